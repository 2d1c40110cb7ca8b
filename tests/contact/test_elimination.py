"""Velocities eliminated: what is left as a product is what is left as a matrix, whatever inertia."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.prepare.islands import islands
from rungwise.contact.prepare.system import System, scaled

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import assemblies


def turned(problem: rw.Problem) -> rw.Problem:
    """The same with velocities counted in other directions for each body: inertia is no diagonal then."""
    n, rng = problem.velocities, np.random.default_rng(0)
    turns = sp.block_diag(
        [sp.coo_array(np.linalg.qr(rng.normal(size=(6, 6)))[0]) for _ in range(n // 6)], format="csr"
    )
    whole = sp.block_diag([sp.eye_array(problem.rows), turns], format="csr")
    A, b = whole.T @ problem.A @ whole, whole.T @ problem.b
    return rw.Problem(A, b, problem.mu, 3, problem.lower, problem.upper, n)


def yielding(problem: rw.Problem) -> rw.Problem:
    """The same with compliant contacts, whose rates are coupled."""
    rng = np.random.default_rng(1)
    factors = rng.normal(size=(len(problem.mu), 3, 3))
    blocks = (
        1e-2
        * abs(scaled(problem).rate / scaled(problem).force)[::3, None, None]
        * (factors @ factors.transpose(0, 2, 1))
    )
    A = problem.A + sp.block_diag([*blocks, sp.csr_array((problem.velocities,) * 2)], format="csr")
    return rw.Problem(A, problem.b, problem.mu, 3, problem.lower, problem.upper, problem.velocities)


PROBLEMS: dict[str, Callable[[], rw.Problem]] = {
    "pile": lambda: assemblies.pile(15, 3.0),
    "pile, inertia in blocks": lambda: turned(assemblies.pile(15, 3.0)),
    "pile, compliant": lambda: yielding(assemblies.pile(15, 3.0)),
    "stack, compliant, inertia in blocks": lambda: turned(yielding(assemblies.stack(20, 3.0))),
}


@pytest.fixture(params=PROBLEMS)
def problem(request: pytest.FixtureRequest) -> rw.Problem:
    return PROBLEMS[request.param]()


def schur(problem: rw.Problem, system: System) -> np.ndarray:
    """The matrix that is left, scaled, from its definition."""
    A, rows = problem.A.toarray(), problem.rows
    left = A[:rows, :rows] - A[:rows, rows:] @ np.linalg.solve(A[rows:, rows:], A[rows:, :rows])
    return left * system.force / system.rate[:, None]


@pytest.mark.few(3)
def test_what_is_left_is_the_definition(problem: rw.Problem) -> None:
    system = scaled(problem)
    expected = schur(problem, system)
    np.testing.assert_allclose(system.dense(), expected, atol=1e-13)


def test_islands_of_a_product_are_those_of_the_matrix() -> None:
    one, rows = assemblies.pile(10, 3.0), assemblies.pile(10).rows
    n = len(one.b) - rows
    blocks = [[one.A[:rows, :rows], one.A[:rows, rows:]], [one.A[rows:, :rows], one.A[rows:, rows:]]]
    A = sp.block_array(
        [[None if M is None else sp.block_diag([M, M]) for M in row] for row in blocks], format="csr"
    )
    idle = sp.diags_array(np.ones(6))  # a body that nothing touches is no island
    A = sp.block_diag([A, idle], format="csr")
    b = np.concatenate([np.tile(one.b[:rows], 2), np.tile(one.b[rows:], 2), np.ones(6)])
    free = np.full(2 * n + 6, np.inf)
    both = rw.Problem(A, b, np.tile(one.mu, 2), 3, -free, free, 2 * n + 6)
    system = scaled(both)
    apart = islands(system)
    assert apart is not None
    np.testing.assert_array_equal(apart.first, [0, rows, 2 * rows])
    found = rw.solve(both)
    assert found.status == "solved"
    np.testing.assert_allclose(found.v[-6:], -1.0)
