"""Snaps: motion without momentum that does not vanish with the step.

What contacts or springs hold may lose its balance as it moves, and snap (von Mises' truss): the state is then
out of balance, and a step moves it however short it is, and so does the next. What settles, because loads or
drives have jumped, is in balance after one such step.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.models.assemble import carried
from rungwise.scene.template.records import Records
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.core.tolerances import DRIVEN, SHORTER
from rungwise.simulation.planar.state.nearby import begin_step, gather
from rungwise.simulation.planar.state.prescribed_speeds import set_speeds
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.planar.step.leaps import (
    SETTLING,
    SMALL,
    STRIDE,
    SUDDEN,
    displacement,
    grown,
    is_tiny,
    noticed,
    solve_again,
)
from rungwise.simulation.watched.inputs import Inputs


@rare_kernel
def snaps(
    records: Records, inputs: Inputs, buffer: Reals, rung: RecordArray, workspace: Workspace, h: float
) -> bool:
    """Whether bodies move on in a small part of a step of length h by what does not vanish with it: by half
    as far as in the last step, where they moved far, or if the step is tiny by what counts as far. Inputs
    that begin with this step explain it, and what settles after them."""
    clock, terms = workspace.state.clock[0], workspace.terms
    tiny = is_tiny(h, terms) and not _settles(workspace)
    without_momentum = rung[0].inertia == 0.0 and rung[0].loads and not clock.chooses
    if not without_momentum or not (tiny or clock.leapt > 0.0) or clock.time <= clock.switched:
        return False
    far = noticed(h, workspace) if tiny else 0.5 * clock.leapt
    part = (SUDDEN if tiny else SHORTER) * min(h, clock.taken)
    if tiny and math.isinf(terms.low[0]):
        far = min(far, grown(records, part, workspace))
    return _moves_on(records, inputs, buffer, rung, workspace, part, 0.0, far) and (
        not tiny or _moves_on(records, inputs, buffer, rung, workspace, part, part, far)
    )


@rare_kernel
def _moves_on(
    records: Records,
    inputs: Inputs,
    buffer: Reals,
    rung: RecordArray,
    workspace: Workspace,
    part: float,
    earlier: float,
    far: float,
) -> bool:
    """Whether loads, springs or contacts move bodies by `far` in a step of length `part`, under the inputs of
    a time `earlier` by so much: a load that jumps between two steps does not move them under both."""
    clock = workspace.state.clock[0]
    time = clock.time
    clock.time = time - earlier
    part, _ = set_speeds(records, inputs, buffer, rung, workspace, part)
    defined = workspace.watched.undefined[0] < 0
    if defined:
        begin_step(records, rung, workspace, part)
    clock.time = time
    if not defined:
        return False
    clock.contacts = gather(records, workspace)
    supported = solve_again(rung, part, workspace) == SUPPORTED
    moved, driven = displacement(records, part, workspace)
    return supported and moved >= max(far, DRIVEN * driven) and _is_thrown(workspace)


@kernel
def is_coarse(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> bool:
    """Whether a step of fixed length without momentum is to be shortened, because it moves bodies far, or out
    of proportion to the last, by what may not vanish with it: it is not tiny, and nothing settles after a
    change of inputs. The solution is left as it was."""
    clock, terms = workspace.state.clock[0], workspace.terms
    if rung[0].inertia > 0.0 or not rung[0].loads or clock.chooses or math.isfinite(terms.low[0]):
        return False
    moved, driven = displacement(records, h, workspace)
    far = STRIDE * clock.smallest
    if clock.leaping <= far:
        if moved <= max(SMALL * clock.smallest, DRIVEN * driven) or moved <= grown(records, h, workspace):
            return False
        far = min(far, moved)
    return (
        not is_tiny(h, terms)
        and not _settles(workspace)
        and not _vanishes(records, rung, h, 0.5 * far, workspace)
    )


@rare_kernel
def _vanishes(records: Records, rung: RecordArray, h: float, far: float, workspace: Workspace) -> bool:
    """Whether a tiny step under the same loads moves bodies by less than `far`."""
    supported = solve_again(rung, SUDDEN * h, workspace) == SUPPORTED
    moved, _ = displacement(records, SUDDEN * h, workspace)
    solve_again(rung, h, workspace)
    return supported and moved < far


@inner_kernel
def _settles(workspace: Workspace) -> bool:
    """Whether inputs changed so short a time ago that bodies may still be on their way to balance."""
    clock = workspace.state.clock[0]
    return bool(clock.time - clock.switched <= SETTLING * workspace.terms.pause[0])


@rare_kernel
def _is_thrown(workspace: Workspace) -> bool:
    """Whether loads or springs drive the motion just solved, or contacts that yielded before."""
    state, terms, scratch, power = workspace.state, workspace.terms, workspace.scratch, 0.0
    for i in range(state.q.shape[0]):
        power += terms.load[i] * scratch.v_new[i]
    for r in range(state.clock[0].limited):
        if 0.0 < terms.gains[r, 0] < math.inf:
            power += scratch.limited_force[r] * carried(terms.limited, r, scratch.v_new)
    thrown = power > 0.0
    for k in range(state.clock[0].contacts):
        thrown |= terms.deformation[2 * k] > 0.0
    return thrown
