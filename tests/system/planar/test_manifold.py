"""Contact points and their features: faces, corners, memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rungwise.system.planar.contact_manifold import ABSENT, VERTICES

FREE = {"role": "object", "motion": {"kind": "free"}}
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}
POINT = {"shape": {"kind": "point"}, "mass": 1.0, "inertia": 1.0}
BOX = FREE | {"shape": {"kind": "box", "width": 2.0, "height": 1.0}}


def at(x: float, y: float, angle: float = 0.0) -> dict[str, Any]:
    return {"pose": {"x": x, "y": y, "angle": angle}}


@pytest.mark.parametrize("first", ["box", "floor"])
def test_box_on_floor_has_two_points(planar: Callable[..., Any], first: str) -> None:
    bodies = {"box": BOX | at(0.3, 0.75), "floor": FLOOR}
    placed = planar({name: bodies[name] for name in sorted(bodies, key=lambda name: name != first)})
    points, features = placed.manifold(placed.q)
    up = 1.0 if first == "box" else -1.0
    assert len(set(features)) == 2
    assert points[np.argsort(points[:, 3])] == pytest.approx(
        np.array([[0.25, 0.0, up, -0.7, 0.125], [0.25, 0.0, up, 1.3, 0.125]])
    )


@pytest.mark.parametrize(
    ("x", "width", "ends"),
    [(0.0, 1.0, (-0.5, 0.5)), (0.0, 4.0, (-1.0, 1.0)), (0.7, 2.0, (-0.3, 1.0)), (-1.9, 2.0, (-1.0, -0.9))],
    ids=["narrower", "wider", "offset right", "offset left"],
)
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_box_on_box_is_held_at_the_ends_of_the_overlap(
    planar: Callable[..., Any], x: float, width: float, ends: tuple[float, float], radius: float
) -> None:
    upper = FREE | {"shape": {"kind": "box", "width": width, "height": 1.0, "radius": radius}}
    placed = planar({"lower": BOX, "upper": upper | at(x, 1.0 + radius + 1e-3)})
    points, features = placed.manifold(placed.q)
    points = points[np.argsort(points[:, 3])]
    assert points[:, 0] == pytest.approx([1e-3, 1e-3], abs=1e-12)
    assert points[:, 1:3] == pytest.approx(np.array([[0.0, -1.0]] * 2), abs=1e-12)
    assert points[:, 3] == pytest.approx(ends)
    rng = np.random.default_rng(0)
    for _ in range(50):
        moved = placed.manifold(placed.q + rng.uniform(-1e-6, 1e-6, 6))[1]
        assert sorted(moved) == sorted(features)


def test_capsule_lies_on_two_points_and_stands_on_one(planar: Callable[..., Any]) -> None:
    capsule = FREE | {"shape": {"kind": "capsule", "length": 1.0, "radius": 0.2}}
    lying = planar({"floor": FLOOR, "capsule": capsule | at(0.0, 0.2)})
    assert lying.manifold(lying.q)[0][:, 0] == pytest.approx([0.0, 0.0], abs=1e-12)
    standing = planar({"lower": BOX, "capsule": capsule | at(0.0, 1.2, np.pi / 2.0)})
    assert standing.manifold(standing.q)[0][:, 0].min() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("below", ["floor", "box"])
def test_deformation_follows_its_feature_through_the_slots(planar: Callable[..., Any], below: str) -> None:
    support = FLOOR | at(0.0, 0.5) if below == "floor" else BOX | {"motion": {"kind": "fixed"}}
    upper = {"shape": {"kind": "box", "width": 1.0, "height": 1.0}}
    placed = planar({"support": support, "upper": FREE | upper | at(0.2, 1.0)})
    placed.look(placed.q + np.array([0.0, 0.0, 1e-3]), 1.0)
    held = {int(feature): slot for slot, feature in enumerate(placed.features)}
    left, right = placed.features
    placed.deformation[:] = [[0.1, 0.2], [0.3, 0.4]]
    placed.modes[:] = [1, 2]
    force = placed.manifolds.force
    force[:] = [[5.0, 6.0], [7.0, 8.0]]
    for tilt in (-1e-3, 1e-3, 0.0, -1e-3):
        placed.look(placed.q + np.array([0.0, 0.0, tilt]), 1.0)
        assert set(placed.features) == {left, right}
        for slot, feature in enumerate(placed.features):
            was = held[int(feature)]
            assert list(placed.deformation[slot]) == [[0.1, 0.2], [0.3, 0.4]][was]
            assert placed.modes[slot] == [1, 2][was]
            assert list(force[slot]) == [[5.0, 6.0], [7.0, 8.0]][was]
    assert placed.features[0] == right


@pytest.mark.parametrize("tilt", [0.0, 1e-4, -1e-4])
def test_deformation_stays_where_two_faces_end_together(planar: Callable[..., Any], tilt: float) -> None:
    """Of equal boxes, one on the other: whichever vertex is over the other's face, it is the same end."""
    placed = planar({"lower": BOX | {"motion": {"kind": "fixed"}}, "upper": BOX | at(0.0, 1.0, tilt)})
    for offset in (1e-3, -1e-3, 0.0, 1e-15, -1e-15, 1e-3):
        placed.look(placed.q + np.array([offset, 0.0, 0.0]), 1.0)
        side = np.sign(placed.points[:, 3])
        assert sorted(side) == [-1.0, 1.0]
        if offset == 1e-3:
            placed.deformation[:] = np.outer(side, (0.1, 0.2))
        assert np.array_equal(placed.deformation, np.outer(side, (0.1, 0.2)))


def test_deformation_is_dropped_with_its_feature(planar: Callable[..., Any]) -> None:
    """A point that turns a corner leaves the deformation of the face behind; one that goes far forgets it."""
    placed = planar({"point": FREE | POINT, "box": BOX | {"motion": {"kind": "fixed"}}})
    for x, y, kept in ((0.95, 0.5, True), (1.01, 0.5, False), (1.01, 0.2, False), (0.9, 9.0, False)):
        placed.look(np.array([0.9, 0.5, 0.0]), 0.1)
        placed.deformation[0], placed.modes[0] = (0.1, 0.2), 1
        placed.look(np.array([x, y, 0.0]), 0.1)
        assert list(placed.deformation[0]) == ([0.1, 0.2] if kept else [0.0, 0.0])
        assert placed.modes[0] == (1 if kept else 0)
    assert list(placed.features) == [ABSENT, ABSENT]


@pytest.mark.parametrize("radius", [0.0, 0.2])
@pytest.mark.parametrize("height", [1e-6, 1e-3, 0.1])
def test_gap_is_smooth_where_a_point_passes_a_vertex(
    planar: Callable[..., Any], radius: float, height: float
) -> None:
    """Around the corner of a box the gap is the distance and the normal its gradient: neither jumps."""
    box = BOX["shape"] | {"radius": radius}
    placed = planar({"point": FREE | POINT, "box": {"role": "obstacle", "shape": box}})
    for turn in np.linspace(-0.2, np.pi / 2.0 + 0.2, 41):
        clear = height * np.array([np.cos(turn), np.sin(turn)])
        if clear.min() < 0.0:
            clear[np.argmax(clear)] = height
        points, _ = placed.manifold(np.array([1.0 + clear[0], 0.5 + clear[1], 0.0]))
        assert points[:, 0] == pytest.approx([height - radius], abs=1e-12)
        expected = np.clip([np.cos(turn), np.sin(turn)], 0.0, None)
        expected /= np.hypot(*expected)
        assert points[0, 1:3] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("exponent", range(-17, -5))
def test_normal_close_to_a_vertex_stays_between_those_of_its_faces(
    planar: Callable[..., Any], exponent: int
) -> None:
    """However near, and whatever rounding does: a normal outside the cone would push the wrong way."""
    box = {"shape": {"kind": "polygon", "vertices": [[-1, 0], [1, 0], [0, 1]]}} | at(0.3, 0.1, 0.7)
    placed = planar({"point": FREE | POINT, "box": {"role": "obstacle"} | box})
    tip, faces = placed.outline[3, :2].copy(), placed.outline[2:4, 2:].copy()
    rng = np.random.default_rng(-exponent)
    for share in rng.uniform(0.0, 1.0, 30):
        toward = share * faces[0] + (1.0 - share) * faces[1]
        points, _ = placed.manifold(np.array([*(tip + 10.0**exponent * toward), 0.0]))
        normal = points[0, 1:3]
        weights = np.linalg.solve(faces.T, normal)
        assert weights.min() > -1e-3
        assert abs(points[0, 0]) < 2.0 * 10.0**exponent + 1e-15


@pytest.mark.parametrize("tilt", [0.2, 0.5, np.pi / 4.0])
def test_corner_slides_off_a_face_unhindered(planar: Callable[..., Any], tilt: float) -> None:
    """A tilted box on its corner, moving along the face: no point of the manifold stands in its way."""
    half = np.hypot(1.0, 0.5)
    height = 0.5 + half * np.sin(tilt + np.arctan2(0.5, 1.0))
    placed = planar({"lower": BOX, "upper": BOX | at(0.0, height, tilt)})
    tip = float(placed.outline[4 + np.argmin(placed.outline[4:, 1]), 0])
    for left in (0.5, 0.1, 1e-2, 1e-3, 1e-4, 0.0, -1e-4, -1e-2):
        q = placed.q + np.array([0.0, 0.0, 0.0, 1.0 - left - tip, 0.0, 0.0])
        points, _ = placed.manifold(q)
        after = points[:, 0] - points[:, 1] * 1e-3
        assert after.min() >= -1e-9


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("i", [0, 1, 2])
@pytest.mark.parametrize("other", [BOX, POINT | FREE, FLOOR], ids=["box", "point", "floor"])
def test_features_are_vertices_whatever_the_numbers(
    planar: Callable[..., Any], other: dict[str, Any], i: int, value: float
) -> None:
    """Kernels read the outline where a feature says: one of no vertex would read what is not theirs."""
    for bodies in ({"box": BOX, "other": other}, {"aother": other, "box": BOX}):
        placed = planar(bodies)
        q = placed.q.copy()
        q[i] = value
        for feature in placed.manifold(q)[1]:
            edge, vertex = feature // VERTICES, feature % VERTICES
            count = len(placed.outline)
            assert 0 <= edge % VERTICES < count and 0 <= vertex < count
