"""Targets of servos that jump: the kinematic rung follows them at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rungwise.scene import Scene
from rungwise.scene.language.expression import STACK
from rungwise.scene.scene import Bound
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.records import ANGLE, SERVO
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.watched.values import TIME
from rungwise.system.planar.joints import measure
from rungwise.system.planar.terms import target
from rungwise.system.terms import rows_of


@dataclass(frozen=True)
class Leap:
    """A servo's target moves by `far` in no time, at `time`; `field` is the path of the servo."""

    field: str
    far: float
    time: float

    def __str__(self) -> str:
        return (
            f"{self.field}: its target is {self.far:.3g} away from"
            f" t = {self.time:.6g} on, and the kinematic rung follows it at once, through what is in the way."
            " Start at the target, let it move with t, or use a richer rung."
        )


@dataclass(frozen=True)
class _Servo:
    """A servo of a coordinate, or of a joint's: its path, its place now, its lever, and its target at a
    time."""

    field: str
    place: float
    lever: float
    target: Callable[[float], float]


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
    servo, begin = _of_coordinate(scene, bound, workspace, i), end - float(clock["leap_step"])
    return _leap(replace(servo, place=servo.target(end) - moved), begin, end, least)


def leap_ahead(scene: Scene, bound: Bound, workspace: Workspace, least: float, span: float) -> Leap | None:
    """The leap beyond `least` that a servo would have to take within so long a time, if any; one to which no
    contact and no joint is near has nothing to do with what stops the run."""
    state = workspace.state
    now = float(state.clock[0]["time"])
    drives, measures = bound.records.coordinates["drive"], bound.records.measures
    servos = [
        _of_coordinate(scene, bound, workspace, i)
        for i in range(len(state.q))
        if state.prescribed[i] and drives[i] == SERVO and _is_concerned(i, workspace)
    ]
    servos += [
        _of_joint(scene, bound, workspace, m)
        for m in range(len(measures))
        if measures[m]["drive"] == SERVO and not measures[m]["held"]
    ]
    for servo in servos:
        found = _leap(servo, now, now + span, least)
        if found is not None:
            return found
    return None


def _is_concerned(i: int, workspace: Workspace) -> bool:
    """Whether rows of contacts or joints of the last problem contain coordinate i."""
    clock, terms = workspace.state.clock[0], workspace.terms
    joined = terms.limited[clock["drives"] : clock["limited"], i]
    return bool(rows_of(terms, int(clock["contacts"]))[:, :, i].any() or joined.any())


def _leap(servo: _Servo, begin: float, end: float, least: float) -> Leap | None:
    """Halve the time towards where the target, followed from the servo's place, moves most."""
    low, high = servo.place, servo.target(end)
    while begin < (middle := 0.5 * (begin + end)) < end:
        value = servo.target(middle)
        if abs(value - low) > abs(high - value):
            end, high = middle, value
        else:
            begin, low = middle, value
    if not abs(high - low) * servo.lever > least:
        return None
    return Leap(servo.field, high - low, begin)


def _of_coordinate(scene: Scene, bound: Bound, workspace: Workspace, i: int) -> _Servo:
    body, coordinate = scene.template.coordinates[i].split(".")

    def wanted(time: float) -> float:
        _set_time(scene, bound, workspace, time)
        return float(target(bound.records.coordinates[i], workspace.state.start[i], time))

    lever, place = float(bound.records.coordinates["lever"][i]), float(workspace.state.q[i])
    return _Servo(f"bodies.{body}.coordinates.{coordinate}.drive", place, lever, wanted)


def _of_joint(scene: Scene, bound: Bound, workspace: Workspace, m: int) -> _Servo:
    records, state = bound.records, workspace.state
    kind, row = records.measures[m], np.zeros(len(state.q))
    lever = float(records.joints[int(kind["joint"])]["lever"]) if kind["which"] == ANGLE else 1.0

    def wanted(time: float) -> float:
        _set_time(scene, bound, workspace, time)
        led = float(state.start[len(state.q) + m] + kind["target_speed"] * time)
        return float(np.clip(kind["target"] if kind["has_target"] else led, kind["lower"], kind["upper"]))

    place = measure(kind, records, state.placed.pose, state.q, row) / lever
    return _Servo(
        f"joints.{scene.template.joints[int(kind['joint'])]}.coordinate.drive", place, lever, wanted
    )


def _set_time(scene: Scene, bound: Bound, workspace: Workspace, time: float) -> None:
    """Set the numbers that depend on time as they are then; they stay so."""
    values = workspace.state.values.copy()
    values[workspace.watched.slots[TIME]] = time
    evaluate_numbers(scene.template.timed_numbers(), values, np.zeros(STACK), bound.buffer)
