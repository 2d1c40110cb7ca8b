"""Small problems in one compiled call: the same answers, and the same judgement, as step by step."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.prepare.elimination import eliminated


def moving(seed: int, inertia: float = 1.0, idle: int = 0) -> rw.Problem:
    """Six velocities, three contacts, a drive with a limit, a joint; and `idle` velocities."""
    rng = np.random.default_rng(seed)
    d, n = 2 + seed % 2, 6
    W, S = rng.normal(size=(3 * d, n)), rng.normal(size=(2, n))
    root = rng.normal(size=(n, n))
    H, c = inertia * (root @ root.T + 0.1 * np.eye(n)), rng.normal(size=n)
    H, c = sp.block_diag([H, sp.eye_array(idle)], format="csr"), np.concatenate([c, np.zeros(idle)])
    W, S = (sp.csr_array(np.hstack([J, np.zeros((len(J), idle))])) for J in (W, S))
    w, F = 0.1 * rng.normal(size=3 * d), np.array([0.2, np.inf])
    return rw.Problem.balance(H, c, W, w, [0.0, 0.4, 0.8], directions=d, S=S, w_s=[0.1, 0.0], F=F)


def test_what_is_left_is_the_same_whether_dense_or_sparse() -> None:
    for seed in range(6):
        small, large = eliminated(moving(seed)), eliminated(moving(seed, idle=300))
        assert isinstance(small.matrix, np.ndarray) and sp.issparse(large.matrix)
        np.testing.assert_allclose(small.matrix, large.matrix.toarray(), atol=1e-12)
        np.testing.assert_allclose(small.b, large.b, atol=1e-12)
        x = np.random.default_rng(seed).normal(size=len(small.b))
        n, v = moving(seed).rows, moving(seed).velocities
        np.testing.assert_allclose(small.recover(x)[n : n + v], large.recover(x)[n : n + v], atol=1e-9)


def test_velocities_that_nothing_holds_are_not_eliminated() -> None:
    problem = moving(0, inertia=0.0)
    assert len(eliminated(problem).kept) == len(problem.b)


def test_inertia_next_to_nothing_is_left_to_the_chain() -> None:
    """Beside rates without forces of 1e9, demands of 0.1 are within any tolerance of the first judge."""
    problem = moving(1, inertia=1e-9)
    found = rw.solve(problem)
    assert found.status == "solved" and found.residuals.penetration < 1e-6
