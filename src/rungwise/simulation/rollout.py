"""Rollouts: many runs from states, each with inputs in segments, in compiled threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.scene import Scene, SceneError
from rungwise.scene.values import shown
from rungwise.simulation.crew import CHUNK, Crew, names_of, outside
from rungwise.simulation.inputs import ScheduleError, Segment, condition
from rungwise.simulation.options import moving_rung
from rungwise.simulation.planar.workspace import State as Like
from rungwise.simulation.planar.workspace import in_memory
from rungwise.simulation.questions import States, rows_of
from rungwise.simulation.result import Run, pair_labels
from rungwise.simulation.run import Simulation, simulate
from rungwise.simulation.state import FARTHEST, Memory, State, StateError, check_state, digest, memory_of

WORK = ("drive_work", "load_work", "contact_work", "support_work", "joint_work")


@dataclass(frozen=True)
class Rollouts:
    """m runs of s segments, of a scene of n coordinates.

    outcome (m,) codes (see `rungwise.outcome.Code`), margin (m,) as of `Results`, time (m,) of the end,
    steps, attempts and worst_residual (m,), switches (m,): how many segments ended; final, speed (m, n) at
    the end. `faults` maps samples with wrong values to a line that names the value; they are `invalid`.

    With `keep`, also the states in which segments ended; the end of a run stands in the column of the segment
    in which it ended, and later columns are nan: see `times`, `q`, `v`, `modes`, `forces`, `work`, `state`.
    """

    scene: Scene
    model: Rung
    outcome: Ints
    margin: Reals
    time: Reals
    steps: Ints
    attempts: Ints
    switches: Ints
    worst_residual: Reals
    final: Reals
    speed: Reals
    faults: dict[int, str]
    memory: Reals = field(repr=False)
    _like: Like = field(repr=False)
    _options: Callable[[int], dict[str, Any]] = field(repr=False)
    _schedules: Callable[[int], tuple[Segment, ...]] = field(repr=False)
    _theta: float = field(repr=False)

    @property
    def times(self) -> Reals:
        """Times (m, s) at the ends of segments."""
        return self._kept("time")

    @property
    def q(self) -> Reals:
        """Places (m, s, n) at the ends of segments."""
        return self._kept("q")

    @property
    def v(self) -> Reals:
        """Velocities (m, s, n) at the ends of segments."""
        return self._kept("v")

    @property
    def points(self) -> list[str]:
        """Labels (p,) of contact points, two for each pair of shapes."""
        return [f"{pair}/{k}" for pair in pair_labels(self.scene) for k in (0, 1)]

    @property
    def modes(self) -> Ints:
        """Modes (m, s, p) of contact points, as in `Run.trajectory`; open where a run had ended before."""
        modes: Ints = self._kept("modes")[:, :, : len(self.points)].copy()
        modes[np.isnan(self.times)] = 0
        return modes

    @property
    def forces(self) -> Reals:
        """Normal and tangential forces (m, s, p, 2) at contact points."""
        return self._kept("force")[:, :, : len(self.points)]

    @property
    def work(self) -> Reals:
        """Work (m, s, 5) since the beginning: of drives, loads, contacts, supports and joints."""
        return np.stack([self._kept(name) for name in WORK], axis=-1)

    def _kept(self, name: str) -> NDArray[Any]:
        if not len(self.memory):
            raise ValueError(f"{name}: was not kept; roll out with keep=True")
        m, s, w = self.memory.shape
        found = in_memory(self._like, name, self.memory.reshape(m * s, w))
        return found.reshape(m, s, *found.shape[1:])

    def state(self, sample: int, segment: int | None = None) -> State:
        """The state of a run at the end of a segment; of the run, if none is given. Raises ValueError where
        the run had ended before, or did not begin."""
        last = min(int(self.switches[sample]), self.memory.shape[1] - 1) if len(self.memory) else 0
        k = last if segment is None else segment
        time = float(self.times[sample, k])
        if math.isnan(time):
            raise ValueError(f"sample {sample} has no state at the end of segment {k}")
        names, values = self.scene.template.coordinates, self.memory[sample, k]
        memory = Memory(values, digest(self.scene), self.model, self._theta, self._schedules(sample))
        return State(names, self.q[sample, k], self.v[sample, k], time, memory)

    def run(self, sample: int) -> Run:
        """The same run once more by `simulate`, with trajectory, reason and certificate. Raises InputError
        for a sample with wrong values."""
        return simulate(self.scene, self.model, **self._options(sample))

    def reason(self, sample: int) -> str:
        """Why the run of this sample ended as it did, in one line."""
        try:
            return self.faults.get(sample) or self.run(sample).reason
        except InputError as error:
            return str(error)


def rollout(
    scene: Scene,
    model: Rung | str,
    states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
    durations: ArrayLike | None = None,
    *,
    until: Sequence[str | None] | None = None,
    ramp: bool | Sequence[bool] = False,
    parameters: Mapping[str, ArrayLike] | None = None,
    step: float | None = None,
    tol: float | None = 1e-3,
    theta: float = 0.5,
    motion: Mapping[str, float] | None = None,
    keep: bool = True,
    threads: int | None = None,
    chunk: int = CHUNK,
    on_progress: Callable[[int], None] | None = None,
) -> Rollouts:
    """Make m runs from states, each with its own inputs in s segments; its bytes do not depend on `threads`.

    Args:
        scene, model, step, tol, theta, motion: as for `Simulation`; theta is 1/2 if not given.
        states: one state or m; or places (m, n), or places and velocities (m, 2 n), at t = 0; the scene's
            start if not given. States of runs go on as `simulate(..., state=)` does.
        inputs: values (m, s, u) of the scene's inputs, or (s, u) for all samples, or a mapping of names to
            values (m, s), (s,) or a number; inputs not named stay as they are.
        durations: of segments, (m, s), (s,) or a number; 0 skips a segment. The runs end with the last.
            Without durations there is no segment, and runs end with the scene.
        until: for each segment a condition that ends it sooner, or None; see `Segment`.
        ramp: whether inputs go to their values linearly, for all segments or for each.
        parameters: values by name, a number or (m,) each.
        keep: whether the states at the switches are kept (see `Rollouts`).
        threads: how many; as many as there are cores if not given.
        on_progress: called with the number of runs done. Ctrl-C raises KeyboardInterrupt within one run.

    Raises SceneError, StateError, ScheduleError or ModelError for wrong shapes, names and options; wrong
    values of a sample make it `invalid`, with a line in `faults`, and the others go on."""
    rung, many = moving_rung(model), _Count()
    lengths = np.zeros((1, 0)) if durations is None else many.rows("durations", durations, 1, ScheduleError)
    levels = _levels(scene, inputs, lengths.shape[1], many)
    over, points = _points(scene, parameters, many)
    begins = None if states is None else _begins(scene, states, many)
    m = many.m or 1
    points = np.ascontiguousarray(np.broadcast_to(points, (m, len(over))))
    texts, ramps = _until(until, lengths.shape[1]), _ramps(ramp, lengths.shape[1])
    for k, text in enumerate(texts):
        condition(scene, text, f"until.{k}")
    options = {"step": step, "tol": tol, "theta": theta, "motion": motion}
    crew = Crew(scene, rung, over, None, until=texts, ramps=ramps, threads=threads, **options)  # type: ignore[arg-type]
    faults = _faults(scene, over, points, lengths, levels, begins)

    def schedule(i: int) -> tuple[Segment, ...]:
        duration, level = lengths[min(i, len(lengths) - 1)], levels[min(i, len(levels) - 1)]
        return tuple(
            Segment(
                {name: float(x) for name, x in zip(scene.template.inputs, row, strict=True) if x == x},
                float(each), text, bool(ramps[k]),
            )
            for k, (each, row, text) in enumerate(zip(duration, level, texts, strict=True))
        )  # fmt: skip

    def of_sample(i: int) -> dict[str, Any]:
        state = None if begins is None else begins.state(scene, min(i, len(begins.bodies) - 1))
        given = {"parameters": dict(zip(over, points[i].tolist(), strict=True)), "state": state}
        return options | given | {"inputs": schedule(i)}

    memories = _memories(crew, begins, of_sample, faults, points)
    samples = crew.run(
        points, bodies=None if begins is None else begins.bodies, memories=memories.rows, memory=memories.of,
        durations=lengths, levels=levels, wrong=np.isin(np.arange(m), list(faults)).astype(np.int64),
        keeps=keep, chunk=chunk, on_progress=on_progress,
    )  # fmt: skip
    found, n = samples.results, len(scene.template.coordinates)
    return Rollouts(
        scene=scene, model=rung, outcome=found["outcome"].copy(), margin=found["margin"].copy(),
        time=found["time"].copy(), steps=found["steps"].copy(), attempts=found["attempts"].copy(),
        switches=found["switches"].copy(), worst_residual=found["worst_residual"].copy(),
        final=samples.final[:, :n].copy(), speed=samples.final[:, n:].copy(), faults=faults,
        memory=samples.kept, _like=crew.workspace.state, _options=of_sample, _schedules=schedule,
        _theta=crew.theta,
    )  # fmt: skip


class _Count:
    """The number m of samples, on which all arguments must agree that have more than one row."""

    def __init__(self) -> None:
        self.m, self._first = 0, ""

    def agree(self, name: str, rows: int, error: type[InputError]) -> None:
        if self.m and rows != self.m:
            raise error(f"{name}: has {rows} samples, and {self._first} has {self.m}")
        self.m, self._first = rows, self._first or name

    def rows(self, name: str, given: ArrayLike, inner: int, error: type[InputError]) -> Reals:
        """Values (m, ...) with `inner` axes for each sample, from these or from values of one sample."""
        try:
            values = np.asarray(given)
            if values.dtype.kind not in "iuf":
                raise ValueError
        except ValueError:
            raise error(f"{name}: must be numbers in an array, not {shown(given)}") from None
        values = np.ascontiguousarray(values, np.float64)
        while values.ndim < inner:
            values = values[None]
        if values.ndim > inner + 1:
            raise error(f"{name}: has {values.ndim} axes, and at most {inner + 1} count")
        if values.ndim == inner:
            return values[None]
        self.agree(name, len(values), error)
        return values


class _Begins(NamedTuple):
    """Where samples begin: `bodies` (r, 2 n + 1) as of `Samples`, and the states given, if any."""

    bodies: Reals
    states: list[State]

    def state(self, scene: Scene, row: int) -> State:
        if self.states:
            return self.states[row]
        n = len(scene.template.coordinates)
        q, v = self.bodies[row, :n], self.bodies[row, n : 2 * n]
        return State(scene.template.coordinates, q, v, float(self.bodies[row, -1]))


class _Memories(NamedTuple):
    """Memories (r, w) to go on from, and the row of each sample (m,), -1 without one."""

    rows: Reals
    of: Ints


def _begins(scene: Scene, states: States, many: _Count) -> _Begins:
    n = len(scene.template.coordinates)
    if isinstance(states, np.ndarray):
        bodies = np.hstack([rows_of(states, n), np.zeros((len(states), 1))])
        many.agree("states", len(bodies), StateError)
        return _Begins(bodies, [])
    listed = [states] if isinstance(states, State) else states
    if not isinstance(listed, Sequence) or not listed:
        raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
    for state in listed:
        check_state(state, scene)
    if not isinstance(states, State):
        many.agree("states", len(listed), StateError)
    return _Begins(np.array([[*s.q, *s.v, s.time] for s in listed]), list(listed))


def _levels(
    scene: Scene, given: ArrayLike | Mapping[str, ArrayLike] | None, segments: int, many: _Count
) -> Reals:
    """Inputs (m or 1, s, u), inf where a value given is none, nan where an input stays as it is."""
    names = scene.template.inputs
    if given is None:
        return np.full((1, segments, len(names)), math.nan)
    if not segments:
        raise ScheduleError("durations: are required with inputs")
    if not isinstance(given, Mapping):
        values = many.rows("inputs", given, 2, ScheduleError)
        if values.shape[1:] != (segments, len(names)):
            raise ScheduleError(
                f"inputs: must have the shape (m, {segments}, {len(names)}), segments and inputs"
                f" ({', '.join(names) or 'the scene has none'}), not {np.shape(given)}"
            )
        return np.where(np.isnan(values), math.inf, values)
    columns, nothing = [], np.full((1, segments), math.nan)
    for name in given:
        if name not in names:
            raise ScheduleError(f"inputs: unknown input {shown(name)}; valid: {', '.join(names) or 'none'}")
    for name in names:
        values = many.rows(f"inputs.{name}", given[name], 1, ScheduleError) if name in given else nothing
        values = np.where(np.isnan(values), math.inf, values) if name in given else values
        if values.shape[1] not in (1, segments):
            raise ScheduleError(
                f"inputs.{name}: has {values.shape[1]} segments, and durations has {segments}"
            )
        columns.append(values)
    rows = max((len(values) for values in columns), default=1)
    return np.ascontiguousarray(
        np.stack([np.broadcast_to(values, (rows, segments)) for values in columns], axis=-1)
    )


def _points(
    scene: Scene, parameters: Mapping[str, ArrayLike] | None, many: _Count
) -> tuple[tuple[str, ...], Reals]:
    """Names of parameters, and their values (m or 1, k)."""
    if not isinstance(parameters, Mapping | None):
        raise SceneError(f"parameters: must be a mapping of names to numbers, not {shown(parameters)}")
    names = names_of(scene, tuple(parameters)) if parameters else ()
    columns = [many.rows(f"parameters.{name}", (parameters or {})[name], 0, SceneError) for name in names]
    rows = max((len(values) for values in columns), default=1)
    return names, np.array([np.broadcast_to(values, rows) for values in columns]).reshape(len(names), rows).T


def _until(until: Sequence[str | None] | None, segments: int) -> tuple[str | None, ...]:
    if until is None:
        return (None,) * segments
    if isinstance(until, str) or not isinstance(until, Sequence) or len(until) != segments:
        raise ScheduleError(f"until: must be a list of {segments} conditions or None, not {shown(until)}")
    return tuple(until)


def _ramps(ramp: bool | Sequence[bool], segments: int) -> tuple[bool, ...]:
    ramps = (ramp,) * segments if isinstance(ramp, bool | np.bool_) else ramp
    if not isinstance(ramps, Sequence | np.ndarray) or len(ramps) != segments:
        raise ScheduleError(f"ramp: must be true or false, or {segments} of them, not {shown(ramp)}")
    return tuple(bool(each) for each in ramps)


def _faults(
    scene: Scene, over: Sequence[str], points: Reals, lengths: Reals, levels: Reals, begins: _Begins | None
) -> dict[int, str]:
    """Samples with wrong values, and a line on the first of each."""
    m, faults = len(points), dict[int, str]()

    def note(wrong: NDArray[np.bool_], line: Callable[[tuple[int, ...]], str]) -> None:
        for place in np.argwhere(wrong):
            row = tuple(int(x) for x in place)
            for i in range(m) if len(wrong) == 1 else (row[0],):
                faults.setdefault(i, f"sample {i}: {line(row)}")

    if begins is not None:
        names, n = scene.template.coordinates, len(scene.template.coordinates)
        bad = ~np.isfinite(begins.bodies) | (np.abs(begins.bodies) > FARTHEST)
        note(
            bad,
            lambda at: (
                f"states.{'q' if at[1] < n else 'v'}.{names[at[1] % n]}: must be finite and within"
                f" -{FARTHEST:g}..{FARTHEST:g}, not {begins.bodies[at]:g}"
            ),
        )
    note(
        ~(np.isfinite(lengths) & (lengths >= 0.0)),
        lambda at: f"durations.{at[1]}: must be finite and >= 0, not {lengths[at]:g}",
    )
    for j, name in enumerate(scene.template.inputs):
        low, high = scene.file.parameters[name].range or (-math.inf, math.inf)
        values = levels[..., j]
        note(np.isinf(values), partial(_not_finite, name))
        note((values < low) | (values > high), partial(_out_of_range, name, values, low, high))
    bad = outside(scene, over, points).astype(bool)
    for i in np.flatnonzero(bad):
        try:
            scene.parameters(dict(zip(over, points[i].tolist(), strict=True)))
        except SceneError as error:
            faults.setdefault(int(i), f"sample {i}: {error}")
    return faults


def _not_finite(name: str, at: tuple[int, ...]) -> str:
    return f"inputs.{name}: must be finite, and is not in segment {at[1]}"


def _out_of_range(name: str, values: Reals, low: float, high: float, at: tuple[int, ...]) -> str:
    return f"inputs.{name}: {values[at]:g} is outside {low:g} to {high:g}, in segment {at[1]}"


def _memories(
    crew: Crew,
    begins: _Begins | None,
    of_sample: Callable[[int], dict[str, Any]],
    faults: dict[int, str],
    points: Reals,
) -> _Memories:
    """Memories that samples from states of runs go on from.

    Where the rung and the parameters are those of the state's run, it is the state's own; otherwise the
    memory of a run that has begun there. What is wrong goes into `faults`.
    """
    m, rows = len(points), list[Reals]()
    of = np.full(m, -1)
    made: dict[tuple[int, bytes], int] = {}
    states = [] if begins is None else begins.states
    for i in range(m) if any(state.memory is not None for state in states) else ():
        row = min(i, len(states) - 1)
        key = row, points[i].tobytes()
        if i in faults or states[row].memory is None:
            continue
        if key not in made:
            values = _begun(crew, states[row], of_sample(i))
            if isinstance(values, str):
                faults[i] = f"sample {i}: {values}"
                continue
            made[key] = len(rows)
            rows.append(values)
        of[i] = made[key]
    return _Memories(np.array(rows) if rows else np.zeros((0, crew.workspace.state.memory.size)), of)


def _begun(crew: Crew, state: State, options: dict[str, Any]) -> Reals | str:
    """The memory from which a run from this state goes on, or why there is none."""
    own = memory_of(state, crew.digest, crew.workspace.state)
    if own is not None and crew.goes_on(own, options["parameters"]):
        return own.values
    try:
        begun = Simulation(crew.scene, crew.model, frames=3, **options)
    except StateError as error:
        return str(error)
    if begun.workspace is None or begun.reason:
        return begun.reason
    return begun.workspace.state.memory.copy()
