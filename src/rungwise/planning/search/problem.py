"""What all stages of one planning share: the task, its moves, the budget, where it starts; plans laid out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.placements import GOALS, NEAREST, Placing
from rungwise.planning.motion.propagate import Places, Predictor
from rungwise.planning.motion.transit import Transit
from rungwise.planning.search.derived import Derived
from rungwise.planning.search.layout import Course, lay_out
from rungwise.planning.search.push_effects import Pushes
from rungwise.planning.task.fingers import with_fingers
from rungwise.planning.task.reserve import guarded_scene
from rungwise.planning.task.task import Task
from rungwise.scene.language.lasting import names_in
from rungwise.simulation.state import State
from rungwise.world.carriers import TaskError
from rungwise.world.contract import OBJECT, SOLIDS
from rungwise.world.find import world_of
from rungwise.world.margins import Question

TREES, LEGS = "trees", "legs"
"""What is counted of trees of contact modes."""
LEAST = 1e-9
"""What plans lack that counts as lacking something."""


class Found(NamedTuple):
    """A course that comes to the goal, and its moves (k, d)."""

    course: Course
    vectors: Reals


class Group(NamedTuple):
    """Parts of the goal (r,) that speak of the same objects, and these."""

    parts: Ints
    bodies: tuple[str, ...]


@dataclass
class Work:
    """What all stages of one planning share. nearest: what the best plan so far lacks; nearest_at: where
    it ends (n,); foreseen, foreseen_at: the same of places in trees of contact modes, which no run may have
    reached; was_there: whether a plan came to what the goal asks for and did not hold it; unlaid:
    plans that came to the goal where robots were placed by hand, and not when they were laid out; trees:
    how many were grown on each stage; seen: what pushes did on each; path (p, n): places on the way of
    the object, if some are given; grown: trees of contact modes, and the legs in them; failures: why
    proposals by contact modes, or of a hand, came to nothing; kept: what searches keep for when they
    go on."""

    task: Task
    moves: Moves
    transit: Transit
    question: Question
    budget: Budget
    start: Places
    size: float
    threads: int | None
    rng: np.random.Generator
    seed: int
    nearest: float = np.inf
    nearest_at: Reals | None = None
    foreseen: float = np.inf
    foreseen_at: Reals | None = None
    was_there: bool = False
    unlaid: int = 0
    trees: Counter[str] = field(default_factory=Counter)
    seen: dict[str, Pushes] = field(default_factory=dict)
    path: Reals = field(default_factory=lambda: np.zeros((0, 0)))
    grown: Counter[str] = field(default_factory=Counter)
    failures: Counter[str] = field(default_factory=Counter)
    kept: dict[str, Any] = field(default_factory=dict)

    def pushes(self, stage: Stage) -> Pushes:
        """What pushes were seen to do on a stage."""
        return self.seen.setdefault(str(stage), Pushes(self.task))

    @cached_property
    def named(self) -> Work:
        """The same, where the task names the fingers that it has without saying so (see `with_fingers`)."""
        task = with_fingers(self.task)
        if task is self.task:
            return self
        moves = _moves_of(task)
        return replace(self, task=task, moves=moves, transit=moves.transit)

    @cached_property
    def goals(self) -> Reals:
        """Places (g, n) at the goal, the nearest first, as far as places decide it."""
        placing = Placing(self.task, self.task.search, self.start.q[0])
        if not placing.asks or placing.room.bound:
            return self.start.q[:0]
        rng = np.random.default_rng(self.seed)
        return placing.goals(rng, self.budget.is_in_time, count=GOALS).places[:NEAREST]

    @cached_property
    def derived(self) -> Derived:
        """Models of moves by derivatives."""
        return Derived(self.task)

    def predictor(self, stage: Stage, *, reserve: bool = True, quick: bool = True) -> Predictor:
        """Runs on a stage; without the reserve, of the goal as it is given; quick ones end where they take
        long."""
        scene = self.task.search if reserve else guarded_scene(self.task.scene)
        return Predictor(
            scene, stage, stage.tol * self.size, self.task.parameters, self.budget, self.threads,
            quick=quick, span=self.task.span,
        )  # fmt: skip

    def came_near(self, lack: float, q: Reals) -> None:
        """Remember how near a plan came to the whole goal, and where it ended (n,)."""
        self.was_there |= lack <= LEAST
        if LEAST < lack < self.nearest:
            self.nearest, self.nearest_at = lack, q.copy()

    def foresee(self, lack: float, q: Reals) -> None:
        """Remember how near a tree of contact modes came to what the goal says of places, and where (n,)."""
        if lack < self.foreseen:
            self.foreseen, self.foreseen_at = lack, q.copy()

    def lack(self, places: Places) -> Reals:
        """How much of the goal plans lack at their ends (m,)."""
        return np.asarray(self._lacks(places).sum(axis=1))

    @property
    def whole(self) -> Aim:
        """The goal."""
        return Aim(self.lack)

    def part(self, parts: Ints, bodies: tuple[str, ...]) -> Aim:
        """Some parts (r,) of the goal, by pushes at these bodies."""
        return Aim(lambda places: self._lacks(places)[:, parts].sum(axis=1), bodies, partial=True)

    def _lacks(self, places: Places) -> Reals:
        """How much of each part of the goal plans lack at their ends (m, p)."""
        rows = np.hstack([places.q, places.v])
        known = np.isfinite(rows).all(axis=1)
        lacks = np.full((len(rows), len(self.question.parts)), np.inf)
        if known.any():
            lacks[known] = self.question.ask(rows[known]).lacks
        return lacks

    @cached_property
    def groups(self) -> tuple[list[Group], list[Group]]:
        """The parts of the goal that lack something at the start, and those that do not, by the objects of
        which they speak; parts that name an object in common are one group."""
        names = {
            name
            for name, role in world_of(self.task.scene).roles(self.task.parameters).items()
            if role == OBJECT
        }
        groups = list[tuple[set[int], set[str]]]()
        for number, texts in enumerate(self.question.parts):
            parts, bodies = {number}, set().union(*(names_in(text) & names for text in texts))
            if bodies:
                shared = [group for group in groups if group[1] & bodies]
                groups = [group for group in groups if not group[1] & bodies]
                groups.append((parts.union(*(g[0] for g in shared)), bodies.union(*(g[1] for g in shared))))
        lacks = self._lacks(self.start)[0]
        found = [Group(np.array(sorted(parts)), tuple(sorted(bodies))) for parts, bodies in groups]
        lacking = [bool(lacks[group.parts].sum() > 0.0) for group in found]
        open_ = [group for group, lacks_it in zip(found, lacking, strict=True) if lacks_it]
        return open_, [group for group in found if not any(group is other for other in open_)]

    def away(self, aim: Reals) -> Callable[[Places], Reals]:
        """Distances (m,) from a place of the objects."""
        return lambda places: self.task.away(places.q, aim)


def begin(task: Task, budget: Budget, seed: int, threads: int | None) -> Work:
    """Where planning starts. Raises TaskError where bodies overlap at the start."""
    moves = _moves_of(task)
    start = State.of(task.scene, parameters=task.parameters)
    overlap = moves.question.overlap(start)
    if overlap:
        raise TaskError(f"start: {overlap}; change the parameters of the start")
    return Work(
        task=task, moves=moves, transit=moves.transit,
        question=Question(task.search, "goal", task.parameters, now=True), budget=budget,
        start=Places(start.q[None].copy(), start.v[None].copy(), np.zeros(1), np.zeros((0, 1))),
        path=np.zeros((0, start.q.size)), size=task.size, threads=threads,
        rng=np.random.default_rng(seed), seed=seed,
    )  # fmt: skip


def _moves_of(task: Task) -> Moves:
    """Moves of a task."""
    if world_of(task.scene).shapes == SOLIDS and task.carriers:
        from rungwise.planning.motion.joint_transit import SpaceMoves

        return SpaceMoves(task)
    return Moves(task)


def known(work: Work) -> str:
    """What is known where nothing was found."""
    outcomes = work.budget.outcomes
    parts = ", ".join(f"{name} {count / outcomes.total():.0%}" for name, count in outcomes.most_common(4))
    ended = f"{work.budget.ended}; " if work.budget.ended else ""
    unlaid = (
        f"; {work.unlaid} reached the goal, but not with paths between their moves" if work.unlaid else ""
    )
    most = ", ".join(f"{why} {count}" for why, count in work.failures.most_common(4))
    failed = f"; most proposals failed for these reasons: {most}" if most else ""
    trees = f"; contact modes: {work.grown[TREES]} trees of {work.grown[LEGS]} legs" if work.grown else ""
    tried = f"moves tried: {outcomes.total()} ({parts or 'none'}){trees}"
    why = ", ".join(f"{why}: {count}" for why, count in work.derived.refused.most_common(2))
    steered = f"; steered without derivatives for these reasons: {why}" if why else ""
    return f"{ended}{tried}{_nearest(work)}{unlaid}{failed}{steered}"


def _nearest(work: Work) -> str:
    """How near plans came to the goal, and where; or that none came nearer than the start."""
    if work.was_there and work.task.lasting:
        return f"; plans reached the goal, but did not hold it for {work.task.lasting:g}"
    begun = float(work.lack(work.start)[0])
    if work.nearest_at is None or work.nearest > begun - LEAST:
        lacks = f", which misses it by {begun:.3g}" if LEAST < begun < np.inf else ""
        return f"; no plan ended nearer to the goal than the start{lacks}{_foreseen(work, begun)}"
    at = _objects_at(work, work.nearest_at)
    come = f"; the nearest plan misses the goal by {work.nearest:.3g}{at and f', with {at}'}"
    return come + _foreseen(work, work.nearest)


def _foreseen(work: Work, lack: float) -> str:
    """How near trees of contact modes came, whose legs were not run; empty where runs, or the start, lack no
    more than they."""
    if work.foreseen_at is None or not LEAST < work.foreseen < lack - LEAST:
        return ""
    at = _objects_at(work, work.foreseen_at)
    return f"; the nearest place in trees of contact modes misses it by {work.foreseen:.3g}, with {at}"


def _objects_at(work: Work, q: Reals) -> str:
    """Coordinates of the objects of which the goal speaks, at q (n,)."""
    bodies = {name for groups in work.groups for group in groups for name in group.bodies}
    names = work.task.scene.template.coordinates
    return ", ".join(
        f"{name} = {value:.4g}"
        for name, value in zip(names, q.tolist(), strict=False)
        if name.partition(".")[0] in bodies
    )


def laid(work: Work, predictor: Predictor, vectors: Reals) -> Course:
    return lay_out(work.moves, work.transit, predictor, work.start, vectors, work.seed)
