"""Loads of a planar scene against the gradient of their energy, and what constants say of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.system.planar import terms as planar_terms
from rungwise.system.terms import Terms, allocate_terms

BODIES = {
    "free": {
        "role": "object",
        "shape": {"kind": "polygon", "vertices": [[0, 0], [1, 0], [0.3, 0.8]]},
        "pose": {"x": 0.4, "y": 1.0, "angle": 0.3},
        "motion": {"kind": "free"},
    },
    "slider": {
        "role": "robot",
        "shape": {"kind": "disc", "radius": 0.5, "at": [0.2, 0.1]},
        "motion": {"kind": "slide", "axis": [1.0, 2.0]},
    },
    "arm": {
        "role": "robot",
        "shape": {"kind": "capsule", "length": 1.0, "radius": 0.1, "at": [0.5, 0.0]},
        "pose": {"x": 1.0, "y": -0.5, "angle": -0.4},
        "motion": {"kind": "hinge", "pivot": [1.0, -0.5]},
    },
    "wall": {"role": "obstacle", "shape": {"kind": "halfplane", "at": [0.0, -5.0]}},
}


def at_rest(placed: Any) -> tuple[Terms, NDArray[np.float64]]:
    """Terms and passive loads at placed.q; servos want their start."""
    records, n = placed.records, len(placed.q)
    terms, passive = allocate_terms(n, 8, 2 * n), np.zeros(n)
    planar_terms.constants(records, terms)
    placed.place(placed.q)
    start = placed.q.copy()
    planar_terms.loads(records, placed.pose, placed.q, np.zeros(n), start, 0.0, 0.0, 1.0, passive, terms)
    return terms, passive


def gradient(function: Callable[[NDArray[np.float64]], Any], q: NDArray[np.float64]) -> NDArray[np.float64]:
    steps = 1e-5 * np.eye(len(q))
    return np.array([(function(q + step) - function(q - step)) / 2e-5 for step in steps])


def test_gravity_is_minus_the_gradient_of_its_energy(planar: Callable[..., Any]) -> None:
    rng = np.random.default_rng(1)
    placed = planar(BODIES, gravity=[0.7, -9.81])

    def energy(q: NDArray[np.float64]) -> float:
        placed.place(q)
        return float(planar_terms.potential_energy(placed.records, placed.pose))

    for _ in range(20):
        placed.q = rng.uniform(-2.0, 2.0, 5)
        terms, passive = at_rest(placed)
        assert passive == pytest.approx(-gradient(energy, placed.q), abs=1e-7)
        assert np.array_equal(terms.load, passive)


def test_given_force_acts_at_the_centre_of_mass(planar: Callable[..., Any]) -> None:
    force, torque = np.array([1.3, -0.4]), 0.9
    loaded = {
        name: body | ({"force": list(force), "torque": torque} if name != "wall" else {})
        for name, body in BODIES.items()
    }
    placed = planar(loaded)
    _, passive = at_rest(placed)

    def work(q: NDArray[np.float64]) -> float:
        placed.place(q)
        return float(np.sum(placed.pose[:3, :2] @ force) + torque * (q[2] + q[4]))

    assert passive == pytest.approx(gradient(work, placed.q), abs=1e-8)


def test_potential_acts_on_robots_with_the_gradient_of_its_energy(planar: Callable[..., Any]) -> None:
    rng = np.random.default_rng(2)
    factors = {"slider.s": 2.0, "arm.angle": -0.5, "free.x": 1.5}
    spring = {"stiffness": 3.0, "terms": factors, "target": 0.7}
    some = planar(BODIES, potentials=[spring])
    every = planar(BODIES, potentials=[spring | {"on": list(factors)}])
    weights = np.array([1.5, 0.0, 0.0, 2.0, -0.5])

    def energy(q: NDArray[np.float64]) -> float:
        return float(1.5 * (weights @ q - 0.7) ** 2)

    for _ in range(10):
        some.q = every.q = rng.uniform(-2.0, 2.0, 5)
        pull = -gradient(energy, every.q)
        terms, _ = at_rest(every)
        assert terms.load == pytest.approx(pull, abs=1e-7)
        assert terms.stiffness == pytest.approx(3.0 * np.outer(weights, weights))
        assert at_rest(some)[0].load == pytest.approx(pull * (0, 0, 0, 1, 1), abs=1e-7)


def test_inertia_is_that_of_the_kinetic_energy(planar: Callable[..., Any]) -> None:
    """M of a coordinate: what mass and inertia weigh at the speeds that its unit speed gives the body."""
    placed = planar(BODIES)
    terms, _ = at_rest(placed)
    bodies = placed.records.bodies
    for i, owner in enumerate([0, 0, 0, 1, 2]):
        ahead, behind = placed.q.copy(), placed.q.copy()
        ahead[i] += 1e-5
        behind[i] -= 1e-5
        placed.place(ahead)
        pose = placed.pose[owner].copy()
        placed.place(behind)
        speed = (pose - placed.pose[owner]) / 2e-5
        expected = bodies[owner]["mass"] * (speed[0] ** 2 + speed[1] ** 2)
        expected += bodies[owner]["inertia"] * (speed[2] ** 2 + speed[3] ** 2)
        assert terms.inertia[i, i] == pytest.approx(expected, rel=1e-8)
        assert terms.metric[i, i] * bodies[owner]["mass"] == pytest.approx(terms.inertia[i, i])
    assert np.count_nonzero(terms.inertia) == 5
