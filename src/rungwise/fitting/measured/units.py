"""Units of measurements: columns that state a unit are counted in m, kg, s and rad until a scene is known.

From then on all columns are in the scene's units; columns that state no unit always are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rungwise.fitting.measured.errors import MotionError
from rungwise.scene.fields.values import shown
from rungwise.scene.language.units import DEGREE, SI, UNIT, Measure, measured
from rungwise.wording import choices

Powers = tuple[int, int, int]
PLACES: dict[Powers, str] = {(1, 0, 0): "a length", (0, 0, 0): "an angle"}
RATES: dict[Powers, str] = {(1, 0, -1): "a speed", (0, 0, -1): "an angular speed"}
TIMES: dict[Powers, str] = {(0, 0, 1): "a time"}
"""Powers of length, mass and time that units of columns may have, in words."""


def stated(
    units: Mapping[str, str], places: Sequence[str], rates: Sequence[str], others: Sequence[str]
) -> dict[str, Measure]:  # fmt: skip
    """The units of "time", of coordinates, velocities, and of other columns, whose units may be any. Raises
    MotionError for unknown names and units."""
    known: dict[str, dict[Powers, str] | None] = {"time": TIMES}
    known |= dict.fromkeys(places, PLACES) | dict.fromkeys(rates, RATES) | dict.fromkeys(others)
    found = {}
    for name, unit in units.items():
        if name not in known:
            raise MotionError(f"units: unknown {shown(name)}{choices(name, known)}")
        try:
            measure = measured(unit) if UNIT.fullmatch(unit) else None
        except ValueError:
            measure = None
        if measure is None:
            raise MotionError(
                f"units.{name}: unknown unit {shown(unit)}; units are products of m, g, s, N, J, W, Pa, Hz,"
                " rad and deg with a prefix, such as mm or deg/s"
            )
        allowed = known[name]
        if allowed is not None and measure.powers not in allowed:
            raise MotionError(f"units.{name}: {shown(unit)} is no unit of {' or '.join(allowed.values())}")
        found[name] = measure
    return found


def in_si(measure: Measure | None) -> float:
    """By what values in a unit are multiplied to be in m, kg, s and rad."""
    return 1.0 if measure is None else measure.scale * DEGREE**measure.degrees


def in_scene(
    scene: Any, told: Mapping[str, Measure], of: Mapping[str, tuple[int, ...]]
) -> dict[str, float]:  # fmt: skip
    """By what columns that state a unit are multiplied to go from m, kg, s and rad to the units of a scene;
    of: powers that its columns have, by name. A parameter has its own unit. Raises MotionError where a column
    is something else in the scene."""
    own = scene.file.units
    counted = SI if own is None else own.model_dump()
    bases = [measured(counted[kind]).scale for kind in SI]
    found = {}
    for name, measure in told.items():
        parameter = scene.file.parameters.get(name)
        wanted = measured(parameter.unit) if parameter is not None else None
        powers = of.get(name, measure.powers) if wanted is None else wanted.powers
        if measure.powers != powers:
            raise MotionError(
                f"units.{name}: {named(measure.powers)}, and in the scene it is {named(powers)}"
            )
        if wanted is not None:
            found[name] = 1.0 / in_si(wanted)
        else:
            found[name] = 1.0 / math.prod(base**power for base, power in zip(bases, powers, strict=True))
    return found


def named(powers: tuple[int, ...]) -> str:
    """A unit of m, kg and s with these powers, as a head of a column states it."""
    parts = [(base, power) for base, power in zip(("m", "kg", "s"), powers, strict=True) if power]
    above = "*".join(f"{base}^{power}" if power > 1 else base for base, power in parts if power > 0)
    below = "".join(f"/{base}^{-power}" if power < -1 else f"/{base}" for base, power in parts if power < 0)
    return (above or "rad") + below
