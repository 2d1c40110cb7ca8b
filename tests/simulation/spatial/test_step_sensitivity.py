"""Derivatives of one step in space: closed forms, steps that the simulation takes, and planar twins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.simulation.derivatives.sensitivity import differentiated, prepared, started
from rungwise.simulation.derivatives.space_assembly import SpaceAssembly
from rungwise.simulation.derivatives.steps import Array, Start

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, G, free, world
from .rungs import DYNAMIC, RIGID, WITH_LOADS, named

H, SPEED, ANGLE, MU = 1e-3, 2.0, 20.0, 0.25
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def test_free_flight() -> None:
    """Places keep their changes and gain h those of speeds; a turn is seen from axes that have turned since,
    and without moments of inertia that differ speeds keep theirs."""
    v = [1.0, 0.0, 2.0, 0.0, 0.0, 3.0]
    q = [0.0, 0.0, 5.0, 0.48, 0.6, 0.0, 0.64]
    s = rw.step_sensitivity("ball", "dynamic-rigid", None, q, v, 0.1)
    turn = 0.3
    back = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    by_q = np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), back]])
    np.testing.assert_allclose(s.dq["q"], by_q, atol=1e-9)
    np.testing.assert_allclose(s.dv["v"], np.eye(6), atol=1e-9)
    np.testing.assert_allclose(s.dq["v"][:3], 0.1 * np.eye(6)[:3], atol=1e-9)
    # About z itself a turn grows by h; across it the mean of the axes while they turn remains.
    mean = np.array([[np.sin(turn), 1.0 - np.cos(turn)], [np.cos(turn) - 1.0, np.sin(turn)]]) / turn
    np.testing.assert_allclose(s.dq["v"][3:5, 3:5], 0.1 * mean, atol=1e-8)
    assert s.dq["v"][5, 5] == pytest.approx(0.1) and not s.contact.weak
    assert s.q.shape == (7,) and s.dq["q"].shape == (6, 6) and s.deformation.shape[1] == 3


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_block_slides_down_a_slope(rung: Rung) -> None:
    """v' = v + h g (sin a - mu cos a), with a in degrees; where contacts yield, once they have settled."""
    given = {"angle": ANGLE, "mu": MU}
    run = rw.simulate("slope", rung, parameters=given, duration=0.2)
    end = run.frames[-1]
    s = rw.step_sensitivity(
        "slope", rung, given, end.q, end.v, H, wrt=("parameters", "v"), names=tuple(given)
    )
    a = np.radians(ANGLE)
    if not rung.compliant:
        exact = [H * G * (np.cos(a) + MU * np.sin(a)) * np.pi / 180.0, -H * G * np.cos(a)]
        np.testing.assert_allclose(s.dv["parameters"][0], exact, rtol=1e-7)
        np.testing.assert_allclose(s.dq["parameters"][0], H * np.array(exact), rtol=1e-7)
        assert s.dv["v"][0, 0] == pytest.approx(1.0, rel=1e-9)
    assert s.dv["parameters"][0, 0] > 0.0 > s.dv["parameters"][0, 1]


def test_a_ball_rolls() -> None:
    """A force f on a ball that rolls adds 5/7 h f / m, and turns it as it rolls; friction changes nothing."""
    q, v = [0.0, 0.0, 0.1, *UPRIGHT], [1.0, 0.0, 0.0, 0.0, 10.0, 0.0]
    given = {"v": 1.0, "mu": 0.5}
    s = rw.step_sensitivity(
        "ball", "dynamic-rigid", given, q, v, H, wrt=("inputs", "parameters"), names=["mu"]
    )
    m = rw.load("ball").bind(rw.load("ball").parameters(given)).model.body_mass[1]
    push = 5.0 / 7.0 * H / m
    np.testing.assert_allclose(s.dv["inputs"][:3, 0], [push, 0.0, 0.0], atol=1e-12)
    assert s.dv["inputs"][4, 0] == pytest.approx(push / 0.1, rel=1e-9)
    np.testing.assert_allclose(s.dv["parameters"], 0.0, atol=1e-9)
    assert set(s.dq) == {"inputs", "parameters"} and s.names == ("mu",)


@pytest.mark.parametrize("rung", RIGID, ids=named)
def test_a_box_at_rest_stays(rung: Rung) -> None:
    """Friction takes a small force in any direction but upwards, and the box stays where it is put."""
    q = [0.0, 0.0, 0.05, *UPRIGHT]
    s = rw.step_sensitivity("slope", rung, {"angle": 5.0}, q, np.zeros(6), H, wrt=("q", "inputs"))
    np.testing.assert_allclose(s.dq["inputs"], 0.0, atol=1e-15)
    along = [0, 1, 5]
    np.testing.assert_allclose(s.dq["q"][np.ix_(along, along)], np.eye(3), atol=1e-6)
    np.testing.assert_allclose(s.dq["q"][2], 0.0, atol=1e-6)  # a gap closes within the step


@pytest.mark.parametrize("rung", RIGID, ids=named)
def test_a_block_that_rests_on_a_slope_turns_as_it_is_turned(rung: Rung) -> None:
    """Its corners share friction in some way; rounding lets none slip."""
    end = rw.simulate("slope", rung, duration=0.3).frames[-1]
    s = rw.step_sensitivity("slope", rung, None, end.q, end.v, H, wrt=("q",))
    assert not s.contact.forces_determined
    assert s.dq["q"][5, 5] == pytest.approx(1.0, abs=1e-6)


def test_a_finger_on_a_servo_pushes_a_box_on_a_spring(make: Make) -> None:
    """Stiffnesses in series: by the target u the box moves as 1/k_spring over the sum of all 1/k."""
    servo, contact, spring = 300.0, 800.0, 500.0
    scene = make(
        world(
            '<body name="f"><joint name="f" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body>',
            f'<body name="b" pos=".3 0 0"><joint name="b" type="slide" axis="1 0 0" stiffness="{spring}"/>'
            '<geom type="box" size=".2 .2 .2" mass="1"/></body>',
            before=NO_GRAVITY, after=f'<actuator><position name="u" joint="f" kp="{servo}"/></actuator>',
        ),
        parameters={"u": {"default": 0.01, "range": [0, 1]}, "k": {"default": contact, "range": [1, 1e4]}},
        contacts=[{"friction": 0.3, "stiffness": "k", "damping": 0.0}],
        controls={"u": "u"},
    )  # fmt: skip
    s = rw.step_sensitivity(
        scene, "quasistatic-compliant", None, [0.0, 0.0], [0.0, 0.0], 0.1, wrt=("parameters",)
    )
    give = 1.0 / servo + 1.0 / contact + 1.0 / spring
    np.testing.assert_allclose(
        s.dq["parameters"][:, 0], [1.0 - 1.0 / servo / give, 1.0 / spring / give], rtol=1e-6
    )
    force = 0.01 / give
    by_k = force / (give * contact**2) * np.array([-1.0 / servo, 1.0 / spring])
    np.testing.assert_allclose(s.dq["parameters"][:, 1], by_k, rtol=1e-5)
    slot = int(np.flatnonzero(s.deformation[:, 0])[0])
    assert s.deformation[slot, 0] == pytest.approx(force / contact, rel=1e-6)
    assert s.ddeformation["parameters"][3 * slot, 0] == pytest.approx(1.0 / give / contact, rel=1e-6)


@pytest.mark.parametrize("rung", [rung for rung in RIGID if rung.inertia == 0.0] + [rw.KINEMATIC], ids=named)
def test_a_prescribed_finger_pushes_what_nothing_resists(make: Make, rung: Rung) -> None:
    """The box goes as far as the finger; the force that pushes it vanishes with its inertia."""
    scene = make(
        world(
            '<body name="f"><joint name="f" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body>',
            '<body name="b" pos=".3 0 0"><joint name="b" type="slide" axis="1 0 0"/>'
            '<geom type="box" size=".2 .2 .2" mass="1"/></body>',
            before=NO_GRAVITY,
        ),
        parameters={"pace": {"default": 0.5, "range": [0, 1]}},
        speeds={"f.f": "pace"},
    )
    s = rw.step_sensitivity(scene, rung, None, [0.0, 0.0], [0.0, 0.0], 0.1)
    np.testing.assert_allclose(s.q, [0.05, 0.05], atol=1e-9)
    np.testing.assert_allclose(s.dq["parameters"][:, 0], [0.1, 0.1], atol=1e-9)
    np.testing.assert_allclose(s.dq["inputs"], [[0.1, 0.0], [0.1, 0.0]], atol=1e-9)
    np.testing.assert_allclose(s.dq["q"], [[1.0, 0.0], [1.0, 0.0]], atol=1e-6)


def test_what_touches_without_force_has_one_sided_derivatives(make: Make) -> None:
    """A ball on the floor without weight: pushed up it flies off; drawn down it does not move."""
    scene = make(world(FLOOR, free("b", "0 0 .1", 'size=".1"'), before=NO_GRAVITY))
    q = [0.0, 0.0, 0.1, *UPRIGHT]
    s = rw.step_sensitivity(scene, "dynamic-rigid", None, q, np.zeros(6), H, wrt=("inputs",))
    assert s.contact.weak == (0,)
    assert s.dv["inputs"][2, 2] == pytest.approx(H)
    assert s.contact.forward(c=-np.eye(6)[2]).v[2, 0] == pytest.approx(0.0, abs=1e-15)


def _twin(make: Make, pace: float, spin: float) -> rw.Scene | Any:
    """The disc of `slide_roll` as a ball with a disc's inertia."""
    ball = (
        '<body name="b" pos="0 0 .1"><freejoint/><geom size=".1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia=".005 .005 .005"/></body>'
    )
    return make(
        world(FLOOR, ball),
        parameters={
            "v0": {"default": pace, "range": [0, 9]}, "mu": {"default": 0.2, "range": [0, 1]},
            "stiffness": {"default": 1e6, "range": [1, 1e9]}, "damping": {"default": 1e3, "range": [0, 1e9]},
        },
        contacts=[{"friction": "mu", "stiffness": "stiffness", "damping": "damping"}],
        start={"velocities": {"b.x": "v0", "b.ry": str(-spin)}},
    )  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize(("pace", "spin"), [(1.0, 0.0), (1.0, -10.0), (2.0, 1.0)])
def test_a_scene_in_space_and_its_planar_twin_agree(make: Make, rung: Rung, pace: float, spin: float) -> None:
    """x, y, angle of the plane are x, z, -ry of space."""
    names, signs = ("mu", "stiffness", "damping"), np.array([1.0, 1.0, -1.0])
    sink = 0.0 if not rung.compliant else 9.81e-6
    v = np.array([pace, 0.0, spin])
    flat = rw.step_sensitivity(
        "slide_roll", rung, None, [0.0, 0.1 - sink, 0.0], v, H, names=names, wrt=("q", "v", "parameters")
    )
    q = [0.0, 0.0, 0.1 - sink, *UPRIGHT]
    twin = rw.step_sensitivity(
        _twin(make, pace, spin), rung, None, q, [pace, 0.0, 0.0, 0.0, -spin, 0.0], H, names=names,
        wrt=("q", "v", "parameters"),
    )  # fmt: skip
    own = [0, 2, 4]
    for kind in ("q", "v"):
        for one, other in ((flat.dq, twin.dq), (flat.dv, twin.dv)):
            got = signs[:, None] * other[kind][np.ix_(own, own)] * signs
            np.testing.assert_allclose(got, one[kind], rtol=1e-5, atol=1e-6)
    got = signs[:, None] * twin.dv["parameters"][own]
    np.testing.assert_allclose(got, flat.dv["parameters"], rtol=1e-5, atol=1e-10)


MEMBERS = {
    "ball": (0.02, 0.2), "slope": (0.1,), "stack": (0.1,), "three_fingers": (0.3, 0.8), "arm_push": (0.3,),
    "floor_push": (0.2,), "hand_turn": (0.2,),
}  # fmt: skip


def begun(name: str, rung: Rung, until: float) -> tuple[Any, Any, Start, tuple[str, ...]]:
    """Steps of a scene, their changes, and where a run has come to after a few of them; overlap is taken back
    within a step, as what opens is."""
    scene = rw.load(name)
    run = rw.simulate(scene, rung, duration=until)
    values = scene.parameters(None)
    names = tuple(name for name in values if values[name] != 0.0)[:6]
    here, changes = prepared(
        scene, rung, None, 2e-3, 1.0, ("q", "v", "inputs", "parameters"), names, Deadline()
    )
    assert isinstance(here, SpaceAssembly)
    for at in (here, *(at for pair in changes.varied for _, at in pair)):
        at._stepper.terms.pause[0] = 2e-3  # type: ignore[attr-defined]
    end = run.frames[-1]
    start = started(here, end.q, end.v, None, run.time)
    for _ in range(2):
        start = here.taken(start).end
    return here, changes, start, names


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("name", "until", "rung"),
    [
        pytest.param(name, t, rung, id=f"{name}-{t}-{rung.name}")
        for name, times in MEMBERS.items()
        for t in times
        for rung in WITH_LOADS
    ],
)
def test_against_steps_taken(name: str, until: float, rung: Rung) -> None:
    """Where redundant rigid contacts leave a motion open, there is nothing to compare."""
    here, changes, start, names = begun(name, rung, until)
    scene, values = rw.load(name), rw.load(name).parameters(None)
    rng = np.random.default_rng(5)
    speed = max(float(np.abs(here.lever * start.v).max()), 1e-3 * here.reach / here.h)
    unit = np.concatenate([here.lever, here.h * here.lever])  # of what changes, as lengths

    def moved(kind: str, i: int) -> tuple[float, Callable[[float], Start]]:
        """Size of a change, and where it leads."""
        one = np.eye(changes.size(kind))[i]
        if kind == "parameters":
            size = 1e-6 * abs(values[names[i]])
            return (
                size,
                lambda by: (
                    here.like(scene, rung, {**values, names[i]: values[names[i]] + by}).taken(start).end
                ),
            )
        size = 1e-6 * (here.reach if kind == "q" else speed) / here.lever[i]
        return size, lambda by: here.taken(here.moved(start, kind, by * one)).end

    def difference(kind: str, i: int) -> Array:
        size, end = moved(kind, i)
        low, high = end(-size), end(size)
        return np.concatenate([here.apart(low.q, high.q), high.v - low.v]) / (2.0 * size)

    compared = 0
    for kind in ("q", "v", "parameters"):
        for i in rng.permutation(changes.size(kind))[:3]:
            along = {kind: np.eye(changes.size(kind))[:, i : i + 1]}
            try:
                step = differentiated(here, changes, start, along, Deadline())
            except rw.ModelError as error:
                # Corners of boxes that coincide, and a capsule along a face.
                assert name in ("stack", "arm_push") and kind == "q"
                assert f"by {here.named(kind, i)}" in str(error)
                continue
            got = np.concatenate([step.state["q"], step.state["v"]])[:, 0]
            if np.isnan(got).any():
                assert not rung.compliant and not step.contact.forces_determined
                continue
            expected, size = difference(kind, i), moved(kind, i)[0]
            tolerance = 1e-4 * np.abs(unit * expected).max() + 2e-10 * here.reach / size
            np.testing.assert_allclose(
                unit * got, unit * expected, rtol=0.0, atol=tolerance, err_msg=f"{kind} {i}"
            )
            compared += 1
    assert compared >= 3 or not step.contact.velocities_determined


def test_a_step_that_is_linearised_again(make: Make) -> None:
    """A ball swings over the floor about a hinge below it: where its arc goes down again the floor stops it,
    which is seen only where the first solution leads."""
    tip = '<joint name="j" axis="0 1 0"/><geom pos="0 0 1.1" size=".1" mass="1"/>'
    scene = make(world(FLOOR, f'<body name="b" pos="0 0 -1">{tip}</body>', before=NO_GRAVITY))
    here, changes = prepared(scene, "dynamic-rigid", None, 0.02, 1.0, ("q", "v"), (), Deadline())
    assert isinstance(here, SpaceAssembly)
    here._stepper.terms.pause[0] = 0.02
    start = started(here, [-0.005], [1.0], None, 0.0)
    end = here.taken(start).end
    assert len(here._stepper.noted) > 1 and end.v[0] < 0.9
    for kind in ("q", "v"):
        step = differentiated(here, changes, start, {kind: np.eye(1)}, Deadline())
        low, high = (here.taken(here.moved(start, kind, np.array([side * 1e-7]))).end for side in (-1.0, 1.0))
        assert step.state["q"][0, 0] == pytest.approx((high.q[0] - low.q[0]) / 2e-7, rel=1e-4)
        assert step.state["v"][0, 0] == pytest.approx((high.v[0] - low.v[0]) / 2e-7, rel=1e-4)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["three_fingers", "floor_push"])
def test_derivatives_follow_features_over_steps(name: str) -> None:
    """A chain of two steps, deformations included, against differences of both together."""
    here, changes, start, _ = begun(name, rw.DYNAMIC_COMPLIANT, 0.8)
    n, slots = len(here.lever), start.deformation.size
    directions = {"q": np.eye(n), "v": np.zeros((n, n)), "deformation": np.zeros((slots, n))}
    _, changes = prepared(name, rw.DYNAMIC_COMPLIANT, None, 2e-3, 1.0, tuple(directions), (), Deadline())
    at = start
    for _ in range(2):
        step = differentiated(here, changes, at, directions, Deadline())
        at, directions = (
            step.end,
            {"q": step.state["q"], "v": step.state["v"], "deformation": step.state["deformation"]},
        )
    for i in range(0, n, 3):
        by, ends = 1e-6 * here.reach / here.lever[i] * np.eye(n)[i], list[Start]()
        for side in (-1.0, 1.0):
            end = here.moved(start, "q", side * by)
            for _ in range(2):
                end = here.taken(end).end
            ends.append(end)
        expected = here.apart(ends[0].q, ends[1].q) / (2.0 * by[i])
        scale = np.abs(here.lever * expected).max()
        np.testing.assert_allclose(
            here.lever * step.state["q"][:, i], here.lever * expected, atol=2e-3 * scale
        )


def test_contacts_of_a_cylinder_that_stands_turn_with_it(make: Make) -> None:
    """A tilt to either side does not put them on other points of its rim."""
    scene = make(world(FLOOR, free("can", "0 0 .05", 'type="cylinder" size=".1 .05"')))
    given = scene, "dynamic-compliant", None, [0.0, 0.0, 0.05, *UPRIGHT], np.zeros(6), H
    found = rw.step_sensitivity(*given, wrt=("q", "inputs", "v"))
    assert np.isfinite(found.dv["q"]).all() and np.isfinite(found.dv["inputs"]).all()


def test_a_contact_with_two_slopes_is_named() -> None:
    """The corners of two boxes coincide: where one is moved, the nearer edges bound the contact."""
    q = rw.simulate("stack", "dynamic-rigid", duration=0.01).frames[-1].q
    with pytest.raises(rw.ModelError, match=r"feature is about to change.*by box0.x of q"):
        rw.step_sensitivity("stack", "dynamic-rigid", None, q, np.zeros(60), H, wrt=("q",))


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wrt": ("speed",)}, "wrt: 'speed' is none of"),
        ({"names": ("weight",)}, "names: unknown parameter 'weight'"),
        ({"q": [0.0]}, "q: must be 7 finite numbers"),
        ({"v": [0.0]}, "v: must be 6 finite numbers"),
        ({"deformation": [0.0]}, "deformation: must have shape"),
        ({"model": "geometric"}, "does not say how bodies move"),
    ],
)
def test_wrong_input(change: dict[str, object], message: str) -> None:
    given = {"scene": "ball", "model": "dynamic-rigid", "parameters": None, "q": [0, 0, 0.1, 1, 0, 0, 0],
             "v": np.zeros(6), "h": H}  # fmt: skip
    with pytest.raises(rw.ModelError, match=message):
        rw.step_sensitivity(**{**given, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("condim", [4, 6])
def test_a_contact_that_resists_turning_slides(make: Make, condim: int) -> None:
    """Against steps taken: a ball slides and spins about the normal, and rolls."""
    geom = f'size=".1" condim="{condim}" friction=".3 .01 .005"'
    scene = make(world(FLOOR, free("b", "0 0 .1", geom), before=""))
    q, v = [0.0, 0.0, 0.0999, 1.0, 0.0, 0.0, 0.0], np.array([1.0, 0.3, 0.0, 2.0, -1.0, 5.0])
    s = rw.step_sensitivity(scene, "dynamic-compliant", None, q, v, H, wrt=("v",))
    assert not s.contact.weak and s.contact.force[0] > 0.0
    size, expected = 1e-5, np.zeros((6, 6))
    for i, one in enumerate(size * np.eye(6)):
        low, high = (
            rw.step_sensitivity(scene, "dynamic-compliant", None, q, v + side * one, H, wrt=("v",)).v
            for side in (-1.0, 1.0)
        )
        expected[:, i] = (high - low) / (2.0 * size)
    assert np.abs(expected - np.eye(6)).max() > 1e-3
    np.testing.assert_allclose(s.dv["v"], expected, atol=1e-6)


def test_contacts_that_resist_turning_where_forces_vanish() -> None:
    """Fingers close around a ball on the kinematic rung, and lead it as a step with another speed does."""
    run = rw.simulate("three_fingers", "kinematic", duration=0.55)
    given = run.frames[-1].q, run.frames[-1].v, H
    s = rw.step_sensitivity("three_fingers", "kinematic", None, *given, time=run.time, wrt=("parameters",))
    assert (s.contact.force != 0.0).any() and np.isfinite(s.dq["parameters"]).all()
    values = rw.load("three_fingers").parameters(None)
    for i, name in enumerate(s.names):
        if values[name] == 0.0:
            continue
        size = 1e-4 * values[name]
        low, high = (
            rw.step_sensitivity(
                "three_fingers", "kinematic", {name: values[name] + side}, *given, time=run.time, wrt=()
            )
            for side in (-size, size)
        )
        np.testing.assert_allclose(s.dv["parameters"][:, i], (high.v - low.v) / (2.0 * size), atol=1e-6)


def test_laws_that_jump_are_refused(make: Make) -> None:
    scene = make(
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')), contacts=[{"friction": 0.3, "static_friction": 0.5}]
    )
    with pytest.raises(rw.ModelError, match="contacts: steps with static_friction cannot"):
        rw.step_sensitivity(scene, "dynamic-rigid", None, [0, 0, 0.1, 1, 0, 0, 0], np.zeros(6), H)
