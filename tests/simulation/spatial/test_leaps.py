"""Without momentum nothing in space leaps unseen: what no balance leads to is unsupported, or told."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import FLOOR, free, world
from .rungs import QUASISTATIC, named

SEEDS = range(6)


def _walk(scene: SpaceScene, rung: Rung, **options: float) -> SpaceSimulation:
    """A run whose every step goes no farther than the smallest body, unless a leap of it is told, and adds no
    overlap that contacts do not foresee."""
    simulation = SpaceSimulation(scene, rung, **options)
    space, stepper = simulation.space, simulation.stepper
    assert stepper is not None
    while simulation.outcome == Code.RUNNING:
        before, time, told = stepper.q.copy(), stepper.time, stepper.leaps
        simulation.steps_taken(1)
        moved = 0.5 * space.fastest(before, np.abs(stepper.v)) * (stepper.time - time)
        driven = 0.5 * space.fastest(before, np.abs(stepper.state.speed)) * (stepper.time - time)
        assert moved <= max(1.01 * space.size.length, 2.0 * driven) or stepper.leaps > told
        yielded = float(np.abs(stepper.state.deformation[:, 0]).max(initial=0.0))
        assert space.least_gap(stepper.q) >= -yielded - 2e-3 * space.size.length
    return simulation


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_slides_down_a_chute_is_unsupported_however_near_the_wall(
    make: Make, seed: int, rung: Rung
) -> None:
    random = np.random.default_rng(seed)
    friction, far = random.uniform(0.05, 0.8), 10.0 ** random.uniform(-2.0, 3.0)
    wall = f'<geom type="box" size=".1 2 1" pos="{far + 0.2} 0 1"/>'
    for steeper, outcome in ((0.9, "timeout"), (1.1, "unsupported")):
        slope = np.arctan(friction) * steeper
        gravity = f'<option gravity="{9.81 * np.sin(slope)} 0 {-9.81 * np.cos(slope)}"/>'
        body = free("b", "0 0 .05", 'type="box" size=".1 .1 .05"')
        scene = make(world(FLOOR, wall, body, before=gravity), contacts=[{"friction": friction}])
        step = 10.0 ** random.uniform(-4, -1)
        assert _walk(scene, rung, duration=5.0 * step, step=step).result().outcome.name == outcome


@pytest.mark.few(6)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", range(12))
def test_stacks_that_slide_as_one_are_unsupported(make: Make, seed: int, rung: Rung) -> None:
    """Most of their contacts neither slip nor part in the motion that proves it."""
    random = np.random.default_rng(seed)
    friction, size, height, boxes = random.uniform(0.05, 0.5), 10.0 ** random.uniform(-2, 0.5), 0.0, ""
    for k in range(int(random.integers(2, 6))):
        thick = size * random.uniform(0.1, 0.4)
        geom = f'type="box" size="{size} {size} {thick}" mass="{10.0 ** random.uniform(-1, 1)}"'
        boxes += free(f"b{k}", f"0 0 {height + thick}", geom)
        height += 2.0 * thick
    slope, to = np.arctan(friction) * random.uniform(1.02, 1.2), random.uniform(-np.pi, np.pi)
    down = 9.81 * np.array([np.sin(slope) * np.cos(to), np.sin(slope) * np.sin(to), -np.cos(slope)])
    gravity = f'<option gravity="{down[0]} {down[1]} {down[2]}"/>'
    scene = make(world(FLOOR, boxes, before=gravity), contacts=[{"friction": friction}])
    found = rw.simulate(scene, rung, duration=1e-2, step=1e-3)
    assert found.outcome.name == "unsupported" and found.certificate is not None, found


@pytest.mark.few(10)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_arms_on_springs_that_cannot_hold_them_are_told(make: Make, seed: int, rung: Rung) -> None:
    """A spring that holds an arm upright against gravity moves it little; a weaker one lets it leap."""
    random = np.random.default_rng(seed)
    for part, leaps in ((2.0, False), (random.uniform(1e-3, 0.02), True)):
        arm = (
            f'<body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0" stiffness="{part * 9.81 * 0.25}"/>'
            '<geom type="capsule" fromto="0 0 0 0.03 0 0.5" size="0.02" mass="1"/></body>'
        )
        found = _walk(make(world(arm)), rung, duration=0.05, step=10.0 ** random.uniform(-3, -2)).result()
        told = any("leapt" in note for note in found.notes) or "snaps out of its balance" in found.reason
        assert told == leaps, found
        assert found.outcome.name in (("timeout", "model_invalid") if leaps else ("timeout",))


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_heavy_stacks_on_soft_contacts_sink_in_topple_or_stand(make: Make, seed: int) -> None:
    random, height, bodies = np.random.default_rng(seed), 0.0, ""
    for k in range(int(random.integers(2, 8))):
        x, y, z = random.uniform(0.02, 0.15, 3)
        place = f"{random.uniform(-0.01, 0.01)} {random.uniform(-0.01, 0.01)} {height + z}"
        bodies += free(
            f"s{k}", place, f'type="box" size="{x} {y} {z}" mass="{10.0 ** random.uniform(-1, 4)}"'
        )
        height += 2.0 * z
    law = {
        "stiffness": 10.0 ** random.uniform(2, 7),
        "damping": 10.0 ** random.uniform(-1, 3),
        "friction": 0.5,
    }
    found = _walk(
        make(world(FLOOR, bodies), contacts=[law]), rw.QUASISTATIC_COMPLIANT, duration=0.1, step=1e-2
    )
    assert found.outcome in (Code.TIMEOUT, Code.MODEL_INVALID, Code.UNSUPPORTED)


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", SEEDS)
def test_arms_that_servos_lead_through_air_take_their_steps_beside_a_small_body(
    make: Make, seed: int, rung: Rung
) -> None:
    """By more than the body's size in each; a step in which they first sag may be shorter."""
    random = np.random.default_rng(seed)
    half, speed, drive = random.uniform(1e-3, 4e-3), random.uniform(0.5, 2.0), seed % 3
    arm = (
        '<body name="arm" pos="0 0 .5"><joint name="j" axis="0 0 1"/><geom type="capsule"'
        ' fromto="0 0 0 .5 0 0" size=".02" mass="1"/><body pos=".5 0 0"><joint name="k" axis="0 1 0"/>'
        '<geom type="capsule"'
        ' fromto="0 0 0 .3 0 0" size=".02" mass=".5" contype="2"/></body></body>'
    )
    servo = '<position joint="{}" name="{}" kp="2000" kv="{}"{}/>'
    more = "" if drive else ' forcerange="-200 200"'
    motors = "".join(
        f'<velocity joint="{name}" name="{name}" kv="200"/>'
        if drive == 1
        else servo.format(name, name, random.uniform(10.0, 200.0), more)
        for name in "jk"
    )
    told: dict[str, object] = {"j": speed if drive == 1 else f"{speed} * t", "k": 0.0}
    cube = free("cube", f".3 .6 {half}", f'type="box" size="{half} {half} {half}" density="1000"')
    scene = make(world(FLOOR, cube, arm, after=f"<actuator>{motors}</actuator>"), controls=told)
    steps = 60
    found = rw.simulate(scene, rung, duration=1e-2 * steps, step=1e-2)
    assert found.outcome.name == "timeout" and found.steps <= steps + 4, found
    assert found.final["arm"]["j"] == pytest.approx(speed * 1e-2 * steps, rel=0.25)
