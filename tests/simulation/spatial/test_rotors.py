"""Fast rotors on joints: tops, gyroscopes and links, against integrations of their own."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rungwise as rw
from rungwise.outcome import Code
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import G, world

Array = NDArray[np.float64]
APART = 'contype="0" conaffinity="0"'


def _end(make: Make, bodies: str, speeds: Array, **options: float) -> tuple[Array, float, SpaceSimulation]:
    """Where a run of 0.5 s ends, the most that its energy changes, and the run."""
    simulation = SpaceSimulation(make(world(bodies)), rw.DYNAMIC_RIGID, duration=0.5, **options)
    stepper, space = simulation.stepper, simulation.space
    assert stepper is not None
    stepper.v[:] = speeds
    begun, most = space.energy(stepper.q, stepper.v), 0.0
    while simulation.outcome == Code.RUNNING:
        simulation.steps_taken(1)
        most = max(most, abs(space.energy(stepper.q, stepper.v) - begun))
    return stepper.q.copy(), most, simulation


def _top(seed: int) -> tuple[str, Array, Array]:
    """A box on a ball joint, with the centre of mass anywhere; its spin; and its axis after 0.5 s, as the
    body stands at first."""
    random = np.random.default_rng(seed)
    spin, lean = random.uniform(40.0, 200.0), random.uniform(0.2, 0.8)
    half = np.array([*random.uniform(0.02, 0.05, 2), random.uniform(0.005, 0.01)])
    centre = np.array([*random.uniform(-0.02, 0.02, 2) * (seed % 2), random.uniform(0.05, 0.12)])
    q = np.array([np.cos(lean), np.sin(lean), 0.0, 0.0])
    speeds = np.array([*random.normal(size=2), spin])
    square = np.square(half)
    inertia = np.diag(square.sum() - square) / 3.0
    inertia += centre @ centre * np.eye(3) - np.outer(centre, centre)

    def moved(_time: float, y: Array) -> Array:
        p, w = y[:4] / np.linalg.norm(y[:4]), y[4:]
        down = -G * _matrix(p)[2]
        turn = np.linalg.solve(inertia, np.cross(centre, down) - np.cross(w, inertia @ w))
        return np.concatenate([0.5 * _times(p, w), turn])

    exact = solve_ivp(moved, (0.0, 0.5), [*q, *speeds], method="DOP853", rtol=1e-10, atol=1e-11)
    numbers = " ".join(f"{value:.15g}" for value in q)
    at, size = (" ".join(f"{value:.15g}" for value in each) for each in (centre, half))
    body = (
        f'<body pos="0 0 1" quat="{numbers}"><joint type="ball"/>'
        f'<geom type="box" size="{size}" pos="{at}" mass="1" {APART}/></body>'
    )
    return body, speeds, _matrix(q).T @ _matrix(exact.y[:4, -1] / np.linalg.norm(exact.y[:4, -1]))[:, 2]


def _times(p: Array, w: Array) -> Array:
    """The product of a quaternion with (0, w)."""
    return np.array([-p[1:] @ w, *(p[0] * w + np.cross(p[1:], w))])


def _matrix(p: Array) -> Array:
    """The matrix of a unit quaternion."""
    a, v = p[0], p[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray(np.eye(3) + 2.0 * a * cross + 2.0 * cross @ cross)


def _off(found: Array, axis: Array) -> float:
    """The angle of a top's axis with another, both as the body stands at first."""
    return float(np.linalg.norm(_matrix(found / np.linalg.norm(found))[:, 2] - axis))


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(8))
def test_tops_point_where_eulers_equations_say(make: Make, seed: int) -> None:
    """The error falls at least as the step, and under `tol` it is what steps may add up to."""
    body, speeds, exact = _top(seed)
    short, shorter = (_off(_end(make, body, speeds, step=h)[0], exact) for h in (2e-4, 1e-4))
    assert shorter < 0.6 * short or shorter < 2e-4
    found, _, simulation = _end(make, body, speeds, step=1e-2, tol=1e-6)
    assert 0.1 * _off(found, exact) <= 1e-6 * simulation.steps


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
def test_fast_rotors_do_not_run_away_however_long_the_step(make: Make, seed: int) -> None:
    """A wheel on an arm in gimbals, and a second one on a second link, at up to two radians per step."""
    random = np.random.default_rng(seed)
    wheel = f'<geom type="cylinder" size=".05 .01" euler="0 90 0" mass="{random.uniform(0.3, 1.0)}" {APART}/>'
    link = (
        f'<geom type="capsule" fromto="0 0 0 .15 0 0" size=".01" mass="{random.uniform(0.05, 0.3)}" {APART}/>'
    )
    rotor = f'<body pos=".15 0 0"><joint axis="1 0 0"/>{wheel}</body>'
    more = f'<body pos=".15 0 0"><joint axis="0 0 1"/>{link}{rotor}</body>' if seed % 2 else ""
    bodies = (
        f'<body pos="0 0 1"><joint axis="0 0 1"/><geom size=".01" mass=".1" {APART}/>'
        f'<body><joint axis="0 1 0"/>{link}{rotor}{more}</body></body>'
    )
    spin = random.uniform(100.0, 200.0)
    speeds = np.array([0.0, 0.0, spin, *([0.0, -0.8 * spin] if seed % 2 else [])])
    (_, long, simulation), (_, short, _) = (_end(make, bodies, speeds, step=h) for h in (1e-2, 2e-3))
    kinetic = 0.5 * speeds @ _momentum(simulation, speeds)
    assert long < 0.5 * kinetic and short < 0.3 * long + 1e-3 * kinetic


def _momentum(simulation: SpaceSimulation, speeds: Array) -> Array:
    found = np.zeros(len(speeds))
    simulation.space.put_momentum(simulation.space.place, speeds, found)
    return found
