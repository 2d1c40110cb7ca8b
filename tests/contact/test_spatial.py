"""Steps' problems in space: `solve_spatial` on random scenes, known answers, and scenes without an answer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.contact.solvers.spatial import solve_spatial
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.planar import GUESS, NO_SOLUTION, SOLVED, TOLERANCE
from rungwise.contact.step.problem import ContactProblem, allocate_problem
from rungwise.contact.step.residual import residual

Array = NDArray[np.float64]
G, H = 9.81, 1e-3
CORNERS = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])


class Answer(NamedTuple):
    status: int
    residual: float
    stage: int
    v: Array
    force: Array
    tau: Array
    mode: NDArray[np.int64]


def solve(p: ContactProblem, force: Array | None = None, tau: Array | None = None) -> Answer:
    """The answer, whose residual is the judge's; without a solution it is zero."""
    n, contacts, limited = len(p.c), len(p.mu), len(p.F)
    force = np.zeros(len(p.w)) if force is None else force.copy()
    tau = np.zeros(limited) if tau is None else tau.copy()
    mode, v = np.full(contacts + limited, -7, np.int64), np.full(n, np.nan)
    status, found, stage = solve_spatial(p, n, contacts, limited, mode, v, force, tau)
    if status == SOLVED:
        assert found == residual(p, n, contacts, limited, v, force, tau) <= TOLERANCE
    else:
        assert status == NO_SOLUTION and not (v.any() or force.any() or tau.any())
    return Answer(status, found, stage, v, force, tau, mode)


def spd(rng: np.random.Generator, n: int) -> Array:
    a = rng.normal(size=(n, n))
    return np.asarray(a @ a.T + 0.1 * n * np.eye(n))


def draw(
    rng: np.random.Generator, d: int, compliant: bool = False, light: bool = False, bodies: int = 5
) -> ContactProblem:
    """Free bodies and an arm in several islands: redundant contacts, one-sided rows, joints, dry friction and
    servos, that rest or do not touch yet, so that there is an answer."""
    sizes = [6] * bodies + [int(rng.integers(3, 10))]
    first = np.concatenate([[0], np.cumsum(sizes)])
    n, contacts, limited = int(first[-1]), int(rng.integers(1, 5 * bodies)), int(rng.integers(0, 9))
    p = allocate_problem(n, contacts, limited, d)
    for b, size in enumerate(sizes):
        own = slice(first[b], first[b + 1])
        p.H[own, own] = spd(rng, size) * 10.0 ** rng.uniform(-2, 2) * (1e-7 if light else 1.0)
    p.c[:] = rng.normal(size=n)
    p.quantum[0] = 1e-13
    for k in range(contacts):
        rows = slice(d * k, d * k + d)
        for b in rng.choice(bodies + 1, int(rng.integers(1, 3)), replace=False):
            p.W[rows, first[b] : first[b + 1]] = rng.normal(size=(d, sizes[b]))
        p.mu[k] = rng.choice([0.0, 0.2, 0.7, 1.2])
        p.w[d * k] = rng.choice([0.0, 0.0, 0.1]) * rng.random()
        if k and rng.random() < 0.5:  # a patch: rows that are combinations of others
            p.W[rows] = p.W[d * (k - 1) : d * k] + (rng.random() < 0.5) * 1e-3 * p.W[rows]
            p.mu[k] = p.mu[k - 1]
        if p.mu[k] == 0.0:
            p.W[d * k + 1 : d * k + d] = 0.0
        if compliant:
            p.R[k] = spd(rng, d) * 10.0 ** rng.uniform(-4, -1)
    for r in range(limited):
        b = int(rng.integers(0, bodies + 1))
        p.S[r, first[b] : first[b + 1]] = rng.normal(size=sizes[b])
        p.F[r] = rng.choice([0.0, 0.3, 3.0, np.inf])
        if rng.random() < 0.5:
            p.R_s[r], p.w_s[r] = 10.0 ** rng.uniform(-3, 0), rng.normal()
    return p


@pytest.mark.parametrize("d", [3, 4])
@pytest.mark.parametrize("compliant", [False, True])
@pytest.mark.parametrize("light", [False, True])
def test_random_scenes_are_solved(d: int, compliant: bool, light: bool) -> None:
    rng = np.random.default_rng(11 + d)
    answers = [solve(draw(rng, d, compliant, light)) for _ in range(100)]
    assert [i for i, answer in enumerate(answers) if answer.status != SOLVED] == []
