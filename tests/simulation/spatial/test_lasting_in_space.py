"""Conditions that must hold for a time, and rest, in space: as in the plane."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, G, free, run, world
from .rungs import MOVING, named

STEP = 2e-3
DRIVEN = '<body name="p"><joint name="j" type="slide"/><geom size=".1" mass="1"/></body>'
INPUT = {"parameters": {"u": {"default": 1.0}}, "inputs": ["u"], "speeds": {"p.j": "u"}}


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_a_way_through_a_region_is_timed_from_where_it_enters(
    make: Make, rung: Rung, tol: float | None
) -> None:
    """As in the plane: a time is over at a / v + T, if the region is as long."""
    for v, a, b, part in ((1.0, 0.1234, 0.2, 0.5), (-0.7, 0.05, 0.1, 0.9), (0.5, 0.03, 0.04, 0.02)):
        within = f"abs(p.j) >= {a} and abs(p.j) <= {b}"
        lasts = (b - a) / abs(v)
        for factor, met in ((part, True), (1.1, False)):
            scene = make(
                world(DRIVEN, before=NO_GRAVITY), speeds={"p.j": v}, step=STEP, duration=0.4,
                goal=f"{within} for {factor * lasts!r}",
            )  # fmt: skip
            found = run(scene, rung, tol=tol)
            assert found.ok == met
            assert not met or found.time == pytest.approx(a / abs(v) + factor * lasts, abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_what_is_interrupted_begins_anew(make: Make, rung: Rung, tol: float | None) -> None:
    """The place goes up to 0.3 and back, again and again: above 0.2 for 0.2 of each 0.6."""
    scene = make(
        world(DRIVEN, before=NO_GRAVITY), step=STEP, duration=2.0, goal="p.j >= 0.2 for 0.19", **INPUT
    )
    later = scene.changed(goal="p.j >= 0.2 for 0.21")
    twice = scene.changed(goal="(p.j >= 0.2 for 0.1) and t > 0.7")
    ways = [{"inputs": {"u": u}, "duration": 0.3} for u in (1.0, -1.0, 1.0, -1.0)]
    assert run(scene, rung, tol=tol, inputs=ways).time == pytest.approx(0.39, abs=1e-9)
    assert not run(later, rung, tol=tol, inputs=ways).ok
    assert run(twice, rung, tol=tol, inputs=ways).time == pytest.approx(0.9, abs=1e-9)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_a_segment_ends_once_its_condition_has_held(make: Make, rung: Rung, tol: float | None) -> None:
    scene = make(world(DRIVEN, before=NO_GRAVITY), step=STEP, duration=2.0, **INPUT)
    segments = [
        {"duration": 1.0, "until": "p.j >= 0.1234 for 0.1"},
        {"inputs": {"u": -1.0}, "duration": 1.0, "until": "p.j >= 0.1234 for 0.05"},
        {"inputs": {"u": 0.0}, "duration": 0.5, "until": "rest(p) for 0.123"},
    ]
    found = run(scene, rung, tol=tol, inputs=segments)
    assert found.time == pytest.approx(0.2234 + 0.05 + 0.123, abs=1e-9)
    assert found.final["p"]["j"] == pytest.approx(0.1734, abs=1e-9)
    short = run(scene, rung, tol=tol, inputs=[{"duration": 0.2, "until": "p.j >= 0.1234 for 0.1"}])
    assert short.outcome.name == "timeout" and "did not hold within 0.2" in short.reason
    state = next(each for each in found.states if each.time > 0.24)
    assert run(scene, rung, tol=tol, state=state).time == found.time


@pytest.mark.parametrize("tol", [None, 1e-3])
def test_the_turning_point_of_a_bounce_is_no_rest(make: Make, tol: float | None) -> None:
    """The ball of the plane: slow where it turns, at rest once its bounces are over."""
    e, height = 0.4, 0.1
    over = math.sqrt(2.0 * height / G) * (1.0 + e) / (1.0 - e)
    away = "t > 0.1 and b.z < 0.19"

    def scene(goal: str) -> rw.Scene:
        made = make(
            world(FLOOR, free("b", f"0 0 {0.1 + height}", 'size=".1"')), step=STEP, tolerance=2e-4,
            contacts=[{"restitution": e}], duration=1.0, goal=goal,
        )  # fmt: skip
        return made

    slow = run(scene(f"{away} and rest(b)"), rw.DYNAMIC_RIGID, tol=tol)
    assert slow.ok and slow.final["b"]["z"] > 0.11
    rests = run(scene(f"{away} and rest(b) for 0.1"), rw.DYNAMIC_RIGID, tol=tol)
    assert rests.ok and rests.time == pytest.approx(over + 0.1, abs=0.1)
    assert rests.final["b"]["z"] == pytest.approx(0.1, abs=1e-4)
    assert rw.ask(rests.scene, "goal", [rests.state, rests.states[0]]).holds.tolist() == [True, False]


def test_rest_counts_turns_by_the_reach_of_the_part(make: Make) -> None:
    """A box whose centre moves at (0.3, 0, 0.4) and that turns by (0, 0.6, 0.8) about it: its corners are
    0.3 away."""
    box = free("b", "0 0 1", 'type="box" size=".2 .1 .2"')
    names = ("b.x", "b.z", "b.ry", "b.rz")
    start = {"velocities": dict(zip(names, (0.3, 0.4, 0.6, 0.8), strict=True))}
    for factor, still in ((1.01, True), (0.99, False)):
        tolerance = factor * STEP * (0.5 + 0.3)
        scene = make(
            world(box, before=NO_GRAVITY), step=STEP, tolerance=tolerance, start=start, duration=0.1,
            goal="rest(b) for 0.05",
        )  # fmt: skip
        assert run(scene, rw.DYNAMIC_RIGID).ok == still
        first = rw.State.of(scene)
        assert rw.ask(scene, "rest(b)", first).values[0, 0] == pytest.approx(tolerance * (1.0 - 1.0 / factor))
    hinge = '<joint name="h" type="hinge" axis="0 1 0"/>'
    arm = f'<body name="a">{hinge}<geom size=".1" pos=".4 0 0" mass="1"/></body>'
    scene = make(world(arm, before=NO_GRAVITY), step=STEP, tolerance=1e-3, duration=0.1)
    rate = np.array([[0.0, 0.7]])
    assert rw.ask(scene, "rest(a)", rate).values[0, 0] == pytest.approx(1e-3 - STEP * 0.7 * (0.4 + 0.1))


def test_a_time_that_is_none_is_named(make: Make) -> None:
    scene = make(world(DRIVEN, before=NO_GRAVITY), goal="p.j > 1 for u", duration=1.0, **INPUT)
    found = rw.simulate(scene, rw.KINEMATIC, parameters={"u": -1.0})
    assert found.outcome.name == "invalid"
    assert found.reason == "goal: the time after 'for' must be finite and >= 0, not -1"
    with pytest.raises(rw.SceneError, match=r"^goal: 'for' needs a time"):
        make(world(DRIVEN, before=NO_GRAVITY), goal="p.j > 1 for ")
