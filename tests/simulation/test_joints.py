"""Joints between bodies against closed forms and scipy's integrator."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene import SceneError

from .conftest import MOVING
from .test_convergence import DYNAMIC, STEPS, exact, order

WORLD = {"role": "obstacle", "shape": {"kind": "point"}}
G = 9.81


def rod(x: float, y: float, angle: float, length: float = 1.0, **more: Any) -> dict[str, Any]:
    """A free thin bar of mass 2 and inertia 0.3."""
    shape = {"kind": "box", "width": length, "height": 0.05}
    pose = {"x": x, "y": y, "angle": angle}
    base = {"role": "object", "shape": shape, "mass": 2.0, "inertia": 0.3}
    return base | {"pose": pose, "motion": {"kind": "free"}, **more}


def hinge(a: str, b: str, x: float, y: float, **coordinate: Any) -> dict[str, Any]:
    return {"kind": "hinge", "between": [a, b], "at": [x, y], "coordinate": coordinate or None}


def scene(bodies: dict[str, Any], joints: dict[str, Any], **fields: Any) -> rw.Scene:
    return rw.load({"name": "jointed", "bodies": bodies, "joints": joints, "duration": 1.0} | fields)


def pendulum(**fields: Any) -> rw.Scene:
    joints = {"pin": hinge("world", "rod", 0.0, 0.0)}
    return scene({"world": WORLD, "rod": rod(0.5, 0.0, 0.0)}, joints, gravity=[0, -G], **fields)


def swing(time: float) -> float:
    """Angle of the pendulum, which starts at rest, level."""
    about = 0.3 + 2.0 * 0.25
    return exact(lambda _, y: [y[1], -2.0 * G * 0.5 * math.cos(y[0]) / about], [0.0, 0.0], time)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_orders_of_a_hinged_pendulum(model: rw.Rung) -> None:
    """The angle is of order 1, the drift of the joint of order 2."""
    errors, drifts, reference = [], [], swing(1.0)
    for h in STEPS:
        run = rw.simulate(pendulum(), model, step=h)
        assert run.outcome.name == "timeout" and run.worst_residual < 1e-12
        errors.append(abs(run.final["rod"]["angle"] - reference))
        drifts.append(float(np.abs(run.trajectory.joint_position[:, :2]).max()))
    assert order(errors) == pytest.approx(1.0, abs=0.05)
    assert order(drifts) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_the_joint_is_the_hinge_that_a_body_may_have_itself(model: rw.Rung) -> None:
    """Reduced and maximal coordinates describe one motion; the joint's force is the pivot's."""
    turning = rod(0.5, 0.0, 0.0, motion={"kind": "hinge", "pivot": [0, 0]})
    own = rw.simulate(scene({"rod": turning}, {}, gravity=[0, -G]), model, step=2e-5, frames=3)
    joint = rw.simulate(pendulum(), model, step=2e-5, frames=3)
    assert joint.final["rod"]["angle"] == pytest.approx(own.final["rod"]["angle"], abs=1e-4)
    angle, spin = joint.final["rod"]["angle"], float(joint.trajectory.velocity[-1, 2])
    about = 0.3 + 2.0 * 0.25
    turn = -2.0 * G * 0.5 * math.cos(angle) / about
    along, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    expected = 2.0 * 0.5 * (turn * across - spin**2 * along) + np.array([0.0, 2.0 * G])
    # Measures are taken in the frame of the first body, the world.
    assert joint.trajectory.joint_force[-1, :2].values == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_energy_accounts_with_joints(model: rw.Rung) -> None:
    """A chain of two links with a motor, drag, dry friction and a spring in its joints."""
    servo = {"kind": "servo", "stiffness": 30.0, "damping": 1.0, "target": "sin(3 * t)", "limit": 8.0}
    joints = {
        "first": hinge("world", "one", 0.0, 0.0, damping=0.3, drive=servo),
        "second": hinge("one", "two", 1.0, 0.0, dry_friction=0.4) | {"stiffness": 1e3, "damping": 5.0},
    }
    bodies = {"world": WORLD, "one": rod(0.5, 0.0, 0.0), "two": rod(1.5, 0.0, 0.0)}
    run = rw.simulate(scene(bodies, joints, gravity=[0, -G]), model)
    works = ("drive_work", "load_work", "support_work", "joint_work")
    assert all(float(np.abs(run.trajectory[name]).max()) > 1e-3 for name in works)
    data = run.trajectory
    total = sum(data[name].values for name in (*works, "contact_work"))
    kinetic = data.kinetic_energy.values
    assert np.abs(kinetic - kinetic[0] - total).max() < 1e-11 * kinetic.max()
    assert float(data.elastic_energy.max()) > 1e-3


def test_work_of_a_rigid_joint_vanishes_with_the_step() -> None:
    work = [
        abs(float(rw.simulate(pendulum(), rw.DYNAMIC_RIGID, step=h).trajectory.joint_work[-1])) for h in STEPS
    ]
    assert order(work) > 1.5 and work[-1] < 1e-5


@pytest.mark.parametrize("tol", [None, 1e-4])
def test_momentum_of_what_floats(tol: float | None) -> None:
    """The force of a joint acts at one point: linear and angular momentum are kept to rounding."""
    one = rod(0.5, 0.0, 0.0, coordinates={"angle": {"speed": 3.0}, "y": {"speed": 1.0}})
    bodies, joints = {"one": one, "two": rod(1.5, 0.0, 0.0)}, {"pin": hinge("one", "two", 1.0, 0.0)}
    data = rw.simulate(scene(bodies, joints), rw.DYNAMIC_RIGID, tol=tol).trajectory
    q, v = data.position.values, data.velocity.values
    linear = v[:, :2] + v[:, 3:5]
    spin = 0.3 * (v[:, 2] + v[:, 5])
    spin += 2.0 * sum(q[:, i] * v[:, i + 1] - q[:, i + 1] * v[:, i] for i in (0, 3))
    # The first step gives the other rod the speed that the joint demands.
    assert np.ptp(linear[1:], axis=0) == pytest.approx([0.0, 0.0], abs=1e-11)
    assert np.ptp(spin[1:]) == pytest.approx(0.0, abs=1e-10 if tol is None else 1e-3)
    assert np.ptp(q[:, 2]) > 0.5


def four_bar(crank_speed: float | None, **fields: Any) -> rw.Scene:
    """Ground 0..2 on the x axis, crank 1 (upright at first), coupler, rocker 1.5 to (2, 0)."""
    tip = (2.0 - 0.9, 1.2)  # the rocker's end: 1.5 from (2, 0)
    coupler = math.hypot(tip[0], tip[1] - 1.0)
    drive = {} if crank_speed is None else {"drive": {"kind": "speed", "speed": crank_speed}}
    bodies = {
        "world": WORLD,
        "crank": rod(0.0, 0.5, math.pi / 2),
        "coupler": rod(tip[0] / 2, (1.0 + tip[1]) / 2, math.atan2(tip[1] - 1.0, tip[0]), coupler),
        "rocker": rod((tip[0] + 2.0) / 2, tip[1] / 2, math.atan2(tip[1], tip[0] - 2.0), 1.5),
    }
    joints = {
        "a": hinge("world", "crank", 0.0, 0.0, **drive),
        "b": hinge("crank", "coupler", 0.0, 1.0),
        "c": hinge("coupler", "rocker", *tip),
        "d": hinge("world", "rocker", 2.0, 0.0),
    }
    return scene(bodies, joints, **fields)


def rocker_angle(crank: float) -> float:
    """Closed form of the four-bar: where the circles about the crank's end and (2, 0) meet."""
    coupler = math.hypot(1.1, 0.2)
    x, y = math.cos(crank), math.sin(crank)
    dx, dy = 2.0 - x, -y
    d = math.hypot(dx, dy)
    along = (coupler**2 - 1.5**2 + d * d) / (2.0 * d)
    up = math.sqrt(coupler**2 - along**2)
    px, py = x + along * dx / d - up * dy / d, y + along * dy / d + up * dx / d
    return math.atan2(py, px - 2.0)


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_driven_four_bar(model: rw.Rung) -> None:
    run = rw.simulate(four_bar(-0.7), model, duration=0.9, step=1e-4, frames=3)
    assert run.outcome.name in ("timeout", "missed") and run.worst_residual <= 1e-8
    crank = math.pi / 2 - 0.7 * 0.9
    assert run.final["crank"]["angle"] == pytest.approx(crank, abs=1e-6)
    assert run.final["rocker"]["angle"] == pytest.approx(rocker_angle(crank), abs=1e-4)


def test_falling_parallelogram() -> None:
    """A redundant linkage: crank, coupler and rocker swing as one pendulum."""
    bodies = {
        "world": WORLD,
        "left": rod(0.5, 0.0, 0.0),
        "right": rod(2.5, 0.0, 0.0),
        "coupler": rod(2.0, 0.0, 0.0, 2.0),
    }
    joints = {
        "a": hinge("world", "left", 0.0, 0.0),
        "b": hinge("left", "coupler", 1.0, 0.0),
        "c": hinge("coupler", "right", 3.0, 0.0),
        "d": hinge("world", "right", 2.0, 0.0),
    }
    about = 2.0 * (0.3 + 2.0 * 0.25) + 2.0
    weight = (2.0 * 2.0 * 0.5 + 2.0) * G
    # Level, the linkage is at a singular position: it starts a little below.
    reference = exact(lambda _, y: [y[1], -weight * math.cos(y[0]) / about], [-0.3, 0.0], 0.6)
    turned = {name: dict(body) for name, body in bodies.items()}
    c, s = math.cos(-0.3), math.sin(-0.3)
    for name, pivot in (("left", 0.0), ("right", 2.0)):
        turned[name]["pose"] = {"x": pivot + 0.5 * c, "y": 0.5 * s, "angle": -0.3}
    turned["coupler"]["pose"] = {"x": 1.0 + c, "y": s}
    joints["b"]["at"], joints["c"]["at"] = [c, s], [2.0 + c, s]
    errors = []
    for h in STEPS:
        run = rw.simulate(
            scene(turned, joints, gravity=[0, -G]), rw.DYNAMIC_RIGID, step=h, duration=0.6, frames=3
        )
        errors.append(abs(run.final["left"]["angle"] - reference))
        assert run.final["coupler"]["angle"] == pytest.approx(0.0, abs=1e-5)
    assert order(errors) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_welded_bodies_are_one(model: rw.Rung) -> None:
    spin = {"angle": {"speed": 2.0}}
    half = {"kind": "box", "width": 0.5, "height": 0.2}
    base = {"role": "object", "motion": {"kind": "free"}}
    parts = {
        "left": base | {"shape": half, "pose": {"x": -0.25}, "coordinates": spin | {"y": {"speed": -0.5}}},
        "right": base | {"shape": half, "pose": {"x": 0.25}, "coordinates": spin | {"y": {"speed": 0.5}}},
    }
    weld = {"weld": {"kind": "weld", "between": ["left", "right"], "at": [0, 0]}}
    two = rw.simulate(scene(parts, weld, gravity=[1.0, -G]), model, step=1e-4, frames=3).final
    whole = base | {"shape": half | {"width": 1.0}, "coordinates": spin}
    one = rw.simulate(scene({"whole": whole}, {}, gravity=[1.0, -G]), model, step=1e-4, frames=3).final
    for name in ("x", "y", "angle"):
        middle = 0.5 * (two["left"][name] + two["right"][name])
        assert middle == pytest.approx(one["whole"][name], abs=2e-4)
    assert two["left"]["angle"] == pytest.approx(two["right"]["angle"], abs=1e-12)


@pytest.mark.parametrize("model", MOVING[1:], ids=str)
def test_compliant_weld_yields_as_its_stiffness_says(model: rw.Rung) -> None:
    """A block hung on a weld: it sags by m g / k, and less with a stiffer one; a rigid one holds it."""
    block = rod(0.0, -1.0, 0.0)
    for stiffness in (1e3, 1e5, "inf"):
        weld = {"kind": "weld", "between": ["world", "rod"], "at": [0, 0], "stiffness": stiffness}
        weld |= {"damping": 0.0 if stiffness == "inf" else 0.9 * math.sqrt(stiffness)}
        hung = scene({"world": WORLD, "rod": block}, {"weld": weld}, gravity=[0, -G])
        sag = -1.0 - rw.simulate(hung, model, duration=4.0, step=2e-3, frames=3).final["rod"]["y"]
        expected = 0.0 if stiffness == "inf" else 2.0 * G / float(stiffness)
        assert sag == pytest.approx(expected, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_drives_and_travel_of_a_slide(model: rw.Rung) -> None:
    """The axis turns with the first body; travel ends without a bounce."""
    frame = rod(0.0, 0.0, 0.5, motion={"kind": "hinge", "pivot": [0, 0]})
    frame |= {"coordinates": {"angle": {"drive": {"kind": "speed", "speed": 0.8}}}}
    rider = rod(0.2 * math.cos(0.5), 0.2 * math.sin(0.5), 0.5, 0.1)
    for drive, upper, expected in (
        ({"kind": "speed", "speed": 0.3}, 1.0, 0.3),
        ({"kind": "servo", "stiffness": 1e6, "damping": 1e4, "target": "0.3 * t"}, 1.0, 0.3),
        ({"kind": "servo", "stiffness": 1e4, "damping": 4e2, "target": "2 * t", "limit": 500}, 0.45, 0.45),
    ):
        axis = [math.cos(0.5), math.sin(0.5)]
        slide = {"kind": "slide", "between": ["frame", "rider"], "at": [0, 0], "axis": axis}
        slide["coordinate"] = {"upper": upper, "drive": drive}
        moving = scene({"frame": frame, "rider": rider}, {"rail": slide})
        run = rw.simulate(moving, model, step=1e-3)
        assert run.outcome.name in ("timeout", "missed"), run.reason
        along = run.trajectory.joint_position.sel(measure="rail.along").values
        assert along[-1] == pytest.approx(expected, abs=5e-3) and along.max() <= upper + 1e-6
        angle = 0.5 + 0.8
        place = np.array([run.final["rider"]["x"], run.final["rider"]["y"]])
        reach = (0.2 + along[-1]) * np.array([math.cos(angle), math.sin(angle)])
        assert place == pytest.approx(reach, abs=2e-3)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_order_of_the_two_bodies_does_not_matter(model: rw.Rung) -> None:
    data = rw.load("two_link").file.model_dump(mode="json")
    runs = [rw.simulate(rw.load(data), model)]
    joint = data["joints"]["shoulder"]
    joint["between"] = joint["between"][::-1]
    target = joint["coordinate"]["drive"]["target"]
    joint["coordinate"]["drive"]["target"] = f"-({target})"
    runs.append(rw.simulate(rw.load(data), model))
    assert {run.outcome.name for run in runs} == {"goal"} and runs[0].steps == runs[1].steps
    for name, value in runs[0].final["disc"].items():
        assert runs[1].final["disc"][name] == pytest.approx(value, abs=1e-6)


def test_joined_bodies_touch_only_if_their_entry_says_so() -> None:
    bodies = {"one": rod(0.5, 0.0, 0.0), "two": rod(1.5, 0.0, 0.0), "three": rod(0.0, 3.0, 0.0)}
    joints = {"pin": hinge("one", "two", 1.0, 0.0)}
    anything = scene(bodies, joints, contacts=[{"between": ["*", "*"]}])
    assert anything.template.contacts == (("one", "three"), ("two", "three"))
    named = scene(bodies, joints, contacts=[{"between": ["one", "two"]}])
    assert named.template.contacts == (("one", "two"),)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"between": ["world", "zzz"]}, "joints.pin.between.1: unknown body 'zzz'; valid: world, rod"),
        ({"between": ["rod", "rod"]}, "joints.pin.between: must name two bodies"),
        ({"damping": 3.0}, "joints.pin: damping: what is rigid has none; give a finite stiffness"),
        ({"kind": "weld", "coordinate": {}}, "joints.pin: a weld has no coordinate"),
        ({"kind": "zzz"}, "joints.pin.kind: must be 'weld', 'hinge' or 'slide'"),
        ({"axis": [0, 0]}, "joints.pin.axis: the axis has no length"),
        ({"stiffness": 0}, "joints.pin.stiffness: 0 must be > 0"),
        ({"coordinate": {"lower": 1}}, "joints.pin.coordinate.lower: 1 must be >= -inf and <= 0"),
        (
            {"coordinate": {"drive": {"kind": "force", "force": "zzz"}}},
            "joints.pin.coordinate.drive.force: unk",
        ),
    ],
)
def test_wrong_joints(change: dict[str, Any], message: str) -> None:
    joints = {"pin": hinge("world", "rod", 0.0, 0.0) | change}
    with pytest.raises(SceneError) as error:
        scene({"world": WORLD, "rod": rod(0.5, 0.0, 0.0)}, joints).bind()
    assert str(error.value).startswith(message)


def test_a_start_that_is_not_joined_is_invalid() -> None:
    away = rod(0.5, 0.0, 0.0, coordinates={"x": {"start": 0.1}})
    run = rw.simulate(
        scene({"world": WORLD, "rod": away}, {"pin": hinge("world", "rod", 0.0, 0.0)}), "kinematic"
    )
    assert run.outcome.name == "invalid"
    assert run.reason == "joints.pin: its along is off by 0.1 at the start"


@pytest.mark.few(5)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_a_linkage_driven_into_its_dead_centre_does_not_come_apart(model: rw.Rung, step: float) -> None:
    """A crank longer than its rod: the slider's line cannot be reached beyond asin(1/2)."""
    bodies = {
        "ground": WORLD,
        "crank": rod(0.1, 0.0, 0.0, 0.2),
        "rod": rod(0.25, 0.0, 0.0, 0.1),
        "slider": rod(0.3, 0.0, 0.0, 0.1),
    }
    joints = {
        "motor": hinge("ground", "crank", 0.0, 0.0, drive={"kind": "speed", "speed": 2.0}),
        "knee": hinge("crank", "rod", 0.2, 0.0),
        "wrist": hinge("rod", "slider", 0.3, 0.0),
        "rail": {"kind": "slide", "between": ["ground", "slider"], "at": [0.3, 0.0]},
    }
    run = rw.simulate(scene(bodies, joints), model, step=step)
    assert run.outcome.name == "jammed", run.reason
    assert run.certificate is not None and run.certificate.kind == "kinematic"
    exact = model is rw.KINEMATIC
    assert run.time == pytest.approx(math.asin(0.5) / 2.0, rel=1e-6 if exact else 5e-3)
    held = run.trajectory.joint_position.sel(measure=["knee.along", "knee.across", "rail.across"])
    assert float(np.abs(held).max()) < (1e-9 if exact else 1e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("links", [1, 2])
def test_controlled_steps_of_joints_grow_like_the_root_of_the_error(links: int) -> None:
    """What a whole step and two halves disagree about along rigid joints is not counted: the next step closes
    them."""
    bodies = {"world": WORLD, "rod": rod(0.5, 0.0, 0.0), "two": rod(1.5, 0.0, 0.0)}
    joints = {"pin": hinge("world", "rod", 0.0, 0.0), "knee": hinge("rod", "two", 1.0, 0.0)}
    if links == 1:
        del bodies["two"], joints["knee"]
    swinging = scene(bodies, joints, gravity=[0, -G])
    runs = [rw.simulate(swinging, rw.DYNAMIC_RIGID, tol=tol) for tol in (1e-4, 1e-6, 1e-8)]
    assert all(run.outcome.name == "timeout" for run in runs)
    for coarse, fine in pairwise(runs):
        assert 7.0 < fine.steps / coarse.steps < 14.0
    if links == 1:
        errors = [abs(run.final["rod"]["angle"] - swing(1.0)) for run in runs]
        assert errors[0] < 1e-4 and errors[1] < 1e-6 and errors[2] < 1e-8


def double_pendulum(friction: float, restitution: float) -> rw.Scene:
    """Two thin rods of length 1, at 20 and 30 degrees from hanging, whose end strikes a floor 0.05 below."""
    upper, lower = math.radians(20.0 - 90.0), math.radians(30.0 - 90.0)
    knee = np.array([math.cos(upper), math.sin(upper)])
    tip = knee + np.array([math.cos(lower), math.sin(lower)])
    bodies = {
        "world": WORLD,
        "floor": {"role": "obstacle", "shape": {"kind": "halfplane", "at": [0.0, float(tip[1]) - 0.05]}},
    }
    for name, (x, y), angle in (("upper", knee / 2, upper), ("lower", (knee + tip) / 2, lower)):
        bodies[name] = rod(float(x), float(y), angle) | {
            "shape": {"kind": "capsule", "length": 1.0, "radius": 0.01}
        }
    joints = {"pin": hinge("world", "upper", 0.0, 0.0), "knee": hinge("upper", "lower", *map(float, knee))}
    contacts = [{"between": ["lower", "floor"], "friction": friction, "restitution": restitution}]
    return scene(bodies, joints, gravity=[0, -G], contacts=contacts, duration=0.6, step=1e-3)


def test_energy_that_newton_and_coulomb_add_is_reported() -> None:
    """Kane and Levinson's double pendulum: friction turns the slip around in an impact that gains energy."""
    gains = {
        (mu, e): rw.simulate(double_pendulum(mu, e), rw.DYNAMIC_RIGID).energy_gained
        for mu in (0.0, 0.5)
        for e in (0.0, 0.7)
    }
    assert gains[0.0, 0.0] == gains[0.5, 0.0] == gains[0.0, 0.7] == 0.0
    assert gains[0.5, 0.7] > 0.1
    assert rw.simulate(double_pendulum(0.5, 0.7), rw.DYNAMIC_COMPLIANT).energy_gained == 0.0


def test_a_saturated_arm_stalls_in_full_steps() -> None:
    """A disc too heavy for the torque of the joints: the arm leans on it and rolls it as slowly as it can."""
    weak = {"mass": 50.0, "torque": 1.0}
    run = rw.simulate("two_link", rw.QUASISTATIC_RIGID, parameters=weak, duration=0.6)
    soft = rw.simulate("two_link", rw.QUASISTATIC_COMPLIANT, parameters=weak, duration=0.6)
    assert run.outcome.name == soft.outcome.name == "timeout"
    assert run.attempts < 1.1 * run.steps < 700
    assert run.final["upper"]["angle"] == pytest.approx(soft.final["upper"]["angle"], abs=5e-3)


def test_the_load_on_a_servo_may_pass_zero_while_it_is_pushed() -> None:
    """Balance is not lost at the target: at rest a and b share 1000 (0.6 - a) = 100 (b - 0.2)."""

    def disc(x: float, **drive: Any) -> dict[str, Any]:
        motion = {"kind": "slide", "axis": [1, 0], "name": "x"}
        shape, pose = {"kind": "disc", "radius": 0.1}, {"x": x}
        coordinates = {"x": {"drive": {"kind": "servo", **drive}}}
        return {"role": "robot", "shape": shape, "pose": pose, "motion": motion, "coordinates": coordinates}

    bodies = {
        "a": disc(0.0, stiffness=1000, damping=10, target="0.6 * min(t, 1)"),
        "b": disc(0.25, stiffness=100, target=0.2),
    }
    pushing = scene(bodies, {}, contacts=[{"between": ["a", "b"]}], duration=2.0)
    for h in (1e-3, 3.3e-4, 1e-4):
        run = rw.simulate(pushing, rw.QUASISTATIC_RIGID, step=h)
        assert run.outcome.name == "timeout", run.reason
        assert run.final["b"]["x"] == pytest.approx((600.0 + 20.0 - 50.0) / 1100.0, abs=1e-6)
