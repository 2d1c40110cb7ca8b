"""Steps that no shorter step makes better: without momentum and damping, loads deform contacts, and let go of
what nothing holds, in no time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw

GRAVITY = 9.81


def _boxes(rng: np.random.Generator, unit: float, heavy: float) -> tuple[list[float], str]:
    """Half heights, and the file of as many boxes side by side on a plane, in units of length `unit`."""
    heights, bodies = [], ""
    for i in range(int(rng.integers(1, 4))):
        x, y, z = rng.uniform(0.03, 0.1, 3) * unit
        heights.append(z)
        bodies += (
            f'<body name="box{i}" pos="{0.4 * i * unit} 0 {z}"><freejoint/>'
            f'<geom type="box" size="{x} {y} {z}" mass="{heavy}"/></body>'
        )
    plane = f'<geom type="plane" size="{unit} {unit} {unit}"/>'
    return heights, (
        f'<mujoco><option gravity="0 0 {-GRAVITY * unit}"/><worldbody>{plane}{bodies}</worldbody></mujoco>'
    )


@pytest.mark.parametrize("seed", range(12))
def test_undamped_contacts_yield_at_once_and_too_much_or_as_much_as_loads_ask(
    seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    unit, heavy = 10.0 ** rng.uniform(-3.0, 2.0), 10.0 ** rng.uniform(-2.0, 3.0)
    heights, text = _boxes(rng, unit, heavy)
    (tmp_path / "boxes.xml").write_text(text)
    for sunk, outcome in (
        (1e-3, rw.Outcome.TIMEOUT),
        (10.0 ** rng.uniform(-0.3, 3.0), rw.Outcome.MODEL_INVALID),
    ):
        depth = sunk * min(heights)
        law = {"friction": 0.5, "stiffness": heavy * GRAVITY * unit / (4.0 * depth), "damping": 0.0}
        scene = {
            "name": "sunk", "model": {"file": str(tmp_path / "boxes.xml")}, "duration": 0.02, "step": 2e-3,
            "contacts": [law], "tolerance": 1e-6 * unit,
        }  # fmt: skip
        run = rw.simulate(rw.load(scene), "quasistatic-compliant")
        assert run.outcome == outcome, run.reason
        if outcome == rw.Outcome.TIMEOUT:
            for i, height in enumerate(heights):
                assert run.final[f"box{i}"]["z"] == pytest.approx(height - depth, abs=1e-6 * depth)


@pytest.mark.parametrize("seed", range(12))
def test_a_ball_rolls_off_a_stack_that_tilts(seed: int, tmp_path: Path) -> None:
    """The centre of the ball lies beside those of the plates: where contacts yield, they tilt, and nothing
    holds the ball then, which a motion proves; on rigid contacts it rests."""
    rng = np.random.default_rng(seed)
    bodies, top, mass = "", 0.0, 10.0 ** rng.uniform(-1.0, 1.0)
    for i in range(int(rng.integers(1, 4))):
        x, y, z = rng.uniform(0.06, 0.1), rng.uniform(0.06, 0.1), rng.uniform(0.02, 0.06)
        aside, light = rng.uniform((0.005, -0.01), (0.015, 0.01)), mass * 10.0 ** rng.uniform(-2.0, 0.0)
        bodies += (
            f'<body name="plate{i}" pos="{aside[0]} {aside[1]} {top + z}"><freejoint/>'
            f'<geom type="box" size="{x} {y} {z}" mass="{light}"/></body>'
        )
        top += 2.0 * z
    bodies += f'<body name="ball" pos="0 0 {top + 0.04}"><freejoint/><geom size=".04" mass="{mass}"/></body>'
    plane = '<geom type="plane" size="1 1 1"/>'
    (tmp_path / "stack.xml").write_text(f"<mujoco><worldbody>{plane}{bodies}</worldbody></mujoco>")
    scene = rw.load({
        "name": "stack", "model": {"file": str(tmp_path / "stack.xml")}, "duration": 0.02, "step": 2e-3,
        "contacts": [{"friction": 0.5}],
    })  # fmt: skip
    run = rw.simulate(scene, "quasistatic-compliant")
    assert run.outcome == rw.Outcome.UNSUPPORTED, run.reason
    assert rw.simulate(scene, "quasistatic-rigid").outcome == rw.Outcome.TIMEOUT
