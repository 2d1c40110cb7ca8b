"""Several pieces on supports, pushed by fingers: on every rung their friction has an answer, and the same."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rungwise as rw
from rungwise.world.find import world_of

RADIUS, SPEED, G = 0.012, 0.01, 9.81
STIFFNESS, LIMIT, YIELDING = 2000.0, 20.0, 1e5
CREEPS = {(0, 4, 2), (1, 6, 2), (1, 7, 1), (1, 12, 2), (2, 11, 1)}
"""Seed, pieces and fingers of heaps that a quasistatic rung does not push to the end: the first ends as not
converged on the rigid one; the others take steps on the compliant one so short that 30 s are not enough."""
HEAPS = [(s, c, f) for s in range(4) for c in range(2, 13) for f in (1, 2) if (s, c, f) not in CREEPS]
AGREE = 1e-3
"""Distance (m) between the ends of a slow push with and without inertia, at most: a twelfth of a piece's
radius. Bodies that slide on when they come free go 0.03 mm at this speed, and go on from there."""


def piece(
    x: float, y: float, mass: float, mu: float, shape: dict[str, Any] | None = None, **pose: float
) -> dict[str, Any]:
    return {
        "role": "object", "shape": shape or {"kind": "disc", "radius": RADIUS}, "mass": mass,
        "pose": {"x": x, "y": y, **pose}, "motion": {"kind": "free"},
        "support": {"friction": mu, "gravity": G},
    }  # fmt: skip


def finger(x: float, y: float, way: float = 1.0) -> dict[str, Any]:
    drive = {
        "kind": "servo", "stiffness": STIFFNESS, "damping": 40.0, "target_speed": SPEED, "limit": LIMIT,
    }  # fmt: skip
    return {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.5 * RADIUS}, "mass": 0.1,
        "pose": {"x": x, "y": y}, "motion": {"kind": "slide", "axis": [way, 0.0], "name": "x"},
        "coordinates": {"x": {"drive": drive}},
    }  # fmt: skip


def scene(bodies: dict[str, Any], mu: float, way: float) -> rw.Scene:
    """A scene in which fingers go so far."""
    contact = {"between": ["*", "*"], "friction": mu, "stiffness": YIELDING, "damping": 100.0}
    return rw.load(
        {
            "name": "pieces", "bodies": bodies, "contacts": [contact], "duration": way / SPEED, "step": 1e-3,
            "tolerance": 1e-7,
        }
    )  # fmt: skip


def heap(count: int, fingers: int, seed: int) -> rw.Scene:
    """Discs and boxes of unlike weight and friction that lie about, and fingers on their way through."""
    rng, spread = np.random.default_rng([count, fingers, seed]), 0.02 * math.sqrt(count)
    places = list[NDArray[np.float64]]()
    while len(places) < count:
        place = rng.uniform(-spread, spread, 2)
        if all(math.dist(place, other) > 2.9 * RADIUS for other in places):
            places.append(place)
        else:
            spread *= 1.003
    bodies = dict[str, Any]()
    for k, (x, y) in enumerate(places):
        box = {"kind": "box", "width": 2 * RADIUS, "height": rng.uniform(0.8, 1.6) * RADIUS}
        mass, mu = 10.0 ** rng.uniform(-2.0, -0.5), rng.uniform(0.2, 0.5)
        angle = rng.uniform(0.0, 6.0)
        bodies[f"piece{k}"] = piece(x, y, mass, mu, box if rng.random() < 0.5 else None, angle=angle)
    for f in range(fingers):
        way = 1.0 - 2.0 * f
        y = rng.uniform(-0.3, 0.3) * spread + RADIUS * way * (fingers - 1)
        bodies[f"finger{f}"] = finger(-way * (spread + 2.0 * RADIUS), y, way)
    return scene(bodies, rng.uniform(0.0, 0.6), spread + 0.02)


def ends(run: rw.Run) -> NDArray[np.float64]:
    """Places (m, 2) of the pieces."""
    return np.array([[at["x"], at["y"]] for name, at in sorted(run.final.items()) if "piece" in name])


@pytest.mark.few(1)
@pytest.mark.parametrize(("seed", "count", "fingers"), HEAPS)
def test_heaps_of_pieces_are_pushed_as_slowly_with_inertia(seed: int, count: int, fingers: int) -> None:
    pieces = heap(count, fingers, seed)
    runs = {
        rung.name: rw.simulate(pieces, rung, tol=1e-5)
        for rung in (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_RIGID)
    }
    assert {str(run.outcome) for run in runs.values()} == {"timeout"}
    slow = ends(runs["dynamic-rigid"])
    for name in ("quasistatic-rigid", "quasistatic-compliant"):
        assert np.abs(ends(runs[name]) - slow).max() <= AGREE


@pytest.mark.parametrize("model", ["quasistatic-rigid", "quasistatic-compliant"])
def test_a_row_of_pieces_asks_for_the_sum_of_their_friction(model: str) -> None:
    """They go straight on together, and the servo is behind by this force over its stiffness; each contact
    that yields carries the friction of those ahead."""
    masses, frictions = (0.02, 0.3, 0.05, 0.11), (0.3, 0.2, 0.5, 0.4)
    bodies = {
        f"piece{k}": piece(2.0 * RADIUS * k, 0.0, *each)
        for k, each in enumerate(zip(masses, frictions, strict=True))
    }
    run = rw.simulate(scene(bodies | {"finger": finger(-1.5 * RADIUS, 0.0)}, 0.4, 0.02), model, step=1e-2)
    carried = np.cumsum((np.array(masses) * frictions * G)[::-1])[::-1]
    behind, yields = carried[0] / STIFFNESS, 0.0 if model.endswith("rigid") else np.cumsum(carried) / YIELDING
    assert str(run.outcome) == "timeout"
    assert run.final["finger"]["x"] == pytest.approx(0.02 - behind, abs=1e-6)
    begin = np.array([[2.0 * RADIUS * k, 0.0] for k in range(4)])
    gone = ends(run) - begin
    np.testing.assert_allclose(gone[:, 0], 0.02 - behind - yields, rtol=0.0, atol=1e-6)
    assert gone[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_pieces_in_another_order_and_in_a_mirror_go_the_same_ways() -> None:
    rng, places = np.random.default_rng(5), [(0.0, 0.004), (0.03, -0.012), (0.03, 0.014), (0.06, 0.002)]
    weights = [(float(m), float(mu)) for m, mu in rng.uniform(0.05, 0.4, (4, 2))]

    def pushed(order: list[int], side: float) -> NDArray[np.float64]:
        bodies = {f"piece{k}": piece(places[k][0], side * places[k][1], *weights[k]) for k in order}
        run = rw.simulate(
            scene({"finger": finger(-2.0 * RADIUS, 0.0)} | bodies, 0.3, 0.05), "quasistatic-rigid", tol=1e-6
        )
        return ends(run) * [1.0, side]

    first = pushed([0, 1, 2, 3], 1.0)
    assert (np.abs(first - np.array(places)).max(axis=1) > 1e-3).sum() == 3
    np.testing.assert_allclose(pushed([3, 1, 0, 2], 1.0), first, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(pushed([0, 1, 2, 3], -1.0), first, rtol=0.0, atol=1e-7)


def test_bodies_far_from_each_other_are_looked_at_among_many() -> None:
    """A crowded step has no room for all pairs; what is asked of one pair finds it however far it is."""
    pieces = heap(20, 1, 0)
    around = world_of(pieces).surroundings({})
    start = world_of(pieces).at({}).q
    far = [around.near(start, k).gap for k in range(len(pieces.template.contacts))]
    assert np.isfinite(far).all() and max(far) > 5.0 * RADIUS
