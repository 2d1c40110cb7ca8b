"""Options of a run: accepted values, and the errors that name the others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung, rung
from rungwise.scene import Scene
from rungwise.scene.fields.values import shown
from rungwise.wording import choices

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


def check_options(
    step: object, tol: object, duration: object, theta: object
) -> tuple[float | None, float | None, float | None, float]:
    """The options as numbers. Raises ModelError that names the option out of its range."""
    if not 0.5 <= _real(theta) <= 1.0:
        raise ModelError(f"theta: must be a number in 0.5..1, not {shown(theta)}")
    return (
        None if step is None else positive("step", step),
        None if tol is None else positive("tol", tol),
        None if duration is None else positive("time", duration),
        _real(theta),
    )


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
