"""Trees over states: moves from states to which earlier moves led, many at a time.

Most moves begin where least of the goal is lacking; they vary the best moves from there, or are drawn evenly.
The others begin at the nodes next to states drawn at random (rapidly exploring trees, LaValle 1998).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.motion.early_stops import best_stops, parts_of, stops_of
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.motion.settle import comes_to_hold, run_to_rest

POPULATION = 96
"""Moves that are run together."""
GREEDY, VARIED = 0.7, 0.7
"""Part of the moves that begin where least is lacking, and part that vary the best move from their node."""
RANK, CHILD = 0.15, 0.5
"""Chance of the best node, and of the best move from it; the others follow geometrically."""
STEPS = (0.01, 0.03, 0.1, 0.3)
"""How far moves are varied."""
KEPT = 0.3
"""Part of a move's numbers that stay where it is varied."""
TINY = 1e-300
"""What is lacking at least where the goal was not reached."""
ROOM = 0.5
"""How far random states lie beyond the tree, as a part of its greatest extent."""
IDLE = 4
"""Rounds in turn in which no move is proposed, after which a tree ends."""


Note: TypeAlias = "Callable[[Reals, Reals, Reals], None]"
"""Is told of moves (m, d) that led from places (m, n) to others, where objects rest."""


@dataclass(frozen=True)
class Tree:
    """N nodes: where they are, the inputs (N, u) there, the node before (N,), the move from there (N, d), how
    many moves it takes (N,), how much of the goal is lacking (N,), and whether it has a memory (N,). The root
    is the first."""

    q: Reals
    v: Reals
    time: Reals
    memory: Reals
    levels: Reals
    parent: Ints
    vectors: Reals
    depth: Ints
    lack: Reals
    known: NDArray[np.bool_]

    def places(self, nodes: Ints) -> Places:
        """Where nodes are; with their memories, if all have one."""
        memory = self.memory[nodes] if self.known[nodes].all() else self.memory[:0]
        return Places(self.q[nodes], self.v[nodes], self.time[nodes], memory)

    def way(self, node: int) -> Reals:
        """The moves (k, d) from the root to a node."""
        found = []
        while node > 0:
            found.append(self.vectors[node])
            node = int(self.parent[node])
        return np.array(found[::-1])

    def ways(self, depth: int, most: int) -> Reals:
        """The plans (r, depth, d) of this many moves that lack least, `most` of them, best first."""
        nodes = np.flatnonzero(self.depth == depth)
        nodes = nodes[np.argsort(self.lack[nodes], kind="stable")][:most]
        return np.array([self.way(int(node)) for node in nodes])

    def least(self, depth: int) -> float:
        """What the best plan of this many moves lacks."""
        return float(self.lack[self.depth == depth].min(initial=np.inf))


Draw: TypeAlias = "Callable[[Moves, Tree, int, np.random.Generator], tuple[Ints, Reals]]"
"""Gives nodes (m,) to go on from, of those with fewer moves than the most, and moves (m, d)."""


def grow(
    moves: Moves, predictor: Predictor, start: Places, before: Reals, aim: Aim, deepest: int, rounds: int,
    rng: np.random.Generator, note: Note | None = None, draw: Draw | None = None,
    planted: Reals | None = None,
) -> tuple[Tree, Reals]:  # fmt: skip
    """A tree from one start, after inputs `before` (u,), with plans of at most `deepest` moves; and the plan
    (k, d) that came to its aim first, (0, d) if none did. `note` is told of all moves that were made; `draw`
    says which moves are run, and from which nodes, where they are not drawn as the module says; the tree
    begins with the moves `planted` (k, d), one after the other, as far as they can be made."""
    tree, idle = _root(moves, start, before, aim), 0
    for vector in () if planted is None else planted:
        last = len(tree.parent) - 1
        tree = _expanded(moves, predictor, tree, np.array([last]), vector[None], aim, note)
        if len(tree.parent) == last + 1 or tree.lack[-1] == 0.0:
            break
    if tree.lack[-1] == 0.0:
        return tree, tree.way(len(tree.parent) - 1)
    for _ in range(rounds):
        parents, vectors = (draw or _draw)(moves, tree, deepest, rng)
        idle = 0 if len(vectors) else idle + 1
        if idle == IDLE:
            break
        vectors = aim.turned(moves, vectors)
        first = len(tree.parent)
        # The root may have no memory: moves that place nothing by hand go on from the memories of the others.
        groups = (
            [parents >= 0]
            if moves.task.carriers and moves.forgets
            else [~tree.known[parents], tree.known[parents]]
        )
        for group in groups:
            tree = _expanded(moves, predictor, tree, parents[group], vectors[group], aim, note)
        reached = first + np.flatnonzero(tree.lack[first:] == 0.0)
        if len(reached):
            return tree, tree.way(int(reached[tree.depth[reached].argmin()]))
        if not predictor.budget.left:
            break
    return tree, np.zeros((0, moves.size))


def _root(moves: Moves, start: Places, before: Reals, aim: Aim) -> Tree:
    zero, known = np.zeros(1, np.int64), len(start.memory) > 0
    return Tree(
        q=start.q, v=start.v, time=start.time, memory=start.memory if known else np.zeros((1, 0)),
        levels=before[None].copy(),
        parent=zero - 1, vectors=np.zeros((1, moves.size)), depth=zero,
        lack=np.maximum(aim.lack(start), TINY), known=np.array([known]),
    )  # fmt: skip


def _draw(moves: Moves, tree: Tree, deepest: int, rng: np.random.Generator) -> tuple[Ints, Reals]:
    """Nodes (m,) to go on from, and moves (m, d)."""
    m = POPULATION
    inner = np.flatnonzero(tree.depth < deepest)
    ranked = inner[np.argsort(tree.lack[inner], kind="stable")]
    parents = ranked[np.minimum(rng.geometric(RANK, size=m) - 1, len(ranked) - 1)]
    explores = np.flatnonzero(rng.random(m) > GREEDY)
    parents[explores] = inner[_nearest(moves, tree.q[inner], len(explores), rng)]
    vectors = rng.random((m, moves.size))
    for k in np.flatnonzero(rng.random(m) < VARIED):
        children = np.flatnonzero(tree.parent == parents[k])
        if len(children):
            ranks = np.argsort(tree.lack[children], kind="stable")
            best = children[ranks[min(int(rng.geometric(CHILD)) - 1, len(ranks) - 1)]]
            vectors[k] = _varied(moves, tree.vectors[best], rng)
    return parents, vectors


def _nearest(moves: Moves, q: Reals, count: int, rng: np.random.Generator) -> Ints:
    """The rows of q (N, n) next to `count` random states."""
    columns = np.flatnonzero(moves.task.weights)
    scaled = q[:, columns] * moves.task.weights[columns]
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    room = ROOM * float((high - low).max(initial=0.0))
    samples = rng.uniform(low - room, high + room, (count, len(columns)))
    away = ((samples[:, None] - scaled[None]) ** 2).sum(axis=-1)
    return np.asarray(away.argmin(axis=1))


def _varied(moves: Moves, vector: Reals, rng: np.random.Generator) -> Reals:
    steps = rng.choice(STEPS) * rng.standard_normal(len(vector))
    trial = vector + np.where(rng.random(len(vector)) < KEPT, 0.0, steps)
    return np.where(moves.periodic, np.mod(trial, 1.0), np.clip(trial, 0.0, 1.0))


def _expanded(
    moves: Moves, predictor: Predictor, tree: Tree, parents: Ints, vectors: Reals, aim: Aim,
    note: Note | None,
) -> Tree:  # fmt: skip
    """The tree with the ends of these moves; at their aim nothing is lacking."""
    if not len(parents):
        return tree
    parts = parts_of(moves, predictor)
    begun, fits = moves.begin(vectors, tree.places(parents))
    segments = moves.segments_of(vectors, begun, tree.levels[parents], parts)
    fits &= moves.task.allows(segments.levels).all(axis=1)
    rows = np.flatnonzero(fits)
    if not len(rows):
        return tree
    segments, vectors, parents = segments.take(fits), vectors[rows], parents[rows]
    ends, levels, *_ = run_to_rest(moves, predictor, begun.take(rows), segments)
    goal = ends.outcome == Code.GOAL
    on = goal | np.isin(ends.outcome, GOES_ON)
    lacks = np.full(len(rows), np.inf)
    lacks[on] = _lacking(aim, ends.places.take(np.flatnonzero(on)))
    lacks[goal] = 0.0
    kept = np.flatnonzero(on)
    if note is not None:
        rested_ = np.flatnonzero(on & ~goal)
        note(vectors[rested_], tree.q[parents[rested_]], ends.places.q[rested_])
    tree = _with(tree, ends.places.take(kept), levels[kept], parents[kept], vectors[kept], lacks[kept])
    if parts == 1:
        return tree
    stops = stops_of(moves, vectors, segments, ends, parts)
    if note is not None:
        note(stops.vectors, tree.q[parents[stops.rows]], stops.places.q)
    best, own = best_stops(aim, stops, lacks)
    if not aim.partial:
        holds = comes_to_hold(moves, predictor, best.places, levels[best.rows])
        own = np.where(holds, 0.0, np.maximum(own, TINY))
    return _with(tree, best.places, levels[best.rows], parents[best.rows], best.vectors, own)


def _lacking(aim: Aim, places: Places) -> Reals:
    """What plans that did not come to the goal lack (m,)."""
    lacks = aim.lack(places)
    return lacks if aim.partial else np.maximum(lacks, TINY)


def _with(tree: Tree, places: Places, levels: Reals, parents: Ints, vectors: Reals, lacks: Reals) -> Tree:
    """The tree with more nodes."""
    known, depth = np.ones(len(parents), bool), tree.depth[parents] + 1
    return _joined(tree, *places, levels, parents, vectors, depth, lacks, known)


def _joined(tree: Tree, *more: NDArray[Any]) -> Tree:
    """The tree with the fields of more nodes."""
    if tree.memory.shape[1:] != more[3].shape[1:]:  # the root was placed by hand
        tree = replace(tree, memory=np.zeros((len(tree.parent), *more[3].shape[1:]), more[3].dtype))
    names = tuple(Tree.__dataclass_fields__)
    return Tree(*(np.concatenate([getattr(tree, name), new]) for name, new in zip(names, more, strict=True)))
