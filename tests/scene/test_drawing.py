"""Shapes from SVG and DXF files: sizes, units, holes, and drawings that are no outline."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf.filemanagement
import numpy as np
import pytest
import shapely
from ezdxf.layouts import Modelspace

import rungwise as rw
from rungwise.scene.fields.shapes import Drawing, Outline

MM = 'width="100mm" height="100mm" viewBox="0 0 100 100"'


def svg(folder: Path, body: str, attributes: str = MM) -> str:
    file = folder / "part.svg"
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{body}</svg>', "utf-8")
    return str(file)


def dxf(folder: Path, draw: Callable[[Modelspace], Any], units: int = 4) -> str:
    document = ezdxf.filemanagement.new()
    document.units = units
    draw(document.modelspace())
    file = folder / "part.dxf"
    document.saveas(file)
    return str(file)


def outline(file: str, **fields: Any) -> Outline:
    """The outline of a drawing, as the scene that was read holds it."""
    shape = {"kind": "drawing", "file": file} | fields
    body = {"role": "object", "shape": shape, "motion": {"kind": "free"}}
    scene = rw.load({"name": "part", "bodies": {"part": body}})
    found = scene.file.bodies["part"].shapes[0]
    assert isinstance(found, Outline)
    again = rw.load(scene.file.model_dump(mode="json"))
    assert again.file == scene.file and again.bind().records.bodies[0]["mass"] > 0.0
    return found


def polygon(found: Outline) -> shapely.Polygon:
    return shapely.Polygon(np.array(found.vertices, float), [np.array(hole, float) for hole in found.holes])


PLATE = '<rect id="plate" x="10" y="20" width="40" height="30"/><circle id="hole" cx="25" cy="30" r="5"/>'


@pytest.mark.parametrize(
    ("unit", "length"), [("m", 1.0), ("cm", 100.0), ("mm", 1e3), ("um", 1e6), ("nm", 1e9), ("in", 1 / 0.0254)]
)
def test_sizes_are_in_the_scenes_unit(tmp_path: Path, unit: str, length: float) -> None:
    found = polygon(outline(svg(tmp_path, PLATE), unit=unit))
    exact = (0.04 * 0.03 - math.pi * 0.005**2) * length**2
    assert found.area == pytest.approx(exact, rel=1e-3)
    assert len(found.interiors) == 1
    x0, y0, x1, y1 = found.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx((0.04 * length, 0.03 * length), rel=1e-9)


@pytest.mark.parametrize(
    ("attributes", "length"),
    [
        ('width="100" height="100"', 0.0254 / 96),
        ('width="4in" height="4in" viewBox="0 0 100 100"', 4 * 0.0254 / 100),
        ('width="100mm" height="100mm" viewBox="0 0 200 200"', 0.0005),
        ('width="20cm" height="20cm" viewBox="0 0 100 100"', 0.002),
    ],
)
def test_units_and_view_of_an_svg(tmp_path: Path, attributes: str, length: float) -> None:
    file = svg(tmp_path, '<g transform="rotate(30) scale(2)"><path d="M1 1h3v4h-3z"/></g>', attributes)
    found = polygon(outline(file))
    assert found.area == pytest.approx(48 * length**2, rel=1e-9)
    assert polygon(outline(file, drawn_in="mm")).area == pytest.approx(
        found.area * (1e-3 / (0.0254 / 96)) ** 2, rel=1e-5
    )


@pytest.mark.few(3)
@pytest.mark.parametrize(("units", "length"), [(1, 0.0254), (4, 1e-3), (5, 1e-2), (6, 1.0), (13, 1e-6)])
def test_lines_and_arcs_of_a_dxf_join(tmp_path: Path, units: int, length: float) -> None:
    def plate(space: Modelspace) -> None:
        space.add_arc((40, 10), 10, -90, 90)
        space.add_line((0, 20), (0, 0))
        space.add_line((40, 0), (0, 0))
        space.add_line((0, 20), (40, 20))
        space.add_circle((40, 10), 4)
        space.add_text("a note")

    found = polygon(outline(dxf(tmp_path, plate, units), tolerance=1e-3 * length))
    exact = (800 + 50 * math.pi - 16 * math.pi) * length**2
    assert found.area == pytest.approx(exact, rel=1e-4)
    centre = (800 * 20 + 50 * math.pi * (40 + 40 / (3 * math.pi)) - 16 * math.pi * 40) * length**3 / exact
    assert found.bounds[0] == pytest.approx(-centre, rel=1e-4)


def test_blocks_of_a_dxf_are_taken_apart(tmp_path: Path) -> None:
    def place(space: Modelspace) -> None:
        block = space.doc.blocks.new("tab")
        block.add_lwpolyline([(0, 0), (2, 0), (2, 1), (0, 1)], close=True)
        space.add_blockref("tab", (5, 5), dxfattribs={"xscale": 10, "yscale": 10, "rotation": 30})

    assert polygon(outline(dxf(tmp_path, place), unit="mm")).area == pytest.approx(200.0)


@pytest.mark.few(7)
@pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.01])
@pytest.mark.parametrize("seed", range(4))
def test_curves_keep_the_tolerance(tmp_path: Path, tolerance: float, seed: int) -> None:
    """Random closed curves of arcs and Bézier pieces, beside far finer chords."""
    rng = np.random.default_rng(seed)
    knots = [(30 + 20 * math.cos(a), 30 + 20 * math.sin(a)) for a in np.arange(5) * 0.4 * math.pi]
    text = f"M{knots[0][0]} {knots[0][1]}"
    for k in range(1, 6):
        (x, y), (px, py) = knots[k % 5], knots[k - 1]
        if rng.random() < 0.3:
            text += f"A{rng.uniform(14, 25)} {rng.uniform(14, 25)} {rng.uniform(0, 90)} 0 1 {x} {y}"
        else:
            a, b = rng.uniform(0.1, 0.4, 2)
            along, out = (
                np.array([x - px, y - py]),
                np.array([x + px - 60, y + py - 60]) * rng.uniform(0, 0.3),
            )
            (ux, uy), (wx, wy) = (px, py) + a * along + out, (x, y) - b * along + out
            text += f"C{ux} {uy} {wx} {wy} {x} {y}"
    file = svg(tmp_path, f'<path d="{text}Z"/>')
    found = polygon(outline(file, unit="mm", tolerance=tolerance, origin="drawing"))
    fine = polygon(outline(file, unit="mm", tolerance=tolerance / 5, origin="drawing"))
    assert found.exterior.hausdorff_distance(fine.exterior) <= 1.2 * tolerance
    assert len(found.exterior.coords) < len(fine.exterior.coords)


def test_a_drawing_may_keep_its_origin_y_upwards(tmp_path: Path) -> None:
    file = svg(tmp_path, '<rect x="10" y="20" width="40" height="30"/>')
    assert polygon(outline(file, unit="mm", origin="drawing")).bounds == pytest.approx((10, -50, 50, -20))
    assert polygon(outline(file, unit="mm")).bounds == pytest.approx((-20, -15, 20, 15))


def test_one_path_of_several(tmp_path: Path) -> None:
    file = svg(tmp_path, PLATE + '<rect id="other" x="70" y="0" width="2" height="2"/>')
    assert polygon(outline(file, path="other", unit="mm")).area == pytest.approx(4.0)


def test_files_are_looked_for_beside_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    svg(tmp_path, PLATE)
    (tmp_path / "scene.yaml").write_text(
        "{name: a, bodies: {a: {role: object, shape: {kind: drawing, file: part.svg}, motion: {kind: free}}}}"
    )
    monkeypatch.chdir(tmp_path.parent)
    assert rw.load(tmp_path / "scene.yaml").bind().records.bodies[0]["mass"] > 0.0


def test_a_peg_rests_in_a_hole_of_a_drawing(tmp_path: Path) -> None:
    """Pieces around a hole are one body: the peg falls by its clearance and stays."""
    frame = svg(tmp_path, '<rect width="40" height="40"/><rect x="10" y="10" width="20" height="20"/>')
    bodies: dict[str, Any] = {
        "frame": {"role": "obstacle", "shape": {"kind": "drawing", "file": frame, "unit": "mm"}},
        "peg": {
            "role": "object",
            "mass": 1.0,
            "shape": {"kind": "box", "width": 16, "height": 16},
            "motion": {"kind": "free"},
        },
    }
    contact = {"between": ["frame", "peg"], "friction": 0.5, "stiffness": 1e6, "damping": 1e3}
    scene = {"name": "a", "bodies": bodies, "contacts": [contact], "gravity": [0, -9810]}
    run = rw.simulate(rw.load(scene | {"tolerance": 1e-4, "duration": 0.2, "step": 1e-3}), "dynamic-rigid")
    assert run.state.q == pytest.approx([0.0, -2.0, 0.0], abs=1e-3)


WRONG = {
    '<path id="q" d="M0 0 L10 0 L10 10"/>': (
        "file: the path q is open from (0.01, -0.01) to (0, 0), a gap of 0.0141421"
    ),
    '<path id="q" d="M0 0 L10 10 L10 0 L0 10 Z"/>': (
        "file: the path q crosses or touches itself at (0.005, -0.005), or has no area"
    ),
    '<path id="q" d="M0 0 L10 0 L20 0 Z"/>': "file: the path q crosses or touches itself",
    PLATE + '<circle id="r" cx="25" cy="30" r="2"/>': "file: the holes hole and r of plate lie in each other",
    PLATE + '<circle id="r" cx="50" cy="30" r="2"/>': "file: the paths plate and r cross or touch each other",
    PLATE + '<circle id="r" cx="80" cy="30" r="2"/>': (
        "path: is required, because the file draws 2 outlines side by side; valid: plate, r"
    ),
    "<text>a</text>": "draws no path",
    "<path": "cannot be read",
}


@pytest.mark.parametrize("body", WRONG)
def test_drawings_that_are_no_outline_are_told(tmp_path: Path, body: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        outline(svg(tmp_path, body))
    text = str(error.value)
    assert text.startswith("bodies.part.shape.") and WRONG[body] in text and "\n" not in text


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"path": "plat"}, "path: part.svg has none named 'plat' (did you mean plate?); valid: plate, hole"),
        ({"unit": "yard"}, "unit: must be 'm', 'cm', 'mm', 'um', 'nm' or 'in', not 'yard'"),
        ({"tolerance": 0}, "tolerance: must be greater than 0, not 0"),
        ({"tolerance": 1e-8}, "tolerance: leaves "),
        ({"origin": "corner"}, "origin: must be 'centroid' or 'drawing', not 'corner'"),
        ({"file": "none.svg"}, "file: 'none.svg' is no file"),
        ({"file": "part.png"}, "file: 'part.png' is neither an SVG nor a DXF file (by its name)"),
    ],
)
def test_wrong_fields_are_told(tmp_path: Path, fields: dict[str, Any], text: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        outline(**{"file": svg(tmp_path, PLATE)} | fields)
    assert text in str(error.value) and "\n" not in str(error.value)


ANY: tuple[Any, ...] = (
    None, True, 3, -1.0, math.nan, math.inf, 10**5000, "", "foo", "a\nb", "\0", "a" * 3000, "..", [], [1], {},
    object(),
)  # fmt: skip


@pytest.mark.parametrize("field", [name for name in Drawing.model_fields if name != "kind"])
def test_any_value_is_taken_or_refused_in_one_line(tmp_path: Path, field: str) -> None:
    file = svg(tmp_path, '<rect width="2" height="3"/>')
    refused = 0
    for value in ANY:
        try:
            outline(**{"file": file, field: value})
        except rw.SceneError as error:
            refused += 1
            assert str(error).startswith(f"bodies.part.shape.{field}") and str(error).isprintable()
    assert refused >= len(ANY) - 4


def test_a_dxf_without_a_unit_is_told(tmp_path: Path) -> None:
    file = dxf(tmp_path, lambda space: space.add_circle((0, 0), 1.0), 0)
    with pytest.raises(
        rw.SceneError, match=r"shape\.drawn_in: is required, because .* states no unit; valid: m, cm"
    ):
        outline(file)
    assert polygon(outline(file, drawn_in="in")).area == pytest.approx(math.pi * 0.0254**2, rel=1e-2)


@pytest.mark.parametrize("vertices", [3, 65, 200, 500])
def test_outlines_of_many_vertices(vertices: int) -> None:
    ring = [[math.cos(a), math.sin(a)] for a in np.arange(vertices) * (2 * math.pi / vertices)]
    for kind in ("outline", "polygon"):
        body = {"role": "object", "shape": {"kind": kind, "vertices": ring}, "motion": {"kind": "free"}}
        mass = rw.load({"name": "a", "bodies": {"a": body}}).bind().records.bodies[0]["mass"]
        assert mass == pytest.approx(0.5 * vertices * math.sin(2 * math.pi / vertices))
