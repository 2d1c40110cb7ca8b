"""The eliminations against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.contact.linear import factorise, solve_in_place, substitute, substitute_many


@pytest.mark.parametrize("size", [1, 2, 5, 17])
def test_all_solve_regular_systems(size):
    """With zeros, and a diagonal that calls for exchanges."""
    rng = np.random.default_rng(size)
    for _ in range(50):
        a = rng.normal(size=(size, size)) * (rng.random((size, size)) < 0.6)
        a[np.arange(size), rng.permutation(size)] += 3.0
        if np.linalg.cond(a) > 1e6:
            continue
        b = rng.normal(size=(size, 2))
        system, order = np.hstack([a, b]), np.zeros(size, np.int64)
        assert solve_in_place(system, size, 2, order) == size
        assert a @ system[:, size:] == pytest.approx(b, abs=1e-9)
        factors, x = a.copy(), b[:, 0].copy()
        assert factorise(factors, size, order)
        substitute(factors, size, order, x)
        assert a @ x == pytest.approx(b[:, 0], abs=1e-9)
        x = b[:, 1].copy()
        substitute_many(factors, size, order, x)
        assert a @ x == pytest.approx(b[:, 1], abs=1e-9)


def test_singular_systems_are_noticed():
    a = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    assert solve_in_place(a.copy(), 2, 1, np.zeros(2, np.int64)) == 1
    assert not factorise(a[:, :2].copy(), 2, np.zeros(2, np.int64))
