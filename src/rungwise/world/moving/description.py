"""What scenes of all worlds say of themselves, as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rungwise.scene.contract import AnyScene


def heading(scene: AnyScene) -> dict[str, Any]:
    """Name and purpose of a scene."""
    return {"scene": scene.name, "about": scene.file.about}


def common(scene: AnyScene, parameters: Mapping[str, float], numbers: Any) -> dict[str, Any]:
    """Parameters, conditions, and the tolerance, duration and step of a scene's numbers, as plain values."""
    return {
        "parameters": {
            name: {"value": parameters[name], **parameter.model_dump()}
            for name, parameter in scene.file.parameters.items()
        },
        **{name: getattr(scene.file, name) for name in ("goal", "unsafe", "doomed")},
        **{name: getattr(numbers, name) for name in ("tolerance", "duration", "step")},
    }


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
