"""Designs: the middles of known bands, under uncertainty, and what blocks where nothing succeeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene.builder import parts

SPEEDS = {"v1": (0.2, 2.2), "v2": (0.2, 2.2)}


def slot(low: float = -0.3, high: float = 0.5, **fields: Any) -> rw.SceneBuilder:
    """A puck that goes d along x, and counts where it ends between two numbers; errors of d are even."""
    s = rw.SceneBuilder("slot", goal=f"puck.x >= {low} and puck.x <= {high} and t >= 0.99", duration=1.0)
    d, off = s.parameter("d", 0.0, range=(-1, 1)), s.parameter("off", 0.0, range=(-1, 1))
    s.body(
        "puck", "robot", parts.disc(0.1), mass=1.0, motion=parts.slide([1, 0], name="x"),
        coordinates={"x": parts.speed(d + off)},
    )  # fmt: skip
    s.body("post", "obstacle", parts.disc(0.1), pose=(9, 0))
    s.contact("puck", "post")
    s.step = 1e-2
    s.task = {"uncertain": {"off": {"uniform": [-0.1, 0.1]}}} | fields
    s.inputs = []
    return s


@pytest.mark.few(1)
@pytest.mark.parametrize("model", ["kinematic", "quasistatic-rigid"])
def test_two_fingers_close_best_in_the_middle_of_the_band(model: str) -> None:
    """Caught for v2 in [1/2, 2] and offsets of the part in [-1/2, 1/2]: a rectangle."""
    found = rw.design("two_finger", ("x3", "v2"), model=model, box={"x3": (-0.6, 0.6), "v2": (0.2, 2.2)})
    assert found.ok and found.samples == 1
    assert found.values["v2"] == pytest.approx(1.25, abs=0.01)
    assert found.values["x3"] == pytest.approx(0.0, abs=0.006)
    assert found.drift["v2"] == pytest.approx((0.5, 2.0), abs=2e-3)
    assert found.drift["x3"] == pytest.approx((-0.5, 0.5), abs=2e-3)
    assert found.margin == pytest.approx(0.75 / 2.0, abs=0.01) and found.decides == "v2"


def test_two_speeds_are_equal_and_far_from_both_ends_of_the_band() -> None:
    """On v1 = v2 = c the lines v2 = 2 v1 and v1 = 2 v2 are c / sqrt 5 away, the sides of the box 2.2 - c."""
    found = rw.design("two_finger", ("v1", "v2"), model="quasistatic-rigid", box=SPEEDS)
    c = 2.2 / (1.0 + 1.0 / np.sqrt(5.0))
    assert list(found.values.values()) == pytest.approx([c, c], abs=0.02)
    assert found.drift["v1"] == pytest.approx((c / 2, 2.2), abs=0.02)


@pytest.mark.long
def test_restarts_agree() -> None:
    one, other = (
        rw.design("two_finger", ("x3", "v2"), model="quasistatic-rigid", robust=True, samples=100, seed=seed,
                  box={"x3": (-0.6, 0.6), "v2": (0.2, 2.2)})
        for seed in (0, 1)
    )  # fmt: skip
    assert one.successes == other.successes == 100
    for name, (low, high) in one.box.items():
        assert abs(one.values[name] - other.values[name]) < 0.25 * (high - low)


@pytest.mark.long
def test_uncertainty_moves_the_ends_of_the_drift() -> None:
    """Errors of 0.1 take 0.1 from both ends, but for the share of failures that counts as kept."""
    sure = rw.design(slot().load(), ("d",), box={"d": (-1, 1)}, model="kinematic")
    assert sure.values["d"] == pytest.approx(0.1, abs=2e-3)
    assert sure.drift["d"] == pytest.approx((-0.3, 0.5), abs=5e-3)
    robust = rw.design(slot().load(), ("d",), box={"d": (-1, 1)}, model="kinematic", robust=True, samples=300)
    assert robust.successes == 300 and robust.lower > 0.98
    assert robust.drift["d"] == pytest.approx((-0.2, 0.4), abs=0.01)


def test_the_rate_is_that_of_the_uncertainty() -> None:
    """A slot of 0.12 for errors of 0.2: three of five succeed at best."""
    found = rw.design(
        slot(0.0, 0.12).load(), ("d",), box={"d": (-1, 1)}, model="kinematic", robust=True, samples=2000
    )
    assert found.values["d"] == pytest.approx(0.06, abs=0.04)
    assert found.successes / 2000 == pytest.approx(0.6, abs=0.03)


def test_more_than_four_parameters_are_searched() -> None:
    box = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.0, 0.9), "x3": (-0.6, 0.6), "restitution": (0.0, 0.5)}
    found = rw.design("two_finger", list(box), model="dynamic-rigid", box=box, budget=3000)
    assert found.ok and found.how == "by a search" and np.isnan(found.margin) and found.runs < 5000


def test_without_success_it_says_what_blocks() -> None:
    found = rw.design("two_finger", ("v2",), model="quasistatic-rigid", box={"v2": (0.1, 0.4)})
    assert not found.found and not found.ok and not found.values
    assert "no design of" in found.reason and "doomed" in found.reason and str(found).endswith(found.reason)
    assert found.summary()["reason"] == found.reason


def test_the_designed_scene_succeeds(tmp_path: Path) -> None:
    found = rw.design("two_finger", ("v2",), model="quasistatic-rigid", box={"v2": (0.2, 2.2)})
    file = tmp_path / "best.yaml"
    file.write_text(found.designed().yaml(), "utf-8")
    assert rw.load(file).file.parameters["v2"].default == found.values["v2"]
    assert rw.simulate(file, "quasistatic-rigid").outcome == "goal"
    assert found.plot() is not None and len(repr(found)) < 500


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"over": ("v3",)}, r"^over: unknown parameter 'v3'; valid: v1, v2, "),
        ({"over": ()}, r"^over: needs at least one parameter"),
        ({"over": ("v2", "v2")}, r"^over: v2 is given twice$"),
        ({"box": {"v2": (3.0, 1.0)}}, r"^over: v2=3:1 must be an interval"),
        ({"samples": 0}, r"^samples: must be at least 1, not 0$"),
        ({"scene": "slide_roll", "over": ("mu",), "robust": True}, r"^task: the scene has none"),
        ({"model": "geometric"}, r"geometric"),
    ],
)
def test_wrong_input(change: dict[str, Any], text: str) -> None:
    asked: dict[str, Any] = {"scene": "two_finger", "over": ("v2",)} | change
    with pytest.raises(rw.InputError, match=text):
        rw.design(**asked)
