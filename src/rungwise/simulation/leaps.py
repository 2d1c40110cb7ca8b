"""Targets of servos that jump: the kinematic rung follows them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rungwise.scene import Scene
from rungwise.scene.expression import STACK
from rungwise.scene.numbers import evaluate_numbers
from rungwise.scene.records import SERVO
from rungwise.scene.scene import Bound
from rungwise.simulation.planar.workspace import Workspace, time_slot
from rungwise.system.planar.terms import target

HALVINGS = 60
"""Halvings that reduce a span of time to rounding."""


@dataclass(frozen=True)
class Leap:
    """A servo's target moves by `far` in no time, at `time`; `coordinate` is its name."""

    coordinate: str
    far: float
    time: float

    def __str__(self) -> str:
        body, coordinate = self.coordinate.split(".")
        return (
            f"bodies.{body}.coordinates.{coordinate}.drive: its target is {self.far:.3g} away from"
            f" t = {self.time:.6g} on, and the kinematic rung follows it at once, through what is in the way."
            " Start at the target, let it move with t, or use a richer rung."
        )


def leap_taken(scene: Scene, bound: Bound, workspace: Workspace, least: float) -> Leap | None:
    """The leap beyond `least`, a length, in the step in which a servo moved something farthest, if there is
    one.

    Angles count by the levers of their coordinates.
    """
    clock = workspace.state.clock[0]
    if not clock["leap"]:
        return None
    i, moved, end = int(clock["leaper"]), float(clock["leap"]), float(clock["leap_time"])
    if abs(moved) * bound.records.coordinates["lever"][i] <= least:
        return None
    begin, place = end - float(clock["leap_step"]), _target(scene, bound, workspace, i, end) - moved
    return _leap(scene, bound, workspace, i, place, begin, end, least)


def leap_ahead(scene: Scene, bound: Bound, workspace: Workspace, least: float, span: float) -> Leap | None:
    """The leap beyond `least` that a servo would have to take within so long a time, if any."""
    state = workspace.state
    now = float(state.clock[0]["time"])
    for i in range(len(state.q)):
        if state.prescribed[i] and bound.records.coordinates["drive"][i] == SERVO:
            found = _leap(scene, bound, workspace, i, float(state.q[i]), now, now + span, least)
            if found is not None:
                return found
    return None


def _leap(
    scene: Scene,
    bound: Bound,
    workspace: Workspace,
    i: int,
    place: float,
    begin: float,
    end: float,
    least: float,
) -> Leap | None:
    """Halve the time towards where the target of coordinate i, followed from `place`, moves most."""

    def wanted(time: float) -> float:
        return _target(scene, bound, workspace, i, time)

    low, high = place, wanted(end)
    for _ in range(HALVINGS):
        middle = 0.5 * (begin + end)
        if not begin < middle < end:
            break
        value = wanted(middle)
        if abs(value - low) > abs(high - value):
            end, high = middle, value
        else:
            begin, low = middle, value
    if not abs(high - low) * bound.records.coordinates["lever"][i] > least:
        return None
    return Leap(scene.template.coordinates[i], high - low, begin)


def _target(scene: Scene, bound: Bound, workspace: Workspace, i: int, time: float) -> float:
    """Position that the servo of coordinate i wants at a time; the numbers that depend on time stay there."""
    values = bound.values.copy()
    values[time_slot(workspace.state)] = time
    evaluate_numbers(scene.template.timed_numbers(), values, np.zeros(STACK), bound.buffer)
    return float(target(bound.records.coordinates[i], workspace.state.start[i], time))
