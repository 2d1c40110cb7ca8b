"""Where runs in space begin: at the scene's start or at a state, without overlap, with joints closed."""

from __future__ import annotations

from rungwise.kernel import Reals
from rungwise.scene import SceneError
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.elements import equality
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.simulation.moving.begin import Fault, worst
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.state import StateError
from rungwise.system.spatial.space import Space

OPEN = 1e-2
"""An equality may be open, and a limit passed, by this part of the system's length at a start that no run has
led to: what rounded numbers of files make, and runs whose states are taken without their memory."""


def faults(space: Space, q: Reals) -> list[Fault]:
    """What is amiss at q."""
    found = [Fault("overlap", (a, b), -gap) for gap, a, b in space.overlaps(q)]
    return found + [Fault("joint", (kind, number), by) for by, kind, number in space.violations(q)]


def faults_before(scene: SpaceScene, parameters: dict[str, float], q: Reals) -> list[Fault]:
    """What was amiss in the state's own run at these parameters. Raises StateError."""
    try:
        return faults(Prepared.of(scene, parameters).system, q)
    except SceneError as error:
        raise StateError(f"state.memory: {error}") from None


def misplaced(scene: SpaceScene, space: Space, q: Reals, before: list[Fault], field: str) -> str:
    """What is amiss at q, more than before and more than rounding explains: the bodies that overlap most, or
    else the joint, tendon or equality that is farthest off; "" if nothing is. A step would close it at any
    speed. The line begins with `field`, the start or the state."""
    least = {"overlap": OVERLAP * space.size.length, "joint": OPEN * space.size.length}
    found = worst(faults(space, q), before, least)
    if found is None:
        return ""
    hint = "; start.settle: true, or --settle, begins at the nearest start that is allowed"
    settles = field == "start" and not scene.file.start.settle
    return f"{field}: {_told(scene, space, found)}{hint if settles else ''}"


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
    return f"{name} is beyond its range ({low:g} to {high:g}) by {fault.by:.3g}; {way}"
