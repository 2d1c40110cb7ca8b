"""The compiled planar loop: steps, halving, events and verdicts, until the run ends or its turn is over.

The way of one step, from the outside in:

    advance           the steps of a turn, and a frame after each
    run_step          a run's step: drives, halving until it has a solution, conditions
    controlled_step   a step of controlled length: whole and in halves, until the two agree; or just one step
    attempt           one attempt at a length: terms, motion, place, look; accepted, or taken back
    choose_motion     the slowest motion, or of several admissible ones the preferred
    core.solve_step   assembles the rung's problem, and chooses inertia, restitution and theta
    contact.solver    solves it: guess of modes, proximal Newton, search over modes
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.step import stretch
from rungwise.kernel import Ints, Reals, RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import ANGLE, SERVO, SPEED, Records
from rungwise.simulation.core.held import keep_near
from rungwise.simulation.core.step import UNSOLVED, solve_step
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
    MISSED,
    MODEL_INVALID,
    NO_SUPPORT,
    NOT_CONVERGED,
    TIMEOUT,
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
from rungwise.simulation.watched.held_since import DATINGS, clear_times, is_over, lasts
from rungwise.simulation.watched.inputs import (
    Inputs,
    is_guarded,
    shortened,
    show_inputs,
    switch_inputs,
    until_lasts,
    until_margin,
)
from rungwise.simulation.watched.values import Conditions
from rungwise.simulation.watched.verdicts import RUNNING, ended, first_times, judge, look_back, next_end
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar
from rungwise.system.planar.place import place
from rungwise.system.planar.pressed import spread_loads
from rungwise.system.planar.seams import find_seams, piece_reach
from rungwise.system.terms import APART, METRIC

STOPPED = 0
"""Place, among the signals, of the signal to stop."""
CLOSED = 1e-9
"""Overlap, or opening of a joint, over the longest lever, that counts as rounding at the start."""


class Setting(NamedTuple):
    """What steps of a run are taken by: the scene's records; its inputs, the numbers that vary in time, and
    the buffer that binding reads them from; programs of the scene's conditions; rung, and control of
    steps."""

    records: Records
    inputs: Inputs
    conditions: Conditions
    buffer: Reals
    rung: RecordArray
    control: RecordArray


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
def advance(setting: Setting, workspace: Workspace, turns: int, signals: Ints) -> int:
    """Take at most `turns` steps, until signalled to stop; returns the outcome, RUNNING if the run has not
    ended."""
    records, rung = setting.records, setting.rung
    state = workspace.state
    clock = state.clock[0]
    if clock.frames == 0:
        clock.outcome = first_verdict(setting, workspace)
        record(records, rung, workspace, True)
    for _ in range(turns):
        if clock.outcome != RUNNING or signals[STOPPED] != 0:
            break
        steps = clock.steps
        clock.outcome = run_step(setting, workspace)
        if clock.steps == steps and clock.outcome == RUNNING:
            break
        record(records, rung, workspace, clock.outcome != RUNNING)
    return clock.outcome


@kernel
def first_verdict(setting: Setting, workspace: Workspace) -> int:
    """Verdict at the beginning of a run; segments whose condition holds already end there, and a run whose
    segment has no time left for its condition."""
    inputs, control = setting.inputs, setting.control
    if inputs.rests[0]:
        set_ways(setting.records, workspace.state)
    if not first_times(setting.conditions, inputs, workspace.watched):
        return INVALID
    verdict = judge(setting.conditions, workspace.watched)
    if switch_inputs(inputs, setting.buffer, 0.0, workspace.watched):
        return TIMEOUT if verdict == RUNNING else verdict
    spent_all = workspace.state.clock[0].segment >= inputs.durations.shape[0]
    return MISSED if verdict == RUNNING and control[0].ends and spent_all else verdict


@kernel
def run_step(setting: Setting, workspace: Workspace) -> int:
    """Take one step, halved as long as it has no solution; a step longer than a nominal step ends before a
    condition holds, so that the condition's beginning is known to a nominal step. None is taken where it is
    halted first."""
    records, inputs, conditions, buffer, rung, control = setting
    state, watched = workspace.state, workspace.watched
    clock = state.clock[0]
    planned = min(clock.next, control[0].longest)
    stop, lasting, dated = clock.switch, lasts(conditions) or until_lasts(inputs), 0
    if lasting:
        stop = min(stop, next_end(conditions, inputs, -math.inf, watched))
    h = min(planned, control[0].duration - clock.time, stop - clock.time)
    cut = stop - clock.time < planned
    past, guarded = False, is_guarded(inputs, watched)
    before = until_margin(inputs, watched) if guarded else -math.inf
    if h > control[0].step or lasting:
        copy(state.values, watched.begun)
    if guarded or lasting:
        keep(workspace, workspace.kept)
    for _ in range(MAX_HALVINGS):
        if workspace.scratch.halt[0] != 0:
            return RUNNING
        h, moving = set_speeds(records, inputs, buffer, rung, workspace, h)
        if not clock.time + h > clock.time:
            return NOT_CONVERGED
        if clock.lifts and lands(records, workspace):
            if h <= control[0].step:
                return INVALID
            h = max(0.5 * h, control[0].step)
            continue
        status, h, following = controlled_step(records, inputs, buffer, rung, control, workspace, h)
        if status != TAKEN and workspace.scratch.halt[0] != 0:
            return RUNNING
        if status == TAKEN:
            if rung[0].metric:
                _note_leap(records, h, state)
            if clock.varies:
                show_inputs(inputs, watched)
            if inputs.rests[0]:
                set_ways(records, state)
            verdict = judge(conditions, watched)
            if h > control[0].step:
                clear = look_back(verdict, conditions, inputs, control, h, watched)
                if clear < 1.0:
                    restore(records, workspace)
                    h = max(min(clear, 0.5) * h if past else clear * h, control[0].step)
                    past = True
                    continue
            part = shortened(inputs, control, before, h, watched) if guarded else 1.0
            if part < 1.0:
                restore(records, workspace)
                h, past = part * h, True
                continue
            waits = False
            if lasting:
                end = ended(conditions, inputs, h, dated < DATINGS, watched)
                if end < clock.time:
                    restore(records, workspace)
                    stop, cut, dated = end, True, dated + 1
                    h = end - clock.time
                    continue
                waits = end < math.inf
                verdict = judge(conditions, watched)
            clock.steps += 1
            clock.taken = h
            clock.next = control[0].step if past else following
            if cut and following >= h and is_over(stop, clock.time, h):
                clock.next = max(clock.next, planned)
            if withholds(records, state):
                clock.next = min(clock.next, control[0].step)
            if rung[0].compliant and has_sunk(records, state):
                return MODEL_INVALID
            if verdict != RUNNING:
                return verdict
            left = clock.segment < inputs.durations.shape[0]
            if left and switch_inputs(inputs, buffer, h, watched):
                return TIMEOUT
            if crawls(control, state):
                return NOT_CONVERGED
            return spent(records, control, workspace, moving, inputs, waits)
        if status == LEFT_UNSUPPORTED:
            if h <= control[0].step:
                return NO_SUPPORT
            h = max(0.5 * h, control[0].step)
            continue
        if status == LEAPT:
            clock.snapped = 1
            return MODEL_INVALID
        if status == REFUSED and moving > 0.0:
            moved = h * max(moving, _fastest(records, rung, workspace))
            if moved < control[0].jam and _is_jammed(records, rung, workspace, h):
                return JAMMED
        if status == UNDEFINED and h <= control[0].step:
            return INVALID
        h = _shorter(records, rung, control, workspace, h) if status == REFUSED else following
    return NOT_CONVERGED


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
