"""Derivatives of runs in space: closed forms of the scheme, and differences of whole runs."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, Array, G, free, world
from .rungs import DYNAMIC, MOVING, named

MU, SPEED, STEPS, H = 0.3, 2.0, 50, 2e-3


def ended(
    scene: SpaceScene, rung: Rung, steps: int, h: float, values: dict[str, float], *begin: Array
) -> tuple[Array, Array]:
    """Where a run of so many steps comes to from q and v, or from where the scene starts."""
    state = rw.State(scene.template.coordinates, *begin, 0.0) if begin else None
    run = SpaceSimulation(scene, rung, parameters=values, state=state, step=h, duration=2.0 * steps * h)
    assert run.steps_taken(steps) == steps and run.time == pytest.approx(steps * h)
    assert run.stepper is not None
    return run.stepper.q.copy(), run.stepper.v.copy()


def apart(scene: SpaceScene, low: tuple[Array, Array], high: tuple[Array, Array]) -> Array:
    """The change (2 n,) of places and speeds from one end to another."""
    places = np.zeros(len(low[1]))
    mujoco.mj_differentiatePos(scene.bind().model, places, 1.0, low[0], high[0])
    return np.concatenate([places, high[1] - low[1]])


def by_parameter(
    scene: SpaceScene, rung: Rung, steps: int, h: float, name: str, size: float, *begin: Array
) -> Array:
    """The central difference of whole runs by a parameter."""
    values = scene.parameters(None)
    low, high = (
        ended(scene, rung, steps, h, values | {name: values[name] + side}, *begin) for side in (-size, size)
    )
    return apart(scene, low, high) / (2.0 * size)


def by_start(
    scene: SpaceScene, rung: Rung, steps: int, h: float, kind: str, i: int, size: float, q: Array, v: Array
) -> Array:
    """The central difference of whole runs by a place or a speed at the start."""
    ends = []
    for side in (-size, size):
        begin = q.copy(), v.copy()
        if kind == "v":
            begin[1][i] += side
        else:
            mujoco.mj_integratePos(scene.bind().model, begin[0], np.eye(len(v))[i], side)
        ends.append(ended(scene, rung, steps, h, scene.parameters(None), *begin))
    return apart(scene, *ends) / (2.0 * size)


def of(s: rw.RunSensitivity, kind: str, i: int) -> Array:
    return np.concatenate([s.dq[kind][:, i], s.dv[kind][:, i]])


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_block_that_slides(make: Make, rung: Rung) -> None:
    """x = v t - mu g h^2 n (n + 1) / 2 after n steps; turned by the friction where contacts yield."""
    scene = make(
        world(FLOOR, free("b", "0 0 .02", 'type="box" size=".2 .2 .02"')),
        parameters={"mu": {"default": MU, "range": [0, 1]}, "pace": {"default": SPEED, "range": [0, 9]}},
        contacts=[{"friction": "mu", "stiffness": 1e7, "damping": 1e4}],
        start={"velocities": {"b.x": "pace"}},
    )
    found = rw.run_sensitivity(scene, rung, steps=STEPS, h=H, wrt=("parameters",))
    assert found.names == ("mu", "pace") and found.time == pytest.approx(STEPS * H)
    exact = np.array([-G * H * H * STEPS * (STEPS + 1) / 2, STEPS * H])
    accuracy = 1e-7 if not rung.compliant else 0.02
    np.testing.assert_allclose(found.dq["parameters"][0], exact, rtol=accuracy)
    np.testing.assert_allclose(found.dv["parameters"][0], [-G * STEPS * H, 1.0], rtol=accuracy)


def test_a_ball_comes_to_roll_at_5_7_of_its_speed(make: Make) -> None:
    """A step in which it begins to roll is as any other."""
    scene = make(
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        contacts=[{"friction": 0.5}],
        start={"velocities": {"b.x": "pace"}},
    )
    found = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=100, h=2e-3, wrt=("parameters",))
    assert found.dv["parameters"][0, 0] == pytest.approx(5.0 / 7.0, rel=1e-6)
    assert found.dv["parameters"][4, 0] == pytest.approx(50.0 / 7.0, rel=1e-6)


@pytest.mark.parametrize("pace", [1.5, 0.0, 9.0])
def test_where_a_scene_starts_depends_on_its_parameters(make: Make, pace: float) -> None:
    """Also at an end of the range of a parameter."""
    scene = make(
        world(free("b", "0 0 1", 'size=".1"'), before=NO_GRAVITY),
        parameters={"pace": {"default": pace, "range": [0, 9]}},
        start={"places": {"b.z": "1 + pace"}, "velocities": {"b.x": "pace**3"}},
    )
    found = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=10, h=1e-2, wrt=("parameters",))
    assert found.dv["parameters"][0, 0] == pytest.approx(3.0 * pace**2, rel=1e-8, abs=1e-9)
    assert found.dq["parameters"][0, 0] == pytest.approx(0.3 * pace**2, rel=1e-8, abs=1e-9)
    assert found.dq["parameters"][2, 0] == pytest.approx(1.0, rel=1e-8)


def test_flight_by_its_start(make: Make) -> None:
    """q' = I + h n I by v, and the identity by q, turns included, without loads."""
    scene = make(world(free("b", "0 0 1", 'size=".1"'), before=NO_GRAVITY))
    q, v = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 2.0, 0.0, 0.0, 3.0])
    found = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=5, h=1e-2, q=q, v=v, wrt=("q", "v"))
    np.testing.assert_allclose(found.dq["q"][:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.dq["v"][:3, :3], 0.05 * np.eye(3), atol=1e-9)
    angle = 5 * 1e-2 * 3.0  # a turn at the start is seen from the frame that has turned since
    turn = [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(found.dq["q"][3:, 3:], turn, atol=1e-6)


def test_a_step_that_ends_where_things_meet_is_weak(make: Make) -> None:
    """A ball comes to the floor at the very end of the last step: faster, it is stopped there."""
    scene = make(
        world(FLOOR, free("b", "0 0 .2", 'size=".1"'), before=NO_GRAVITY),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        start={"velocities": {"b.z": "-pace"}},
    )
    found = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=10, h=1e-2, wrt=("parameters",))
    assert found.weak == (9,)
    assert found.dq["parameters"][2, 0] == pytest.approx(0.0, abs=1e-9)
    assert found.dv["parameters"][2, 0] == pytest.approx(0.09 / 1e-2, rel=1e-6)
    before = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=5, h=1e-2, wrt=("parameters",))
    assert before.dq["parameters"][2, 0] == pytest.approx(-0.05) and not before.weak


def cam(make: Make) -> SpaceScene:
    """A round finger on a servo passes under a round follower on a rail: friction holds where they slide."""
    return make(
        world(
            '<body name="f" pos="-.12 0 0"><joint name="f" type="slide" axis="1 .1 0" damping="1"/>'
            '<geom size=".1" mass="1"/></body>',
            '<body name="r" pos="0 .02 .19"><joint name="r" type="slide" axis="0 0 1" damping="20"/>'
            '<geom size=".12" mass="2"/></body>',
            after='<actuator><position name="u" joint="f" kp="3000" kv="50"/><motor name="w" joint="r"/>'
            "</actuator>",
        ),
        parameters={
            "u": {"default": 0.05, "range": [0, 1]}, "w": {"default": 1.0, "range": [-9, 9]},
            "mu": {"default": 0.2, "range": [0, 1]}, "k": {"default": 2e5, "range": [1, 1e9]},
        },
        contacts=[{"friction": "mu", "stiffness": "k", "damping": "k / 1000"}],
        controls={"u": "u * min(t / 0.05, 1)", "w": "w"},
    )  # fmt: skip


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_contact_that_slides_against_differences_of_whole_runs(make: Make, rung: Rung) -> None:
    """By parameters, by the start, and by a force on the follower, which is that of its motor."""
    scene, steps, h = cam(make), 60, 1e-3
    bound = scene.bind()
    q, v = bound.place.copy(), np.zeros(2)
    s = rw.run_sensitivity(scene, rung, steps=steps, h=h, q=q, v=v)
    end = ended(scene, rung, steps, h, scene.parameters(None), q, v)
    np.testing.assert_allclose(np.concatenate([s.q, s.v]), np.concatenate(end), atol=1e-12)
    assert not s.weak or not rung.loads
    assert rung.metric or abs(of(s, "parameters", 2)).max() > 1e-4  # friction slides
    for i, name in enumerate(s.names):
        size = 1e-4 * scene.parameters(None)[name]
        expected = by_parameter(scene, rung, steps, h, name, size, q, v)
        tolerance = 1e-6 * np.abs(expected).max() + 1e-11 / size
        np.testing.assert_allclose(of(s, "parameters", i), expected, atol=tolerance, err_msg=name)
    for kind in ("q", "v"):
        for i in range(2):
            expected = by_start(scene, rung, steps, h, kind, i, 1e-7, q, v)
            tolerance = 1e-7 * np.abs(expected).max() + 1e-6
            np.testing.assert_allclose(of(s, kind, i), expected, atol=tolerance, err_msg=f"{kind} {i}")
    if rung.loads:
        np.testing.assert_allclose(of(s, "inputs", 1), of(s, "parameters", 1), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_slip_that_turns_against_differences_of_whole_runs(make: Make, rung: Rung) -> None:
    """A ball with spin about all axes comes down and slides, so friction turns with its slip, and tangents
    along which the contact is deformed turn as it rolls."""
    scene = make(
        world(FLOOR, free("b", "0 0 .1002", 'size=".1" mass=".7"')),
        parameters={"mu": {"default": 0.25, "range": [0, 1]}, "k": {"default": 1e5, "range": [1, 1e9]}},
        contacts=[{"friction": "mu", "stiffness": "k", "damping": 300.0}],
        start={"velocities": {"b.x": 1.0, "b.y": -0.4, "b.rx": 6.0, "b.ry": -3.0, "b.rz": 2.0}},
    )
    bound, steps, h = scene.bind(), 60, 1e-3
    q, v = bound.place.copy(), bound.motion.copy()
    s = rw.run_sensitivity(scene, rung, steps=steps, h=h, q=q, v=v, wrt=("q", "v", "parameters"))

    def check(kind: str, i: int, expected: Array) -> None:
        tolerance = 1e-6 * np.abs(expected).max() + 1e-7
        np.testing.assert_allclose(of(s, kind, i), expected, rtol=0.0, atol=tolerance, err_msg=f"{kind} {i}")

    for i, name in enumerate(s.names):
        size = 1e-4 * scene.parameters(None)[name]
        check("parameters", i, by_parameter(scene, rung, steps, h, name, size, q, v))
    for kind in ("q", "v"):
        for i in range(6):
            check(kind, i, by_start(scene, rung, steps, h, kind, i, 1e-7, q, v))


def test_a_ball_that_leaves_the_floor_and_comes_back(make: Make) -> None:
    """What a contact was deformed by before it opened has no part in what it does when it closes again."""
    scene = make(
        world(FLOOR, free("b", "0 0 .15", 'size=".1"')),
        parameters={"k": {"default": 2e4, "range": [1, 1e9]}, "height": {"default": 0.0, "range": [-1, 1]}},
        contacts=[{"friction": 0.3, "stiffness": "k", "damping": 20.0}],
        start={"places": {"b.z": "0.15 + height"}, "velocities": {"b.x": 0.5}},
    )
    steps, h = 400, 1e-3
    s = rw.run_sensitivity(scene, rw.DYNAMIC_COMPLIANT, steps=steps, h=h, wrt=("parameters",))
    for i, (name, size) in enumerate((("k", 1e-2), ("height", 1e-7))):
        expected = by_parameter(scene, rw.DYNAMIC_COMPLIANT, steps, h, name, size)
        assert np.abs(expected[6:]).max() > 1e-5
        tolerance = 1e-6 * np.abs(expected).max() + 1e-12 / size
        np.testing.assert_allclose(of(s, "parameters", i), expected, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("dyntype", ["filterexact", "integrator"])
def test_actuators_that_act_by_and_by(make: Make, dyntype: str) -> None:
    """Their activation is handed on from step to step."""
    scene = make(
        world(
            '<body name="b"><joint name="x" type="slide" axis="1 0 0"/><geom size=".1" mass="2"/></body>',
            before=NO_GRAVITY,
            after=f'<actuator><general name="m" joint="x" dyntype="{dyntype}" dynprm="0.1" gainprm="4"/>'
            "</actuator>",
        ),
        parameters={"u": {"default": 0.5, "range": [0, 1]}},
        controls={"m": "u"},
    )
    steps, h = 100, 1e-3
    s = rw.run_sensitivity(scene, rw.DYNAMIC_RIGID, steps=steps, h=h, wrt=("parameters",))
    expected = by_parameter(scene, rw.DYNAMIC_RIGID, steps, h, "u", 1e-3)
    np.testing.assert_allclose(of(s, "parameters", 0), expected, rtol=1e-7)
    end = ended(scene, rw.DYNAMIC_RIGID, steps, h, scene.parameters(None))
    np.testing.assert_allclose(np.concatenate([s.q, s.v]), np.concatenate(end), rtol=1e-12)


def test_a_run_in_two_parts_is_the_chain_of_its_parts() -> None:
    """The second begins at the end and time of the first, with its deformations; tangents begin anew."""
    kinds, h = ("q", "v", "inputs", "parameters"), 1e-3
    whole = rw.run_sensitivity("ball", rw.DYNAMIC_COMPLIANT, steps=6, h=h, wrt=kinds)
    first = rw.run_sensitivity("ball", rw.DYNAMIC_COMPLIANT, steps=3, h=h, wrt=kinds)
    second = rw.run_sensitivity(
        "ball", rw.DYNAMIC_COMPLIANT, steps=3, h=h, q=first.q, v=first.v, deformation=first.deformation,
        time=first.time, wrt=(*kinds, "deformation"),
    )  # fmt: skip
    assert second.time == pytest.approx(whole.time)
    np.testing.assert_allclose(second.q, whole.q, atol=1e-15)
    onward = np.hstack([np.vstack([second.dq[k], second.dv[k]]) for k in ("q", "v", "deformation")])
    for kind in kinds:
        found = onward @ np.vstack([first.dq[kind], first.dv[kind], first.ddeformation[kind]])
        if kind in ("inputs", "parameters"):
            found += np.vstack([second.dq[kind], second.dv[kind]])
        expected = np.vstack([whole.dq[kind], whole.dv[kind]])
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max(), err_msg=kind)


def test_by_nothing_there_are_no_columns() -> None:
    for scene, n in (("ball", 6), ("two_finger", 3)):
        found = rw.run_sensitivity(scene, rw.DYNAMIC_COMPLIANT, steps=2, wrt=("parameters",), names=())
        assert found.dq["parameters"].shape == (n, 0) and found.time > 0.0


def test_a_run_that_has_no_derivative_says_where_and_by_what(make: Make) -> None:
    """A box comes down on one of its size: where it is moved, the nearer edges bound the contact."""
    table = '<geom type="box" size=".1 .1 .1"/>'
    scene = make(
        world(table, free("box", "0 0 .2001", 'type="box" size=".1 .1 .1"')),
        parameters={"aside": {"default": 0.0, "range": [-1, 1]}},
        start={"velocities": {"box.x": "aside"}},
    )
    with pytest.raises(rw.ModelError, match=r"step \d+, from time .*feature is about to change.*by aside"):
        rw.run_sensitivity(scene, rw.DYNAMIC_COMPLIANT, steps=20, h=1e-3, wrt=("parameters",))
    with pytest.raises(rw.ModelError, match=r"step \d+, from time .*feature is about to change.*by box.x"):
        rw.run_sensitivity(scene, rw.DYNAMIC_COMPLIANT, steps=20, h=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"steps": 0}, "steps: must be a whole number"),
        ({"wrt": ("w",)}, "wrt: 'w' is none of"),
        ({"names": ("w",)}, "names: unknown parameter 'w'"),
        ({"q": np.zeros(7)}, "q and v: give both"),
        ({"h": -1.0}, "step: must be"),
        ({"deformation": [1.0]}, "deformation: must have shape"),
    ],
)
def test_wrong_input(make: Make, change: dict[str, Any], words: str) -> None:
    scene = make(
        world(free("b", "0 0 1", 'size=".1"')),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        start={"velocities": {"b.x": "pace"}},
    )
    with pytest.raises(rw.ModelError, match=words):
        rw.run_sensitivity(**{"scene": scene, "model": rw.DYNAMIC_RIGID, "steps": 2} | change)
