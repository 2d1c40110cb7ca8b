"""Where bodies are, in conditions of scenes in space: ``at`` and ``tilt``."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rungwise as rw

SCENE = {
    "name": "any",
    "model": {"file": "peg_arm.xml"},
    "parameters": {"far": {"default": 0.1, "unit": "m"}},
    "goal": "at(tip, z, hole) <= far and tilt(tip, z, hole) <= 1",
}


def places(count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.hstack([rng.uniform(-1.0, 1.0, (count, 6)), 0.05 * rng.uniform(-1.0, 1.0, (count, 4))])


def told(scene: object, term: str) -> np.ndarray:
    """The number at random places of the joints."""
    q = places(6)
    return np.asarray(rw.ask(scene, f"{term} >= 0", np.hstack([q, 0.0 * q])).values[:, 0])


@pytest.mark.parametrize("lean", [0.0, 0.5])
def test_places_and_tilts_are_those_of_the_poses_of_bodies(lean: float) -> None:
    half = [math.cos(lean / 2), 0.0, math.sin(lean / 2), 0.0]
    scene = rw.load({**SCENE, "model": {"file": "peg_arm.xml", "set": {"bodies": {"block": {"quat": half}}}}})
    q = places(6)
    found = rw.geometry(scene, np.hstack([q, 0.0 * q]))
    tip, hole = (found.poses[:, found.bodies.index(name)] for name in ("tip", "hole"))
    turns = [Rotation.from_quat(pose[:, 3:], scalar_first=True) for pose in (tip, hole)]
    seen = turns[1].inv().apply(tip[:, :3] - hole[:, :3])
    for k, axis in enumerate("xyz"):
        assert told(scene, f"at(tip, {axis})") == pytest.approx(tip[:, k])
        assert told(scene, f"at(tip, {axis}, hole)") == pytest.approx(seen[:, k])
        own, other = (turn.as_matrix()[:, :, k] for turn in turns)
        assert told(scene, f"tilt(tip, {axis})") == pytest.approx(np.arccos(own[:, k]))
        assert told(scene, f"tilt(tip, {axis}, hole)") == pytest.approx(np.arccos((own * other).sum(axis=1)))


def test_a_run_ends_where_a_place_in_a_condition_comes_to_its_bound() -> None:
    begun = {**SCENE, "start": {"places": {"upper.shoulder": 0.5}}, "duration": 2, "step": 1e-3}
    top = told_at(rw.load(begun), rw.State.of(rw.load(begun)))
    falls = rw.load({**begun, "goal": f"at(tip, z) <= {top - 0.01!r}"})
    run = rw.simulate(falls, "dynamic-compliant", duration=2.0)
    assert run.outcome == rw.Outcome.GOAL
    assert told_at(falls, run.state) == pytest.approx(top - 0.01, abs=1e-3)


def told_at(scene: rw.SpaceScene, state: rw.State) -> float:
    return float(rw.ask(scene, "at(tip, z) >= 0", state).values[0, 0])


@pytest.mark.parametrize(
    "wrong", ["at(tip)", "at(tip, w)", "at(none, x)", "tilt(tip, z, none)", "at(tip, x, hole, z)"]
)
def test_other_arguments_are_refused_in_a_line(wrong: str) -> None:
    with pytest.raises(rw.SceneError, match="goal: unknown name"):
        rw.load({**SCENE, "goal": f"{wrong} <= 0.1"})


def test_a_place_is_a_length_and_a_tilt_an_angle() -> None:
    with pytest.raises(rw.SceneError, match="goal"):
        rw.load({**SCENE, "goal": "tilt(tip, z, hole) <= far"})
    scene = rw.load(SCENE)
    assert rw.ask(scene, "goal", np.zeros((1, 20))).units == ("length", "angle")


def test_a_part_on_a_body_that_is_not_there_is_refused_in_a_line() -> None:
    part = {"file": "ball.xml", "body": "flange", "xyz": [0.0, 0.2, 0.0]}
    wrong = {
        **SCENE,
        "goal": None,
        "model": {"file": "peg_arm.xml", "parts": {"own": {**part, "body": "flang"}}},
    }
    with pytest.raises(rw.SceneError, match=r"model\.parts\.own\.body: no body is called 'flang'"):
        rw.load(wrong)
