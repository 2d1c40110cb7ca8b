"""Units in which a scene counts, for the scales of its pictures."""

from __future__ import annotations

import re
from typing import Any

SI = {"length": "m", "time": "s", "force": "N"}
ANGLES = {"rad", "deg"}


def titled(file: Any, name: str) -> str:
    """The name of a parameter, and its unit where it has one: the title of an axis."""
    unit = file.parameters[name].unit
    return f"{name} [{unit}]" if unit not in (None, "", "1") else name


def units_of(file: Any) -> dict[str, str]:
    """The units of length, time and force in which a scene counts: what it says; without that metres,
    kilograms and seconds if a parameter has a unit, else "", since such a scene may count in any."""
    own = file.units
    if own is None:
        found = any(
            set(re.findall(r"[A-Za-zµ]+", each.unit or "")) - ANGLES for each in file.parameters.values()
        )
        return dict(SI) if found else dict.fromkeys(SI, "")
    is_si = (own.length, own.mass, own.time) == ("m", "kg", "s")
    return {"length": own.length, "time": own.time, "force": "N" if is_si else ""}
