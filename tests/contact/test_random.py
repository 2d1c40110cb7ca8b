"""Hundreds of problems that nobody chose: solved, proved to be unsolvable, or reported with a residual."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.judge.farkas import check
from rungwise.contact.prepare.system import scaled

TRIALS, SEEDS = 300, 2


def random_problem(rng: np.random.Generator) -> rw.Problem:
    """Well and ill posed: rank deficient, nonsymmetric, indefinite, singular inertia, limits, joints, and
    contacts twice; friction from none to far beyond what is met; forces from 1e-4 to 1e4."""
    d, k = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    n, mu = d * k, rng.choice([0.0, 1e-9, 0.1, 0.5, 1.0, 1.0 + 1e-12, 2.0, 1e3], k)
    force = 10.0 ** rng.integers(-4, 5)
    match int(rng.integers(4)):
        case 0:
            size = int(rng.integers(1, 7))
            M = rng.normal(size=(size, size))
            return rw.Problem.lcp(M @ M.T if rng.random() < 0.5 else M, force * rng.normal(size=size))
        case 1:
            size = int(rng.integers(1, 7))
            G = rng.normal(size=(size, int(rng.integers(1, size + 1))))
            lower = np.where(rng.random(size) < 0.3, -np.inf, -rng.random(size))
            upper = np.where(rng.random(size) < 0.3, np.inf, rng.random(size))
            return rw.Problem.boxes(G @ G.T, rng.normal(size=size), lower, upper)
        case 2:
            nv, b = int(rng.integers(1, 7)), int(rng.integers(0, 3))
            H = rng.normal(size=(nv, nv))
            H = H @ H.T + 0.1 * np.eye(nv)
            still = int(rng.integers(0, nv + 1)) * int(rng.integers(0, 2))
            H[:still], H[:, :still] = 0.0, 0.0
            W, S = rng.normal(size=(n, nv)), rng.normal(size=(b, nv))
            if rng.random() < 0.2:
                W[-d:], mu[-1] = W[:d], mu[0]
            w, F = rng.normal(size=n) * (rng.random() < 0.5), force * rng.choice([0.0, 0.5, np.inf], b)
            load = force * rng.normal(size=nv)
            return rw.Problem.balance(H, load, W, force * w, mu, directions=d, S=S, w_s=np.zeros(b), F=F)
    G = rng.normal(size=(n, int(rng.integers(1, n + 3))))
    W = G @ G.T + (rng.random() < 0.3) * 1e-3 * rng.normal(size=(n, n))
    q = rng.normal(size=n) if rng.random() < 0.5 else G @ rng.normal(size=G.shape[1])
    return rw.Problem.local(W, force * q, mu, d)


def residual(problem: rw.Problem, x: np.ndarray) -> float:
    """The largest entry of the natural map of the exact law, in plain numpy and in the units given."""
    d, rows, y = problem.directions, problem.rows, problem.A @ x + problem.b
    others = x[rows:] - np.clip(x[rows:] - y[rows:], problem.lower, problem.upper)
    worst = float(np.abs(others).max(initial=0.0))
    for k, mu in enumerate(problem.mu):
        r, u = x[d * k : d * k + d], y[d * k : d * k + d].copy()
        u[0] += mu * np.linalg.norm(u[1:])
        ahead = r - u
        t = np.linalg.norm(ahead[1:])
        if mu * t <= -ahead[0]:
            onto = np.zeros(d)
        elif t <= mu * ahead[0]:
            onto = ahead
        else:
            n = (ahead[0] + mu * t) / (1.0 + mu**2)
            onto = np.concatenate([[n], mu * n * ahead[1:] / t])
        worst = max(worst, float(np.abs(r - onto).max()))
    return worst


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_random_problem_is_lied_about(seed: int) -> None:
    """Solved means the laws hold, recomputed; a certificate checks; hardly any is left undecided."""
    rng, met = np.random.default_rng(seed), Counter[str]()
    for _ in range(TRIALS):
        problem = random_problem(rng)
        found = rw.solve(problem)
        met[str(found.status)] += 1
        assert np.isfinite(found.x).all()
        if found.status == "solved":
            size = np.abs(problem.b).max() + np.abs(problem.A).max() * np.abs(found.x).max()
            assert residual(problem, found.x) <= 1e-6 * size
        elif found.status == "not_converged":
            assert found.residuals.worst > found.tol and found.certificate is None
        else:
            assert found.certificate is not None and check(scaled(problem, found.massless), found.certificate)
    assert met["solved"] >= 0.7 * TRIALS
    assert met["not_converged"] <= 0.03 * TRIALS
