"""Where runs begin: at the scene's start or at a state, without overlap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.state import State, StateError, check_state, digest
from rungwise.simulation.stepping.stepper import Stepper


class Fault(NamedTuple):
    """What is amiss at a place: two numbers, of geoms or bodies that overlap, or of an equality that is open,
    a limit that is passed; and by how much."""

    kind: str
    numbers: tuple[int, int]
    by: float


def begin_at(state: State, scene: AnyScene, stepper: Stepper) -> Reals | None:
    """Put a run at a state; returns the memory (w,) of the state's run, None if it has none or is of another
    scene. Raises StateError."""
    check_state(state, scene)
    stepper.q = state.q.copy()
    scene.normalise(stepper.q, "state.q", StateError)
    stepper.state.v[:] = state.v
    stepper.time = state.time
    stepper.state.clock["time"] = state.time
    return memory_of(state, scene)


def memory_of(state: State, scene: AnyScene) -> Reals | None:
    """The memory (w,) of a checked state, None where it has none or is of another scene. Raises StateError
    where it is of other q, v or time."""
    if state.memory is None or state.memory.scene != digest(scene):
        return None
    memory, template = state.memory.values, scene.template
    values = memory[memory_parts(scene, memory).values]
    time = len(template.parameters)
    places = time + 1 + len(template.coordinates)
    rates = places + len(template.velocities)
    own = {"time": values[time : time + 1], "q": values[time + 1 : places], "v": values[places:rates]}
    for field, known in own.items():
        if not np.array_equal(known, np.atleast_1d(getattr(state, field))):
            raise StateError(
                f"state.{field}: differs from the state's memory; make a state with State.of,"
                " or replace memory by None, too"
            )
    return state.memory.values


def worst(faults: list[Fault], before: list[Fault], least: Mapping[str, float]) -> Fault | None:
    """What is most amiss, more than before and more than rounding explains (`least`, by kind)."""
    allowed: dict[tuple[str, tuple[int, int]], float] = {}
    for kind, numbers, by in before:
        allowed[kind, numbers] = max(by, allowed.get((kind, numbers), 0.0))
    amiss = [
        fault for fault in faults
        if fault.by > least[fault.kind] + allowed.get((fault.kind, fault.numbers), 0.0)
    ]  # fmt: skip
    return max(amiss, key=lambda fault: (fault.kind == "overlap", fault.by)) if amiss else None
