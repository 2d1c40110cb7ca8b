"""Gaps against shapely: distance of the cores less the radii."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from numpy.random import Generator
from shapely import Geometry

from rungwise.system.planar.contact_manifold import ABSENT

KINDS = ("point", "disc", "capsule", "box", "polygon")
FREE = {"role": "object", "motion": {"kind": "free"}, "mass": 1.0, "inertia": 1.0}


def random_shape(rng: Generator, kind: str) -> dict[str, Any]:
    """A shape of size about 1, placed and turned in its body's frame."""
    at, angle = [float(x) for x in rng.uniform(-0.5, 0.5, 2)], float(rng.uniform(-4.0, 4.0))
    a, b, r = (float(x) for x in rng.uniform(0.1, 1.0, 3))
    match kind:
        case "point":
            return {"kind": kind, "at": at}
        case "disc":
            return {"kind": kind, "at": at, "radius": r}
        case "capsule":
            return {"kind": kind, "at": at, "angle": angle, "length": a, "radius": 0.3 * r}
        case "box":
            return {"kind": kind, "at": at, "angle": angle, "width": a, "height": b, "radius": rounding(rng)}
    turns = np.sort((np.arange(rng.integers(3, 9)) + rng.uniform(0.0, 0.7)) * rng.uniform(0.6, 0.78))
    turns *= 2.0 * np.pi / (turns[-1] - turns[0] + 0.7)
    vertices = [[float(a * np.cos(t)), float(b * np.sin(t))] for t in turns]
    return {"kind": kind, "at": at, "angle": angle, "vertices": vertices, "radius": rounding(rng)}


def rounding(rng: Generator) -> float:
    return float(rng.choice([0.0, 0.2]) * rng.uniform(0.5, 1.0))


def core(shape: dict[str, Any], pose: dict[str, float]) -> Geometry:
    """The shape without its radius, as shapely draws it."""
    match shape["kind"]:
        case "point" | "disc":
            drawn: Geometry = shapely.Point(0.0, 0.0)
        case "capsule":
            drawn = shapely.LineString([(-shape["length"] / 2, 0.0), (shape["length"] / 2, 0.0)])
        case "box":
            x, y = shape["width"] / 2, shape["height"] / 2
            drawn = shapely.box(-x, -y, x, y)
        case _:
            drawn = shapely.Polygon(shape["vertices"])
    for x, y, angle in (
        (*shape.get("at", (0.0, 0.0)), shape.get("angle", 0.0)),
        (pose["x"], pose["y"], pose["angle"]),
    ):
        c, s = np.cos(angle), np.sin(angle)
        drawn = shapely.affinity.affine_transform(drawn, [c, -s, s, c, x, y])
    return drawn


def random_pose(rng: Generator, size: float) -> dict[str, float]:
    x, y, angle = (float(x) for x in rng.uniform(-1.0, 1.0, 3) * (size, size, 3.0))
    return {"x": x, "y": y, "angle": angle}


def assert_gap(planar: Callable[..., Any], a: dict[str, Any], b: dict[str, Any]) -> None:
    """The gap between two free bodies is shapely's; cores that overlap have less than touching ones."""
    placed = planar({"a": FREE | a, "b": FREE | b})
    points, _ = placed.manifold(placed.q)
    gap = points[:, 0].min()
    radii = a["shape"].get("radius", 0.0) + b["shape"].get("radius", 0.0)
    distance = core(a["shape"], a["pose"]).distance(core(b["shape"], b["pose"]))
    if distance > 1e-12:
        assert gap == pytest.approx(distance - radii, abs=1e-9 * (distance + radii))
    else:
        assert gap <= 1e-12 - radii


@pytest.mark.few(1)
@pytest.mark.parametrize("count", [80, pytest.param(400, marks=pytest.mark.long)])
@pytest.mark.parametrize("size", [0.4, 1.0, 4.0])
def test_gap_is_that_of_shapely(planar: Callable[..., Any], size: float, count: int) -> None:
    rng = np.random.default_rng(int(10 * size))
    for _ in range(count):
        a, b = (
            {"shape": random_shape(rng, str(rng.choice(KINDS))), "pose": random_pose(rng, size)} for _ in "ab"
        )
        assert_gap(planar, a, b)


@pytest.mark.parametrize("count", [300, pytest.param(1200, marks=pytest.mark.long)])
def test_gap_where_everything_is_aligned(planar: Callable[..., Any], count: int) -> None:
    """Shapes on a grid: parallel and touching faces, ends in line, vertices over vertices."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        bodies = []
        for _ in range(2):
            turns = [float(n) * np.pi / 4.0 for n in rng.integers(0, 4, 2)]
            places = [[float(n) / 2.0 for n in rng.integers(-2, 3, 2)] for _ in range(2)]
            kind, size = str(rng.choice(KINDS[:4])), {}
            if kind != "point":
                size = {"radius": 0.25}
            if kind == "capsule":
                size |= {"length": 1.0, "angle": turns[0]}
            elif kind == "box":
                size = {"width": 1.0, "height": float(rng.integers(1, 3)), "angle": turns[0]}
            shape = {"kind": kind, "at": places[0], **size}
            bodies.append({"shape": shape, "pose": {"x": places[1][0], "y": places[1][1], "angle": turns[1]}})
        assert_gap(planar, *bodies)


@pytest.mark.parametrize("away", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2.0])
@pytest.mark.parametrize("other", ["point", "disc", "capsule"])
def test_what_lies_in_line_with_a_capsule_is_apart(
    planar: Callable[..., Any], away: float, angle: float, other: str
) -> None:
    capsule = {"kind": "capsule", "length": 1.0, "radius": 0.1}
    shape = capsule if other == "capsule" else {"kind": other} | ({"radius": 0.1} if other == "disc" else {})
    reach = 1.0 if other == "capsule" else 0.5
    at = {"x": (reach + away) * np.cos(angle), "y": (reach + away) * np.sin(angle), "angle": angle}
    placed = planar(
        {"a": FREE | {"shape": capsule, "pose": {"angle": angle}}, "b": FREE | {"shape": shape, "pose": at}}
    )
    points, _ = placed.manifold(placed.q)
    assert points[:, 0] == pytest.approx([away - 0.1 - shape.get("radius", 0.0)], abs=1e-12)
    assert points[0, 1:3] == pytest.approx([-np.cos(angle), -np.sin(angle)], abs=1e-12)


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", KINDS)
def test_gap_to_a_half_plane(planar: Callable[..., Any], kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    for _ in range(60):
        shape, pose, tilt = random_shape(rng, kind), random_pose(rng, 2.0), rng.uniform(-4.0, 4.0)
        normal, at = np.array([np.cos(tilt), np.sin(tilt)]), rng.uniform(-1.0, 1.0, 2)
        floor = {"kind": "halfplane", "normal": list(3.0 * normal), "at": list(at)}
        placed = planar(
            {"a": {"role": "obstacle", "shape": floor}, "b": FREE | {"shape": shape, "pose": pose}}
        )
        points, _ = placed.manifold(placed.q)
        heights = (shapely.get_coordinates(core(shape, pose)) - at) @ normal
        assert points[:, 0].min() == pytest.approx(heights.min() - shape.get("radius", 0.0), abs=1e-12)


def test_points_lie_midway_between_the_surfaces(planar: Callable[..., Any]) -> None:
    rng = np.random.default_rng(11)
    for _ in range(200):
        bodies = {
            name: {"shape": random_shape(rng, str(rng.choice(KINDS))), "pose": random_pose(rng, 2.0)}
            for name in "ab"
        }
        placed = planar({name: FREE | body for name, body in bodies.items()})
        points, _ = placed.manifold(placed.q)
        gap, nx, ny, x, y = points[np.argmin(points[:, 0])]
        if gap <= 0.0:
            continue
        for name, sign in (("a", 1.0), ("b", -1.0)):
            shape, pose = bodies[name]["shape"], bodies[name]["pose"]
            surface = shapely.Point(x + sign * gap / 2.0 * nx, y + sign * gap / 2.0 * ny)
            assert surface.distance(core(shape, pose)) == pytest.approx(shape.get("radius", 0.0), abs=1e-9)


def test_gap_is_exact_within_the_margin_and_a_lower_bound_beyond(planar: Callable[..., Any]) -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        bodies = {
            name: FREE | {"shape": random_shape(rng, str(rng.choice(KINDS))), "pose": random_pose(rng, 3.0)}
            for name in "ab"
        }
        placed = planar(bodies)
        exact = placed.manifold(placed.q)[0][:, 0].min()
        least = placed.look(placed.q, 0.5)
        assert least == placed.gaps[0]
        assert least <= exact
        if exact <= 0.5:
            assert least == exact and placed.features[0] != ABSENT


def nearly_flush(rng: Generator) -> list[dict[str, Any]]:
    """Two rounded shapes whose faces are nearly parallel and near each other, at the ends of the faces."""
    bodies, tilt = [], float(rng.uniform(-0.2, 0.2))
    radius = float(rng.uniform(0.01, 0.2))
    for k in range(2):
        shape: dict[str, Any] = {"kind": "capsule", "length": float(rng.uniform(0.1, 1.0)), "radius": radius}
        if rng.random() < 0.5:
            shape = {"kind": "box", "width": shape["length"], "height": 0.3, "radius": radius}
        bodies.append({"shape": shape, "pose": {"x": 0.0, "y": 0.0, "angle": k * tilt}})
    half, lift = (sum(body["shape"].get(name, 0.0) for body in bodies) / 2.0 for name in ("width", "height"))
    half += sum(body["shape"].get("length", 0.0) for body in bodies) / 2.0
    beside = (
        half + radius * float(rng.uniform(-0.5, 0.2)) if rng.random() < 0.7 else float(rng.uniform(-1, 1))
    )
    bodies[1]["pose"]["x"] = beside
    bodies[1]["pose"]["y"] = lift + half * abs(np.sin(tilt)) + 2.0 * radius * float(rng.uniform(0.5, 1.2))
    return bodies


@pytest.mark.parametrize("count", [400, pytest.param(1500, marks=pytest.mark.long)])
def test_gap_at_the_ends_of_nearly_flush_faces(planar: Callable[..., Any], count: int) -> None:
    """Of rounded shapes the closest features may be two vertices, however small the tilt: a gap to the line
    of an edge, beside the edge, would jump where the faces count as parallel."""
    rng = np.random.default_rng(11)
    for _ in range(count):
        assert_gap(planar, *nearly_flush(rng))
