"""Edges of placed outlines: an edge has the number of the vertex at which it starts."""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, inner_kernel, kernel

TIE = 1e-9
"""Distance that counts as zero, over the length of an edge or overlap. Chosen by trial, to a decade, far
above rounding."""
_OPPOSED = -0.995
"""Cosine between the normals of faces that count as parallel: within 0.1 rad, chosen by trial."""


@inner_kernel
def next_vertex(shape: Record, vertex: int) -> int:
    """The vertex after this one; edges begin at the vertex whose number they bear."""
    return vertex + 1 if vertex + 1 < shape.end else shape.first


@inner_kernel
def vertex_before(shape: Record, vertex: int) -> int:
    """The vertex before this one, at which the edge to it begins."""
    return vertex - 1 if vertex > shape.first else shape.end - 1


@inner_kernel
def along(edge: int, vertex: int, outline: Reals) -> float:
    """Place of the vertex along the edge, from its start."""
    dx, dy = outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1]
    return outline[edge, 2] * dy - outline[edge, 3] * dx


@inner_kernel
def height(edge: int, vertex: int, outline: Reals) -> float:
    """Distance of the vertex from the line of the edge, positive outside."""
    dx, dy = outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1]
    return outline[edge, 2] * dx + outline[edge, 3] * dy


@kernel
def span(edge: int, vertex: int, outline: Reals) -> float:
    """A length to measure ties by: the distance of the vertex from the edge's start."""
    return math.hypot(outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1])


@kernel
def are_parallel(edge: int, facing: int, outline: Reals) -> bool:
    """Whether the edges may come to lie flat on each other.

    Were the end of one edge held outside the other at any angle, a vertex that slides off the edge would be
    kicked.
    """
    return outline[edge, 2] * outline[facing, 2] + outline[edge, 3] * outline[facing, 3] < _OPPOSED


@kernel
def more_opposed(edge: int, before: int, after: int, outline: Reals) -> int:
    """The one of two edges whose normal is more opposed to that of `edge`; `after` if they are alike."""
    nx, ny = outline[edge, 2], outline[edge, 3]
    if nx * outline[before, 2] + ny * outline[before, 3] < nx * outline[after, 2] + ny * outline[after, 3]:
        return before
    return after
