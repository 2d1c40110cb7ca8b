"""Which pairs of shapes are near, and the contact points between them, with memory of their features.

Each pair owns two slots. A slot's deformation and mode belong to its feature: they follow it from step to
step and are dropped when the feature changes.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, kernel, rare_kernel
from rungwise.scene.template.records import HALFPLANE, Records
from rungwise.system.planar.chains import (
    Chains,
)
from rungwise.system.planar.contact_manifold import (
    ABSENT,
    GAP,
    LANDED,
    LIFTED,
    VERTICES,
    Found,
    Manifolds,
    manifold,
)
from rungwise.system.planar.corners import Course, crosses, set_course, touching_face
from rungwise.system.planar.edges import (
    are_parallel,
    next_vertex,
    vertex_before,
)
from rungwise.system.planar.near import forget_gaps, forget_slot, is_listed, list_near, near_pairs, pair_at
from rungwise.system.planar.place import Placement, X, Y
from rungwise.system.planar.seams import Seams, carry_over, continue_each_other, keep_slots


@kernel
def find_contacts(
    records: Records,
    placed: Placement,
    v: Reals,
    margin: float,
    manifolds: Manifolds,
    seams: Seams,
    course: Course,
) -> float:
    """Update every pair's slots, for bodies that move on with `v` (n,); returns the least gap found.

    Gaps are exact below `margin` and for watched contacts, otherwise a lower bound. A pair of which one body
    is raised above the other has no points, and its gap is none of the least.
    """
    pairs, outline, gaps, fresh = records.pairs, placed.outline, manifolds.gaps, manifolds.fresh
    least = math.inf
    course.known[0] = 0
    if is_listed(manifolds):
        list_near(records, placed, margin, manifolds)
    forget_gaps(pairs, manifolds)
    for c in range(manifolds.lifted.shape[0]):
        lies = LANDED if manifolds.lifted[c] == LIFTED else 0
        manifolds.lifted[c] = LIFTED if records.contacts[c].raised > 0.0 else lies
    if seams.outlines.joined[0] != 0:
        keep_slots(manifolds, seams)
    for i in range(near_pairs(manifolds, pairs.shape[0])):
        p = pair_at(manifolds, i)
        contact = pairs[p].contact
        a, b = records.shapes[pairs[p].shape_a], records.shapes[pairs[p].shape_b]
        slot = 2 * p
        raised = records.contacts[contact].raised
        if raised > 0.0:
            forget_slot(slot, manifolds)
            forget_slot(slot + 1, manifolds)
            beside = max(_distance(slot, a, b, outline, manifolds, seams.alone), 0.0)
            gaps[contact] = min(gaps[contact], math.hypot(beside, raised))
            continue
        gap = 0.0 if records.contacts[contact].watched else _distance_of_circles(a, b, placed)
        if gap > margin:
            forget_slot(slot, manifolds)
            forget_slot(slot + 1, manifolds)
        else:
            points = manifolds.points[slot : slot + 2]
            found = Found(points, fresh)
            count = manifold(a, b, outline, seams.alone, found)
            gap = points[0, GAP]
            if count == 2:
                gap = min(gap, points[1, GAP])
            seamed = seams.seamed[pairs[p].shape_a] != 0 or seams.seamed[pairs[p].shape_b] != 0
            if seamed and not continue_each_other(a, b, seams.outlines):
                count = manifold(a, b, outline, seams.outlines, found)
                for k in range(count):
                    gap = min(gap, points[k, GAP])
            if course.horizon[0] > 0.0 and gap <= margin:
                set_course(records.bodies, placed.pose, v, course)
                if crosses(a, b, placed, seams, found, count, course):
                    touching_face(p, seamed, count, records, placed, manifolds, seams, course)
            _follow(slot, a, b, outline, manifolds)
        gaps[contact] = min(gaps[contact], gap)
        least = min(least, gap)
    if seams.outlines.joined[0] != 0:
        carry_over(manifolds, outline, seams)
    return least


@rare_kernel
def _distance(slot: int, a: Record, b: Record, outline: Reals, manifolds: Manifolds, chains: Chains) -> float:
    """The gap in the plane of two shapes, one of which is raised."""
    points = manifolds.points[slot : slot + 2]
    count = manifold(a, b, outline, chains, Found(points, manifolds.fresh))
    gap = points[0, GAP]
    return float(min(gap, points[1, GAP]) if count == 2 else gap)


@rare_kernel
def _distance_of_circles(a: Record, b: Record, placed: Placement) -> float:
    """Lower bound of the gap from the circles about the bodies' centres."""
    if a.kind == HALFPLANE:
        return _height(a, b, placed)
    if b.kind == HALFPLANE:
        return _height(b, a, placed)
    pose = placed.pose
    dx, dy = pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y]
    return math.sqrt(dx * dx + dy * dy) - a.reach - b.reach


@kernel
def _height(plane: Record, shape: Record, placed: Placement) -> float:
    i, pose, outline = plane.first, placed.pose, placed.outline
    dx, dy = pose[shape.body, X] - outline[i, 0], pose[shape.body, Y] - outline[i, 1]
    return outline[i, 2] * dx + outline[i, 3] * dy - shape.reach - plane.radius


@kernel
def _follow(slot: int, a: Record, b: Record, outline: Reals, manifolds: Manifolds) -> None:
    """Give slots `slot` and `slot + 1` the fresh features, keeping what belongs to those that stay."""
    fresh, features = manifolds.fresh, manifolds.features
    if fresh[0] == features[slot] and fresh[1] == features[slot + 1]:
        return
    if _stays(slot + 1, fresh[0], a, b, outline, manifolds) or _stays(
        slot, fresh[1], a, b, outline, manifolds
    ):
        features[slot], features[slot + 1] = features[slot + 1], features[slot]
        modes, deformation, force = manifolds.modes, manifolds.deformation, manifolds.force
        modes[slot], modes[slot + 1] = modes[slot + 1], modes[slot]
        for d in range(deformation.shape[1]):
            x, y = deformation[slot, d], force[slot, d]
            deformation[slot, d], force[slot, d] = deformation[slot + 1, d], force[slot + 1, d]
            deformation[slot + 1, d], force[slot + 1, d] = x, y
    for k in range(2):
        if not _stays(slot + k, fresh[k], a, b, outline, manifolds):
            forget_slot(slot + k, manifolds)
        features[slot + k] = fresh[k]


@kernel
def _stays(slot: int, new: int, a: Record, b: Record, outline: Reals, manifolds: Manifolds) -> bool:
    """Whether the slot's feature and a new one are one contact: equal, the same end of the stretch where two
    faces meet, or a rounded vertex that goes round the corner at the end of an edge while it is deformed.

    Where the faces end together, rounding decides whose vertex is over the other's edge, and between rounded
    shapes the two vertices there are closest for a while.
    """
    old = manifolds.features[slot]
    if old == ABSENT or new == ABSENT:
        return False
    if old == new:
        return True
    rolls = manifolds.deformation[slot, 0] != 0.0 and (a.radius > 0.0 or b.radius > 0.0)
    edge, vertex, facing, corner = old // VERTICES, old % VERTICES, new // VERTICES, new % VERTICES
    if edge >= VERTICES and facing >= VERTICES:
        return False
    if edge >= VERTICES:
        return _ends_in(facing, corner, vertex, edge - VERTICES, a, b, outline, rolls)
    if facing >= VERTICES:
        return _ends_in(edge, vertex, corner, facing - VERTICES, a, b, outline, rolls)
    if not are_parallel(edge, facing, outline):
        return False
    if a.first <= edge < a.end:
        return _end_together(a, edge, vertex, b, facing, corner)
    return _end_together(b, edge, vertex, a, facing, corner)


@kernel
def _end_together(shape: Record, edge: int, vertex: int, other: Record, facing: int, corner: int) -> bool:
    """Whether `vertex`, of the facing edge, and `corner`, of the edge, are on the same side of both edges."""
    if vertex == facing:
        return corner == next_vertex(shape, edge)
    return corner == edge and vertex == next_vertex(other, facing)


@kernel
def _ends_in(
    edge: int, vertex: int, i: int, j: int, a: Record, b: Record, outline: Reals, rolls: bool
) -> bool:
    """Whether vertices i and j are `vertex` and an end of the edge, and `vertex` rolls over that end or its
    shape has a face there that may come to lie on the edge."""
    if vertex not in (i, j):
        return False
    corner = i if vertex == j else j
    own, other = (a, b) if a.first <= edge < a.end else (b, a)
    if corner not in (edge, next_vertex(own, edge)):
        return False
    before = vertex_before(other, vertex)
    return rolls or are_parallel(edge, vertex, outline) or are_parallel(edge, before, outline)
