"""Contacts in space: rows, laws, and the features that carry forces and deformations from step to step.

Contacts are found anew at each state. A feature is a contact of the
same two geoms near the same place on their bodies; its slot keeps the first tangent in the frames of both
bodies, and the tangent at the next state is the mean of the two, so that deformations turn with the bodies.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import place_in
from rungwise.kernel import Ints, Reals, inner_kernel, kernel
from rungwise.system.entries import clear_rows, is_crowded, set_spans
from rungwise.system.skew import XX, XY, YY, is_skew, widened
from rungwise.system.terms import Terms

FREE = -1
"""Geom of a slot that no feature has."""
NEAR = 0.2
"""A contact is the feature of a step before where it lies within this part of the smaller geom's size from
it; chosen by trial, to a factor of two: corners of a box are farther apart, and nothing moves as far in a
step."""


SAME = 0.05
"""Within this part of the distance no other contact is nearer; the order of contacts mostly stays."""
BLUNT = 1e-5
"""Motion of a contact along one of its directions, over its motion along the others by the same velocity,
that is an error of the direction: normals of meshes err by 1e-6. Chosen by trial, to a decade."""


class Features(Block):
    """Features by slot: geoms (s, 2); place, along (s, 6): the contact and its first tangent in the frames of
    the bodies of both geoms; world (s, 11): point, normal and first tangent in the world, gap and
    friction, the greatest where it differs by direction."""

    geoms: Ints
    place: Reals
    along: Reals
    world: Reals
    used: Ints


def allocate_features(slots: int) -> Features:
    """Slots without features."""
    return Features(
        geoms=np.full((slots, 2), FREE), place=np.zeros((slots, 6)), along=np.zeros((slots, 6)),
        world=np.zeros((slots, 11)), used=np.zeros(1, np.int64),
    )  # fmt: skip


class Solids(Block):
    """What a model says of its geoms, and where its bodies are.

    body (g,); size (g,): of the geom, inf for planes; law (g, g): row of `laws` for two geoms; laws (l, 8):
    normal and tangential stiffness and damping, restitution, and sliding, torsional and rolling friction, nan
    for MuJoCo's; free (n,): whether a velocity is not prescribed; span (b, 2): the widened of the velocities
    that may move a body; centre (b, 3), turn (b, 9): frames of the bodies, in MuJoCo's memory.
    """

    body: Ints
    size: Reals
    law: Ints
    laws: Reals
    free: Ints
    span: Ints
    centre: Reals
    turn: Reals


class ContactSet(Block):
    """Contacts, `count` (1,) of them: dist (c,), pos (c, 3), frame (c, 9), friction (c, 5), dim (c,), geom
    (c, 2), address (c,) of the first of its rows, -1 if nothing moves it. A row has entries (r,) many, from
    first (r,) on: J (e,), in the columns column (e,), which are the same for all rows of a contact."""

    count: Ints
    dist: Reals
    pos: Reals
    frame: Reals
    friction: Reals
    dim: Ints
    geom: Ints
    address: Ints
    first: Ints
    entries: Ints
    column: Ints
    J: Reals


class Seen(NamedTuple):
    """A set of contacts, its arrays as long as there are contacts."""

    dist: Reals
    pos: Reals
    frame: Reals
    friction: Reals
    dim: Ints
    geom: Ints
    address: Ints
    first: Ints
    entries: Ints
    column: Ints
    J: Reals


def seen_in(contacts: ContactSet) -> Seen:
    """The contacts of a set that there are."""
    w, c = contacts, slice(int(contacts.count[0]))
    return Seen(
        w.dist[c], w.pos[c], w.frame[c], w.friction[c], w.dim[c], w.geom[c], w.address[c],
        w.first, w.entries, w.column, w.J,
    )  # fmt: skip


def dense(seen: Seen, c: int, width: int, n: int) -> Reals:
    """The first rows (width, n) of a contact; 0 where it has fewer."""
    rows, first = np.zeros((width, n)), int(seen.address[c])
    for i in range(min(width, int(seen.dim[c]))):
        begin, count = int(seen.first[first + i]), int(seen.entries[first + i])
        rows[i, seen.column[begin : begin + count]] = seen.J[begin : begin + count]
    return rows


@kernel
def fill_contacts(
    seen: ContactSet,
    solids: Solids,
    kept: Features,
    found: Features,
    reach: float,
    most: int,
    terms: Terms,
    slots: Ints,
    fresh: Ints,
) -> int:
    """Fill terms with all contacts within `reach` that something free can change, at most `most`.

    Writes their slots and whether each is new (c,), and their features into `found`; returns how many there
    are, or -1 if there are more than `most`.
    """
    count, d, n = 0, terms.contact_stiffness.shape[1], terms.load.shape[0]
    for s in range(found.used[0]):
        found.geoms[s, 0] = FREE
    found.used[0] = 0
    for c in range(seen.count[0]):
        if seen.address[c] < 0 or not seen.dist[c] <= reach:
            continue
        if not _is_free(c, seen, solids.free):
            continue
        if count == most:
            return -1
        slot = _slot_of(c, seen, solids, kept, found)
        found.used[0] = max(found.used[0], slot + 1)
        fresh[count] = kept.geoms[slot, 0] == FREE
        slots[count] = slot
        _fill_rows(c, count, slot, seen, solids, kept, found, bool(fresh[count]), d, n, terms)
        _fill_law(c, count, slot, seen, solids, found, d, terms)
        found.world[slot, 9] = seen.dist[c]
        count += 1
    return count


@kernel
def least_gap(seen: ContactSet) -> float:
    """The smallest gap of contacts that have rows; inf where there is none."""
    least = math.inf
    for c in range(seen.count[0]):
        if seen.address[c] >= 0:
            least = min(least, seen.dist[c])
    return least


@inner_kernel
def _moved(geom: Ints, solids: Solids, n: int) -> tuple[int, int, int, int]:
    """Two spans of the velocities that may move one of two geoms, of n."""
    a, b = solids.body[geom[0]], solids.body[geom[1]]
    first, end = solids.span[a, 0], solids.span[a, 1]
    second, last = solids.span[b, 0], solids.span[b, 1]
    if second < first:
        first, end, second, last = second, last, first, end
    if second < end:  # links of one mechanism
        return first, max(end, last), n, n
    return first, end, second, last


@kernel
def _is_free(c: int, seen: ContactSet, free: Ints) -> bool:
    begin, found = seen.first[seen.address[c]], False
    for e in range(begin, begin + seen.entries[seen.address[c]]):
        found |= seen.J[e] != 0.0 and free[seen.column[e]] == 1
    return found


@kernel
def _slot_of(c: int, seen: ContactSet, solids: Solids, kept: Features, found: Features) -> int:
    """The slot of the nearest feature of the same geoms that no other contact has taken, or a free one."""
    a, b = seen.geom[c, 0], seen.geom[c, 1]
    best, empty = FREE, FREE
    near = NEAR * min(solids.size[a], solids.size[b])
    used = max(kept.used[0], found.used[0])
    likely = c < used and found.geoms[c, 0] == FREE and kept.geoms[c, 0] == a and kept.geoms[c, 1] == b
    if likely and _apart(c, 0, c, seen, solids, kept) < SAME * near:
        return c
    for s in range(used):
        if found.geoms[s, 0] != FREE:
            continue
        if kept.geoms[s, 0] == FREE:
            empty = s if empty == FREE else empty
        elif kept.geoms[s, 0] == a and kept.geoms[s, 1] == b:
            apart = min(_apart(c, 0, s, seen, solids, kept), _apart(c, 1, s, seen, solids, kept))
            if apart < near:
                best, near = s, apart
    if best != FREE:
        return best
    return empty if empty != FREE else used


@kernel
def _apart(c: int, side: int, s: int, seen: ContactSet, solids: Solids, kept: Features) -> float:
    """Distance of contact c from feature s on the body of one of its geoms."""
    b, total = solids.body[seen.geom[c, side]], 0.0
    for i in range(3):
        own = 0.0
        for j in range(3):
            own += solids.turn[b, 3 * j + i] * (seen.pos[c, j] - solids.centre[b, j])
        total += (own - kept.place[s, 3 * side + i]) ** 2
    return math.sqrt(total)


@kernel
def _fill_rows(
    c: int,
    k: int,
    slot: int,
    seen: ContactSet,
    solids: Solids,
    kept: Features,
    found: Features,
    is_fresh: bool,
    d: int,
    n: int,
    terms: Terms,
) -> None:
    """Fill the rows of contact k: normal, two tangents that turn with the bodies, and what else resists."""
    frame = seen.frame[c]
    along, across = 1.0, 0.0
    if not is_fresh:
        along, across = _heading(frame, slot, seen.geom[c], solids, kept)
    found.geoms[slot, 0], found.geoms[slot, 1] = seen.geom[c, 0], seen.geom[c, 1]
    for side in range(2):
        b = solids.body[seen.geom[c, side]]
        for i in range(3):
            place, tangent = 0.0, 0.0
            for j in range(3):
                place += solids.turn[b, 3 * j + i] * (seen.pos[c, j] - solids.centre[b, j])
                tangent += solids.turn[b, 3 * j + i] * (along * frame[3 + j] + across * frame[6 + j])
            found.place[slot, 3 * side + i], found.along[slot, 3 * side + i] = place, tangent
    for i in range(3):
        found.world[slot, i], found.world[slot, 3 + i] = seen.pos[c, i], frame[i]
        found.world[slot, 6 + i] = along * frame[3 + i] + across * frame[6 + i]
    if is_crowded(terms.entries):
        moved = _moved(seen.geom[c], solids, n)
        set_spans(terms.entries.rows, k, moved[0], moved[1], moved[2], moved[3])
    clear_rows(terms.entries, k, d, terms.rows)
    _turn_rows(c, k, along, across, seen, d, terms)
    if seen.dim[c] > 1:
        _clear_blunt(c, k, seen, d, terms)
    if is_skew(terms.skew):
        terms.skew[k, XX], terms.skew[k, XY], terms.skew[k, YY] = 1.0, 0.0, 1.0
    if seen.dim[c] > 1 and is_skew(terms.skew):
        _tell_skew(c, k, along, across, seen, solids, d, terms)
    if d > 3 and seen.dim[c] > 3:
        _weigh(c, k, along, across, seen, solids, d, terms)


@inner_kernel
def _turn_rows(c: int, k: int, along: float, across: float, seen: ContactSet, d: int, terms: Terms) -> None:
    """Fill the rows of contact k with those that are seen, with tangents turned."""
    J, first, begin = seen.J, seen.address[c], seen.first[seen.address[c]]
    for e in range(seen.entries[first]):
        j = place_in(terms.entries.rows, k, seen.column[begin + e])
        terms.rows[k * d, j] = J[begin + e]
        for pair in range(1, d - 1, 3):
            if seen.dim[c] > pair + 1:
                x, y = J[seen.first[first + pair] + e], J[seen.first[first + pair + 1] + e]
                terms.rows[k * d + pair, j] = along * x + across * y
                terms.rows[k * d + pair + 1, j] = along * y - across * x
        if d > 3 and seen.dim[c] > 3:
            terms.rows[k * d + 3, j] = J[seen.first[first + 3] + e]


@inner_kernel
def _clear_blunt(c: int, k: int, seen: ContactSet, d: int, terms: Terms) -> None:
    """Let directions of contact k be zero along which nothing moves, up to errors of its normal: forces along
    them would be of any size, and motions without inertia run away."""
    begin = seen.first[seen.address[c]]
    for i in range(3):
        moves = False
        for e in range(begin, begin + seen.entries[seen.address[c]]):
            j, most = place_in(terms.entries.rows, k, seen.column[e]), 0.0
            for other in range(3):
                most = max(most, abs(terms.rows[k * d + other, j]))
            moves |= abs(terms.rows[k * d + i, j]) > BLUNT * most
        if not moves:
            for e in range(begin, begin + seen.entries[seen.address[c]]):
                terms.rows[k * d + i, place_in(terms.entries.rows, k, seen.column[e])] = 0.0


@kernel
def _tell_skew(
    c: int, k: int, along: float, across: float, seen: ContactSet, solids: Solids, d: int, terms: Terms
) -> None:
    """Let rows of slip be those in which friction that differs along its two tangents is a disc."""
    slide, other, _, _, _ = _frictions(c, seen, solids)
    if slide != other:
        unit = max(slide, other)
        skew = _between(slide / unit, other / unit, along, across)
        for i in range(3):
            terms.skew[k, i] = skew[i]
        _mix(c, k, k * d + 1, skew, seen, terms)


@inner_kernel
def _between(one: float, two: float, along: float, across: float) -> tuple[float, float, float]:
    """The symmetric matrix with these values along the two tangents that are seen, in those of a contact."""
    return (
        one * along * along + two * across * across,
        (two - one) * along * across,
        one * across * across + two * along * along,
    )


@inner_kernel
def _mix(c: int, k: int, r: int, by: tuple[float, float, float], seen: ContactSet, terms: Terms) -> None:
    """Multiply two rows of contact k, from r on, by a symmetric matrix."""
    begin = seen.first[seen.address[c]]
    for e in range(begin, begin + seen.entries[seen.address[c]]):
        j = place_in(terms.entries.rows, k, seen.column[e])
        x, y = terms.rows[r, j], terms.rows[r + 1, j]
        terms.rows[r, j], terms.rows[r + 1, j] = by[XX] * x + by[XY] * y, by[XY] * x + by[YY] * y


@kernel
def _weigh(
    c: int, k: int, along: float, across: float, seen: ContactSet, solids: Solids, d: int, terms: Terms
) -> None:
    """Scale the rows of a contact that resists turning, so that one friction bounds all of its forces."""
    slide, other, twist, roll, beside = _frictions(c, seen, solids)
    unit, begin = _unit(slide, other, twist, roll, beside), seen.first[seen.address[c]]
    for i in range(1, min(d, seen.dim[c])):
        own = max(slide, other) if i < 3 else twist if i == 3 else max(roll, beside)
        part = own / unit if unit > 0.0 else 1.0
        for e in range(begin, begin + seen.entries[seen.address[c]]):
            terms.rows[k * d + i, place_in(terms.entries.rows, k, seen.column[e])] *= part
    if d > 4 and seen.dim[c] > 4 and roll != beside:
        most = max(roll, beside)
        _mix(c, k, k * d + 4, _between(roll / most, beside / most, along, across), seen, terms)


@kernel
def _heading(frame: Reals, slot: int, geom: Ints, solids: Solids, kept: Features) -> tuple[float, float]:
    """Parts of the two tangents that are seen in a feature's first one, which has turned with both bodies."""
    along, across = 0.0, 0.0
    for side in range(2):
        b = solids.body[geom[side]]
        for j in range(3):
            world = 0.0
            for i in range(3):
                world += solids.turn[b, 3 * j + i] * kept.along[slot, 3 * side + i]
            along += world * frame[3 + j]
            across += world * frame[6 + j]
    length = math.hypot(along, across)
    return (along / length, across / length) if length > 0.0 else (1.0, 0.0)


@kernel
def _frictions(c: int, seen: ContactSet, solids: Solids) -> tuple[float, float, float, float, float]:
    """Friction of a contact as MuJoCo has it: sliding along two tangents, torsional, and rolling about these.
    That of its law, alike along both, and in place of what it does not give the model's, which changes as
    sliding friction does."""
    law = solids.laws[solids.law[seen.geom[c, 0], seen.geom[c, 1]]]
    own = seen.friction[c, 0]
    slide = own if math.isnan(law[5]) else law[5]
    other = seen.friction[c, 1] if math.isnan(law[5]) else law[5]
    part = slide / own if own > 0.0 else 1.0
    twist = part * seen.friction[c, 2] if math.isnan(law[6]) else law[6]
    roll = part * seen.friction[c, 3] if math.isnan(law[7]) else law[7]
    beside = part * seen.friction[c, 4] if math.isnan(law[7]) else law[7]
    return slide, other, twist, roll, beside


@kernel
def _unit(slide: float, other: float, twist: float, roll: float, beside: float) -> float:
    """The friction that a contact's rows are scaled for: of sliding, where there is any."""
    slides = max(slide, other)
    return slides if slides > 0.0 else max(twist, max(roll, beside))


@kernel
def _fill_law(
    c: int, k: int, slot: int, seen: ContactSet, solids: Solids, found: Features, d: int, terms: Terms
) -> None:
    law = solids.laws[solids.law[seen.geom[c, 0], seen.geom[c, 1]]]
    terms.gap[k], terms.lever[k] = seen.dist[c], 1.0
    slide, other, twist, roll, beside = _frictions(c, seen, solids)
    found.world[slot, 10] = max(slide, other) if seen.dim[c] > 1 else 0.0
    unit = _unit(slide, other, twist, roll, beside)
    terms.friction[k] = unit if seen.dim[c] > 3 else found.world[slot, 10]
    terms.restitution[k] = law[4]
    for i in range(d):
        for j in range(d):
            terms.contact_stiffness[k, i, j] = terms.contact_damping[k, i, j] = 0.0
        terms.contact_stiffness[k, i, i] = law[0] if i == 0 else law[1]
        terms.contact_damping[k, i, i] = law[2] if i == 0 else law[3]
    if is_skew(terms.skew):
        x, y = widened(terms.skew, k, 1.0, 0.0)
        xx, xy = widened(terms.skew, k, x, y)
        x, y = widened(terms.skew, k, 0.0, 1.0)
        _, yy = widened(terms.skew, k, x, y)
        _fill_block(k, law[1] * xx, law[1] * xy, law[1] * yy, terms.contact_stiffness)
        _fill_block(k, law[3] * xx, law[3] * xy, law[3] * yy, terms.contact_damping)


@inner_kernel
def _fill_block(k: int, xx: float, xy: float, yy: float, matrices: Reals) -> None:
    """Fill in the part of a contact's matrix that belongs to slip."""
    matrices[k, 1, 1], matrices[k, 2, 2] = xx, yy
    matrices[k, 1, 2] = matrices[k, 2, 1] = xy
