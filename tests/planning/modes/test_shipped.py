"""The scenes that ship with a task for fingers: one known answer of each, and plans by contact modes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

import rungwise as rw
from rungwise.planning.modes import tried

KEPT = Path(__file__).parents[3] / "docs" / "gallery"


def test_a_card_rests_up_to_its_middle_over_the_edge() -> None:
    """With a little more than half of it in front of the table it falls."""
    for part, outcome in ((0.49, "missed"), (0.51, "unsupported")):
        over = {"inside": -part * 0.08}
        assert rw.simulate("card", "quasistatic-rigid", parameters=over, duration=0.2).outcome == outcome


def test_a_finger_of_the_corridor_lags_by_friction_and_damping_over_its_stiffness() -> None:
    ahead = [rw.Segment({"x1": -0.12, "y1": 0.0, "y2": 0.3}, 0.5), rw.Segment({"x1": 0.0}, 2.0, ramp=True)]
    run = rw.simulate("corridor", "quasistatic-rigid", inputs=ahead, duration=2.5)
    assert run.final["box"]["x"] > 0.05
    force = 0.3 * 0.5 * 9.81 + 2.0 * math.sqrt(500.0 * 0.1) * 0.06
    assert -run.final["finger1"]["x"] == pytest.approx(force / 500.0, rel=1e-6)


def test_a_block_in_a_corner_is_not_raised_without_friction() -> None:
    """The kept plan tips it by friction alone; what its finger weighs, its arm carries."""
    plan = [rw.Segment(**part) for part in yaml.safe_load((KEPT / "corner_pivot.yaml").read_text("utf-8"))]
    smooth = rw.simulate("corner_pivot", "dynamic-compliant", parameters={"mu": 0.0}, inputs=plan)
    assert smooth.outcome != "goal" and abs(smooth.final["block"]["angle"]) < 0.2
    still = rw.simulate("corner_pivot", "quasistatic-rigid", duration=0.1)
    assert still.final["finger"]["y"] == pytest.approx(0.05, abs=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("corner_pivot", 1),
        ("card", 1),
        pytest.param("book", 1, marks=pytest.mark.long),
        pytest.param("corridor", 0, marks=pytest.mark.long),
        pytest.param("planar_hand", 1, marks=pytest.mark.long),
    ],
)
def test_a_scene_with_fingers_is_planned_and_lifted(name: str, seed: int) -> None:
    """On the quasistatic rung, then on the richest one, where it holds at a tenth of the error."""
    found = rw.plan(name, seed=seed)
    assert found.found, found.reason
    assert found.records[0].stage.startswith("quasistatic-rigid") and found.records[0].how == "planned"
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


def test_fingers_are_placed_on_any_number_of_pairs_of_opposite_places(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tried, "PAIRS", 23)
    assert rw.plan("card").found
