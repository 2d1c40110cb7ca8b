"""The Allegro hand of example-robot-data turns a ball and a cube in its palm, the Shadow hand of
gymnasium-robotics a ball."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rungwise as rw
from rungwise.planning.modes.hands.described import turning
from rungwise.planning.modes.hands.gaits import by_hand, hand_in
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

DATA = Path(__file__).parents[3] / "examples" / "data"


def _scene(name: str) -> Any:
    try:
        return rw.load(DATA / f"allegro_{name}.yaml")
    except rw.SceneError as error:
        if "example-robot-data" not in str(error):
            raise
        pytest.skip("the model of the hand needs example-robot-data: pip install example-robot-data")


@pytest.mark.parametrize("name", ["ball", "cube"])
def test_the_hand_begins_where_nothing_overlaps_and_has_four_fingers(name: str) -> None:
    scene = _scene(name)
    run = rw.simulate(scene, "dynamic-compliant", duration=0.02)
    assert run.outcome == "timeout", run.reason
    assert len(scene.template.inputs) == 16
    hand = turning(task_of(scene))
    assert hand is not None and [len(finger.loose) for finger in hand.fingers] == [4] * 4
    # With its last link, or the tip that is fixed to it.
    assert all(len(finger.touching) == 2 for finger in hand.fingers)


@pytest.mark.long
@pytest.mark.parametrize(("turn", "seed"), [(30.0, 0), (60.0, 1), (90.0, 2)])
@pytest.mark.parametrize("name", ["ball", "cube"])
def test_the_hand_turns_what_lies_in_its_palm(name: str, turn: float, seed: int) -> None:
    work = begin(task_of(_scene(name), {"turn": turn}), Budget(20_000, None), seed, 1)
    predictor = work.predictor(Stage(next(m for m in rw.LADDER if m.name == "dynamic-compliant"), 1e-2))
    hand = hand_in(work)
    assert hand is not None
    found = by_hand(work, predictor, hand)
    assert found is not None and found.course.reached, work.nearest


@pytest.mark.long
def test_a_hand_whose_last_joints_only_tendons_hold_has_five_fingers() -> None:
    scene = rw.load(DATA / "shadow_ball.yaml")
    run = rw.simulate(scene, "dynamic-compliant", duration=0.02)
    assert run.outcome == "timeout", run.reason
    hand = turning(task_of(scene))
    assert hand is not None and [int(finger.loose.sum()) for finger in hand.fingers] == [3, 3, 3, 4, 5]
    assert [len(finger.touching) for finger in hand.fingers] == [2, 2, 2, 2, 1]


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_such_a_hand_turns_a_ball(seed: int) -> None:
    found = rw.plan(DATA / "shadow_ball.yaml", seed=seed)
    assert found.found, found.reason
