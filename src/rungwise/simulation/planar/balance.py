"""Leaps: steps without momentum to places that no balance leads to.

Without inertia a step's problem asks for balance at its end alone. What nothing holds where the step begins
then comes to rest against whatever lies in its way, however far. So the contacts that are closed when the
step begins, or that driven motion closes in it, have to balance the loads alone, with springs, dampers,
drives and dry friction: what balances only against others got there by momentum, which the rung leaves out.

What contacts or springs hold may lose its balance as it moves, and snap (von Mises' truss): the state is then
out of balance, and a step moves it however short it is, and so does the next. What settles, because loads or
drives have jumped, is in balance after one such step.
"""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, SOLVED
from rungwise.kernel import Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.models.assemble import carried
from rungwise.models.limit import LIMIT, greatest_load
from rungwise.scene.records import Records
from rungwise.simulation.core.step import SUPPORTED, is_balanced, solve_assembled, solve_step
from rungwise.simulation.planar.choice import choose_motion
from rungwise.simulation.planar.drives import set_speeds
from rungwise.simulation.planar.inputs import Inputs
from rungwise.simulation.planar.nearby import NEAR, begin_step, gather
from rungwise.simulation.planar.workspace import Workspace
from rungwise.system.terms import Terms

LEAST = 1e-2
"""Displacement in a step, over the smallest shape's reach, from which on it may be a leap."""
STRIDE = 0.1
"""Displacement in the same unit, from which on a step is shortened: it takes faces as flat."""
DRIVEN = 2.0
"""Displacement over the farthest of a driven coordinate, from which on it may be a leap."""
TINY = 1e-6
"""Step, over twice the nominal one, in which loads and drives move nothing unless they jump."""
LEFT = 10.0 * LIMIT
"""Part of the load and of the resistance that inertia may make up where it does not bound the motion."""
HEAVIER = 10.0
"""Factor on the inertia of a limit that changes a motion if nothing else bounds it."""
SHORTER, SUDDEN = 1.0 / 16.0, 2.0**-12
"""Parts of a step, and of a tiny one, in which what vanishes with the step moves less than half as far: a
load that jumps somewhere in a tiny step hardly does so in this part."""
SETTLING = 2.0
"""Time after a change of inputs, over twice the nominal step, in which what moves may still settle."""


@kernel
def strides(rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> bool:
    """Whether the step just solved has no momentum and takes bodies to contacts that were out of the reach of
    driven motion, or far with more inertia in the balance than the limit leaves there."""
    if rung[0].inertia > 0.0 or not rung[0].loads:
        return False
    state, terms, scratch, met = workspace.state, workspace.terms, workspace.scratch, False
    for k in range(contacts):
        met |= scratch.contact_force[2 * k] > 0.0 and not _is_within(h, k, workspace)
    if met and greatest_load(terms, state.clock[0].free, state.free)[0] == 0.0:
        return False
    return met or (state.clock[0].leaping > 0.0 and not is_balanced(h, LEFT, terms, state, scratch))


@rare_kernel
def stands(records: Records, rung: RecordArray, h: float, shortest: float, workspace: Workspace) -> bool:
    """Whether contacts within that reach balance the loads alone, in a motion that inertia does not bound. If
    not, their problem is left in the workspace, else the solution is as it was."""
    clock = workspace.state.clock[0]
    everything, clock.contacts = clock.contacts, 0
    for k in range(everything):
        if _is_within(h, k, workspace):
            _put(k, clock.contacts, workspace)
            clock.contacts += 1
    held = _solve(rung, h, workspace) == SUPPORTED and not _is_bound_by_inertia(records, h, workspace)
    if held:
        clock.contacts = gather(records, workspace)
        choose_motion(records, rung, h, clock.contacts, shortest, workspace)
    return held


@rare_kernel
def _is_bound_by_inertia(records: Records, h: float, workspace: Workspace) -> bool:
    """Whether bodies move less than half as far with `HEAVIER` times the inertia that stands for none."""
    state, terms, scratch, problem = workspace.state, workspace.terms, workspace.scratch, workspace.problem
    clock = state.clock[0]
    moved, _ = _displacement(records, h, workspace)
    more = (HEAVIER - 1.0) * clock.eps / h
    for i in range(clock.free):
        for b in range(state.q.shape[0]):
            problem.c[i] -= more * terms.inertia[state.free[i], b] * state.speed[b]
        for j in range(clock.free):
            problem.H[i, j] += more * terms.inertia[state.free[i], state.free[j]]
    status = solve_assembled(clock.contacts, clock.limited, clock.free, terms, state, scratch, problem, False)
    if status != SOLVED:
        return True
    for i in range(clock.free):
        scratch.v_new[state.free[i]] = scratch.x[i]
    less, _ = _displacement(records, h, workspace)
    return bool(less < 0.5 * moved)


@kernel
def leaping(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> float:
    """How far the step just solved, of length h and without momentum, moves bodies beyond what is driven: a
    length, 0 where it is no more than steps usually are."""
    if rung[0].inertia > 0.0 or not rung[0].loads or workspace.state.clock[0].chooses:
        return 0.0
    seen = _seen(h, workspace)
    if math.isinf(seen):
        return 0.0
    moved, driven = _displacement(records, h, workspace)
    return moved if moved > max(seen, DRIVEN * driven) else 0.0


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
    far = _seen(h, workspace) if tiny else 0.5 * clock.leapt
    part = (SUDDEN if tiny else SHORTER) * min(h, clock.taken)
    part, _ = set_speeds(records, inputs, buffer, rung, workspace, part)
    if workspace.scratch.undefined[0] >= 0:
        return False
    begin_step(records, rung, workspace, part)
    clock.contacts = gather(records, workspace)
    supported = _solve(rung, part, workspace) == SUPPORTED
    moved, driven = _displacement(records, part, workspace)
    return supported and moved >= max(far, DRIVEN * driven) and _is_thrown(workspace)


@inner_kernel
def _seen(h: float, workspace: Workspace) -> float:
    """Displacement from which on a step is looked at: a part of the smallest shape; under error control,
    where displacements that do not vanish make steps ever shorter, the error allowed in a tiny step."""
    allowed, tiny = workspace.terms.low[0], is_tiny(h, workspace.terms)
    if math.isinf(allowed):
        return float((STRIDE if tiny else LEAST) * workspace.state.clock[0].smallest)
    return float(allowed if tiny else math.inf)


@kernel
def is_coarse(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> bool:
    """Whether a step of fixed length is to be shortened, because bodies move far in it by what may not vanish
    with it: it is not tiny, and nothing settles after a change of inputs. The solution is left as it was."""
    clock, terms = workspace.state.clock[0], workspace.terms
    far = math.isinf(terms.low[0]) and clock.leaping > STRIDE * clock.smallest
    return (
        far
        and not is_tiny(h, terms)
        and not _settles(workspace)
        and not _vanishes(records, rung, h, workspace)
    )


@rare_kernel
def _vanishes(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> bool:
    """Whether a tiny step under the same loads moves bodies hardly at all."""
    supported = _solve(rung, SUDDEN * h, workspace) == SUPPORTED
    moved, _ = _displacement(records, SUDDEN * h, workspace)
    _solve(rung, h, workspace)
    return supported and moved < 0.5 * STRIDE * workspace.state.clock[0].smallest


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


@inner_kernel
def is_tiny(h: float, terms: Terms) -> bool:
    """Whether a step is so short that only what is out of balance at its start moves in it."""
    return bool(h < TINY * terms.pause[0])


@inner_kernel
def _displacement(records: Records, h: float, workspace: Workspace) -> tuple[float, float]:
    """The farthest displacement, as a length, in the step just solved: of free and of driven coordinates."""
    state, moved, driven = workspace.state, 0.0, 0.0
    for i in range(state.q.shape[0]):
        far = h * records.coordinates[i].lever * abs(workspace.scratch.v_new[i])
        if state.prescribed[i]:
            driven = max(driven, far)
        else:
            moved = max(moved, far)
    return moved, driven


@inner_kernel
def _is_within(h: float, k: int, workspace: Workspace) -> bool:
    """Whether contact k is closed, what is driven closes it in a step of length h, or it pushed in the last
    step: a step that takes faces as flat may leave it a little open."""
    state, gap = workspace.state, workspace.terms.gap[k]
    if gap <= NEAR * state.clock[0].reach or state.modes[workspace.scratch.slots[k]] != OPEN:
        return True
    return bool(gap <= -h * carried(workspace.terms.rows, 2 * k, state.speed))


@rare_kernel
def _put(k: int, at: int, workspace: Workspace) -> None:
    """Write what belongs to contact k in the place of contact `at`."""
    terms = workspace.terms
    workspace.scratch.slots[at] = workspace.scratch.slots[k]
    for values in (terms.gap, terms.lever, terms.friction, terms.restitution):
        values[at] = values[k]
    for i in range(2):
        terms.deformation[2 * at + i] = terms.deformation[2 * k + i]
        for j in range(2):
            terms.contact_stiffness[at, i, j] = terms.contact_stiffness[k, i, j]
            terms.contact_damping[at, i, j] = terms.contact_damping[k, i, j]
        for j in range(terms.rows.shape[1]):
            terms.rows[2 * at + i, j] = terms.rows[2 * k + i, j]


@rare_kernel
def _solve(rung: RecordArray, h: float, workspace: Workspace) -> int:
    return solve_step(
        rung, h, workspace.terms, workspace.state.clock[0].contacts, workspace.state, workspace.scratch,
        workspace.problem,
    )  # fmt: skip
