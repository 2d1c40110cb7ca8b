"""Doomed sets against what can be said by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.sets.doomed.backward import around, backward


def slider(**more: Any) -> dict[str, Any]:
    return {"shape": {"kind": "point"}, "motion": {"kind": "slide", "axis": [1, 0]}} | more


def pushing() -> rw.Scene:
    """A pusher that only goes forward, a block before it, and a goal on the way."""
    pusher = slider(
        role="robot", shape={"kind": "halfplane", "normal": [1, 0]},
        coordinates={"p": {"lower": 0, "upper": 2, "drive": {"kind": "speed", "speed": "v"}}},
    )  # fmt: skip
    pusher["motion"] = pusher["motion"] | {"name": "p"}
    return rw.load(
        {
            "name": "pushing",
            "parameters": {"v": {"default": 1.0, "range": [0.01, 9.0]}},
            "bodies": {"pusher": pusher, "block": slider(role="object", mass=1)},
            "contacts": [{"between": ["pusher", "block"]}],
            "goal": "abs(block.s - 1) <= 0.05",
            "duration": 4,
            "step": 1e-3,
        }
    )


def braking() -> rw.Scene:
    """A carriage between two edges, with a bounded force; it is to stop in the middle."""
    carriage = slider(
        role="robot", mass=1, coordinates={"s": {"drive": {"kind": "force", "force": "u"}}}
    )  # fmt: skip
    return rw.load(
        {
            "name": "braking",
            "parameters": {"u": {"default": 0.0, "range": [-9.0, 9.0]}},
            "bodies": {"cart": carriage},
            "goal": "abs(cart.s) <= 0.1 and abs(speed(cart.s)) <= 0.2",
            "unsafe": "abs(cart.s) > 1",
            "duration": 4,
            "step": 1e-3,
        }
    )


def doomed(found: rw.DoomedSet, points: Reals) -> Any:
    return found.labels(points) == rw.Label.DOOMED


def states(found: rw.DoomedSet, n: int = 50_000) -> Reals:
    low, high = found.box.T
    return np.random.default_rng(5).uniform(low, high, (n, len(low)))


@pytest.mark.few(1)
@pytest.mark.parametrize("model", [rw.KINEMATIC, rw.QUASISTATIC_RIGID], ids=str)
def test_what_was_pushed_too_far_is_doomed(model: rw.Rung) -> None:
    found = rw.doomed_set(
        pushing(), model, ("p", "s"), {"v": (0.2, 1.0)}, box={"s": (0.0, 2.5)}, cells=(80, 100), threads=1
    )
    assert found.escapes == 0.0
    points = states(found)
    points = points[points[:, 0] <= points[:, 1]]
    truth = points[:, 1] > 1.05
    assert not (doomed(found, points) & ~truth).any()
    assert doomed(found, points[points[:, 1] > 1.05 + 4 * found.unit[1]]).all()


def test_what_may_move_by_itself_is_doomed_only_behind_the_pusher() -> None:
    """The block cannot pass the pusher, which only goes forward: it is lost once that is beyond the goal."""
    options: dict[str, Any] = {"box": {"s": (0.0, 2.5)}, "cells": (80, 100), "threads": 1}
    found, slowest = (
        rw.doomed_set(pushing(), rw.KINEMATIC, ("p", "s"), {"v": (0.2, 1.0)}, solutions=solutions, **options)
        for solutions in ("any", "slowest")
    )
    points = states(found)
    points = points[points[:, 0] <= points[:, 1]]
    assert not (doomed(found, points) & ~(points[:, 0] > 1.05)).any()
    far = points[(points[:, 0] > 1.05 + 4 * found.unit[0]) & (points[:, 1] < 2.4)]
    assert doomed(found, far).all()
    assert not (doomed(found, points) & ~doomed(slowest, points)).any()
    assert found.holds_on(rw.DYNAMIC_RIGID)[0] and found.holds_on(rw.QUASISTATIC_RIGID)[0]
    assert not found.holds_on(rw.DYNAMIC_COMPLIANT)[0]
    assert slowest.holds_on(rw.KINEMATIC)[0] and not slowest.holds_on(rw.QUASISTATIC_RIGID)[0]


@pytest.mark.long
def test_braking_too_late() -> None:
    """Doomed iff x + v^2 / 2 > 1 for v > 0, and mirrored; longer macro-steps see it more sharply."""
    parts = []
    for strides in ((16.0,), (16.0, 48.0)):
        found = rw.doomed_set(
            braking(), rw.DYNAMIC_RIGID, ("s", "speed(s)"), {"u": (-1.0, 1.0)},
            box={"s": (-1.05, 1.05), "speed(s)": (-3.0, 3.0)}, cells=(84, 120), strides=strides, threads=1,
        )  # fmt: skip
        points = states(found)
        x, v = points.T
        truth = (np.abs(x) > 1) | (np.sign(v) * x + 0.5 * v**2 > 1)
        assert not (doomed(found, points) & ~truth).any()
        slow = np.abs(v) < 1.8
        parts.append(np.mean(doomed(found, points)[slow]) / np.mean(truth[slow]))
    assert 0.4 < parts[0] < parts[1] and parts[1] > 0.7


@pytest.mark.long
def test_two_fingers_and_the_rule_of_the_scene() -> None:
    """With speeds in 1/2..1 the ratio decides, too. Fingers at -0.3 and 0.3 close on the line x1 + x2 = 2.6;
    they do so between its ends iff x1 can be between 1 and 1.6 there."""
    found = rw.doomed_set(
        "two_finger", rw.KINEMATIC, ("x1", "x2", "x3"), {"v1": (0.5, 1.0), "v2": (0.5, 1.0)},
        box={"x3": (-1.6, 1.6)}, cells=(18, 18, 30), parameters={"offset": 0.3}, threads=1,
    )  # fmt: skip
    points = states(found)
    x1, x2, x3 = points.T
    left = (2.6 - x1 - x2) / 1.5
    truth = (np.abs(x3) > 0.3 * (1 - 1e-4)) | (x1 + 0.5 * left > 1.6) | (x1 + left < 1.0)
    free = (2 - x1 > np.maximum(0, 1 - np.abs(-0.3 - x3))) & (2 - x2 > np.maximum(0, 1 - np.abs(0.3 - x3)))
    assert not (doomed(found, points) & free & ~truth).any()
    assert doomed(found, points[free & (np.abs(x3) > 0.3 + 3 * found.unit[2])]).all()
    beside = found.beside_rule(20_000, threads=1)
    assert beside["both"] > 0.6 and beside["only by rule"] < 0.2


def test_runs_from_doomed_states_do_not_reach_the_goal() -> None:
    """Random inputs that change at random times."""
    found = rw.doomed_set(
        pushing(),
        rw.QUASISTATIC_RIGID,
        ("p", "s"),
        {"v": (0.2, 1.0)},
        box={"s": (0.0, 2.5)},
        cells=40,
        threads=1,
    )
    points = states(found, 2000)
    points = points[doomed(found, points)]
    speeds = np.random.default_rng(6).uniform(0.2, 1.0, (10, len(points)))
    for v in speeds:
        runs = rw.rollout(found.scene, found.model, points, durations=0.3, parameters={"v": v}, threads=1)
        alive = runs.outcome != rw.Code.INVALID
        assert not (runs.outcome == rw.Code.GOAL).any()
        points = np.where(alive[:, None], runs.final, points)
    assert len(points) > 500


def test_kept_and_read_again(tmp_path: Path) -> None:
    found = rw.doomed_set(
        pushing(), rw.KINEMATIC, ("p", "s"), {"v": (0.2, 1.0)}, box={"s": (0.0, 2.5)}, cells=20, threads=1,
        out=tmp_path,
    )  # fmt: skip
    again = rw.load_doomed_set(tmp_path, pushing())
    assert (again.cells == found.cells).all() and again.volumes == found.volumes
    assert again.inputs == found.inputs and again.steps == found.steps and again.holds_on(rw.KINEMATIC)[0]
    assert found.classify(np.array([[0.5, 9.0], [0.5, 2.3], [1.9, 0.1]])).tolist() == [
        "unknown",
        "doomed",
        "invalid",
    ]
    with pytest.raises(rw.SetError, match="holds a set of states"):
        rw.load_set(tmp_path)
    with pytest.raises(rw.SetError, match="is not the scene as it was"):
        rw.load_doomed_set(tmp_path, braking())


def test_around_and_backward() -> None:
    vertices = np.array([1.0, np.nan, 3.0, 7.0])[:, None]
    assert around(vertices, 0, True)[:, 0].tolist() == [1.0, 3.0, 7.0]
    assert around(vertices, 1, False)[:, 0].tolist() == [1.0, 1.0, 3.0]
    # A ring of five cells, one of which is blocked, each leading to the next.
    first = ((np.arange(5) + 1) % 5)[:, None, None]
    seed, allowed = np.arange(5) == 3, np.arange(5) != 1
    assert backward(seed, allowed, first, first).tolist() == [False, False, True, True, False]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"over": ("p",)}, "lacks block.s"),
        ({"over": ("p", "q")}, "unknown coordinate 'q'"),
        ({"model": rw.DYNAMIC_RIGID}, r"lacks speed\(block.s\)"),
        ({"model": rw.DYNAMIC_COMPLIANT}, "take a rigid rung"),
        ({"inputs": {"w": (0.1, 1.0)}}, "unknown parameter 'w'"),
        ({"inputs": {"v": (1.0, 0.1)}}, "must be an interval"),
        ({"box": {}}, "block.s needs an interval"),
        ({"cells": 1}, "cells: 2 to 4096"),
        ({"solutions": "some"}, "solutions: must be slowest, or any"),
        ({"strides": ()}, "strides must lie"),
    ],
)
def test_wrong_input(change: dict[str, Any], words: str) -> None:
    request: dict[str, Any] = {
        "scene": pushing(), "model": rw.KINEMATIC, "over": ("p", "s"), "inputs": {"v": (0.2, 1.0)},
        "box": {"s": (0.0, 2.5)}, "cells": 8, "threads": 1,
    } | change  # fmt: skip
    with pytest.raises((rw.SetError, rw.SceneError), match=words):
        rw.doomed_set(**request)
