"""Arguments of rollouts: one value for all samples or one for each, and samples whose values are wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.simulation.inputs import ScheduleError, Segment, condition
from rungwise.simulation.rows import States, rows_of
from rungwise.simulation.state import State, StateError, check_state
from rungwise.simulation.threads import names_of, outside
from rungwise.wording import choices


class Count:
    """The number m of samples, on which all arguments must agree that have more than one row; those of one
    row serve all samples."""

    def __init__(self) -> None:
        self.m: int | None = None
        self._first = ""

    def agree(self, name: str, rows: int, error: type[InputError]) -> None:
        if self.m is None or self.m == 1:
            self.m, self._first = rows, name
        elif rows not in (1, self.m):
            raise error(f"{name}: has {rows} samples, and {self._first} has {self.m}: must be 1 or {self.m}")

    def rows(self, name: str, given: ArrayLike, inner: int, error: type[InputError]) -> Reals:
        """Values (m, ...) with `inner` axes for each sample, from these or from values of one sample."""
        values = numbers_of(name, given, error)
        while values.ndim < inner:
            values = values[None]
        if values.ndim > inner + 1:
            raise error(f"{name}: has {values.ndim} axes, and at most {inner + 1} count")
        if values.ndim == inner:
            return values[None]
        self.agree(name, len(values), error)
        return values


def numbers_of(name: str, given: ArrayLike, error: type[InputError]) -> Reals:
    """An array of numbers, copied. Raises the error."""
    try:
        values = np.asarray(given)
        if values.dtype.kind not in "iuf":
            raise ValueError
    except ValueError:
        raise error(f"{name}: must be numbers in an array, not {shown(given)}") from None
    return np.array(values, np.float64, order="C")


class Begins(NamedTuple):
    """Where samples begin: `bodies` (r, n_q + n_v + 1), places, velocities and time, and the states given, if
    any."""

    bodies: Reals
    states: list[State]

    def state(self, scene: AnyScene, row: int) -> State:
        if self.states:
            return self.states[row]
        n = len(scene.template.coordinates)
        q, v = self.bodies[row, :n], self.bodies[row, n:-1]
        return State(scene.template.coordinates, q, v, float(self.bodies[row, -1]))


def begins_of(scene: AnyScene, states: States, many: Count) -> Begins:
    if isinstance(states, np.ndarray):
        rows = rows_of(states, len(scene.template.coordinates), len(scene.template.velocities))
        bodies = np.hstack([rows, np.zeros((len(states), 1))])
        many.agree("states", len(bodies), StateError)
        return Begins(bodies, [])
    listed = [states] if isinstance(states, State) else states
    if not isinstance(listed, Sequence) or not listed:
        raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
    for state in listed:
        check_state(state, scene)
    if not isinstance(states, State):
        many.agree("states", len(listed), StateError)
    return Begins(np.array([[*s.q, *s.v, s.time] for s in listed]), list(listed))


def durations_of(
    given: ArrayLike | None, inputs: ArrayLike | Mapping[str, ArrayLike] | None, many: Count
) -> Reals:
    """Durations (m or 1, s); a number holds for all segments that the inputs have."""
    if given is None:
        return np.zeros((1, 0))
    lengths = many.rows("durations", given, 1, ScheduleError)
    if np.ndim(given) > 0 or inputs is None:
        return lengths
    if isinstance(inputs, Mapping):
        counts = [np.shape(values)[-1] for values in inputs.values() if np.ndim(values) > 0]
        return np.repeat(lengths, max(counts, default=1), axis=1)
    return np.repeat(lengths, np.shape(inputs)[-2] if np.ndim(inputs) > 1 else 1, axis=1)


def levels_of(
    scene: AnyScene, given: ArrayLike | Mapping[str, ArrayLike] | None, segments: int, many: Count
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
            raise ScheduleError(f"inputs: unknown input {shown(name)}{choices(name, names)}")
    for name in names:
        values = many.rows(f"inputs.{name}", given[name], 1, ScheduleError) if name in given else nothing
        values = np.where(np.isnan(values), math.inf, values) if name in given else values
        if values.shape[1] not in (1, segments):
            raise ScheduleError(
                f"inputs.{name}: has {values.shape[1]} segments, and durations has {segments}"
            )
        columns.append(values)
    rows = _common(columns)
    return np.ascontiguousarray(
        np.stack([np.broadcast_to(values, (rows, segments)) for values in columns], axis=-1)
    )


def points_of(
    scene: AnyScene, parameters: Mapping[str, ArrayLike] | None, many: Count
) -> tuple[tuple[str, ...], Reals]:
    """Names of parameters, and their values (m or 1, k)."""
    if not isinstance(parameters, Mapping | None):
        raise SceneError(f"parameters: must be a mapping of names to numbers, not {shown(parameters)}")
    names = names_of(scene, tuple(parameters), "parameters") if parameters else ()
    columns = [many.rows(f"parameters.{name}", (parameters or {})[name], 0, SceneError) for name in names]
    rows = _common(columns)
    return names, np.array([np.broadcast_to(values, rows) for values in columns]).reshape(len(names), rows).T


def until_of(until: Sequence[str | None] | None, segments: int) -> tuple[str | None, ...]:
    if until is None:
        return (None,) * segments
    if isinstance(until, str) or not isinstance(until, Sequence) or len(until) != segments:
        raise ScheduleError(f"until: must be a list of {segments} conditions or None, not {shown(until)}")
    return tuple(until)


def _common(columns: Sequence[Reals]) -> int:
    """How many rows columns of one row, or of this many, have together."""
    return next((len(values) for values in columns if len(values) != 1), 1)


def ramps_of(ramp: bool | Sequence[bool], segments: int) -> tuple[bool, ...]:
    ramps = (ramp,) * segments if isinstance(ramp, bool | np.bool_) else ramp
    listed = isinstance(ramps, Sequence | np.ndarray) and len(ramps) == segments
    if not listed or not all(isinstance(each, bool | np.bool_) for each in ramps):
        raise ScheduleError(f"ramp: must be true or false, or {segments} of them, not {shown(ramp)}")
    return tuple(bool(each) for each in ramps)


def faults_of(
    scene: AnyScene, over: Sequence[str], points: Reals, lengths: Reals, levels: Reals,
    begins: Begins | None,
) -> dict[int, str]:  # fmt: skip
    """Samples with wrong values, and a line on the first of each."""
    m, faults = len(points), dict[int, str]()

    def note(wrong: NDArray[np.bool_], line: Callable[[tuple[int, ...]], str]) -> None:
        for place in np.argwhere(wrong):
            row = tuple(int(x) for x in place)
            for i in range(m) if len(wrong) == 1 else (row[0],):
                faults.setdefault(i, f"sample {i}: {line(row)}")

    if begins is not None:
        names, rates = scene.template.coordinates, scene.template.velocities
        labels = [f"q.{name}" for name in names] + [f"v.{name}" for name in rates] + ["time"]
        most = scene.farthest
        bad = ~np.isfinite(begins.bodies) | (np.abs(begins.bodies) > most)
        note(
            bad,
            lambda at: (
                f"states.{labels[at[1]]}: must be finite and within"
                f" -{most:g}..{most:g}, not {begins.bodies[at]:g}"
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


class Asked(NamedTuple):
    """What a rollout is asked for: names of parameters `over` and points (m, k); durations (m or 1, s);
    inputs (m or 1, s, u); conditions and ramps of segments; where samples begin; and samples with wrong
    values."""

    over: tuple[str, ...]
    points: Reals
    lengths: Reals
    levels: Reals
    until: tuple[str | None, ...]
    ramps: tuple[bool, ...]
    begins: Begins | None
    faults: dict[int, str]

    def schedule(self, scene: AnyScene, i: int) -> tuple[Segment, ...]:
        """The segments of a sample."""
        duration = self.lengths[min(i, len(self.lengths) - 1)]
        level, names = self.levels[min(i, len(self.levels) - 1)], scene.template.inputs
        return tuple(
            Segment(
                {name: float(x) for name, x in zip(names, row, strict=True) if x == x}, float(each), text,
                bool(self.ramps[k]),
            )
            for k, (each, row, text) in enumerate(zip(duration, level, self.until, strict=True))
        )  # fmt: skip

    def state(self, scene: AnyScene, i: int) -> State | None:
        """Where a sample begins; None at the scene's start."""
        return None if self.begins is None else self.begins.state(scene, min(i, len(self.begins.bodies) - 1))

    def options(self, scene: AnyScene, i: int) -> dict[str, Any]:
        """What `simulate` takes to run a sample."""
        parameters = dict(zip(self.over, self.points[i].tolist(), strict=True))
        schedule, state = self.schedule(scene, i), self.state(scene, i)
        return {"parameters": parameters, "state": state, "inputs": schedule}


def asked(
    scene: AnyScene, states: States | None, inputs: ArrayLike | Mapping[str, ArrayLike] | None,
    durations: ArrayLike | None, until: Sequence[str | None] | None, ramp: bool | Sequence[bool],
    parameters: Mapping[str, ArrayLike] | None,
) -> Asked:  # fmt: skip
    """The arguments of `rollout`, checked. Raises SceneError, StateError and ScheduleError for wrong shapes
    and names."""
    many = Count()
    lengths = durations_of(durations, inputs, many)
    segments = lengths.shape[1]
    levels = levels_of(scene, inputs, segments, many)
    over, points = points_of(scene, parameters, many)
    begins = None if states is None else begins_of(scene, states, many)
    m = 1 if many.m is None else many.m
    points = np.ascontiguousarray(np.broadcast_to(points, (m, len(over))))
    texts, ramps = until_of(until, segments), ramps_of(ramp, segments)
    for k, text in enumerate(texts):
        condition(scene, text, f"until.{k}")
    faults = faults_of(scene, over, points, lengths, levels, begins)
    return Asked(over, points, lengths, levels, texts, ramps, begins, faults)
