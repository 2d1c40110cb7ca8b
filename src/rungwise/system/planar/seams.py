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
from rungwise.system.planar.chains import (
    DEAD,
    FLUSH,
    NONE,
    PLAIN,
    REFLEX,
    SHARP,
    Chains,
    allocate_chains,
)
from rungwise.system.planar.contact_manifold import (
    ABSENT,
    VERTICES,
    Manifolds,
)
from rungwise.system.planar.edges import (
    are_parallel,
    height,
)
from rungwise.system.planar.place import Placement, X, Y


class Seams(Block):
    """Seams of a scene, per shape, and pair of shapes.

    alone                        the chains of the shapes, each by itself
    outlines                     the chains of the outlines that shapes form together
    neighbours  (k, 2)           shapes that may lie flush
    still       (1,)             how many of these, the first, never move relative to each other
    seamed      (shapes,)        whether the shape is a piece of an outline
    features, deformation, modes, force   per slot, before contacts are looked for again
    """

    alone: Chains
    outlines: Chains
    neighbours: Ints
    still: Ints
    seamed: Ints
    features: Ints
    deformation: Reals
    modes: Ints
    force: Reals


def allocate_seams(records: Records) -> Seams:
    """The seams of a scene, yet to be found."""
    neighbours, still = _neighbours(records)
    slots = 2 * len(records.pairs)
    return Seams(
        alone=allocate_chains(records),
        outlines=allocate_chains(records),
        neighbours=neighbours,
        still=np.array([still]),
        seamed=np.zeros(len(records.shapes), np.int64),
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
    shapes, pose, outline, chains = records.shapes, placed.pose, placed.outline, seams.outlines
    seams.seamed[:] = 0
    chains.joined[0] = 0
    if seams.neighbours.shape[0] == 0:
        return
    chains.corner[:] = PLAIN
    chains.before[:] = NONE
    chains.after[:] = NONE
    for s in range(shapes.shape[0]):
        for i in range(shapes[s].first, shapes[s].end):
            chains.owner[i] = chains.cone[chains.ends[i], 0] = chains.cone[i, 1] = i
            chains.exposed[i, 0], chains.exposed[i, 1] = 0.0, math.inf
    for k in range(seams.neighbours.shape[0]):
        s, t = seams.neighbours[k, 0], seams.neighbours[k, 1]
        a, b = shapes[s], shapes[t]
        near = FLUSH * min(a.reach, b.reach)
        far = math.hypot(pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y])
        if a.radius == b.radius and far <= a.reach + b.reach + near:
            found = _link_all(a, b, near, outline, chains)
            if k < seams.still[0]:
                for i in range(a.first, a.end):
                    found |= _cover(i, b.first, b.end, near, outline, chains)
                for m in range(b.first, b.end):
                    found |= _cover(m, a.first, a.end, near, outline, chains)
            if found:
                seams.seamed[s] = seams.seamed[t] = chains.joined[0] = 1
    if chains.joined[0] != 0:
        for i in range(chains.after.shape[0]):
            m = chains.after[i]
            if m != NONE and (_is_covered_at_end(i, chains) or chains.exposed[m, 0] > 0.0):
                chains.after[i] = chains.before[m] = NONE
                chains.corner[m] = chains.corner[chains.ends[i]] = PLAIN
        _share_corners(shapes, outline, seams)
    for i in range(chains.whole.shape[0]):
        first = last = i
        while chains.before[first] != NONE:
            first = chains.before[first]
        while chains.after[last] != NONE:
            last = chains.after[last]
        chains.whole[i, 0], chains.whole[i, 1] = first, chains.ends[last]


@kernel
def piece_reach(s: int, records: Records, outline: Reals, seams: Seams) -> float:
    """Reach of the shape, or, with seams, of the common piece: no less than those of the neighbours, and half
    of a whole face."""
    shapes, whole = records.shapes, seams.outlines.whole
    reach = shapes[s].reach
    if seams.seamed[s] != 0:
        for k in range(seams.neighbours.shape[0]):
            one, other = seams.neighbours[k, 0], seams.neighbours[k, 1]
            if s in (one, other) and seams.seamed[one] != 0 and seams.seamed[other] != 0:
                reach = max(reach, shapes[one].reach, shapes[other].reach)
        for i in range(shapes[s].first, shapes[s].end):
            first, last = whole[i, 0], whole[i, 1]
            dx, dy = outline[last, 0] - outline[first, 0], outline[last, 1] - outline[first, 1]
            reach = max(reach, 0.5 * math.hypot(dx, dy))
    return reach


@rare_kernel
def _link_all(a: Record, b: Record, near: float, outline: Reals, chains: Chains) -> bool:
    """Link the edges of both shapes, and cover the sides that meet at the seams."""
    found = False
    for i in range(a.first, a.end):
        for m in range(b.first, b.end):
            if _link(i, m, near, outline, chains):
                _cover(chains.ends[i], b.first, b.end, near, outline, chains)
                _cover(m - 1 if m > b.first else b.end - 1, a.first, a.end, near, outline, chains)
                found = True
            if _link(m, i, near, outline, chains):
                _cover(chains.ends[m], a.first, a.end, near, outline, chains)
                _cover(i - 1 if i > a.first else a.end - 1, b.first, b.end, near, outline, chains)
                found = True
    return found


@kernel
def continue_each_other(a: Record, b: Record, chains: Chains) -> bool:
    """Whether a face of one shape continues into the other: then neither of the two slides over the seam."""
    found = False
    for i in range(a.first, a.end):
        found |= b.first <= chains.after[i] < b.end or b.first <= chains.before[i] < b.end
    return found


@kernel
def _link(i: int, m: int, near: float, outline: Reals, chains: Chains) -> bool:
    """Link edge i to edge m if edge i continues there in the same line."""
    j = chains.ends[i]
    if not math.hypot(outline[m, 0] - outline[j, 0], outline[m, 1] - outline[j, 1]) <= near:
        return False
    same = outline[i, 2] * outline[m, 2] + outline[i, 3] * outline[m, 3] > 0.0
    off_i, off_m = height(i, chains.ends[m], outline), height(m, i, outline)
    if not same or max(abs(off_i), abs(off_m)) > near or chains.after[i] != NONE or chains.before[m] != NONE:
        return False
    chains.after[i], chains.before[m] = m, i
    chains.corner[m] = chains.corner[j] = DEAD
    return True


@rare_kernel
def _cover(i: int, first: int, end: int, near: float, outline: Reals, chains: Chains) -> bool:
    """Cover the part of edge i that lies in the polygon of vertices first..end, or along its boundary."""
    j = chains.ends[i]
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
        chains.exposed[i, 0] = max(chains.exposed[i, 0], high)
    if high >= length - 2.0 * near:
        chains.exposed[i, 1] = min(chains.exposed[i, 1], low)
    return True


@rare_kernel
def _share_corners(shapes: RecordArray, outline: Reals, seams: Seams) -> None:
    """Find the edges that bound the corners that neighbours have in common, and the owners of these
    corners."""
    chains = seams.outlines
    for k in range(seams.still[0]):
        s, t = seams.neighbours[k, 0], seams.neighbours[k, 1]
        if seams.seamed[s] != 0 and seams.seamed[t] != 0 and shapes[s].radius == shapes[t].radius:
            near = FLUSH * min(shapes[s].reach, shapes[t].reach)
            for i in range(shapes[s].first, shapes[s].end):
                for m in range(shapes[t].first, shapes[t].end):
                    dx, dy = outline[m, 0] - outline[i, 0], outline[m, 1] - outline[i, 1]
                    if math.hypot(dx, dy) <= near:
                        _share(i, m, chains)
                        _share(m, i, chains)
    for s in range(shapes.shape[0]):
        for i in range(shapes[s].first, shapes[s].end):
            low, high = chains.cone[i, 0], chains.cone[i, 1]
            if chains.corner[i] == SHARP:
                turn = outline[low, 2] * outline[high, 3] - outline[low, 3] * outline[high, 2]
                if _is_covered_at_end(low, chains) or chains.exposed[high, 0] > 0.0:
                    chains.corner[i] = DEAD
                elif turn <= 0.0:
                    chains.corner[i] = REFLEX
            if chains.corner[i] != SHARP:
                chains.owner[i] = i


@rare_kernel
def _share(i: int, m: int, chains: Chains) -> None:
    """Let vertex i have the exposed edges at vertex m of a neighbour where its own are covered."""
    if chains.corner[i] != DEAD and _is_inner(i, chains) and _is_inner(m, chains):
        chains.corner[i] = SHARP
        chains.owner[i] = min(chains.owner[i], chains.owner[m])
        before, after = chains.cone[m, 0], chains.cone[m, 1]
        if _is_covered_at_end(chains.cone[i, 0], chains) and not _is_covered_at_end(before, chains):
            chains.cone[i, 0] = before
        if chains.exposed[chains.cone[i, 1], 0] > 0.0 and not chains.exposed[after, 0] > 0.0:
            chains.cone[i, 1] = after


@kernel
def _is_inner(i: int, chains: Chains) -> bool:
    """Whether a part of the shape's boundary next to the vertex is covered."""
    return (
        chains.corner[i] != PLAIN
        or chains.exposed[i, 0] > 0.0
        or _is_covered_at_end(chains.cone[i, 0], chains)
    )


@kernel
def _is_covered_at_end(i: int, chains: Chains) -> bool:
    return chains.exposed[i, 1] < math.inf


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
                    seams.features[old], features[slot], outline, seams.outlines
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
    slot: int, manifolds: Manifolds, before: Ints, modes_before: Ints, outline: Reals, chains: Chains
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
            if gone and is_continued(before[slot], features[other], outline, chains):
                return manifolds.modes[slot]
        elif is_continued(before[other], features[slot], outline, chains):
            return modes_before[other]
    return modes_before[slot]


@kernel
def is_continued(old: int, new: int, outline: Reals, chains: Chains) -> bool:
    """Whether both features are the same vertex over parts of one face, or the same end of the stretch where
    two faces meet, whose vertex is now over the other's."""
    if old == ABSENT:
        return False
    edge, vertex, other, corner = old // VERTICES, old % VERTICES, new // VERTICES, new % VERTICES
    if edge >= VERTICES or other >= VERTICES:
        return False
    whole = chains.whole
    first, last, start, end = whole[edge, 0], whole[edge, 1], whole[other, 0], whole[other, 1]
    twin = chains.owner[vertex] == chains.owner[corner]
    if twin and first == start and last == end:
        return True
    if not are_parallel(edge, other, outline):
        return False
    return (vertex == start and corner == last) or (vertex == end and corner == first)
