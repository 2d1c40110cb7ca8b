"""Many runs in one compiled call: bind a sample, run it to its outcome, keep the verdict and its margin."""

from __future__ import annotations

import math

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, kernel, record_type
from rungwise.scene.bind import bind, origin
from rungwise.scene.faults import BOUND
from rungwise.scene.records import Records
from rungwise.scene.template import Bounds, Numbers
from rungwise.simulation.planar.loop import begin, run_step
from rungwise.simulation.planar.memory import clear
from rungwise.simulation.planar.verdicts import GOAL, INVALID, NOT_CONVERGED, RUNNING, judge, margin
from rungwise.simulation.planar.workspace import Conditions, Workspace
from rungwise.system.planar.place import start

RESULT = record_type("outcome steps attempts", "time margin worst_residual")
"""One run: its outcome's code, counts, the time of its end, signed margin and worst scaled residual."""

OPTIONS = record_type("", "step duration tol longest jam budget")
"""nan: the scene's own step or duration. tol 0: fixed steps; longest: in parts of the duration; jam: in parts
of the goal's tolerance; budget: greatest number of steps of a run."""

STOPPED = 0
"""Place, among the signals, of the signal to stop."""


class Programs(Block):
    """The data shared by all samples: programs, checks, and the numbers that samples begin with."""

    numbers: Numbers
    bounds: Bounds
    buffer: Reals
    parameters: Reals
    blank: RecordArray


class Place(Block):
    """The arrays of one thread: the numbers of its sample, the records that are views of them, the
    workspace."""

    buffer: Reals
    control: RecordArray
    records: Records
    workspace: Workspace


@kernel
def run_samples(
    programs: Programs,
    timed: Numbers,
    conditions: Conditions,
    rung: RecordArray,
    options: RecordArray,
    columns: Ints,
    points: Reals,
    signals: Ints,
    place: Place,
    results: RecordArray,
    final: Reals,
) -> None:
    """Run `points` (m, k), values of `columns` (k,), into `results` (m,) and `final` (m, 2 n).

    Columns count parameters, then the coordinates' places at the start, then their speeds; `final` has places
    and speeds at the end.

    A sample does not depend on earlier samples. The kernel ends early, with results left RUNNING, when
    signalled.
    """
    for i in range(points.shape[0]):
        if signals[STOPPED] != 0:
            break
        results[i].outcome = _run(
            programs, timed, conditions, rung, options, columns, points[i], signals, place, results[i : i + 1]
        )
        state = place.workspace.state
        for j in range(state.q.shape[0]):
            final[i, j] = state.q[j]
            final[i, state.q.shape[0] + j] = state.v[j]


@kernel
def _run(
    programs: Programs,
    timed: Numbers,
    conditions: Conditions,
    rung: RecordArray,
    options: RecordArray,
    columns: Ints,
    point: Reals,
    signals: Ints,
    place: Place,
    result: RecordArray,
) -> int:
    """Run one sample; returns its outcome, and writes the rest into result[0]."""
    workspace, control = place.workspace, place.control
    state, scratch = workspace.state, workspace.scratch
    clock = state.clock[0]
    result[0].margin = math.nan
    result[0].steps = result[0].attempts = 0
    result[0].time = result[0].worst_residual = 0.0
    if not _bind(programs, columns, point, place):
        state.q[:] = math.nan
        state.v[:] = math.nan
        return INVALID
    _set_control(options, place)
    clear(workspace, programs.blank)
    start(place.records, state.q, state.v)
    if begin(place.records, rung, control, workspace) == INVALID:
        return INVALID
    outcome = judge(conditions, state, scratch)
    best, danger = _watch(conditions, workspace, -math.inf, -math.inf)
    while outcome == RUNNING:
        if signals[STOPPED] != 0:
            return RUNNING
        if clock.steps >= options[0].budget:
            outcome = NOT_CONVERGED
            break
        outcome = run_step(place.records, timed, conditions, place.buffer, rung, control, workspace)
        best, danger = _watch(conditions, workspace, best, danger)
    result[0].margin = _margin(outcome, best, danger, 1.0 - clock.time / control[0].duration)
    result[0].steps, result[0].attempts = clock.steps, clock.attempts
    result[0].time, result[0].worst_residual = clock.time, clock.worst_residual
    return outcome


@kernel
def _bind(programs: Programs, columns: Ints, point: Reals, place: Place) -> bool:
    """Write the sample's numbers into the thread's records; false when the scene is impossible there."""
    values, records = place.workspace.state.values, place.records
    values[:] = 0.0
    for j in range(programs.parameters.shape[0]):
        values[j] = programs.parameters[j]
    known = programs.parameters.shape[0]
    for j in range(columns.shape[0]):
        if columns[j] < known:
            values[columns[j]] = point[j]
    for j in range(place.buffer.shape[0]):
        place.buffer[j] = programs.buffer[j]
    stack = place.workspace.scratch.stack
    fault, _ = bind(programs.numbers, programs.bounds, values, stack, place.buffer, records)
    values[values.shape[0] - 1] = records.world[0].tolerance
    possible = fault == BOUND
    for j in range(columns.shape[0]):
        if possible and columns[j] >= known:
            possible = _start(records, columns[j] - known, point[j])
    return possible


@kernel
def _start(records: Records, column: int, value: float) -> bool:
    """Let a coordinate start at this place, or at this speed; whether it lies within its travel."""
    n = records.coordinates.shape[0]
    i = column % n
    c = records.coordinates[i]
    if column >= n:
        c.speed = value
        return True
    c.start = value - origin(records.bodies[c.body], i)
    return bool(c.lower <= value <= c.upper)


@kernel
def _set_control(options: RecordArray, place: Place) -> None:
    """Set step, duration and tolerances of this sample."""
    world, control, wanted = place.records.world[0], place.control[0], options[0]
    control.step = world.step if math.isnan(wanted.step) else wanted.step
    control.duration = world.duration if math.isnan(wanted.duration) else wanted.duration
    control.tolerance = world.tolerance
    control.error = wanted.tol
    control.longest = control.step if wanted.tol == 0.0 else wanted.longest * control.duration
    control.jam = wanted.jam * world.tolerance


@kernel
def _watch(conditions: Conditions, workspace: Workspace, best: float, danger: float) -> tuple[float, float]:
    """Greatest margins so far: of the goal, and of the unsafe and doomed conditions."""
    state, scratch = workspace.state, workspace.scratch
    goal = margin(conditions, 0, state, scratch)
    if goal > best:
        best = goal
    for index in (1, 2):
        near = margin(conditions, index, state, scratch)
        if near > danger:
            danger = near
    return best, danger


@kernel
def _margin(outcome: int, best: float, danger: float, left: float) -> float:
    """Signed margin of a run: with the goal reached, how far it stayed from a condition that would have ended
    it (without such conditions, the part of the time that was left); otherwise how near it came to the goal,
    negative."""
    if outcome == GOAL:
        return -danger if danger > -math.inf else left
    return min(best, 0.0) if best > -math.inf else math.nan
