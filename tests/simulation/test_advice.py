"""What a run advises fits its rung and its scene; what nothing can touch is named."""

from __future__ import annotations

import re
from typing import Any

import pytest

import rungwise as rw

from .random_scenes import random_scene

DISC = {"kind": "disc", "radius": 0.1}
MOVING = [rung for rung in rw.LADDER if rung.moves]


def thrown(**conditions: Any) -> rw.Scene:
    """A disc that slides without friction, with a fixed one far away."""
    bodies = {
        "puck": {
            "role": "object", "shape": DISC, "mass": 1.0, "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}},
        },
        "post": {"role": "obstacle", "shape": DISC, "pose": {"x": 9.0}},
    }  # fmt: skip
    contacts = [{"between": ["puck", "post"]}]
    return rw.load({"name": "a", "bodies": bodies, "contacts": contacts, "duration": 0.1} | conditions)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_goal_names_the_next_rung(model: rw.Rung) -> None:
    reason = rw.simulate(thrown(goal="puck.s >= 0.05"), model).reason
    above = rw.LADDER[rw.LADDER.index(model) + 1 :]
    assert reason.endswith(f"The next rung is {above[0].name}." if above else "This is the richest rung.")


def test_a_goal_is_asked_for_only_where_there_is_none() -> None:
    assert "state a goal" in rw.simulate(thrown(), "kinematic").reason
    reason = rw.simulate(thrown(goal="puck.s >= 7"), "kinematic").reason
    assert "state a goal" not in reason and "--time" in reason


def puck(drive: dict[str, Any], damping: float = 0.0) -> rw.Scene:
    """A disc with a drive of its own, and one that it may come to touch."""
    scene = thrown().file.model_dump(mode="json", exclude_unset=True) | {"goal": "post.s >= 100"}
    scene["bodies"]["puck"]["coordinates"]["s"] = {"drive": drive}
    scene["bodies"]["post"] |= {
        "role": "object", "mass": 1.0, "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"damping": damping}},
    }  # fmt: skip
    return rw.load(scene)


STILL = "Nothing moves any more: more time changes nothing. Change inputs, drives or the start."
LED = "Only puck, led by drives, still moves: more time (--time) helps only if it touches something."
MORE = "Give more time (--time)."


@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize(
    ("speed", "duration", "advised"),
    [("1", 0.1, LED), ("10", 1.0, MORE), ("t", 0.1, MORE)],
)
def test_more_time_is_advised_where_it_may_help(
    model: rw.Rung, speed: str, duration: float, advised: str
) -> None:
    scene = puck({"kind": "speed", "speed": speed}, damping=1.0)
    run = rw.simulate(scene, model, duration=duration)
    assert run.outcome == "timeout" and run.reason.endswith(advised)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_where_nothing_moves_more_time_is_not_advised(model: rw.Rung) -> None:
    scene = puck({"kind": "force", "force": 0.0}, damping=1.0)
    run = rw.simulate(scene, model)
    assert run.outcome == "timeout" and run.reason.endswith(STILL)


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_scene_in_space_in_which_nothing_moves_is_not_helped_by_time(model: rw.Rung) -> None:
    scene = rw.load("stack").changed(goal="t >= 100")
    reason = rw.simulate(scene, model, duration=0.3).reason
    assert "Give more time" not in reason or model.compliant


def test_bodies_that_nothing_can_touch_are_named() -> None:
    data = thrown().file.model_dump(mode="json")
    assert rw.simulate(rw.load(data), "kinematic").notes == ()
    alone = data | {"contacts": []}
    expected = "contacts: puck moves, and no entry lets anything touch it"
    assert rw.simulate(rw.load(alone), "kinematic").notes == (expected,)
    alone["bodies"]["other"] = data["bodies"]["puck"] | {"pose": {"x": 3.0}}
    expected = "contacts: puck, other move, and no entry lets anything touch them"
    assert rw.simulate(rw.load(alone), "kinematic").notes == (expected,)


def test_links_of_an_arm_need_no_contact() -> None:
    assert not any("touch" in note for note in rw.simulate("two_link", "kinematic").notes)


@pytest.mark.parametrize("number", [3227, 3316])
def test_what_nothing_balances_without_a_proof_is_named(number: int) -> None:
    run = rw.simulate(random_scene(number), "quasistatic-rigid", tol=1e-5)
    named = re.search(r"without inertia at (\w+)\.\w+, and no certificate says why", run.reason)
    assert (run.outcome == "unsupported" and run.certificate) or (named and named[1] in run.final)
    assert "dynamic" in run.reason


def test_speeds_of_the_start_do_not_unbalance_a_rung_without_momentum() -> None:
    run = rw.simulate(random_scene(3086), "quasistatic-rigid", tol=1e-5)
    assert run.outcome == "timeout" and run.worst_residual < 1e-8
