"""Outlines that are not convex: pieces, mass, refusals, and a part that rests on two of its points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from shapely.ops import split

import rungwise as rw
from rungwise.scene.drawings.outline import convex_pieces

L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]


def star(points: int, inner: float, rng: np.random.Generator | None = None) -> list[tuple[float, float]]:
    """A star, or a random outline around the origin: simple, and not convex."""
    radii = [1.0 if k % 2 == 0 else inner for k in range(2 * points)]
    if rng is not None:
        radii = [float(r) for r in rng.uniform(0.2, 1.0, 2 * points)]
    angles = [math.pi * k / points for k in range(2 * points)]
    return [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("clockwise", [False, True])
def test_pieces_are_convex_and_make_up_the_outline(seed: int, clockwise: bool) -> None:
    rng = np.random.default_rng(seed)
    outline = star(int(rng.integers(3, 12)), 0.0, rng)[:: -1 if clockwise else 1]
    pieces = [shapely.Polygon([outline[k] for k in piece]) for piece in convex_pieces(outline)]
    whole = shapely.Polygon(outline)
    assert sum(piece.area for piece in pieces) == pytest.approx(whole.area, rel=1e-12)
    assert shapely.union_all(pieces).symmetric_difference(whole).area < 1e-12
    for piece in pieces:
        assert piece.convex_hull.area == pytest.approx(piece.area, rel=1e-9) and piece.exterior.is_ccw
    reflex = sum(
        shapely.LinearRing([outline[k - 1], outline[k], outline[(k + 1) % len(outline)]]).is_ccw == clockwise
        for k in range(len(outline))
    )
    assert len(pieces) <= 2 * reflex + 1


def test_a_convex_outline_is_one_piece() -> None:
    assert len(convex_pieces([(0, 0), (1, 0), (1, 1), (0, 1)])) == 1


def part(vertices: Any, **fields: Any) -> rw.Scene:
    body = {"role": "object", "shape": {"kind": "outline", "vertices": vertices}, "motion": {"kind": "free"}}
    return rw.load({"name": "part", "bodies": {"part": body}} | fields)


def test_mass_centre_and_inertia() -> None:
    body = part(L_SHAPE).bind().records.bodies[0]
    assert (body["mass"], body["x"], body["y"]) == pytest.approx((3.0, 5 / 6, 5 / 6))
    # Two squares and one beside them: second moments about the centre by Steiner.
    squares = [(0.5, 0.5), (1.5, 0.5), (0.5, 1.5)]
    expected = sum(1 / 6 + (x - 5 / 6) ** 2 + (y - 5 / 6) ** 2 for x, y in squares)
    assert body["inertia"] == pytest.approx(expected)


def test_vertices_may_be_expressions() -> None:
    parameters = {"a": {"default": 1.0}}
    scene = part(
        [[0, 0], ["2 * a", 0], ["2 * a", "a"], ["a", "a"], ["a", "2 * a"], [0, "2 * a"]],
        parameters=parameters,
    )
    for a in (1.0, 0.3, 7.0):
        assert scene.bind({"a": a}).records.bodies[0]["mass"] == pytest.approx(3.0 * a * a)


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "bodies.part.shape: the outline crosses or touches itself"),
        (
            [[0, 0], [1, 0], [2, 0]],
            "bodies.part.shape: the outline crosses or touches itself, or has no area",
        ),
        ([[0, 0], [1, 0], [1, 0], [0, 1]], "bodies.part.shape: the outline crosses or touches itself"),
        ([[0, 0], [1, 0], ["zzz", 1]], "bodies.part.shape.vertices.2.0: unknown name zzz"),
        ([[0, 0], [1, 0], ["1/0", 1]], "bodies.part.shape.vertices.2.0: must be finite, not inf"),
    ],
)
def test_wrong_outlines(vertices: Any, message: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        part(vertices)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("model", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=str)
def test_a_star_comes_to_rest_on_two_of_its_points(model: rw.Rung) -> None:
    body = {
        "role": "object",
        "shape": {"kind": "outline", "vertices": star(5, 0.4)},
        "pose": {"y": 1.2, "angle": 0.2},
        "motion": {"kind": "free"},
    }
    bodies = {"star": body, "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}}
    contact = {"between": ["*", "*"], "friction": 0.5, "stiffness": 1e6, "damping": 1e3}
    data = {"name": "star", "gravity": [0, -9.81], "bodies": bodies, "contacts": [contact], "duration": 3.0}
    run = rw.simulate(data, model)
    assert run.worst_residual <= 1e-8 and float(run.trajectory.kinetic_energy[-1]) < 1e-12
    # Two points of the five at one height: an odd multiple of 18 degrees.
    assert math.degrees(run.final["star"]["angle"]) % 72 == pytest.approx(18.0, abs=1e-3)
    assert run.final["star"]["y"] == pytest.approx(math.cos(math.radians(36)), abs=1e-4)


def square(x: float, y: float, width: float = 1.0, height: float = 1.0) -> dict[str, Any]:
    return {"kind": "box", "width": width, "height": height, "at": [x, y]}


def bound(shapes: Any, **fields: Any) -> Any:
    body = {"role": "object", "shape": shapes, "motion": {"kind": "free"}}
    return rw.load({"name": "part", "bodies": {"part": body}} | fields).bind().records


@pytest.mark.parametrize("seed", range(10))
def test_an_outline_is_the_same_however_it_is_cut(seed: int) -> None:
    rng = np.random.default_rng(seed)
    outline = star(int(rng.integers(3, 8)), 0.0, rng)
    whole = shapely.Polygon(outline)
    pieces = [whole]
    for angle, y in rng.uniform(0.0, 1.0, (3, 2)):
        c, s = math.cos(math.pi * angle), math.sin(math.pi * angle)
        line = shapely.LineString([(-2.0 * c, y - 0.5 - 2.0 * s), (2.0 * c, y - 0.5 + 2.0 * s)])
        pieces = [part for piece in pieces for part in split(piece, line).geoms]
    shapes = [{"kind": "outline", "vertices": list(piece.exterior.coords)[:-1]} for piece in pieces]
    one, many = (bound(shape).vertices for shape in ({"kind": "outline", "vertices": outline}, shapes[::-1]))
    for field in ("x", "y", "normal_x", "normal_y"):
        assert many[field] == pytest.approx(one[field], abs=1e-12)


@pytest.mark.parametrize(
    ("shapes", "vertices"),
    [
        ([square(0, 0), square(1, 0)], 4),
        ([square(0, 0), square(1, 0), square(0, 1)], 8),
        ([square(0, 0), square(0.9, 0)], 8),
        ([square(0, 0), square(1.1, 0)], 8),
        ([square(0, 0), square(1, 1)], 8),
        ([square(0, 0), {"kind": "disc", "radius": 0.5, "at": [1.0, 0.0]}], 5),
        ([square(0, 0), square(1, 0) | {"radius": 0.1}], 8),
        ([square(0, 0), square(1, 0, "a")], 8),
    ],
    ids=["one box", "corner", "overlap", "apart", "point", "disc", "rounded", "expression"],
)
def test_which_shapes_are_pieces_of_one_outline(shapes: Any, vertices: int) -> None:
    """Those with known numbers that share a stretch of their edges, and no area; mass is the same."""
    records = bound(shapes, parameters={"a": {"default": 1.0}})
    assert len(records.vertices) == vertices
    assert records.bodies[0]["mass"] == pytest.approx(sum(mass(shape) for shape in shapes))


def mass(shape: dict[str, Any]) -> float:
    return float(bound(shape, parameters={"a": {"default": 1.0}}).bodies[0]["mass"])


def test_boxes_around_a_hole_leave_it_open() -> None:
    frame = [square(0, 1, 3), square(0, -1, 3), square(-1, 0), square(1, 0)]
    records = bound(frame)
    centres = {(float(v["x"]), float(v["y"])) for v in records.vertices}
    assert records.bodies[0]["mass"] == pytest.approx(8.0)
    assert {(abs(round(x, 9)), abs(round(y, 9))) for x, y in centres} == {(0.5, 0.5), (1.5, 1.5)}
