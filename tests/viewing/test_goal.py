"""Goals that want a pose are drawn as one; others are not."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.plane.clip import clip
from rungwise.viewing.plane.goal import goal_places
from rungwise.viewing.plane.pictures import strip

DRAWN = {"push": "box", "book": "book", "card": "card", "corner_pivot": "block", "corridor": "box"}
NOT = ("two_finger", "four_finger", "gripper", "pivot", "grasp", "peg_in_hole")


@pytest.mark.parametrize("scene", [*DRAWN, *NOT])
def test_poses_that_goals_want(scene: str) -> None:
    loaded = rw.load(scene)
    shown = clip(rw.simulate(loaded, "kinematic", duration=0.01))
    assert [shown.bodies[body] for body in shown.wanted] == ([DRAWN[scene]] if scene in DRAWN else [])
    places = goal_places(loaded, loaded.parameters())
    if scene in DRAWN:  # the goal holds there
        state = rw.State.of(loaded, {name: wanted.value for name, wanted in places.items()})
        answers = rw.ask(loaded, "goal", state)
        poses = [k for k, term in enumerate(answers.terms) if term.startswith(("abs", "hypot"))]
        assert (answers.values[0, poses] >= 0.0).all()
        assert [text.get_text() for text in strip([shown]).legends[0].texts][-1] != ""
        assert "pose that the goal wants" in {t.get_text() for t in strip([shown]).legends[0].texts}


@pytest.mark.parametrize(
    ("goal", "found"),
    [
        ("abs(box.x - 0.3) <= 0.01", {"box.x": 0.3}),
        ("hypot(2 * box.x - 0.3, v - box.y) <= 0.01 and t > 0", {"box.x": 0.15, "box.y": 0.02}),
        ("(abs(box.angle - 30 * deg) < 0.01 for 0.2) and box.x > 0", {"box.angle": np.pi / 6}),
        ("abs(box.x - box.y) <= 0.01", {}),
        ("abs(box.x * box.x) <= 0.01", {}),
        ("abs(box.x) <= 0.01 or abs(box.y) <= 0.01", {}),
        ("not abs(box.x) <= 0.01", {}),
        ("abs(speed(box.x)) <= 0.01 and box.x >= 1", {}),
        ("abs(box.x - t) <= 0.01", {}),
        ("abs(box.x) <= gap(rod, box)", {}),
    ],
)
def test_terms_that_name_a_place(goal: str, found: dict[str, float]) -> None:
    scene = rw.load("push").changed(goal=goal)
    places = goal_places(scene, scene.parameters())
    assert {name: wanted.value for name, wanted in places.items()} == pytest.approx(found)
