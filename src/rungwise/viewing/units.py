"""Units that a scene's parameters agree on, for the scales of its pictures."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

BASES = {"length": "m", "time": "s", "force": "N"}


def titled(file: Any, name: str) -> str:
    """The name of a parameter, and its unit where it has one: the title of an axis."""
    unit = file.parameters[name].unit
    return f"{name} [{unit}]" if unit not in (None, "", "1") else name


def units_of(file: Any) -> dict[str, str]:
    """The units in which a scene says that it counts; else what its parameters agree on."""
    if file.units is None:
        return common_units(each.unit for each in file.parameters.values())
    own = file.units
    is_si = (own.length, own.mass, own.time) == ("m", "kg", "s")
    return {"length": own.length, "time": own.time, "force": "N" if is_si else ""}


def common_units(declared: Iterable[str]) -> dict[str, str]:
    """The unit of lengths, times and forces: the one in the declared units, or "" for none or several."""
    symbols = {symbol for unit in declared for symbol in re.findall(r"[A-Za-zµ]+", unit)}
    found = {
        kind: [symbol for symbol in symbols if re.fullmatch(f"[kMGcmuµn]?{base}", symbol)]
        for kind, base in BASES.items()
    }
    return {kind: units[0] if len(units) == 1 else "" for kind, units in found.items()}
