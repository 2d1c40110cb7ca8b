"""Linear systems solved in the velocities that were eliminated, dense and sparse."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.prepare.product import MOST
from rungwise.contact.prepare.system import System, scaled, uneliminated
from rungwise.contact.solvers.newton.condensed import diagonal_blocks, invert, solver
from rungwise.contact.solvers.newton.factors import factors

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import assemblies


@pytest.fixture(scope="module")
def system() -> System:
    """Of 260 balls: 1560 velocities, more than are kept dense."""
    return scaled(assemblies.balls(260, 6, 0.3))


@pytest.mark.long
@pytest.mark.parametrize("dense", [False, True])
def test_the_condensed_solution_is_that_of_the_whole_matrix(system: System, dense: bool) -> None:
    parts = system.condensed
    assert parts is not None and sp.issparse(parts.own) and parts.own.shape[0] > MOST
    if dense:
        parts = parts._replace(own=parts.own.toarray())
    rng, n, d = np.random.default_rng(0), system.size, system.directions
    E, L = 0.1 * rng.normal(size=(n, 3)), 0.1 * rng.normal(size=(n, 3))
    i = np.arange(n)
    E[i, i % d] += 1.0
    L[i, i % d] += 1.0
    whole = diagonal_blocks(E, system.rows, d) + diagonal_blocks(L, system.rows, d) @ system.matrix()
    made, right = solver(parts, system.rows, d, E, L), rng.normal(size=n)
    assert made is not None
    np.testing.assert_allclose(whole @ made.solve(right), right, atol=1e-9)
    assert made.sign == np.linalg.slogdet(whole.toarray())[0]


@pytest.mark.long
def test_factors_of_many_bodies_stay_sparse(system: System) -> None:
    """Each touches few others: less than half of the entries that any pivots leave."""
    parts = system.condensed
    assert parts is not None
    rng, n, d = np.random.default_rng(1), system.size, system.directions
    i = np.arange(n)
    E, L = 0.1 * rng.normal(size=(n, 3)), np.zeros((n, 3))
    E[i, i % d] = 10.0 ** rng.uniform(-3.0, 3.0, n)
    L[i, i % d] = 1.0
    made = solver(parts, system.rows, d, E, L)
    inverse, response = np.empty((2, n, 3))
    invert(E, L, parts.front, system.rows, d, inverse, response)
    shape = (n, parts.own.shape[0])
    B, C = (sp.csr_array(part[::-1], shape=shape) for part in (parts.back, parts.across))
    anywhere = factors(parts.own - C.T @ (diagonal_blocks(response, system.rows, d) @ B))
    assert made is not None and anywhere is not None
    assert made.entries <= anywhere.entries / 2


def test_blocks_of_contacts_and_single_others() -> None:
    values = np.arange(1.0, 16.0).reshape(5, 3)
    expected = np.zeros((5, 5))
    expected[:2, :2], expected[2:4, 2:4], expected[4, 4] = values[:2, :2], values[2:4, :2], values[4, 0]
    np.testing.assert_array_equal(diagonal_blocks(values, 4, 2).toarray(), expected)


def test_velocities_that_are_kept_are_not_taken_for_what_hides_a_low_rank() -> None:
    """Many contacts of few bodies, nothing eliminated: the first step of the path inside is a step."""
    from rungwise.contact.prepare import rank
    from rungwise.contact.solvers import interior_point
    from rungwise.contact.solvers.work import Work

    whole = uneliminated(assemblies.pile(15, 3.0))
    assert whole.has_free and rank.parts(whole) is None
    x, steps = interior_point.solve(whole, np.zeros(whole.size), 1e-10, Work())
    assert 0 < steps < 60
    found = rw.solve(assemblies.pile(15, 3.0), start=whole.recover(x * whole.force))
    assert found.status == "solved"
