"""Close fits and thin bodies in space: balls in tubes, plates, and boxes near their friction angle."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, free, run, world
from .rungs import DYNAMIC, QUASISTATIC, WITH_LOADS, named

SEEDS = range(6)


def _tube(random: np.random.Generator, radius: float) -> tuple[str, str]:
    """A mesh, and staves about a bore: boxes, capsules or meshes."""
    count, thick, high = int(random.integers(4, 16)), 0.2 * radius, 4.0 * radius
    wide = 1.02 * (radius + thick) * np.tan(np.pi / count)
    corners = [(x, y, z) for x in (-thick / 2, thick / 2) for y in (-wide, wide) for z in (-high, high)]
    kind = random.choice(["box", "capsule", "mesh"])
    shape = {
        "box": f'type="box" size="{thick / 2} {wide} {high}"',
        "capsule": f'type="capsule" size="{thick / 2} {high}"',
        "mesh": 'type="mesh" mesh="stave"',
    }[kind]
    staves = ""
    for angle in 2.0 * np.pi * np.arange(count) / count:
        x, y = (radius + thick / 2) * np.array([np.cos(angle), np.sin(angle)])
        staves += f'<geom {shape} pos="{x:.17g} {y:.17g} {high}" euler="0 0 {np.rad2deg(angle):.17g}"/>'
    text = " ".join(f"{x:.9g}" for x in np.ravel(corners))
    return f'<asset><mesh name="stave" vertex="{text}"/></asset>', staves


@pytest.mark.few(12)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_stands_in_a_close_tube_stays_there(make: Make, seed: int, rung: Rung) -> None:
    random = np.random.default_rng(seed)
    radius = random.uniform(0.02, 0.2)
    room = radius * 10.0 ** random.uniform(-6, -3)
    mesh, staves = _tube(random, radius + room)
    shape = random.choice([f'size="{radius}"', f'type="cylinder" size="{radius} {radius}"'])
    body = free("b", f"{random.uniform(-0.4, 0.4) * room:.17g} 0 {radius:.17g}", shape)
    scene = make(world(FLOOR, staves, body, before=mesh), contacts=[{"friction": random.uniform(0.0, 0.8)}])
    found = run(scene, rung, duration=0.05, step=2e-3)
    assert found.outcome.name == "timeout", found
    assert np.hypot(found.final["b"]["x"], found.final["b"]["y"]) <= 2.0 * room + 1e-3 * radius


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_gravity_pulls_out_of_a_loose_tube_is_unsupported(make: Make, seed: int, rung: Rung) -> None:
    """And where the fit is so close that nothing proves it, the run says where it stands."""
    random = np.random.default_rng(seed)
    radius, slope = random.uniform(0.02, 0.2), random.uniform(0.3, 1.2)
    down = 9.81 * np.array([np.cos(slope), 0.0, np.sin(slope)])
    shape = random.choice([f'size="{radius}"', f'type="capsule" size="{radius} {radius}"'])
    body = free("b", f"0 0 {4.0 * radius:.17g}", shape)
    for room in (1e-2, 1e-3, 1e-6):
        mesh, staves = _tube(random, radius * (1.0 + room))
        before = f'{mesh}<option gravity="{down[0]} 0 {down[2]}"/>'
        scene = make(world(staves, body, before=before), contacts=[{"friction": 0.1}])
        found = rw.simulate(scene, rung, duration=0.01, step=1e-3)
        open_end = room < 1e-4 and found.outcome.name == "not_converged"
        assert found.outcome.name == "unsupported" or (open_end and " at world|b " in found.reason), (
            room,
            found.reason,
        )


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_thin_plates_fall_on_each_other(make: Make, seed: int, rung: Rung) -> None:
    """As thin as a hundredth to a thousandth of their length."""
    random, plates, height = np.random.default_rng(seed), "", 0.0
    for k in range(int(random.integers(1, 4))):
        size = random.uniform(0.1, 0.4)
        thick, height = size * 10.0 ** random.uniform(-3, -2), height + random.uniform(0.15, 0.2)
        box = f'type="box" size="{size} {size * random.uniform(0.4, 1)} {thick / 2}"'
        shape = random.choice([box, f'type="cylinder" size="{size} {thick / 2}"'])
        tilt = " ".join(str(x) for x in random.uniform(-15, 15, 3))
        plates += free(f"p{k}", f"0 {random.uniform(-0.1, 0.1)} {height}", shape, f'euler="{tilt}"')
    scene = make(world(FLOOR, plates), contacts=[{"friction": random.uniform(0.1, 0.8)}])
    found = run(scene, rung, duration=0.4, step=2e-3)
    assert found.outcome.name == "timeout", found
    assert all(-1e-3 < body["z"] < 1.0 for body in found.final.values())


@pytest.mark.few(9)
@pytest.mark.parametrize("part", [0.99, 0.999])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_box_near_its_friction_angle_with_torsion_holds_and_a_ball_beside_it_does_not(
    make: Make, seed: int, part: float
) -> None:
    random = np.random.default_rng(seed)
    friction = random.uniform(0.2, 0.8)
    slope = np.arctan(friction) * part
    gravity = f'<option gravity="{9.81 * np.sin(slope)} 0 {-9.81 * np.cos(slope)}"/>'
    law = {"friction": friction, "torsional_friction": 10.0 ** random.uniform(-4, -1)}
    box = free("box", "0 0 .05", 'type="box" size=".1 .1 .05" condim="4"')
    ball = free("ball", "0 1 .1", 'size=".1" condim="4"')
    for bodies, outcome in ((box, "timeout"), (box + ball, "unsupported")):
        found = rw.simulate(
            make(world(FLOOR, bodies, before=gravity), contacts=[law]), rw.QUASISTATIC_RIGID, duration=0.02
        )
        assert found.outcome.name == outcome


@pytest.mark.parametrize("rung", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=named)
def test_boxes_that_touch_on_all_sides_have_room_for_their_contacts(make: Make, rung: Rung) -> None:
    """Faces, edges and corners of 27 cubes: more contacts than other scenes of as many bodies have."""
    cubes = ""
    for i in range(27):
        x, y, z = 0.2 * np.array([i % 3, i // 3 % 3, i // 9 + 0.5])
        cubes += free(f"c{i}", f"{x:.17g} {y:.17g} {z:.17g}", 'type="box" size=".1 .1 .1"')
    found = run(make(world(FLOOR, cubes), contacts=[{"friction": 0.5}]), rung, duration=4e-3, step=2e-3)
    assert found.outcome.name == "timeout"
    assert all(abs(body["qw"]) > 1.0 - 1e-9 for body in found.final.values())
