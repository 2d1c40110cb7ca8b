"""Which pairs of shapes are near, and the contact points between them, with memory of their features.

Each pair owns two slots. A slot's deformation and mode belong to its feature: they follow it from step to
step and are dropped when the feature changes.
"""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, Record, RecordArray, kernel, rare_kernel
from rungwise.scene.records import HALFPLANE
from rungwise.system.planar.corners import Course, crosses, set_course, sunk, touching_face
from rungwise.system.planar.joined import joined_manifold
from rungwise.system.planar.manifold import ABSENT, GAP, VERTICES, are_parallel, manifold, next_vertex
from rungwise.system.planar.place import X, Y
from rungwise.system.planar.seams import Seams, carry_over, continue_each_other, keep_slots


@kernel
def find_contacts(
    bodies: RecordArray,
    shapes: RecordArray,
    contacts: RecordArray,
    pairs: RecordArray,
    pose: Reals,
    outline: Reals,
    v: Reals,
    margin: float,
    points: Reals,
    features: Ints,
    deformation: Reals,
    modes: Ints,
    gaps: Reals,
    fresh: Ints,
    seams: Seams,
    course: Course,
) -> float:
    """Update every pair's slots; returns the least gap found.

    `points` (2 pairs, 5), `features`, `modes` (2 pairs,) and `deformation` (2 pairs, d) are per slot, `gaps`
    per contact: exact below `margin` and for watched contacts, otherwise a lower bound. `fresh` (2,) is
    scratch.
    """
    least = math.inf
    course.known[0] = 0
    for c in range(gaps.shape[0]):
        gaps[c] = math.inf
    if seams.joined[0] != 0:
        keep_slots(features, deformation, modes, seams)
    for p in range(pairs.shape[0]):
        contact = pairs[p].contact
        a, b = shapes[pairs[p].shape_a], shapes[pairs[p].shape_b]
        slot = 2 * p
        gap = 0.0 if contacts[contact].watched else _distance_of_circles(a, b, pose, outline)
        if gap > margin:
            _forget(slot, features, deformation, modes)
            _forget(slot + 1, features, deformation, modes)
        else:
            count = manifold(a, b, outline, points[slot : slot + 2], fresh)
            gap = points[slot, GAP]
            if count == 2:
                gap = min(gap, points[slot + 1, GAP])
            seamed = seams.seamed[pairs[p].shape_a] != 0 or seams.seamed[pairs[p].shape_b] != 0
            if seamed and not continue_each_other(a, b, seams):
                count = joined_manifold(a, b, outline, seams, points[slot : slot + 2], fresh)
                for k in range(count):
                    gap = min(gap, points[slot + k, GAP])
            if course.horizon[0] > 0.0 and gap <= margin:
                set_course(bodies, pose, v, course)
                if crosses(a, b, pose, outline, seams, points[slot : slot + 2], fresh, count, course):
                    compressed = sunk(a.body, b.body, contacts, pairs, features, deformation)
                    touching_face(
                        a, b, shapes, pose, outline, seams, seamed, count, compressed, course,
                        points[slot : slot + 2], fresh,
                    )  # fmt: skip
            _follow(slot, fresh, a, b, outline, features, deformation, modes)
        gaps[contact] = min(gaps[contact], gap)
        least = min(least, gap)
    if seams.joined[0] != 0:
        carry_over(features, deformation, modes, outline, seams)
    return least


@rare_kernel
def _distance_of_circles(a: Record, b: Record, pose: Reals, outline: Reals) -> float:
    """Lower bound of the gap from the circles about the bodies' centres."""
    if a.kind == HALFPLANE:
        return _height(a, b, pose, outline)
    if b.kind == HALFPLANE:
        return _height(b, a, pose, outline)
    dx, dy = pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y]
    return math.sqrt(dx * dx + dy * dy) - a.reach - b.reach


@kernel
def _height(plane: Record, shape: Record, pose: Reals, outline: Reals) -> float:
    i = plane.first
    dx, dy = pose[shape.body, X] - outline[i, 0], pose[shape.body, Y] - outline[i, 1]
    return outline[i, 2] * dx + outline[i, 3] * dy - shape.reach - plane.radius


@kernel
def _forget(slot: int, features: Ints, deformation: Reals, modes: Ints) -> None:
    if features[slot] != ABSENT:
        features[slot] = ABSENT
        deformation[slot, :] = 0.0
        modes[slot] = 0


@kernel
def _follow(
    slot: int,
    fresh: Ints,
    a: Record,
    b: Record,
    outline: Reals,
    features: Ints,
    deformation: Reals,
    modes: Ints,
) -> None:
    """Give slots `slot` and `slot + 1` the fresh features, keeping the deformation and mode of features that
    stay."""
    if fresh[0] == features[slot] and fresh[1] == features[slot + 1]:
        return
    if _stays(features[slot + 1], fresh[0], a, b, outline) or _stays(features[slot], fresh[1], a, b, outline):
        features[slot], features[slot + 1] = features[slot + 1], features[slot]
        modes[slot], modes[slot + 1] = modes[slot + 1], modes[slot]
        for d in range(deformation.shape[1]):
            x = deformation[slot, d]
            deformation[slot, d] = deformation[slot + 1, d]
            deformation[slot + 1, d] = x
    for k in range(2):
        if not _stays(features[slot + k], fresh[k], a, b, outline):
            _forget(slot + k, features, deformation, modes)
        features[slot + k] = fresh[k]


@kernel
def _stays(old: int, new: int, a: Record, b: Record, outline: Reals) -> bool:
    """Whether two features are one contact: equal, or the same end of the stretch where two faces meet.

    Where the faces end together, rounding decides whose vertex is over the other's edge.
    """
    if old == ABSENT or new == ABSENT:
        return False
    if old == new:
        return True
    edge, vertex, facing, corner = old // VERTICES, old % VERTICES, new // VERTICES, new % VERTICES
    if edge >= VERTICES or facing >= VERTICES or not are_parallel(edge, facing, outline):
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
