"""The tree on sets known in closed form: what it finds, and what it costs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rungwise.kernel import Ints, Reals
from rungwise.sets.cells.crossings import solve
from rungwise.sets.cells.tree import BudgetSpent, Tree


class Oracle:
    """Labels 0 and 1 by the sign of a function on the unit box; counts what it is asked."""

    def __init__(self, function: Callable[[Reals], Reals], finest: int) -> None:
        self.function, self.side, self.count = function, float(1 << finest), 0

    def __call__(self, places: Reals) -> tuple[Ints, Reals]:
        self.count += len(places)
        values = self.function(places / self.side)
        return (values < 0.0).astype(np.int64), values


def ball(x: Reals) -> Reals:
    return np.asarray(0.37 - np.linalg.norm(x - 0.47, axis=1))


def grown(function: Callable[[Reals], Reals], axes: int, target: int) -> tuple[Tree, Oracle]:
    tree, oracle = Tree.empty(axes, target, target), Oracle(function, target)
    tree.grow(oracle)
    return tree, oracle


@pytest.mark.few(1)
@pytest.mark.parametrize(("axes", "levels", "growth"), [(2, (6, 7, 8, 9), 2.0), (3, (5, 6, 7), 4.0)])
def test_evaluations_grow_like_the_surface(axes: int, levels: tuple[int, ...], growth: float) -> None:
    trees = [grown(ball, axes, level) for level in levels]
    counts = [oracle.count for _, oracle in trees]
    cells = [len(tree.leaves[level]) for (tree, _), level in zip(trees, levels, strict=True)]
    assert cells[-1] / cells[-2] == pytest.approx(growth, rel=0.02)
    assert (np.divide(counts[1:], counts[:-1]) < 1.02 * growth).all()


@pytest.mark.long
def test_a_surface_at_256_costs_a_twentieth_of_the_grid() -> None:
    assert grown(ball, 3, 8)[1].count < 256**3 / 20


@pytest.mark.few(2)
@pytest.mark.parametrize("axes", [1, 2, 3, 4])
def test_leaves_tile_the_box_and_agree_with_their_corners(axes: int) -> None:
    tree, _ = grown(ball, axes, 5 if axes < 4 else 4)
    cells = sum(len(cells) * tree.size(level) ** axes for level, cells in enumerate(tree.leaves))
    assert cells == (1 << tree.finest) ** axes
    places = np.random.default_rng(0).uniform(0.0, 1 << tree.finest, (5000, axes))
    levels, _ = tree.locate(places)
    assert (levels >= 0).all()
    # A leaf that is not of the finest level has one label, and the boundary is not in it.
    truth = ball(places / (1 << tree.finest)) < 0.0
    for level in range(tree.finest):
        here = levels == level
        cells_here = tree.leaves[level][tree.locate(places[here])[1]]
        labels, _ = tree.corner_labels(cells_here, level)
        assert (labels == labels[:, :1]).all() and (labels[:, 0] == truth[here]).all()


def test_crossings_lie_on_the_surface() -> None:
    """Root finding on margins: far nearer than a quarter of a cell, which bisection would give."""
    tree, oracle = grown(ball, 3, 5)
    before = oracle.count
    keys, fractions = solve(tree, 5, oracle)
    places = tree.vertices.places(keys // 3).astype(np.float64)
    places[np.arange(len(keys)), keys % 3] += fractions
    assert np.abs(ball(places / 32.0)).max() < 0.01 / 32.0
    assert oracle.count - before < 2.5 * len(keys)


def test_a_strip_between_the_first_vertices_is_followed_from_one_probe() -> None:
    """A strip that no vertex of the first grid meets is found at one place, and followed along its length."""

    def strip(x: Reals) -> Reals:
        return np.asarray(0.015 - np.abs(x[:, 1] - 0.53 - 0.004 * np.sin(9.0 * x[:, 0])))

    tree, oracle = grown(strip, 2, 8)
    assert not tree.is_mixed(tree.leaves[8], 8).any()
    tree.probe(np.array([[0.3, 0.53]]) * 256.0, oracle)
    places = np.random.default_rng(1).uniform(0.0, 256.0, (20_000, 2))
    levels, index = tree.locate(places)
    truth = strip(places / 256.0) < 0.0
    for level in range(8):
        here = levels == level
        labels, _ = tree.corner_labels(tree.leaves[level][index[here]], level)
        assert (labels[:, 0] == truth[here]).all()


@pytest.mark.parametrize("centre", [0.3, 0.7])
def test_an_island_that_no_vertex_meets_is_seen_by_margins(centre: float) -> None:
    """In a cell of the first grid, off its corners: margins there say that they would change sign."""

    def island(x: Reals) -> Reals:
        return np.asarray(0.25 / 16.0 - np.linalg.norm(x - (5.0 + centre) / 16.0, axis=1))

    tree, _ = grown(island, 2, 8)
    found = tree.vertices.places(tree.vertices.keys)[tree.vertices.labels == 0]
    assert (np.ptp(found, axis=0) >= 6).all()  # of a diameter of 8


def test_a_probe_opens_an_island() -> None:
    def island(x: Reals) -> Reals:
        return np.where(np.linalg.norm(x - 0.531, axis=1) < 0.012, 1.0, -1.0)

    tree, oracle = grown(island, 2, 8)
    assert not tree.is_mixed(tree.leaves[8], 8).any()
    place = np.array([[0.531, 0.531]]) * 256.0
    tree.probe(place, oracle)
    solid = np.pi * (0.012 * 256.0) ** 2
    found = tree.vertices.places(tree.vertices.keys)[tree.vertices.labels == 0]
    assert 0.7 * solid < len(found) < 1.3 * solid


def test_budget_ends_the_refinement_with_whole_leaves() -> None:
    tree, oracle = Tree.empty(2, 9, 9), Oracle(ball, 9)

    def poor(places: Reals) -> tuple[Ints, Reals]:
        if oracle.count + len(places) > 800:
            raise BudgetSpent
        return oracle(places)

    tree.grow(poor)
    assert tree.spent and oracle.count <= 800
    assert sum(len(cells) * tree.size(level) ** 2 for level, cells in enumerate(tree.leaves)) == 512**2
