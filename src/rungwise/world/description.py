"""What scenes of all worlds say of themselves, as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def stated(report: Mapping[str, Any], width: int) -> list[str]:
    """Lines of the parameters, whose names have this width, of the conditions, and of times and tolerance."""
    lines = ["parameters"]
    for name, p in report["parameters"].items():
        unit = "" if p["unit"] == "1" else f" {p['unit']}"
        within = "" if p["range"] is None else f", {p['range'][0]:g} to {p['range'][1]:g}"
        lines.append(f"  {name:{width}s} {p['value']:.6g}{unit}{within}  {p['about']}")
    lines += [f"{field}: {report[field]}" for field in ("goal", "unsafe", "doomed") if report[field]]
    told = (
        f"tolerance {report['tolerance']:.3g}, duration {report['duration']:.6g}, step {report['step']:.3g}"
    )
    return [*lines, told]
