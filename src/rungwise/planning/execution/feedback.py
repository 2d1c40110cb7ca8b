"""Executing a plan with feedback: after each move the actual state is read, and the rest is planned anew.

The planner knows the task's nominal parameters; the world has its own. The state is read without error, at
the ends of moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.execution.remaining_legs import Legs, inputs_of, run_pieces
from rungwise.planning.modes.hands.gaits import cycled, hand_in
from rungwise.planning.modes.reach.planner import reach_in
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.plan import Plan
from rungwise.planning.search.goals import goals_of, with_places
from rungwise.planning.search.layout import Course, is_by_modes, lay_out
from rungwise.planning.search.problem import Work, begin
from rungwise.planning.search.shooting import Search, run_moves, shoot
from rungwise.planning.search.tree import Tree, grow
from rungwise.planning.task.task import task_of
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State
from rungwise.world.find import world_of

COARSE = 1e-2
"""Accuracy with which the rest is planned, as a part of the size of what is moved."""
LOOKS = 2
"""Moves that are made at most, for each that a plan of the task may have."""
REPAIR = Search(population=48, generations=6)
ROUNDS, CYCLED = 12, 24
"""Rounds of a tree that is grown anew; and of one of cycles of a hand, of which most take half a dozen
moves."""


class Moves:
    """The moves (k, d) of a plan that are left in one execution; before: inputs (u,) at its beginning; made
    (j, d): the moves that were laid out last."""

    def __init__(self, plan: Plan, nominal: Predictor, work: Work) -> None:
        """`work` begins where the plan does: a hand and its goals are the same from wherever it goes on."""
        self.before = work.task.before
        self._left, self._nominal = plan.moves, nominal
        self.made = plan.moves[:0]
        self._hand = hand_in(work)
        if self._hand is not None:
            goals_of(work)

    def next(self, work: Work, levels: Reals) -> Course | None:
        """The next move, laid out; of a hand all that lead on; None where there is none."""
        for vectors in self._plans(work, self._left, levels):
            count = 1 if self._hand is None else len(vectors)
            course = lay_out(
                work.moves, work.transit, self._nominal, work.start, vectors[:count], work.seed, levels, True
            )
            if course.segments and not course.blocked and (course.reached or course.outcome in GOES_ON):
                self.made, self._left = np.split(vectors, [len(course.counts)])
                return course
        return None

    def went(self, places: Sequence[Reals]) -> int:
        """After how many of these ends of segments the rest is planned anew: after a whole move."""
        return len(places)

    def _plans(self, work: Work, rest: Reals, levels: Reals) -> Iterator[Reals]:
        """Plans (k, d) from where the world is, as they are found: the rest of the plan if it comes to the
        goal, plans near it where no hand has many joints to vary, and new ones; last those that come nearest
        to the goal."""
        if len(rest):
            trial = run_moves(work.moves, self._nominal, work.start, rest[None], work.whole, levels)
            if trial.reached[0]:
                yield rest[: trial.reached[0]]
            if self._hand is None:
                yield from self._near(work, rest, levels)
        nearest = list[tuple[float, Reals]]()
        for tree, way in self._trees(work, levels, max(2, len(rest))):
            if len(way):
                yield way
            node = int(tree.lack.argmin())
            nearest.append((float(tree.lack[node]), tree.way(node)))
        for _, vectors in sorted(nearest, key=lambda each: each[0]):
            if len(vectors):
                yield vectors

    def _near(self, work: Work, rest: Reals, levels: Reals) -> Iterator[Reals]:
        """Plans near what is left (k, d) that come to the goal."""
        near = shoot(
            work.moves, self._nominal, work.start, len(rest), work.whole, work.rng, REPAIR,
            seeds=rest[None], spread=0.1, before=levels,
        )  # fmt: skip
        for vectors, reached in zip(near.vectors, near.reached, strict=True):
            if reached:
                yield vectors[:reached]

    def _trees(self, work: Work, levels: Reals, most: int) -> Iterator[tuple[Tree, Reals]]:
        """Trees from where the world is, with a plan (k, d) to the goal or (0, d), until the budget is spent
        or one does not grow; one of cycles, where a hand holds the object."""
        if self._hand is not None:
            cycles, way = cycled(work, self._nominal, self._hand, levels, 0, CYCLED)
            if cycles is not None:
                yield cycles, way
        while self._hand is None and work.budget.left:
            tree, way = grow(
                work.moves, self._nominal, work.start, levels, work.whole, most, ROUNDS, work.rng
            )
            yield tree, way
            if len(tree.parent) == 1:
                return


def begun(plan: Plan, budget: Budget, seed: int, threads: int | None) -> Work:
    """The work of the search that found a plan, from where it began: legs by contact modes have fingers, also
    where the task does not name them."""
    work = begin(task_of(plan.scene, plan.parameters), budget, seed, threads)
    work = with_places(work) if reach_in(work) is None else work
    return work.named if is_by_modes(plan.labels) else work


class Replanner:
    """Executes a plan in worlds with other parameters, re-planning at the ends of moves."""

    def __init__(
        self, plan: Plan, stage: Stage, tol: float, threads: int | None = None, time: Budget | None = None
    ) -> None:
        self._plan, self._stage, self._tol, self._threads = plan, stage, tol, threads
        self._time = Budget() if time is None else time
        self._work = begun(plan, self._time.within(None), 0, threads)
        self._task = self._work.task
        accuracy = stage.tol if is_by_modes(plan.labels) else COARSE
        self._nominal = self._work.predictor(Stage(stage.model, accuracy))
        self._steps = world_of(plan.scene).replanning_steps

    def _rest(self) -> Moves | Legs:
        """All that is to be executed."""
        if is_by_modes(self._plan.labels):
            return Legs(self._plan, self._nominal, self._work.start)
        return Moves(self._plan, self._nominal, self._work)

    def execute(
        self, parameters: dict[str, float], errors: dict[str, float], seed: int
    ) -> tuple[Code, tuple[Segment, ...]]:
        """How it ends in the world with these parameters and errors of inputs, and what was executed. Raises
        TimeOver."""
        work = replace(self._work, rng=np.random.default_rng(seed), seed=seed)
        world = Predictor(
            self._plan.scene, self._stage, self._tol, parameters, self._time.within(None), self._threads,
            quick=False, span=self._task.span,
        )  # fmt: skip
        start = State.of(self._plan.scene, parameters=parameters)
        now = Places(start.q[None].copy(), start.v[None].copy(), np.zeros(1), np.zeros((0, 1)))
        rest = self._rest()
        outcome, executed, levels = Code.MISSED, list[Segment](), rest.before
        for look in range(LOOKS * self._task.moves[1]):
            self._time.look()
            budget = self._nominal.budget = self._time.within(self._steps)
            here = replace(work, start=self._read(now, levels), budget=budget, seed=seed + look)
            course = rest.next(here, levels)
            if course is None:
                self._time.look()  # none may have been found because the time is over
                break
            segments = self._disturbed(course.segments, errors)
            outcome, ends, now = run_pieces(world, now, segments)
            count = rest.went([place.q[0] for place in ends])
            if count < len(ends):
                outcome, now, segments = Code.MISSED, ends[count - 1], segments[:count]
            executed += segments
            levels = course.levels if count == len(ends) else inputs_of(course.segments[:count])[-1]
            if outcome not in GOES_ON:
                break
        return outcome, tuple(executed)

    def _read(self, now: Places, levels: Reals) -> Places:
        """The state of the world as the planner takes it over: it knows places and speeds, and where bodies
        touch, deformations, but not the world's parameters."""
        if not len(now.memory):
            return Places(now.q.copy(), now.v.copy(), np.zeros(1), np.zeros((0, 1)))
        return self._nominal.taken_over(now, self._plan.scene, levels)

    def _disturbed(self, segments: tuple[Segment, ...], errors: dict[str, float]) -> list[Segment]:
        """The segments with errors added to their inputs, within the ranges of the parameters."""
        found = []
        for segment in segments:
            values = {}
            for name, value in segment.inputs.items():
                low, high = self._plan.scene.file.parameters[name].range or (-np.inf, np.inf)
                values[name] = float(np.clip(value + errors.get(name, 0.0), low, high))
            found.append(replace(segment, inputs=values))
        return found
