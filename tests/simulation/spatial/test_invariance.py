"""Turned, mirrored, reordered and rescaled scenes, and limits between rungs."""

from __future__ import annotations

from math import cos, sin, sqrt

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene

from .conftest import Make
from .measure import FLOOR, Array, G, free, q, run, v, world
from .rungs import DYNAMIC, named

LAW = {"friction": 0.4, "stiffness": 1e5, "damping": 200.0}
SPIN, SPEED = np.array([0.5, 3.0, 1.0]), np.array([1.0, 0.3, 0.0])


def text(values: Array) -> str:
    return " ".join(f"{x:.17g}" for x in values)


def matrix(turn: Array) -> Array:
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, turn)
    return found.reshape(3, 3)


def product(a: Array, b: Array) -> Array:
    found = np.zeros(4)
    mujoco.mju_mulQuat(found, a, b)
    return found


BEGUN = np.array([cos(0.2), 0.3 * sin(0.2), sqrt(0.91) * sin(0.2), 0.0])


def thrown(make: Make, turn: Array, begun: Array = BEGUN, **speeds: Array) -> SpaceScene:
    """A box thrown onto a floor, all of it turned by a quaternion, gravity as well."""
    R = matrix(turn)
    place, speed = R @ [0.1, 0.2, 0.12], R @ speeds.get("speed", SPEED)
    spin = speeds.get("spin", SPIN)
    floor = f'<geom name="floor" type="plane" size="5 5 0.1" quat="{text(turn)}"/>'
    box = free("b", text(place), 'type="box" size=".1 .15 .05"', f'quat="{text(product(turn, begun))}"')
    velocities = dict(zip(("b.x", "b.y", "b.z", "b.rx", "b.ry", "b.rz"), [*speed, *spin], strict=True))
    return make(
        world(floor, box, before=f'<option gravity="{text(R @ [0.0, 0.0, -G])}"/>'),
        contacts=[LAW],
        start={"velocities": {name: float(x) for name, x in velocities.items()}},
        duration=0.15,
        step=2e-3,
    )


STILL = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.few(5)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize(
    "turn", [(cos(0.4), 0.0, 0.0, sin(0.4)), (0.5, 0.5, 0.5, 0.5), (0.8, 0.0, 0.36, 0.48)]
)
def test_a_turned_scene_turns_the_motion(make: Make, rung: Rung, turn: tuple[float, ...]) -> None:
    about = np.array(turn)
    plain, turned = run(thrown(make, STILL), rung), run(thrown(make, about), rung)
    np.testing.assert_allclose(matrix(about).T @ q(turned)[:3], q(plain)[:3], atol=1e-7)
    np.testing.assert_allclose(matrix(about).T @ v(turned)[:3], v(plain)[:3], atol=1e-5)
    np.testing.assert_allclose(v(turned)[3:], v(plain)[3:], atol=1e-4)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_mirrored_scene_mirrors_the_motion(make: Make, rung: Rung) -> None:
    """At the plane y = 0.2 through the middle of the box: y, and turns about x and z, change sign."""
    flip, turned = np.array([1.0, -1.0, 1.0]), np.array([1.0, -1.0, 1.0, -1.0])
    plain = run(thrown(make, STILL), rung)
    mirrored = run(thrown(make, STILL, BEGUN * turned, speed=SPEED * flip, spin=-SPIN * flip), rung)
    np.testing.assert_allclose((q(mirrored)[:3] - [0, 0.2, 0]) * flip, q(plain)[:3] - [0, 0.2, 0], atol=1e-7)
    np.testing.assert_allclose(q(mirrored)[3:] * turned, q(plain)[3:], atol=1e-6)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_the_order_of_bodies_does_not_matter(make: Make, rung: Rung) -> None:
    bodies = [
        free("a", "0 0 .1", 'size=".1"'),
        free("b", "0.04 0.02 .29", 'type="box" size=".1 .1 .08"'),
        free("c", "0.3 0 .06", 'type="capsule" size=".05 .1"', 'euler="0 90 0"'),
    ]
    ends = []
    for order in ((0, 1, 2), (2, 1, 0)):
        scene = make(world(FLOOR, *(bodies[k] for k in order)), contacts=[LAW], duration=0.2, step=2e-3)
        final = run(scene, rung).final
        ends.append([final[name][each] for name in "abc" for each in ("x", "y", "z")])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_units_of_length_mass_and_time_do_not_matter(make: Make, rung: Rung) -> None:
    """The same box in other units comes to the same place: lengths l, masses m, times t."""
    ends = []
    for length, mass, time in ((1.0, 1.0, 1.0), (1e3, 1e-3, 1e2)):
        sizes = text(length * np.array([0.1, 0.15, 0.05]))
        geom = f'type="box" size="{sizes}" mass="{mass}"'
        box = free("b", f"0 0 {0.12 * length}", geom, f'quat="{text(BEGUN)}"')
        floor = f'<geom name="floor" type="plane" size="{5 * length} {5 * length} {length}"/>'
        scene = make(
            world(floor, box, before=f'<option gravity="0 0 {-G * length / time**2}"/>'),
            contacts=[{"friction": 0.4, "stiffness": 1e5 * mass / time**2, "damping": 200.0 * mass / time}],
            start={"velocities": {"b.x": length / time, "b.ry": 3.0 / time}},
            duration=0.15 * time,
            step=2e-3 * time,
        )
        found = run(scene, rung)
        speeds = v(found) * time
        ends.append([*(q(found)[:3] / length), *q(found)[3:], *(speeds[:3] / length), *speeds[3:]])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)


def test_stiffer_contacts_come_to_rigid_ones(make: Make) -> None:
    """Pushed slowly, a box on compliant contacts is off by what they yield: a tenth at ten times the
    stiffness."""
    pusher = (
        '<body name="l" pos="-0.3 0 0.1"><joint name="s" type="slide" axis="1 0 0"/>'
        '<geom type="box" size="0.1 0.2 0.09" mass="1"/></body>'
    )
    block = free("b", "0 0 .1", 'type="box" size=".1 .1 .1"')

    def end(rung: Rung, stiffness: float) -> Array:
        scene = make(
            world(FLOOR, pusher, block), speeds={"l.s": 0.5}, duration=0.4, step=2e-3,
            contacts=[{"friction": 0.2, "stiffness": stiffness}],
        )  # fmt: skip
        return q(run(scene, rung))[1:4]

    rigid = end(rw.QUASISTATIC_RIGID, 1e6)
    assert rigid[0] == pytest.approx(0.1, abs=1e-6)
    off = [float(np.linalg.norm(end(rw.QUASISTATIC_COMPLIANT, K) - rigid)) for K in (1e4, 1e5, 1e6)]
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.05)
    assert off[1] / off[2] == pytest.approx(10.0, rel=0.05)


def test_less_inertia_comes_to_quasistatic_motion(make: Make) -> None:
    """A slider on a spring and a damper: off by the inertia that is left."""
    body = (
        '<body name="p"><joint name="j" type="slide" axis="1 0 0" stiffness="100" damping="50"'
        ' springref="0.1"/><geom size=".1" mass="2"/></body>'
    )
    scene = make(world(body), duration=0.3, step=1e-3)
    limit = q(run(scene, rw.QUASISTATIC_RIGID))[0]
    off = [q(run(scene, rw.DYNAMIC_RIGID.with_inertia(eps)))[0] - limit for eps in (1e-2, 1e-3)]
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)
    assert abs(off[1]) < 1e-4


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_contact_with_friction_converges_with_the_step(make: Make, rung: Rung) -> None:
    """A ball that slides, and comes to roll: to first order at least."""
    scene = make(
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')), contacts=[LAW],
        start={"velocities": {"b.x": 1.0, "b.ry": -3.0}}, duration=0.2,
    )  # fmt: skip
    ends = [q(run(scene, rung, step=h))[0] for h in (2e-3, 1e-3, 5e-4)]
    first, second = ends[0] - ends[1], ends[1] - ends[2]
    assert abs(first) < 2e-3 and abs(second) < 0.6 * abs(first)


@pytest.mark.parametrize("law", [{}, {"friction": 0.3}, {"restitution": 0.0}], ids=str)
def test_default_stiffness_and_damping_do_not_depend_on_the_unit_of_mass(
    make: Make, law: dict[str, float]
) -> None:
    def dropped(unit: float) -> Array:
        box = free("b", "0 0 .06", f'type="box" size=".1 .1 .05" mass="{unit}"')
        ball = free("ball", ".5 0 .06", f'size=".05" mass="{3.0 * unit}"')
        begun = {"velocities": {"b.x": 0.3, "ball.z": -0.5}}
        scene = make(world(FLOOR, box, ball), contacts=[law] if law else [], start=begun)
        return q(run(scene, rw.DYNAMIC_COMPLIANT, duration=0.1, step=1e-3))

    np.testing.assert_allclose(dropped(1e-3), dropped(1.0), atol=1e-12)
