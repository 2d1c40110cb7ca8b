"""Bodies on a support: friction in an ellipsoid about the centre of pressure, and pushes against it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.outcome import Code
from rungwise.simulation.planar.state.workspace import SCALARS

RNG = np.random.default_rng(20)
FORCES = ("quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant")
BOX = {"kind": "box", "width": 0.2, "height": 0.12}
G = 9.81


def part(support: dict[str, Any], pose: tuple[float, ...] = (0.0, 0.0, 0.0), **more: Any) -> dict[str, Any]:
    """A free box of mass 1 on a support."""
    place = dict(zip(("x", "y", "angle"), pose, strict=True))
    body = {"role": "object", "shape": BOX, "mass": 1.0, "pose": place, "motion": {"kind": "free"}}
    return body | {"support": {"friction": 0.4, "load": G} | support} | more


def pusher(x: float, y: float, ux: float, uy: float) -> dict[str, Any]:
    """A point that moves at (ux, uy) and does not turn."""
    speeds = {"x": ux, "y": uy, "angle": 0.0}
    drives = {name: {"drive": {"kind": "speed", "speed": speed}} for name, speed in speeds.items()}
    pose = {"x": x, "y": y}
    return {
        "role": "robot",
        "shape": {"kind": "point"},
        "pose": pose,
        "motion": {"kind": "free"},
        "coordinates": drives,
    }


def scene(bodies: dict[str, Any], mu: float = 0.0, **more: Any) -> dict[str, Any]:
    contacts = [{"between": ["*", "*"], "friction": mu}]
    return {"name": "push", "bodies": bodies, "contacts": contacts, "step": 1e-3, "duration": 2.0} | more


def twist(run: rw.Run, first: int = 0) -> np.ndarray[Any, Any]:
    """Velocity (3,) of the first body."""
    assert run.workspace is not None
    return run.workspace.state.v[first : first + 3].copy()


def ratio(c: float) -> dict[str, Any]:
    return {"pressure": {"kind": "ratio", "ratio": c}}


@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
@pytest.mark.parametrize("heading", RNG.uniform(0.0, 2.0 * math.pi, 4))
def test_a_body_stops_after_v2_over_2_mu_g_whatever_its_heading(model: str, heading: float) -> None:
    v, mu, h = 0.8, 0.4, 1e-3
    speeds = {"x": {"speed": v * math.cos(heading)}, "y": {"speed": v * math.sin(heading)}}
    body = part({"friction": mu}, (0.0, 0.0, 1.3 * heading), coordinates=speeds)
    run = rw.simulate(scene({"p": body}, step=h), model)
    x, y = run.final["p"]["x"], run.final["p"]["y"]
    # Implicit Euler lags by half a step of the first speed.
    assert math.hypot(x, y) == pytest.approx(v * v / (2 * mu * G) - 0.5 * h * v, abs=h * h * mu * G)
    assert abs(math.remainder(math.atan2(y, x) - heading, 2.0 * math.pi)) < 1e-9


@pytest.mark.parametrize("kind", ["uniform", "ring", "points"])
def test_a_spin_ends_after_omega_rho2_over_mu_g_c(kind: str) -> None:
    omega, mu, rho2, h = 9.0, 0.4, (0.2**2 + 0.12**2) / 12.0, 1e-4
    feet = [[0.1, 0.06], [-0.1, 0.06], [-0.1, -0.06], [0.1, -0.06]]
    pressure, c = {
        "uniform": ({"kind": "uniform"}, None),
        "ring": ({"kind": "ring", "radius": 0.07}, 0.07),
        "points": ({"kind": "points", "points": feet}, math.hypot(0.1, 0.06)),
    }[kind]
    if c is None:
        d, a, b = math.hypot(0.2, 0.12), 0.2, 0.12
        c = (d + a * a / (2 * b) * math.asinh(b / a) + b * b / (2 * a) * math.asinh(a / b)) / 6.0
    body = part({"friction": mu, "pressure": pressure}, coordinates={"angle": {"speed": omega}})
    run = rw.simulate(scene({"p": body}, step=h, goal=f"speed(p.angle) <= {1e-9 * omega}"), "dynamic-rigid")
    time, turn = omega * rho2 / (mu * G * c), omega**2 * rho2 / (2 * mu * G * c)
    assert run.time == pytest.approx(time, abs=1.01 * h)
    assert run.final["p"]["angle"] == pytest.approx(turn - 0.5 * h * omega, abs=1e-6 * turn)
    assert abs(run.final["p"]["x"]) < 1e-12


@pytest.mark.parametrize("c", [0.03, 0.0673, 0.12])
def test_slide_and_spin_fall_along_the_curve_of_the_ellipsoid(c: float) -> None:
    """omega / omega0 = (v / v0)^(c^2 / rho^2)."""
    rho2, errors = (0.2**2 + 0.12**2) / 12.0, []
    speeds = {"x": {"speed": 0.6}, "y": {"speed": -0.3}, "angle": {"speed": 7.0}}
    for h in (1e-4, 2.5e-5):
        given = scene({"p": part(ratio(c), coordinates=speeds)}, step=h, duration=0.1)
        v = twist(rw.simulate(given, "dynamic-rigid"))
        expected = 7.0 * (math.hypot(v[0], v[1]) / math.hypot(0.6, 0.3)) ** (c * c / rho2)
        errors.append(abs(v[2] - expected))
    assert errors[1] < 0.3 * errors[0] and errors[1] < 1e-3


def expected_push(
    x: float, y: float, u: np.ndarray[Any, Any], c: float, mu: float, n: np.ndarray[Any, Any]
) -> tuple[np.ndarray[Any, Any], bool]:
    """Twist at the centre of pressure of a push at (x, y) with velocity u, in the body frame; does it stick.

    Lynch's sticking push if its force is in the cone about the inward normal n, else the force on its edge.
    """
    total = c * c + x * x + y * y
    v = np.array([(c * c + x * x) * u[0] + x * y * u[1], x * y * u[0] + (c * c + y * y) * u[1]]) / total
    t = np.array([-n[1], n[0]])
    if v @ n > 0.0 and abs(v @ t) <= mu * (v @ n):
        return np.array([*v, (x * v[1] - y * v[0]) / c**2]), True
    f = n + mu * math.copysign(1.0, v @ t) * t
    omega = (x * f[1] - y * f[0]) / c**2
    met = (f + omega * np.array([-y, x])) @ n
    return np.array([*f, omega]) * (u @ n) / met, False


def random_push(rng: np.random.Generator) -> dict[str, Any]:
    """A push at the left side of a turned box: its scene but for the mode of friction, and its data."""
    c, angle = float(rng.uniform(0.02, 0.12)), float(rng.uniform(-3.0, 3.0))
    centre = rng.uniform(-0.04, 0.04, 2)
    at = np.array([-0.1, rng.uniform(-0.055, 0.055)])
    u = float(rng.uniform(0.05, 0.2)) * np.array([1.0, rng.uniform(-0.6, 0.6)])
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return {"c": c, "angle": angle, "centre": centre, "at": at, "u": u, "turn": turn}


def pushed(push: dict[str, Any], mu: float, mu_s: float = 0.4, **more: Any) -> dict[str, Any]:
    support = {"friction": mu_s, "centre": push["centre"].tolist(), **ratio(push["c"])}
    place, u = push["turn"] @ push["at"], push["turn"] @ push["u"]
    bodies = {"p": part(support, (0.0, 0.0, push["angle"])), "f": pusher(*place, *u)}
    return scene(bodies, mu, duration=1e-3, **more)


def test_pushes_stick_and_slide_as_the_limit_surface_says() -> None:
    rng, stuck = np.random.default_rng(5), 0
    for _ in range(24):
        push, mu = random_push(rng), float(rng.uniform(0.05, 0.8))
        run = rw.simulate(scene_of := pushed(push, mu), "quasistatic-rigid")
        found = twist(run)
        x, y = push["at"] - push["centre"]
        expected, sticks = expected_push(x, y, push["u"], push["c"], mu, np.array([1.0, 0.0]))
        back = -push["centre"]
        moved = expected[:2] + expected[2] * np.array([-back[1], back[0]])
        size = np.abs(found).max()
        np.testing.assert_allclose(found, [*(push["turn"] @ moved), expected[2]], atol=2e-8 * size)
        assert str(run.outcome) in ("timeout", "missed"), scene_of
        stuck += sticks
    assert 5 < stuck < 20


def test_the_kinematic_rung_pushes_without_friction_about_the_centre_of_mass() -> None:
    rng, rho = np.random.default_rng(6), math.sqrt((0.2**2 + 0.12**2) / 12.0)
    for _ in range(8):
        push = random_push(rng)
        found = twist(rw.simulate(pushed(push, 0.8), "kinematic"))
        x, y = push["at"]
        expected, _ = expected_push(x, y, push["u"], rho, 0.0, np.array([1.0, 0.0]))
        turned = [*(push["turn"] @ expected[:2]), expected[2]]
        # Linearised again about the motion: exact to the turn of the rows within the step.
        np.testing.assert_allclose(found, turned, atol=3e-2 * np.abs(found).max())


def final(given: dict[str, Any], model: str, **options: Any) -> np.ndarray[Any, Any]:
    run = rw.simulate(given, model, **options)
    assert str(run.outcome) in ("timeout", "missed", "goal"), run.reason
    return np.array([run.final["p"][name] for name in ("x", "y", "angle")])


def long_push(
    speed: float, mu_s: float, length: float = 0.06, steps: int = 120, **contact: Any
) -> dict[str, Any]:
    support = {"friction": mu_s, "centre": [0.02, -0.01]}
    bodies = {"p": part(support), "f": pusher(-0.1, 0.02, speed, 0.2 * speed)}
    given = scene(bodies, 0.3, duration=length / speed, step=length / speed / steps)
    given["contacts"][0] |= contact
    return given


def test_rigid_quasistatic_pushes_depend_neither_on_speed_nor_on_friction() -> None:
    base = final(long_push(0.1, 0.4), "quasistatic-rigid")
    assert abs(base[2]) > 0.05
    for speed, mu_s in ((1e-4, 0.4), (30.0, 0.4), (0.1, 1e-3), (0.1, 40.0), (3.0, 0.02)):
        np.testing.assert_allclose(final(long_push(speed, mu_s), "quasistatic-rigid"), base, atol=1e-8)


def test_compliant_quasistatic_pushes_differ_by_the_give_of_the_contact() -> None:
    """O(mu_s N / K) without damping, and O(C v / K)."""
    base = final(long_push(0.1, 0.4), "quasistatic-rigid")
    far = []
    for K, C, speed in ((1e5, 0.0, 0.1), (1e6, 0.0, 0.1), (1e5, 3e3, 0.1), (1e6, 3e4, 0.1)):
        given = long_push(speed, 0.4, steps=480, stiffness=K, damping=C)
        rigid = final(long_push(speed, 0.4, steps=480), "quasistatic-rigid")
        apart = np.abs(final(given, "quasistatic-compliant") - rigid).max()
        far.append(apart)
        assert apart < 30.0 * (0.4 * G + C * speed) / K, (K, C, apart)
    assert far[1] < 0.2 * far[0]
    assert np.abs(base).max() > 0.05


def test_dynamic_pushes_tend_to_quasistatic_ones_with_the_square_of_the_speed() -> None:
    slow = final(long_push(1e-2, 0.4), "quasistatic-rigid")
    apart = []
    for speed in (0.02, 0.01, 0.005):
        apart.append(np.abs(final(long_push(speed, 0.4), "dynamic-rigid") - slow).max())
    orders = np.log2(np.array(apart[:-1]) / apart[1:])
    assert (orders > 1.9).all(), (apart, orders)


@pytest.mark.parametrize("model", ("kinematic", *FORCES))
def test_mirrored_pushes(model: str) -> None:
    for mu in (0.0, 0.3):
        ends = []
        for sign in (1.0, -1.0):
            support = {"centre": [0.02, -0.01 * sign], "pressure": {"kind": "uniform"}}
            speeds = {"y": {"speed": 0.05 * sign}, "angle": {"speed": 2.0 * sign}}
            bodies = {
                "p": part(support, (0.0, 0.0, 0.4 * sign), coordinates=speeds),
                "f": pusher(-0.13, 0.02 * sign, 0.2, 0.02 * sign),
            }
            ends.append(final(scene(bodies, mu, duration=0.4, step=2e-3), model))
        np.testing.assert_allclose(ends[0] * [1.0, -1.0, -1.0], ends[1], atol=1e-9)
        assert np.abs(ends[0]).max() > 0.02


@pytest.mark.parametrize("model", FORCES)
def test_rows_of_bodies_push_each_other_in_any_order(model: str) -> None:
    bodies = {
        "p": part({"centre": [0.01, 0.0]}),
        "q": part({"friction": 0.1, "pressure": {"kind": "ring", "radius": 0.05}}, (0.22, 0.04, 0.3)),
        "f": pusher(-0.1, 0.01, 0.2, 0.0),
    }
    ends = []
    for order in (("p", "q", "f"), ("f", "q", "p"), ("q", "p", "f")):
        given = scene({name: bodies[name] for name in order}, 0.2, duration=0.5, step=2e-3)
        ends.append(final(given, model))
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-8)
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-8)


@pytest.mark.parametrize("model", FORCES)
def test_controlled_steps_agree_with_short_ones(model: str) -> None:
    given = long_push(0.1, 0.4, steps=2000, damping=1e3)
    fine, controlled = final(given, model), final(given, model, tol=1e-7)
    np.testing.assert_allclose(controlled, fine, atol=3e-4)


@pytest.mark.parametrize("model", FORCES)
def test_the_support_takes_the_work_that_the_pusher_does(model: str) -> None:
    """Drive, contacts and support balance on the quasistatic rigid rung, where nothing is stored."""
    run = rw.simulate(long_push(0.1, 0.4), model)
    assert run.workspace is not None
    count = int(run.workspace.state.clock[0]["frames"])
    work = {name: run.workspace.frames.scalars[:count, k] for k, name in enumerate(SCALARS)}
    support, drive = work["support_work"], work["drive_work"]
    assert (np.diff(support) <= 0.0).all() and support[-1] < -0.02
    if model == "quasistatic-rigid":
        assert support[-1] + drive[-1] + work["contact_work"][-1] == pytest.approx(0.0, abs=1e-6 * drive[-1])


def test_supports_in_batches_with_their_numbers_as_parameters() -> None:
    names = ("mu_s", "N", "r")
    body = part({"friction": "mu_s", "load": "N", "pressure": {"kind": "ring", "radius": "r"}})
    body["coordinates"] = {"x": {"speed": 0.5}, "angle": {"speed": 4.0}}
    given = scene({"p": body}, duration=0.1, goal="speed(p.x) < 0.45")
    given["parameters"] = {name: {"default": 0.1} for name in names}
    points = np.array([[0.4, 3.0, 0.05], [0.1, 9.0, 0.02], [0.0, 9.0, 0.02], [1.0, 0.0, 0.1]])
    found = rw.Batch(rw.load(given), "dynamic-rigid", names, step=1e-3, tol=None, threads=1).run(points)
    for k, point in enumerate(points):
        values = dict(zip(names, point.tolist(), strict=True))
        run = rw.simulate(given, "dynamic-rigid", parameters=values)
        assert run.outcome.code == found.outcome[k] == (Code.GOAL if k < 2 else Code.TIMEOUT)
        assert run.time == found.time[k]


def test_a_torque_free_support_only_opposes_the_centre_of_pressure() -> None:
    """One point carries the body: spin about it goes on, and is not slowed."""
    foot = {"kind": "points", "points": [[0.0, 0.0]]}
    body = part({"pressure": foot}, coordinates={"angle": {"speed": 3.0}, "x": {"speed": 0.2}})
    v = twist(rw.simulate(scene({"p": body}, duration=0.2), "dynamic-rigid"))
    np.testing.assert_allclose(v, [0.0, 0.0, 3.0], atol=1e-12)


def test_the_scene_is_pushed_to_its_pose_on_all_rungs_with_forces() -> None:
    given = rw.load("push")
    said = {rung.name: str(rw.simulate(given, rung).outcome) for rung in rw.LADDER if rung.moves}
    assert said == dict.fromkeys(FORCES, "goal") | {"kinematic": "timeout"}


@pytest.mark.parametrize("model", FORCES)
def test_the_scene_turned_over(model: str) -> None:
    """A push above the middle of the box is the mirror image of one below."""
    ends = []
    for sign in (1.0, -1.0):
        over = {"offset": 0.03 * sign, "press_y": 0.01 * sign, "angle": 0.2 * sign, "near": 0.0}
        end = rw.simulate("push", model, parameters=over, step=5e-3).final["box"]
        ends.append([end["x"], sign * end["y"], sign * end["angle"]])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_a_body_on_a_slope_rests_up_to_its_friction_and_no_further() -> None:
    for slope, rests in ((0.99 * 0.4 * G, True), (1.01 * 0.4 * G, False)):
        load = [slope * math.cos(1.0), slope * math.sin(1.0)]
        for model in FORCES:
            run = rw.simulate(scene({"p": part({})}, gravity=load, duration=0.2), model)
            if rests:
                assert run.final["p"] == {"x": 0.0, "y": 0.0, "angle": 0.0}
            elif model.startswith("quasistatic"):
                assert str(run.outcome) == "unsupported" and run.certificate is not None
            else:
                moved = 0.5 * 0.01 * 0.4 * G * 0.2 * (0.2 + 1e-3)
                assert math.hypot(run.final["p"]["x"], run.final["p"]["y"]) == pytest.approx(moved, rel=1e-9)


def test_a_jam_between_a_rod_and_a_wall_is_proved() -> None:
    wall = {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [-1, 0]}, "pose": {"x": 0.15}}
    bodies = {"p": part({}), "w": wall, "f": pusher(-0.1, 0.03, 0.2, 0.0)}
    for model, kind in (
        ("kinematic", "kinematic"),
        ("quasistatic-rigid", "frictional"),
        ("dynamic-rigid", "frictional"),
    ):
        run = rw.simulate(scene(bodies, 0.3), model)
        assert str(run.outcome) == "jammed" and run.certificate is not None, run.reason
        assert run.certificate.kind == kind


def test_runs_on_supports_go_on_bit_for_bit() -> None:
    for model in ("kinematic", *FORCES):
        whole = rw.simulate("push", model, step=1e-2, parameters={"near": 0.0})
        for state in (whole.states[100], whole.states[357]):
            rest = rw.simulate("push", model, step=1e-2, parameters={"near": 0.0}, state=state)
            assert rest.final == whole.final


@pytest.mark.parametrize("lightest", [1e-4, 1e-8])
@pytest.mark.parametrize("offset", [0.0, 0.015])
def test_a_part_is_pushed_alike_beside_parts_of_very_unequal_load(lightest: float, offset: float) -> None:
    """A contact that a pusher drives must yield, however small the loads of others are."""
    bodies = {"p": part({}, (0.1, offset, 0.0)), "f": pusher(-0.001, 0.0, 0.2, 0.0)}
    alone = rw.simulate(scene(bodies, 0.3, duration=0.3), "quasistatic-rigid")
    for k, ratio in enumerate((1.0, math.sqrt(lightest), lightest)):
        bodies[f"o{k}"] = part({"load": ratio * G}, (0.4 * k, 1.0, 0.1), mass=ratio)
    beside = rw.simulate(scene(bodies, 0.3, duration=0.3), "quasistatic-rigid")
    assert str(beside.outcome) == str(alone.outcome) == "timeout"
    assert alone.final["p"]["x"] > 0.1
    assert beside.final["p"] == pytest.approx(alone.final["p"], abs=1e-9)


@pytest.mark.parametrize("lightest", [1e-4, 1e-8])
def test_a_row_of_parts_of_very_unequal_load_is_pushed_as_far_as_the_pusher_goes(lightest: float) -> None:
    loads = [lightest, 1.0, math.sqrt(lightest)]
    for order in ((0, 1, 2), (1, 0, 2), (2, 1, 0)):
        row = {
            f"o{k}": part({"load": loads[i] * G}, (0.1 + 0.2 * k, 0.0, 0.0), mass=loads[i])
            for k, i in enumerate(order)
        }
        given = scene(row | {"f": pusher(-0.001, 0.0, 0.2, 0.0)}, 0.3, duration=0.3)
        run = rw.simulate(given, "quasistatic-rigid")
        assert str(run.outcome) == "timeout", run.reason
        ends = [run.final[name]["x"] for name in row]
        expected = [-0.001 + 0.2 * 0.3 + 0.1 + 0.2 * k for k in range(3)]
        np.testing.assert_allclose(ends, expected, atol=1e-6)
