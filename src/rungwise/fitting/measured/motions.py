"""Measured motions: times, places and velocities of a scene's coordinates, trial by trial."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rungwise.fitting.measured import tables
from rungwise.fitting.measured.errors import MotionError
from rungwise.fitting.measured.units import in_scene, in_si, named, stated
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.plain import cut
from rungwise.scene.fields.values import shown
from rungwise.wording import choices, listed
from rungwise.world.arguments import numbers_of
from rungwise.world.find import world_of

if TYPE_CHECKING:
    import xarray

FEWEST = 3
"""Fewest frames of a trial: from fewer no velocity follows."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One measured motion of k frames: times (k,), places q (k, n), velocities v (k, r) if they were
    measured, nan in gaps; parameters that are known in it, and inputs (k,), by name."""

    times: Reals
    q: Reals
    v: Reals | None
    parameters: dict[str, float]
    inputs: dict[str, Reals]

    @property
    def duration(self) -> float:
        """From the first frame to the last."""
        return float(self.times[-1] - self.times[0])


class Motions:
    """Measured motions of m trials.

    Args:
        coordinates: names (n,), as the scene calls them ("part.x").
        times: (k,) of all trials, or one array for each, ascending.
        places: (m, k, n), or (k_i, n) for each trial; (k, n) is one trial. nan where nothing was measured.
        velocities: in the same shape, if they were measured; otherwise computed by local regression.
        rates: names (r,) of the velocities, if they differ from the coordinates: in space angular velocities
            ("part.rx") are no rates of quaternions.
        parameters: values that are known: a number, or one for each trial, by name.
        inputs: values applied at the frames, (m, k) or one array for each trial, by name of the input.
        deviations: standard deviations of the measurement by name of a coordinate, and of a velocity as
            "speed(part.x)"; of all others the scatter about a local regression is taken. In space that of
            a quaternion is an angle, under the name of its first coordinate.
        units: units of coordinates, velocities ("speed(part.x)"), "time", parameters and inputs, by name;
            deviations have the same. What has none is in the scene's units, and a parameter in its own.

    Raises MotionError: wrong shapes, unknown units, times that do not ascend.
    """

    @keywords
    def __init__(
        self,
        coordinates: Sequence[str],
        times: Any,
        places: Any,
        velocities: Any = None,
        *,
        rates: Sequence[str] | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        inputs: Mapping[str, Any] | None = None,
        deviations: Mapping[str, float] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.coordinates = _names("coordinates", coordinates)
        self.rates = self.coordinates if rates is None else _names("rates", rates)
        columns = [*self.coordinates, *(f"speed({name})" for name in self.rates)]
        speeds, others = columns[len(self.coordinates) :], [*(parameters or {}), *(inputs or {})]
        self._stated = stated(units or {}, self.coordinates, speeds, others)
        scales = {name: in_si(each) for name, each in self._stated.items()}
        n = len(self.coordinates)
        q = _trials("places", places, n)
        v = [None] * len(q) if velocities is None else _trials("velocities", velocities, len(self.rates))
        if len(v) != len(q):
            raise MotionError(f"velocities: are of {len(v)} trials, and places of {len(q)}")
        every = _times(times, q)
        of_trials = _known(parameters or {}, len(q))
        given = _inputs(inputs or {}, q)
        own = _deviations(deviations or {}, columns)
        self.deviations = {name: x * scales.get(name, 1.0) for name, x in own.items()}
        raw = [_trial(i, every[i], q[i], v[i], of_trials[i], given[i]) for i in range(len(q))]
        self.trials = tuple(self._scaled(each, scales) for each in raw)

    def counted_in(self, scene: Any) -> Motions:
        """The same, with the columns that state a unit in the units of a scene. Raises MotionError."""
        if not self._stated:
            return self
        world, place = world_of(scene), world_of(scene).place(None).dimensions()
        names = [*scene.template.coordinates, *(f"speed({name})" for name in world.velocities)]
        powers = {
            name: (int(each.length), 0, int(each.time))
            for name, each in zip(names, [*place[0], *place[1]], strict=True)
        }
        scales = in_scene(scene, self._stated, powers)
        found = self.take(range(len(self)))
        found._stated = {}
        found.deviations = {name: x * scales.get(name, 1.0) for name, x in self.deviations.items()}
        found.trials = tuple(self._scaled(each, scales) for each in self.trials)
        return found

    def _scaled(self, trial: Trial, scales: Mapping[str, float]) -> Trial:
        """A trial with columns multiplied by what is given for them."""
        places = [scales.get(name, 1.0) for name in self.coordinates]
        speeds = [scales.get(f"speed({name})", 1.0) for name in self.rates]
        return Trial(
            trial.times * scales.get("time", 1.0), trial.q * places,
            None if trial.v is None else trial.v * speeds,
            {name: x * scales.get(name, 1.0) for name, x in trial.parameters.items()},
            {name: x * scales.get(name, 1.0) for name, x in trial.inputs.items()},
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.trials)

    def __repr__(self) -> str:
        return f"<Motions of {cut(', '.join(self.coordinates), 120)}: {len(self)} trials>"

    @keywords
    def take(self, rows: Iterable[int]) -> Motions:
        """The trials with the numbers `rows`."""
        found = object.__new__(Motions)
        vars(found).update(vars(self) | {"trials": tuple(self.trials[int(row)] for row in rows)})
        if not found.trials:
            raise MotionError("rows: name no trial")
        return found

    @keywords
    def split(self, share: float = 0.5, *, seed: int = 0) -> tuple[Motions, Motions]:
        """Trials to fit, a share of all drawn by the seed, and the others, to be held out. Raises
        MotionError where one part would be empty."""
        order = np.random.default_rng(seed).permutation(len(self))
        first = min(max(round(share * len(self)), 1), len(self) - 1)
        if not 0.0 < share < 1.0 or len(self) < 2:
            raise MotionError(f"share: {shown(share)} of {len(self)} trials leaves one part empty")
        return self.take(np.sort(order[:first])), self.take(np.sort(order[first:]))

    @classmethod
    def from_csv(cls, file: str | Path, **given: Any) -> Motions:
        """Motions from the table in `file`, with columns `time`, `trial` and those of coordinates; the
        arguments `given` are those of `Motions`."""
        return cls(**tables.read_csv(Path(file)) | given)

    @classmethod
    def from_datasets(cls, data: xarray.Dataset | Sequence[xarray.Dataset], **given: Any) -> Motions:
        """Motions from `data`, one dataset for each trial, with `position` over `time` and `coordinate`, and
        `velocity`, as in `Run.trajectory`; the arguments `given` are those of `Motions`."""
        return cls(**tables.read_datasets(data) | given)

    @classmethod
    def from_runs(cls, runs: Any, **given: Any) -> Motions:
        """Motions from the recorded frames of a run or of runs; the arguments `given` are those
        of `Motions`."""
        return cls(**tables.read_runs(runs) | given)

    @keywords
    def save(self, file: str | Path) -> None:
        """Write the table that `from_csv` reads to `file`. Raises OSError."""
        first = self.trials[0]
        others = [*first.parameters, *first.inputs]
        rates = [f"speed({name})" for name in self.rates] if first.v is not None else []
        units = {name: f" [{named(each.powers)}]" for name, each in self._stated.items()}
        heads = [f"{name}{units.get(name, '')}" for name in ("time", *self.coordinates, *rates, *others)]
        tables.write_csv(
            Path(file), ["trial", *heads],
            [_columns(number, trial) for number, trial in enumerate(self.trials)],
        )  # fmt: skip


def _columns(number: int, trial: Trial) -> Reals:
    """A trial as rows of a table."""
    k = len(trial.times)
    known = [np.full(k, value) for value in trial.parameters.values()]
    rates = [] if trial.v is None else [trial.v]
    return np.column_stack(
        [np.full(k, float(number)), trial.times, trial.q, *rates, *known, *trial.inputs.values()]
    )


def _names(field: str, given: Sequence[str]) -> tuple[str, ...]:
    if isinstance(given, str) or not all(isinstance(name, str) for name in given) or not len(given):
        raise MotionError(f"{field}: must be names, not {shown(given)}")
    if len(set(given)) < len(given):
        raise MotionError(f"{field}: {next(name for name in given if list(given).count(name) > 1)} is twice")
    return tuple(given)


def _trials(field: str, given: Any, columns: int) -> list[Any]:
    """Arrays (k_i, columns) of the trials."""
    try:
        ndim = np.ndim(given)
    except ValueError:
        ndim = 0
    listed_ = [given] if ndim == 2 else given
    if ndim not in (0, 2, 3) or not isinstance(listed_, Sequence | np.ndarray) or not len(listed_):
        raise MotionError(f"{field}: must have the shape (m, k, {columns}), or be a list of (k, {columns})")
    found = [numbers_of(f"{field}.{i}", each, MotionError) for i, each in enumerate(listed_)]
    for i, each in enumerate(found):
        if each.ndim != 2 or each.shape[1] != columns:
            raise MotionError(f"{field}.{i}: must have the shape (k, {columns}), not {each.shape}")
        if len(each) < FEWEST:
            raise MotionError(f"{field}.{i}: has {len(each)} frames, and needs at least {FEWEST}")
    return found


def _times(given: Any, q: Sequence[Reals]) -> list[Reals]:
    """Times (k_i,) of the trials, ascending."""
    try:
        is_one = np.ndim(given) == 1 and not np.ndim(given[0])
    except ValueError:
        is_one = False
    every = [given] * len(q) if is_one else list(given)
    if len(every) != len(q):
        raise MotionError(f"times: are of {len(every)} trials, and places of {len(q)}")
    found = [numbers_of(f"times.{i}", each, MotionError) for i, each in enumerate(every)]
    for i, (times, places) in enumerate(zip(found, q, strict=True)):
        if times.shape != (len(places),):
            raise MotionError(f"times.{i}: must have the shape ({len(places)},), not {times.shape}")
        wrong = np.flatnonzero(~(np.diff(times) > 0.0))
        if not np.isfinite(times).all() or len(wrong):
            at = int(wrong[0]) + 1 if len(wrong) else int(np.flatnonzero(~np.isfinite(times))[0])
            raise MotionError(f"times.{i}: must ascend, and do not at frame {at}")
    return found


def _known(given: Mapping[str, ArrayLike], m: int) -> list[dict[str, float]]:
    """Parameters of each trial."""
    columns = {name: numbers_of(f"parameters.{name}", values, MotionError) for name, values in given.items()}
    for name, values in columns.items():
        if values.shape not in ((), (m,)):
            raise MotionError(f"parameters.{name}: must be a number or ({m},), not {values.shape}")
    whole = {name: np.broadcast_to(values, m) for name, values in columns.items()}
    return [{name: float(values[i]) for name, values in whole.items()} for i in range(m)]


def _inputs(given: Mapping[str, Any], q: Sequence[Reals]) -> list[dict[str, Reals]]:
    """Inputs of each trial at its frames."""
    found: list[dict[str, Reals]] = [{} for _ in q]
    for name, values in given.items():
        each = [values] if len(q) == 1 and np.ndim(values) == 1 else list(values)
        if len(each) != len(q):
            raise MotionError(f"inputs.{name}: are of {len(each)} trials, and places of {len(q)}")
        for i, (row, places) in enumerate(zip(each, q, strict=True)):
            level = numbers_of(f"inputs.{name}.{i}", row, MotionError)
            if level.shape != (len(places),) or not np.isfinite(level).all():
                raise MotionError(f"inputs.{name}.{i}: must be {len(places)} finite numbers, one a frame")
            found[i][name] = level
    return found


def _deviations(given: Mapping[str, float], known: Sequence[str]) -> dict[str, float]:
    """Deviations by name."""
    for name, value in given.items():
        if name not in known:
            raise MotionError(f"deviations: unknown {shown(name)}{choices(name, known)}")
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not value > 0.0:
            raise MotionError(f"deviations.{name}: must be a number greater than 0, not {shown(value)}")
    return {name: float(value) for name, value in given.items()}


def _trial(
    number: int, times: Reals, q: Reals, v: Reals | None, known: dict[str, float], inputs: dict[str, Reals]
) -> Trial:  # fmt: skip
    if v is not None and len(v) != len(q):
        raise MotionError(f"velocities.{number}: has {len(v)} frames, and places.{number} {len(q)}")
    if not np.isfinite(q).any(axis=0).all():
        raise MotionError(f"places.{number}: a column has no number; leave out what was not measured")
    return Trial(times, q, v, known, inputs)


def check_names(motions: Motions, coordinates: Sequence[str], velocities: Sequence[str]) -> None:
    """Refuse motions of coordinates that a scene does not have. Raises MotionError."""
    for name in motions.coordinates:
        if name not in coordinates:
            raise MotionError(f"coordinates: unknown {shown(name)}{choices(name, coordinates)}")
    if any(trial.v is not None for trial in motions.trials):
        for name in motions.rates:
            if name not in velocities:
                raise MotionError(f"rates: unknown {shown(name)}{choices(name, velocities)}")


def check_parameters(
    motions: Motions, over: Sequence[str], known: Mapping[str, Any], inputs: Sequence[str]
) -> None:
    """Refuse known parameters and inputs that a scene does not have, that are to be found, or that leave the
    range of a parameter (of `known`, by name)."""
    for number, trial in enumerate(motions.trials):
        for name in trial.parameters:
            if name not in known:
                raise MotionError(f"parameters: unknown {shown(name)}{choices(name, tuple(known))}")
            if name in over:
                raise MotionError(f"parameters.{name}: is known in the motions, and `over` asks for it")
        for name in trial.inputs:
            if name not in inputs:
                raise MotionError(f"inputs: unknown {shown(name)}; valid: {listed(inputs)}")
        for field, values in (("parameters", trial.parameters), ("inputs", trial.inputs)):
            for name, value in values.items():
                _check_range(f"{field}.{name}", known[name].range, np.atleast_1d(value), number)


def _check_range(field: str, ends: tuple[float, float] | None, values: Reals, number: int) -> None:
    """Refuse values outside of the range of a parameter."""
    low, high = ends or (-np.inf, np.inf)
    wrong = np.flatnonzero(~((values >= low) & (values <= high)))
    if len(wrong):
        x = values[wrong[0]]
        raise MotionError(f"{field}: {x:g} in trial {number} is outside {low:g} to {high:g}")
