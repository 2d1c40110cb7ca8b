"""Laws of contact that scenes in space name beside the common ones, against what is known of them in closed
form, and against planar scenes of the same bodies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.world.find import world_of
from rungwise.world.ingredients import FRICTION, INGREDIENTS, OTHER, RESTITUTION
from tests.simulation.spatial.conftest import Make
from tests.simulation.spatial.measure import FLOOR, NO_GRAVITY, Array, free, q, run, v, world
from tests.simulation.spatial.rungs import DYNAMIC, WITH_LOADS, named

POISSON = {"impact": "poisson"}
RAMP = {"friction": 0.3, "static_friction": 0.5}
GRAVITY = '<option gravity="{} {} {}"/>'
RADIUS = 0.02
HALFPLANE = {"role": "obstacle", "shape": {"kind": "halfplane"}}
STIFF = {"stiffness": 1e6, "damping": 1e3}

Case = tuple[tuple[float, float, float], float, float, float, float]
"""Speeds along x, along the normal and of turning; angle, friction, restitution, moment of inertia."""


def speeds(body: str, **given: float) -> dict[str, Any]:
    return {"velocities": {f"{body}.{name}": value for name, value in given.items()}}


def block(
    make: Make, law: dict[str, Any], slope: float = 0.0, start: float = 0.0, turn: float = 0.0, **fields: Any
) -> Any:
    """A flat block on a plane, which slopes down along a horizontal way that is turned by `turn`."""
    c, s = math.cos(turn), math.sin(turn)
    pull = 10.0 * math.sin(slope)
    option = GRAVITY.format(c * pull, s * pull, -10.0 * math.cos(slope))
    geom = 'type="box" size=".1 .1 .005"'
    euler = f'euler="0 0 {math.degrees(turn)}"'
    model = world(FLOOR, free("block", "0 0 .005", geom, euler), before=option)
    begun = speeds("block", x=c * start, y=s * start)
    return make(model, contacts=[STIFF | law], start=begun, **{"duration": 0.2, "step": 1e-3} | fields)


# Restitution that falls with speed, and Poisson's.


@pytest.mark.long
def test_restitution_falls_above_the_yield_speed(make: Make) -> None:
    for speed, law in ((0.4, {}), (2.0, {}), (2.0, POISSON)):
        model = world(FLOOR, free("ball", "0 0 .15", 'size=".1"'), before=NO_GRAVITY)
        entry = {"restitution": 0.8, "friction": 0.3, "yield_speed": 0.5} | law
        scene = make(model, contacts=[entry], start=speeds("ball", z=-speed, x=0.2), duration=0.2, step=1e-3)
        expected = 0.8 * speed * min(1.0, (speed / 0.5) ** -0.25)
        assert v(run(scene, rw.DYNAMIC_RIGID))[2] == pytest.approx(expected, rel=1e-9)


def in_the_plane(case: Case, law: dict[str, Any]) -> Array:
    """Speeds of a rod with round ends after one of them struck a floor."""
    rates, angle, mu, e, inertia = case
    body = {
        "role": "object", "mass": 1.0, "centre": [0, 0], "inertia": inertia, "motion": {"kind": "free"},
        "shape": [{"kind": "disc", "radius": RADIUS, "at": [side, 0]} for side in (-0.5, 0.5)],
        "pose": {"y": 0.5 * abs(math.sin(angle)) + RADIUS + 1e-9, "angle": angle},
        "coordinates": dict(zip(("x", "y", "angle"), ({"speed": rate} for rate in rates), strict=True)),
    }  # fmt: skip
    contact = {"between": ["rod", "floor"], "friction": mu, "restitution": e} | law
    scene = {"name": "rod", "bodies": {"rod": body, "floor": HALFPLANE}, "contacts": [contact]}
    scene |= {"duration": 1e-6, "step": 1e-6}
    return np.asarray(rw.simulate(scene, rw.DYNAMIC_RIGID).trajectory.velocity.values[-1])


def in_space(make: Make, case: Case, law: dict[str, Any], turn: float) -> Array:
    """The same in space, in a vertical plane that is turned by `turn` about the vertical."""
    (x, y, rate), angle, mu, e, inertia = case
    c, s = math.cos(angle), math.sin(angle)
    ends = "".join(
        f'<geom size="{RADIUS}" pos="{side * c} 0 {side * s}"/>' for side in (-0.5, 0.5)
    )  # fmt: skip
    height = 0.5 * abs(s) + RADIUS + 1e-9
    body = (
        f'<body name="rod" pos="0 0 {height}" euler="0 0 {math.degrees(turn)}"><freejoint/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>{ends}</body>'
    )
    begun = speeds("rod", x=math.cos(turn) * x, y=math.sin(turn) * x, z=y, ry=-rate)
    contacts = [{"friction": mu, "restitution": e} | law]
    scene = make(
        world(FLOOR, body, before=NO_GRAVITY), contacts=contacts, start=begun, duration=1e-6, step=1e-6
    )
    after = v(run(scene, rw.DYNAMIC_RIGID))
    assert -math.sin(turn) * after[0] + math.cos(turn) * after[1] == pytest.approx(0.0, abs=1e-8)
    return np.array([math.cos(turn) * after[0] + math.sin(turn) * after[1], after[2], -after[4]])


def drawn(rng: np.random.Generator) -> Case:
    """A rod whose lower end approaches the floor."""
    angle = float(rng.uniform(0.1, 1.4) * rng.choice([-1.0, 1.0]))
    lever = 0.5 * math.cos(angle) * (-1.0 if angle > 0.0 else 1.0)
    while True:
        x, y, rate = rng.uniform((-2.0, -3.0, -3.0), (2.0, 0.0, 3.0)).tolist()
        if y + lever * rate < -0.1:
            mu, e, inertia = rng.uniform(0.0, 1.2), rng.uniform(0.05, 1.0), 10.0 ** rng.uniform(-2.0, 0.0)
            return (x, y, rate), angle, mu, e, inertia


KANE = ((-0.3, -1.0, 0.0), -0.9, 0.6, 0.9, 1.0 / 12.0)


@pytest.mark.long
@pytest.mark.parametrize("law", [{}, POISSON], ids=["newton", "poisson"])
@pytest.mark.parametrize("seed", range(4))
def test_a_rod_strikes_a_floor_as_in_the_plane(make: Make, law: dict[str, Any], seed: int) -> None:
    """Kane and Levinson's rod (1985), whose slip friction turns, and drawn ones."""
    rng = np.random.default_rng(seed)
    for case in (KANE, *(drawn(rng) for _ in range(4))):
        turn = rng.uniform(0.0, 6.0)
        np.testing.assert_allclose(in_space(make, case, law, turn), in_the_plane(case, law), atol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_poissons_law_adds_no_energy(make: Make, seed: int) -> None:
    """Bodies of any shape and inertia that strike a floor at any pose, with sliding friction, and with
    torsional and rolling friction beside it."""
    rng = np.random.default_rng(seed)
    shapes = ('type="box" size="{} {} {}"', 'type="ellipsoid" size="{} {} {}"', 'type="capsule" size="{} {}"')
    for number in range(6):
        geom = shapes[number % 3].format(*rng.uniform(0.05, 0.3, 3))
        inertia = 10.0 ** rng.uniform(-3.0, -1.0) * rng.uniform(0.6, 1.0, 3)
        body = (
            '<body name="b" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="1"'
            f' diaginertia="{" ".join(map(str, inertia))}"/><geom {geom}/></body>'
        )
        floor = FLOOR.replace("/>", f' condim="{rng.choice([3, 4, 6])}"/>')
        turn, rates = rng.normal(size=4), rng.normal(size=6) * [2, 2, 0, 5, 5, 5]
        places = dict(zip(("qw", "qx", "qy", "qz"), turn / np.linalg.norm(turn), strict=True))
        begun = speeds("b", **dict(zip(("x", "y", "z", "rx", "ry", "rz"), rates.tolist(), strict=True)))
        begun["velocities"]["b.z"] = -3.0
        begun["places"] = {f"b.{name}": float(value) for name, value in places.items()}
        contacts = [{"friction": rng.uniform(0.0, 1.2), "restitution": rng.uniform(0.3, 1.0)} | POISSON]
        scene = make(
            world(floor, body, before=NO_GRAVITY), contacts=contacts, start=begun, duration=0.5, step=2e-3
        )
        found = run(scene, rw.DYNAMIC_RIGID)
        energy = found.trajectory.energy.values
        assert v(found)[2] > 0.0
        assert np.diff(energy).max() <= 1e-9 * energy[0]


def test_impacts_of_many_bodies_are_those_of_each(make: Make) -> None:
    """From sixty velocities on, problems know where their entries are."""
    balls = [free(f"b{k}", f"{k} 0 .1", 'size=".1"') for k in range(11)]
    after = []
    for own in (balls[:1], balls):
        begun = {"velocities": {}}
        for k in range(len(own)):
            begun["velocities"] |= {f"b{k}.z": -1.0, f"b{k}.x": 2.0, f"b{k}.ry": -3.0, f"b{k}.rz": 1.0}
        entry = {"friction": 0.4, "restitution": 0.7} | POISSON
        scene = make(
            world(FLOOR, *own, before=NO_GRAVITY), contacts=[entry], start=begun, duration=1e-3, step=1e-3
        )
        after.append(v(run(scene, rw.DYNAMIC_RIGID)).reshape(-1, 6))
    np.testing.assert_allclose(after[1], np.tile(after[0], (11, 1)), atol=1e-8)


# Static friction.


@pytest.mark.few(1)
@pytest.mark.parametrize("turn", [0.0, 2.0])
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_slope_holds_a_block_up_to_the_static_angle(make: Make, rung: Rung, turn: float) -> None:
    """Beyond it, and after any slip, the block is slowed by kinetic friction."""
    least = math.atan(0.5)
    held = run(block(make, RAMP, least - 0.01, turn=turn), rung)
    assert str(held.outcome) == "timeout" and np.hypot(*q(held)[:2]) < 2e-6
    for slope, start in ((least + 0.01, 0.0), (0.3, 0.1)):
        found = run(block(make, RAMP, slope, start, turn), rung)
        slid = float(math.cos(turn) * v(found)[0] + math.sin(turn) * v(found)[1])
        if rung.inertia > 0.0:
            expected = start + 0.2 * 10.0 * (math.sin(slope) - 0.3 * math.cos(slope))
            assert slid == pytest.approx(expected, rel=1e-4)
        else:
            assert (str(found.outcome) == "unsupported") == (slope > least)


def pulled(make: Make, rung: Rung) -> tuple[Any, dict[str, Any]]:
    """A block that a spring pulls at a pace over a floor, in space and in the plane."""
    stiffness, pace = 100.0, 0.2
    joints = '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
    body = f'<body name="block" pos="0 0 .05">{joints}<geom size=".05" mass="1"/></body>'
    servo = f'<actuator><position name="s" joint="x" kp="{stiffness}"/></actuator>'
    law = RAMP | ({"stiffness": 1e8, "damping": 1e5} if rung.compliant else {})
    common = {"duration": 1.0, "step": 1e-3}
    scene = make(
        world(FLOOR, body, before=GRAVITY.format(0, 0, -10), after=servo),
        contacts=[law], controls={"s": f"{pace} * t"}, **common,
    )  # fmt: skip
    drive = {"kind": "servo", "stiffness": stiffness, "target": f"{pace} * t"}
    own = {
        "role": "object", "shape": {"kind": "disc", "radius": 0.05}, "mass": 1.0, "pose": {"y": 0.05},
        "motion": {"kind": "free"}, "coordinates": {"x": {"drive": drive}, "angle": {"damping": 1e6}},
    }  # fmt: skip
    planar = {"name": "block", "gravity": [0, -10], "bodies": {"block": own, "floor": HALFPLANE}} | common
    return scene, planar | {"contacts": [{"between": ["block", "floor"]} | law]}


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_spring_pulls_a_block_off_at_the_static_force(make: Make, rung: Rung) -> None:
    """It sticks and slips from then on as a planar one does."""
    scene, planar = pulled(make, rung)
    found, other = run(scene, rung), rw.simulate(planar, rung)
    t, x = found.trajectory.time.values, found.trajectory.position.values[:, 0]
    assert t[np.argmax(x > 1e-4)] == pytest.approx(0.5 * 10.0 / (100.0 * 0.2), abs=0.02)
    grid = np.linspace(0.0, 1.0, 101)
    own = other.trajectory
    apart = np.interp(grid, t, x) - np.interp(grid, own.time.values, own.position.values[:, 0])
    assert np.abs(apart).max() < 1e-3 and x[-1] > 0.05


# Adhesion.


def hanging(make: Make, part: float, law: dict[str, Any]) -> Any:
    """A ball of this part of 1 kg below a floor, upside down, with drag."""
    joints = "".join(
        f'<joint name="{name}" type="slide" axis="{axis}" damping="5"/>'
        for name, axis in (("x", "1 0 0"), ("z", "0 0 1"))
    )
    body = f'<body name="ball" pos="0 0 .1">{joints}<geom size=".1" mass="{part}"/></body>'
    entry = STIFF | {"adhesion": 10.0} | law
    return make(
        world(FLOOR, body, before=GRAVITY.format(0, 0, 10)), contacts=[entry], duration=0.1, step=1e-3
    )


@pytest.mark.few(2)
@pytest.mark.parametrize("part", [0.99, 1.01])
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_ball_hangs_by_adhesion_up_to_its_pull(make: Make, rung: Rung, part: float) -> None:
    found = run(hanging(make, part, {}), rung)
    if part < 1.0:
        assert abs(q(found)[1]) <= 1.1 * 10.0 / 1e6
    else:
        assert q(found)[1] > 1e-3
        if rung.inertia == 0.0:  # off the floor all of the weight drags it
            assert v(found)[1] == pytest.approx(10.0 * part / 5.0)


POINTS = {
    "box": ('size=".1 .1 .05"', 4),
    "capsule": ('size=".05 .1" euler="0 90 0"', 2),
    "sphere": ('size=".05"', 1),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("shape", POINTS)
def test_each_point_of_contact_pulls(make: Make, shape: str) -> None:
    size, points = POINTS[shape]
    for part, stays in ((0.99, True), (1.01, False)):
        model = world(
            FLOOR, free("b", "0 0 .05", f'type="{shape}" {size} mass="{points * part}"'),
            before=GRAVITY.format(0, 0, 10),
        )  # fmt: skip
        scene = make(model, contacts=[{"adhesion": 10.0}], duration=0.05, step=1e-3)
        assert (q(run(scene, rw.DYNAMIC_RIGID))[2] - 0.05 < 1e-6) == stays


@pytest.mark.few(2)
@pytest.mark.parametrize("accuracy", [{"step": 1e-3}, {"step": 1e-2}, {"tol": 1e-4}], ids=str)
@pytest.mark.parametrize("speed", [0.04, 0.1])
def test_leaving_takes_the_work_of_the_pull(make: Make, speed: float, accuracy: dict[str, float]) -> None:
    """Also where the range is so short that the pull would stop the ball in a step of any speed."""
    model = world(FLOOR, free("ball", "0 0 .1", 'size=".1"'), before=NO_GRAVITY)
    entry = {"adhesion": 1e3, "adhesion_range": 1e-6}
    scene = make(model, contacts=[entry], start=speeds("ball", z=speed), duration=0.1)
    found = run(scene, rw.DYNAMIC_RIGID, **accuracy)
    left = math.sqrt(max(speed**2 - 2.0 * 1e3 * 1e-6, 0.0))
    assert v(found)[2] == pytest.approx(left, abs=1e-3)
    works = found.trajectory.load_work.values[-1] + found.trajectory.contact_work.values[-1]
    assert 0.5 * v(found)[2] ** 2 - 0.5 * speed**2 == pytest.approx(works, abs=1e-9)


def test_a_ball_bounces_off_a_floor_that_pulls_as_in_the_plane(make: Make) -> None:
    law = {"adhesion": 5.0, "adhesion_range": 0.01, "restitution": 0.5, "yield_speed": 0.8, "friction": 0.3}
    ends = []
    for accuracy in ({"step": 1e-4}, {"tol": 1e-5}):
        model = world(FLOOR, free("ball", "0 0 .15", 'size=".1"'), before=NO_GRAVITY)
        scene = make(model, contacts=[law], start=speeds("ball", z=-1.0), duration=0.12)
        ends.append(v(run(scene, rw.DYNAMIC_RIGID, **accuracy))[2])
    ball = {
        "role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0, "pose": {"y": 0.15},
        "motion": {"kind": "free"}, "coordinates": {"y": {"speed": -1.0}},
    }  # fmt: skip
    contact = {"between": ["ball", "floor"]} | law
    planar = {"name": "b", "bodies": {"ball": ball, "floor": HALFPLANE}, "contacts": [contact]}
    other = rw.simulate(planar | {"duration": 0.12, "step": 1e-3}, rw.DYNAMIC_RIGID)
    np.testing.assert_allclose(ends, other.trajectory.velocity.values[-1][1], atol=5e-3)
    gained, e = 1.0 + 2.0 * 5.0 * 0.01, 0.5 * (math.sqrt(1.1) / 0.8) ** -0.25
    np.testing.assert_allclose(ends, math.sqrt(e**2 * gained - 0.1), atol=5e-3)


def test_a_pull_reaches_as_far_as_it_is_told(make: Make) -> None:
    """Also that of curved geoms, from many times their size."""
    model = world(
        '<geom type="ellipsoid" size=".2 .3 .1"/>', free("egg", "0 0 9", 'type="ellipsoid" size=".1 .1 .1"')
    )
    model = '<option gravity="0 0 0"/>' + model
    for reach, falls in ((8.9, 1.0), (8.7, 0.0)):
        scene = make(model, contacts=[{"adhesion": 2.0, "adhesion_range": reach}], duration=1e-2, step=1e-3)
        found = rw.simulate(scene, rw.DYNAMIC_RIGID)
        assert found.final["egg"]["z"] - 9.0 == pytest.approx(-falls * 1e-4, rel=0.15)


# All laws.


def rolls(make: Make, turn: float = 0.0, side: float = 1.0, **fields: Any) -> Any:
    """A spinning ball that falls on a floor with all laws, under gravity that is not upright; turned by
    `turn` about the vertical, or on the other side of the plane of x and z."""
    c, s = math.cos(turn), math.sin(turn)
    law = RAMP | {"adhesion": 1.0, "adhesion_range": 1e-3, "restitution": 0.5, "yield_speed": 0.1}

    def turned(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y, s * x + c * y

    pull, way, spin = turned(2.0, side * 0.5), turned(0.5, side * 0.2), turned(side * 1.0, 3.0)
    begun = speeds("ball", x=way[0], y=way[1], z=-1.0, rx=spin[0], ry=spin[1], rz=side * 2.0)
    model = world(FLOOR, free("ball", "0 0 .11", 'size=".1"'), before=GRAVITY.format(*pull, -10.0))
    common = {"duration": 0.15, "step": 1e-3} | fields
    return make(model, contacts=[STIFF | law | POISSON], start=begun, **common)


@pytest.mark.few(3)
@pytest.mark.parametrize(("turn", "side"), [(0.5 * math.pi, 1.0), (2.0, 1.0), (0.0, -1.0)])
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_what_is_turned_or_mirrored_moves_so(make: Make, rung: Rung, turn: float, side: float) -> None:
    own, other = (q(run(rolls(make, *how), rung))[:3] for how in ((), (turn, side)))
    c, s = math.cos(turn), math.sin(turn)
    back = [c * other[0] + s * other[1], side * (c * other[1] - s * other[0]), other[2]]
    np.testing.assert_allclose(back, own, atol=1e-6)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_run_with_laws_goes_on_from_any_state(make: Make, rung: Rung) -> None:
    scene = rolls(make, duration=0.08, step=2e-3)
    whole = rw.simulate(scene, rung)
    for state in whole.states[3:-1:9]:
        rest = rw.simulate(scene, rung, state=state)
        assert np.array_equal(q(rest), q(whole)) and np.array_equal(v(rest), v(whole))


@pytest.mark.parametrize("side", [0.98, 1.02])
def test_torsional_friction_of_what_sticks_is_greater_in_proportion(make: Make, side: float) -> None:
    """A motor turns a ball on the spot; what slides is slowed by kinetic torsional friction."""
    joints = '<joint name="z" type="slide" axis="0 0 1"/><joint name="r" axis="0 0 1"/>'
    body = f'<body name="b" pos="0 0 .1">{joints}<geom size=".1" mass="1" friction="1 .05 .001"/></body>'
    model = world(
        FLOOR.replace("/>", ' condim="4" friction="1 .05 .001"/>'), body,
        before=GRAVITY.format(0, 0, -10), after='<actuator><motor name="m" joint="r"/></actuator>',
    )  # fmt: skip
    scene = make(model, contacts=[RAMP], controls={"m": side * 0.5 * 0.05 * 10.0}, duration=0.05, step=1e-3)
    turned = v(run(scene, rw.DYNAMIC_RIGID))[1]
    expected = 0.05 * (side * 0.5 - 0.3) * 0.05 * 10.0 / (0.4 * 0.1**2) if side > 1.0 else 0.0
    assert turned == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_samples_with_static_friction_below_kinetic_are_named(make: Make) -> None:
    model, ranges = (
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')),
        {"held": {"default": 0.5, "range": [0.1, 1]}},
    )
    entry = {"friction": 0.3, "static_friction": "held"}
    scene = make(model, contacts=[entry], parameters=ranges, duration=0.01)
    held = np.array([0.2, 0.5])
    found = rw.rollout(scene, "dynamic-rigid", durations=0.01, parameters={"held": held}, threads=1)
    assert found.faults == {0: "sample 0: contacts.0: static_friction must be at least friction"}


def lawful(make: Make, **changes: Any) -> Any:
    law = RAMP | {"adhesion": 1.0, "restitution": 0.5, "yield_speed": 0.1} | POISSON | changes
    return make(world(FLOOR, free("ball", "0 0 .1", 'size=".1"')), contacts=[law], tolerance=1e-5)


def test_what_the_laws_are_is_told(make: Make) -> None:
    """By `check`, by exported models, which do not hold them, and by derivatives."""
    scene = lawful(make)
    home = world_of(scene)
    text = home.described(home.describe(scene.parameters()))
    named = "static friction 0.5, yield speed 0.1, adhesion 1, adhesion range 1e-05, impacts by Poisson's law"
    assert named in text
    assert "static_friction, yield_speed, adhesion, impact: poisson" in rw.mjcf(scene)
    plain = make(world(FLOOR, free("ball", "0 0 .1", 'size=".1"')), contacts=[{"friction": 0.3}])
    assert "(friction, stiffness, damping, restitution)" in rw.mjcf(plain)
    with pytest.raises(
        rw.InputError, match=r"contacts: steps with static_friction, adhesion.* cannot be differentiated"
    ):
        rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=2)


def test_a_diagnosis_counts_laws_as_in_the_plane(make: Make) -> None:
    """Each number of a law changes one ingredient, and comes from the world that the ingredient is of."""
    known = [lawful(make)] + [
        lawful(make, **{name: value})
        for name, value in (
            ("static_friction", 0.6), ("yield_speed", 0.2), ("impact", "newton"), ("adhesion", 2.0),
        )
    ]  # fmt: skip
    variants = [world_of(each).variant(each.parameters(), rw.DYNAMIC_RIGID, 1e-3) for each in known]
    for other, own in zip(variants[1:], (FRICTION, RESTITUTION, RESTITUTION, OTHER), strict=True):
        changed = [name for name in INGREDIENTS if variants[0].effective(name) != other.effective(name)]
        assert changed == [own]
        mixed = variants[0].mixed(other, frozenset({own}))
        assert mixed.effective(own) == other.effective(own)


def test_a_replay_names_laws_that_mujoco_lacks(make: Make) -> None:
    model = world(FLOOR, free("ball", "0 0 .1", 'size=".1"'), before=GRAVITY.format(0, 0, 5))
    found = run(make(model, contacts=[{"adhesion": 10.0}], duration=0.3, step=2e-3), rw.DYNAMIC_RIGID)
    assert any("adhesion, which MuJoCo does not know" in line for line in rw.replay(found).reasons)
