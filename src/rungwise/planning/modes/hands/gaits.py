"""Plans of cycles of a hand, found in trees: each cycle is proposed from where the object really is, and run
move by move; what lacks least is gone on from."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.hands.cycles import Cycles, inputs
from rungwise.planning.modes.hands.hand import Hand, hand_of
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.placements import placed_part
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import Found, Work, laid
from rungwise.planning.search.tree import Tree, grow
from rungwise.planning.task.task import Task
from rungwise.world.find import world_of

ABREAST, EACH = 6, 3
"""Cycles that are run together, and that are proposed from one node at a time."""
LASTS = (0.0, 0.4)
"""How long moves are held, as the number of their duration, at least and at most."""
ROUNDS = 120
"""Moves that follow each other in a tree."""
HAND, TREES_BY_HAND = "hand", "trees by hand"
"""By which the hand, and the number of the last tree, are kept for all stages."""


def hand_in(work: Work) -> Hand | None:
    """The hand of a task whose goal speaks of places, sought once; None where there is none."""
    if HAND not in work.kept:
        asks = placed_part(work.task.scene.file.goal or "") is not None
        work.kept[HAND] = hand_of(work.task) if asks else None
    found: Hand | None = work.kept[HAND]
    return found


def by_hand(work: Work, predictor: Predictor, hand: Hand, planted: Reals | None = None) -> Found | None:
    """A plan of cycles by one more tree, which begins with moves (k, d) if they are given. Raises
    TimeOver."""
    number = work.kept[TREES_BY_HAND] = work.kept.get(TREES_BY_HAND, -1) + 1
    _, way = cycled(work, predictor, hand, work.task.before, number, planted=planted)
    if not len(way):
        return None
    course = laid(work, predictor, way)
    if course.reached:
        return Found(course, way[: len(course.counts)])
    work.unlaid += 1
    return None


def cycled(
    work: Work, predictor: Predictor, hand: Hand, levels: Reals, number: int, rounds: int = ROUNDS,
    planted: Reals | None = None,
) -> tuple[Tree | None, Reals]:  # fmt: skip
    """The tree of cycles of this number from where the work starts, after inputs `levels` (u,), that begins
    with the moves `planted` (k, d); None where no place at the goal is known. And its moves (k, d) to the
    goal, (0, d) if there are none. Raises TimeOver."""
    if not len(goals_of(work)):
        return None, np.zeros((0, work.moves.size))
    gaits, rng = Gaits(work.task, hand, goals_of(work)), np.random.default_rng([work.seed, number])
    try:
        gaits.tree, way = grow(
            work.moves, predictor, work.start, levels, work.whole, work.task.moves[1], rounds, rng, None,
            gaits, planted,
        )  # fmt: skip
    finally:
        work.failures.update(gaits.refused)
        if gaits.tree is not None:
            best = int(gaits.tree.lack.argmin())
            work.came_near(float(gaits.tree.lack[best]), gaits.tree.q[best])
    return gaits.tree, way


@dataclass
class Running:
    """A cycle that is run: the node to go on from, the moves that are left (r, d), and the key of the one
    that was proposed last."""

    node: int
    left: list[Reals]
    key: bytes = b""


class Gaits:
    """Moves of a task by which a hand turns an object to places (g, n) at the goal. tree: the last that asked
    for moves."""

    tree: Tree | None = None

    def __init__(self, task: Task, hand: Hand, goals: Reals) -> None:
        self._task, self._hand, self._goals = task, hand, goals
        self._cycles: Cycles | None = None
        self._running = list[Running]()
        self._seen = 0
        self._tries = dict[int, int]()

    @property
    def refused(self) -> Counter[str]:
        """How often, and why, nothing came of fingers that were to touch the object."""
        return Counter() if self._cycles is None else self._cycles.refused

    def __call__(
        self, moves: Moves, tree: Tree, deepest: int, rng: np.random.Generator
    ) -> tuple[Ints, Reals]:
        """Nodes (m,) to go on from, and moves (m, d)."""
        self.tree = tree
        if self._cycles is None:
            home = world_of(self._task.scene).at(self._task.parameters).q
            self._cycles = Cycles(self._hand, home)
        self._go_on(tree, deepest)
        inner = np.flatnonzero(tree.depth < deepest - 1)
        for _ in range(ABREAST):
            if len(self._running) >= ABREAST or not len(inner):
                break
            self._begin(moves, tree, self._chosen(tree, inner, rng), rng)
        nodes, vectors = list[int](), list[Reals]()
        for own in self._running:
            own.key = own.left[0].tobytes()
            nodes.append(own.node)
            vectors.append(own.left[0])
        return np.array(nodes, np.int64), np.array(vectors).reshape(-1, moves.size)

    def _go_on(self, tree: Tree, deepest: int) -> None:
        """Find the nodes to which the last moves led; cycles that led to none, or are over, are left."""
        ends = {
            (int(tree.parent[node]), tree.vectors[node].tobytes()): node
            for node in range(self._seen, len(tree.parent))
        }
        self._seen = len(tree.parent)
        going = list[Running]()
        for own in self._running:
            node = ends.get((own.node, own.key))
            if node is not None and len(own.left) > 1 and tree.depth[node] < deepest:
                going.append(Running(node, own.left[1:]))
        self._running = going

    def _chosen(self, tree: Tree, inner: Ints, rng: np.random.Generator) -> int:
        """A node to go on from: little is lacking, and it was not often chosen."""
        tries = np.array([self._tries.get(int(node), 0) for node in inner])
        weighed = tree.lack[inner] * (1.0 + tries) * rng.uniform(1.0, 1.5, len(inner))
        node = int(inner[weighed.argmin()])
        self._tries[node] = self._tries.get(node, 0) + 1
        return node

    def _begin(self, moves: Moves, tree: Tree, node: int, rng: np.random.Generator) -> None:
        """Cycles from a node."""
        assert self._cycles is not None
        q = tree.q[node]
        goal = self._goals[int(self._task.away(self._goals, q).argmin())]
        levels = tree.levels[node]
        for cycle in self._cycles.proposals(q, goal, EACH, rng):
            rows = np.array([inputs(self._hand, levels, joints) for joints in cycle])
            vectors = moves.held_for(rows, np.zeros(len(rows)))
            vectors[:, -1] = rng.uniform(*LASTS)
            self._running.append(Running(node, list(vectors)))
