"""Doomed sets of scenes in space against closed forms, and beside the same scene in the plane."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise import cli
from rungwise.scene.space import SpaceScene

CART = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody>
<body name="cart"><joint name="s" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body></worldbody>
<actuator><motor name="u" joint="s"/></actuator></mujoco>"""
PUSH = """<mujoco><worldbody><geom name="table" type="plane" size="5 5 .1"/>
<body name="pusher" pos="0 0 .05"><joint name="p" type="slide" axis="1 0 0" range="0 1.4" limited="true"/>
<geom name="pusher" type="box" size=".05 .05 .04" pos="-.05 0 0" mass="1"/></body>
<body name="block" pos=".05 0 .05"><freejoint/>
<geom name="block" type="box" size=".05 .05 .05" mass="1"/></body>
</worldbody></mujoco>"""


def scene(folder: Path, model: str, **fields: Any) -> SpaceScene:
    (folder / "model.xml").write_text(model)
    made = rw.load({"name": "made", "model": {"file": str(folder / "model.xml")}, **fields})
    assert isinstance(made, SpaceScene)
    return made


def braking(folder: Path) -> SpaceScene:
    return scene(
        folder,
        CART,
        parameters={"u": {"default": 0.0, "range": [-9.0, 9.0]}},
        controls={"u": "u"},
        goal="abs(cart.s) <= 0.1 and abs(speed(cart.s)) <= 0.2",
        unsafe="abs(cart.s) > 1",
        duration=4,
    )


def pushing(folder: Path) -> SpaceScene:
    """A pusher that only goes forward, a block that it slides along a table, and a goal on the way."""
    return scene(
        folder,
        PUSH,
        parameters={"v": {"default": 1.0, "range": [0.01, 9.0]}},
        speeds={"pusher.p": "v"},
        contacts=[{"between": ["*", "*"], "friction": 0.2}],
        goal="abs(block.x - 1) <= 0.1",
        duration=4,
        step=0.05,
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("cells", "seen"), [((10, 12), 0.2), pytest.param((14, 16), 0.25, marks=pytest.mark.long)], ids=str
)
def test_braking_too_late(tmp_path: Path, cells: tuple[int, int], seen: float) -> None:
    """Doomed only if x + v^2 / 2 > 1 for v > 0, and mirrored; runs are those of the plane."""
    found = rw.doomed_set(
        braking(tmp_path), rw.DYNAMIC_RIGID, ("s", "speed(s)"), {"u": (-1.0, 1.0)},
        box={"s": (-1.05, 1.05), "speed(s)": (-2.4, 2.4)}, cells=cells, strides=(12.0,), threads=1,
    )  # fmt: skip
    points = np.random.default_rng(5).uniform(*found.box.T, (20_000, 2))
    x, v = points.T
    truth = (np.abs(x) > 1) | (np.sign(v) * x + 0.5 * v**2 > 1)
    doomed = found.labels(points) == rw.Label.DOOMED
    assert not (doomed & ~truth).any()
    assert np.mean(doomed & truth) / np.mean(truth) > seen
    mirrored = found.cells[::-1, ::-1]
    assert np.mean(mirrored == found.cells) > 0.98


@pytest.mark.long
def test_what_was_pushed_too_far_is_doomed(tmp_path: Path) -> None:
    """A block beyond the goal does not come back; before it, it can still be pushed there."""
    found = rw.doomed_set(
        pushing(tmp_path), rw.QUASISTATIC_RIGID, ("p", "block.x"), {"v": (0.2, 1.0)},
        box={"block.x": (0.0, 1.9)}, cells=(20, 19), threads=1,
    )  # fmt: skip
    points = np.random.default_rng(6).uniform(*found.box.T, (5_000, 2))
    p, x = points.T
    doomed = found.labels(points) == rw.Label.DOOMED
    assert doomed[(x > 1.1 + 3 * found.unit[1]) & (p < x - 0.05)].all()
    assert not doomed[(x < 0.9) & (p < x - 0.05)].any()
    assert found.holds_on(rw.QUASISTATIC_RIGID)[0] and not found.holds_on(rw.DYNAMIC_COMPLIANT)[0]
    found.save(tmp_path / "set")
    kept = rw.load_doomed_set(tmp_path / "set", scene=found.scene)
    np.testing.assert_array_equal(kept.cells, found.cells)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"over": ("p",)}, "block.x moves as well"),
        ({"over": ("p", "q")}, "unknown coordinate 'q'"),
        ({"over": ("p", "block.x", "speed(block.x)")}, "is prescribed, not a state"),
        ({"model": rw.DYNAMIC_COMPLIANT}, "take a rigid rung"),
        ({"over": ()}, "1 to 4 states"),
        ({"box": {}}, "block.x needs an interval"),
        ({"solutions": "any"}, "only the slowest motion"),
    ],
)
def test_wrong_input(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    request: dict[str, Any] = {
        "scene": pushing(tmp_path), "model": rw.QUASISTATIC_RIGID, "over": ("p", "block.x"),
        "inputs": {"v": (0.2, 1.0)}, "box": {"block.x": (0.0, 1.6)}, "cells": 6, "threads": 1,
    } | change  # fmt: skip
    with pytest.raises((rw.SetError, rw.SceneError), match=words):
        rw.doomed_set(**request)


def test_a_scene_that_follows_the_time_is_refused(tmp_path: Path) -> None:
    given = {"u": {"default": 0.0, "range": [-1.0, 1.0]}}
    timed = scene(tmp_path, CART, parameters=given, controls={"u": "u * t"}, goal="cart.s >= 1")
    with pytest.raises((rw.SetError, rw.SceneError), match="depends on the time"):
        rw.doomed_set(timed, rw.DYNAMIC_RIGID, ("s", "speed(s)"), {"u": (0.0, 1.0)}, cells=4, threads=1)


@pytest.mark.long
def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.yaml").write_text(braking(tmp_path).yaml())
    over, inputs = "s=-1.05:1.05,speed(s)=-2.4:2.4", "u=-1:1"
    told = ["rungwise", "doomed", str(tmp_path / "scene.yaml"), "--model", "dynamic-rigid", "--over", over]
    told += [
        "--inputs",
        inputs,
        "--cells",
        "6",
        "--stride",
        "6",
        "--threads",
        "1",
        "--out",
        str(tmp_path / "o"),
    ]
    monkeypatch.setattr(sys, "argv", told)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code in (0, 1)
    said = capsys.readouterr().out
    assert "made on dynamic-rigid over cart.s in -1.05..1.05, speed(cart.s) in -2.4..2.4" in said
    assert (tmp_path / "o").is_dir()
