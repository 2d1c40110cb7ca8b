"""The compiled planar loop: steps, halving, events and verdicts, until the run ends or its turn is over.

The way of one step, from the outside in:

    advance           the steps of a turn, and a frame after each
    core.run_step     a step, taken back where a condition begins to hold on its way; conditions, schedule
    take_step         a step: drives, halving until it has a solution
    controlled_step   a step of controlled length: whole and in halves, until the two agree; or just one step
    attempt           one attempt at a length: terms, motion, place, look; accepted, or taken back
    choose_motion     the slowest motion, or of several admissible ones the preferred
    core.solve_step   assembles the rung's problem, and chooses inertia, restitution and theta
    contact.solver    solves it: guess of modes, proximal Newton, search over modes
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.block import Block
from rungwise.contact.step import stretch
from rungwise.kernel import Ints, Reals, RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import ANGLE, SERVO, SPEED, Records
from rungwise.simulation.core.held import keep_near
from rungwise.simulation.core.loop import NOWHERE, SUNK, begin_run, is_taken, run_step
from rungwise.simulation.core.step import SUPPORTED, UNSOLVED, solve_step
from rungwise.simulation.core.tolerances import MAX_HALVINGS, NEAR, PAUSE, ROUNDING
from rungwise.simulation.planar.state.frames import record
from rungwise.simulation.planar.state.laws import tell_laws
from rungwise.simulation.planar.state.memory import keep, restore
from rungwise.simulation.planar.state.nearby import begin_step, fastest_pair, gather, lands, look
from rungwise.simulation.planar.state.passing import thinnest
from rungwise.simulation.planar.state.prescribed_speeds import set_speeds
from rungwise.simulation.planar.state.verdicts import (
    INVALID,
    JAMMED,
    MODEL_INVALID,
    NO_SUPPORT,
    NOT_CONVERGED,
    has_sunk,
    spent,
    withholds,
)
from rungwise.simulation.planar.state.ways import set_ways
from rungwise.simulation.planar.state.workspace import State, Workspace, trial_in
from rungwise.simulation.planar.step.attempt import LEFT_UNSUPPORTED, REFUSED, TAKEN, UNDEFINED
from rungwise.simulation.planar.step.blame import crawls
from rungwise.simulation.planar.step.error_control import LEAPT, controlled_step, until_contact
from rungwise.simulation.planar.step.midpoint_rows import is_centred
from rungwise.simulation.watched.held_since import clear_times
from rungwise.simulation.watched.inputs import Inputs, show_inputs
from rungwise.simulation.watched.values import Conditions, Watched
from rungwise.simulation.watched.verdicts import RUNNING
from rungwise.system import contract
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar
from rungwise.system.planar.place import place
from rungwise.system.planar.pressed import spread_loads
from rungwise.system.planar.seams import find_seams, piece_reach
from rungwise.system.terms import APART, METRIC

HALTED, SNAPPED = 3, 7
"""Statuses beside those of `core.loop`: the step is given up; a leap goes on however short the step."""
STOPPED = 0
"""Place, among the signals, of the signal to stop."""
CLOSED = 1e-9
"""Overlap, or opening of a joint, over the longest lever, that counts as rounding at the start."""


class Plane(Block):
    """A scene in the plane as the loop of its run knows it."""

    records: Records
    rung: RecordArray
    workspace: Workspace


class Setting(NamedTuple):
    """What steps of a run are told by: the inputs, the numbers that vary in time, and the buffer that binding
    reads them from."""

    watched: Watched
    inputs: Inputs
    buffer: Reals


class Run(NamedTuple):
    """What a run is made by beside its scene: what tells it its inputs; programs of the scene's conditions;
    control of steps; the greatest margins so far, of the goal, and of the unsafe or doomed condition that is
    nearer (2,), empty where nobody asks; the verdict as it stands, and whether it is that a segment's
    condition did not hold in its time (2,)."""

    setting: Setting
    conditions: Conditions
    control: RecordArray
    margins: Reals
    verdict: Ints


@kernel
def begin(records: Records, rung: RecordArray, control: RecordArray, workspace: Workspace) -> int:
    """Prepare a run from q and v at t = 0; returns RUNNING, or INVALID when bodies overlap or joints are open
    there."""
    state, terms = workspace.state, workspace.terms
    clock = state.clock[0]
    n = state.q.shape[0]
    copy(state.q, state.start[:n])
    clock.free = 0
    for i in range(n):
        clock.chooses |= state.prefer[i] != 0.0
        drive = records.coordinates[i].drive
        state.prescribed[i] = drive == SPEED or (rung[0].metric and drive == SERVO)
        if not state.prescribed[i]:
            state.free[clock.free] = i
            clock.free += 1
        elif drive == SPEED:
            state.v[i] = records.coordinates[i].drive_speed
    clock.limited = 0
    planar.couple(records, terms.entries.matrices)
    if rung[0].loads:
        clock.limited = planar.constants(records, terms)
        if terms.exact.shape[0] > 0:
            spread_loads(records, terms)
    for i in range(n):
        low, _ = stretch(terms.entries.matrices, i, n)
        terms.metric[i, i - low] = terms.heft[i, METRIC] = records.coordinates[i].metric
    for r in range(clock.limited):
        clock.surfaces |= terms.surface[r] != APART
    clock.drives = clock.limited
    clock.limited = joints.constants(records, rung[0].metric, clock.drives, terms)
    clock.centred = is_centred(rung, control[0].error, terms, state)
    for c in range(records.contacts.shape[0]):
        newton = not rung[0].compliant and rung[0].inertia > 0.0
        clock.bounces |= newton and records.contacts[c].restitution > 0.0
        clock.lifts |= records.contacts[c].lifts
        clock.laws |= records.contacts[c].laws
    if state.laws.shape[1] > 0:
        tell_laws(records, state)
    place(records, state.q, state.placed, True)
    find_seams(records, state.placed, workspace.seams)
    clock.smallest = math.inf
    for s in range(records.shapes.shape[0]):
        reach = piece_reach(s, records, state.placed.outline, workspace.seams)
        if reach > 0.0 and math.isfinite(reach):
            clock.smallest = min(clock.smallest, reach)
            clock.reach = max(clock.reach, reach)
    clock.thin = thinnest(records)
    clock.extent, pose = clock.reach, state.placed.pose
    for b in range(records.bodies.shape[0]):
        clock.extent = max(clock.extent, abs(pose[b, 0]), abs(pose[b, 1]))
    terms.rounding[0] = ROUNDING * clock.extent
    terms.pause[0] = PAUSE * control[0].step
    terms.low[0] = control[0].error if control[0].error > 0.0 else math.inf
    clock.margin = control[0].tolerance
    clock.next = control[0].step
    look(records, workspace, state.v)
    apart = _comes_apart(records, workspace)
    copy(workspace.scratch.measures, state.start[n:])
    clear_times(0, workspace.watched)
    return INVALID if apart or clock.least_gap < -slack(workspace) else RUNNING


@inner_kernel
def slack(workspace: Workspace) -> float:
    """Overlap, or opening of a joint, that counts as rounding at the start."""
    return float(max(CLOSED * workspace.state.clock[0].reach, workspace.terms.rounding[0]))


@kernel
def _comes_apart(records: Records, workspace: Workspace) -> bool:
    """Whether a joint is open at the start, or outside its travel; measures the joints."""
    state, places = workspace.state, workspace.scratch.measures
    measures, apart = records.measures, False
    joints.values(records, state.placed.pose, state.q, workspace.scratch.row, places)
    for m in range(measures.shape[0]):
        most = slack(workspace)
        if measures[m].which == ANGLE:
            most /= records.joints[measures[m].joint].lever
        low, high = (0.0, 0.0) if measures[m].held else (measures[m].lower, measures[m].upper)
        apart |= not low - most <= places[m] <= high + most
    return apart


@kernel
def advance(plane: Plane, run: Run, turns: int, signals: Ints) -> int:
    """Take at most `turns` steps, until signalled to stop; returns the outcome, RUNNING if the run has not
    ended."""
    clock = plane.workspace.state.clock[0]
    if clock.frames == 0:
        begin_run(plane, run)
        record(plane.records, plane.rung, plane.workspace, True)
    for _ in range(turns):
        if run.verdict[0] != RUNNING or signals[STOPPED] != 0:
            break
        taken = is_taken(run_step(plane, run))
        if not taken and run.verdict[0] == RUNNING:
            break
        record(plane.records, plane.rung, plane.workspace, run.verdict[0] != RUNNING)
    return int(run.verdict[0])


@contract.take_step.given_by(Plane)
@kernel
def take_step(plane: Plane, run: Run, h: float) -> int:
    """Take one step, halved as long as it has no solution; the verdict says what it means where it has none.
    None is taken where it is halted first."""
    records, rung, workspace, s, control = (
        plane.records,
        plane.rung,
        plane.workspace,
        run.setting,
        run.control,
    )
    state = workspace.state
    clock = state.clock[0]
    for _ in range(MAX_HALVINGS):
        if workspace.scratch.halt[0] != 0:
            return HALTED
        h, moving = set_speeds(records, s.inputs, s.buffer, rung, workspace, h)
        if not clock.time + h > clock.time:
            break
        if clock.lifts and lands(records, workspace):
            if h <= control[0].step:
                return _ends(run, INVALID)
            h = max(0.5 * h, control[0].step)
            continue
        status, h, following = controlled_step(records, s.inputs, s.buffer, rung, control, workspace, h)
        if status != TAKEN and workspace.scratch.halt[0] != 0:
            return HALTED
        if status == TAKEN:
            if rung[0].metric:
                _note_leap(records, h, state)
            clock.steps += 1
            clock.taken, clock.next, clock.moving = h, following, moving
            if withholds(records, state):
                clock.next = min(clock.next, control[0].step)
            if rung[0].compliant and has_sunk(records, state):
                run.verdict[0] = MODEL_INVALID
                return SUNK
            if crawls(control, state):
                run.verdict[0] = NOT_CONVERGED
                return NOWHERE
            return SUPPORTED
        if status == LEFT_UNSUPPORTED:
            if h <= control[0].step:
                return _ends(run, NO_SUPPORT)
            h = max(0.5 * h, control[0].step)
            continue
        if status == LEAPT:
            clock.snapped = 1
            run.verdict[0] = MODEL_INVALID
            return SNAPPED
        if status == REFUSED and moving > 0.0:
            moved = h * max(moving, _fastest(records, rung, workspace))
            if moved < control[0].jam and _is_jammed(records, rung, workspace, h):
                return _ends(run, JAMMED)
        if status == UNDEFINED and h <= control[0].step:
            return _ends(run, INVALID)
        h = _shorter(records, rung, control, workspace, h) if status == REFUSED else following
    return _ends(run, NOT_CONVERGED)


@inner_kernel
def _ends(run: Run, verdict: int) -> int:
    """The run ends with a step that was not taken."""
    run.verdict[0] = verdict
    return UNSOLVED


@contract.see.given_by(Plane)
@kernel
def see(plane: Plane, run: Run, _h: float) -> None:
    """Places, gaps and forces are told where they are read; inputs vary, and so do ways."""
    clock, s = plane.workspace.state.clock[0], run.setting
    if clock.varies:
        show_inputs(s.inputs, s.watched)
    if s.inputs.rests[0]:
        set_ways(plane.records, plane.workspace.state)


@contract.keep_run.given_by(Plane)
@kernel
def keep_run(plane: Plane, run: Run) -> None:
    """Steps whose error is controlled keep it themselves."""
    if run.control[0].error == 0.0:
        keep(plane.workspace, plane.workspace.kept)


@contract.take_back_run.given_by(Plane)
@kernel
def take_back_run(plane: Plane, _run: Run) -> None:
    restore(plane.records, plane.workspace)


@contract.spent.given_by(Plane)
@kernel
def is_spent(plane: Plane, run: Run, waits: bool) -> int:
    moving = plane.workspace.state.clock[0].moving
    return int(spent(plane.records, run.control, plane.workspace, moving, run.setting.inputs, waits))


@rare_kernel
def _is_jammed(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> bool:
    """Whether a step of length h, linearised where it begins, has no solution by contacts alone that are
    closed there or that driven motion closes in it; their problem is left in the workspace. One that closes
    in just this step may leave it without solution, and the next step with one."""
    begin_step(records, rung, workspace, h)
    clock = workspace.state.clock[0]
    contacts = gather(records, workspace)
    clock.contacts = keep_near(trial_in(rung, h, contacts, workspace), NEAR * clock.reach)
    return solve_step(trial_in(rung, h, clock.contacts, workspace)) == UNSOLVED


@rare_kernel
def _fastest(records: Records, rung: RecordArray, workspace: Workspace) -> float:
    """The fastest approach of a pair: a pushed body may move faster than the body that pushes it."""
    return fastest_pair(records, rung, workspace.terms, workspace.state, workspace.state.v, 0.0)


@rare_kernel
def _note_leap(records: Records, h: float, state: State) -> None:
    """Remember the farthest motion in a step of anything that a servo, followed exactly, moves."""
    clock = state.clock[0]
    for i in range(state.q.shape[0]):
        c = records.coordinates[i]
        farthest = abs(clock.leap) * records.coordinates[clock.leaper].lever
        if c.drive == SERVO and abs(h * state.speed[i]) * c.lever > farthest:
            clock.leaper, clock.leap = i, h * state.speed[i]
            clock.leap_time, clock.leap_step = clock.time, h


@rare_kernel
def _shorter(
    records: Records, rung: RecordArray, control: RecordArray, workspace: Workspace, h: float
) -> float:
    """The next step to try after a refusal: up to the first contact to close, or else half of the refused
    step."""
    landing, _ = until_contact(records, rung, workspace, h, 1e-3 * control[0].tolerance, 0.0, 0.0, math.inf)
    return landing if landing < 0.999 * h else 0.5 * h
