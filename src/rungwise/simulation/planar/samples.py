"""Many runs in one compiled call: bind a sample, run it to its outcome, keep the verdict and its margin."""

from __future__ import annotations

import math

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, copy, kernel, record_type
from rungwise.scene.bind.bind import bind
from rungwise.scene.template.faults import BOUND
from rungwise.scene.template.records import Records
from rungwise.scene.template.template import Bounds, Numbers
from rungwise.simulation.planar.begin import begin_by_hand, take_start
from rungwise.simulation.planar.loop import STOPPED, Setting, begin, first_verdict, run_step
from rungwise.simulation.planar.state.memory import clear, go_on
from rungwise.simulation.planar.state.verdicts import INVALID, MODEL_INVALID, NOT_CONVERGED, crushed
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.watched.inputs import Inputs, begin_inputs
from rungwise.simulation.watched.values import Conditions
from rungwise.simulation.watched.verdicts import GOAL, RUNNING, margins

RESULT = record_type("outcome steps attempts solves switches", "time margin worst_residual")
"""One run: its outcome's code, counts, the time of its end, signed margin and worst scaled residual.
`switches` are the segments of its schedule that ended."""

OPTIONS = record_type("", "step duration tol longest jam budget span")
"""nan: the scene's own step or duration. tol 0: fixed steps; longest: how often it goes into the span, which
is the run's own duration where it is nan; jam: in parts of the goal's tolerance; budget: greatest number of
steps of a run."""

NOWHERE = 0.3
"""Part of the greatest number of steps: after so many attempts that lead no farther than a nominal step, a
run with such a bound ends."""


class Programs(Block):
    """The data shared by all samples: programs, checks, and the numbers that samples begin with."""

    numbers: Numbers
    bounds: Bounds
    buffer: Reals
    parameters: Reals
    blank: RecordArray


class Place(Block):
    """The arrays of one thread: the numbers of its sample, the records that are views of them, the inputs,
    the workspace."""

    buffer: Reals
    control: RecordArray
    records: Records
    inputs: Inputs
    workspace: Workspace


class Samples(Block):
    """m runs of s segments; an array of one row, or none, serves all runs.

    points     (m, k)        values of parameters
    bodies     (m, 2 n + 1)  q, v and time at the start; no row: the scene's own start
    memories   (r, w)        states to go on from
    memory     (m,)          row of the memory that a run goes on from, or -1
    durations  (m, s)        of segments
    levels     (m, s, u)     of inputs
    wrong      (m,)          whether a run is not to be made
    results    (m,)          outcomes
    final      (m, 2 n)      places and speeds at the end
    kept       (m, s, w)     memories at the switches, the end last; no row: not kept
    """

    points: Reals
    bodies: Reals
    memories: Reals
    memory: Ints
    durations: Reals
    levels: Reals
    wrong: Ints
    results: RecordArray
    final: Reals
    kept: Reals


@kernel
def run_samples(
    programs: Programs,
    conditions: Conditions,
    rung: RecordArray,
    options: RecordArray,
    columns: Ints,
    samples: Samples,
    first: int,
    last: int,
    signals: Ints,
    place: Place,
) -> None:
    """Make the runs `first` to `last`, excluded; points are the values of the parameters `columns` (k,).

    A run does not depend on earlier runs. The kernel ends early when signalled: the run that goes on is left
    RUNNING where it has come to, and the others as they are.
    """
    for i in range(first, last):
        if signals[STOPPED] != 0:
            break
        result = samples.results[i : i + 1]
        result[0].margin = math.nan
        result[0].steps = result[0].attempts = result[0].solves = result[0].switches = 0
        result[0].time = result[0].worst_residual = 0.0
        state = place.workspace.state
        result[0].outcome = INVALID
        if samples.wrong[i] == 0 and _prepare(programs, rung, options, columns, samples, i, place):
            result[0].outcome = _run(conditions, rung, options, samples, i, signals, place, result)
        elif samples.wrong[i] != 0:
            state.q[:] = math.nan
            state.v[:] = math.nan
        copy(state.q, samples.final[i, : state.q.shape[0]])
        copy(state.v, samples.final[i, state.q.shape[0] :])


@kernel
def _prepare(
    programs: Programs,
    rung: RecordArray,
    options: RecordArray,
    columns: Ints,
    samples: Samples,
    i: int,
    place: Place,
) -> bool:
    """Bind sample i and begin its run; whether that is possible."""
    workspace, control, records = place.workspace, place.control, place.records
    state = workspace.state
    if not _bind(programs, columns, samples.points[i], place):
        state.q[:] = math.nan
        state.v[:] = math.nan
        return False
    _set_control(options, place)
    clear(workspace, programs.blank)
    memory, bodies, n = samples.memory[i], samples.bodies, state.q.shape[0]
    if bodies.shape[0] > 0:
        row = bodies[min(i, bodies.shape[0] - 1)]
        copy(row[:n], state.q)
        copy(row[n : 2 * n], state.v)
        state.clock[0].time = row[2 * n]
    else:
        take_start(records, rung, state)
    _set_schedule(samples, i, options, place)
    begin_inputs(place.inputs, place.buffer, workspace.watched)
    if bodies.shape[0] > 0 and memory < 0:
        code = begin_by_hand(records, rung, control, workspace)
    else:
        code = begin(records, rung, control, workspace)
    if memory >= 0:
        go_on(records, workspace, samples.memories[memory])
        begin_inputs(place.inputs, place.buffer, workspace.watched)
        return True
    return code != INVALID


@kernel
def _set_schedule(samples: Samples, i: int, options: RecordArray, place: Place) -> None:
    """Take over the schedule of sample i; the run ends with it where no duration is given."""
    durations, levels, control = place.inputs.durations, place.inputs.levels, place.control[0]
    if durations.shape[0] == 0:
        return
    copy(samples.durations[min(i, samples.durations.shape[0] - 1)], durations)
    row = samples.levels[min(i, samples.levels.shape[0] - 1)]
    for k in range(levels.shape[0]):
        copy(row[k], levels[k])
    if math.isnan(options[0].duration):
        control.duration, control.ends = place.workspace.state.clock[0].time, 1
        for k in range(durations.shape[0]):
            control.duration += durations[k]


@kernel
def _run(
    conditions: Conditions,
    rung: RecordArray,
    options: RecordArray,
    samples: Samples,
    i: int,
    signals: Ints,
    place: Place,
    result: RecordArray,
) -> int:
    """Run one sample that has begun; returns its outcome, and writes the rest into result[0]."""
    workspace, control = place.workspace, place.control
    state, kept = workspace.state, samples.kept
    clock = state.clock[0]
    began = clock.time
    control[0].longest = control[0].step
    if options[0].tol > 0.0:
        span = control[0].duration if math.isnan(options[0].span) else options[0].span
        control[0].longest = span / options[0].longest
    setting = Setting(place.records, place.inputs, conditions, place.buffer, rung, control)
    outcome = first_verdict(setting, workspace)
    best, danger = _watch(conditions, workspace, -math.inf, -math.inf)
    ended = _keep_switches(samples, i, 0, workspace)
    while outcome == RUNNING and signals[STOPPED] == 0 and workspace.scratch.halt[0] == 0:
        if clock.steps >= options[0].budget or clock.crowd >= NOWHERE * options[0].budget:
            outcome = NOT_CONVERGED
            break
        outcome = run_step(setting, workspace)
        if outcome == NOT_CONVERGED and crushed(rung, workspace) >= 0:
            outcome = MODEL_INVALID
        best, danger = _watch(conditions, workspace, best, danger)
        ended = _keep_switches(samples, i, ended, workspace)
    if kept.shape[0] > 0 and ended < kept.shape[1]:
        copy(state.memory, kept[i, ended])
    left = 0.0
    if control[0].duration > began:
        left = 1.0 - (clock.time - began) / (control[0].duration - began)
    result[0].margin = _margin(outcome, best, danger, left)
    result[0].steps, result[0].attempts, result[0].switches = clock.steps, clock.attempts, ended
    result[0].solves = clock.solves
    result[0].time, result[0].worst_residual = clock.time, clock.worst_residual
    return outcome


@kernel
def _keep_switches(samples: Samples, i: int, ended: int, workspace: Workspace) -> int:
    """Keep the state for each segment that ended now, `ended` of them being known; returns how many have."""
    state = workspace.state
    while ended < state.clock[0].segment:
        if samples.kept.shape[0] > 0:
            copy(state.memory, samples.kept[i, ended])
        ended += 1
    return ended


@kernel
def _bind(programs: Programs, columns: Ints, point: Reals, place: Place) -> bool:
    """Write the sample's numbers into the thread's records; false when the scene is impossible there."""
    values, records = place.workspace.state.values, place.records
    values[:] = 0.0
    for j in range(programs.parameters.shape[0]):
        values[j] = programs.parameters[j]
    for j in range(columns.shape[0]):
        values[columns[j]] = point[j]
    for j in range(place.buffer.shape[0]):
        place.buffer[j] = programs.buffer[j]
    stack = place.workspace.watched.stack
    fault, _ = bind(programs.numbers, programs.bounds, values, stack, place.buffer, records)
    values[values.shape[0] - 1] = records.world[0].tolerance
    return fault == BOUND


@kernel
def _set_control(options: RecordArray, place: Place) -> None:
    """Set step, duration and tolerances of this sample."""
    world, control, wanted = place.records.world[0], place.control[0], options[0]
    control.ends = 0
    control.step = world.step if math.isnan(wanted.step) else wanted.step
    control.duration = world.duration if math.isnan(wanted.duration) else wanted.duration
    control.tolerance = world.tolerance
    control.error = wanted.tol
    control.jam = wanted.jam * world.tolerance


@kernel
def _watch(conditions: Conditions, workspace: Workspace, best: float, danger: float) -> tuple[float, float]:
    """Greatest margins so far: of the goal, and of the unsafe and doomed conditions."""
    goal, near = margins(conditions, workspace.watched)
    return goal if goal > best else best, near if near > danger else danger


@kernel
def _margin(outcome: int, best: float, danger: float, left: float) -> float:
    """Signed margin of a run: with the goal reached, how far it stayed from a condition that would have ended
    it (without such conditions, the part of the time that was left); otherwise how near it came to the goal,
    negative."""
    if outcome == GOAL:
        return -danger if danger > -math.inf else left
    return min(best, 0.0) if best > -math.inf else math.nan
