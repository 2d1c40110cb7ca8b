"""The eliminations against numpy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rungwise.contact.block_factors import add, add_product, clear, plan
from rungwise.contact.block_factors import factorise as factorise_blocks
from rungwise.contact.block_factors import substitute as substitute_blocks
from rungwise.contact.least_degree import Pattern, eliminate, join
from rungwise.contact.linear import factorise, solve_in_place, substitute


@pytest.mark.few(1)
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


def test_singular_systems_are_noticed():
    a = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    assert solve_in_place(a.copy(), 2, 1, np.zeros(2, np.int64)) == 1
    assert not factorise(a[:, :2].copy(), 2, np.zeros(2, np.int64))


@pytest.mark.long
@pytest.mark.parametrize("bodies", [1, 2, 7, 20])
def test_factors_by_blocks_are_those_of_the_whole(bodies):
    """Bodies of one to seven velocities, and groups that touch one, two or three of them."""
    rng = np.random.default_rng(bodies)
    for _ in range(5):
        first = np.concatenate([[0], np.cumsum(rng.integers(1, 8, bodies))])
        n, whole = int(first[-1]), np.zeros((first[-1], first[-1]))
        for a, b in itertools.pairwise(first):
            own = rng.normal(size=(b - a, b - a))
            whole[a:b, a:b] = own @ own.T + np.eye(b - a)
        sizes = np.repeat(np.diff(first), np.diff(first))
        columns = [np.arange(a, b) for a, b in itertools.pairwise(first)]
        touched = [
            np.concatenate([columns[b] for b in sorted(rng.choice(bodies, min(bodies, k), replace=False))])
            for k in rng.integers(1, 4, 3 * bodies)
        ]
        pattern = Pattern(
            np.concatenate([[0], np.cumsum(sizes)]), np.concatenate([columns[b] for b in np.searchsorted(
                first, np.arange(n), side="right") - 1]),
            np.concatenate([[0], np.cumsum([len(t) for t in touched])]), np.concatenate(touched),
        )  # fmt: skip
        blocks = plan(pattern)
        clear(blocks)
        for i, j in zip(*whole.nonzero(), strict=True):
            add(blocks, i, j, whole[i, j])
        for t in touched:
            W, E = rng.normal(size=(3, len(t))), np.eye(3) + 0.3 * rng.normal(size=(3, 3))
            C = rng.normal(size=(3, len(t)))
            add_product(blocks, t, C, E, W, np.empty(3 * len(t)))
            whole[np.ix_(t, t)] += C.T @ E @ W
        assert factorise_blocks(blocks)
        b = rng.normal(size=n)
        x = b.copy()
        substitute_blocks(blocks, x)
        assert whole @ x == pytest.approx(b, abs=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("nodes", [1, 2, 9, 40, 140])
def test_nodes_are_eliminated_in_the_order_of_least_degree(nodes):
    """Beside all degrees, counted anew at each elimination."""
    rng = np.random.default_rng(nodes)
    for density in (0.0, 0.03, 0.1, 0.3, 1.0):
        near = np.triu(rng.random((nodes, nodes)) < density, 1)
        near |= near.T
        bits = np.zeros((nodes, nodes), np.int64)
        for a, b in zip(*near.nonzero(), strict=True):
            join(bits, a, b)
        place, start, later = eliminate(bits)
        left = list(range(nodes))
        for p in range(nodes):
            pivot = min(left, key=lambda i: (near[i].sum(), i))
            joined = np.flatnonzero(near[pivot])
            assert place[pivot] == p
            assert later[start[p] : start[p + 1]].tolist() == sorted(place[joined])
            near[np.ix_(joined, joined)] = True
            near[pivot] = near[:, pivot] = False
            np.fill_diagonal(near, False)
            left.remove(pivot)
