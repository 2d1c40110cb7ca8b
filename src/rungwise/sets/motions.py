"""Sets of a model that has several motions: by the slowest, by some and by all admissible motions.

On a kinematic or quasistatic rung an object that must move may move in many ways. The extreme motions go as
fast as contacts allow along one coordinate, either way, until something stops them. A point is possible if
its slowest motion or one of the extremes reaches the goal, guaranteed if all these motions do. So a point
labelled possible is possible: a run proves it; and a point labelled not guaranteed is not guaranteed. The
converse holds where the object has one free coordinate, since then every motion lies between the two
extremes; with more free coordinates, a motion that changes its direction on the way may do what no extreme
does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.simulation.result import Run
from rungwise.world.batch import Batch, Results
from rungwise.world.find import world_of
from rungwise.world.run import finished, simulation_of

SLOWEST, POSSIBLE, GUARANTEED = "slowest", "possible", "guaranteed"
SOLUTIONS = (SLOWEST, POSSIBLE, GUARANTEED)
HASTE = 1e3
"""Speed of an extreme motion in multiples of the pace (see `Simulation`): events that it meets on its way
come early by one part in so many."""
Motion = Mapping[str, float]


def motions(scene: AnyScene, model: Rung, solutions: str = POSSIBLE) -> tuple[Motion, ...]:
    """The slowest motion and, for a model that has other motions, the extremes: both ways along each
    coordinate of a body that nothing drives."""
    if solutions == SLOWEST or model.inertia > 0.0:
        return ({},)
    world = world_of(scene)
    if not world.many_motions:
        raise SceneError(f"solutions: of {scene.name} only the {SLOWEST} motion is known")
    return ({}, *({name: sign * HASTE} for name in world.at_liberty for sign in (-1.0, 1.0)))


class Motions:
    """A batch of runs that takes every motion in turn, as long as the point is not decided."""

    def __init__(
        self, scene: AnyScene, model: Rung, over: Sequence[str], solutions: str, **options: Any
    ) -> None:
        self._wanted = solutions == GUARANTEED
        self._batches: list[Batch] = []
        for motion in motions(scene, model, solutions):
            self._batches.append(Batch(scene, model, over, motion=motion, **options))
            self._batches[-1].proves = False  # what a proof tells has the same label
        self.over = self._batches[0].over

    def run(
        self, points: Reals, *, deadline: Deadline = NEVER, on_progress: Callable[[int], None] | None = None
    ) -> Results:
        """Run the points as `Batch.run` does; all that one motion leaves open when the deadline has come is
        `running`. Margins are the greatest (possible) or least (guaranteed) of the margins known."""
        found = self._batches[0].run(points, limit=deadline.seconds, on_progress=on_progress)
        for batch in self._batches[1:]:
            done = ~np.isin(found.outcome, (Code.INVALID, Code.RUNNING))
            at = np.flatnonzero(done & ((found.outcome == Code.GOAL) == self._wanted))
            if len(at):
                told = None if on_progress is None else lambda _: on_progress(len(points))
                other = batch.run(points[at], limit=deadline.seconds, on_progress=told)
                _merge(found, at, other, self._wanted)
        return found


def _merge(found: Results, at: NDArray[np.intp], other: Results, wanted: bool) -> None:
    """Replace runs that another motion decides otherwise; else keep the run, with the margin nearer to that
    decision."""
    margin = found.margin[at]
    nearer = np.fmin(margin, other.margin) if wanted else np.fmax(margin, other.margin)
    changed = ((other.outcome == Code.GOAL) != wanted) | (other.outcome == Code.RUNNING)
    for field in fields(Results):
        values = getattr(found, field.name)
        values[at[changed]] = getattr(other, field.name)[changed]
    found.margin[at[~changed]] = nearer[~changed]


def decisive(scene: AnyScene, model: Rung, solutions: str, deadline: Deadline, **options: Any) -> Run:
    """The run that decides a point: the first that reaches the goal (possible) or does not (guaranteed), or
    else the slowest. A run that the deadline ends decides nothing, and is returned as far as it has come."""
    first: Run | None = None
    for motion in motions(scene, model, solutions):
        simulation = simulation_of(scene, model, motion=motion or None, **options)
        run: Run = finished(simulation, None, deadline)
        first = first or run
        is_decided = (run.outcome.code == Code.GOAL) != (solutions == GUARANTEED)
        if is_decided or run.outcome.code == Code.RUNNING:
            return run
    assert first is not None
    return first
