"""Options of a run: accepted values, and the errors that name the others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rungwise.content import ByContent
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung, rung
from rungwise.scene import Scene
from rungwise.scene.fields.values import shown
from rungwise.wording import choices

if TYPE_CHECKING:
    from rungwise.simulation.inputs import Schedule
    from rungwise.simulation.state import State

MANY = 10**9
"""Most frames, and most steps between two of them."""


class ModelError(InputError):
    """The model or an option of the run is wrong; the text is one line that names it."""


def moving_rung(model: Rung | str) -> Rung:
    """The rung of that name. Raises ModelError, also for the rung that does not move."""
    try:
        chosen = rung(model)
    except ValueError as error:
        raise ModelError(str(error)) from None
    if not chosen.moves:
        raise ModelError(
            "model: the geometric rung does not say how bodies move; plans begin on it; use a richer rung"
        )
    return chosen


@dataclass(frozen=True, kw_only=True, eq=False)
class RunOptions(ByContent):
    """Options of a run, checked. Raises ModelError that names the option out of its range.

    Args:
        parameters: values by name; the others keep their defaults.
        step: length of a step; the scene's own if not given.
        tol: error allowed per step in each coordinate, for steps of controlled length; if not given, fixed.
        duration: end of the run; the scene's own if not given.
        span: length of the whole run of which this run is a part: error-controlled steps are then no longer
            than in the whole run; the end of this run if not given.
        theta: of the theta rule on the dynamic compliant rung, in 1/2..1. 1/2 is of second order as long as
            contacts do not change their mode.
        motion: preferred velocities by coordinate ("part.x3"), in multiples of the pace, the fastest speed of
            the slowest motion; an angle counts by its radius of gyration. On the kinematic and quasistatic
            rungs an object that cannot rest takes, of all its admissible motions, the one nearest to them; if
            not given, nearest to zero: the slowest. See `simulation.planar.step.preferred_motion`.
        state: at which, and at whose time, the run begins; the scene's start if not given. It contains
            neither `parameters` nor `duration` (the end of the run).
        inputs: a schedule of the scene's inputs, which begins with the run: segments, or mappings of their
            fields (see `Segment`). The run ends with it, or at `duration` if that is given. A state from the
            middle of a schedule continues with this schedule if none is given here.
        frames: greatest number of states that are kept (the stride doubles when they are full).
        stride: steps between frames at first; if not given, so many that the whole duration fits into
            `frames` with fixed steps, and 1 under error control.
        save_hard: a folder, for the problems of hard steps (see `HardSteps`); needs h5py.
    """

    parameters: Mapping[str, float] | None = None
    step: float | None = None
    tol: float | None = None
    duration: float | None = None
    span: float | None = None
    theta: float = 1.0
    motion: Mapping[str, float] | None = None
    state: State | None = None
    inputs: Schedule | None = None
    frames: int | None = 2000
    stride: int | None = None
    save_hard: str | Path | None = None

    def __post_init__(self) -> None:
        if not 0.5 <= _real(self.theta) <= 1.0:
            raise ModelError(f"theta: must be a number in 0.5..1, not {shown(self.theta)}")
        checked: dict[str, object] = {"theta": _real(self.theta)}
        for field, name in (("step", "step"), ("tol", "tol"), ("duration", "time"), ("span", "span")):
            value = getattr(self, field)
            checked[field] = None if value is None else positive(name, value)
        for field, least in (("frames", 3), ("stride", 1)):
            value = getattr(self, field)
            checked[field] = None if value is None else count(field, value, least)
        vars(self).update(checked)


def preferences(scene: Scene, model: Rung, motion: Mapping[str, float] | None) -> Reals:
    """Preferred velocities (n,) in multiples of the pace, by coordinate. Raises ModelError."""
    names = scene.template.coordinates
    chosen = np.zeros(len(names))
    if not isinstance(motion, Mapping | None):
        raise ModelError(f"motion: must be a mapping of coordinates to numbers, not {shown(motion)}")
    for name, value in (motion or {}).items():
        if name not in names:
            raise ModelError(f"motion: unknown coordinate {shown(name)}{choices(name, names)}")
        if not math.isfinite(_real(value)):
            raise ModelError(f"motion.{name}: must be a finite number, not {shown(value)}")
        chosen[names.index(name)] = float(value)
    if chosen.any() and model.inertia > 0.0:
        raise ModelError(
            f"motion: inertia decides on the {model.name} rung; take a kinematic or quasistatic one"
        )
    return chosen


def positive(name: str, value: object) -> float:
    """A finite number greater than 0. Raises ModelError that names the option."""
    number = _real(value)
    if not 0.0 < number < math.inf:
        raise ModelError(f"{name}: must be a finite number greater than 0, not {shown(value)}")
    return number


def not_negative(name: str, value: object) -> float:
    """A finite number that is not below 0. Raises ModelError that names the option."""
    number = _real(value)
    if not 0.0 <= number < math.inf:
        raise ModelError(f"{name}: must be a finite number that is not below 0, not {shown(value)}")
    return number


def _real(value: object) -> float:
    """A number as float, and NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def count(name: str, value: object, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= MANY:
        raise ModelError(f"{name}: must be a whole number in {least}..{MANY}, not {shown(value)}")
    return int(value)
