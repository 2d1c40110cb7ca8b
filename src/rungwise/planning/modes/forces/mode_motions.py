"""Motions of contact modes, compiled: projections, all modes of some contacts, limit surfaces of supports."""

from __future__ import annotations

import math

from rungwise.contact.linear import invert
from rungwise.kernel import Ints, Reals, kernel
from rungwise.planning.modes.forces.cones import (
    AMID,
    MOST,
    PART,
    RANK,
    SLIDE,
    STICK,
    TINY,
    Memory,
    contact_edges,
    grip,
    nonnegative,
    pressed,
    presses,
)  # fmt: skip
from rungwise.system.products import dot

RIGIDLY = 1e3
"""Weight with which contacts of an object on supports are kept."""
GAIN = 1e-3
"""Part of the wanted motion, squared, that a mode must make."""
KEPT, WEAK = 1e-4, 1e-3
"""Motion of an object on supports against contacts that are kept, in parts of the wanted one, that counts as
none; and the part of the strongest finger's force with which others press at least."""
LONGEST = 20.0
"""Forces of fingers without a limit, in parts of the load."""
_LEANS = 1e-6
"""Part of a support's row below which what is left of it counts as none."""
_SAME = 1e-5
"""Parts of motions, beside `TINY`, by which equal ones differ."""


@kernel
def project(count: int, memory: Memory, motion: Reals) -> int:
    """Make a motion (k,) one against which no row of `held` (count, k) works; returns how many of these are
    independent, with their `axes`."""
    held, axes, first = memory.held, memory.axes, 0.0
    size = motion.shape[0]
    for step in range(size):
        best, which = 0.0, -1
        for i in range(count):
            own = dot(held[i], held[i], size)
            if own > best:
                best, which = own, i
        best = math.sqrt(best)
        if step == 0:
            first = best
        if which < 0 or not best > RANK * first:
            return step
        for c in range(size):
            axes[step, c] = held[which, c] / best
        along = dot(axes[step], motion, size)
        for c in range(size):
            motion[c] -= along * axes[step, c]
        for i in range(count):
            along = dot(axes[step], held[i], size)
            for c in range(size):
                held[i, c] -= along * axes[step, c]
    return int(size)


@kernel
def hold(mode: Ints, memory: Memory) -> int:
    """Write the rows that a mode keeps into `held`, and that of what may not change; returns how many there
    are."""
    normals, tangents, width, count = memory.normals, memory.tangents, memory.ring.shape[1], 0
    for i in range(mode.shape[0]):
        if mode[i] != PART:
            for c in range(normals.shape[1]):
                memory.held[count, c] = normals[i, c]
            count += 1
        if mode[i] == STICK:
            for t in range(width):
                for c in range(normals.shape[1]):
                    memory.held[count, c] = tangents[i * width + t, c]
                count += 1
    for i in range(memory.bounds[0]):
        for c in range(normals.shape[1]):
            memory.held[count, c] = memory.bound[i, c]
        count += 1
    return count


@kernel
def projected(mode: Ints, want: Reals, motion: Reals, memory: Memory) -> bool:
    """The motion (k,) of a mode nearest to the wanted one (k,); False where it closes contacts that part."""
    size = want.shape[0]
    for c in range(size):
        motion[c] = want[c]
    project(hold(mode, memory), memory, motion)
    tol = TINY * (1.0 + math.sqrt(dot(motion, motion, size)))
    for i in range(mode.shape[0]):
        if mode[i] == PART and dot(memory.normals[i], motion, size) < -tol:
            return False
    return True


@kernel
def every_mode(contacts: int, want: Reals, memory: Memory) -> int:
    """Modes of so many contacts that make some of the wanted motion (k,), each motion once; returns how many
    there are, with their `modes` and `motions`, those that keep most contacts first."""
    count, found, size = min(contacts, MOST), 0, want.shape[0]
    least, motion = GAIN * dot(want, want, size), memory.hoped
    for number in range(count, -1, -1):
        for kept in range(2**count):
            bits = 0
            for i in range(count):
                bits += (kept >> i) & 1
            if bits != number:
                continue
            for sticking in range(-1, count + 1):
                alone = 0 <= sticking < count
                if (alone and not (kept >> sticking) & 1) or (sticking == count and number < 2):
                    continue
                mode = memory.modes[found, :contacts]
                for i in range(contacts):
                    mode[i] = PART
                    if i < count and (kept >> i) & 1:
                        mode[i] = STICK if sticking in (i, count) else SLIDE
                if not projected(mode, want, motion, memory) or dot(motion, want, size) < least:
                    continue
                if _is_new(motion, found, memory.motions):
                    for c in range(size):
                        memory.motions[found, c] = motion[c]
                    found += 1
                    if found == memory.modes.shape[0]:
                        return found
    return found


@kernel
def _is_new(motion: Reals, count: int, motions: Reals) -> bool:
    for k in range(count):
        same = True
        for c in range(motion.shape[0]):
            same = same and abs(motion[c] - motions[k, c]) <= TINY + _SAME * abs(motions[k, c])
        if same:
            return False
    return True


@kernel
def turn(surface: Reals, memory: Memory) -> None:
    """The matrix `turned` (k, k) by which a support turns forces into motions: (S^T S)^-1 for its rows S (r,
    k), as far as these are independent."""
    size, axes, turned = surface.shape[1], memory.axes, memory.turned
    count = 0
    for step in range(size):
        best, which = 0.0, -1
        for i in range(surface.shape[0]):
            for c in range(size):
                memory.hoped[c] = surface[i, c]
            for j in range(step):
                along = dot(axes[j], memory.hoped, size)
                for c in range(size):
                    memory.hoped[c] -= along * axes[j, c]
            own = dot(memory.hoped, memory.hoped, size)
            if own > best and own > (_LEANS * _LEANS) * dot(surface[i], surface[i], size):
                best, which = own, i
                for c in range(size):
                    memory.change[c] = memory.hoped[c]
        if which < 0:
            break
        for c in range(size):
            axes[step, c] = memory.change[c] / math.sqrt(best)
        count += 1
    gram = memory.factor
    for a in range(count):
        for b in range(count):
            total = 0.0
            for i in range(surface.shape[0]):
                total += dot(axes[a], surface[i], size) * dot(axes[b], surface[i], size)
            gram[a, b] = total
    invert(gram, count)
    for c in range(size):
        for e in range(size):
            total = 0.0
            for a in range(count):
                for b in range(count):
                    total += axes[a, c] * gram[a, b] * axes[b, e]
            turned[c, e] = total


@kernel
def leans(m: int, mode: Ints, want: Reals, memory: Memory) -> bool:
    """Whether forces along `edges` (m, k) move an object on a support in a mode towards where it wants to go
    by `want` (k,): along turned @ edges. Then `change` is its motion, and `share` is what each edge takes of
    the force, to a scale."""
    size, scale = want.shape[0], math.sqrt(dot(want, want, want.shape[0]))
    change, rows = memory.change, hold(mode, memory)
    for j in range(m):
        _slide(j, rows, memory)
    for i in range(size + rows):
        memory.wanted[i] = want[i] / scale if i < size else 0.0
    nonnegative(m, size + rows, memory)
    for c in range(size):
        change[c] = 0.0
        for j in range(m):
            change[c] += scale * memory.share[j] * memory.columns[j, c]
    for j in range(m):
        memory.share[j] = memory.share[j] / memory.lengths[j] if memory.lengths[j] > 0.0 else 0.0
    return dot(change, want, size) >= GAIN * scale * scale


@kernel
def drags(m: int, fingers: int, limit: float, mode: Ints, want: Reals, memory: Memory) -> bool:
    """As `leans`, with the edges of the fingers first, where each of these presses, and the mode is kept; the
    force is then as great as the support's friction, `limit` at most."""
    scale, least, greatest = math.sqrt(dot(want, want, want.shape[0])), math.inf, 0.0
    if not leans(m, mode, want, memory):
        return False
    if fingers > 1 or memory.ring.shape[1] > 1:
        _center(m, hold(mode, memory), scale, memory)
    for f in range(fingers):
        own = pressed(f, memory)
        least, greatest = min(least, own), max(greatest, own)
    if least < WEAK * greatest or not _keeps(mode, hold(mode, memory), scale, memory):
        return False
    total = 0.0
    for c in range(want.shape[0]):
        memory.wanted[c] = 0.0
        for j in range(m):
            memory.wanted[c] += memory.share[j] * memory.edges[j, c]
    for c in range(want.shape[0]):
        total += memory.wanted[c] * dot(memory.turned[c], memory.wanted, want.shape[0])
    for j in range(m):
        memory.share[j] *= limit / math.sqrt(total)
    return True


@kernel
def _center(m: int, rows: int, scale: float, memory: Memory) -> None:
    """After `leans`: of all forces that make the same motion the least, amid the cones, so that all press."""
    size = memory.change.shape[0]
    for i in range(size + rows + m):
        memory.wanted[i] = memory.change[i] / scale if i < size else 0.0
    for j in range(m):
        for i in range(m):
            memory.columns[j, size + rows + i] = AMID if i == j else 0.0
    nonnegative(m, size + rows + m, memory)
    for j in range(m):
        memory.share[j] = memory.share[j] / memory.lengths[j] if memory.lengths[j] > 0.0 else 0.0


@kernel
def _slide(j: int, rows: int, memory: Memory) -> None:
    """The column of an edge: the motion that it makes, of length 1, and what contacts that are kept move by;
    `lengths` is what it was."""
    size, column, total = memory.change.shape[0], memory.columns[j], 0.0
    for c in range(size):
        column[c] = dot(memory.turned[c], memory.edges[j], size)
        total += column[c] * column[c]
    norm = math.sqrt(total)
    if norm <= TINY * math.sqrt(dot(memory.edges[j], memory.edges[j], size)):
        norm = 0.0
    memory.lengths[j] = norm
    for c in range(size):
        column[c] = column[c] / norm if norm > 0.0 else 0.0
    for i in range(rows):
        column[size + i] = RIGIDLY * dot(memory.held[i], column, size)


@kernel
def _keeps(mode: Ints, rows: int, scale: float, memory: Memory) -> bool:
    """Whether `change` keeps the contacts that a mode keeps, closes none, and slides as was hoped."""
    normals, tangents, width, size = (
        memory.normals,
        memory.tangents,
        memory.ring.shape[1],
        memory.change.shape[0],
    )
    for i in range(rows):
        if abs(dot(memory.held[i], memory.change, size)) > KEPT * scale:
            return False
    for i in range(mode.shape[0]):
        if dot(normals[i], memory.change, size) < -KEPT * scale:
            return False
        slips = 0.0
        for t in range(width):
            own = tangents[i * width + t]
            slips += dot(own, memory.change, size) * dot(own, memory.hoped, size)
        if mode[i] == SLIDE and slips < 0.0:
            return False
    return True


@kernel
def pushed(
    rows: Reals, friction: Reals, held: Ints, of: Ints, kept: Reals, columns: Ints, units: Reals, mode: Ints,
    want: Reals, surface: Reals, limit: float, reserve: float, strongest: Reals, memory: Memory,
) -> bool:  # fmt: skip
    """Whether fingers `of` (g,) that touch at contacts (g,), -1 for none, push an object on a support with
    rows `surface` (r, k) in a mode of the contacts that are written; then `change` and `pushes` are known.
    They use a part of their friction (g,), and are so strong (f,)."""
    count = grip(rows, friction, held, kept, columns, units, memory)
    turn(surface, memory)
    if count == 0 or not projected(mode, want, memory.hoped, memory):
        return False
    end = contact_edges(mode, memory.hoped, reserve, memory, memory.ring.shape[0] * count)
    if not drags(end, count, limit, mode, want, memory):
        return False
    return presses(rows, friction, held, of, kept, strongest, LONGEST * limit, memory)
