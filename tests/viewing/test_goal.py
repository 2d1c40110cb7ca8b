"""Goals that want a pose are drawn as one; others are not."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.goal import goal_places
from rungwise.viewing.plane.clip import clip
from rungwise.viewing.plane.pictures import strip
from rungwise.viewing.space import pictures
from rungwise.viewing.space.runs import film_of

DRAWN = {"push": "box", "book": "book", "card": "card", "corner_pivot": "block", "corridor": "box"}
NOT = ("two_finger", "four_finger", "gripper", "pivot", "grasp", "peg_in_hole")


@pytest.mark.few(1)
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


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("goal", "found"),
    [
        ("abs(box.x - 0.3) <= 0.01", {"box.x": 0.3}),
        ("hypot(2 * box.x - 0.3, v - box.y) <= 0.01 and t > 0", {"box.x": 0.15, "box.y": 0.02}),
        ("(abs(box.angle - 30 * deg) < 0.01 for 0.2) and box.x > 0", {"box.angle": np.pi / 6}),
        ("hypot(hypot(box.x - 1, box.y), box.angle) <= 0.01", {"box.x": 1.0, "box.y": 0.0, "box.angle": 0.0}),
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


IN_SPACE = {
    "floor_push": "box",
    "arm_turn": "box",
    "door": "door",
    "hand_turn": "ball",
    "palm_lift": "box",
    "slope": "block",
}
NOT_IN_SPACE = ("block_turn", "three_finger_lift", "peg", "ball")


@pytest.mark.few(1)
@pytest.mark.parametrize("scene", [*IN_SPACE, *NOT_IN_SPACE])
def test_poses_that_goals_want_in_space(scene: str) -> None:
    loaded = rw.load(scene)
    film = film_of(rw.simulate(loaded, "kinematic", duration=0.004))
    assert [film.bodies[body] for body in film.wanted] == [
        own for name, own in IN_SPACE.items() if name == scene
    ]
    legends = pictures.strip([film], 1).legends
    words = {text.get_text() for legend in legends for text in legend.texts}
    assert ("pose that the goal wants" in words) == (scene in IN_SPACE)
    for body in film.wanted if scene != "door" else ():
        label = film.bodies[body]
        names = (f"{label}.{each}" for each in ("x", "y", "z", "qw", "qx", "qy", "qz"))
        state = rw.State.of(loaded, dict(zip(names, film.goal[body], strict=True)))
        answers = rw.ask(loaded, "goal", state)
        poses = [k for k, term in enumerate(answers.terms) if term.startswith(("abs(atan2", "hypot"))]
        assert poses and (answers.values[0, poses] >= 0.0).all()


@pytest.mark.parametrize(
    ("goal", "pose"),
    [
        ("hypot(box.x - 0.2, box.y) <= 0.01", [0.2, 0.0, 0.04, 1.0, 0.0, 0.0, 0.0]),
        ("hypot(hypot(box.x, box.y), box.z - 1) <= 0.01", [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        (
            "hypot(box.x, box.y) <= 0.01 and abs(angle_about(box, y) + 60 * deg) <= 0.1",
            [0.0, 0.0, 0.04, np.sqrt(0.75), 0.0, -0.5, 0.0],
        ),
        ("abs(box.x - 0.2) <= 0.01", None),
        ("hypot(box.x, box.y) <= 0.2", None),
        ("hypot(box.x, box.y) >= 0.01", None),
        ("abs(angle_about(box, z)) <= 0.1", None),
    ],
)
def test_what_a_goal_must_hold_in_space(goal: str, pose: list[float] | None) -> None:
    film = film_of(rw.simulate(rw.load("floor_push").changed(goal=goal), "kinematic", duration=0.002))
    assert len(film.wanted) == (pose is not None)
    if pose is not None:
        assert film.goal[film.wanted[0]] == pytest.approx(pose, abs=1e-6)
