"""Mirrored scenes give mirrored results; units, frame and order of bodies do not matter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

from .conftest import MOVING


@pytest.mark.few(6)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("r", [0.43, 0.61, 0.9, 1.37])
def test_mirror(two_finger: rw.Scene, model: rw.Rung, r: float) -> None:
    common = {"mu": 0.4, "restitution": 0.3}
    one = rw.simulate(two_finger, model, parameters=common | {"v1": 1.1, "v2": 1.1 * r, "x3": 0.07})
    two = rw.simulate(two_finger, model, parameters=common | {"v1": 1.1 * r, "v2": 1.1, "x3": -0.07})
    assert one.outcome == two.outcome and one.steps == two.steps
    assert one.final["part"]["x3"] == pytest.approx(-two.final["part"]["x3"], abs=1e-12)
    assert one.final["finger1"]["x1"] == pytest.approx(two.final["finger2"]["x2"], abs=1e-12)


@pytest.mark.few(7)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize(
    ("length", "mass", "time"), [(1e-3, 1e-6, 1.0), (1e3, 1.0, 1e-3), (1e-6, 1e-9, 1e-2)]
)
def test_units(two_finger: rw.Scene, model: rw.Rung, length: float, mass: float, time: float) -> None:
    base = {name: parameter.default for name, parameter in two_finger.file.parameters.items()} | {
        "v2": 0.57,
        "mu": 0.3,
    }
    unit = {
        "v1": length / time, "v2": length / time, "mass": mass, "half_base": length, "height": length,
        "offset": length, "travel": length, "x3": length, "stiffness": mass / time**2, "damping": mass / time,
    }  # fmt: skip
    scaled = {name: value * unit.get(name, 1.0) for name, value in base.items()}
    data = two_finger.file.model_dump(mode="json")
    for parameter in data["parameters"].values():
        parameter["range"] = None
    wide = rw.load(data)
    one, two = (rw.simulate(wide, model, parameters=p) for p in (base, scaled))
    assert one.outcome == two.outcome and abs(one.steps - two.steps) <= 1
    assert two.final["part"]["x3"] / length == pytest.approx(one.final["part"]["x3"], abs=1e-6)
    assert two.time / time == pytest.approx(one.time, abs=2e-4)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_order_of_bodies(two_finger: rw.Scene, model: rw.Rung) -> None:
    data = two_finger.file.model_dump(mode="json")
    data["bodies"] = dict(reversed(data["bodies"].items()))
    data["contacts"][0]["between"] = data["contacts"][0]["between"][::-1]
    turned = rw.load(data)
    for v2 in (0.47, 0.8):
        one, two = (rw.simulate(scene, model, parameters={"v2": v2}) for scene in (two_finger, turned))
        assert one.outcome == two.outcome
        for body, places in one.final.items():
            assert places == pytest.approx(two.final[body], abs=1e-11)


def turned(data: dict[str, Any], angle: float, shift: tuple[float, float]) -> dict[str, Any]:
    """The blocks scene in a frame that is turned and shifted."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    data["gravity"] = [f"gravity * {s!r}", f"-gravity * {c!r}"]
    for body in data["bodies"].values():
        pose = body["pose"]
        x, y, a = (pose[key] for key in ("x", "y", "angle"))
        pose["x"] = f"{c!r} * ({x}) - {s!r} * ({y}) + {shift[0]!r}"
        pose["y"] = f"{s!r} * ({x}) + {c!r} * ({y}) + {shift[1]!r}"
        pose["angle"] = f"({a}) + {angle!r}"
    return data


@pytest.mark.few(3)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_frame(model: rw.Rung) -> None:
    plain = rw.load("blocks").file.model_dump(mode="json") | {"goal": None, "unsafe": None}
    angle, shift = 0.83, (1.7, -0.4)
    parameters = {"slope": 0.4, "mu": 0.3, "mu_stack": 0.25, "spin": 0.5}
    if model.inertia == 0.0:
        parameters |= {"mu": 0.6, "mu_stack": 0.6}
    scenes = (
        rw.load(plain),
        rw.load(
            turned(rw.load("blocks").file.model_dump(mode="json"), angle, shift)
            | {"goal": None, "unsafe": None}
        ),
    )
    one, two = (rw.simulate(scene, model, parameters=parameters, duration=0.5) for scene in scenes)
    c, s = float(np.cos(angle)), float(np.sin(angle))
    assert one.outcome == two.outcome
    for body, place in one.final.items():
        there = two.final[body]
        assert there["x"] == pytest.approx(c * place["x"] - s * place["y"] + shift[0], abs=1e-7)
        assert there["y"] == pytest.approx(s * place["x"] + c * place["y"] + shift[1], abs=1e-7)
        assert there["angle"] == pytest.approx(place["angle"] + angle, abs=1e-7)
