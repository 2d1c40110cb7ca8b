"""Beginning a run at a state."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals, RecordArray
from rungwise.outcome import Code
from rungwise.scene import Scene, SceneError
from rungwise.scene.template.records import ANGLE, SERVO, Records
from rungwise.simulation import trajectory
from rungwise.simulation.planar.begin import begin_by_hand, outside_travel
from rungwise.simulation.planar.loop import CLOSED, Setting, begin, slack
from rungwise.simulation.planar.state.memory import go_on
from rungwise.simulation.planar.state.workspace import Workspace, in_memory
from rungwise.simulation.state import Memory, PlaceError, State, StateError, digest, memory_of
from rungwise.simulation.watched.inputs import Inputs, begin_inputs, set_all
from rungwise.system.planar import joints
from rungwise.system.planar.place import allocate_placement, place


class Before(NamedTuple):
    """The scene as the state's run knew it: its records, gaps of contacts, measures of joints, and where
    servos were led from."""

    records: Records
    gaps: Reals
    measures: Reals
    start: Reals


def begin_at(state: State, scene: Scene, setting: Setting, fresh: bool, workspace: Workspace) -> str:
    """Prepare a run that goes on from a checked state; returns why it is invalid there, or an empty text. The
    schedule begins there if `fresh`, and goes on as the state's run followed it if not.

    Bodies may overlap, joints be open and coordinates lie outside their travel by as much as in the state's
    own run, by its errors and deformations. Raises PlaceError for a place outside its travel, and StateError
    for a memory that is not the state's.
    """
    records, inputs, _, buffer, rung, control = setting
    now = workspace.state
    memory = memory_of(state, digest(scene), now)
    if memory is not None and memory.inputs:
        _take_inputs(memory, inputs, workspace)
    goes_on = memory is not None and _continues(memory, rung, len(scene.template.parameters), workspace)
    before = None if memory is None or goes_on else _before(state, scene, memory, workspace)
    if before is not None:
        _check_travel(state, records, before)
    now.q[:], now.v[:], now.clock["time"] = state.q, state.v, state.time
    (begin_inputs if fresh else set_all)(inputs, buffer, workspace.watched)
    if memory is None:
        return _begin_by_hand(state, scene, setting, workspace)
    code = Code(begin(records, rung, control, workspace))
    if before is None:
        go_on(records, workspace, memory.values.copy())
        (begin_inputs if fresh else set_all)(inputs, buffer, workspace.watched)
        return ""
    # Servos that follow a speed go on from where they have led before.
    speeds = _followed(before.records) - _followed(records)
    workspace.state.start[:] = before.start + speeds * state.time
    _hand_on(memory, bool(rung[0]["compliant"]), workspace)
    return out_of_place(scene, records, workspace, before) if code == Code.INVALID else ""


def _begin_by_hand(state: State, scene: Scene, setting: Setting, workspace: Workspace) -> str:
    """Begin at a state that no run has left, as samples of a rollout do."""
    records = setting.records
    code = Code(begin_by_hand(records, setting.rung, setting.control, workspace))
    i = outside_travel(records, workspace)
    if i >= 0:
        raise _outside(state, records, i)
    return out_of_place(scene, records, workspace) if code == Code.INVALID else ""


def out_of_place(scene: Scene, records: Records, workspace: Workspace, before: Before | None = None) -> str:
    """The bodies that overlap most at the start, or the joint that is most open; empty where it was so
    before."""
    overlaps = -workspace.state.manifolds.gaps
    off = _off(records, workspace.scratch.measures)
    if before is not None:
        most = slack(workspace)
        units = np.where(
            records.measures["which"] == ANGLE, records.joints["lever"][records.measures["joint"]], 1.0
        )
        overlaps = _beyond(overlaps, -before.gaps, most)
        off = _beyond(off, _off(before.records, before.measures), most / units)
    if off.max(initial=0.0) > overlaps.max(initial=0.0):
        worst = int(np.argmax(off))
        name = f"{scene.template.joints[worst // 3]}: its {trajectory.MEASURES[worst % 3]}"
        return f"joints.{name} is off by {off[worst]:.3g} at the start"
    if not overlaps.max(initial=0.0) > 0.0:
        return ""
    a, b = scene.template.contacts[int(np.argmax(overlaps))]
    return f"bodies.{a}: overlaps {b} by {overlaps.max():.3g} at the start"


def _off(records: Records, places: Reals) -> Reals:
    """How far measures of joints are outside what is held, or their travel."""
    held = records.measures["held"] == 1
    low, high = (np.where(held, 0.0, records.measures[side]) for side in ("lower", "upper"))
    return np.asarray(np.maximum(low - places, places - high))


def _beyond(now: Reals, before: Reals, most: Any) -> Reals:
    """What is more than before, but for rounding; 0 elsewhere."""
    return np.where(now <= np.maximum(before, 0.0) + most, 0.0, now)


def _take_inputs(memory: Memory, inputs: Inputs, workspace: Workspace) -> None:
    """Let the inputs be as they are in the memory, in the same segment."""
    now, columns = workspace.state, inputs.columns
    now.values[columns] = in_memory(now, "values", memory.values[None])[0, columns]
    now.levels[:] = in_memory(now, "levels", memory.values[None])[0]
    for name in ("segment", "varies", "opened", "switched", "switch"):
        now.clock[name] = memory.clock[name]


def _continues(memory: Memory, rung: RecordArray, parameters: int, workspace: Workspace) -> bool:
    """Whether the run goes on as if it had not been interrupted."""
    before = in_memory(workspace.state, "values", memory.values[None])[0]
    same = np.array_equal(before[:parameters], workspace.state.values[:parameters])
    return bool(same and memory.model.record(memory.theta) == rung)


def _before(state: State, scene: Scene, memory: Memory, workspace: Workspace) -> Before:
    values, gaps, start = (
        in_memory(workspace.state, name, memory.values[None])[0] for name in ("values", "gaps", "start")
    )
    parameters = dict(zip(scene.template.parameters, values.tolist(), strict=False))
    for name in scene.template.inputs if memory.inputs else ():
        parameters[name] = scene.file.parameters[name].default
    try:
        records = scene.bind(parameters).records
    except SceneError as error:
        raise StateError(f"state.memory: {error}") from None
    placed, measures = allocate_placement(records), np.zeros(len(records.measures))
    place(records, state.q.copy(), placed, True)
    joints.values(records, placed.pose, state.q.copy(), np.zeros(len(state.q)), measures)
    return Before(records, gaps, measures, start)


def _hand_on(memory: Memory, compliant: bool, workspace: Workspace) -> None:
    """Give contacts whose features touch as before their modes and forces, and their deformations where they
    are compliant."""
    now = workspace.state

    def before(name: str) -> Any:
        return in_memory(now, name, memory.values[None])[0]

    now.manifolds.turn[0] += 1
    same = np.ones(len(now.modes), bool)
    same[: len(now.manifolds.features)] = before("features") == now.manifolds.features
    now.modes[same], now.force[same] = before("modes")[same], before("force")[same]
    if compliant:
        now.deformation[same] = before("deformation")[same]


def _followed(records: Records) -> Reals:
    """Speeds that servos without target follow, of coordinates and of joints' measures; 0 for all others."""
    return np.concatenate(
        [
            np.where((each["drive"] == SERVO) & (each["has_target"] == 0), each["target_speed"], 0.0)
            for each in (records.coordinates, records.measures)
        ]
    )


def _check_travel(state: State, records: Records, before: Before) -> None:
    c = before.records.coordinates
    outside = np.maximum(np.maximum(c["lower"] - state.q, state.q - c["upper"]), 0.0)
    for i, (value, c) in enumerate(zip(state.q, records.coordinates, strict=True)):
        most = outside[i] + CLOSED * abs(float(value))
        if not c["lower"] - most <= value <= c["upper"] + most:
            raise _outside(state, records, i)


def _outside(state: State, records: Records, i: int) -> PlaceError:
    low, high = float(records.coordinates["lower"][i]), float(records.coordinates["upper"][i])
    return PlaceError(f"state.q.{state.names[i]}: {state.q[i]:g} is outside its travel, {low:g} to {high:g}")
