"""Steering: inputs are changed as the motions that nearby inputs were seen to make say, in a trust region.

About the inputs at a node of a tree a few moves with inputs nearby are run. An affine model is fitted to
where the objects come: the derivative of the end of a move by its inputs, smoothed over the contacts that
these inputs close and open (randomized smoothing: Suh, Pang and Tedrake, 2022, arXiv 2109.05143; planning
with it: Pang, Suh, Yang and Tedrake, 2023, arXiv 2206.10787). Bounded least squares of the model give the
inputs that come nearest to the goal, within several radii about those at the node; they are run like any
other move, and their ends are nodes about which steering goes on. Where nothing was fitted yet, a model by
the derivative of one step proposes moves, too (`derived`); everywhere it would lead trees too greedily into
dead ends, from which fingers have to grasp anew. The other moves let go and grasp anew:
some of the inputs are drawn anew, go back to where they were before, or repeat a move that led nearer to
the goal.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from rungwise.kernel import Ints, Reals
from rungwise.planning.motion.moves import Moves
from rungwise.planning.search.derived import HELD, Derived
from rungwise.planning.search.tree import Tree
from rungwise.planning.task.task import Task

STEERED, PROBES, EXTRA = 2, 20, 2
"""Nodes about which a round steers; moves that are run about one at most, and how many more than inputs."""
SPREAD, FITTED = 0.06, 0.2
"""Spread of inputs about a node, in parts of their ranges, and how far off moves still enter its model."""
RADII = (0.03, 0.06, 0.12, 0.25)
"""Radii of the trust regions, in the same parts."""
DAMPING = 1e-2
"""Weight of the size of a change, beside the model's greatest singular value."""
GRASPS = 24
"""Moves of a round that grasp anew."""
RANK = 0.3
"""Chance of the best node to be one from which a move grasps anew; the others follow geometrically."""


class Steering:
    """Moves of a task whose inputs no carrier uses, that steer its objects to places (g, n) at the goal."""

    def __init__(self, task: Task, goals: Reals, derived: Derived | None) -> None:
        self._task, self._goals, self._derived = task, goals, derived
        self._tries = Counter[int]()

    def __call__(
        self, _moves: Moves, tree: Tree, deepest: int, rng: np.random.Generator
    ) -> tuple[Ints, Reals]:
        """Nodes (m,) to go on from, and moves (m, d)."""
        inner = np.flatnonzero(tree.depth < deepest)
        parents, vectors = list[Ints](), list[Reals]()
        for node in self._chosen(tree, inner, rng):
            rows = self._about(tree, node, rng)
            self._tries[node] += 1
            parents.append(np.full(len(rows), node, np.int64))
            vectors.append(rows)
        ranked = inner[np.argsort(tree.lack[inner], kind="stable")]
        nodes = ranked[np.minimum(rng.geometric(RANK, size=GRASPS) - 1, len(ranked) - 1)]
        parents.append(nodes)
        vectors.append(np.array([self._grasp(tree, int(node), rng) for node in nodes]))
        return np.concatenate(parents).astype(np.int64), np.vstack(vectors)

    def _chosen(self, tree: Tree, inner: Ints, rng: np.random.Generator) -> list[int]:
        """Nodes to steer from: little is lacking, and steering did not often begin there."""
        tries = np.array([self._tries[int(node)] for node in inner])
        weighed = tree.lack[inner] * (1.0 + tries) * rng.uniform(1.0, 1.5, len(inner))
        return [int(node) for node in inner[np.argsort(weighed, kind="stable")[:STEERED]]]

    def _foreseen(self, tree: Tree, node: int, rng: np.random.Generator) -> Reals:
        """Moves (m, d) that the derivative of a step proposes where steering begins, none elsewhere; none
        where inputs move no object."""
        held, model = self._held(tree, node), None
        if self._derived is not None and not self._tries[node]:
            model = self._derived.model(tree.q[node], float(tree.time[node]), tree.levels[node])
        if model is None or not model.any():
            return np.zeros((0, len(held)))
        return self._steps(tree, node, held, (np.zeros(model.shape[1]), model), rng)

    def _about(self, tree: Tree, node: int, rng: np.random.Generator) -> Reals:
        """Moves (m, d) from a node: those that a model proposes where enough is known, else such as tell and
        those of a derivative; the model of the node before where steering has not yet begun here."""
        held, size = self._held(tree, node), len(self._task.free)
        enough = min(size + EXTRA, PROBES)
        for source in (node, int(tree.parent[node])) if not self._tries[node] else (node,):
            own = self._held(tree, source) if source >= 0 else held
            near = self._near(tree, source, own) if source >= 0 else np.zeros(0, np.int64)
            if len(near) > enough // 2:
                model = fitted(
                    tree.vectors[near, :size] - own[:size], self._task.off(tree.q[near], tree.q[source])
                )
                middle = model[0] if source == node else np.zeros_like(model[0])
                return self._steps(tree, node, held, (middle, model[1]), rng)
        rows = np.repeat(held[None], enough, axis=0)
        rows[1:, :size] += SPREAD * rng.standard_normal((enough - 1, size))
        return np.vstack([self._foreseen(tree, node, rng), np.clip(rows, 0.0, 1.0)])

    def _held(self, tree: Tree, node: int) -> Reals:
        """The move (d,) that holds the inputs at a node, for a middle duration."""
        free = self._task.free
        low, high = self._task.low[free], self._task.high[free]
        span = np.where(high > low, high - low, 1.0)
        return np.append(np.clip((tree.levels[node, free] - low) / span, 0.0, 1.0), HELD)

    def _near(self, tree: Tree, node: int, held: Reals) -> Ints:
        """Nodes to which moves with inputs nearby led from a node."""
        children = np.flatnonzero(tree.parent == node)
        off = np.abs(tree.vectors[children] - held)[:, :-1].max(axis=1, initial=0.0)
        found: Ints = children[off <= FITTED]
        return found

    def _steps(
        self, tree: Tree, node: int, held: Reals, model: tuple[Reals, Reals], rng: np.random.Generator
    ) -> Reals:
        """The moves that a model proposes at a node, one for each radius."""
        place, size = tree.q[node], len(held) - 1
        goal = self._goals[int(self._task.away(self._goals, place).argmin())]
        wanted = self._task.off(goal[None], place)[0] - model[0]
        found = np.array([nearest_change(model[1], wanted, held[:size], radius) for radius in RADII])
        found += 0.1 * np.array(RADII)[:, None] * rng.standard_normal(found.shape)
        rows = np.repeat(held[None], len(found), axis=0)
        rows[:, :size] += found
        return np.clip(rows, 0.0, 1.0)

    def _grasp(self, tree: Tree, node: int, rng: np.random.Generator) -> Reals:
        """A move (d,) from a node with which robots may let go and grasp anew."""
        held = self._held(tree, node)
        kind, some = rng.random(), rng.random(len(held)) < rng.choice([0.25, 0.5, 1.0])
        if kind < 0.5 or len(tree.parent) == 1:
            drawn = rng.random(len(held))
        elif kind < 0.75:
            drawn = tree.vectors[_of_way(tree, node, rng)]
        else:
            better = np.flatnonzero(tree.lack < tree.lack[np.maximum(tree.parent, 0)])
            drawn = tree.vectors[int(rng.choice(better))] if len(better) else rng.random(len(held))
            some[:] = True
        return np.where(some, drawn, held)


def _of_way(tree: Tree, node: int, rng: np.random.Generator) -> int:
    """A node on the way to this one."""
    way = [node]
    while tree.parent[way[-1]] > 0:
        way.append(int(tree.parent[way[-1]]))
    return int(rng.choice(way))


def fitted(changes: Reals, ends: Reals) -> tuple[Reals, Reals]:
    """The affine model of ends (m, n) over changes of inputs (m, u): where no change leads (n,), and slopes
    (u, n)."""
    rows = np.column_stack([np.ones(len(changes)), changes / SPREAD])
    damping = 1e-2 * len(rows) * np.eye(rows.shape[1])
    damping[0, 0] *= 1e-2
    found = np.linalg.solve(rows.T @ rows + damping, rows.T @ ends)
    middle: Reals = found[0]
    return middle, np.asarray(found[1:] / SPREAD)


def nearest_change(model: Reals, wanted: Reals, at: Reals, radius: float) -> Reals:
    """The change of inputs (u,) within a radius, and with inputs `at` in 0..1, by which a linear model (u, n)
    comes nearest to what is wanted (n,)."""
    damping = DAMPING * float(np.linalg.norm(model, 2)) + 1e-12
    matrix = np.vstack([model.T, damping * np.eye(len(model))])
    low, high = np.maximum(-radius, -at), np.minimum(radius, 1.0 - at)
    fits: NDArray[np.bool_] = high - low > 1e-9
    found = np.zeros(len(model))
    if fits.any():
        right = np.concatenate([wanted, np.zeros(len(model))])
        found[fits] = lsq_linear(matrix[:, fits], right, (low[fits], high[fits])).x
    return found
