"""Leaps: how far a step without momentum moves bodies, and from where on it is looked at.

Thresholds are chosen by trial, to a decade.
"""

from __future__ import annotations

import math

from rungwise.kernel import RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.models.limit import LIMIT
from rungwise.scene.template.records import Records
from rungwise.simulation.core.step import solve_step
from rungwise.simulation.core.tolerances import DRIVEN
from rungwise.simulation.planar.state.workspace import Workspace, trial_in
from rungwise.system.terms import Terms

LEAST = 1e-2
"""Displacement in a step, over the smallest shape's reach, from which on it may be a leap."""
STRIDE = 0.1
"""Displacement in the same unit, from which on a step is shortened: it takes faces as flat."""
SMALL = 1e-3
"""Displacement in the same unit, from which on one that grows from step to step may be a leap."""
GROWN, YIELDED = 2.0, 2.0
"""Displacement over what the pace of the last step explains, and over the deepest deformation, from which on
it grows. Where balance is stable the rest of a step that took faces as flat is shorter than this step."""
TINY = 1e-6
"""Step, over twice the nominal one, in which loads and drives move nothing unless they jump."""
LEFT = 10.0 * LIMIT
"""Part of the load and of the resistance that inertia may make up where it does not bound the motion."""
HEAVIER = 10.0
"""Factor on the inertia of a limit that changes a motion if nothing else bounds it."""
SUDDEN = 2.0**-12
"""Part of a tiny step in which what vanishes with the step moves less than half as far: a load that jumps
somewhere in a tiny step hardly does so in this part."""
SETTLING = 2.0
"""Time after a change of inputs, over twice the nominal step, in which what moves may still settle."""


@kernel
def leaping(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> float:
    """How far the step just solved, of length h and without momentum, moves bodies beyond what is driven: a
    length, 0 where it is no more than steps usually are."""
    if rung[0].inertia > 0.0 or not rung[0].loads or workspace.state.clock[0].chooses:
        return 0.0
    seen = noticed(h, workspace)
    if math.isinf(seen):
        return 0.0
    moved, driven = displacement(records, h, workspace)
    return moved if moved > max(seen, DRIVEN * driven) else 0.0


@inner_kernel
def noticed(h: float, workspace: Workspace) -> float:
    """Displacement from which on a step is looked at: a part of the smallest shape; under error control,
    where displacements that do not vanish make steps ever shorter, the error allowed in a tiny step."""
    allowed, tiny = workspace.terms.low[0], is_tiny(h, workspace.terms)
    if math.isinf(allowed):
        return float((STRIDE if tiny else LEAST) * workspace.state.clock[0].smallest)
    return float(allowed if tiny else math.inf)


@kernel
def grown(records: Records, h: float, workspace: Workspace) -> float:
    """Displacement in a step of length h from which on it is out of proportion to the last step."""
    state, clock, pace, yielded = workspace.state, workspace.state.clock[0], 0.0, 0.0
    for i in range(state.v.shape[0]):
        pace = max(pace, records.coordinates[i].lever * abs(state.v[i]))
    for k in range(clock.contacts):
        yielded = max(yielded, workspace.terms.deformation[2 * k])
    return float(max(SMALL * clock.smallest, YIELDED * yielded, GROWN * pace * max(h, clock.taken)))


@inner_kernel
def is_tiny(h: float, terms: Terms) -> bool:
    """Whether a step is so short that only what is out of balance at its start moves in it."""
    return bool(h < TINY * terms.pause[0])


@inner_kernel
def displacement(records: Records, h: float, workspace: Workspace) -> tuple[float, float]:
    """The farthest displacement, as a length, in the step just solved: of free and of driven coordinates."""
    state, moved, driven = workspace.state, 0.0, 0.0
    for i in range(state.q.shape[0]):
        far = h * records.coordinates[i].lever * abs(workspace.scratch.v_new[i])
        if state.prescribed[i]:
            driven = max(driven, far)
        else:
            moved = max(moved, far)
    return moved, driven


@rare_kernel
def solve_again(rung: RecordArray, h: float, workspace: Workspace) -> int:
    return solve_step(trial_in(rung, h, workspace.state.clock[0].contacts, workspace))
