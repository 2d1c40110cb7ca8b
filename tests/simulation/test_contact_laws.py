"""Laws of contact that scenes name beside the common ones: adhesion, restitution that falls with speed, and
static above kinetic friction, each against what is known of it in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.result import Run
from tests.simulation.scaling import Units, scaled

G = 10.0
LOADED = [rung for rung in rw.LADDER if rung.moves and rung.loads]
MOMENTUM = [rung for rung in LOADED if rung.inertia > 0.0]
on_loaded = pytest.mark.parametrize("rung", LOADED, ids=lambda rung: rung.name)


def on_floor(body: dict[str, Any], law: dict[str, Any], turn: float = 0.0, **options: Any) -> dict[str, Any]:
    """A free body of mass 1 above a floor, and gravity; all of it turned by `turn` about the origin."""
    c, s = math.cos(turn), math.sin(turn)
    x, y = body.get("pose", {}).get("x", 0.0), body["pose"]["y"]
    own = {"role": "object", "mass": 1.0, "motion": {"kind": "free"}} | body
    own["pose"] = {"x": c * x - s * y, "y": s * x + c * y, "angle": turn}
    floor = {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [-s, c]}}
    contact = {"between": ["body", "floor"], "stiffness": 1e6, "damping": 1e3} | law
    world = {"name": "laws", "gravity": [s * G, -c * G], "duration": 1.0, "step": 1e-3, "tolerance": 1e-6}
    return world | {"bodies": {"body": own, "floor": floor}, "contacts": [contact]} | options


def disc(height: float = 0.0, **fields: Any) -> dict[str, Any]:
    return {"shape": {"kind": "disc", "radius": 0.1}, "pose": {"y": 0.1 + height}} | fields


def box(**fields: Any) -> dict[str, Any]:
    return {"shape": {"kind": "box", "width": 1.0, "height": 0.02}, "pose": {"y": 0.01}} | fields


def of(run: Run, coordinate: str, what: str = "position") -> Any:
    return getattr(run.trajectory, what).sel(coordinate=coordinate).values


def moves_at(run: Run, coordinate: str, least: float) -> float:
    """The time from which on a coordinate has moved by more than `least`."""
    moved = np.abs(of(run, coordinate) - of(run, coordinate)[0]) > least
    assert moved.any()
    return float(run.trajectory.time.values[np.argmax(moved)])


# Adhesion.


@pytest.mark.few(3)
@pytest.mark.parametrize("turn", [math.pi, 0.5 * math.pi])
@pytest.mark.parametrize("part", [0.99, 1.01])
@on_loaded
def test_a_ball_hangs_until_it_weighs_more_than_its_contact_holds(
    rung: Rung, part: float, turn: float
) -> None:
    """Floors that are ceilings and walls; without friction the ball falls along a wall, and not off it."""
    drag = {"x": {"damping": 5.0}, "y": {"damping": 5.0}}
    data = on_floor(disc(coordinates=drag), {"adhesion": G / part}, turn, duration=0.1)
    data["gravity"] = [-math.sin(turn) * G, math.cos(turn) * G]
    run = rw.simulate(data, rung)
    away = -math.sin(turn) * (of(run, "body.x") - of(run, "body.x")[0])
    away += math.cos(turn) * (of(run, "body.y") - of(run, "body.y")[0])
    if part < 1.0:
        assert np.abs(away).max() <= 1.1 * G / part / 1e6
    else:
        assert away[-1] > 1e-3
        if rung.inertia == 0.0:  # off the floor all of the weight drags it
            speed = math.hypot(of(run, "body.x", "velocity")[-1], of(run, "body.y", "velocity")[-1])
            assert speed == pytest.approx(G / 5.0)


def test_the_kinematic_rung_knows_no_adhesion() -> None:
    plain, sticky = (
        rw.simulate(on_floor(disc(), law, duration=0.01), rw.KINEMATIC) for law in ({}, {"adhesion": 1e3})
    )
    assert np.array_equal(of(plain, "body.y"), of(sticky, "body.y"))


@on_loaded
def test_a_spring_pulls_a_part_off_when_it_holds_its_weight_and_the_pull(rung: Rung) -> None:
    stiffness, pace, pull = 1e3, 0.05, 5.0
    servo = {"kind": "servo", "stiffness": stiffness, "damping": 50.0, "target": f"0.1 + {pace} * t"}
    data = on_floor(
        disc(coordinates={"y": {"drive": servo}}), {"adhesion": pull, "adhesion_range": 1e-5}, duration=0.5
    )
    run = rw.simulate(data, rung, step=5e-4)
    late = 0.015 if rung.inertia > 0.0 else 50.0 / stiffness  # until it is off, and what the damper holds
    assert moves_at(run, "body.y", 2e-5) == pytest.approx((G + pull) / stiffness / pace, abs=0.004 + late)


@pytest.mark.parametrize("side", [0.98, 1.02])
@on_loaded
def test_friction_of_what_adheres_knows_the_pull(rung: Rung, side: float) -> None:
    """A plate touches at two points, each of which pulls."""
    push = side * 0.5 * (G + 2.0 * 20.0)
    plate = box(force=[push, 0.0], coordinates={"x": {"damping": 1.0}})
    run = rw.simulate(on_floor(plate, {"adhesion": 20.0, "friction": 0.5}, duration=0.1), rung)
    slid = of(run, "body.x")[-1]
    assert (slid > 1e-4) == (side > 1.0)


def test_leaving_takes_the_work_of_the_pull_over_its_range() -> None:
    """A ball thrown upwards from the floor, without gravity, is slower by the work; too slow, it stays."""
    pull, reach = 2.0, 0.01
    for speed in (0.1, 0.25, 0.5):
        ball = disc(coordinates={"y": {"speed": speed}})
        data = on_floor(ball, {"adhesion": pull, "adhesion_range": reach}, gravity=[0, 0], duration=0.5)
        run = rw.simulate(data, rw.DYNAMIC_RIGID, step=1e-4)
        left = speed**2 - 2.0 * pull * reach
        assert of(run, "body.y", "velocity")[-1] == pytest.approx(math.sqrt(max(left, 0.0)), abs=2e-3)
        kinetic = 0.5 * of(run, "body.y", "velocity")[-1] ** 2 - 0.5 * speed**2
        works = run.trajectory.load_work.values[-1] + run.trajectory.contact_work.values[-1]
        assert kinetic == pytest.approx(works, abs=1e-9)


@pytest.mark.parametrize("part", [0.97, 1.03])
@on_loaded
def test_a_finger_lifts_what_sticks_to_it_more_than_to_the_floor(rung: Rung, part: float) -> None:
    """A grain of 20 micrometres: its weight, 1e-10 N, is nothing beside adhesion, and counts all the same."""
    density, radius, floor = 2500.0, 2e-5, 2e-7
    weight = density * math.pi * radius**2 * G
    grain = {
        "role": "object", "shape": {"kind": "disc", "radius": radius}, "density": density,
        "pose": {"y": radius}, "motion": {"kind": "free"},
    }  # fmt: skip
    finger = {
        "role": "robot", "shape": {"kind": "box", "width": 1e-4, "height": 1e-5},
        "pose": {"y": 2 * radius + 5e-6}, "motion": {"kind": "slide", "axis": [0, 1]},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1e-5}}},
    }  # fmt: skip
    common = {"adhesion_range": 1e-8, "stiffness": 100.0, "damping": 1e-3}
    data = {
        "name": "pick", "gravity": [0, -G], "tolerance": 1e-8, "duration": 1.0, "step": 1e-3,
        "bodies": {"grain": grain, "finger": finger, "floor": on_floor(disc(), {})["bodies"]["floor"]},
        "contacts": [
            {"between": ["grain", "floor"], "adhesion": floor} | common,
            {"between": ["grain", "finger"], "adhesion": part * (floor + weight)} | common,
        ],
        "goal": "grain.y >= 2.2e-5",
    }  # fmt: skip
    assert rw.simulate(data, rung).outcome == ("goal" if part > 1.0 else "timeout")


@pytest.mark.few(4)
@pytest.mark.parametrize("accuracy", [{"step": 1e-3}, {"step": 1e-2}, {"tol": 1e-3}, {"tol": 1e-6}], ids=str)
@pytest.mark.parametrize("speed", [0.04, 0.1])
@pytest.mark.parametrize("rung", MOMENTUM, ids=lambda rung: rung.name)
def test_a_short_range_takes_its_work_at_every_step(
    rung: Rung, speed: float, accuracy: dict[str, Any]
) -> None:
    """In a step of 1e-3 the pull would stop a ball at a speed of 1."""
    ball = disc(coordinates={"y": {"speed": speed}})
    data = on_floor(ball, {"adhesion": 1e3}, gravity=[0, 0], duration=0.1)
    left = math.sqrt(max(speed**2 - 2.0 * 1e3 * 1e-6, 0.0))
    assert of(rw.simulate(data, rung, **accuracy), "body.y", "velocity")[-1] == pytest.approx(left, abs=1e-3)


@pytest.mark.parametrize("tol", [None, 1e-3, 1e-5])
def test_what_is_gained_where_the_pull_begins_is_lost_where_it_ends(tol: float | None) -> None:
    """A ball falls on a floor that pulls, without gravity, and bounces."""
    pull, reach, e = 5.0, 0.01, 0.5
    ball = disc(0.05, coordinates={"y": {"speed": -1.0}})
    law = {"adhesion": pull, "adhesion_range": reach, "restitution": e}
    run = rw.simulate(on_floor(ball, law, gravity=[0, 0], duration=0.2), rw.DYNAMIC_RIGID, tol=tol)
    work = 2.0 * pull * reach
    expected = math.sqrt(e**2 * (1.0 + work) - work)
    assert of(run, "body.y", "velocity")[-1] == pytest.approx(expected, abs=2e-3)


@pytest.mark.few(3)
@pytest.mark.parametrize("accuracy", [{"step": 1e-3}, {"step": 5e-4}, {"tol": 1e-4}], ids=str)
@on_loaded
def test_a_ball_sticks_to_a_ball_that_it_slides_around(rung: Rung, accuracy: dict[str, float]) -> None:
    """A step along the tangent leaves a gap beyond the range, and is not what parts them."""
    drag = 0.0 if rung.inertia > 0.0 else 10.0
    pose = {"x": 1.1 * math.sin(0.2), "y": 1.1 * math.cos(0.2)}
    body = disc(pose=pose, coordinates={c: {"damping": drag} for c in ("x", "y")})
    data = on_floor(body, {"adhesion": 100.0}, duration=1.4)
    data["bodies"]["floor"]["shape"] = {"kind": "disc", "radius": 1.0}
    run = rw.simulate(data, rung, **accuracy)
    away = np.hypot(of(run, "body.x"), of(run, "body.y")) - 1.1
    assert np.abs(away).max() < 3e-4
    assert of(run, "body.y").min() < (-1.0 if rung.inertia > 0.0 else 1.0)


# Restitution that falls with speed.


def bounced(speed: float, law: dict[str, Any], turn: float = 0.0) -> float:
    """The speed after an impact at `speed`, without gravity."""
    v = {"x": {"speed": math.sin(turn) * speed}, "y": {"speed": -math.cos(turn) * speed}}
    data = on_floor(disc(0.05, coordinates=v), law, turn, gravity=[0, 0], duration=0.1 / speed)
    run = rw.simulate(data, rw.DYNAMIC_RIGID, step=1e-3 / speed)
    return float(-math.sin(turn) * of(run, "body.x", "velocity")[-1]) + float(
        math.cos(turn) * of(run, "body.y", "velocity")[-1]
    )


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_restitution_falls_where_the_material_yields(turn: float) -> None:
    """By the fourth root of the speed above the yield speed; below it is as it was."""
    law = {"restitution": 0.8, "yield_speed": 0.5}
    for speed in (0.1, 0.49, 0.51, 1.0, 8.0):
        expected = 0.8 * speed * min(1.0, (speed / 0.5) ** -0.25)
        assert bounced(speed, law, turn) == pytest.approx(expected, rel=1e-9)


def test_a_yield_speed_that_is_not_reached_changes_no_bit() -> None:
    plain = bounced(1.0, {"restitution": 0.8})
    assert bounced(1.0, {"restitution": 0.8, "yield_speed": 1.01}) == plain
    assert bounced(1.0, {"restitution": 0.8, "yield_speed": "inf"}) == plain


def test_what_yields_is_the_relative_motion() -> None:
    """Two balls of one mass that meet: each has half of the approach."""
    ball = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0}
    ball["motion"] = {"kind": "slide", "axis": [1, 0]}
    bodies = {
        name: ball | {"pose": {"x": 0.2 * side}, "coordinates": {"s": {"speed": -side + 1.0}}}
        for name, side in (("left", -1.0), ("right", 1.0))
    }
    contact = {"between": ["left", "right"], "restitution": 1.0, "yield_speed": 0.125}
    run = rw.simulate(
        {"name": "two", "bodies": bodies, "contacts": [contact], "duration": 0.3}, rw.DYNAMIC_RIGID
    )
    v = run.trajectory.velocity.values[-1]
    assert v[1] - v[0] == pytest.approx(2.0 * (2.0 / 0.125) ** -0.25, rel=1e-9)
    assert v.sum() == pytest.approx(2.0)


# Static above kinetic friction.


RAMP = {"friction": 0.3, "static_friction": 0.5}


def pushed(law: dict[str, Any], drag: float = 0.5, side: float = 1.0) -> dict[str, Any]:
    """A thin plate on a floor, pushed by a force that grows by 2 per second."""
    plate = box(
        shape={"kind": "box", "width": 1.0, "height": 2e-3}, pose={"y": 1e-3}, force=[f"{2.0 * side} * t", 0],
        coordinates={"x": {"damping": drag}},
    )  # fmt: skip
    return on_floor(plate, law, duration=3.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@on_loaded
def test_what_sticks_starts_at_static_friction_and_goes_on_by_kinetic(rung: Rung, side: float) -> None:
    run = rw.simulate(pushed(RAMP, side=side), rung)
    assert moves_at(run, "body.x", 1e-5) == pytest.approx(0.5 * G / 2.0, abs=0.02)
    if rung.inertia == 0.0:
        assert of(run, "body.x", "velocity")[-1] == pytest.approx(
            side * (2.0 * 3.0 - 0.3 * G) / 0.5, rel=1e-3
        )
    else:
        # m v' = 2 t - mu N - c v from 2.5 on
        c, t = 0.5, 0.5
        expected = (2.0 - 2.0 / c) / c * (1.0 - math.exp(-c * t)) + 2.0 / c * t
        assert of(run, "body.x", "velocity")[-1] == pytest.approx(side * expected, rel=1e-2)


@on_loaded
def test_a_static_friction_that_is_the_kinetic_one_changes_no_bit(rung: Rung) -> None:
    plain = rw.simulate(pushed({"friction": 0.4}), rung)
    same = rw.simulate(pushed({"friction": 0.4, "static_friction": 0.4}), rung)
    assert np.array_equal(plain.trajectory.position.values, same.trajectory.position.values)


@pytest.mark.parametrize("rung", MOMENTUM, ids=lambda rung: rung.name)
def test_a_block_that_a_spring_drags_sticks_and_slips(rung: Rung) -> None:
    """It sticks for 2 D / (k V) and slips for 2 (pi - atan(D w / (k V))) / w, D the drop of friction, w the
    frequency on the spring (Rabinowicz 1958)."""
    k, pace, drop, w = 100.0, 0.2, (0.5 - 0.3) * G, 10.0
    servo = {"kind": "servo", "stiffness": k, "target": f"{pace} * t"}
    plate = box(
        shape={"kind": "box", "width": 1.0, "height": 2e-3}, pose={"y": 1e-3},
        coordinates={"x": {"drive": servo}, "angle": {"damping": 0.0}},
    )  # fmt: skip
    law = RAMP | ({"stiffness": 1e8, "damping": 1e5} if rung.compliant else {})
    run = rw.simulate(on_floor(plate, law, duration=2.5), rung, step=1e-3)
    v, t = of(run, "body.x", "velocity"), run.trajectory.time.values
    slips = v > 0.01 * pace
    starts = t[1:][slips[1:] & ~slips[:-1]]
    stick, slip = 2.0 * drop / (k * pace), 2.0 * (math.pi - math.atan(drop * w / (k * pace))) / w
    assert starts[0] == pytest.approx(0.5 * G / (k * pace), abs=5e-3)
    np.testing.assert_allclose(np.diff(starts), stick + slip, atol=0.012)


@pytest.mark.parametrize("rung", MOMENTUM, ids=lambda rung: rung.name)
def test_a_block_on_a_rising_slope_starts_at_the_static_angle(rung: Rung) -> None:
    turn = 0.05
    slope = {
        "role": "robot", "shape": {"kind": "box", "width": 4.0, "height": 0.2, "at": [0, -0.1]},
        "motion": {"kind": "hinge", "pivot": [0, 0]},
        "coordinates": {"angle": {"start": 0.4, "drive": {"kind": "speed", "speed": turn}}},
    }  # fmt: skip
    c, s = math.cos(0.4), math.sin(0.4)
    block = {
        "role": "object", "shape": {"kind": "box", "width": 0.2, "height": 0.001}, "mass": 1.0,
        "pose": {"x": -0.0005 * s, "y": 0.0005 * c, "angle": 0.4}, "motion": {"kind": "free"},
        "coordinates": {
            "x": {"speed": -0.0005 * c * turn}, "y": {"speed": -0.0005 * s * turn}, "angle": {"speed": turn},
        },
    }  # fmt: skip
    contact = {"between": ["block", "slope"], "stiffness": 1e7, "damping": 1e4} | RAMP
    data = {
        "name": "slope", "gravity": [0, -G], "bodies": {"slope": slope, "block": block},
        "contacts": [contact], "duration": 1.7, "step": 1e-3,
    }  # fmt: skip
    run = rw.simulate(data, rung)
    x, y = of(run, "block.x"), of(run, "block.y")
    start = (math.atan(0.5) - 0.4) / turn
    t, away = run.trajectory.time.values, np.hypot(x, y)
    angle = math.atan(0.5)
    pull = G * (math.sin(angle) - 0.3 * math.cos(angle))
    began = t[np.argmax(away > 0.01)] - math.sqrt(0.02 / pull)
    assert began == pytest.approx(start, abs=0.03)
    late, rises = t[-1] - began, G * (math.cos(angle) + 0.3 * math.sin(angle)) * turn
    assert away[-1] == pytest.approx(0.5 * pull * late**2 + rises * late**3 / 6.0, rel=0.02)


def test_a_slope_beyond_the_static_angle_is_unsupported_and_one_below_is_not() -> None:
    for static, held in ((0.5, True), (0.4, False)):
        data = on_floor(box(), {"friction": 0.3, "static_friction": static}, duration=0.01)
        data["gravity"] = [0.45 * G, -G]
        run = rw.simulate(data, rw.QUASISTATIC_RIGID)
        assert (str(run.outcome) == "unsupported") != held


def test_without_momentum_a_slope_holds_whatever_speed_a_block_starts_with() -> None:
    """The start's speed is of the rungs with momentum, on which the block slides on."""
    moves = {"x": {"speed": 0.1}, "y": {"speed": 0.0}}
    for rung in LOADED:
        data = on_floor(box(coordinates=moves), RAMP, duration=0.02)
        data["gravity"] = [0.4 * G, -G]
        run = rw.simulate(data, rung)
        assert run.outcome == "timeout", rung
        slid = of(run, "body.x", "velocity")[-1]
        assert slid == pytest.approx(0.1 + 0.1 * G * 0.02 if rung.inertia > 0.0 else 0.0, abs=1e-3)


def test_static_friction_below_kinetic_is_refused_in_a_line() -> None:
    data = on_floor(box(), {"friction": "mu", "static_friction": 0.3}, parameters={"mu": {"default": 0.2}})
    assert rw.simulate(data, rw.DYNAMIC_RIGID, duration=0.01).outcome != "invalid"
    with pytest.raises(rw.InvalidScene, match=r"contacts between body and floor: static_friction must be at"):
        rw.load(data).bind({"mu": 0.4})


@pytest.mark.few(1)
@on_loaded
def test_laws_do_not_depend_on_units(rung: Rung) -> None:
    ball = disc(0.02, coordinates={"x": {"speed": 0.3, "damping": 1.0}, "y": {"damping": 1.0}})
    law = RAMP | {
        "restitution": 0.6,
        "yield_speed": 0.2,
        "adhesion": 3.0,
        "adhesion_range": 1e-3,
        "impact": "poisson",
    }
    data = on_floor(ball, law, duration=0.3, step=1e-3)
    units = Units(length=1e3, mass=1e-3, time=10.0)
    here, there = rw.simulate(data, rung), rw.simulate(scaled(rw.load(data), units), rung)
    assert here.outcome == there.outcome
    np.testing.assert_allclose(of(there, "body.y"), 1e3 * of(here, "body.y"), rtol=1e-6, atol=1e-6)


def test_runs_of_a_batch_with_static_friction_below_kinetic_say_so() -> None:
    law = {"friction": "mu", "static_friction": "held"}
    ranges = {"mu": {"default": 0.3, "range": [0, 1]}, "held": {"default": 0.5, "range": [0.1, 1]}}
    data = on_floor(box(), law, parameters=ranges)
    held = np.array([0.2, 0.5, 0.1])
    found = rw.rollout(data, "dynamic-rigid", durations=0.01, parameters={"held": held})
    line = "contacts between body and floor: static_friction must be at least friction"
    assert found.faults == {0: f"sample 0: {line}", 2: f"sample 2: {line}"}
    motions = rw.Motions(("body.y",), [0.0, 0.1, 0.2], np.full((1, 3, 1), 0.01))
    with pytest.raises(rw.InputError, match=rf"box: {line} \(at held 0.1, mu 1\)"):
        rw.fit(data, "dynamic-rigid", motions, ("held", "mu"))
    designed = rw.design(
        data | {"goal": "body.x > 1"}, ("held",), model="dynamic-rigid", box={"held": (0.1, 0.2)}
    )
    assert line in designed.reason
