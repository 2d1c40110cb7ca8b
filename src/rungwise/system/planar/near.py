"""Which pairs of many bodies may touch soon: a list that is kept until some body has moved far enough.

Pairs whose circles are farther apart than the reach of the list are left out; they cannot come within what is
looked for before a body has moved by half of the rest. Source: Verlet, Phys. Rev. 159 (1967) 98-103. Pairs
with a half-plane, and those whose gap conditions read, are always in the list.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, RecordArray, inner_kernel, rare_kernel
from rungwise.scene.template.records import HALFPLANE, Records
from rungwise.system.planar.contact_manifold import ABSENT, Manifolds
from rungwise.system.planar.place import Placement, X, Y

AHEAD = 8.0
"""Reach of the list beyond what is looked for, over what is looked for."""
LATER = 4
"""Steps for which forces of pairs that left the list are read: three, and one to spare."""


@inner_kernel
def is_listed(manifolds: Manifolds) -> bool:
    """Whether near pairs are listed."""
    return bool(manifolds.near.shape[0] > 0)


@inner_kernel
def near_pairs(manifolds: Manifolds, pairs: int) -> int:
    """How many pairs to look at, of so many."""
    return int(manifolds.listed[0]) if manifolds.near.shape[0] > 0 else pairs


@inner_kernel
def pair_at(manifolds: Manifolds, i: int) -> int:
    """The i-th pair to look at."""
    return int(manifolds.near[i]) if manifolds.near.shape[0] > 0 else i


@rare_kernel
def list_near(records: Records, placed: Placement, margin: float, manifolds: Manifolds) -> None:
    """List the pairs that may be within `margin`, if the list is not right any more."""
    seen, within, pose, moved = manifolds.seen, manifolds.within, placed.pose, 0.0
    for b in range(seen.shape[0]):
        moved = max(moved, (pose[b, X] - seen[b, 0]) ** 2 + (pose[b, Y] - seen[b, 1]) ** 2)
    if within[0] >= 0.0 and 2.0 * math.sqrt(moved) + margin <= within[0]:
        return
    within[0] = (1.0 + AHEAD) * margin
    manifolds.turn[0] += 1
    for b in range(seen.shape[0]):
        seen[b, 0], seen[b, 1] = pose[b, X], pose[b, Y]
    manifolds.far[:] = math.inf
    count = 0
    for p in range(records.pairs.shape[0]):
        pair = records.pairs[p]
        a, b = records.shapes[pair.shape_a], records.shapes[pair.shape_b]
        apart = _apart(a, b, placed)
        if apart <= within[0] or records.contacts[pair.contact].watched:
            manifolds.near[count] = p
            count += 1
        else:
            bound = manifolds.far[pair.contact]
            manifolds.far[pair.contact] = min(bound, apart - AHEAD * margin)
            forget_slot(2 * p, manifolds)
            forget_slot(2 * p + 1, manifolds)
    manifolds.listed[0] = count


@rare_kernel
def _apart(a: Record, b: Record, placed: Placement) -> float:
    """Distance of the circles about the bodies' centres; no more than 0 for a half-plane, which may turn."""
    if HALFPLANE in (a.kind, b.kind):
        return 0.0
    pose = placed.pose
    dx, dy = pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y]
    return math.sqrt(dx * dx + dy * dy) - a.reach - b.reach


@inner_kernel
def forget_slot(slot: int, manifolds: Manifolds) -> None:
    """Forget the feature of a slot, and what belongs to it."""
    if manifolds.features[slot] != ABSENT:
        manifolds.features[slot] = ABSENT
        manifolds.deformation[slot, :] = 0.0
        manifolds.modes[slot] = 0


@inner_kernel
def forget_gaps(pairs: RecordArray, manifolds: Manifolds) -> None:
    """Let gaps be what is known of pairs that are not looked at."""
    if is_listed(manifolds):
        _forget_near_gaps(pairs, manifolds)
    else:
        for c in range(manifolds.gaps.shape[0]):
            manifolds.gaps[c] = math.inf


@rare_kernel
def _forget_near_gaps(pairs: RecordArray, manifolds: Manifolds) -> None:
    """The same where gaps of contacts without a listed pair are so already, unless they may have changed."""
    gaps, far, turn, shown = manifolds.gaps, manifolds.far, manifolds.turn, manifolds.shown
    if shown[0] != turn[0]:
        for c in range(gaps.shape[0]):
            gaps[c] = far[c]
        shown[0] = turn[0]
        return
    for i in range(manifolds.listed[0]):
        c = pairs[manifolds.near[i]].contact
        gaps[c] = far[c]


@inner_kernel
def forget_forces(manifolds: Manifolds, force: Reals) -> None:
    """Set forces (slots, d), of which those of pairs come first, to zero where they may not be."""
    if is_listed(manifolds) and manifolds.cleared[0] == manifolds.turn[0]:
        _forget_near_forces(manifolds, force)
        return
    for slot in range(force.shape[0]):
        for j in range(force.shape[1]):
            force[slot, j] = 0.0
    if is_listed(manifolds):
        manifolds.cleared[0] = manifolds.turn[0]


@rare_kernel
def _forget_near_forces(manifolds: Manifolds, force: Reals) -> None:
    """The same where those of pairs that are not listed are zero."""
    for i in range(manifolds.listed[0]):
        for slot in range(2 * manifolds.near[i], 2 * manifolds.near[i] + 2):
            for j in range(force.shape[1]):
                force[slot, j] = 0.0
    for slot in range(manifolds.features.shape[0], force.shape[0]):
        for j in range(force.shape[1]):
            force[slot, j] = 0.0


@inner_kernel
def listen(manifolds: Manifolds) -> bool:
    """Whether forces of contacts without a listed pair may not be zero in this step or the two before."""
    if is_listed(manifolds):
        heard, turn = manifolds.heard, manifolds.turn
        if heard[0] != turn[0]:
            heard[0], heard[1] = turn[0], LATER
        heard[1] = max(heard[1] - 1, 0)
    return hears_all(manifolds)


@inner_kernel
def hears_all(manifolds: Manifolds) -> bool:
    """What `listen` said."""
    return not is_listed(manifolds) or bool(manifolds.heard[1] > 0)
