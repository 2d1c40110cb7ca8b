"""Contact rows against central differences of what they are rates of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from rungwise.system.planar.jacobian import contact_rows

STEP = 1e-6
SHAPES = {
    "box": {"kind": "box", "width": 1.0, "height": 0.6, "at": [0.1, 0.2], "angle": 0.3},
    "rounded": {"kind": "polygon", "vertices": [[0, 0], [1, 0], [0.8, 0.9], [0, 0.5]], "radius": 0.1},
    "capsule": {"kind": "capsule", "length": 0.8, "radius": 0.2, "at": [-0.2, 0.1]},
    "disc": {"kind": "disc", "radius": 0.3, "at": [0.2, -0.1]},
    "plane": {"kind": "halfplane", "normal": [0.3, 1.0], "at": [0.0, -1.0]},
}


def random_motion(rng: Generator) -> dict[str, Any]:
    match rng.integers(0, 3):
        case 0:
            return {"kind": "free"}
        case 1:
            return {"kind": "slide", "axis": list(rng.uniform(-1.0, 1.0, 2))}
    return {"kind": "hinge", "pivot": list(rng.uniform(-2.0, 2.0, 2))}


def random_body(rng: Generator, shape: dict[str, Any]) -> dict[str, Any]:
    x, y, angle = (float(x) for x in rng.uniform(-1.2, 1.2, 3))
    return {
        "role": "object",
        "shape": shape,
        "pose": {"x": x, "y": y, "angle": angle},
        "motion": random_motion(rng),
        "mass": 1.0,
        "inertia": 1.0,
    }


def rows_of(placed: Any, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both rows of one point, at the last placed q."""
    rows = np.full((4, len(placed.q)), np.nan)
    bodies = placed.records.bodies
    contact_rows(0, 1, bodies, placed.pose, point, rows, 2)
    return rows[2:]


def carried(placed: Any, body: int, q: NDArray[np.float64], point: NDArray[np.float64]) -> Any:
    """Where q takes the material point of `body` that is at `point` when the body is at placed.q."""
    placed.place(placed.q)
    x, y, c, s = placed.pose[body]
    local = np.array([[c, s], [-s, c]]) @ (point - (x, y))
    placed.place(q)
    x, y, c, s = placed.pose[body]
    return np.array([x, y]) + np.array([[c, -s], [s, c]]) @ local


def differences(placed: Any, point: int) -> NDArray[np.float64]:
    """Central differences of gap and of relative tangential place, one column per coordinate."""
    points, features = placed.manifold(placed.q)
    nx, ny, *at = points[point, 1:]
    columns = []
    for i in range(len(placed.q)):
        gaps, places = [], []
        for sign in (1.0, -1.0):
            q = placed.q.copy()
            q[i] += sign * STEP
            moved, named = placed.manifold(q)
            gaps.append(moved[named.index(features[point]), 0])
            places.append(carried(placed, 0, q, np.array(at)) - carried(placed, 1, q, np.array(at)))
        slip = (places[0] - places[1]) @ (ny, -nx)
        columns.append([(gaps[0] - gaps[1]) / (2.0 * STEP), slip / (2.0 * STEP)])
    return np.array(columns).T


@pytest.mark.few(7)
@pytest.mark.parametrize("b", SHAPES)
@pytest.mark.parametrize("a", [name for name in SHAPES if name != "plane"])
def test_rows_are_rates_of_gap_and_slip(planar: Callable[..., Any], a: str, b: str) -> None:
    rng = np.random.default_rng(100 * list(SHAPES).index(a) + list(SHAPES).index(b))
    for _ in range(12):
        placed = planar({"a": random_body(rng, SHAPES[a]), "b": random_body(rng, SHAPES[b])})
        points, _ = placed.manifold(placed.q)
        for k, point in enumerate(points):
            expected = differences(placed, k)
            placed.place(placed.q)
            assert rows_of(placed, point) == pytest.approx(expected, abs=2e-8)


def test_rows_at_two_vertices(planar: Callable[..., Any]) -> None:
    """A corner before a corner: the normal joins them and turns with both."""
    for place in ((1.3, 0.9), (-1.2, 1.0), (1.1, -1.4)):
        pose = {"x": place[0], "y": place[1], "angle": 0.1}
        placed = planar(
            {
                "a": {
                    "role": "object",
                    "shape": {"kind": "box", "width": 1, "height": 1},
                    "motion": {"kind": "free"},
                },
                "b": {
                    "role": "object",
                    "shape": {"kind": "box", "width": 1, "height": 0.6},
                    "pose": pose,
                    "motion": {"kind": "free"},
                },
            }
        )
        points, features = placed.manifold(placed.q)
        assert len(points) == 1 and features[0] >= 1 << 40
        expected = differences(placed, 0)
        placed.place(placed.q)
        assert rows_of(placed, points[0]) == pytest.approx(expected, abs=2e-8)


def test_swapped_bodies_have_mirrored_rows(planar: Callable[..., Any]) -> None:
    """Gap and rows do not depend on which body is named first; the normal changes sides, the slip too."""
    rng = np.random.default_rng(5)
    for _ in range(150):
        one, other = (random_body(rng, SHAPES[str(rng.choice(list(SHAPES)))]) for _ in "ab")
        if "halfplane" in (one["shape"]["kind"], other["shape"]["kind"]):
            one["shape"] = SHAPES["box"]
        placed, swapped = planar({"a": one, "b": other}), planar({"b": other, "a": one})
        shift = len(placed.q) - (3 if one["motion"]["kind"] == "free" else 1)
        points, mirrored = placed.manifold(placed.q)[0], swapped.manifold(swapped.q)[0]
        assert len(points) == len(mirrored)
        for point in points:
            twin = mirrored[np.argmin(np.hypot(*(mirrored[:, 3:] - point[3:]).T))]
            assert twin[0] == pytest.approx(point[0], abs=1e-12)
            assert twin[1:3] == pytest.approx(-point[1:3], abs=1e-12)
            assert twin[3:] == pytest.approx(point[3:], abs=1e-12)
            rows = np.roll(rows_of(placed, point), shift, axis=1)
            assert rows_of(swapped, twin) == pytest.approx(rows, abs=1e-12)
