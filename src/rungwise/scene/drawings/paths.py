"""Paths of drawings: what a file draws, as polylines, y upwards.

SVG is read by svgelements (units, viewBox, transforms, references), DXF by ezdxf (the extra `drawings`).
Chords end on the curve and depart from it by no more than a given distance.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.wording import choices

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254}
MAX_DRAWING = 20_000_000
FEWEST, MOST = 4, 1024
"""Chords of a curve: a few at least, so that nothing hides between its ends."""

Place = tuple[float, float]


@dataclass(frozen=True)
class Drawn:
    """A path of a file: its name there, its points in units of the file, and whether it is closed."""

    name: str
    points: list[Place]
    closed: bool


Flatten = Callable[[Any, float], tuple[list[Place], bool]]
Read = tuple[float | None, dict[str, list[Any]], Flatten]
"""The unit of a file in metres, its curves by name, and what makes chords of a curve."""


@dataclass(frozen=True)
class File:
    """The paths of a file at a tolerance, in its units; a unit in metres, None where it says none."""

    unit: float | None
    paths: Callable[[float], Iterator[Drawn]]


def read_drawing(field: str, path: Path, name: str | None) -> File:
    """The file's paths, all of them or those of a name. Raises SceneError, in a line that begins with
    `field` and names `file` or `path` in it."""
    readers: dict[str, Callable[[Path], Read]] = {".svg": _svg, ".dxf": _dxf}
    text = f"{field}.file: {str(path)[:200]!r}"
    if path.suffix.lower() not in readers:
        raise SceneError(f"{text} is neither an SVG nor a DXF file (by its name)")
    if not path.is_file():
        raise SceneError(f"{text} is no file")
    if path.stat().st_size > MAX_DRAWING:
        raise SceneError(f"{text} is larger than {MAX_DRAWING} bytes")
    try:
        unit, named, flat = readers[path.suffix.lower()](path)
    except ImportError:
        raise SceneError(
            f"{text} needs svgelements and ezdxf, which come with: pip install 'rungwise[drawings]'"
        ) from None
    except Exception as error:  # readers of torn drawings raise nearly anything
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise SceneError(f"{text} cannot be read: {reason}") from None
    if not named:
        raise SceneError(f"{text} draws no path")
    if name is not None and name not in named:
        raise SceneError(
            f"{field}.path: {path.name} has none named {shown(name)}{choices(name, tuple(named))}"
        )
    wanted = named if name is None else {name: named[name]}

    def paths(tolerance: float) -> Iterator[Drawn]:
        for label, curves in wanted.items():
            for curve in curves:
                points, closed = flat(curve, tolerance)
                if len(points) > 1:
                    yield Drawn(label, points, closed)

    return File(unit, paths)


def _svg(path: Path) -> Read:
    """Subpaths by the id of their element, in user units at 96 to the inch."""
    import svgelements

    text = path.read_text("utf-8")
    document = svgelements.SVG.parse(str(path), ppi=96.0)
    named: dict[str, list[Any]] = {}
    for count, element in enumerate(document.elements()):
        if isinstance(element, svgelements.Shape):
            label = str(element.id or f"path{count}")
            named.setdefault(label, []).extend(svgelements.Path(element).as_subpaths())
    width = re.search(r"<svg\b[^>]*?\swidth\s*=\s*['\"]\s*[-+.\deE]+\s*([a-z]+)", text)
    # svgelements takes a millimetre for 0.0393701 inches.
    exact = 1.0 / (25.4 * 0.0393701) if width and width[1] in ("mm", "cm") else 1.0
    return exact * METRES["in"] / 96.0, named, _flat_svg


def _flat_svg(subpath: Any, tolerance: float) -> tuple[list[Place], bool]:
    import svgelements

    points: list[Place] = []
    closed = False
    for segment in subpath:
        if isinstance(segment, svgelements.Close):
            closed = True
        elif isinstance(segment, svgelements.Move | svgelements.Line):
            points.append(_place(segment.end))
        else:
            points.extend(_chords(segment, tolerance))
    return points, closed


def _place(point: Any) -> Place:
    return float(point.x), 0.0 - float(point.y)


def _chords(segment: Any, tolerance: float) -> list[Place]:
    """Ends of chords of a segment but for the first: so many that three points of each keep the tolerance."""
    count = FEWEST
    while True:
        places = np.array(segment.npoint(np.linspace(0.0, 1.0, 4 * count + 1)), float) * (1.0, -1.0)
        start, end = places[:-1:4], places[4::4]
        along = end - start
        length = np.maximum(np.hypot(*along.T), np.finfo(float).tiny)
        across = [
            along[:, 0] * (p - start)[:, 1] - along[:, 1] * (p - start)[:, 0]
            for p in (places[k:-1:4] for k in (1, 2, 3))
        ]
        if np.max(np.abs(across) / length) <= tolerance or count >= MOST:
            return [(float(x), 0.0 + float(y)) for x, y in end]
        count *= 2


def _dxf(path: Path) -> Read:
    """Curves of the model space by layer; blocks are taken apart."""
    from ezdxf import disassemble
    from ezdxf import path as paths
    from ezdxf.enums import InsertUnits
    from ezdxf.filemanagement import readfile
    from ezdxf.units import conversion_factor

    document = readfile(path)
    units = InsertUnits(document.units)
    unit = conversion_factor(units, InsertUnits.Meters) if units else None
    named: dict[str, list[Any]] = {}
    for entity in disassemble.recursive_decompose(document.modelspace()):
        try:
            curve = paths.make_path(entity)
        except TypeError:
            continue
        named.setdefault(str(entity.dxf.layer), []).extend(curve.sub_paths())
    return unit, named, _flat_dxf


def _flat_dxf(curve: Any, tolerance: float) -> tuple[list[Place], bool]:
    return [(float(p.x), float(p.y)) for p in curve.flattening(tolerance)], bool(curve.is_closed)
