"""Supports at their limits: faint and great friction, and centres of pressure outside what carries a body."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

import rungwise as rw


def pushed(friction: float, **support: Any) -> dict[str, Any]:
    rod = {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.02}, "pose": {"x": -0.1, "y": 0.01},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": 0.2}}},
    }  # fmt: skip
    box = {
        "role": "object",
        "shape": {"kind": "box", "width": 0.1, "height": 0.08},
        "mass": 1,
        "motion": {"kind": "free"},
        "support": {"friction": friction, **(support or {"gravity": 9.81})},
    }
    contacts = [{"between": ["*", "*"], "friction": 0.3}]
    return {"name": "pushed", "bodies": {"rod": rod, "box": box}, "contacts": contacts} | {
        "duration": 0.5, "step": 1e-3
    }  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=str)
def test_friction_however_faint_or_great_stops_no_run(model: rw.Rung) -> None:
    without = rw.simulate(pushed(0.0), model)
    for friction in (5e-324, 1e-320, 1e-300, 1e-200, 1e-150, 1e-100, 1e-30, 1e-9, 1.0, 30.0):
        run = rw.simulate(pushed(friction), model)
        assert str(run.outcome) == "timeout", (friction, run.reason)
        if friction < 1e-139 or (friction < 1e-9 and "dynamic" in model.name):
            assert run.final["box"] == pytest.approx(without.final["box"], abs=1e-12), friction


def test_centre_of_pressure_is_within_what_carries_the_body() -> None:
    """Random convex parts of several shapes against shapely's hull."""
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(150):
        shapes, drawn = [], []
        for _ in range(rng.integers(1, 4)):
            at = rng.uniform(-1.0, 1.0, 2)
            size = rng.uniform(0.1, 1.0, 2)
            if rng.random() < 0.5:
                shapes.append({"kind": "disc", "radius": float(size[0]), "at": at.tolist()})
                drawn.append(shapely.Point(at).buffer(size[0], 400))
            else:
                corner = at - size / 2.0
                shapes.append({"kind": "box", "width": size[0], "height": size[1], "at": at.tolist()})
                drawn.append(shapely.box(*corner, *(corner + size)))
        hull = shapely.union_all(drawn).convex_hull
        spot = rng.uniform(-1.5, 1.5, 2)
        inside, beside = hull.contains(shapely.Point(spot)), hull.exterior.distance(shapely.Point(spot))
        scene = pushed(0.3, load=1.0, centre=spot.tolist())
        scene["bodies"]["box"]["shape"] = shapes
        scene["bodies"]["rod"]["pose"] = {"x": -9.0}
        if beside < 1e-4:
            continue
        if inside:
            rw.load(scene).bind()
        else:
            refused += 1
            with pytest.raises(rw.SceneError, match=r"^bodies\.box\.support\.centre: no pressure"):
                rw.load(scene).bind()
    assert 30 < refused < 120


def test_centre_of_points_is_within_their_hull() -> None:
    feet = {"kind": "points", "points": [[-0.1, 0.0], [0.1, 0.0], [0.0, 0.2]]}
    rw.load(pushed(0.3, load=1.0, pressure=feet, centre=[0.0, 0.19])).bind()
    with pytest.raises(rw.SceneError, match=r"^bodies\.box\.support\.centre"):
        rw.load(pushed(0.3, load=1.0, pressure=feet, centre=[0.05, 0.19])).bind()
