"""Least squares over the edges of friction cones, and motions of contact modes, compiled.

Forces are least squares with coefficients of at least 0 (Lawson and Hanson, Solving Least Squares Problems,
1974, chapter 23), with an orthonormal basis of the columns in use. Sizes: k coordinates of the object, e
contacts, f fingers, m edges, d rows of a problem; t tangents of a contact, 1 in the plane, 2 in space and 3
with torsion, and s edges of its cone, 2, 8 or 10.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, inner_kernel, kernel
from rungwise.system.products import dot

PART, SLIDE, STICK = 0, 1, 2
"""What a contact does in a mode; which way it slides follows from the motion."""
MOST = 6
"""Contacts of which modes are told apart; more are kept or parted together with the nearest of these."""
EDGES = 8
"""Edges of a cone in space, within it."""
TINY, UNBALANCED = 1e-9, 1e-6
"""Slip, over the motion, that counts as none; force, over the load, that counts as balanced."""
AMID = 3e-3
"""Weight of the forces themselves, beside their balance: of all that balance the least, amid the cones."""
RANK = 1e-7
"""Part of a column below which what is left of it counts as none, and of the first row below which others
count as dependent."""
_ROUNDING, _ROUNDS = 1e-11, 3
"""Part of what is wanted along a column that counts as none; and how often, for each column, one is taken."""


class Memory(Block):
    """Memory of these kernels, and what they answer. normals (e, k), tangents (e t, k), friction (e,): of the
    object's contacts, over its units; ring (s, t): the directions of the edges of cones; bound (r, k):
    directions in which it may not change, of which the first `bounds` (1,) hold; edges (m, k): of forces on
    it, those of fingers first; share (m,): of each in the force; change (k,): of the object; pushes (n,): of
    fingers on their own coordinates."""

    normals: Reals
    tangents: Reals
    friction: Reals
    columns: Reals
    wanted: Reals
    left: Reals
    sizes: Reals
    share: Reals
    trial: Reals
    lengths: Reals
    basis: Reals
    factor: Reals
    passive: Ints
    inside: Ints
    held: Reals
    axes: Reals
    turned: Reals
    bound: Reals
    bounds: Ints
    edges: Reals
    change: Reals
    hoped: Reals
    pushes: Reals
    modes: Ints
    motions: Reals
    ring: Reals


def ring_of(tangents: int) -> Reals:
    """Directions (s, t) of the edges of a cone."""
    if tangents == 1:
        return np.array([[1.0], [-1.0]])
    angles = np.arange(EDGES) * (2.0 * math.pi / EDGES)
    slides = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if tangents == 2:
        return slides
    return np.vstack([np.pad(slides, ((0, 0), (0, 1))), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


def memory_for(
    contacts: int, fingers: int, edges: int, size: int, coordinates: int, tangents: int = 1
) -> Memory:
    """Memory for so many contacts, fingers and edges, of an object of `size` coordinates, of all
    `coordinates`."""
    ring = ring_of(tangents)
    own = len(ring) * (contacts + fingers)
    rows, edges = size + 2 * own + 1, max(own, edges) + 1
    told = min(contacts, MOST)
    most = 2**told * (told + 2)
    shapes: dict[str, tuple[int, ...]] = {
        "normals": (contacts, size), "tangents": (tangents * contacts, size), "friction": (contacts,),
        "columns": (edges, rows), "wanted": (rows,), "left": (rows,), "sizes": (edges,), "share": (edges,),
        "trial": (edges,), "lengths": (edges,), "basis": (edges, rows), "factor": (edges, edges),
        "passive": (edges,), "inside": (edges,), "held": ((1 + tangents) * contacts + size + 1, size),
        "axes": (size, size),
        "turned": (size, size), "bound": (size, size), "bounds": (1,),
        "edges": (edges, size), "change": (size,), "hoped": (size,),
        "pushes": (coordinates,), "modes": (most, contacts), "motions": (most, size),
    }  # fmt: skip
    kinds = {
        name: np.int64 if name in ("passive", "inside", "bounds", "modes") else np.float64 for name in shapes
    }
    return Memory(**{name: np.zeros(shape, kinds[name]) for name, shape in shapes.items()}, ring=ring)


@kernel
def see(
    rows: Reals, friction: Reals, which: Ints, columns: Ints, units: Reals, memory: Memory
) -> None:  # fmt: skip
    """Write normals, tangents and friction of some contacts (e,) of all (c,) with these rows (c, d, n)."""
    tangents = memory.ring.shape[1]
    for i in range(which.shape[0]):
        for c in range(columns.shape[0]):
            memory.normals[i, c] = rows[which[i], 0, columns[c]] / units[c]
            for t in range(tangents):
                memory.tangents[i * tangents + t, c] = rows[which[i], 1 + t, columns[c]] / units[c]
        memory.friction[i] = friction[which[i]]


@kernel
def grip(
    rows: Reals, friction: Reals, held: Ints, kept: Reals, columns: Ints, units: Reals, memory: Memory
) -> int:  # fmt: skip
    """Write the edges of fingers that touch at contacts (f,), -1 for none, and use a part of their friction
    (f,); returns how many fingers these are."""
    count, sides = 0, memory.ring.shape[0]
    for f in range(held.shape[0]):
        if held[f] < 0:
            continue
        mu = kept[f] * friction[held[f]]
        for side in range(sides):
            for c in range(columns.shape[0]):
                own = rows[held[f], 0, columns[c]]
                for t in range(memory.ring.shape[1]):
                    own += mu * memory.ring[side, t] * rows[held[f], 1 + t, columns[c]]
                memory.edges[sides * count + side, c] = own / units[c]
        count += 1
    return count


@kernel
def presses(
    rows: Reals, friction: Reals, held: Ints, of: Ints, kept: Reals, strongest: Reals, most: float,
    memory: Memory,
) -> bool:  # fmt: skip
    """Write the `pushes` of fingers `of` (g,) at contacts (g,) from the `share` of their edges; False where a
    finger is too weak (f,), or would push with more than `most` at a contact."""
    count, sides, total, finger = 0, memory.ring.shape[0], 0.0, -1
    for c in range(memory.pushes.shape[0]):
        memory.pushes[c] = 0.0
    for f in range(held.shape[0]):
        if held[f] < 0:
            continue
        normal = pressed(count, memory)
        total, finger = normal if of[f] != finger else total + normal, of[f]
        if normal > most or total > strongest[finger]:
            return False
        mu = kept[f] * friction[held[f]]
        for side in range(sides):
            for c in range(memory.pushes.shape[0]):
                own = rows[held[f], 0, c]
                for t in range(memory.ring.shape[1]):
                    own += mu * memory.ring[side, t] * rows[held[f], 1 + t, c]
                memory.pushes[c] -= memory.share[sides * count + side] * own
        count += 1
    return True


@kernel
def pressed(f: int, memory: Memory) -> float:
    """The normal force of a finger, from the `share` of its edges, which come first."""
    total, sides = 0.0, memory.ring.shape[0]
    for side in range(sides):
        total += memory.share[sides * f + side]
    return total


@kernel
def nonnegative(m: int, d: int, memory: Memory) -> float:
    """Coefficients of at least 0 (m,), in `share`, with which `columns` (m, d) come nearest to `wanted` (d,);
    returns the distance, which is `left` (d,)."""
    columns, left, inside, share = memory.columns, memory.left, memory.inside, memory.share
    size, count = 0.0, 0
    for i in range(d):
        left[i] = memory.wanted[i]
        size += left[i] * left[i]
    size = math.sqrt(size)
    for j in range(m):
        share[j], inside[j], total = 0.0, 0, 0.0
        for i in range(d):
            total += columns[j, i] * columns[j, i]
        memory.sizes[j] = math.sqrt(total)
    for _ in range(_ROUNDS * m):
        best, which = _ROUNDING * size, -1
        for j in range(m):
            if inside[j] == 0 and memory.sizes[j] > 0.0:
                along = dot(columns[j], left, d) / memory.sizes[j]
                if along > best:
                    best, which = along, j
        if which < 0:
            break
        if count == d or not _joined(which, count, d, memory):
            inside[which] = -1
            continue
        memory.passive[count], inside[which] = which, 1
        taken = _settled(count + 1, d, memory)
        if taken == 0:
            inside[which] = -1
            continue
        count = taken
        for j in range(m):
            if inside[j] < 0:
                inside[j] = 0
        for i in range(d):
            left[i] = memory.wanted[i]
        for i in range(count):
            j = memory.passive[i]
            for r in range(d):
                left[r] -= share[j] * columns[j, r]
    return math.sqrt(dot(left, left, d))


@kernel
def _joined(j: int, count: int, d: int, memory: Memory) -> bool:
    """Take a column into the basis as the last of so many and one; False where it depends on these."""
    basis, factor = memory.basis, memory.factor
    for i in range(d):
        basis[count, i] = memory.columns[j, i]
    for i in range(count):
        factor[i, count] = 0.0
    for _ in range(2):
        for i in range(count):
            along = dot(basis[i], basis[count], d)
            factor[i, count] += along
            for r in range(d):
                basis[count, r] -= along * basis[i, r]
    norm = math.sqrt(dot(basis[count], basis[count], d))
    if not norm > RANK * memory.sizes[j]:
        return False
    factor[count, count] = norm
    for i in range(d):
        basis[count, i] /= norm
    return True


@kernel
def _settled(count: int, d: int, memory: Memory) -> int:
    """Least squares over the columns in use, of which those that would be negative are given up, the last of
    them never; returns how many are left, or 0 where rounding alone brought the last one in."""
    passive, share, trial = memory.passive, memory.share, memory.trial
    first = True
    while True:
        for i in range(count - 1, -1, -1):
            total = dot(memory.basis[i], memory.wanted, d)
            for j in range(i + 1, count):
                total -= memory.factor[i, j] * trial[j]
            trial[i] = total / memory.factor[i, i]
        if first and not trial[count - 1] > 0.0:
            return 0
        first, part, worst = False, 1.0, -1
        for i in range(count):
            if not trial[i] > 0.0:
                before = share[passive[i]]
                own = before / (before - trial[i]) if before > trial[i] else 0.0
                if worst < 0 or own < part:
                    part, worst = own, i
        if worst < 0:
            for i in range(count):
                share[passive[i]] = trial[i]
            return count
        kept = 0
        for i in range(count):
            j = passive[i]
            share[j] += part * (trial[i] - share[j])
            if i == worst or not share[j] > 0.0:
                share[j], memory.inside[j] = 0.0, 0
            elif _joined(j, kept, d, memory):
                passive[kept] = j
                kept += 1
            else:
                share[j], memory.inside[j] = 0.0, 0
        count = kept
        if count == 0:
            return 0


@kernel
def contact_edges(mode: Ints, change: Reals, reserve: float, memory: Memory, begin: int) -> int:
    """Write the edges of the forces at contacts that a mode keeps into `edges`, from `begin` on: both of the
    cone, or the one against the slip by a change (k,). Returns where they end."""
    normals, tangents, friction, ring = memory.normals, memory.tangents, memory.friction, memory.ring
    size, width, count = change.shape[0], ring.shape[1], begin
    tol = TINY * (1.0 + math.sqrt(dot(change, change, size)))
    for i in range(mode.shape[0]):
        if mode[i] == PART:
            continue
        slip = slip_of(i, change, memory)
        sticks = mode[i] == STICK or slip <= tol
        for side in range(ring.shape[0] if sticks else 1):
            for c in range(size):
                own = normals[i, c]
                for t in range(width):
                    mu = (1.0 - reserve) * friction[i] * ring[side, t]
                    if not sticks:
                        mu = -friction[i] * (dot(tangents[i * width + t], change, size) / slip)
                    own += mu * tangents[i * width + t, c]
                memory.edges[count, c] = own
            count += 1
    return count


@inner_kernel
def slip_of(i: int, change: Reals, memory: Memory) -> float:
    """How far a contact slips in a change (k,)."""
    size, width, total = change.shape[0], memory.ring.shape[1], 0.0
    for t in range(width):
        own = dot(memory.tangents[i * width + t], change, size)
        total += own * own
    return math.sqrt(total)


@kernel
def balances(m: int, fingers: int, weight: Reals, scale: float, least: Reals, memory: Memory) -> bool:
    """Whether forces along `edges` (m, k), each of those of fingers at least `least` (s f,), balance a weight
    (k,)."""
    size, total = weight.shape[0], 0.0
    for c in range(size):
        memory.wanted[c] = -weight[c] / scale
        for j in range(memory.ring.shape[0] * fingers):
            memory.wanted[c] -= least[j] * memory.edges[j, c] / scale
        total += memory.wanted[c] * memory.wanted[c]
    for j in range(m):
        for c in range(size):
            memory.columns[j, c] = memory.edges[j, c]
    return nonnegative(m, size, memory) <= UNBALANCED * (1.0 + math.sqrt(total))


@kernel
def center(m: int, fingers: int, scale: float, least: Reals, memory: Memory) -> None:
    """After `balances`: the `share` of each edge in the least of all forces that balance, amid the cones."""
    size = memory.change.shape[0]
    for j in range(m):
        memory.wanted[size + j] = 0.0
        for i in range(m):
            memory.columns[j, size + i] = AMID if i == j else 0.0
    nonnegative(m, size + m, memory)
    for j in range(m):
        memory.share[j] = scale * memory.share[j] + (least[j] if j < memory.ring.shape[0] * fingers else 0.0)
