"""Which of the motions that a step admits is taken: the slowest, or the nearest to a preferred velocity.

A quasistatic or kinematic step from which loads, drives and friction do not single out one motion admits many
velocities. The slowest velocity is the nearest to zero in the norm of the inertia; here a preferred velocity
replaces zero. Far preferences give the extremes of the admissible motions. An object for which rest is
admissible
rests: so first the slowest motion says what moves, then as many of the moving objects are held as can be,
objects without a preference first, and the remaining objects take the motion nearest to their preference.
Every motion found in this way is admissible: it solves the step's own problem.
"""

from __future__ import annotations

import math

from rungwise.kernel import Record, RecordArray, copy, kernel, rare_kernel
from rungwise.scene.template.records import NO_DRIVE, Records
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.planar.state.workspace import State, Workspace, trial_in
from rungwise.system.planar.place import coordinate_count, turns

SUDDEN = 5
"""A status beside the statuses of `solve_step`: a preferred motion begins, or goes too far, in so long a
step."""
REST = 1e-6
"""A body slower than this part of the pace rests."""
STRIDE = 0.05
"""How far a preferred motion may go in one step, over the smallest shape's reach: conditions see each
step."""
ONSET = 1e-4
"""How far a preferred motion may go in the step in which it begins, in the same unit: this dates its
beginning."""
FLUNG = 10.0
"""A body faster than the pace by this factor takes part in a preferred motion."""
FAR = 10.0
"""How far from its start a preferred motion may take a body that nothing stops, in extents of the scene; an
angle may go once around."""


@kernel
def choose_motion(
    records: Records, rung: RecordArray, h: float, contacts: int, shortest: float, workspace: Workspace
) -> int:
    """Solve the step as `solve_step`; where a motion is preferred, take the admissible motion nearest to it,
    or return SUDDEN in a step longer than `shortest`."""
    state, scratch = workspace.state, workspace.scratch
    clock = state.clock[0]
    status = _solve(rung, h, contacts, workspace)
    if status != SUPPORTED or not clock.chooses:
        return status
    pace = _pace(records, workspace)
    if pace == 0.0:
        return status
    copy(scratch.v_new, scratch.slowest)
    clock.leans = 1
    moving = 0
    for b in range(records.bodies.shape[0]):
        if _is_object(records, b, state):
            rests = _rests(records, records.bodies[b], pace, workspace)
            rests &= not _goes_on(records, records.bodies[b], pace, workspace)
            _hold(records.bodies[b], rests, workspace)
            moving += not rests
    for preferred in (False, True):
        for b in range(records.bodies.shape[0]):
            body = records.bodies[b]
            if moving > 1 and _may_be_held(records, b, preferred, pace, workspace):
                _hold(body, True, workspace)
                rests = _solve(rung, h, contacts, workspace) == SUPPORTED
                _hold(body, rests, workspace)
                moving -= rests
    if moving > 0:
        _wish(records, pace, workspace)
        status = _solve(rung, h, contacts, workspace)
        if status == SUPPORTED and h > shortest and _is_sudden(records, h, pace, workspace):
            status = SUDDEN
        if rung[0].loads and clock.eps == 1.0:
            scratch.contact_force[:] = 0.0
            scratch.limited_force[:] = 0.0
    clock.leans = 0
    state.wish[:] = 0.0
    scratch.held[:] = 0
    _set_free(workspace)
    return status


@kernel
def _solve(rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> int:
    return solve_step(trial_in(rung, h, contacts, workspace))


@kernel
def _is_object(records: Records, b: int, state: State) -> bool:
    """Whether a body moves and nothing drives it."""
    body, measures = records.bodies[b], records.measures
    count = coordinate_count(body)
    alone = count > 0
    for i in range(body.coordinate, body.coordinate + count):
        alone &= not state.prescribed[i] and records.coordinates[i].drive == NO_DRIVE
    for m in range(measures.shape[0]):
        joint = records.joints[measures[m].joint]
        alone &= measures[m].drive == NO_DRIVE or b not in (joint.body_a, joint.body_b)
    return alone


@rare_kernel
def _may_be_held(records: Records, b: int, preferred: bool, pace: float, workspace: Workspace) -> bool:
    """Whether a body is an object that is not held yet, with or without a preferred motion."""
    state, body, asked = workspace.state, records.bodies[b], False
    if not _is_object(records, b, state) or workspace.scratch.held[body.coordinate]:
        return False
    for i in range(body.coordinate, body.coordinate + coordinate_count(body)):
        asked |= state.prefer[i] != 0.0
    return asked == preferred and not _goes_on(records, body, pace, workspace)


@rare_kernel
def _pace(records: Records, workspace: Workspace) -> float:
    """Greatest speed of any coordinate in the slowest motion."""
    fastest = 0.0
    for i in range(records.coordinates.shape[0]):
        fastest = max(fastest, abs(workspace.scratch.v_new[i]) * records.coordinates[i].lever)
    return fastest


@rare_kernel
def _rests(records: Records, body: Record, pace: float, workspace: Workspace) -> bool:
    rests = True
    for i in range(body.coordinate, body.coordinate + coordinate_count(body)):
        rests &= abs(workspace.scratch.slowest[i]) * records.coordinates[i].lever <= REST * pace
    return rests


@rare_kernel
def _goes_on(records: Records, body: Record, pace: float, workspace: Workspace) -> bool:
    """Whether a preferred motion has begun and nothing has stopped the body: in the limit of fast motions it
    is one step, however many it takes here. A motion that has gone too far ends."""
    state, along, asked, fastest = workspace.state, 0.0, 0.0, 0.0
    for i in range(body.coordinate, body.coordinate + coordinate_count(body)):
        unit = records.coordinates[i].lever
        along += state.prefer[i] * state.v[i] * unit
        asked += state.prefer[i] * state.prefer[i] * pace
        fastest = max(fastest, abs(state.v[i]) * unit)
        if _has_gone_far(records, i, workspace):
            return False
    return fastest > FLUNG * pace or along > 0.5 * asked


@rare_kernel
def _has_gone_far(records: Records, i: int, workspace: Workspace) -> bool:
    """Whether a coordinate is so far from its start that its motion is no longer preferred."""
    is_angle = turns(records.bodies[records.coordinates[i].body], i)
    far = 2.0 * math.pi if is_angle else FAR * workspace.terms.rounding[0] / ROUNDING
    return bool(abs(workspace.state.q[i] - workspace.state.start[i]) > far)


@rare_kernel
def _hold(body: Record, holds: bool, workspace: Workspace) -> None:
    """Take a body's coordinates out of the unknowns, at rest, or back into them."""
    for i in range(body.coordinate, body.coordinate + coordinate_count(body)):
        workspace.scratch.held[i] = holds
    _set_free(workspace)


@rare_kernel
def _set_free(workspace: Workspace) -> None:
    state = workspace.state
    clock = state.clock[0]
    clock.free = 0
    for i in range(state.q.shape[0]):
        if not state.prescribed[i] and not workspace.scratch.held[i]:
            state.free[clock.free] = i
            clock.free += 1


@rare_kernel
def _wish(records: Records, pace: float, workspace: Workspace) -> None:
    """Fill in the preferred velocities of the bodies that are not held."""
    state = workspace.state
    for i in range(state.q.shape[0]):
        held = state.prescribed[i] or workspace.scratch.held[i]
        if not held and not _has_gone_far(records, i, workspace):
            state.wish[i] = state.prefer[i] * pace / records.coordinates[i].lever


@rare_kernel
def _is_sudden(records: Records, h: float, pace: float, workspace: Workspace) -> bool:
    """Whether a preferred motion begins in this step, or goes far in it."""
    state, scratch = workspace.state, workspace.scratch
    size = min(state.clock[0].smallest, workspace.terms.rounding[0] / ROUNDING)
    sudden = False
    for i in range(state.q.shape[0]):
        unit = records.coordinates[i].lever
        beyond = unit * abs(scratch.v_new[i] - scratch.slowest[i])
        if beyond > REST * pace:
            begins = abs(state.v[i]) * unit <= REST * pace
            sudden |= h * beyond > (ONSET if begins else STRIDE) * size
    return sudden
