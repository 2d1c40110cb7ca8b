"""Friction of pairs that differs along the two tangents of a contact: an ellipse in place of a disc.

On a floor whose normal is z, MuJoCo's first tangent is y, the second -x.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.derivatives.sensitivity import step_sensitivity
from rungwise.simulation.options import ModelError

from .conftest import Make
from .measure import FLOOR, G, forces, free, run, v, world
from .rungs import COMPLIANT, DYNAMIC, WITH_LOADS, named

mujoco = pytest.importorskip("mujoco")

ALONG_Y, ALONG_X = 0.6, 0.2
LAW = {"stiffness": 1e5, "damping": 1e3}
HEADINGS = [0.0, 0.4, 1.1, 0.5 * math.pi, 2.5]


def pair(*friction: float, condim: int = 3, geoms: str = 'geom1="floor" geom2="g"') -> str:
    numbers = " ".join(map(str, (*friction, *(0.005, 1e-4, 1e-4)[: 5 - len(friction)])))
    return f'<contact><pair {geoms} condim="{condim}" friction="{numbers}"/></contact>'


def pulled(angle: float, heading: float) -> str:
    """Gravity as on a slope of this angle that falls towards the heading."""
    x, y, z = math.sin(angle) * math.cos(heading), math.sin(angle) * math.sin(heading), -math.cos(angle)
    return f'<option gravity="{G * x} {G * y} {G * z}"/>'


BLOCK = free("b", "0 0 .05", 'name="g" type="box" size=".2 .2 .05"')
BALL = free("b", "0 0 .1", 'name="g" size=".1"')


def lying(make: Make, *friction: float, before: str = "", body: str = BLOCK, **fields: Any) -> Any:
    model = world(FLOOR, body, before=before, after=pair(*friction))
    return make(model, **({"contacts": [LAW], "duration": 0.2, "step": 1e-3} | fields))


def coefficient(heading: float) -> float:
    """Of friction in a direction: that of the ellipse along it."""
    return 1.0 / math.hypot(math.cos(heading) / ALONG_X, math.sin(heading) / ALONG_Y)


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("heading", HEADINGS)
def test_a_block_on_a_slope_slides_where_the_slope_is_steeper_than_friction_along_it(
    make: Make, rung: Rung, heading: float
) -> None:
    """It sticks while the force m g sin that holds it is in the ellipse of radii mu_i m g cos."""
    for part in (0.99, 1.01):
        before = pulled(math.atan(part * coefficient(heading)), heading)
        found = rw.simulate(lying(make, ALONG_Y, ALONG_X, before=before), rung)
        speed = float(np.hypot(*v(found)[:2]))
        if part < 1.0:
            assert found.outcome == "timeout" and speed < 1e-9
        elif rung.inertia > 0.0:
            assert speed > 1e-3
        else:
            assert found.outcome == "unsupported"


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("heading", HEADINGS[1:3])
def test_friction_of_what_slides_dissipates_most(make: Make, rung: Rung, heading: float) -> None:
    """f_i = -N mu_i^2 v_i / sqrt(sum mu_i^2 v_i^2), in the world; so it is not against the motion."""
    speeds = {"b.x": 2.0 * math.cos(heading), "b.y": 2.0 * math.sin(heading)}
    found = run(lying(make, ALONG_Y, ALONG_X, start={"velocities": speeds}), rung)
    mu = np.array([ALONG_X, ALONG_Y])
    frame = found.frames[-1]
    pushed, slip = frame.touch.force.sum(axis=0), frame.v[:2]
    expected = -pushed[2] * mu**2 * slip / np.linalg.norm(mu * slip)
    assert pushed[2] == pytest.approx(G, rel=1e-3)
    np.testing.assert_allclose(pushed[:2], expected, rtol=1e-3)
    assert frame.touch.friction.tolist() == [ALONG_Y] * len(frame.touch.gap)


@pytest.mark.parametrize("rung", COMPLIANT, ids=named)
def test_what_sticks_yields_alike_in_all_directions(make: Make, rung: Rung) -> None:
    """By force over stiffness, as with one friction: stiffness is the scene's along both tangents."""
    shifts = []
    for friction in ((ALONG_Y, ALONG_X), (ALONG_Y, ALONG_Y), (ALONG_X, ALONG_Y)):
        scene = lying(make, *friction, before=pulled(0.1, 0.7), duration=1.0)
        found, simulation = forces(scene, rung)
        own, kept = simulation.stepper.state.deformation, simulation.space.kept
        slots = np.flatnonzero(kept.geoms[:, 0] >= 0)
        across = np.cross(kept.world[slots, 3:6], kept.world[slots, 6:9])
        shifts.append(
            (own[slots, 1, None] * kept.world[slots, 6:9] + own[slots, 2, None] * across).sum(axis=0)
        )
        pushed = found.frames[-1].touch.force.sum(axis=0)
        np.testing.assert_allclose(1e5 * shifts[-1], pushed - pushed[2] * np.eye(3)[2], atol=1e-6)
        np.testing.assert_allclose(
            pushed[:2], -G * math.sin(0.1) * np.array([math.cos(0.7), math.sin(0.7)]), rtol=1e-6
        )
    np.testing.assert_allclose(shifts[1:], [shifts[0]] * 2, rtol=1e-8)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_swapped_axes_swap_the_motion(make: Make, rung: Rung) -> None:
    one = run(lying(make, 0.6, 0.2, start={"velocities": {"b.x": 1.0, "b.y": 0.7}}), rung)
    other = run(lying(make, 0.2, 0.6, start={"velocities": {"b.x": 0.7, "b.y": 1.0}}), rung)
    np.testing.assert_allclose(v(other)[:2], v(one)[1::-1], rtol=1e-8)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_turned_world_turns_the_motion(make: Make, rung: Rung) -> None:
    """A wall whose normal is x: MuJoCo's tangents are y and z."""
    wall = '<geom name="floor" type="plane" size="5 5 .1" quat=".70710678118654752 0 .70710678118654752 0"/>'
    block = free("b", ".05 0 0", 'name="g" type="box" size=".05 .2 .2"')
    model = world(wall, block, before=f'<option gravity="{-G} 0 0"/>', after=pair(0.6, 0.2))
    fields: dict[str, Any] = {"contacts": [LAW], "duration": 0.2, "step": 1e-3}
    there = run(make(model, start={"velocities": {"b.y": 1.0, "b.z": -0.7}}, **fields), rung)
    here = run(lying(make, 0.6, 0.2, start={"velocities": {"b.y": 1.0, "b.x": 0.7}}), rung)
    np.testing.assert_allclose(v(there)[1:3] * [1.0, -1.0], v(here)[1::-1], rtol=1e-7)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_ball_that_spins_on_the_spot_slides_as_one_that_does_not(make: Make, rung: Rung) -> None:
    """Tangents turn with the bodies, friction does not."""
    ends = []
    for spin in (0.0, 20.0):
        start = {"velocities": {"b.x": 1.0, "b.y": 0.7, "b.rz": spin}}
        law = LAW | {"tangential_stiffness": 1e7}
        scene = lying(make, 0.6, 0.2, body=BALL, start=start, contacts=[law], duration=0.1, step=5e-4)
        ends.append(v(run(scene, rung))[:2])
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-8 if not rung.compliant else 1e-3)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("heading", [0.4, 2.5])
def test_equal_coefficients_are_one_friction(make: Make, rung: Rung, heading: float) -> None:
    """Also where another pair of the model has two, and where they differ by rounding."""
    aside = free("c", "2 0 .05", 'name="h" type="box" size=".2 .2 .05"')
    other = '<pair geom1="floor" geom2="h" friction=".5 .3 .005 .0001 .0001"/></contact>'
    start = {} if rung.inertia == 0.0 else {"start": {"velocities": {"b.x": 1.0, "b.y": -0.5}}}
    ends = []
    for friction, more in (((0.3, 0.3), ""), ((0.3, 0.3), other), ((0.3, 0.3 * (1.0 + 1e-10)), "")):
        model = world(FLOOR, BLOCK, *([aside] if more else []), before=pulled(0.2, heading))
        after = pair(*friction)
        after = after.replace("</contact>", more) if more else after
        scene = make(model + after, contacts=[LAW], duration=0.2, step=1e-3, **start)
        ends.append(np.concatenate([run(scene, rung).frames[-1].q[:7], run(scene, rung).frames[-1].v[:6]]))
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, atol=1e-9)


@pytest.mark.parametrize(("axis", "rolls"), [("x", 2e-3), ("y", 5e-4)])
def test_rolling_friction_is_that_about_its_axis(make: Make, axis: str, rolls: float) -> None:
    """A ball that rolls along x turns about y, MuJoCo's first tangent."""
    turn = {"x": ("b.ry", 5.0), "y": ("b.rx", -5.0)}[axis]
    start = {"velocities": {f"b.{axis}": 0.5, turn[0]: turn[1]}}
    model = world(FLOOR, BALL, after=pair(1.0, 0.9, 0.02, 2e-3, 5e-4, condim=6))
    scene = make(model, contacts=[LAW | {"stiffness": 1e7}], start=start, duration=0.1, step=5e-4)
    inertia, radius = 0.4 * 0.1**2, 0.1
    moment = rolls / math.hypot(1.0, rolls / (radius * (1.0 + inertia / radius**2)))
    expected = 5.0 - 0.1 * moment * G / (inertia + radius**2)
    for rung in DYNAMIC:
        after = run(scene, rung).trajectory.velocity.sel(rate=turn[0]).values[-1]
        assert abs(after) == pytest.approx(expected, abs=4e-3)


def test_friction_of_a_scene_replaces_both(make: Make) -> None:
    scene = lying(make, 0.6, 0.2, before=pulled(0.3, 0.4), contacts=[LAW | {"friction": 0.4}])
    assert float(np.abs(v(run(scene, rw.DYNAMIC_RIGID))).max()) < 1e-9
    with_own = lying(make, 0.6, 0.2, before=pulled(0.3, 0.4))
    assert float(np.abs(v(run(with_own, rw.DYNAMIC_RIGID))).max()) > 0.1


@pytest.mark.parametrize("heading", [0.0, 0.4, 1.1])
def test_mujoco_slides_alike(make: Make, heading: float) -> None:
    """To a hundredth of the way, as soft as its friction is."""
    start = {"velocities": {"b.x": 1.5 * math.cos(heading), "b.y": 1.5 * math.sin(heading)}}
    option = '<option cone="elliptic" impratio="10" timestep="5e-4"/>'
    model = world(FLOOR, BLOCK.replace('.05"', '.01"').replace("0 0 .05", "0 0 .01"), before=option)
    scene = make(model + pair(0.3, 0.1), contacts=[LAW], start=start, duration=0.3, step=5e-4)
    bound = scene.bind()
    data = mujoco.MjData(bound.model)
    data.qvel[:2] = [1.5 * math.cos(heading), 1.5 * math.sin(heading)]
    while data.time < 0.3 - 1e-9:
        bound.step_in_mujoco(data)
    for rung in DYNAMIC:
        found = run(scene, rung).frames[-1].q
        np.testing.assert_allclose(found[:2], data.qpos[:2], atol=0.01 * float(np.hypot(*data.qpos[:2])))


def test_derivatives_refuse_it_in_a_line(make: Make) -> None:
    scene = lying(make, 0.6, 0.2)
    first = run(scene, rw.DYNAMIC_RIGID, duration=1e-3).frames[0]
    with pytest.raises(ModelError, match="friction that differs by direction cannot be differentiated"):
        step_sensitivity(scene, rw.DYNAMIC_RIGID, {}, first.q, first.v, 1e-3)
