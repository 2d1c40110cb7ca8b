"""What slides over an outline moves alike however the outline is cut into pieces, and wherever it stands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.random import Generator
from numpy.typing import NDArray
from shapely.geometry.polygon import orient
from shapely.ops import split

import rungwise as rw

Data = dict[str, Any]
Loop = list[tuple[float, float]]
FLOORS = ("flat", "L", "U", "comb", "step")
SLIDERS = ("box", "U", "L")
WELL_POSED = (rw.KINEMATIC, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)


def floor(rng: Generator, kind: str) -> Loop:
    """An outline whose top is y = 0 from 0 to at least 0.8: with a wall at its right, or at both ends, with
    teeth, or with a step down."""
    width, deep = float(rng.uniform(1.2, 2.5)), float(rng.uniform(0.2, 0.5))
    wall = [(width + 0.3, -0.3), (width + 0.3, 0.4), (width, 0.5), (width, 0.0)]
    if kind == "flat":
        return [(0.0, -0.4), (1.0, -0.3), (1.2, -0.1), (1.6, -0.35), (3.0, -0.2), (3.0, 0.0), (0.0, 0.0)]
    if kind == "L":
        return [(0.0, -deep), *wall, (0.0, 0.0)]
    if kind == "U":
        return [(-0.4, -deep), *wall, (-0.1, 0.0), (-0.1, 0.4), (-0.4, 0.4)]
    if kind == "step":
        return [(0.0, -deep - 0.1), (3.0, -0.4), (3.0, -0.1), (1.3, -0.1), (1.3, 0.0), (0.0, 0.0)]
    found, x = [(0.0, -0.5), (3.0, -0.5), (3.0, 0.0)], 3.0
    while x > 1.5:
        x, gap = x - float(rng.uniform(0.25, 0.5)), float(rng.uniform(0.02, 0.12))
        found += [(x, 0.0), (x, -0.2), (x - gap, -0.2), (x - gap, 0.0)]
        x -= gap
    return [*found, (0.0, 0.0)]


def slider(rng: Generator, kind: str) -> Loop:
    """A box, a table or a corner, its base at y = 0."""
    w, h, t = float(rng.uniform(0.05, 0.3)), float(rng.uniform(0.1, 0.3)), 0.03
    if kind == "box":
        return [(-w, 0.0), (w, 0.0), (w, h), (-w, h)]
    if kind == "L":
        return [(-w, 0.0), (w, 0.0), (w, t), (t - w, t), (t - w, h), (-w, h)]
    inside = [(t - w, 0.0), (t - w, h - t), (w - t, h - t), (w - t, 0.0)]
    return [(-w, 0.0), *inside, (w, 0.0), (w, h), (-w, h)]


def cut(rng: Generator, outline: Loop, cuts: int) -> list[Loop]:
    """Pieces of an outline between random lines, upright, level and slanted."""
    x, y, right, top = shapely.Polygon(outline).bounds
    pieces = [shapely.Polygon(outline)]
    for _ in range(cuts):
        at = np.array([rng.uniform(x, right), rng.uniform(y, top)])
        angle = float(rng.choice([0.0, math.pi / 2, rng.uniform(0.0, math.pi)]))
        away = 9.0 * np.array([math.cos(angle), math.sin(angle)])
        line = shapely.LineString([at - away, at + away])
        pieces = [part for piece in pieces for part in split(piece, line).geoms]
    return [list(orient(piece).exterior.coords)[:-1] for piece in pieces]


class Frame:
    """A frame that is turned, and may be mirrored before."""

    def __init__(self, angle: float, mirrored: bool) -> None:
        self.angle, self.sign = angle, -1.0 if mirrored else 1.0
        c, s = math.cos(angle), math.sin(angle)
        self.matrix = np.array([[c * self.sign, -s], [s * self.sign, c]])

    def places(self, loop: Loop) -> list[list[float]]:
        placed: list[list[float]] = (np.array(loop) @ self.matrix.T).tolist()
        return placed

    def back(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([*self.matrix.T @ q[:2], self.sign * (q[2] - self.angle)])


def motion(
    rng: Generator, ground: list[Loop], bodies: bool, part: list[Loop], frame: Frame, model: rw.Rung
) -> NDArray[np.float64]:
    """Where a part that is thrown over the ground comes to, in the frame: both are given in pieces, those of
    the ground as bodies or as shapes of one."""
    lift, spin = float(rng.choice([0.0, rng.uniform(0.0, 0.02)])), float(rng.choice([0.0, 1.0]))
    x, v, mu = float(rng.uniform(0.4, 0.6)), float(rng.uniform(0.5, 3.0)), float(rng.choice([0.0, 0.3]))
    shapes = [{"kind": "outline", "vertices": frame.places(piece)} for piece in ground]
    own = Frame(0.0, frame.sign < 0.0)
    (px, py), (vx, vy), (gx, gy) = frame.places([(x, lift), (v, 0.0), (0.0, -9.81)])
    fixed: dict[str, Data] = {f"f{k}": {"role": "obstacle", "shape": shape} for k, shape in enumerate(shapes)}
    thrown: Data = {
        "role": "object",
        "shape": [{"kind": "outline", "vertices": own.places(piece)} for piece in part],
        "mass": 1.0,
        "inertia": 0.02,
        "centre": [0.0, 0.05],
        "motion": {"kind": "free"},
        "pose": {"x": px, "y": py, "angle": frame.angle},
        "coordinates": {"x": {"speed": vx}, "y": {"speed": vy}, "angle": {"speed": frame.sign * spin}},
    }
    data = {
        "name": "outlines",
        "gravity": [gx, gy],
        "bodies": (fixed if bodies else {"f": {"role": "obstacle", "shape": shapes}}) | {"part": thrown},
        "contacts": [{"between": ["part", "f*"], "friction": mu, "stiffness": 1e5, "damping": 200.0}],
    }
    end = rw.simulate(data, model, step=float(rng.choice([2e-3, 1e-2])), duration=0.6).final["part"]
    return frame.back(np.array([end["x"], end["y"], end["angle"]]))


@pytest.mark.few(60)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", SLIDERS)
@pytest.mark.parametrize("ground", FLOORS)
@pytest.mark.parametrize("model", WELL_POSED, ids=str)
def test_cuts_do_not_matter(model: rw.Rung, ground: str, kind: str, seed: int) -> None:
    """Pieces of several bodies are compared on rigid rungs: their width says how far something soft may sink
    into them."""
    rng = np.random.default_rng([seed, FLOORS.index(ground), SLIDERS.index(kind)])
    whole, part = floor(rng, ground), slider(rng, kind)
    pieces, parts = cut(rng, whole, 3), cut(rng, part, 2)
    here, turned = Frame(0.0, False), Frame(float(rng.uniform(-3.0, 3.0)), bool(seed % 2))

    def end(ground: list[Loop], bodies: bool, part: list[Loop], frame: Frame) -> NDArray[np.float64]:
        return motion(np.random.default_rng([seed, 1]), ground, bodies, part, frame, model)

    expected = end([whole], False, [part], here)
    assert end(pieces, False, [part], here) == pytest.approx(expected, abs=1e-9)
    assert end([whole], False, parts, here) == pytest.approx(expected, abs=1e-9)
    assert end(pieces, False, parts, turned) == pytest.approx(expected, abs=1e-9)
    if not model.compliant:
        assert end(pieces, True, [part], here) == pytest.approx(expected, abs=1e-9)
        assert end(pieces, True, parts, turned) == pytest.approx(expected, abs=1e-9)


def row(rng: Generator) -> list[tuple[list[Loop], float]]:
    """Parts that stand side by side on the ground, corner at corner: their pieces, and their weight. A part
    with a foot and a wall is given as two boxes that overlap."""
    parts: list[tuple[list[Loop], float]] = []
    x = 0.0
    for _ in range(int(rng.integers(3, 6))):
        w, h, kind = float(rng.uniform(0.04, 0.08)), float(rng.uniform(0.03, 0.07)), int(rng.integers(3))
        box = [(x, 0.0), (x + w, 0.0), (x + w, h), (x, h)]
        foot = [(x, 0.0), (x + w, 0.0), (x + w, 0.015), (x, 0.015)]
        wall = [(x, 0.0), (x + 0.015, 0.0), (x + 0.015, h), (x, h)]
        wedge = [(x, 0.0), (x + w, 0.0), (x + float(rng.uniform(0.2, 0.8)) * w, h)]
        parts.append(([[box], [foot, wall], [wedge]][kind], float(rng.uniform(0.2, 6.0))))
        x += w
    return parts


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=str)
def test_mirrored_rows_mirror_the_motion(model: rw.Rung, seed: int) -> None:
    """Where corner meets corner either of two faces may keep the bodies apart; mirrored scenes take the same
    one."""
    rng = np.random.default_rng(seed)
    parts, friction = row(rng), rng.uniform(0.1, 0.5, 2).tolist()
    ends = []
    for frame in (Frame(0.0, False), Frame(0.0, True)):
        bodies: dict[str, Data] = {"floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}}
        for k, (pieces, mass) in enumerate(parts):
            shapes = [{"kind": "polygon", "vertices": frame.places(piece)} for piece in pieces]
            bodies[f"o{k}"] = {"role": "object", "shape": shapes, "mass": mass, "motion": {"kind": "free"}}
        bodies["p"] = {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.01},
            "pose": {"x": -0.015 * frame.sign, "y": 0.014},
            "motion": {"kind": "slide", "axis": [frame.sign, 0.0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "speed", "speed": 0.1}}},
        }
        data = {
            "name": "row",
            "gravity": [0.0, -9.81],
            "bodies": bodies,
            "contacts": [
                {"between": ["floor", "*"], "friction": friction[0], "stiffness": 1e5, "damping": 200.0},
                {"between": ["*", "*"], "friction": friction[1], "stiffness": 1e5, "damping": 200.0},
            ],
        }
        run = rw.simulate(data, model, step=1e-3, duration=0.15)
        ends.append((run.outcome, run.final))
    (outcome, one), (mirrored, other) = ends
    assert outcome == mirrored
    for k in range(len(parts)):
        a, b = one[f"o{k}"], other[f"o{k}"]
        assert [-b["x"], b["y"], -b["angle"]] == pytest.approx([a["x"], a["y"], a["angle"]], abs=1e-9)
