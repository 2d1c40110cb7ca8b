"""Parameters of the laws of contact that scenes name come back from motions that were made with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rungwise as rw

RUNG = rw.DYNAMIC_RIGID
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}
LAWS: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, float]]] = {
    "restitution that falls with speed": (
        {"pose": {"y": "high + 0.05"}, "coordinates": {}},
        {"restitution": 0.8, "yield_speed": "law"},
        {"law": 0.5},
    ),
    "static friction": (
        {"pose": {"y": 0.05}, "coordinates": {"angle": {"damping": 1e3}}, "force": ["100 * high * t", 0]},
        {"friction": 0.3, "static_friction": "law"},
        {"law": 0.5},
    ),
    "adhesion": (
        {"pose": {"y": "high + 0.05"}, "coordinates": {}},
        {"restitution": 0.8, "adhesion": "10 * law", "adhesion_range": 0.01},
        {"law": 1.5},
    ),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", LAWS)
def test_the_number_of_a_law_comes_back(name: str) -> None:
    body, law, true = LAWS[name]
    body = {
        "role": "object", "shape": {"kind": "disc", "radius": 0.05}, "mass": 1.0, "motion": {"kind": "free"},
    } | body  # fmt: skip
    data = {
        "name": "laws", "gravity": [0, -10], "bodies": {"body": body, "floor": FLOOR},
        "parameters": {"high": {"default": 0.2}, "law": {"default": 1.0, "range": [0.31, 3.0]}},
        "contacts": [{"between": ["body", "floor"]} | law], "duration": 0.5, "step": 2e-3, "tolerance": 1e-6,
    }  # fmt: skip
    scene, highs = rw.load(data), (0.2, 0.3, 0.4)
    runs = [rw.simulate(scene, RUNG, parameters={"high": x} | true, tol=1e-4) for x in highs]
    motions = rw.Motions.from_runs(runs, parameters={"high": highs})
    # Whole trials: in short spans the few in which a law acts count as outliers of a robust loss.
    found = rw.fit(scene, RUNG, motions, ("law",), span=10.0, threads=1)
    assert found.values["law"] == pytest.approx(true["law"], rel=0.05)


IN_SPACE: dict[str, tuple[str, dict[str, Any], dict[str, Any], float]] = {
    "restitution that falls with speed": (
        '<body name="b" pos="0 0 .1"><joint name="z" type="slide" axis="0 0 1"/>',
        {"restitution": 0.8, "yield_speed": "law"},
        {"start": {"places": {"b.z": "high - 0.05"}}, "step": 4e-3},
        0.5,
    ),
    "static friction": (
        '<body name="b" pos="0 0 .05"><joint name="x" type="slide" axis="1 0 0"/>'
        '<joint name="z" type="slide" axis="0 0 1"/>',
        {"friction": 0.3, "static_friction": "law"},
        {"controls": {"m": "100 * high * t"}, "step": 4e-3},
        0.5,
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("name", IN_SPACE)
def test_the_number_of_a_law_comes_back_in_space(name: str, tmp_path: Path) -> None:
    body, law, fields, true = IN_SPACE[name]
    motor = '<actuator><motor name="m" joint="x"/></actuator>' if "controls" in fields else ""
    (tmp_path / "m.xml").write_text(
        '<mujoco><option gravity="0 0 -10"/><worldbody><geom type="plane" size="5 5 .1"/>'
        f'{body}<geom size=".05" mass="1"/></body></worldbody>{motor}</mujoco>'
    )
    parameters = {"high": {"default": 0.2}, "law": {"default": 1.0, "range": [0.31, 3.0]}}
    data = {"name": "laws", "model": {"file": str(tmp_path / "m.xml")}, "contacts": [law], "duration": 0.4}
    scene, highs = rw.load(data | fields | {"parameters": parameters}), (0.2, 0.4)
    runs = [rw.simulate(scene, RUNG, parameters={"high": x, "law": true}) for x in highs]
    motions = rw.Motions.from_runs(runs, parameters={"high": highs})
    # At the steps of the data: runs of first order put an impact up to a step early.
    found = rw.fit(scene, RUNG, motions, ("law",), span=10.0, step=4e-3, threads=1)
    assert found.values["law"] == pytest.approx(true, rel=0.01)
