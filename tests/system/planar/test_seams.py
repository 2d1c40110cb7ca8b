"""Contact points over flush neighbours are those over one piece, wherever the slider is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from rungwise.system.planar.contact_manifold import ABSENT

NEAR = 0.02
FREE = {"role": "object", "motion": {"kind": "free"}, "mass": 1.0, "inertia": 1.0, "centre": [0.0, 0.0]}


def box(left: float, right: float, low: float, high: float) -> dict[str, Any]:
    at = [(left + right) / 2, (low + high) / 2]
    return {"kind": "box", "width": right - left, "height": high - low, "at": at}


def cuts(rng: Generator, left: float, right: float) -> list[tuple[float, float]]:
    places = np.sort(rng.uniform(left, right, int(rng.integers(1, 4))))
    return list(pairwise([left, *(float(x) for x in places), right]))


def floor(rng: Generator, kind: str) -> dict[str, Any]:
    shapes = [box(a, b, -float(rng.uniform(0.3, 1.0)), 0.0) for a, b in cuts(rng, 0.0, 3.0)]
    if kind == "shapes":
        return {"f": {"role": "obstacle", "shape": shapes}}
    return {f"f{k}": {"role": "obstacle", "shape": shapes[k]} for k in rng.permutation(len(shapes))}


def points(placed: Any, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gap, normal into the part and place of each point nearer than NEAR, in the order of places."""
    placed.look(q, NEAR)
    found = placed.points.copy()
    first = np.repeat(placed.records.shapes["body"][placed.records.pairs["shape_a"]], 2)
    moving = int(np.flatnonzero(placed.records.bodies["motion"])[0])
    found[:, 1:3] *= np.where(first == moving, 1.0, -1.0)[:, None]
    found = found[(placed.features != ABSENT) & (found[:, 0] < NEAR)]
    return found[np.lexsort(np.round(found[:, [4, 3]], 9).T)]


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["bodies", "shapes"])
@pytest.mark.parametrize("many", [False, True], ids=["one slider", "slider in pieces"])
def test_points_are_those_of_one_piece(planar: Callable[..., Any], kind: str, many: bool) -> None:
    rng = np.random.default_rng([len(kind), many])
    for _ in range(25):
        width = float(rng.uniform(0.2, 1.5))
        whole: Any = box(-width / 2, width / 2, 0.0, 0.3)
        pieces = [box(a, b, 0.0, 0.3) for a, b in cuts(rng, -width / 2, width / 2)] if many else whole
        seamed = planar({**floor(rng, kind), "part": FREE | {"shape": pieces}})
        plain = planar(
            {"f": {"role": "obstacle", "shape": box(0.0, 3.0, -0.5, 0.0)}, "part": FREE | {"shape": whole}}
        )
        for _ in range(12):
            tilt = float(rng.choice([0.0, rng.uniform(-0.01, 0.01)]))
            lift = float(rng.choice([0.0, -1e-6, rng.uniform(-1e-4, 1e-3)]))
            q = np.array([rng.uniform(-0.3, 3.3), lift + 0.5 * width * abs(tilt), tilt])
            expected, found = points(plain, q), points(seamed, q)
            assert found.shape == expected.shape
            assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kind", ["shapes", "bodies"])
def test_slanted_seams_make_no_points(planar: Callable[..., Any], kind: str) -> None:
    """A slab cut from its corner, or anywhere, below or beside a slider that may be deeper than its top."""
    rng = np.random.default_rng(len(kind))
    one = {"f": {"role": "obstacle", "shape": box(0.0, 3.0, -0.5, 0.0)}}
    for k in range(30):
        top = 3.0 if k % 2 else float(rng.uniform(2.0, 2.9))
        low = float(rng.uniform(0.1, 2.9))
        left = [[0.0, -0.5], [low, -0.5], [top, 0.0], [0.0, 0.0]]
        right = [[low, -0.5], [3.0, -0.5], [3.0, 0.0], [top, 0.0]][: 4 - k % 2]
        # A rounding of nothing keeps the pieces apart when the scene is loaded.
        shapes = [{"kind": "polygon", "vertices": side, "radius": "none"} for side in (left, right)]
        floor = {f"f{n}": {"role": "obstacle", "shape": shape} for n, shape in enumerate(shapes)}
        if kind == "shapes":
            floor = {"f": {"role": "obstacle", "shape": shapes}}
        part = FREE | {"shape": box(-0.2, 0.2, 0.0, 0.3)}
        seamed = planar({**floor, "part": part}, parameters={"none": {"default": 0.0}})
        plain = planar({**one, "part": part})
        for _ in range(20):
            tilt = float(rng.choice([0.0, rng.uniform(-0.3, 0.3)]))
            over = np.array([rng.uniform(1.5, 3.2), float(rng.choice([0.0, -1e-6, rng.uniform(0, 0.01)]))])
            beside = np.array([3.2 + float(rng.choice([0.0, rng.uniform(0, 0.01)])), rng.uniform(-0.2, 0.02)])
            x, y = (over, beside)[int(rng.integers(2))]
            q = np.array([x, y + 0.2 * abs(np.sin(tilt)) * (x < 3.2), tilt * (x < 3.2)])
            expected, found = points(plain, q), points(seamed, q)
            assert found.shape == expected.shape, (k, q, expected, found)
            assert found == pytest.approx(expected, abs=1e-12)


def test_a_piece_touches_no_level_face_beside_it(planar: Callable[..., Any]) -> None:
    """A slider in two pieces that stands on one of two tables of the same height."""
    tables = [box(0.0, 1.0, -0.5, 0.0), box(2.0, 3.0, -0.5, 0.0)]
    floor = {"f": {"role": "obstacle", "shape": tables}}
    pieces = [box(-0.2, 0.1, 0.0, 0.3) | {"radius": "none"}, box(0.1, 0.2, 0.0, 0.3) | {"radius": "none"}]
    seamed = planar({**floor, "part": FREE | {"shape": pieces}}, parameters={"none": {"default": 0.0}})
    plain = planar({**floor, "part": FREE | {"shape": box(-0.2, 0.2, 0.0, 0.3)}})
    for x in (0.5, 0.95, 2.1, 2.5):
        q = np.array([x, 0.0, 0.0])
        assert points(seamed, q) == pytest.approx(points(plain, q), abs=1e-12)
