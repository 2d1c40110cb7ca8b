"""Mass, centre, inertia, poses and faults of a bound scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from numpy.typing import NDArray
from shapely import Geometry

from rungwise.scene import InvalidScene, SceneError, load
from rungwise.scene.template.records import Records

TRIANGLE = [[0.0, 0.0], [3.0, 0.0], [1.0, 2.0]]
TRAPEZE = [[-1.0, -0.4], [1.2, -0.5], [0.7, 0.6], [-0.3, 0.8]]


def bound(body: dict[str, Any], given: dict[str, float] | None = None, **fields: Any) -> Records:
    """Records of a scene with one body, free unless it says otherwise."""
    whole = {"role": "object", "motion": {"kind": "free"}} | body
    return load({"name": "test", "bodies": {"b": whole}, **fields}).bind(given).records


def polygon(vertices: Any, **more: Any) -> dict[str, Any]:
    return {"kind": "polygon", "vertices": vertices, **more}


def mass_centre_inertia(records: Records) -> tuple[float, float, float, float]:
    body = records.bodies[0]
    return tuple(float(body[field]) for field in ("mass", "centre_x", "centre_y", "inertia"))  # type: ignore[return-value]


def moments(drawn: Geometry) -> tuple[float, float, float, float]:
    """Area, centroid and polar second moment about it, from the outline that shapely draws."""
    x, y = shapely.get_coordinates(shapely.normalize(drawn).exterior).T
    centre = drawn.centroid
    x, y = x - centre.x, y - centre.y
    cross = x[:-1] * y[1:] - x[1:] * y[:-1]
    squares = x[:-1] ** 2 + x[:-1] * x[1:] + x[1:] ** 2 + y[:-1] ** 2 + y[:-1] * y[1:] + y[1:] ** 2
    return drawn.area, centre.x, centre.y, abs(float(cross @ squares)) / 12.0


def turned(points: Any, angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"kind": "disc", "radius": 2.0, "at": [1.0, 3.0]}, (4.0 * math.pi, 1.0, 3.0, 8.0 * math.pi)),
        (
            {"kind": "box", "width": 2.0, "height": 3.0, "at": [1.0, 0.0], "angle": 0.7},
            (6.0, 1.0, 0.0, 6.5),
        ),
        (polygon(TRIANGLE), (3.0, 4.0 / 3.0, 2.0 / 3.0, 3.0 * (9.0 + 8.0 + 5.0) / 36.0)),
        (
            {"kind": "capsule", "length": 2.0, "radius": 0.5},
            (
                2.0 + math.pi / 4.0,
                0.0,
                0.0,
                2.0 * (4.0 + 1.0) / 12.0 + math.pi / 4.0 * (0.125 + 1.0 + 2.0 * 4.0 * 0.5 / (3.0 * math.pi)),
            ),
        ),
        (
            {"kind": "regular", "corners": 6, "reach": 2.0, "at": [1.0, 0.5], "angle": 0.3},
            (6.0 * math.sqrt(3.0), 1.0, 0.5, 6.0 * math.sqrt(3.0) * 4.0 / 6.0 * 2.5),
        ),
    ],
    ids=["disc", "box", "triangle", "capsule", "hexagon"],
)
def test_closed_forms(shape: dict[str, Any], expected: tuple[float, ...]) -> None:
    assert mass_centre_inertia(bound({"shape": shape})) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    area, x, y, inertia = mass_centre_inertia(bound({"shape": shape, "density": 2.5}))
    assert (area, x, y, inertia) == pytest.approx(
        (2.5 * expected[0], *expected[1:3], 2.5 * expected[3]), rel=1e-12, abs=1e-12
    )


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("at", [[0.0, 0.0], [0.4, -1.1]])
@pytest.mark.parametrize("angle", [0.0, 2.1])
def test_rounded_polygon_is_shapelys_buffer(radius: float, at: list[float], angle: float) -> None:
    shape = polygon(TRAPEZE, radius=radius, at=at, angle=angle)
    drawn = shapely.Polygon(turned(TRAPEZE, angle) + at).buffer(radius, quad_segs=2000)
    assert mass_centre_inertia(bound({"shape": shape})) == pytest.approx(moments(drawn), rel=1e-6)


def test_a_regular_polygon_is_the_polygon_of_its_corners_at_any_parameters() -> None:
    corners = [[0.9 * math.cos(t), 0.9 * math.sin(t)] for t in 2.0 * math.pi * np.arange(5) / 5.0]
    whole = {"kind": "regular", "corners": 5, "reach": "3 * r", "radius": 0.1, "angle": 0.2}
    sized = {"parameters": {"r": {"default": 0.1, "range": [0.0, 1.0]}}}
    there = mass_centre_inertia(bound({"shape": whole}, {"r": 0.3}, **sized))
    assert there == pytest.approx(
        mass_centre_inertia(bound({"shape": polygon(corners, radius=0.1, angle=0.2)}))
    )
    with pytest.raises(InvalidScene, match=r"shape\.reach"):
        bound({"shape": whole}, {"r": 0.0}, **sized)


def test_capsule_is_shapelys_buffer() -> None:
    shape = {"kind": "capsule", "length": 1.3, "radius": 0.4, "at": [0.3, 0.2], "angle": -0.6}
    ends = turned([[-0.65, 0.0], [0.65, 0.0]], -0.6) + np.array([0.3, 0.2])
    drawn = shapely.LineString(ends).buffer(0.4, quad_segs=2000)
    assert mass_centre_inertia(bound({"shape": shape})) == pytest.approx(moments(drawn), rel=1e-6)


def test_body_of_several_shapes_is_their_sum() -> None:
    shapes = [
        {"kind": "box", "width": 2.0, "height": 1.0, "at": [0.0, -0.5]},
        {"kind": "box", "width": 1.0, "height": 2.0, "at": [0.2, 1.0]},
        polygon([[0.7, 0.0], [1.0, 0.0], [0.7, 1.0]]),
    ]
    drawn = shapely.union_all(
        [
            shapely.box(-1.0, -1.0, 1.0, 0.0),
            shapely.box(-0.3, 0.0, 0.7, 2.0),
            shapely.Polygon([[0.7, 0.0], [1.0, 0.0], [0.7, 1.0]]),
        ]
    )
    assert mass_centre_inertia(bound({"shape": shapes})) == pytest.approx(moments(drawn), rel=1e-12)


def test_order_and_sense_of_vertices_do_not_matter() -> None:
    expected = mass_centre_inertia(bound({"shape": polygon(TRAPEZE, radius=0.1)}))
    for first in range(4):
        for sense in (1, -1):
            vertices = (TRAPEZE[first:] + TRAPEZE[:first])[::sense]
            records = bound({"shape": polygon(vertices, radius=0.1)})
            assert mass_centre_inertia(records) == pytest.approx(expected, rel=1e-12)
            assert np.sort(records.vertices["x"]) == pytest.approx(
                np.sort(np.array(TRAPEZE)[:, 0]) - expected[1]
            )
            outward = (
                records.vertices["normal_x"] * records.vertices["x"]
                + records.vertices["normal_y"] * records.vertices["y"]
            )
            assert outward.min() > 0.0


def test_coordinates_are_of_the_centre_and_the_pose_of_the_drawing() -> None:
    pose = {"x": 2.0, "y": -1.0, "angle": 0.9}
    records = bound({"shape": polygon(TRIANGLE), "pose": pose})
    body = records.bodies[0]
    drawn = turned(TRIANGLE, 0.9) + np.array([2.0, -1.0])
    assert (body["x"], body["y"]) == pytest.approx(tuple(drawn.mean(axis=0)))
    local = np.column_stack([records.vertices["x"], records.vertices["y"]])
    assert turned(local, 0.9) + np.array([body["x"], body["y"]]) == pytest.approx(drawn)
    assert records.shapes[0]["reach"] == pytest.approx(np.hypot(*local.T).max())


def test_given_mass_centre_and_inertia_are_respected() -> None:
    shape = polygon(TRIANGLE)
    assert mass_centre_inertia(bound({"shape": shape, "mass": 6.0})) == pytest.approx(
        (6.0, 4.0 / 3.0, 2.0 / 3.0, 11.0 / 3.0)
    )
    about_corner = 3.0 * ((4.0 / 3.0) ** 2 + (2.0 / 3.0) ** 2) + 11.0 / 6.0
    assert mass_centre_inertia(bound({"shape": shape, "centre": [0.0, 0.0]})) == pytest.approx(
        (3.0, 0.0, 0.0, about_corner)
    )
    given = {"mass": 2.0, "centre": [0.1, 0.2], "inertia": 7.0}
    records = bound({"shape": {"kind": "point", "at": [1.0, 1.0]}, **given})
    assert mass_centre_inertia(records) == (2.0, 0.1, 0.2, 7.0)
    assert list(records.coordinates["mass"]) == [2.0, 2.0, 7.0]
    assert list(records.coordinates["metric"]) == [1.0, 1.0, 3.5]


def test_hinge_and_slide_have_the_inertia_of_their_motion() -> None:
    shape = {"kind": "disc", "radius": 1.0, "at": [1.0, 0.0]}
    hinge = bound(
        {"shape": shape, "pose": {"angle": math.pi / 2.0}, "motion": {"kind": "hinge", "pivot": [2, 1]}}
    )
    assert hinge.coordinates[0]["mass"] == pytest.approx(math.pi * (0.5 + 4.0))
    assert hinge.coordinates[0]["metric"] == pytest.approx(4.5)
    slide = bound({"shape": shape, "motion": {"kind": "slide", "axis": [3.0, -4.0]}})
    assert slide.coordinates[0]["mass"] == pytest.approx(math.pi)
    assert (slide.bodies[0]["axis_x"], slide.bodies[0]["axis_y"]) == pytest.approx((0.6, -0.8))


def test_expressions_bind_as_literals_do() -> None:
    values = {"a": 1.5, "r": 0.2, "m": 3.0}

    def scene(a: float | str, r: float | str, m: float | str, negative: float | str) -> dict[str, Any]:
        return {
            "shape": [
                polygon([[negative, 0.0], [a, 0.0], [0.0, a]], radius=r, angle=r),
                {"kind": "box", "width": a, "height": r, "at": [r, a]},
            ],
            "pose": {"x": a, "y": negative, "angle": r},
            "mass": m,
            "motion": {"kind": "hinge", "pivot": [r, negative]},
        }

    names = {name: {"default": 1.0} for name in values}
    written = bound(scene("a", "r", "2 * m - m", "-a"), values, parameters=names)
    literal = bound(scene(1.5, 0.2, 3.0, -1.5))
    for kind in ("bodies", "coordinates", "shapes", "vertices"):
        assert getattr(written, kind).tobytes() == getattr(literal, kind).tobytes()


def test_binding_again_starts_from_what_is_written() -> None:
    names = {"a": {"default": 1.0}}
    scene = load(
        {
            "name": "test",
            "parameters": names,
            "bodies": {
                "b": {
                    "role": "object",
                    "motion": {"kind": "free"},
                    "shape": polygon([[0, 0], [0, "a"], [2, 0]]),
                }
            },
        }
    )
    first = scene.bind({"a": 2.0}).buffer.copy()
    scene.bind({"a": -3.0})
    assert np.array_equal(scene.bind({"a": 2.0}).buffer, first)


SLIDE = {"kind": "slide", "axis": [1.0, 0.0]}


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"shape": polygon([[0, 0], [2, 0], [1, 0.2], [1, 2]])}, ("bodies.b.shape", "convex")),
        ({"shape": polygon([[0, 0], [1, 1], [1, 0], [0, 1]])}, ("bodies.b.shape", "convex")),
        ({"shape": polygon([[0, 0], [1, 0], [1, 0], [0, 1]])}, ("bodies.b.shape", "convex")),
        ({"shape": polygon([[0, 0], [1, 0], [2, 0]])}, ("bodies.b.shape", "convex")),
        (
            {
                "shape": polygon(
                    [[math.cos(4 * math.pi * k / 5), math.sin(4 * math.pi * k / 5)] for k in range(5)]
                )
            },
            ("bodies.b.shape", "convex"),
        ),
        ({"shape": {"kind": "halfplane", "normal": [0, 0]}, "mass": 1}, ("bodies.b.shape", "normal")),
        ({"shape": {"kind": "disc", "radius": 0}}, ("bodies.b.shape.radius", "> 0")),
        ({"shape": {"kind": "box", "width": 1, "height": -1}}, ("bodies.b.shape.height", "> 0")),
        ({"shape": polygon(TRIANGLE, radius=-0.1)}, ("bodies.b.shape.radius", ">= 0")),
        ({"shape": polygon(TRIANGLE), "density": -1}, ("bodies.b.density", ">= 0")),
        (
            {"shape": polygon(TRIANGLE), "motion": {"kind": "slide", "axis": [0, 0]}},
            ("bodies.b", "axis has no length"),
        ),
        ({"shape": {"kind": "point"}}, ("bodies.b", "mass")),
        ({"shape": {"kind": "point"}, "mass": 1.0}, ("bodies.b", "inertia")),
        ({"shape": {"kind": "point"}, "motion": SLIDE}, ("bodies.b", "mass")),
        ({"shape": polygon(TRIANGLE), "mass": 0.0}, ("bodies.b", "mass")),
        (
            {"shape": polygon(TRIANGLE), "motion": SLIDE, "coordinates": {"s": {"start": 2, "upper": 1}}},
            ("bodies.b.coordinates.s", "outside"),
        ),
        (
            {"shape": polygon(TRIANGLE), "motion": SLIDE, "coordinates": {"s": {"lower": 2, "upper": 1}}},
            ("bodies.b.coordinates.s", "outside"),
        ),
    ],
)
def test_what_is_impossible_names_its_field(body: dict[str, Any], words: tuple[str, str]) -> None:
    with pytest.raises((InvalidScene, SceneError)) as caught:
        bound(body)
    text = str(caught.value)
    assert text.startswith(words[0]) and words[1] in text and "\n" not in text


@pytest.mark.parametrize("mass", [-1, "-1", "2 - 3", "-1e-9 * pi"])
def test_constants_out_of_range_are_refused_by_load(mass: object) -> None:
    body = {"role": "object", "shape": {"kind": "disc", "radius": 1}, "motion": {"kind": "free"}}
    with pytest.raises(SceneError, match=r"bodies\.b\.mass: -.* must be >= 0"):
        load({"name": "a", "bodies": {"b": {**body, "mass": mass}}})
    with pytest.raises(SceneError, match="step: 0 must be > 0"):
        load({"name": "a", "bodies": {"b": body}, "step": 0})
    assert load({"name": "a", "parameters": {"m": {"default": -1.0}}, "bodies": {"b": {**body, "mass": "m"}}})


def test_a_point_needs_no_mass_where_no_force_moves_it() -> None:
    driven = {"motion": SLIDE, "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}}}
    assert bound({"shape": {"kind": "point"}, **driven}).coordinates[0]["mass"] == 0.0
    assert bound({"shape": {"kind": "point"}, "motion": {"kind": "fixed"}}).bodies[0]["mass"] == 0.0


def support(shape: Any, **fields: Any) -> tuple[float, float, float, float]:
    """Greatest force, ratio and centre of pressure (from the centre of mass) of a body on a support."""
    given = {"friction": 0.5, "load": 4.0} | fields
    record = bound({"shape": shape, "mass": 1.0, "inertia": 1.0, "support": given}).supports[0]
    return tuple(float(record[field]) for field in ("force", "ratio", "centre_x", "centre_y"))  # type: ignore[return-value]


def mean_distance(shapes: list[Geometry], x: float, y: float) -> float:
    """Mean distance of areas from a point, on a grid of cells."""
    total = area = 0.0
    for drawn in shapes:
        low_x, low_y, high_x, high_y = drawn.bounds
        a = low_x + (np.arange(1000) + 0.5) * (high_x - low_x) / 1000
        b = low_y + (np.arange(1000) + 0.5) * (high_y - low_y) / 1000
        grid_x, grid_y = np.meshgrid(a, b)
        inside = shapely.contains_xy(drawn, grid_x, grid_y)
        mean = float(np.hypot(grid_x - x, grid_y - y)[inside].mean())
        total, area = total + mean * drawn.area, area + drawn.area
    return total / area


def test_pressure_in_closed_form() -> None:
    square = (math.sqrt(2.0) + math.asinh(1.0)) / 6.0
    for shape, more, c in (
        ({"kind": "disc", "radius": 0.3}, {}, 0.2),
        ({"kind": "disc", "radius": 0.3, "at": [7.0, 2.0]}, {"centre": [7.3, 2.0]}, 3.2 / (3.0 * math.pi)),
        ({"kind": "disc", "radius": 0.3}, {"pressure": {"kind": "ring", "radius": 0.1}}, 0.1),
        ({"kind": "box", "width": 2.0, "height": 2.0}, {}, 2.0 * square),
        ({"kind": "box", "width": 3.0, "height": 4.0}, {},
         (5.0 + 9.0 / 8.0 * math.asinh(4.0 / 3.0) + 16.0 / 6.0 * math.asinh(3.0 / 4.0)) / 6.0),
        ({"kind": "box", "width": 1.0, "height": 1.0}, {"centre": [0.5, 0.5]}, 2.0 * square),
        ({"kind": "point"}, {"pressure": {"kind": "ratio", "ratio": 0.0}}, 0.0),
    ):  # fmt: skip
        force, ratio, _, _ = support(shape, **more)
        assert force == 2.0
        assert ratio == pytest.approx(c, rel=1e-11), shape


@pytest.mark.long
def test_pressure_of_outlines_about_any_point_of_their_hull() -> None:
    rng = np.random.default_rng(3)
    for _ in range(6):
        angle, radius = float(rng.uniform(-3.0, 3.0)), float(rng.uniform(0.05, 0.6))
        at = rng.uniform(-1.0, 1.0, 2)
        trapeze = polygon(TRAPEZE, radius=radius, angle=angle, at=at.tolist())
        disc = {"kind": "disc", "radius": 0.5, "at": [2.0, 1.0]}
        drawn = [
            shapely.Polygon(turned(TRAPEZE, angle) + at).buffer(radius, quad_segs=200),
            shapely.Point(2.0, 1.0).buffer(0.5, quad_segs=200),
        ]
        hull = shapely.union_all(drawn).convex_hull.buffer(-1e-3)
        place = rng.uniform(-2.0, 3.0, 2)
        while not hull.contains(shapely.Point(place)):
            place = rng.uniform(-2.0, 3.0, 2)
        _, found, x, y = support([trapeze, disc], centre=place.tolist())
        assert found == pytest.approx(mean_distance(drawn, *place), rel=2e-4)
        records = bound({"shape": [trapeze, disc]})
        centre = np.array([records.bodies[0]["centre_x"], records.bodies[0]["centre_y"]])
        np.testing.assert_allclose([x, y], place - centre, atol=1e-12)


def test_pressure_lies_under_the_outline_or_on_its_points() -> None:
    box = {"kind": "box", "width": 1.0, "height": 1.0, "at": [1.0, 0.0]}
    _, _, x, y = support(box)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-15)
    feet = {"kind": "points", "points": [[0.0, 0.0], [3.0, 0.0]], "weights": [2.0, 1.0]}
    _, ratio, x, y = support(box, pressure=feet)
    assert (ratio, x, y) == pytest.approx((4.0 / 3.0, 0.0, 0.0), abs=1e-15)
    assert support(box, pressure=feet, centre=[0.0, 0.0])[1:] == pytest.approx((1.0, -1.0, 0.0))


def test_the_load_of_a_support_is_a_force_or_the_weight() -> None:
    body = {"shape": {"kind": "disc", "radius": 1.0}, "density": 2.0}
    given = {"friction": 0.5, "gravity": 10.0}
    record = bound(body | {"support": given}).supports[0]
    assert float(record["force"]) == pytest.approx(0.5 * 10.0 * 2.0 * math.pi)
