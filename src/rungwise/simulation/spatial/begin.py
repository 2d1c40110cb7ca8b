"""Where runs in space begin: at the scene's start or at a state, without overlap, with joints closed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import SceneError
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.bind import normalise
from rungwise.scene.space.elements import equality
from rungwise.simulation.core.stepper import OVERLAP, Stepper
from rungwise.simulation.spatial.memory import memory_parts
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.state import State, StateError, check_state, digest
from rungwise.system.spatial.space import Space

OPEN = 1e-2
"""An equality may be open, and a limit passed, by this part of the system's length at a start that no run has
led to: what rounded numbers of files make, and runs whose states are taken without their memory."""


def begin_at(state: State, scene: SpaceScene, stepper: Stepper) -> Reals | None:
    """Put a run at a state; returns the memory (w,) of the state's run, None if it has none or is of another
    scene. Raises StateError."""
    check_state(state, scene)
    stepper.q = state.q.copy()
    normalise(stepper.q, scene, "state.q", StateError)
    stepper.state.v[:] = state.v
    stepper.time = state.time
    stepper.state.clock["time"] = state.time
    return memory_of(state, scene)


def memory_of(state: State, scene: SpaceScene) -> Reals | None:
    """The memory (w,) of a checked state, None where it has none or is of another scene. Raises StateError
    where it is of other q, v or time."""
    if state.memory is None or state.memory.scene != digest(scene):
        return None
    template, values = scene.template, state.memory.values[memory_parts(scene).values]
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


class Fault(NamedTuple):
    """Two geoms that overlap, or an equality that is open, a limit that is passed; and by how much."""

    kind: str
    numbers: tuple[int, int]
    by: float


def faults(space: Space, q: Reals) -> list[Fault]:
    """What is amiss at q."""
    found = [Fault("overlap", (a, b), -gap) for gap, a, b in space.overlaps(q)]
    return found + [Fault("joint", (kind, number), by) for by, kind, number in space.violations(q)]


def faults_before(scene: SpaceScene, parameters: dict[str, float], q: Reals) -> list[Fault]:
    """What was amiss in the state's own run at these parameters. Raises StateError."""
    try:
        return faults(Prepared.of(scene, parameters).space, q)
    except SceneError as error:
        raise StateError(f"state.memory: {error}") from None


def misplaced(scene: SpaceScene, space: Space, q: Reals, before: list[Fault], field: str) -> str:
    """What is amiss at q, more than before and more than rounding explains: the bodies that overlap most, or
    else the joint, tendon or equality that is farthest off; "" if nothing is. A step would close it at any
    speed. The line begins with `field`, the start or the state."""
    allowed: dict[tuple[str, tuple[int, int]], float] = {}
    for kind, numbers, by in before:
        allowed[kind, numbers] = max(by, allowed.get((kind, numbers), 0.0))
    least = {"overlap": OVERLAP * space.size.length, "joint": OPEN * space.size.length}
    amiss = [
        fault for fault in faults(space, q)
        if fault.by > least[fault.kind] + allowed.get((fault.kind, fault.numbers), 0.0)
    ]  # fmt: skip
    if not amiss:
        return ""
    worst = max(amiss, key=lambda fault: (fault.kind == "overlap", fault.by))
    return f"{field}: {_told(scene, space, worst)}"


def _told(scene: SpaceScene, space: Space, fault: Fault) -> str:
    import mujoco

    m, kinds = space.model, mujoco.mjtConstraint
    if fault.kind == "overlap":
        bodies, geoms, of = scene.labels.bodies, scene.labels.geoms, space.solids.body
        one, other = (f"{bodies[of[g]]} ({geoms[g]})" for g in fault.numbers)
        return f"{one} and {other} overlap by {fault.by:.3g}"
    (kind, number), way = fault.numbers, "start.places or start.keyframe can mend it"
    if kind == kinds.mjCNSTR_EQUALITY:
        return f"equality {equality(m, scene.labels, number)} is open by {fault.by:.3g}; {way}"
    joint = kind == kinds.mjCNSTR_LIMIT_JOINT
    low, high = (m.jnt_range if joint else m.tendon_range)[number]
    name = scene.template.velocities[m.jnt_dofadr[number]] if joint else m.tendon(number).name
    return f"{name} is beyond its range ({low:g} to {high:g}) by a way of {fault.by:.3g}; {way}"
