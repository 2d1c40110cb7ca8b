"""Outlines that shapes form together, as chains of one-sided edges.

Shapes that lie flush are pieces of one outline. Each edge knows its neighbours around the outline: edges
between pieces separate nothing, and a direction that belongs to a neighbour makes no contact here. Source of
the idea: ghost vertices of chain shapes (Catto, Box2D documentation, section Chain Shape).
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, Record, inner_kernel, kernel
from rungwise.scene.template.records import HALFPLANE, Records
from rungwise.system.planar.edges import TIE, along, are_parallel, height, more_opposed

NONE = -1
PLAIN, DEAD, SHARP, REFLEX = range(4)
FLUSH = 1e-9
"""Distance, over the smaller reach of two shapes, up to which the shapes are flush: a start that overlaps by
no more is admitted, too."""


class Chains(Block):
    """Chains of edges around outlines, per edge (or the vertex where it starts).

    joined   (1,)            whether any shapes are pieces of one outline
    ends     (vertices,)     vertex where the edge ends
    before   (vertices,)     edge that the face of this one continues, or NONE
    after    (vertices,)     edge into which the face of this one continues, or NONE
    whole    (vertices, 2)   vertices at the start and at the end of the whole face that the edge is a part of
    corner   (vertices,)     PLAIN, DEAD (between flush faces, or inside), or shared with other pieces:
                              SHARP where they stand out together, REFLEX where not
    cone     (vertices, 2)   the edges of the outline, before and after, that meet in the corner
    owner    (vertices,)     the vertex that stands for all that meet in this SHARP corner, or itself
    exposed  (vertices, 2)   part of the edge that is not covered: places along it from its start, the
                              last infinite where its end is not covered
    """

    joined: Ints
    ends: Ints
    before: Ints
    after: Ints
    whole: Ints
    corner: Ints
    cone: Ints
    owner: Ints
    exposed: Reals


def allocate_chains(records: Records) -> Chains:
    """The chains of shapes each of which is an outline of its own."""
    shapes, count = records.shapes, len(records.vertices)
    ends = np.arange(1, count + 1)
    ends[shapes["end"] - 1] = shapes["first"]
    edges = np.arange(count)
    before = np.empty_like(edges)
    before[ends] = edges
    return Chains(
        joined=np.zeros(1, np.int64),
        ends=ends,
        before=np.full(count, NONE, np.int64),
        after=np.full(count, NONE, np.int64),
        whole=np.column_stack([edges, ends]),
        corner=np.full(count, PLAIN, np.int64),
        cone=np.column_stack([before, edges]),
        owner=edges.copy(),
        exposed=np.tile([0.0, math.inf], (count, 1)),
    )


@inner_kernel
def face_of(edge: int, chains: Chains) -> tuple[int, int]:
    """Vertices at the start and at the end of the whole face that the edge is a part of."""
    return chains.whole[edge, 0], chains.whole[edge, 1]


@inner_kernel
def facing_edge(edge: int, vertex: int, outline: Reals, chains: Chains) -> int:
    """The edge at the vertex, or at its corner of the common piece, that is most opposed to `edge`."""
    return more_opposed(edge, chains.cone[vertex, 0], chains.cone[vertex, 1], outline)


@kernel
def is_admitted(i: int, deepest: int, shape: Record, other: Record, outline: Reals, chains: Chains) -> bool:
    """Whether edge i and its normal at the deepest vertex of `other` belong to the outside of the outlines:
    the edge lies along a face there, or the vertex stands out in the direction of the edge."""
    plane = shape.kind == HALFPLANE
    if other.end - other.first > 1:
        facing = facing_edge(i, deepest, outline, chains)
        if are_parallel(i, facing, outline):
            faces = _is_exposed(facing, i, outline, chains)
            return faces and (plane or _is_exposed(i, facing, outline, chains))
        corner = chains.corner[deepest]
        if corner in (DEAD, REFLEX):
            return False
        if corner == SHARP and not _is_in_cone(deepest, -outline[i, 2], -outline[i, 3], outline, chains):
            return False
    place = along(i, deepest, outline)
    return plane or _reaches(i, place, place, chains)


@kernel
def _is_exposed(edge: int, facing: int, outline: Reals, chains: Chains) -> bool:
    """Whether the edge is exposed where the facing one lies along it."""
    ends = along(edge, facing, outline), along(edge, chains.ends[facing], outline)
    return _reaches(edge, min(ends[0], ends[1]), max(ends[0], ends[1]), chains)


@kernel
def _reaches(i: int, first: float, last: float, chains: Chains) -> bool:
    """Whether the stretch from `first` to `last` along edge i is not beside or beyond its covered parts."""
    low, high = chains.exposed[i, 0], chains.exposed[i, 1]
    return low < high and not ((low > 0.0 and last <= low) or first >= high)


@kernel
def least_of_face(edge: int, vertex: int, outline: Reals, chains: Chains) -> float:
    """Least height over the edge of the face that faces it at a corner; infinite if none lies along it."""
    facing = facing_edge(edge, vertex, outline, chains)
    if not are_parallel(edge, facing, outline):
        return math.inf
    first, last = face_of(facing, chains)
    return min(height(edge, first, outline), height(edge, last, outline))


@inner_kernel
def is_over(edge: int, vertex: int, outline: Reals, chains: Chains) -> bool:
    """Whether the vertex projects onto the whole face of the edge, with rounding at its ends."""
    start, end = face_of(edge, chains)
    low, high, place = along(edge, start, outline), along(edge, end, outline), along(edge, vertex, outline)
    slack = TIE * (high - low)
    return place >= low - slack and place <= high + slack


@kernel
def is_own(edge: int, vertex: int, outline: Reals, chains: Chains) -> bool:
    """Whether the vertex is over this part of the whole face. At a seam it is over just one of the two
    parts."""
    before, after = chains.before[edge], chains.after[edge]
    if before != NONE and along(before, vertex, outline) < along(before, edge, outline):
        return False
    return not (after != NONE and not along(edge, vertex, outline) < along(edge, after, outline))


@kernel
def is_corner(vertex: int, nx: float, ny: float, outline: Reals, chains: Chains) -> bool:
    """Whether the vertex, or its twin that owns it, may touch something in this direction."""
    kind = chains.corner[vertex]
    if kind in (DEAD, REFLEX) or chains.owner[vertex] != vertex:
        return False
    return kind == PLAIN or _is_in_cone(vertex, nx, ny, outline, chains)


@kernel
def _is_in_cone(vertex: int, nx: float, ny: float, outline: Reals, chains: Chains) -> bool:
    """Whether the direction lies between the normals of the two exposed edges that meet in the corner."""
    low, high = chains.cone[vertex, 0], chains.cone[vertex, 1]
    return (
        outline[low, 2] * ny - outline[low, 3] * nx >= -TIE
        and nx * outline[high, 3] - ny * outline[high, 2] >= -TIE
    )
