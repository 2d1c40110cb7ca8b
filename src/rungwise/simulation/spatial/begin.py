"""Where runs in space begin: at the scene's start or at a state, without overlap, with joints closed."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.scene import normalise
from rungwise.simulation.core.march import OVERLAP, March
from rungwise.simulation.state import State, check_state
from rungwise.system.spatial.space import Space

OPEN = 1e-2
"""An equality may be open, and a limit passed, by this part of the system's length at a start that no run has
led to: what rounded numbers of files make, and runs whose states are taken without their memory."""


def begin_at(state: State, scene: SpaceScene, march: March, space: Space) -> Reals:
    """Put a run at a state; returns the memory (w,) of the state's run, empty if it has none. Raises
    StateError."""
    check_state(state, scene)
    march.q = state.q.copy()
    normalise(space.model, march.q)
    march.state.v[:] = state.v
    march.time = state.time
    march.state.clock["time"] = state.time
    return np.zeros(0) if state.memory is None else state.memory.values


def overlapping(scene: SpaceScene, space: Space, march: March) -> str:
    """Which bodies overlap at the start, more than compliant contacts in the state's own run did; else ""."""
    sunk = march.state.deformation[:, 0].max(initial=0.0)
    allowed = OVERLAP * space.size.length + 2.0 * sunk
    for gap, a, b in space.overlaps(march.q):
        if gap < -allowed:
            bodies, geoms, of = scene.labels.bodies, scene.labels.geoms, space.solids.body
            pair = f"{bodies[of[a]]} ({geoms[a]}) and {bodies[of[b]]} ({geoms[b]})"
            return f"start: {pair} overlap by {-gap:.3g}"
    return ""


def misplaced(scene: SpaceScene, space: Space, q: Reals) -> str:
    """Which joint or tendon is beyond its range, or which equality is open, at a start; else "". A step would
    close it at any speed."""
    import mujoco

    amiss, kind, number = max(space.violations(q), default=(0.0, 0, 0))
    if amiss <= OPEN * space.size.length:
        return ""
    m, kinds = space.model, mujoco.mjtConstraint
    way = "start.places or start.keyframe can mend it"
    if kind == kinds.mjCNSTR_EQUALITY:
        name = m.equality(number).name or f"number {number}"
        return f"start: equality {name} is open by {amiss:.3g}; {way}"
    joint = kind == kinds.mjCNSTR_LIMIT_JOINT
    low, high = (m.jnt_range if joint else m.tendon_range)[number]
    name = scene.template.velocities[m.jnt_dofadr[number]] if joint else m.tendon(number).name
    return f"start: {name} is beyond its range ({low:g} to {high:g}) by a way of {amiss:.3g}; {way}"
