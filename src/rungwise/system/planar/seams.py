"""Seams: faces of neighbouring shapes that lie flush, and parts of their outlines inside the neighbours.

Two shapes that do not move relative to each other, by a given motion, and that touch the same bodies, are one
piece to these bodies. A face that continues flush into the neighbour's face is *linked* to it; the corners
between the two are *dead*: no vertex of the common piece. Parts of edges inside neighbours are *covered*, the
rest is exposed. Source: ghost vertices of collision detection along chains of edges (Catto, Box2D), for any
neighbours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, Record, RecordArray, kernel, rare_kernel
from rungwise.scene.template.records import FIXED, HALFPLANE, SPEED, Records
from rungwise.system.planar.contact_manifold import ABSENT, VERTICES, Manifolds, are_parallel, height
from rungwise.system.planar.place import Placement, X, Y

NONE = -1
PLAIN, DEAD, SHARP, REFLEX = range(4)
FLUSH = 1e-9
"""Distance, over the smaller reach of two shapes, up to which the shapes are flush: a start that overlaps by
no more is admitted, too."""


class Seams(Block):
    """Seams of a scene, per edge (or the vertex where it starts), shape, and pair of shapes.

    ends        (vertices,)     vertex where the edge ends
    before      (vertices,)     edge that the face of this one continues, or NONE
    after       (vertices,)     edge into which the face of this one continues, or NONE
    corner      (vertices,)     PLAIN, DEAD (between flush faces, or inside), or shared with neighbours:
                                 SHARP where they stand out together, REFLEX where not
    cone        (vertices, 2)   the exposed edges, before and after, that meet in a SHARP corner
    owner       (vertices,)     the vertex that stands for all that meet in this SHARP corner, or itself
    exposed     (vertices, 2)   part of the edge that is not covered: places along it from its start, the
                                 last infinite where its end is not covered
    neighbours  (k, 2)          shapes that may lie flush
    still       (1,)            how many of these, the first, never move relative to each other
    seamed      (shapes,)       whether any of this holds for the shape
    joined      (1,)            whether it holds for any shape
    features, deformation, modes, force   per slot, before contacts are looked for again
    """

    ends: Ints
    before: Ints
    after: Ints
    corner: Ints
    cone: Ints
    owner: Ints
    exposed: Reals
    neighbours: Ints
    still: Ints
    seamed: Ints
    joined: Ints
    features: Ints
    deformation: Reals
    modes: Ints
    force: Reals


def allocate_seams(records: Records) -> Seams:
    """The seams of a scene, yet to be found."""
    neighbours, still = _neighbours(records)
    shapes, count, slots = records.shapes, len(records.vertices), 2 * len(records.pairs)
    ends = np.arange(1, count + 1)
    ends[shapes["end"] - 1] = shapes["first"]
    return Seams(
        ends=ends,
        before=np.full(count, NONE, np.int64),
        after=np.full(count, NONE, np.int64),
        corner=np.zeros(count, np.int64),
        cone=np.zeros((count, 2), np.int64),
        owner=np.arange(count),
        exposed=np.zeros((count, 2)),
        neighbours=neighbours,
        still=np.array([still]),
        seamed=np.zeros(len(shapes), np.int64),
        joined=np.zeros(1, np.int64),
        features=np.full(slots, ABSENT, np.int64),
        deformation=np.zeros((slots, 2)),
        modes=np.zeros(slots, np.int64),
        force=np.zeros((slots, 2)),
    )


def _neighbours(records: Records) -> tuple[NDArray[np.int64], int]:
    """Pairs of shapes that touch the same bodies, and how many of them, which come first, never move relative
    to each other. Bodies whose motion is not given carry themselves: they form no common piece."""
    partners: dict[int, set[int]] = {}
    for a, b in zip(records.contacts["body_a"].tolist(), records.contacts["body_b"].tolist(), strict=True):
        partners.setdefault(a, set()).add(b)
        partners.setdefault(b, set()).add(a)
    groups: dict[tuple[int, ...], list[int]] = {}
    for s, (body, kind, first, end) in enumerate(records.shapes[["body", "kind", "first", "end"]].tolist()):
        if kind != HALFPLANE and end - first > 1 and body in partners:
            groups.setdefault(tuple(sorted({body} | partners[body])), []).append(s)
            groups.setdefault(tuple(sorted(partners[body])), []).append(s)
    body, motion = records.shapes["body"], records.bodies["motion"]
    free = set(records.coordinates["body"][records.coordinates["drive"] != SPEED].tolist())
    pairs = {
        (s, t)
        for group in groups.values() for s in group for t in group
        if s < t and (body[s] == body[t] or not {body[s], body[t]} & free)
    }  # fmt: skip
    still = {(s, t) for s, t in pairs if body[s] == body[t] or motion[body[s]] == motion[body[t]] == FIXED}
    return np.array([*sorted(still), *sorted(pairs - still)], np.int64).reshape(-1, 2), len(still)


@kernel
def find_seams(records: Records, placed: Placement, seams: Seams) -> None:
    """Find the seams between neighbours at the placed outlines."""
    shapes, pose, outline = records.shapes, placed.pose, placed.outline
    seams.seamed[:] = 0
    seams.joined[0] = 0
    if seams.neighbours.shape[0] == 0:
        return
    seams.corner[:] = PLAIN
    seams.before[:] = NONE
    seams.after[:] = NONE
    for s in range(shapes.shape[0]):
        for i in range(shapes[s].first, shapes[s].end):
            seams.owner[i] = seams.cone[seams.ends[i], 0] = seams.cone[i, 1] = i
            seams.exposed[i, 0], seams.exposed[i, 1] = 0.0, math.inf
    for k in range(seams.neighbours.shape[0]):
        s, t = seams.neighbours[k, 0], seams.neighbours[k, 1]
        a, b = shapes[s], shapes[t]
        near = FLUSH * min(a.reach, b.reach)
        far = math.hypot(pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y])
        if a.radius == b.radius and far <= a.reach + b.reach + near:
            found = _link_all(a, b, near, outline, seams)
            if k < seams.still[0]:
                for i in range(a.first, a.end):
                    found |= _cover(i, b.first, b.end, near, outline, seams)
                for m in range(b.first, b.end):
                    found |= _cover(m, a.first, a.end, near, outline, seams)
            if found:
                seams.seamed[s] = seams.seamed[t] = seams.joined[0] = 1
    if seams.joined[0] != 0:
        for i in range(seams.after.shape[0]):
            m = seams.after[i]
            if m != NONE and (_is_covered_at_end(i, seams) or seams.exposed[m, 0] > 0.0):
                seams.after[i] = seams.before[m] = NONE
                seams.corner[m] = seams.corner[seams.ends[i]] = PLAIN
        _share_corners(shapes, outline, seams)


@kernel
def piece_reach(s: int, records: Records, outline: Reals, seams: Seams) -> float:
    """Reach of the shape, or, with seams, of the common piece: no less than those of the neighbours, and half
    of a whole face."""
    shapes = records.shapes
    reach = shapes[s].reach
    if seams.seamed[s] != 0:
        for k in range(seams.neighbours.shape[0]):
            one, other = seams.neighbours[k, 0], seams.neighbours[k, 1]
            if s in (one, other) and seams.seamed[one] != 0 and seams.seamed[other] != 0:
                reach = max(reach, shapes[one].reach, shapes[other].reach)
        for i in range(shapes[s].first, shapes[s].end):
            first, last = outer_ends(i, seams)
            dx, dy = outline[last, 0] - outline[first, 0], outline[last, 1] - outline[first, 1]
            reach = max(reach, 0.5 * math.hypot(dx, dy))
    return reach


@rare_kernel
def _link_all(a: Record, b: Record, near: float, outline: Reals, seams: Seams) -> bool:
    """Link the edges of both shapes, and cover the sides that meet at the seams."""
    found = False
    for i in range(a.first, a.end):
        for m in range(b.first, b.end):
            if _link(i, m, near, outline, seams):
                _cover(seams.ends[i], b.first, b.end, near, outline, seams)
                _cover(m - 1 if m > b.first else b.end - 1, a.first, a.end, near, outline, seams)
                found = True
            if _link(m, i, near, outline, seams):
                _cover(seams.ends[m], a.first, a.end, near, outline, seams)
                _cover(i - 1 if i > a.first else a.end - 1, b.first, b.end, near, outline, seams)
                found = True
    return found


@kernel
def continue_each_other(a: Record, b: Record, seams: Seams) -> bool:
    """Whether a face of one shape continues into the other: then neither of the two slides over the seam."""
    found = False
    for i in range(a.first, a.end):
        found |= b.first <= seams.after[i] < b.end or b.first <= seams.before[i] < b.end
    return found


@kernel
def _link(i: int, m: int, near: float, outline: Reals, seams: Seams) -> bool:
    """Link edge i to edge m if edge i continues there in the same line."""
    j = seams.ends[i]
    if not math.hypot(outline[m, 0] - outline[j, 0], outline[m, 1] - outline[j, 1]) <= near:
        return False
    same = outline[i, 2] * outline[m, 2] + outline[i, 3] * outline[m, 3] > 0.0
    off_i, off_m = height(i, seams.ends[m], outline), height(m, i, outline)
    if not same or max(abs(off_i), abs(off_m)) > near or seams.after[i] != NONE or seams.before[m] != NONE:
        return False
    seams.after[i], seams.before[m] = m, i
    seams.corner[m] = seams.corner[j] = DEAD
    return True


@rare_kernel
def _cover(i: int, first: int, end: int, near: float, outline: Reals, seams: Seams) -> bool:
    """Cover the part of edge i that lies in the polygon of vertices first..end, or along its boundary."""
    j = seams.ends[i]
    length = math.hypot(outline[j, 0] - outline[i, 0], outline[j, 1] - outline[i, 1])
    low, high = 0.0, length
    for m in range(first, end):
        begins, stops = height(m, i, outline), height(m, j, outline)
        if max(abs(begins), abs(stops)) <= near:
            if outline[i, 2] * outline[m, 2] + outline[i, 3] * outline[m, 3] > 0.0:
                return False
        elif begins > 0.0 and stops > 0.0:
            return False
        elif begins > 0.0:
            low = max(low, length * begins / (begins - stops))
        elif stops > 0.0:
            high = min(high, length * begins / (begins - stops))
    if not high - low > 2.0 * near or end - first < 3:
        return False
    if low <= 2.0 * near:
        seams.exposed[i, 0] = max(seams.exposed[i, 0], high)
    if high >= length - 2.0 * near:
        seams.exposed[i, 1] = min(seams.exposed[i, 1], low)
    return True


@rare_kernel
def _share_corners(shapes: RecordArray, outline: Reals, seams: Seams) -> None:
    """Find the edges that bound the corners that neighbours have in common, and the owners of these
    corners."""
    for k in range(seams.still[0]):
        s, t = seams.neighbours[k, 0], seams.neighbours[k, 1]
        if seams.seamed[s] != 0 and seams.seamed[t] != 0 and shapes[s].radius == shapes[t].radius:
            near = FLUSH * min(shapes[s].reach, shapes[t].reach)
            for i in range(shapes[s].first, shapes[s].end):
                for m in range(shapes[t].first, shapes[t].end):
                    dx, dy = outline[m, 0] - outline[i, 0], outline[m, 1] - outline[i, 1]
                    if math.hypot(dx, dy) <= near:
                        _share(i, m, seams)
                        _share(m, i, seams)
    for s in range(shapes.shape[0]):
        for i in range(shapes[s].first, shapes[s].end):
            low, high = seams.cone[i, 0], seams.cone[i, 1]
            if seams.corner[i] == SHARP:
                turn = outline[low, 2] * outline[high, 3] - outline[low, 3] * outline[high, 2]
                if _is_covered_at_end(low, seams) or seams.exposed[high, 0] > 0.0:
                    seams.corner[i] = DEAD
                elif turn <= 0.0:
                    seams.corner[i] = REFLEX
            if seams.corner[i] != SHARP:
                seams.owner[i] = i


@rare_kernel
def _share(i: int, m: int, seams: Seams) -> None:
    """Let vertex i have the exposed edges at vertex m of a neighbour where its own are covered."""
    if seams.corner[i] != DEAD and _is_inner(i, seams) and _is_inner(m, seams):
        seams.corner[i] = SHARP
        seams.owner[i] = min(seams.owner[i], seams.owner[m])
        before, after = seams.cone[m, 0], seams.cone[m, 1]
        if _is_covered_at_end(seams.cone[i, 0], seams) and not _is_covered_at_end(before, seams):
            seams.cone[i, 0] = before
        if seams.exposed[seams.cone[i, 1], 0] > 0.0 and not seams.exposed[after, 0] > 0.0:
            seams.cone[i, 1] = after


@kernel
def _is_inner(i: int, seams: Seams) -> bool:
    """Whether a part of the shape's boundary next to the vertex is covered."""
    return (
        seams.corner[i] != PLAIN or seams.exposed[i, 0] > 0.0 or _is_covered_at_end(seams.cone[i, 0], seams)
    )


@kernel
def _is_covered_at_end(i: int, seams: Seams) -> bool:
    return seams.exposed[i, 1] < math.inf


@kernel
def keep_slots(manifolds: Manifolds, seams: Seams) -> None:
    """Keep what `carry_over` looks up."""
    for slot in range(manifolds.features.shape[0]):
        seams.features[slot], seams.modes[slot] = manifolds.features[slot], manifolds.modes[slot]
        for d in range(manifolds.deformation.shape[1]):
            seams.deformation[slot, d] = manifolds.deformation[slot, d]
            seams.force[slot, d] = manifolds.force[slot, d]


@kernel
def carry_over(manifolds: Manifolds, outline: Reals, seams: Seams) -> None:
    """Give each point that has come over a seam the deformation, mode and force that it had before."""
    features, deformation = manifolds.features, manifolds.deformation
    for slot in range(features.shape[0]):
        if features[slot] != ABSENT and _is_new(slot, features, seams):
            for old in range(features.shape[0]):
                if old // 2 != slot // 2 and is_continued(
                    seams.features[old], features[slot], outline, seams
                ):
                    manifolds.modes[slot] = seams.modes[old]
                    for d in range(deformation.shape[1]):
                        deformation[slot, d] = seams.deformation[old, d]
                        manifolds.force[slot, d] = seams.force[old, d]


@kernel
def _is_new(slot: int, features: Ints, seams: Seams) -> bool:
    first = slot - slot % 2
    return features[slot] != seams.features[first] and features[slot] != seams.features[first + 1]


@kernel
def mode_before(
    slot: int, manifolds: Manifolds, before: Ints, modes_before: Ints, outline: Reals, seams: Seams
) -> int:
    """Mode of the slot's contact when the features were `before`, in whichever slot the contact was then.

    A contact that has left the slot over a seam is accounted for in its new slot: its mode here is as before.
    """
    features = manifolds.features
    if slot >= features.shape[0] or features[slot] == before[slot]:
        return modes_before[slot]
    for other in range(features.shape[0]):
        if features[slot] == ABSENT:
            gone = features[other] != ABSENT
            if gone and is_continued(before[slot], features[other], outline, seams):
                return manifolds.modes[slot]
        elif is_continued(before[other], features[slot], outline, seams):
            return modes_before[other]
    return modes_before[slot]


@kernel
def is_continued(old: int, new: int, outline: Reals, seams: Seams) -> bool:
    """Whether both features are the same vertex over parts of one face, or the same end of the stretch where
    two faces meet, whose vertex is now over the other's."""
    if old == ABSENT:
        return False
    edge, vertex, other, corner = old // VERTICES, old % VERTICES, new // VERTICES, new % VERTICES
    if edge >= VERTICES or other >= VERTICES:
        return False
    first, last = outer_ends(edge, seams)
    start, end = outer_ends(other, seams)
    twin = seams.owner[vertex] == seams.owner[corner]
    if twin and first == start and last == end:
        return True
    if not are_parallel(edge, other, outline):
        return False
    return (vertex == start and corner == last) or (vertex == end and corner == first)


@kernel
def outer_ends(edge: int, seams: Seams) -> tuple[int, int]:
    """Vertices at the start and at the end of the whole face that the edge is a part of."""
    first = last = edge
    while seams.before[first] != NONE:
        first = seams.before[first]
    while seams.after[last] != NONE:
        last = seams.after[last]
    return first, seams.ends[last]
