"""Where the load of a support lies that has the limit surface of its pressure: as edges, and as spots.

An area is bounded by straight edges, arcs taken as many short ones, and a ring is as many short ones. Spots
stand for the same load where a body turns about a point far away, or slides: Gauss-Legendre quadrature along
the edges of a ring, and along rays to the edges of an area. A load on a few points has rows of its own (see
`supports`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.kinds.pressure import (
    EDGE,
    EDGES,
    HEAD,
    LINE,
    REACH,
    SHARE,
    SPOT,
    SPOTS,
)
from rungwise.contact.step import EXACT_BEGIN, EXACT_COS, EXACT_ROW, EXACT_SIN
from rungwise.kernel import Reals, Record, RecordArray, kernel, rare_kernel
from rungwise.scene.template.records import HALFPLANE, POINTS, RING, Records
from rungwise.system.planar.place import COS, SIN
from rungwise.system.terms import Terms

CIRCLE = 64
"""Edges of a full circle: forces are exact to about the square of a step of the angle, over 24."""
_NODES = (0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263)
_PARTS = (0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269)
"""Gauss-Legendre quadrature of 4 points on 0..1."""
_PAIR = (0.5 - math.sqrt(1.0 / 12.0), 0.5 + math.sqrt(1.0 / 12.0))
"""Nodes of 2 points, of equal parts."""
SHORT = 0.2
"""Length of an edge over the reach of all, up to which rays to two points of it are enough."""
MOST = 16
"""Spots of an edge, at most."""


def has_edges(support: Record) -> bool:
    """Whether the load of a support has the limit surface of its pressure, and lies along edges."""
    return bool(support["exact"] and support["pressure"] != POINTS)


def allocate_surfaces(records: Records) -> dict[str, NDArray[np.float64]]:
    """`exact` and `pressures` of `Terms`, to be filled."""
    own, numbers = [support for support in records.supports if has_edges(support)], 0
    for support in own:
        body = records.bodies[int(support["body"])]
        shapes = records.shapes[int(body["first_shape"]) : int(body["end_shape"])]
        edges = CIRCLE + sum(2 * CIRCLE + 4 * int(s["end"] - s["first"]) for s in shapes)
        numbers += HEAD + (EDGE + SPOT * MOST) * edges
    return {"exact": np.full((len(own), 4), -1.0), "pressures": np.zeros(numbers)}


@rare_kernel
def place_surface(support: Record, pose: Reals, exact: Reals) -> None:
    """Say which rows the limit surface of a pressure has, and how its body is turned."""
    exact[EXACT_ROW] = support.row if support.ratio > 0.0 else -1.0
    exact[EXACT_COS], exact[EXACT_SIN] = pose[support.body, COS], pose[support.body, SIN]


@rare_kernel
def spread_loads(records: Records, terms: Terms) -> None:
    """Fill in the numbers of all pressures."""
    surface, begin = 0, 0
    for k in range(records.supports.shape[0]):
        support = records.supports[k]
        if support.exact and support.pressure != POINTS:
            table = terms.pressures[begin:]
            _draw(support, records, table)
            _measure(support.ratio, table)
            _spread(table)
            terms.exact[surface, EXACT_BEGIN] = begin
            begin += HEAD + EDGE * int(table[EDGES]) + SPOT * int(table[SPOTS])
            surface += 1


@kernel
def _draw(support: Record, records: Records, table: Reals) -> None:
    """Fill in the edges."""
    table[LINE] = 1.0 if support.pressure == RING else 0.0
    table[EDGES] = table[SPOTS] = 0.0
    if support.pressure == RING:
        half = math.pi / CIRCLE
        slope = math.asinh(math.tan(half))
        # So that the mean distance of the edges is the radius.
        out = support.ratio / (0.5 * (1.0 + math.cos(half) ** 2 / math.sin(half) * slope))
        _add_arc(0.0, 0.0, out, 0.0, 2.0 * math.pi, table)
        return
    body = records.bodies[support.body]
    for s in range(body.first_shape, body.end_shape):
        if records.shapes[s].kind != HALFPLANE:
            _add_outline(records.shapes[s], records.vertices, support, table)


@kernel
def _add_outline(shape: Record, vertices: RecordArray, support: Record, table: Reals) -> None:
    """Add the edges of a convex shape."""
    first, n, radius = shape.first, shape.end - shape.first, shape.radius
    for k in range(n):
        a, b = vertices[first + k], vertices[first + (k + 1) % n]
        before = vertices[first + (k + n - 1) % n]
        at_x, at_y = a.x - support.centre_x, a.y - support.centre_y
        begin, turn = 0.0, 2.0 * math.pi
        if n > 1:
            begin = math.atan2(before.normal_y, before.normal_x)
            sine = before.normal_x * a.normal_y - before.normal_y * a.normal_x
            turn = math.atan2(abs(sine), before.normal_x * a.normal_x + before.normal_y * a.normal_y)
        _add_arc(at_x, at_y, radius, begin, turn, table)
        if n > 1:
            out_x, out_y = radius * a.normal_x, radius * a.normal_y
            to_x, to_y = b.x - support.centre_x, b.y - support.centre_y
            _add_edge(at_x + out_x, at_y + out_y, to_x + out_x, to_y + out_y, table)


@kernel
def _add_arc(x: float, y: float, radius: float, begin: float, turn: float, table: Reals) -> None:
    pieces = math.ceil(CIRCLE * turn / (2.0 * math.pi)) if radius > 0.0 else 0
    for p in range(pieces):
        one, two = begin + turn * p / pieces, begin + turn * (p + 1) / pieces
        _add_edge(
            x + radius * math.cos(one), y + radius * math.sin(one),
            x + radius * math.cos(two), y + radius * math.sin(two), table,
        )  # fmt: skip


@kernel
def _add_edge(ax: float, ay: float, bx: float, by: float, table: Reals) -> None:
    at, length = HEAD + EDGE * int(table[EDGES]), math.hypot(bx - ax, by - ay)
    if length > 0.0:
        table[at], table[at + 1] = ax, ay
        table[at + 2], table[at + 3], table[at + 4] = (bx - ax) / length, (by - ay) / length, length
        table[EDGES] += 1.0


@kernel
def _measure(ratio: float, table: Reals) -> None:
    """Count edges in the unit `ratio`, and fill in how far they reach, and their share."""
    whole, reach = 0.0, 0.0
    for at in range(HEAD, HEAD + EDGE * int(table[EDGES]), EDGE):
        for i in (0, 1, 4):
            table[at + i] /= ratio
        x, y, across, along, length = table[at], table[at + 1], table[at + 2], table[at + 3], table[at + 4]
        reach = max(reach, math.hypot(x, y))
        whole += length if table[LINE] > 0.0 else 0.5 * length * (x * along - y * across)
    table[REACH], table[SHARE] = reach, 1.0 / whole


@kernel
def _spread(table: Reals) -> None:
    """Fill in the spots of all edges: along these, or along rays to them from the centre."""
    end = HEAD + EDGE * int(table[EDGES])
    for at in range(HEAD, end, EDGE):
        x, y, length = table[at], table[at + 1], table[at + 4]
        along, across = table[at + 2] * length, table[at + 3] * length
        if table[LINE] > 0.0:
            for s in _PAIR:
                _add_spot(x + s * along, y + s * across, 0.5 * table[SHARE] * length, end, table)
            continue
        swept = table[SHARE] * (x * across - y * along)
        short = length <= SHORT * table[REACH]
        for i in range(2 if short else 4):
            s, part = (_PAIR[i], 0.5 * swept) if short else (_NODES[i], _PARTS[i] * swept)
            for j in range(4):
                t = _NODES[j]
                _add_spot(t * (x + s * along), t * (y + s * across), part * _PARTS[j] * t, end, table)


@kernel
def _add_spot(x: float, y: float, part: float, begin: int, table: Reals) -> None:
    at = begin + SPOT * int(table[SPOTS])
    table[at], table[at + 1], table[at + 2] = x, y, part
    table[SPOTS] += 1.0
