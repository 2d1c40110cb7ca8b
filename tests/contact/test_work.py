"""Solves that lead nowhere end: by what they may do, and not by a clock."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.solution import ADVICE, FORCES_ALONE
from rungwise.contact.solve import LIMIT, SLIGHT, SQUARE, allowed

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import assemblies

SOLVE = importlib.import_module("rungwise.contact.solve")
SIZE = 900


def scattered(rng: np.random.Generator, rows: int, columns: int, per_row: float) -> sp.csr_array:
    """Random entries at random places (scipy's own generator changed its arguments in 1.15)."""
    some = rng.random((rows, columns)) < per_row / columns
    return sp.csr_array(np.where(some, rng.normal(size=(rows, columns)), 0.0))


def sparse(rng: np.random.Generator, own: float) -> sp.csr_array:
    """Random and symmetric, a few entries in each row: indefinite, and full once it is factorised."""
    A = scattered(rng, SIZE, SIZE, 3.0)
    return sp.csr_array(A + A.T + own * sp.eye_array(SIZE))


def dense(rng: np.random.Generator, own: float) -> np.ndarray:
    A = rng.normal(size=(SIZE, SIZE)) / SIZE**0.5
    return A + A.T + own * np.eye(SIZE)


def still(rng: np.random.Generator) -> rw.Problem:
    """Velocities of which a third have no inertia, so that nothing is eliminated."""
    n, k = SIZE // 2, SIZE // 6
    H = sp.diags_array(np.where(rng.random(n) < 0.3, 0.0, 1.0))
    W = scattered(rng, 3 * k, n, 8.0)
    return rw.Problem.balance(H, rng.normal(size=n), W, rng.normal(size=3 * k), np.full(k, 0.5))


PROBLEMS: dict[str, Callable[[np.random.Generator], rw.Problem]] = {
    "sparse, in space": lambda rng: rw.Problem.local(
        sparse(rng, 0.5), rng.normal(size=SIZE), np.full(SIZE // 3, 0.5)
    ),
    "sparse, in the plane": lambda rng: rw.Problem.local(
        sparse(rng, 0.5), rng.normal(size=SIZE), np.full(SIZE // 2, 0.5), 2
    ),
    "sparse LCP": lambda rng: rw.Problem.lcp(sparse(rng, 0.1), rng.normal(size=SIZE)),
    "dense, in space": lambda rng: rw.Problem.local(
        dense(rng, 0.5), rng.normal(size=SIZE), np.full(SIZE // 3, 0.5)
    ),
    "without inertia": still,
}


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long) if name.startswith("dense") else name for name in PROBLEMS],
)
def test_hopeless_problems_end_within_the_work_that_is_allowed(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fiftieth of what is allowed at most."""
    monkeypatch.setattr(SOLVE, "allowed", lambda _: LIMIT / 50)
    problem = PROBLEMS[name](np.random.default_rng(1))
    found = rw.solve(problem)
    assert found.status != "solved" and found.residuals.worst > found.tol
    assert np.isfinite(found.x).all() and found.reason.startswith(ADVICE[found.status])


@pytest.mark.few(1)
@pytest.mark.parametrize("is_dense", [False, True])
def test_a_stack_in_forces_alone_ends_and_says_what_helps(is_dense: bool) -> None:
    """Boxes ever heavier above, of which rounding of the Delassus matrix hides who carries whom."""
    p = assemblies.stack(40, 3.0, ratio=1e5)
    rows, A = p.rows, sp.csr_array(p.A)
    W, per_mass = A[:rows, rows:], sp.diags_array(1.0 / A[rows:, rows:].diagonal())
    delassus = (W @ per_mass @ W.T).tocsr()
    q = p.b[:rows] - W @ per_mass @ p.b[rows:]
    problem = rw.Problem.local(delassus.toarray() if is_dense else delassus, q, p.mu)
    found = rw.solve(problem)
    assert found.status in ("solved", "not_converged")
    assert (FORCES_ALONE in found.reason) == (found.status == "not_converged")


def test_the_work_that_is_allowed_follows_the_size() -> None:
    assert allowed(1) < 2 * SLIGHT
    assert allowed(2000) == pytest.approx(SLIGHT + SQUARE * 4e6)
    assert allowed(10**6) == LIMIT
