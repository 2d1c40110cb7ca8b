"""Stacks and piles: contacts share the load in many ways, and nothing moves, or moves as it must."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import rungwise as rw

from .conftest import MOVING

LOADED = [model for model in MOVING if model.loads]
RIGID = (rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID)
G = 9.81


def box(x: float, y: float, width: float = 1.0, angle: float = 0.0) -> dict[str, Any]:
    return {
        "role": "object",
        "mass": 1.0,
        "shape": {"kind": "box", "width": width, "height": 1.0},
        "pose": {"x": x, "y": y, "angle": angle},
        "motion": {"kind": "free"},
    }


def on_ground(bodies: list[dict[str, Any]], pull: float = 0.0, mu: float = 0.5, **fields: Any) -> rw.Scene:
    """Bodies on level ground, pulled along it by `pull` beside their weight."""
    named: dict[str, Any] = {f"b{i}": body for i, body in enumerate(bodies)}
    named["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    law = {"friction": mu, "stiffness": 1e6, "damping": 1e4}
    contacts = [{"between": ["b*", "b*"], **law}, {"between": ["b*", "ground"], **law}]
    scene = {"name": "pile", "gravity": [pull, -G], "bodies": named, "contacts": contacts}
    return rw.load(scene | {"duration": 0.1, "step": 1e-3} | fields)


def stack(boxes: int, width: float = 1.0, lean: float = 0.0) -> list[dict[str, Any]]:
    return [box(lean * i, 0.5 + i, width) for i in range(boxes)]


def pyramid(rows: int) -> list[dict[str, Any]]:
    return [box(c + 0.5 * r, 0.5 + r, 0.9) for r in range(rows) for c in range(rows - r)]


def two_point_bodies() -> dict[str, list[dict[str, Any]]]:
    """Bodies on two points: where both stick, the tangential forces may be shared in many ways."""
    discs = [{"kind": "disc", "radius": 0.1, "at": [x, 0.0]} for x in (-0.5, 0.5)]
    shapes: dict[str, tuple[Any, float]] = {
        "rounded": ({"kind": "box", "width": 1.0, "height": 1.0, "radius": 0.1}, 0.6),
        "capsule": ({"kind": "capsule", "length": 1.0, "radius": 0.1}, 0.1),
        "discs": (discs, 0.1),
    }
    return {name: [box(0.0, y) | {"shape": shape}] for name, (shape, y) in shapes.items()}


PILES = {"box": stack(1), "four": stack(4), "ten": stack(10), "pyramid": pyramid(4), **two_point_bodies()}


def ground_force(run: rw.simulation.run.Run) -> float:
    """Mean normal force of the ground on everything, over the second half of the run."""
    data = run.trajectory
    late = data.time.values >= 0.5 * run.time
    held = [str(name).split("/")[0].endswith("ground") for name in data.point.values]
    if "contact_impulse" in data:
        given = data.contact_impulse.values[late][1:, held, 0].sum()
        return float(given / np.ptp(data.time.values[late]))
    return float(data.contact_force.values[late][:, held, 0].sum(axis=1).mean())


@pytest.mark.few(11)
@pytest.mark.parametrize("pile", PILES)
@pytest.mark.parametrize("model", LOADED, ids=str)
def test_what_is_at_rest_stays_and_is_carried(model: rw.Rung, pile: str) -> None:
    scene = on_ground(PILES[pile])
    run = rw.simulate(scene, model, stride=1)
    assert run.outcome.name == "timeout", run.reason
    assert run.attempts == run.steps == 100 and run.worst_residual <= 1e-9
    assert ground_force(run) == pytest.approx(G * len(PILES[pile]), rel=1e-3 if model.compliant else 1e-9)
    moved = np.abs(run.trajectory.position.values - run.trajectory.position.values[0]).max()
    assert moved <= (1e-2 if model.compliant else 1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("model", RIGID, ids=str)
@pytest.mark.parametrize("boxes", [pyramid(6), stack(20)], ids=("pyramid", "stack"))
def test_twenty_boxes_rest_for_a_second_without_a_refused_step(
    model: rw.Rung, boxes: list[dict[str, Any]]
) -> None:
    run = rw.simulate(on_ground(boxes, duration=1.0), model)
    assert run.attempts == run.steps == 1000 and run.worst_residual <= 1e-9
    assert np.abs(run.trajectory.position.values - run.trajectory.position.values[0]).max() <= 1e-12


@pytest.mark.parametrize("pull", [4.0, 6.0])
def test_a_stack_that_slides_does_so_as_one(pull: float) -> None:
    """All friction is at its limit, yet between the boxes nothing slips; nothing tips, as they are wide."""
    mu, h, steps = 0.3, 1e-3, 100
    run = rw.simulate(on_ground(stack(6, width=10.0), pull, mu), rw.DYNAMIC_RIGID)
    assert run.attempts == run.steps == steps and run.worst_residual <= 1e-9
    gone = 0.5 * (pull - mu * G) * h * h * steps * (steps + 1)
    for name, place in run.final.items():
        assert place["x"] == pytest.approx(gone, rel=1e-9)
        assert abs(place["angle"]) <= 1e-12 and place["y"] == pytest.approx(0.5 + int(name[1:]), abs=1e-12)


@pytest.mark.parametrize(("pull", "falls"), [(1.55, False), (1.72, True)])
def test_a_stack_tips_when_its_weight_leaves_its_base(pull: float, falls: bool) -> None:
    """Six boxes with their centre 3 up and 0.5 from the edge tip as one where pull / g > 1/6."""
    scene = on_ground(stack(6), pull, duration=0.3)
    rigid = rw.simulate(scene, rw.DYNAMIC_RIGID)
    tilted = [abs(place["angle"]) > 1e-4 for place in rigid.final.values()]
    assert rigid.worst_residual <= 1e-8 and tilted == [falls] * 6
    still = rw.simulate(scene, rw.QUASISTATIC_RIGID)
    assert still.outcome.name == ("unsupported" if falls else "timeout"), still.reason


def test_a_heap_that_falls_comes_to_rest() -> None:
    """Boxes at an angle, dropped side by side on each other: energy only falls, and few steps are refused."""
    angles = [0.3, -0.4, 0.2, -0.1, 0.45, -0.25, 0.05, 0.35]
    boxes = [
        box(1.45 * (i % 4) + 0.1 * (i // 4), 1.0 + 1.6 * (i // 4), angle=a) for i, a in enumerate(angles)
    ]
    run = rw.simulate(on_ground(boxes, duration=2.0), rw.DYNAMIC_RIGID)
    data = run.trajectory
    assert run.outcome.name == "timeout" and run.worst_residual <= 1e-8
    assert run.attempts <= 1.05 * run.steps
    total = data.kinetic_energy.values + data.potential_energy.values
    assert all(b <= a + 1e-6 * total[0] for a, b in itertools.pairwise(total))
    assert data.kinetic_energy.values[-1] <= 1e-9 * total[0]
    assert data.gap.values[-1].min() >= -1e-3
