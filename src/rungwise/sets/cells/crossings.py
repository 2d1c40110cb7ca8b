"""Where the boundary crosses the edges of cells of one level, and its plane in each cell."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.sets.cells.labels import Label
from rungwise.sets.cells.tree import BudgetSpent, Oracle, Tree

WIDTH = 0.25
"""Brackets of crossings end up no wider than this part of a cell."""
MAX_ROUNDS = 40
"""Trials on an edge, at most."""


def edges_of(axes: int) -> tuple[Ints, Ints]:
    """The edges of a cell: place of the lower end (e, d) in cells, and axis (e,)."""
    corners = np.array(list(product((0, 1), repeat=axes)), np.int64)
    pairs = [(corner, axis) for axis in range(axes) for corner in corners if corner[axis] == 0]
    return np.array([corner for corner, _ in pairs]), np.array([axis for _, axis in pairs])


def crossing_edges(tree: Tree, level: int) -> Ints:
    """Sorted keys of the edges of a level's mixed leaves whose ends have different labels.

    An edge's key is the key of its lower end times the number of axes, plus its axis.
    """
    origins = tree.leaves[level]
    origins = origins[tree.is_mixed(origins, level)]
    lower, axis = edges_of(tree.axes)
    starts = tree.vertices.key(origins[:, None, :] + tree.size(level) * lower)
    keys = np.unique(starts * tree.axes + axis)
    low, high = ends_of(tree, level, keys)
    return np.asarray(keys[tree.vertices.labels[low] != tree.vertices.labels[high]])


def ends_of(tree: Tree, level: int, keys: Ints) -> tuple[Ints, Ints]:
    """Indices of the vertices at both ends of edges."""
    side = (1 << tree.finest) + 1
    starts = keys // tree.axes
    ends = starts + tree.size(level) * side ** (keys % tree.axes)
    return tree.vertices.find(starts)[0], tree.vertices.find(ends)[0]


def solve(tree: Tree, level: int, oracle: Oracle) -> tuple[Ints, Reals]:
    """Keys of a level's crossing edges, and where along each (0..1) the label of its lower end ends.

    Regula falsi on margins of opposite sign, bisection elsewhere: each trial lies a little beyond the
    estimate, so that two trials bracket a smooth crossing. Labels alone decide the bracket.
    """
    keys = crossing_edges(tree, level)
    vertices = tree.vertices
    low, high = ends_of(tree, level, keys)
    origin, axis = vertices.places(keys // tree.axes).astype(np.float64), keys % tree.axes
    a, b = np.zeros(len(keys)), np.ones(len(keys))
    label = vertices.labels[low]
    at_a, at_b = vertices.margins[low].copy(), vertices.margins[high].copy()
    for _ in range(MAX_ROUNDS):
        open_ = np.flatnonzero(b - a > WIDTH * (1.0 + 1e-12))
        if not len(open_):
            break
        trial = _trial(a[open_], b[open_], at_a[open_], at_b[open_])
        places = origin[open_]
        places[np.arange(len(open_)), axis[open_]] += tree.size(level) * trial
        try:
            found, margins = oracle(places)
        except BudgetSpent:
            tree.spent = True
            break
        same = found == label[open_]
        a[open_[same]], at_a[open_[same]] = trial[same], margins[same]
        b[open_[~same]], at_b[open_[~same]] = trial[~same], margins[~same]
    estimate = _root(a, b, at_a, at_b)
    return keys, np.clip(estimate, a, b)


def _root(a: Reals, b: Reals, at_a: Reals, at_b: Reals) -> Reals:
    """Where a straight line between margins of opposite sign passes zero; the middle where margins have no
    opposite sign."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = a + (b - a) * at_a / (at_a - at_b)
        straddles = np.isfinite(root) & ((at_a >= 0.0) != (at_b >= 0.0))
    return np.where(straddles, root, 0.5 * (a + b))


def _trial(a: Reals, b: Reals, at_a: Reals, at_b: Reals) -> Reals:
    """A place beyond the root, on the side where the bracket is wider, and well inside it."""
    root = _root(a, b, at_a, at_b)
    beyond = np.where(b - root > root - a, root + 0.45 * WIDTH, root - 0.45 * WIDTH)
    inside = 0.05 * (b - a)
    return np.clip(beyond, a + inside, b - inside)


def crossings_of_cells(
    tree: Tree, level: int, keys: Ints, fractions: Reals
) -> tuple[Reals, NDArray[np.bool_]]:
    """A place (m, e, d), in the cell's own coordinates 0..1, on each edge of a level's leaves, and whether
    the boundary crosses the edge there."""
    origins = tree.leaves[level]
    lower, axis = edges_of(tree.axes)
    wanted = tree.vertices.key(origins[:, None, :] + tree.size(level) * lower) * tree.axes + axis
    at = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    there = keys[at] == wanted if len(keys) else np.zeros(wanted.shape, bool)
    points = np.broadcast_to(lower.astype(np.float64), (len(origins), *lower.shape)).copy()
    points[:, np.arange(len(axis)), axis] = fractions[at] if len(keys) else 0.0
    return points, there


def planes(tree: Tree, level: int, keys: Ints, fractions: Reals) -> tuple[Reals, Reals, Ints]:
    """The plane through the crossings of each leaf of a level, by least squares.

    Returns normals (m, d) and offsets (m,) in the cell's own coordinates 0..1, and the labels (m, 2) on the
    negative and the positive side; -1 where the leaf has more than two labels, or no plane parts its corners
    as their labels do.
    """
    points, there = crossings_of_cells(tree, level, keys, fractions)
    weight = there[..., None].astype(np.float64)
    count = np.maximum(weight.sum(axis=1), 1.0)
    centre = (points * weight).sum(axis=1) / count
    away = (points - centre[:, None, :]) * weight
    _, vectors = np.linalg.eigh(np.einsum("mei,mej->mij", away, away))
    normal = vectors[:, :, 0]
    offset = np.einsum("mi,mi->m", normal, centre)
    corner_labels, _ = tree.corner_labels(tree.leaves[level], level)
    side = tree.corners.astype(np.float64) @ normal.T - offset
    return normal, offset, _sides(corner_labels, side.T)


def _sides(corner_labels: Ints, side: Reals) -> Ints:
    """Labels on both sides of planes, or -1 where corners contradict their side."""
    result = np.full((len(side), 2), -1, np.int64)
    for k, positive in enumerate((False, True)):
        mine = (side >= 0.0) == positive
        low = np.where(mine, corner_labels, len(Label)).min(axis=1)
        high = np.where(mine, corner_labels, -1).max(axis=1)
        result[:, k] = np.where(low == high, low, -1)
    result[(result < 0).any(axis=1)] = -1
    return result
