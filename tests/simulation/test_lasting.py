"""Conditions that must hold for a time, and rest: when they are met, on every rung, at all steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

G = 10.0
MOVING = rw.LADDER[1:]
DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}
TOLS = [None, 1e-3]
LONG = 3.0


def led(speed: str | float, goal: str, sign: float = 1.0, **fields: Any) -> rw.Scene:
    """A robot that is led along x, or against it, beside a part that nothing touches."""
    drive = {"kind": "speed", "speed": f"{sign} * ({speed})"}
    robot = {"role": "robot", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0}
    robot |= {
        "motion": {"kind": "free"},
        "coordinates": {"x": {"drive": drive}, "y": {"drive": drive | {"speed": 0}}},
    }
    robot["coordinates"] |= {"angle": {"drive": {"kind": "speed", "speed": 0}}}
    part = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0, "pose": {"y": 9.0}}
    part |= {"motion": {"kind": "slide", "axis": [1, 0]}, "coordinates": {"s": {"damping": 1.0}}}
    data = {"name": "led", "bodies": {"robot": robot, "part": part}, "duration": LONG, "step": 1e-2}
    data |= {"contacts": [{"between": ["robot", "part"]}], "tolerance": 1e-3}
    return rw.load(data | {"goal": goal.replace("X", f"({sign} * robot.x)")} | fields)


def ball(goal: str, e: float = 0.6, height: float = 0.5, **fields: Any) -> rw.Scene:
    """A ball that falls on a floor from this height, and bounces."""
    body = {
        "role": "object",
        "shape": {"kind": "disc", "radius": 0.1},
        "mass": 1.0,
        "motion": {"kind": "free"},
    }
    bodies = {"part": body | {"pose": {"y": 0.1 + height}}, "floor": FLOOR}
    contact = {"between": ["part", "floor"], "restitution": e, "stiffness": 1e6, "damping": 1e4}
    data = {"name": "ball", "bodies": bodies, "contacts": [contact], "gravity": [0, -G], "goal": goal}
    return rw.load(data | {"duration": 4.0, "step": 1e-3, "tolerance": 1e-4} | fields)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("tol", TOLS)
def test_a_way_through_a_region_is_timed_from_where_it_enters(rung: rw.Rung, tol: float | None) -> None:
    """At a speed v a robot is within a region from a / v to b / v: a time T less than (b - a) / v is over at
    a / v + T, and no greater one; to rounding, at all steps, and on the mirrored way."""
    rng = np.random.default_rng(5)
    for k in range(6):
        v, a = rng.uniform(0.3, 1.2), rng.uniform(0.05, 0.2)
        b, step, sign = a + rng.uniform(0.05, 0.2), 1e-2 / (1 + k % 2), (1.0, -1.0)[k % 2]
        within = f"X >= {a!r} and X <= {b!r}"
        for part in (0.02, 0.3, 0.9):
            lasts = part * (b - a) / v
            run = rw.simulate(led(v, f"{within} for {lasts!r}", sign, step=step), rung, tol=tol)
            assert run.ok and run.time == pytest.approx(a / v + lasts, abs=1e-9)
        run = rw.simulate(led(v, f"{within} for {1.1 * (b - a) / v!r}", sign, step=step), rung, tol=tol)
        assert not run.ok


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("tol", TOLS)
def test_what_is_interrupted_begins_anew(rung: rw.Rung, tol: float | None) -> None:
    """x = sin(w t) is above 1/2 for two thirds of each half period, and below 1.9 at all times."""
    w = 6.0
    once, period = math.asin(0.5) / w, 2.0 * math.pi / w
    above = (math.pi - 2.0 * math.asin(0.5)) / w
    cases = {
        f"X >= 0.5 for {0.9 * above!r}": once + 0.9 * above,
        f"X >= 0.5 for {1.1 * above!r}": None,
        f"(X >= 0.5 for {0.5 * above!r}) and t > {period + once + 0.1 * above!r}": period
        + once
        + 0.5 * above,
        f"(X >= 0.5 for {0.5 * above!r}) for {0.3 * above!r}": once + 0.8 * above,
        "X < 1.9 for 1": 1.0,
        f"not (X >= 0.5 for {0.5 * above!r}) for 1.5": None,
        "X >= 0.5 for 0": once,
    }
    for goal, time in cases.items():
        run = rw.simulate(led(f"{w} * cos({w} * t)", goal, step=2e-3), rung, tol=tol)
        assert run.ok == (time is not None), goal
        if time is not None:
            # Without `for` a condition is known to a nominal step.
            assert run.time == pytest.approx(time, abs=2.1e-3 if goal.endswith("for 0") else 1e-4), goal


@pytest.mark.parametrize("rung", DYNAMIC, ids=lambda rung: rung.name)
@pytest.mark.parametrize("tol", TOLS)
@pytest.mark.parametrize("step", [4e-3, 2e-3])
def test_a_fall_through_a_zone_is_timed_as_the_run_has_it(
    rung: rw.Rung, tol: float | None, step: float
) -> None:
    """A ball that falls from 2.1 is between 1.5 and 0.7 from its own entry on: that on the straight line
    between its frames."""
    zone = "part.y <= 1.5 and part.y >= 0.7"
    enters, leaves = (math.sqrt(2.0 * (2.1 - y) / G) for y in (1.5, 0.7))
    for part in (0.01, 0.7):
        lasts = part * (leaves - enters)
        run = rw.simulate(
            ball(f"{zone} for {lasts!r}", e=0.0, height=2.0, step=step), rung, tol=tol, stride=1
        )
        y = run.trajectory.position.sel(coordinate="part.y").values
        t = run.trajectory.time.values
        k = int(np.argmax(y <= 1.5))
        entered = t[k - 1] + (t[k] - t[k - 1]) * (y[k - 1] - 1.5) / (y[k - 1] - y[k])
        assert run.ok and run.time == pytest.approx(entered + lasts, abs=1e-9)
        assert entered == pytest.approx(enters, abs=step)
    run = rw.simulate(
        ball(f"{zone} for {1.1 * (leaves - enters)!r}", e=0.0, height=2.0, step=step), rung, tol=tol
    )
    assert not run.ok


@pytest.mark.parametrize("tol", TOLS)
def test_the_turning_point_of_a_bounce_is_no_rest(tol: float | None) -> None:
    """A ball that bounces is slow where it turns; it rests, and stays, once its bounces are over: a time of
    sqrt(2 h / g) (1 + e) / (1 - e) after it was let go."""
    e, height = 0.5, 0.2
    over = math.sqrt(2.0 * height / G) * (1.0 + e) / (1.0 - e)
    first = math.sqrt(2.0 * height / G) * (1.0 + e)
    away = "t > 0.1 and part.y < 0.29"
    turns = rw.simulate(ball(f"{away} and rest(part)", e, height), rw.DYNAMIC_RIGID, tol=tol)
    assert turns.ok and turns.time == pytest.approx(first, abs=0.02)
    assert turns.final["part"]["y"] > 0.14, "slow in the air"
    rests = rw.simulate(ball(f"{away} and rest(part) for 0.1", e, height), rw.DYNAMIC_RIGID, tol=tol)
    assert rests.ok and rests.time == pytest.approx(over + 0.1, abs=0.05)
    assert rests.final["part"]["y"] == pytest.approx(0.1, abs=1e-4)
    high = rw.simulate(ball("part.y >= 0.149 and t > 0.25 for 0.1", e, height), rw.DYNAMIC_RIGID, tol=tol)
    assert not high.ok


def test_rest_counts_angles_by_the_reach_of_the_part() -> None:
    """rest(part): in a nominal step of the scene no point moves farther than the tolerance."""
    box = {"role": "object", "shape": {"kind": "box", "width": 0.8, "height": 0.6}, "mass": 1.0}
    moving: dict[str, tuple[dict[str, Any], dict[str, float], float]] = {
        "free": ({"kind": "free"}, {"x": 0.03, "y": -0.04, "angle": 0.1}, 0.05 + 0.5 * 0.1),
        "slide": ({"kind": "slide", "axis": [0, 1]}, {"s": -0.2}, 0.2),
        "hinge": ({"kind": "hinge", "pivot": [-0.3, 0.4]}, {"angle": 0.2}, 0.2 * (0.5 + 0.5)),
    }
    for motion, speeds, way in moving.values():
        part = box | {"motion": motion, "coordinates": {name: {"speed": v} for name, v in speeds.items()}}
        for factor, still in ((1.01, True), (0.99, False)):
            data = {"name": "r", "bodies": {"part": part, "floor": FLOOR | {"pose": {"y": -9}}}, "step": 0.02}
            data |= {"tolerance": factor * way * 0.02, "duration": 0.1, "goal": "rest(part) for 0.05"}
            made = rw.load(data | {"contacts": [{"between": ["part", "floor"]}]})
            for own in (None, 0.005):
                run = rw.simulate(made, rw.DYNAMIC_RIGID, step=own)
                assert run.ok == still
            rate = np.concatenate([np.zeros(len(speeds)), list(speeds.values())])[None]
            asked = rw.ask(made, "rest(part)", rate)
            assert asked.holds[0] == still and asked.units == ("length",)
            assert asked.values[0, 0] == pytest.approx((factor - 1.0) * way * 0.02)


@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
def test_a_segment_ends_once_its_condition_has_held(rung: rw.Rung) -> None:
    """Times count from where a segment begins; one whose condition does not hold long enough runs out."""
    fields = {"parameters": {"u": {"default": 1.0}}, "inputs": ["u"]}
    scene = led("u", "t > 99", **fields)
    for tol in TOLS:
        segments = [
            {"duration": 1.0, "until": "robot.x >= 0.1234 for 0.3"},
            {"inputs": {"u": -1.0}, "duration": 1.0, "until": "robot.x >= 0.1234 for 0.2"},
            {"inputs": {"u": 0.5}, "duration": 1.0, "until": "(robot.x < 9 for 0.05) and robot.x > 0.3"},
            {"inputs": {"u": 0.0}, "duration": 0.5, "until": "rest(robot) for 0.123"},
        ]
        run = rw.simulate(scene, rung, tol=tol, inputs=segments)
        ends = [0.4234, 0.6234, 0.6234 + (0.3 - 0.2234) / 0.5, 0.0]
        ends[3] = ends[2] + 0.123
        assert run.time == pytest.approx(ends[3], abs=2e-5) and run.outcome.name == "missed"
        assert run.final["robot"]["x"] == pytest.approx(0.3, abs=2e-5)
        short = rw.simulate(
            scene, rung, tol=tol, inputs=[{"duration": 0.4, "until": "robot.x >= 0.1234 for 0.3"}]
        )
        assert short.outcome.name == "timeout" and "did not hold within 0.4" in short.reason


@pytest.mark.parametrize("tol", TOLS)
def test_runs_go_on_with_the_times_of_their_states(tol: float | None) -> None:
    scene = ball("rest(part) and t > 0.1 for 0.1", 0.5, 0.1)
    whole = rw.simulate(scene, rw.DYNAMIC_RIGID, tol=tol, stride=1)
    assert whole.ok
    late = whole.states[-2]
    for state in (late, whole.states[len(whole.states) // 3]):
        again = rw.simulate(scene, rw.DYNAMIC_RIGID, tol=tol, state=state)
        assert again.time == whole.time and np.array_equal(again.state.q, whole.state.q)
    by_hand = rw.State.of(scene, {"part.y": late["part.y"]}, time=late.time)
    anew = rw.simulate(scene, rw.DYNAMIC_RIGID, tol=tol, state=by_hand)
    assert anew.ok and anew.time == pytest.approx(late.time + 0.1, abs=1e-9)
    answers = rw.ask(scene, "goal", [whole.state, late])
    assert answers.holds.tolist() == [True, False]
    assert answers.terms == ("rest(part)", "t > 0.1", "rest(part) and t > 0.1 for 0.1")
    assert answers.units == ("length", "time", "time")
    assert answers.values[1, 2] == pytest.approx(late.time - whole.time, abs=1e-9)
    assert not rw.ask(scene, "goal", by_hand).holds[0]
    assert rw.ask(scene, "goal", by_hand).values[0, 2] == -0.1


def test_many_runs_say_what_one_says() -> None:
    scene = led(
        "v", "X >= 0.2 and X <= 0.5 for wait", parameters={"v": {"default": 1.0}, "wait": {"default": 0.1}}
    )
    points = np.array([[v, wait] for v in (0.5, 1.0, 2.0) for wait in (0.0, 0.1, 0.25)])
    found = rw.Batch(scene, rw.KINEMATIC, ("v", "wait")).run(points)
    rolled = rw.rollout(scene, rw.KINEMATIC, parameters={"v": points[:, 0], "wait": points[:, 1]}, tol=None)
    for i, (v, wait) in enumerate(points.tolist()):
        run = rw.simulate(scene, rw.KINEMATIC, parameters={"v": v, "wait": wait})
        assert found.outcomes[i] == rolled.outcomes[i] == run.outcome.name
        assert rolled.time[i] == run.time
        assert run.ok == (wait < 0.3 / v)
        if not run.ok:  # what was lacking of the time, at most
            assert found.margin[i] == pytest.approx(0.3 / v - wait, abs=2e-2)
    guarded = rw.rollout(scene, rw.KINEMATIC, durations=[1.0], until=["robot.x >= 0.3 for 0.1"], tol=None)
    assert guarded.time[0] == pytest.approx(0.3)


def test_a_run_at_rest_waits_for_what_holds() -> None:
    """A run in which nothing moves any more would end as missed; a time that is not over keeps it going."""
    for goal, time in (("X < 1 for 2.5", 2.5), ("X > 1 for 2.5", None)):
        run = rw.simulate(led(0.0, goal), rw.KINEMATIC)
        assert run.ok == (time is not None)
        assert time is None or run.time == pytest.approx(time, abs=1e-9)
    unsafe = rw.simulate(led(1.0, "X > 2", unsafe="robot.x > 0.5 for 0.25"), rw.KINEMATIC)
    assert unsafe.outcome.name == "unsafe" and unsafe.time == pytest.approx(0.75, abs=1e-9)


def test_long_steps_see_what_holds_on_their_way() -> None:
    """A zone that a step of error control would leap over is seen, and so is what interrupts a time."""
    for rung in (rw.KINEMATIC, rw.DYNAMIC_RIGID):
        run = rw.simulate(led(1.0, "X > 0.5 and X < 0.56 for 0.05", step=1e-3), rung, tol=1e-2)
        assert run.ok and run.time == pytest.approx(0.55, abs=1e-9)
        assert run.steps < 0.5 * run.time / 1e-3, "steps are longer than nominal ones"
        gap = "X < 0.5 or X > 0.53"
        run = rw.simulate(led(1.0, f"{gap} for 0.6", step=1e-3), rung, tol=1e-2)
        assert run.ok and run.time == pytest.approx(1.13, abs=1e-9)


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("y", [1.5, 1.31, 1.1])
def test_long_steps_are_shortened_where_something_begins_to_hold(tol: float, y: float) -> None:
    """A ball in free fall is on its parabola at the ends of centred steps: the time of its entry is known to
    the bend of its way within a nominal step, however long steps are."""
    run = rw.simulate(ball(f"part.y <= {y} for 0.05", 0.0, 2.0, step=2e-3), rw.DYNAMIC_RIGID, tol=tol)
    enters = math.sqrt(2.0 * (2.1 - y) / G)
    assert run.time == pytest.approx(enters + 0.05, abs=3e-6)
    assert run.steps < 40


@pytest.mark.parametrize("tol", TOLS)
def test_steps_that_are_taken_back_take_back_what_they_noted(tol: float | None) -> None:
    """In one step a part leaves a place where it was for long enough, and comes to another: the step is taken
    back to where it has been there for a moment, which is before it leaves."""
    run = rw.simulate(led(1.0, "(X <= 0.505 for 0.2) and (X >= 0.501 for 0.001)"), rw.KINEMATIC, tol=tol)
    assert run.ok and run.time == pytest.approx(0.502, abs=1e-9)
    run = rw.simulate(led(1.0, "(X <= 0.505 for 0.5) and (X >= 0.501 for 0.001)"), rw.KINEMATIC, tol=tol)
    assert run.ok and run.time == pytest.approx(0.502, abs=1e-9)
    run = rw.simulate(led(1.0, "(X <= 0.5015 for 0.2) and (X >= 0.501 for 0.001)"), rw.KINEMATIC, tol=tol)
    assert not run.ok


@pytest.mark.parametrize("tol", TOLS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_box_that_slides_to_rest(sign: float, tol: float | None) -> None:
    """It is slower than tolerance / step from (v - tolerance / step) / (mu g) on, and rests for as long as
    asked; a region that it crosses faster than T is none, one in which it comes to rest is."""
    v, mu, lasts = 1.0, 0.4, 0.2
    box = {"role": "object", "shape": {"kind": "box", "width": 0.4, "height": 0.1}, "mass": 1.0}
    box |= {"motion": {"kind": "free"}, "pose": {"y": 0.05}, "coordinates": {"x": {"speed": sign * v}}}
    data = {"name": "box", "bodies": {"part": box, "floor": FLOOR}, "gravity": [0, -G], "duration": 1.0}
    data |= {"contacts": [{"between": ["part", "floor"], "friction": mu}], "step": 1e-3, "tolerance": 1e-4}

    def met(goal: str) -> float | None:
        run = rw.simulate(data | {"goal": goal.replace("X", f"({sign} * part.x)")}, rw.DYNAMIC_RIGID, tol=tol)
        return run.time if run.ok else None

    slow, at = (v - 0.1) / (mu * G), 0.5 * v**2 / (mu * G)
    assert met(f"rest(part) for {lasts}") == pytest.approx(slow + lasts, abs=2e-3)
    assert met(f"X >= {0.4 * at} and X <= {0.6 * at} for {lasts}") is None
    enters = (v - math.sqrt(v**2 - 2.0 * mu * G * 0.8 * at)) / (mu * G)
    assert met(f"X >= {0.8 * at} for {lasts}") == pytest.approx(
        enters + lasts, abs=3e-3 if tol is None else 2e-2
    )
