"""How an object moves in a contact mode, and the forces with which it does.

An object that supports carry moves as the forces of its fingers make it, by the normal of the limit surface;
others move as their fingers lead them, and forces balance their weight. Sliding contacts push against the
slip with all their friction; those that stick, and fingers, keep a reserve of it. Forces are least squares
over the edges of the cones (Lawson and Hanson 1974).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.forces.cones import (
    PART,
    SLIDE,
    STICK,
    Memory,
    balances,
    center,
    contact_edges,
    grip,
    presses,
    see,
)  # fmt: skip
from rungwise.planning.modes.forces.drag import STANDS, Lying, lying
from rungwise.planning.modes.forces.mode_motions import (
    GAIN,
    KEPT,
    LONGEST,
    every_mode,
    leans,
    projected,
    pushed,
    turn,
)
from rungwise.planning.modes.grips import Grip, bind, grips, touching
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.world.carriers import frame_of

LED = 1e-4
"""Motion, per length, that contacts and fingers are to resist where they lead an object alone."""
SETTLED, LOADINGS = 0.01, 30
"""Part of the weight that may be out of balance, so that friction of a support, by its load and its slips, is
not sought anew; and how often it is at most."""


class Motion(NamedTuple):
    """A change (k,) of the object, what fingers press with on their own coordinates (n,), and the contacts by
    which they are led (f,)."""

    change: Reals
    pushes: Reals
    led: Ints


def modes(ground: Ground, seen: Seen, want: Reals) -> list[tuple[tuple[int, ...], Reals]]:
    """Modes of the closed contacts (e,), with the motion of each, over units, that is nearest to the wanted
    one (k,); those first that make most of it."""
    memory, count = _seen(ground, seen), len(seen.closed)
    found = every_mode(count, want, memory)
    motions = memory.motions[:found].copy()
    order = np.argsort(-(motions @ want), kind="stable")
    kinds = memory.modes[:found, :count].copy()
    if ground.pushes:
        slips = np.abs(motions @ memory.tangents[:count].T)
        kinds[(kinds == SLIDE) & (slips <= KEPT * np.linalg.norm(motions, axis=1)[:, None])] = STICK
    return [(tuple(kinds[k].tolist()), motions[k]) for k in order]


def is_led(ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...]) -> bool:
    """Whether fingers (f,) and kept contacts leave the object no other motion."""
    return is_led_by(ground, seen, grips(ground, seen, used)[0], np.array(mode, np.int64))


def is_led_by(ground: Ground, seen: Seen, grip: Grip, kinds: Ints) -> bool:
    """See `is_led`, of fingers that hold the object so."""
    touches, held, kept = seen.touches, grip.contacts, seen.closed[kinds != PART]
    normals = touches.rows[[*kept, *held], 0]
    tangents = touches.rows[[*seen.closed[kinds == STICK], *held], 1:].reshape(-1, normals.shape[1])
    rows = np.vstack([normals, tangents])[:, ground.columns] / ground.units
    return int(np.linalg.matrix_rank(rows, tol=LED)) == len(ground.columns)


def drags(ground: Ground, seen: Seen, mode: tuple[int, ...]) -> bool:
    """Whether the object rests on contacts that slide in a mode, so that their friction tells its motion
    where fingers leave it several."""
    return _dragged(ground, seen, np.array(mode, np.int64)) is not None


def _dragged(ground: Ground, seen: Seen, mode: Ints) -> tuple[Reals, float] | None:
    """See `drags`: the support that contacts are under the weight alone; None in the plane, where fingers
    lead all motions."""
    lies = _lying(ground, seen, mode)
    forces = None if lies is None else lies.normal_forces(np.zeros(len(ground.columns)))
    return None if lies is None or forces is None else lies.support(forces)


def _lying(ground: Ground, seen: Seen, mode: Ints) -> Lying | None:
    """The contacts on which an object in space lies in a mode; None in the plane, and where nothing presses
    on any. Those that modes do not tell apart do what those of their face do, and slide where it turns."""
    if not len(ground.turns):
        return None
    touches, beside = seen.touches, seen.touches.beside
    kinds, faces = np.full(len(beside.faces), PART), touches.faces[seen.closed]
    for k in np.flatnonzero(beside.gaps < ground.closed):
        own = mode[faces == beside.faces[k]]
        if len(own) and (own != PART).all():
            kinds[k] = STICK if (own == STICK).all() else SLIDE
    every = np.concatenate([touches.rows[seen.closed], beside.rows])[:, :, ground.columns] / ground.units
    return lying(
        np.concatenate([mode, kinds]), every[:, 0], every[:, 1:],
        np.concatenate([touches.friction[seen.closed], beside.friction]),
        touches.loads[ground.columns] / ground.units,
    )  # fmt: skip


def carried(ground: Ground, seen: Seen) -> tuple[Reals, float] | None:
    """The rows (r, k) of the support under the object, over its units, and the greatest force; None where
    there is none. Of two objects, one of which pushes the other, those with the lesser force count less: as
    if both moved at one speed."""
    if not len(ground.supporting):
        return None
    surfaces = seen.touches.supports
    rows = surfaces.rows[ground.supporting[:, None], ground.columns] / ground.units
    limits = surfaces.limits[ground.supporting]
    if ground.pushes:
        rows = rows * np.sqrt(limits / limits.max())[:, None]
    return rows, float(limits.max())


def motion(
    ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, press: float
) -> Motion | None:
    """How the object moves in a mode where it wants to go by `want` (k,), over units, and how fingers push,
    at least with this part of the load; None where it does not, or nothing balances."""
    for held in grips(ground, seen, used):
        found = _held_motion(ground, seen, held, np.array(mode, np.int64), want, press)
        if found is not None and _opens(ground, seen, used, found):
            return found
    return None


def _held_motion(
    ground: Ground, seen: Seen, held: Grip, mode: Ints, want: Reals, press: float
) -> Motion | None:
    """See `motion`, of an object that is held so."""
    support, memory = carried(ground, seen), _seen(ground, seen)
    bind(ground, seen, held, memory)
    if support is None and len(ground.turns) and not is_led_by(ground, seen, held, mode):
        return _dragging(ground, seen, held, mode, want, memory)
    if support is not None:
        return _on_support(ground, seen, held, mode, want, support, memory)
    change = np.empty(len(want))
    if not projected(mode, want, change, memory) or change @ want < GAIN * float(want @ want):
        return None
    pushes = _balanced(ground, seen, held, mode, change, press, memory)
    if pushes is None or not _is_settled(ground, seen, held, mode, change, memory):
        return None
    return Motion(change / ground.units, pushes, held.led)


def _dragging(
    ground: Ground, seen: Seen, held: Grip, mode: Ints, want: Reals, memory: Memory
) -> Motion | None:
    """See `motion`, of an object that fingers drag over the contacts on which it lies: these are a support by
    the slips of the motion, and under the forces of the push, that come of it; None where no force is enough,
    as where the object sticks to its support rather than to its fingers."""
    lies, wrench, change = _lying(ground, seen, mode), np.zeros(len(want)), np.zeros(len(want))
    slips: Reals | None = None
    found: Motion | None = None
    memory.friction[: len(mode)][mode == SLIDE] = 0.0
    if lies is None:
        return None
    for within in (*[SETTLED] * LOADINGS, STANDS):
        forces = lies.normal_forces(wrench)
        if forces is None:
            return None
        if found is not None and lies.stands(forces, wrench, change, within):
            return found
        support = lies.support(forces, slips)
        found = support and _on_support(ground, seen, held, mode, want, support, memory)
        if found is None:
            return None
        change, wrench = found.change * ground.units, _wrench(held, memory)
        now = lies.slips(change)
        slips = now if slips is None else 0.5 * (slips + now)
    return None


def _wrench(held: Grip, memory: Memory) -> Reals:
    """The force (k,) of fingers on the object, over units."""
    count = len(memory.ring) * len(held.contacts)
    return np.asarray(memory.share[:count] @ memory.edges[:count])


def _is_settled(ground: Ground, seen: Seen, held: Grip, mode: Ints, change: Reals, memory: Memory) -> bool:
    """Whether contacts of an object in space that are to stick, and without which fingers would leave it
    other motions, stick by the normal forces that they have where all contacts yield alike."""
    if not len(ground.turns) or not (mode == STICK).any() or not change.any():
        return True
    if is_led_by(ground, seen, held, np.where(mode == STICK, SLIDE, mode)):
        return True
    wrench, lies = _wrench(held, memory), _lying(ground, seen, mode)
    forces = None if lies is None else lies.normal_forces(wrench)
    if lies is None or forces is None:
        return lies is None
    return lies.stands(forces, wrench, change, reserve=ground.fingers[0].reserve)


def _opens(ground: Ground, seen: Seen, used: Ints, found: Motion) -> bool:
    """Whether contacts of fingers that touch at several places, and do not press at all of them, open, or are
    kept."""
    if not ground.is_wide:
        return True
    every = [k for f in np.flatnonzero(used) for k in touching(ground, seen, int(f))]
    if len(every) == int((found.led >= 0).sum()):
        return True
    change = ground.around.change(seen.q, ground.moved(seen, found.change, used, found.led))
    rates = seen.touches.rows[every, 0] @ change
    return bool(rates.min() >= -KEPT * float(np.linalg.norm(found.change * ground.units)))


def could(
    ground: Ground, seen: Seen, mode: tuple[int, ...], want: Reals, press: float
) -> Callable[[Reals, bool], bool] | None:  # fmt: skip
    """Whether forces of fingers along edges (m, k), over units, make a mode where the object wants to go by
    `want` (k,), and with `pressing` each with at least its part of the load; None where the mode does not."""
    support, kinds, hoped = carried(ground, seen), np.array(mode, np.int64), np.empty(len(want))
    memory = _seen(ground, seen)
    if not projected(kinds, want, hoped, memory) or hoped @ want < GAIN * float(want @ want):
        return None
    weight = seen.touches.loads[ground.columns] / ground.units
    borrowed = _dragged(ground, seen, kinds) if support is None else None
    if borrowed is not None:
        memory.friction[: len(kinds)][kinds == SLIDE] = 0.0
    slid = memory.edges[: contact_edges(kinds, hoped, 0.0, memory, 0)].copy()
    memory = _seen(ground, seen)
    end = contact_edges(kinds, hoped, ground.fingers[0].reserve, memory, 0)
    others = memory.edges[:end].copy()
    scale = _scale(ground, weight)

    def makes(edges: Reals, pressing: bool) -> bool:
        memory, count = _seen(ground, seen, len(edges) + end), len(edges)
        if support is not None:
            turn(support[0], memory)
        memory.edges[:count], memory.edges[count : count + end] = edges, others
        if support is not None:
            return leans(count + end, kinds, want, memory)
        least = np.full(count, press * scale / len(memory.ring) if pressing else 0.0)
        if balances(count + end, count // len(memory.ring), weight, scale, least, memory):
            return True
        if borrowed is None:
            return False
        turn(borrowed[0], memory)
        memory.edges[count : count + len(slid)] = slid
        return leans(count + len(slid), kinds, want, memory)

    return makes


def finger_edges(ground: Ground, seen: Seen, parts: Reals) -> Reals:
    """Edges (m, s, k), over units, of the forces on a free object of a finger that touches at parts (m,)
    of its outline, with the friction of the first finger that may touch it."""
    _, turned = frame_of(seen.touches.poses[ground.body])
    points, normals = ground.around.outline(ground.body)(parts)
    rows = ground.around.rows(seen.q, ground.body, points, -normals @ turned.T)[:, :, ground.columns]
    f = int(np.flatnonzero(ground.own >= 0)[0])
    mu = (1.0 - ground.fingers[f].reserve) * ground.frictions[f]
    ring = ground.memory(0).ring
    if ground.around.tangents > 2:
        rows[:, 3] *= ground.twists[f]
    edges = [rows[:, 0] + mu * np.tensordot(own, rows[:, 1:], (0, 1)) for own in ring]
    return np.asarray(np.stack(edges, axis=1) / ground.units)


def held_edges(ground: Ground, seen: Seen, used: Ints) -> Reals:
    """Edges (s f, k), over units, of the forces of fingers that hold the object (f,)."""
    memory = _seen(ground, seen)
    count = _gripped(ground, seen, grips(ground, seen, used)[0], memory)
    return memory.edges[: len(memory.ring) * count].copy()


def rests(ground: Ground, seen: Seen, used: Ints, press: float = 0.0) -> Reals | None:
    """What fingers (f,) press with on their coordinates (n,) where the object rests between them; None where
    it cannot."""
    if carried(ground, seen) is not None:
        return np.zeros(len(seen.q))
    still, sticks = np.zeros(len(ground.columns)), np.full(len(seen.closed), STICK)
    return _balanced(ground, seen, grips(ground, seen, used)[0], sticks, still, press, _seen(ground, seen))


def _seen(ground: Ground, seen: Seen, edges: int = 0) -> Memory:
    """Memory in which the contacts of the object with its surroundings are written."""
    memory, touches = ground.memory(len(seen.closed), edges), seen.touches
    see(touches.rows, touches.friction, seen.closed, ground.columns, ground.units, memory)
    memory.bounds[0] = 0
    return memory


def _gripped(ground: Ground, seen: Seen, held: Grip, memory: Memory) -> int:
    """Write the edges of fingers that hold the object; at how many contacts they do."""
    touches, kept = seen.touches, ground.kept[held.of]
    return grip(touches.rows, touches.friction, held.contacts, kept, ground.columns, ground.units, memory)


def _balanced(
    ground: Ground, seen: Seen, held: Grip, mode: Ints, change: Reals, least: float, memory: Memory
) -> Reals | None:  # fmt: skip
    """What fingers press with, on their own coordinates (n,), at least with this part of the load, where they
    hold the object so, and they and forces at the contacts that a mode keeps balance what acts on it; None
    where nothing does."""
    weight = seen.touches.loads[ground.columns] / ground.units
    scale, count = _scale(ground, weight), _gripped(ground, seen, held, memory)
    sides = len(memory.ring)
    own = np.repeat([max(least * scale, ground.fingers[f].press[0]) for f in held.of], sides) / sides
    end = contact_edges(mode, change, ground.fingers[0].reserve, memory, sides * count)
    if not balances(end, count, weight, scale, own, memory):
        return None
    center(end, count, scale, own, memory)
    touches, kept = seen.touches, ground.kept[held.of]
    holds = presses(
        touches.rows, touches.friction, held.contacts, held.of, kept, ground.strongest, LONGEST * scale,
        memory,
    )  # fmt: skip
    return memory.pushes.copy() if holds else None


def _scale(ground: Ground, weight: Reals) -> float:
    """The size of the forces about an object of this weight (k,)."""
    pressing = max((finger.press[0] for finger in ground.fingers), default=0.0)
    return float(np.linalg.norm(weight)) or pressing or 1.0


def _on_support(
    ground: Ground, seen: Seen, held: Grip, mode: Ints, want: Reals, support: tuple[Reals, float],
    memory: Memory,
) -> Motion | None:  # fmt: skip
    """The motion of an object on a support: along A G x for forces x of at least 0 along edges G, where
    A = (S^T S)^-1 turns forces into motions by the limit surface with rows S."""
    rows, limit = support
    touches, kept = seen.touches, ground.kept[held.of]
    moves = pushed(
        touches.rows, touches.friction, held.contacts, held.of, kept, ground.columns, ground.units, mode,
        want, rows, limit, ground.fingers[0].reserve, ground.strongest, memory,
    )  # fmt: skip
    if not moves:
        return None
    more = _both(ground, seen, rows @ memory.change) if ground.pushes else 1.0
    return Motion(memory.change / ground.units, more * memory.pushes, held.led)


def _both(ground: Ground, seen: Seen, rates: Reals) -> float:
    """How many times the greatest force of a support two objects take as they slide so, by the rates (r,) of
    the weighed rows of their supports."""
    surfaces = seen.touches.supports
    limits = surfaces.limits[ground.supporting]
    of_last = np.abs(surfaces.rows[ground.supporting[:, None], ground.columns[ground.aims]]).max(axis=1) > 0.0
    total = 0.0
    for own in (of_last, ~of_last):
        if own.any():
            total += math.sqrt(limits[own].max() / limits.max()) * float(np.linalg.norm(rates[own]))
    return total / float(np.linalg.norm(rates))
