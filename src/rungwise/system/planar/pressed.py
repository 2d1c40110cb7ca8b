"""Where the load of a support lies that has the limit surface of its pressure: as edges, and as spots.

An area is bounded by straight edges, arcs taken as many short ones, and a ring is as many short ones: their
moments about a point are in closed form, also on the edge itself. Spots stand for the same load where a body
turns about a point far away, or slides, for then those moments cancel: Gauss-Legendre quadrature along rays
to the edges.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals, Record, RecordArray, kernel, rare_kernel
from rungwise.scene.template.records import HALFPLANE, POINTS, RING, Records
from rungwise.system.planar.place import COS, SIN
from rungwise.system.terms import Terms

CIRCLE = 64
"""Edges of a full circle: forces are exact to about the square of a step of the angle, over 24."""
_NODES = (0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263)
_PARTS = (0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269)
"""Gauss-Legendre quadrature of 4 points on 0..1."""
SPOTS = 16
"""Spots of an edge, at most."""


def sizes(records: Records) -> tuple[int, int, int]:
    """Surfaces, edges and spots that there may be."""
    surfaces, edges, points = 0, 0, 0
    for support in records.supports:
        if support["exact"]:
            surfaces += 1
            body = records.bodies[int(support["body"])]
            shapes = records.shapes[int(body["first_shape"]) : int(body["end_shape"])]
            edges += CIRCLE + sum(2 * CIRCLE + 4 * int(s["end"] - s["first"]) for s in shapes)
            points += int(support["end"] - support["first"])
    return surfaces, edges, points + SPOTS * edges


def allocate_surfaces(records: Records) -> dict[str, NDArray[np.float64]]:
    """Zeroed `exact`, `edges` and `spots` of `Terms`."""
    surfaces, edges, spots = sizes(records)
    return {
        "exact": np.full((surfaces, 10), -1.0), "edges": np.zeros((edges, 4)), "spots": np.zeros((spots, 3)),
    }  # fmt: skip


@rare_kernel
def place_surface(support: Record, pose: Reals, exact: Reals) -> None:
    """Say which rows the limit surface of a pressure has, and how its body is turned."""
    exact[0] = support.row if support.ratio > 0.0 else -1.0
    exact[1], exact[2] = pose[support.body, COS], pose[support.body, SIN]


@rare_kernel
def spread_loads(records: Records, terms: Terms) -> None:
    """Fill in edges and spots of all surfaces, from the centres of pressure, in the bodies' frames."""
    m, edge, spot = 0, 0, 0
    for k in range(records.supports.shape[0]):
        support = records.supports[k]
        if not support.exact:
            continue
        exact = terms.exact[m]
        exact[3], exact[4], exact[6], exact[8] = support.ratio, edge, spot, support.pressure == RING
        if support.pressure == POINTS:
            spot = _points(support, records.bodies[support.body], records.spots, terms.spots, spot)
        elif support.pressure == RING:
            edge, spot = _ring(support.ratio, terms, edge, spot)
        else:
            body = records.bodies[support.body]
            for s in range(body.first_shape, body.end_shape):
                if records.shapes[s].kind != HALFPLANE:
                    edge, spot = _outline(records.shapes[s], records.vertices, support, terms, edge, spot)
        exact[5], exact[7] = edge, spot
        _share(exact, terms)
        m += 1


@kernel
def _share(exact: Reals, terms: Terms) -> None:
    """Let the parts of the spots add up to 1, and set what makes 1 of the whole length, or area, of the
    edges, in the unit `ratio`."""
    total, whole = 0.0, 0.0
    for k in range(int(exact[6]), int(exact[7])):
        total += terms.spots[k, 2]
    for k in range(int(exact[6]), int(exact[7])):
        terms.spots[k, 2] /= total
    for k in range(int(exact[4]), int(exact[5])):
        a, b, c, d = terms.edges[k, 0], terms.edges[k, 1], terms.edges[k, 2], terms.edges[k, 3]
        whole += math.hypot(c - a, d - b) if exact[8] > 0.0 else 0.5 * (a * d - b * c)
    scale = exact[3] if exact[8] > 0.0 else exact[3] * exact[3]
    exact[9] = scale / whole if whole > 0.0 else 0.0


@kernel
def _points(support: Record, body: Record, given: RecordArray, spots: Reals, at: int) -> int:
    for k in range(support.first, support.end):
        spots[at, 0] = given[k].x - body.centre_x - support.centre_x
        spots[at, 1] = given[k].y - body.centre_y - support.centre_y
        spots[at, 2] = given[k].weight
        at += 1
    return at


@kernel
def _ring(radius: float, terms: Terms, edge: int, spot: int) -> tuple[int, int]:
    half = math.pi / CIRCLE
    slope = math.asinh(math.tan(half))
    # So that the mean distance of the edges is the radius.
    out = radius / (0.5 * (1.0 + math.cos(half) ** 2 / math.sin(half) * slope))
    for k in range(CIRCLE):
        angle = 2.0 * k * half
        terms.edges[edge, 0], terms.edges[edge, 1] = out * math.cos(angle), out * math.sin(angle)
        angle += 2.0 * half
        terms.edges[edge, 2], terms.edges[edge, 3] = out * math.cos(angle), out * math.sin(angle)
        angle -= half
        terms.spots[spot, 0], terms.spots[spot, 1] = radius * math.cos(angle), radius * math.sin(angle)
        terms.spots[spot, 2] = 1.0
        edge, spot = edge + 1, spot + 1
    return edge, spot


@kernel
def _outline(
    shape: Record, vertices: RecordArray, support: Record, terms: Terms, edge: int, spot: int
) -> tuple[int, int]:
    """Edges and spots of a convex shape; returns the numbers after them."""
    first, n, radius = shape.first, shape.end - shape.first, shape.radius
    x = y = 0.0
    for k in range(n):
        x += (vertices[first + k].x - support.centre_x) / n
        y += (vertices[first + k].y - support.centre_y) / n
    for k in range(n):
        a, b = vertices[first + k], vertices[first + (k + 1) % n]
        before = vertices[first + (k + n - 1) % n]
        at_x, at_y = a.x - support.centre_x, a.y - support.centre_y
        begin, turn = 0.0, 2.0 * math.pi
        if n > 1:
            begin = math.atan2(before.normal_y, before.normal_x)
            sine = before.normal_x * a.normal_y - before.normal_y * a.normal_x
            turn = math.atan2(abs(sine), before.normal_x * a.normal_x + before.normal_y * a.normal_y)
        pieces = math.ceil(CIRCLE * turn / (2.0 * math.pi)) if radius > 0.0 else 0
        for p in range(pieces):
            one, two = begin + turn * p / pieces, begin + turn * (p + 1) / pieces
            edge, spot = _edge(
                at_x + radius * math.cos(one), at_y + radius * math.sin(one),
                at_x + radius * math.cos(two), at_y + radius * math.sin(two), x, y, 1, terms, edge, spot,
            )  # fmt: skip
        if n > 1:
            out_x, out_y = radius * a.normal_x, radius * a.normal_y
            edge, spot = _edge(
                at_x + out_x, at_y + out_y, b.x - support.centre_x + out_x, b.y - support.centre_y + out_y,
                x, y, 4, terms, edge, spot,
            )  # fmt: skip
    return edge, spot


@kernel
def _edge(
    ax: float, ay: float, bx: float, by: float, x: float, y: float, rays: int, terms: Terms, edge: int,
    spot: int,
) -> tuple[int, int]:  # fmt: skip
    """An edge, and spots along rays from (x, y) to it."""
    terms.edges[edge, 0], terms.edges[edge, 1], terms.edges[edge, 2], terms.edges[edge, 3] = ax, ay, bx, by
    swept = max((ax - x) * (by - ay) - (ay - y) * (bx - ax), 0.0)
    for i in range(rays):
        s = _NODES[i] if rays > 1 else 0.5
        part = _PARTS[i] if rays > 1 else 1.0
        for j in range(4):
            t = _NODES[j]
            terms.spots[spot, 0] = x + t * (ax + s * (bx - ax) - x)
            terms.spots[spot, 1] = y + t * (ay + s * (by - ay) - y)
            terms.spots[spot, 2] = swept * part * _PARTS[j] * t
            spot += 1
    return edge + 1, spot
