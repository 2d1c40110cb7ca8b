"""The boundary of a label's part of the box as a mesh.

Dual contouring of the tree (Ju, Losasso, Schaefer and Warren 2002): one vertex to each leaf, the mean of the
places where the boundary crosses the edges around it, and one piece of surface to each such edge, through the
leaves that meet there. So it has no slits where leaves of different size meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.sets.cells.crossings import edges_of
from rungwise.sets.cells.labelled import LabelledBox
from rungwise.sets.cells.labels import Label
from rungwise.sets.cells.tree import Tree
from rungwise.sets.store import SetError

_ROUND = {2: ((-1,), (1,)), 3: ((-1, -1), (1, -1), (1, 1), (-1, 1))}
"""The sides of an edge along the other axes, going round it."""


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, d), in the order and units of the set's parameters, and pieces (m, d) of their numbers.

    Over three parameters pieces are triangles, counter-clockwise seen from where the label is not; over two
    they are segments with the label on their left.
    """

    vertices: Reals
    pieces: Ints

    def coarsened(self, cells: int, box: Reals) -> Mesh:
        """The mesh with one vertex, the mean, for all vertices in each of cells^d parts of the box; collapsed
        pieces go."""
        low, high = box.T
        at = np.clip(((self.vertices - low) / (high - low) * cells).astype(np.int64), 0, cells - 1)
        _, where = np.unique(at @ cells ** np.arange(len(low)), return_inverse=True)
        count = np.bincount(where)
        vertices = np.stack([np.bincount(where, column) / count for column in self.vertices.T], axis=1)
        return Mesh(vertices, _proper(where[self.pieces]))


@dataclass(frozen=True)
class _Edges:
    """Edges (m,) of leaves whose ends differ in having the label: lower end, axis, level, place of the
    crossing in units, and whether the lower end has the label."""

    start: Ints
    axis: Ints
    level: Ints
    crossing: Reals
    from_label: Ints


def boundary(found: LabelledBox, label: Label = Label.FEASIBLE) -> Mesh:
    """The boundary of the part that has a label, without the sides of the box.

    Raises SetError unless the set is over two or three parameters.
    """
    axes, tree = len(found.over), found.tree
    check_axes(axes)
    edges = _edges(found, label)
    leaves, least = _leaves_around(tree, edges)
    leaves, crossing = leaves[least], edges.crossing[least]
    _, pieces = np.unique(leaves, return_inverse=True)
    pieces = pieces.reshape(leaves.shape)
    count = np.bincount(pieces.ravel())
    sums = [np.bincount(pieces.ravel(), np.repeat(column, len(_ROUND[axes]))) for column in crossing.T]
    vertices = np.stack(sums, axis=1).reshape(-1, axes) / np.maximum(count, 1)[:, None]
    swapped = (edges.from_label[least] == 0) ^ ((axes == 2) & (edges.axis[least] == 1))
    pieces[swapped] = pieces[swapped, ::-1]
    if axes == 3:
        pieces = _triangles(vertices, pieces)
    return Mesh(found.box[:, 0] + vertices * found.unit, _proper(pieces))


def check_axes(axes: int) -> None:
    """Raise SetError unless a set over so many parameters has a mesh."""
    if axes not in _ROUND:
        raise SetError(f"mesh: needs a set over 2 or 3 parameters, not {axes}")


def _edges(found: LabelledBox, label: Label) -> _Edges:
    tree, axes = found.tree, len(found.over)
    lower, axis = edges_of(axes)
    parts = []
    for level, origins in enumerate(tree.leaves):
        size = tree.size(level)
        starts = tree.vertices.key(origins[:, None, :] + size * lower)
        keys = np.unique(starts * axes + axis)
        along = keys % axes
        start = tree.vertices.places(keys // axes)
        ends = [tree.vertices.find(tree.vertices.key(start + k * size * np.eye(axes, dtype=np.int64)[along]))
                for k in (0, 1)]  # fmt: skip
        has = [tree.vertices.labels[at] == label for at, _ in ends]
        fraction = np.full(len(keys), 0.5)
        known, where = found.crossings.get(level, (keys[:0], fraction[:0]))
        _, mine, theirs = np.intersect1d(keys, known, assume_unique=True, return_indices=True)
        fraction[mine] = where[theirs]
        differ = has[0] != has[1]
        crossing = start + (fraction * size)[:, None] * np.eye(axes)[along]
        parts.append((start, along, np.full(len(keys), level), crossing, has[0].astype(np.int64), differ))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return _Edges(*(column[columns[-1]] for column in columns[:-1]))


def _leaves_around(tree: Tree, edges: _Edges) -> tuple[Ints, NDArray[np.bool_]]:
    """Numbers (m, 2^(d-1)) of the leaves around each edge, going round, and which edges no leaf splits.

    Beyond a side of the box lies a leaf of no depth: its number tells the leaf within and the side.
    """
    axes, end = tree.axes, 1 << tree.finest
    first = np.cumsum([0, *(len(leaves) for leaves in tree.leaves)])
    numbers, least = [], np.ones(len(edges.axis), bool)
    for sides in _ROUND[axes]:
        place = edges.start.astype(np.float64)
        rows = np.arange(len(place))
        place[rows, edges.axis] += 0.5 * 2.0 ** (tree.finest - edges.level)
        for k, side in enumerate(sides):
            place[rows, (edges.axis + 1 + k) % axes] += 0.5 * side
        beyond = (place < 0.0) | (place > end)
        levels, index = tree.locate(np.clip(place, 0.5, end - 0.5))
        least &= levels <= edges.level
        numbers.append(((first[levels] + index) << axes) + beyond @ (1 << np.arange(axes)))
    return np.stack(numbers, axis=1), least


def _triangles(vertices: Reals, quads: Ints) -> Ints:
    """Two triangles for each quadrilateral, along the diagonal over which it is folded less."""
    halves = np.stack([quads[:, [[0, 1, 2], [0, 2, 3]]], quads[:, [[1, 2, 3], [1, 3, 0]]]])
    corners = vertices[halves]
    normals = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals /= np.where(length > 0.0, length, 1.0)
    better = np.argmax(np.einsum("dqi,dqi->dq", normals[..., 0, :], normals[..., 1, :]), axis=0)
    return np.asarray(halves[better, np.arange(len(quads))].reshape(-1, 3))


def _proper(pieces: Ints) -> Ints:
    """Pieces without the pieces that have a vertex twice."""
    ordered = np.sort(pieces, axis=1)
    return np.asarray(pieces[(np.diff(ordered, axis=1) > 0).all(axis=1)])
