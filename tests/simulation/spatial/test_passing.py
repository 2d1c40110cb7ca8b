"""Whatever the step, bodies in space go through nothing, and overlap no more at its end than is allowed."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.outcome import Code
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import NO_GRAVITY, free, world
from .rungs import named

RIGID, COMPLIANT = rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT
MANY = 150
"""Steps after which a run has been seen long enough."""


def _room(rng: np.random.Generator, half: float, thick: float) -> str:
    """Six walls about a cube, boxes or planes."""
    walls = ""
    for axis, side in [(axis, side) for axis in range(3) for side in (-1, 1)]:
        place, size, inward = np.zeros(3), np.full(3, half + 2.0 * thick), np.zeros(3)
        place[axis], size[axis], inward[axis] = side * (half + thick), thick, -side
        if rng.random() < 0.3:
            place[axis] = side * half
            walls += f'<geom type="plane" size="1 1 1" pos="{_text(place)}" zaxis="{_text(inward)}"/>'
        else:
            walls += f'<geom type="box" size="{_text(size)}" pos="{_text(place)}"/>'
    return walls


def _text(numbers: object) -> str:
    return " ".join(f"{x:.17g}" for x in np.asarray(numbers, float))


def _solid(rng: np.random.Generator, name: str, size: float) -> tuple[str, str]:
    """An asset and geoms, with a link on a hinge at times."""
    a, b, c = size * rng.uniform(0.4, 1.0, 3)
    corners = rng.normal(size=(10, 3))
    corners *= size / np.linalg.norm(corners, axis=1)[:, None]
    shapes = {
        "box": f'type="box" size="{a} {b} {c}"',
        "ball": f'size="{a}"',
        "capsule": f'type="capsule" size="{0.4 * a} {0.6 * b}"',
        "disc": f'type="cylinder" size="{a} {0.05 * b}"',
        "ellipsoid": f'type="ellipsoid" size="{a} {b} {c}"',
        "mesh": f'type="mesh" mesh="m{name}"',
    }
    kind = str(rng.choice(list(shapes)))
    geoms = f'<geom {shapes[kind]} mass="{10.0 ** rng.uniform(-1, 1)}"/>'
    if rng.random() < 0.3:
        axis, arm = _text(rng.normal(size=3)), _text([0, 0, 0, size, 0, 0])
        geoms += (
            f'<body><joint axis="{axis}"/><geom type="capsule" size="{0.1 * size}" fromto="{arm}"/></body>'
        )
    return f'<mesh name="m{name}" vertex="{_text(corners.ravel())}"/>' if kind == "mesh" else "", geoms


def _thrown(make: Make, seed: int) -> SpaceScene:
    """Up to three bodies in a closed room, at up to 1000 m/s, with steps of up to 1 s."""
    rng = np.random.default_rng(seed)
    assets = bodies = ""
    speeds, speed = {}, 10.0 ** rng.uniform(0, 3)
    for k in range(int(rng.integers(1, 4))):
        asset, geoms = _solid(rng, f"b{k}", rng.uniform(0.05, 0.2))
        place = [0.7 * k - 0.7, *rng.uniform(-0.5, 0.5, 2)]
        assets += asset
        bodies += f'<body name="b{k}" pos="{_text(place)}" quat="{_text(rng.normal(size=4))}"><freejoint/>'
        bodies += f"{geoms}</body>"
        way = rng.normal(size=3)
        ways = [*(speed * way / np.linalg.norm(way)), *rng.normal(size=3)]
        speeds |= {
            f"b{k}.{c}": float(x) for c, x in zip(("x", "y", "z", "rx", "ry", "rz"), ways, strict=True)
        }
    room = _room(rng, 1.0, 10.0 ** rng.uniform(-2.5, -1))
    law = {"friction": 0.3, "restitution": float(rng.choice([0.0, 0.5, 1.0]))}
    return make(
        world(room, bodies, before=f"{NO_GRAVITY}<asset>{assets}</asset>"),
        contacts=[law], start={"velocities": speeds}, step=float(10.0 ** rng.uniform(-2, 0)), duration=1.0,
    )  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", [RIGID, COMPLIANT], ids=named)
@pytest.mark.parametrize("seed", range(12))
def test_what_is_thrown_in_a_room_stays_in_it(make: Make, seed: int, rung: rw.Rung) -> None:
    simulation = SpaceSimulation(_thrown(make, seed), rung, frames=3)
    space, stepper = simulation.space, simulation.stepper
    assert stepper is not None
    while simulation.outcome == Code.RUNNING and simulation.steps < MANY:
        simulation.steps_taken(1)
        data = mujoco.MjData(space.model)
        data.qpos[:] = stepper.q
        mujoco.mj_kinematics(space.model, data)
        allowed = (1e-3 if rung is RIGID else 0.3) * space.size.length
        moving = space.model.body_weldid[space.model.geom_bodyid] != 0
        assert np.abs(data.geom_xpos[moving]).max() <= 1.0 + allowed
        assert space.least_gap(stepper.q) >= -allowed
    ends = (Code.RUNNING, Code.TIMEOUT) if rung is RIGID else (Code.RUNNING, Code.TIMEOUT, Code.MODEL_INVALID)
    assert simulation.outcome in ends


@pytest.mark.parametrize("rung", [RIGID, COMPLIANT], ids=named)
@pytest.mark.parametrize("geoms", ["one", "two"])
def test_a_box_that_falls_in_one_step_lands(make: Make, geoms: str, rung: rw.Rung) -> None:
    """Also one of two geoms, whose contacts MuJoCo looks for by the margin of the body."""
    more = '<geom type="box" size=".02 .02 .02" pos="0 0 .1" mass=".1"/>' if geoms == "two" else ""
    body = free("b", "0 0 .6", f'type="box" size=".1 .1 .1"/>{more}<geom size=".01"')
    scene = make(
        '<option timestep="1"/>' + world('<geom type="box" size="3 3 .01" pos="0 0 -.01"/>', body),
        duration=2.0,
    )
    found = rw.simulate(scene, rung)
    assert found.outcome.name == "timeout"
    assert found.final["b"]["z"] == pytest.approx(0.1, abs=1e-3)


def test_a_blade_on_a_hinge_does_not_turn_through_a_rod(make: Make) -> None:
    """Seen at both ends of a turn nothing overlaps; the blade ends on the side where it began."""
    joint, geom = (
        '<joint name="j" axis="0 0 1"/>',
        '<geom type="box" size=".4 .001 .05" pos=".5 0 0" mass="1"/>',
    )
    blade = f'<body name="b">{joint}{geom}</body>'
    rod = '<geom type="capsule" size=".005" fromto="0 .7 -.3 0 .7 .3"/>'
    for speed in (3.0, 30.0, 300.0):
        scene = make(
            world(blade, rod, before=NO_GRAVITY),
            start={"velocities": {"b.j": speed}}, duration=2.0, step=1.0,
        )  # fmt: skip
        assert rw.simulate(scene, RIGID).final["b"]["j"] == pytest.approx(np.pi / 2, abs=0.03)


@pytest.mark.parametrize("tilt", [0.0, 1e-16, 1e-14, 1e-12, 1e-9, 1e-6, 1e-4])
def test_gaps_of_a_cylinder_that_stands_are_exact(make: Make, tilt: float) -> None:
    floor = '<geom type="plane" size="1 1 1"/>'
    scene = make(world(floor, free("b", "0 0 .05", 'type="cylinder" size=".07 .05"')))
    space = SpaceSimulation(scene, RIGID).space
    for heading in np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, 20):
        q = np.array([0.1, 0.2, 0.05, 1.0, 0.5 * tilt * np.cos(heading), 0.5 * tilt * np.sin(heading), 0.0])
        assert space.least_gap(q) == pytest.approx(-0.07 * tilt, abs=1e-9 + 0.1 * tilt**2)
        assert len(space.seen(q).dist) >= 3
