"""Bodies of very unequal mass, and coordinates that nothing but drives and contacts resists."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, G, free, q, run, v, world
from .rungs import DYNAMIC, RIGID, WITH_LOADS, named

SIDE = 0.05
CUBE = f'type="box" size="{SIDE} {SIDE} {SIDE}"'


def tower(masses: list[float], shifts: list[float]) -> str:
    cubes = (
        free(f"cube{i}", f"{shift} 0 {(2 * i + 1) * SIDE}", f'{CUBE} mass="{mass:.17g}"')
        for i, (mass, shift) in enumerate(zip(masses, shifts, strict=True))
    )
    return world(FLOOR, *cubes)


@pytest.mark.few(8)
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_towers_of_unequal_bodies_stand(make: Make, rung: Rung, seed: int) -> None:
    """Masses over up to five decades, in any order; the floor carries them all."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    masses = list(10.0 ** rng.uniform(-2.5, 2.5, count))
    scene = make(tower(masses, list(0.1 * SIDE * rng.uniform(-1, 1, count))), contacts=[])
    found = run(scene, rung, duration=0.04, step=2e-3)
    assert found.outcome.name == "timeout"
    touch = found.frames[-1].touch
    carried = sum(
        force[2] for force, pair in zip(touch.force, touch.geoms, strict=True) if 0 in (int(g) for g in pair)
    )
    sinking = sum(masses) * float(np.abs(v(found)).max()) / 2e-3 if rung in DYNAMIC else 0.0
    assert carried == pytest.approx(G * sum(masses), rel=1e-6, abs=sinking)


@pytest.mark.parametrize("heavy", [1e3, 1e5])
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_heavy_body_rests_on_a_light_one(make: Make, rung: Rung, heavy: float) -> None:
    found = run(make(tower([1.0, heavy], [0.0, 0.2 * SIDE])), rung, duration=0.04, step=2e-3)
    assert found.outcome.name == "timeout"
    assert q(found)[[2, 9]] == pytest.approx([SIDE, 3 * SIDE], abs=2e-3 * SIDE)


@pytest.mark.parametrize("heavy", [1.0, 1e-3, 1e4])
def test_masses_do_not_matter_where_there_are_no_loads(make: Make, heavy: float) -> None:
    """The kinematic rung moves what a pusher meets, and no mass counts: a slide between two cubes that it
    drives apart moves both by as much."""
    wedge = (
        '<body name="pusher" pos="0 0 0.3"><joint name="s" type="slide" axis="1 0 0"/>'
        f"<geom {CUBE} mass='1'/></body>"
    )
    cubes = free("a", f"{2 * SIDE} 0 0.3", CUBE) + free("b", f"{4 * SIDE} 0 0.3", f'{CUBE} mass="{heavy}"')
    scene = make(world(wedge, cubes), speeds={"pusher.s": 0.5})
    found = run(scene, rw.KINEMATIC, duration=0.02, step=2e-3)
    start = np.array([0.0, 2 * SIDE, 4 * SIDE])
    moved = q(found)[[0, 1, 8]] - start
    assert moved == pytest.approx([0.01, 0.01, 0.01], abs=1e-9)


@pytest.mark.parametrize("heavy", [1e-3, 1e4])
def test_a_joint_pushed_apart_shares_its_way_whatever_the_masses(make: Make, heavy: float) -> None:
    """Two cubes side by side, tied at a distance by an equality of places that a driven slide opens."""
    slide = '<joint name="{0}" type="slide" axis="1 0 0"/>'
    bodies = "".join(
        f'<body name="{name}" pos="0 {y} 0">{slide.format("j" + name)}<geom size=".1" mass="{mass}"/></body>'
        for name, y, mass in (("a", 0.0, 1.0), ("b", 1.0, heavy), ("c", 2.0, 1.0))
    )
    tie = (
        '<tendon><fixed name="t"><joint joint="ja" coef="1"/><joint joint="jb" coef="1"/>'
        '<joint joint="jc" coef="-1"/></fixed></tendon><equality><tendon tendon1="t"/></equality>'
    )
    scene = make(world(bodies, after=tie), speeds={"c.jc": 0.5})
    found = run(scene, rw.KINEMATIC, duration=0.02, step=2e-3)
    assert q(found) == pytest.approx([0.005, 0.005, 0.01], abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_peg_on_a_servo_goes_in_without_momentum_as_with_it(rung: Rung, seed: int) -> None:
    """Without momentum nothing but the servo resists the way down, and the wrist's springs the others."""
    rng = np.random.default_rng(seed)
    drawn = {
        "offset": rng.uniform(-4e-3, 4e-3),
        "slant": rng.uniform(-0.01, 0.01),
        "mu": rng.uniform(0.1, 0.3),
        "wrist": 10.0 ** rng.uniform(2.0, 3.5),
        "twist": 10.0 ** rng.uniform(0.0, 1.5),
    }
    found = run(rw.load("peg"), rung, step=2e-3, parameters=drawn)
    assert found.outcome.name == "goal"


@pytest.mark.parametrize("damping", [1e-2, 1e-4])
def test_a_rod_that_topples_against_faint_damping_is_told_and_followed(make: Make, damping: float) -> None:
    """However long steps are beside the time in which damping gives way."""
    arm = (
        f'<body name="arm" pos="0 0 1"><joint name="j" type="hinge" axis="0 1 0" damping="{damping}"/>'
        '<geom type="capsule" fromto="0 0 0 0.01 0 0.5" size="0.02" mass="1"/></body>'
    )
    scene, hangs = make(world(arm)), np.pi - np.arctan(0.02)
    found = run(scene, rw.QUASISTATIC_RIGID, duration=60.0 * damping, step=4.0 * damping)
    assert abs(found.final["arm"]["j"] - hangs) < 1.0
    assert any("against damping alone" in note for note in found.notes)
    exact = run(scene, rw.QUASISTATIC_RIGID, duration=20.0 * damping, step=damping, tol=1e-3)
    assert exact.final["arm"]["j"] == pytest.approx(hangs, abs=0.01)
    assert not run(scene, rw.DYNAMIC_RIGID, duration=0.01).notes


@pytest.mark.few(3)
@pytest.mark.parametrize("shape", ['type="box" size=".06 .07 .05"', 'type="cylinder" size=".07 .05"'])
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_part_is_pushed_askew_over_a_table(make: Make, rung: Rung, shape: str) -> None:
    """It turns about a point that passes one of its contacts; loads about its axes are rounding."""
    slides = "".join(
        f'<joint name="p{x}" type="slide" axis="{a}"/>' for x, a in (("x", "1 0 0"), ("y", "0 1 0"))
    )
    pusher = f'<body name="pusher" pos="-.2 0 .06">{slides}<geom size=".04" mass=".5"/></body>'
    drives = "".join(f'<velocity name="u{x}" joint="p{x}" kv="100"/>' for x in "xy")
    scene = make(
        world(
            FLOOR,
            pusher,
            free("part", "0 0 .05", f'{shape} mass=".4"'),
            after=f"<actuator>{drives}</actuator>",
        ),
        controls={"ux": 0.2, "uy": 0.02},
        contacts=[{"friction": 0.4}],
    )
    found = run(scene, rung, duration=1.0, step=5e-3)
    assert found.outcome.name == "timeout"
    assert found.final["part"]["x"] > 0.08 and abs(found.final["part"]["z"] - 0.05) < 1e-3


@pytest.mark.few(6)
@pytest.mark.parametrize("rung", RIGID, ids=named)
@pytest.mark.parametrize("seed", range(16))
def test_stacks_stand_below_boxes_up_to_a_million_times_as_heavy(make: Make, seed: int, rung: Rung) -> None:
    """From the first step on, whose contacts are new: forces that last resorts find have to be kept."""
    random, height, boxes = np.random.default_rng(seed), 0.0, ""
    count, ratio = int(random.integers(3, 9)), 10.0 ** random.uniform(4, 6)
    for k in range(count):
        x, y, thick = *random.uniform(-0.01, 0.01, 2), 0.1 * random.uniform(0.3, 1.0)
        geom = f'type="box" size=".1 .1 {thick:.17g}" mass="{ratio ** (k / (count - 1)):.17g}"'
        boxes += free(f"b{k}", f"{x} {y} {height + thick:.17g}", geom)
        height += 2.0 * thick
    found = run(make(world(FLOOR, boxes), contacts=[{"friction": 0.5}]), rung, duration=0.01, step=2e-3)
    assert found.outcome.name == "timeout", found.reason
