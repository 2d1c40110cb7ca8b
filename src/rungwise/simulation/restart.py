"""Beginning a run at a state."""

from __future__ import annotations

from typing import Any

import numpy as np

from rungwise.kernel import RecordArray
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.scene.records import SERVO, Records
from rungwise.simulation.planar.loop import CLOSED, begin
from rungwise.simulation.planar.memory import go_on
from rungwise.simulation.planar.workspace import Workspace, in_memory
from rungwise.simulation.state import Memory, State, StateError, digest


def begin_at(
    state: State,
    scene: Scene,
    records: Records,
    rung: RecordArray,
    control: RecordArray,
    workspace: Workspace,
) -> Code:
    """Prepare a run that goes on from a checked state; INVALID when bodies overlap there, or joints are open.

    Where compliant contacts had been deformed, bodies may overlap by as much. Raises StateError for a place
    outside its travel.
    """
    now, memory = workspace.state, state.memory
    if memory is not None and memory.scene != digest(scene):
        memory = None  # its contacts belong to other shapes
    if memory is None:
        _check_travel(state, records)
    now.q[:], now.v[:] = state.q, state.v
    code = Code(begin(records, rung, control, workspace))
    if memory is not None and _continues(memory, rung, len(scene.template.parameters), workspace):
        go_on(records, workspace, memory.values)
        return Code.RUNNING
    now.clock["time"] = state.time
    _start_servos(state, records, workspace)
    if memory is None:
        return code
    deepest = _hand_on(memory, bool(rung[0]["compliant"]), workspace)
    return Code.RUNNING if now.clock[0]["least_gap"] >= -2.0 * deepest else code


def _continues(memory: Memory, rung: RecordArray, parameters: int, workspace: Workspace) -> bool:
    """Whether the run goes on as if it had not been interrupted."""
    before = in_memory(workspace.state, "values", memory.values[None])[0]
    same = np.array_equal(before[:parameters], workspace.state.values[:parameters])
    return bool(same and memory.model.record(memory.theta) == rung)


def _hand_on(memory: Memory, compliant: bool, workspace: Workspace) -> float:
    """Give contacts whose features touch as before their modes and forces, and their deformations where they
    are compliant; returns the deepest deformation before."""
    now = workspace.state

    def before(name: str) -> Any:
        return in_memory(now, name, memory.values[None])[0]

    same = np.ones(len(now.modes), bool)
    same[: len(now.manifolds.features)] = before("features") == now.manifolds.features
    now.modes[same], now.force[same] = before("modes")[same], before("force")[same]
    if compliant:
        now.deformation[same] = before("deformation")[same]
    now.start[:] = before("start")
    return float(np.abs(before("deformation")).max(initial=0.0))


def _start_servos(state: State, records: Records, workspace: Workspace) -> None:
    """Let servos that follow a speed pass through the state."""
    for i, c in enumerate(records.coordinates):
        if c["drive"] == SERVO and not c["has_target"]:
            workspace.state.start[i] = state.q[i] - c["target_speed"] * state.time


def _check_travel(state: State, records: Records) -> None:
    for name, value, c in zip(state.names, state.q, records.coordinates, strict=True):
        low, high, slack = float(c["lower"]), float(c["upper"]), CLOSED * abs(float(value))
        if not low - slack <= value <= high + slack:
            raise StateError(f"state.q.{name}: {value:g} is outside its travel, {low:g} to {high:g}")
