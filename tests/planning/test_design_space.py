"""Designs of scenes in space: middles known by symmetry, chamfers that catch a peg, what blocks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import rungwise as rw
from rungwise.cli import app
from rungwise.scene.space import SpaceScene

PUCK = """
<mujoco>
  <worldbody>
    <body name="puck"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body>
    <body name="post" pos="9 0 0"><geom size="0.1"/></body>
  </worldbody>
</mujoco>
"""
BOX = {"d": (-1.0, 1.0)}


def slot(folder: Path, low: float = -0.3, high: float = 0.5, **fields: Any) -> SpaceScene:
    """A puck that goes d along x in 1 s and must end between two numbers; errors of d are even."""
    folder.mkdir(exist_ok=True)
    (folder / "puck.xml").write_text(PUCK, "utf-8")
    data = {
        "name": "slot", "model": {"file": "puck.xml"},
        "parameters": {name: {"default": 0.0, "range": [-1, 1]} for name in ("d", "off")},
        "speeds": {"puck.x": "d + off"}, "goal": f"puck.x >= {low} and puck.x <= {high} and t >= 0.99",
        "step": 0.1, "task": {"uncertain": {"off": {"uniform": [-0.1, 0.1]}}},
    }  # fmt: skip
    (folder / "slot.yaml").write_text(yaml.safe_dump(data | fields), "utf-8")
    scene = rw.load(folder / "slot.yaml")
    assert isinstance(scene, SpaceScene)
    return scene


@pytest.mark.parametrize("model", ["dynamic-rigid", pytest.param("kinematic", marks=pytest.mark.long)])
def test_the_middle_of_a_slot_is_best(tmp_path: Path, model: str) -> None:
    found = rw.design(slot(tmp_path), ("d",), model=model, box=BOX, threads=1)
    assert found.ok and found.how == "in the middle of the set"
    assert found.values["d"] == pytest.approx(0.1, abs=2e-3)
    assert found.drift["d"] == pytest.approx((-0.3, 0.5), abs=5e-3)
    assert found.margin == pytest.approx(0.2, abs=2e-3) and found.decides == "d"


@pytest.mark.long
def test_a_search_finds_the_place_that_is_farthest_from_what_is_unsafe(tmp_path: Path) -> None:
    """Two draws narrow the slot by their distance; in its middle the worse of them has most room."""
    scene = slot(tmp_path, -0.4, 0.4, unsafe="abs(puck.x) > 0.4")
    found = rw.design(
        scene, ("d",), model="kinematic", box=BOX, robust=True, samples=20, draws=2, budget=250, tol=0.2,
        seed=1, threads=1,
    )  # fmt: skip
    assert found.successes == 20 and found.how == "by a search" and np.isnan(found.margin)
    low, high = found.drift["d"]
    assert -0.4 < low < -0.3 and 0.3 < high < 0.4 and found.runs < 450
    assert found.values["d"] == pytest.approx(0.5 * (low + high), abs=0.02)


@pytest.mark.long
def test_a_slope_is_best_level_and_drifts_to_its_friction() -> None:
    """mu >= tan |angle|, in a box that is not symmetric itself."""
    box = {"angle": (-60.0, 50.0)}
    found = rw.design("slope", ("angle",), model="dynamic-rigid", box=box, tol=0.02, threads=1)
    most = np.degrees(np.arctan(0.5))
    assert found.values["angle"] == pytest.approx(0.0, abs=0.6)
    assert found.drift["angle"] == pytest.approx((-most, most), abs=0.2)


@pytest.mark.long
def test_the_farthest_place_of_a_band_is_its_middle(tmp_path: Path) -> None:
    """-0.3 <= d + off <= 0.5 in a square of side 2: half as wide as 0.8 / sqrt 2."""
    box = {"d": (-1.0, 1.0), "off": (-1.0, 1.0)}
    found = rw.design(slot(tmp_path), tuple(box), model="kinematic", box=box, tol=0.1, threads=1)
    assert found.margin == pytest.approx(0.4 / np.sqrt(2.0) / 2.0, abs=0.02)
    assert list(found.values.values()) == pytest.approx([0.05, 0.05], abs=0.04)


@pytest.mark.long
def test_the_chamfer_of_a_hole_catches_the_peg() -> None:
    """The tip is beside the middle by the offset and 0.07 slant; chamfer and clearance must reach it."""
    beside = 0.004 + 0.07 * 0.01
    found = rw.design(
        "peg", ("chamfer",), model="dynamic-rigid", box={"chamfer": (0.001, 0.01)},
        parameters={"offset": -0.004}, tol=0.05, threads=1,
    )  # fmt: skip
    low, high = found.drift["chamfer"]
    assert low == pytest.approx(beside - 0.0005, abs=1e-4) and high == 0.01
    assert found.values["chamfer"] == pytest.approx(0.5 * (low + high), abs=3e-4)


@pytest.mark.long
def test_without_success_it_says_what_blocks() -> None:
    found = rw.design(
        "slope", ("mu",), model="dynamic-rigid", box={"mu": (0.01, 0.3)}, tol=0.1, budget=50, threads=1
    )
    assert not found.found and not found.values and set(found.outcomes) == {"timeout"}
    assert "most often: the time is over, and no condition" in found.reason
    with pytest.raises(rw.InputError, match=r"^goal: the scene has none"):
        rw.design(rw.load("slope").changed(goal=None), ("mu",))


def test_the_command_writes_a_scene_that_loads_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = slot(tmp_path / "scene")
    monkeypatch.chdir(tmp_path)
    told = ["--over", "d=-1:1", "--model", "kinematic", "--tol", "0.05", "--threads", "1", "--json"]
    told += ["--out", "best.yaml", "--png", "best.png"]
    answer = CliRunner().invoke(app, ["design", "scene/slot.yaml", *told])
    assert answer.exit_code == 0, answer.output
    best = json.loads(answer.stdout)["values"]["d"]
    (tmp_path / "else").mkdir()
    monkeypatch.chdir(tmp_path / "else")
    again = rw.load(tmp_path / "best.yaml")
    assert again.file.parameters["d"].default == best
    assert again.file.goal == scene.file.goal and (tmp_path / "best.png").stat().st_size > 0
    assert rw.simulate(again, "kinematic").outcome == "goal"


def test_the_design_of_a_shipped_scene_names_its_model_alone(tmp_path: Path) -> None:
    found = rw.design("slope", ("mu",), model="dynamic-rigid", box={"mu": (0.1, 0.9)}, tol=0.2, threads=1)
    text = found.designed().yaml()
    assert yaml.safe_load(text)["model"]["file"] == "slope.xml"
    file = tmp_path / "best.yaml"
    file.write_text(text, "utf-8")
    assert rw.load(file).file.parameters["mu"].default == found.values["mu"]
    assert found.plot() is not None and len(repr(found)) < 500


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"over": ("mass",)}, r"^over: unknown parameter 'mass'"),
        ({"robust": True}, r"^task: the scene has none"),
        ({"draws": 0}, r"^draws: must be at least 1, not 0$"),
        ({"box": {"mu": (3.0, 1.0)}}, r"^over: mu=3:1 must be an interval"),
        ({"model": "geometric"}, r"geometric"),
    ],
)
def test_wrong_input(change: dict[str, Any], text: str) -> None:
    asked: dict[str, Any] = {"scene": "slope", "over": ("mu",)} | change
    with pytest.raises(rw.InputError, match=text):
        rw.design(**asked)
