"""Stacks that stand on their faces: nothing tilts or slides them, so they rest, and friction has nothing to
do."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene

from .conftest import Make
from .measure import FLOOR, G, free, run, v, world
from .rungs import RIGID, named


def stack(make: Make, seed: int) -> SpaceScene:
    """Boxes and cylinders on each other, and on some a ball, of masses that may differ a lot, all of whose
    centres lie well within the faces below."""
    rng = np.random.default_rng(seed)
    mu, condim = rng.choice([0.2, 0.5, 0.9, 1.5]), rng.choice([3, 4, 6])
    decades, height, parts = rng.choice([0.0, 1.0, 2.0]), 0.0, []
    for level in range(rng.integers(2, 5)):
        a, b, c = rng.uniform(0.05, 0.1), rng.uniform(0.7, 1.3), rng.uniform(0.02, 0.06)
        geom = (
            f'type="box" size="{a} {a * b} {c}"' if rng.random() < 0.5 else f'type="cylinder" size="{a} {c}"'
        )
        x, y = rng.uniform(-0.006, 0.006, 2)
        turn = f'euler="0 0 {rng.uniform(0.0, 360.0)}"'
        mass = f'mass="{10 ** rng.uniform(-decades, decades)}" condim="{condim}"'
        parts.append(free(f"b{level}", f"{x} {y} {height + c}", f"{geom} {mass}", turn))
        height += 2.0 * c
    if rng.random() < 0.4:
        parts.append(free("ball", f"0 0 {height + 0.04}", f'type="sphere" size=".04" condim="{condim}"'))
    return make(world(FLOOR, *parts), contacts=[{"friction": float(mu)}], duration=3e-3, step=1e-3)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", RIGID, ids=named)
@pytest.mark.parametrize("seed", range(24))
def test_stacks_rest_and_friction_does_nothing(make: Make, rung: Rung, seed: int) -> None:
    found = run(stack(make, seed), rung, stride=1).trajectory
    assert not found.velocity.values.any()
    force, normal = found.touch_force.values, found.touch_normal.values
    pressure = (force * normal).sum(axis=1)
    friction = np.linalg.norm(force - pressure[:, None] * normal, axis=1)
    assert friction.max() <= 1e-11 * np.abs(pressure).max()


@pytest.mark.parametrize("light", [1e-2, 1.0, 1e2])
def test_a_compliant_floor_yields_at_once_below_bodies_of_unequal_masses(make: Make, light: float) -> None:
    """A light box on a heavy one: v = -load / (h K + C), from the first step on."""
    heavy, stiffness, damping, h = 4e3, 1e9, 1e6, 1e-3
    lower = free("lower", "0 0 .05", f'type="box" size=".1 .1 .05" mass="{heavy}" condim="6"')
    upper = free("upper", "0 0 .12", f'type="box" size=".05 .05 .02" mass="{light}" condim="6"')
    law = {"friction": 0.2, "stiffness": stiffness, "damping": damping}
    scene = make(world(FLOOR, lower, upper), contacts=[law], duration=h, step=h)
    found = run(scene, rw.QUASISTATIC_COMPLIANT, stride=1)
    expected = -(heavy + light) * G / 4.0 / (h * stiffness + damping)
    assert v(found)[2] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("count", [5, 12])
def test_boxes_on_soft_contacts_come_to_rest(make: Make, count: int) -> None:
    """The momentum that rounding of places leaves in them is none; what touches nothing keeps its own."""
    boxes = [
        free(f"b{i}", f"0 0 {0.1 + 0.2 * i}", 'type="box" size=".1 .1 .1" mass="8"') for i in range(count)
    ]
    slow = (
        '<body name="slow" pos="2 0 1"><joint name="slow" type="slide" axis="1 0 0"/><geom size=".1" mass="1"'
        ' contype="0" conaffinity="0"/></body>'
    )
    scene = make(
        world(FLOOR, *boxes, slow), duration=2.0, step=1e-3, start={"velocities": {"slow.slow": 1e-12}}
    )  # fmt: skip
    found = run(scene, rw.DYNAMIC_COMPLIANT)
    names = list(scene.template.velocities)
    assert not v(found)[: 6 * count].any()
    assert v(found)[names.index("slow.slow")] == 1e-12
