"""How an object moves in a contact mode, and the forces with which it does.

An object that supports carry moves as the forces of its fingers make it, by the normal of the limit surface;
others move as their fingers lead them, and forces balance their weight. Sliding contacts push against the
slip with all their friction; those that stick, and fingers, keep a reserve of it. Forces are least squares
over the edges of the cones (Lawson and Hanson 1974).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.cones import (
    PART,
    STICK,
    Memory,
    balances,
    center,
    contact_edges,
    grip,
    presses,
    see,
)  # fmt: skip
from rungwise.planning.modes.fingers import Finger
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.motions import GAIN, LONGEST, every_mode, leans, projected, pushed, turn

LED = 1e-4
"""Motion, per length, that contacts and fingers are to resist where they lead an object alone."""


class Motion(NamedTuple):
    """A change (k,) of the object, and what fingers press with on their own coordinates (n,)."""

    change: Reals
    pushes: Reals


def modes(ground: Ground, seen: Seen, want: Reals) -> list[tuple[tuple[int, ...], Reals]]:
    """Modes of the closed contacts (e,), with the motion of each, over units, that is nearest to the wanted
    one (k,); those first that make most of it."""
    memory, count = _seen(ground, seen), len(seen.closed)
    found = every_mode(count, want, memory)
    motions = memory.motions[:found].copy()
    order = np.argsort(-(motions @ want), kind="stable")
    return [(tuple(memory.modes[k, :count].tolist()), motions[k]) for k in order]


def is_led(ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...]) -> bool:
    """Whether fingers (f,) and kept contacts leave the object no other motion."""
    kinds, touches = np.array(mode, int), seen.touches
    held, kept = seen.held[used > 0], seen.closed[kinds != PART]
    normals, tangents = (
        touches.rows[[*kept, *held], 0],
        touches.rows[[*seen.closed[kinds == STICK], *held], 1],
    )
    rows = np.vstack([normals, tangents])[:, ground.columns] / ground.units
    return int(np.linalg.matrix_rank(rows, tol=LED)) == len(ground.columns)


def carried(ground: Ground, seen: Seen) -> tuple[Reals, float] | None:
    """The rows (r, k) of the support under the object, over its units, and the greatest force; None where
    there is none."""
    if not len(ground.supporting):
        return None
    surfaces = seen.touches.supports
    rows = surfaces.rows[ground.supporting[:, None], ground.columns] / ground.units
    return rows, float(surfaces.limits[ground.supporting].max())


def motion(
    ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, press: float
) -> Motion | None:
    """How the object moves in a mode where it wants to go by `want` (k,), over units, and how fingers push,
    at least with this part of the load; None where it does not, or nothing balances."""
    support, memory, kinds = carried(ground, seen), _seen(ground, seen), np.array(mode, np.int64)
    if support is not None:
        return _on_support(ground, seen, used, kinds, want, support, memory)
    change = np.empty(len(want))
    if not projected(kinds, want, change, memory) or change @ want < GAIN * float(want @ want):
        return None
    pushes = _balanced(ground, seen, used, kinds, change, press, memory)
    return None if pushes is None else Motion(change / ground.units, pushes)


def could(
    ground: Ground, seen: Seen, mode: tuple[int, ...], want: Reals, press: float
) -> Callable[[Reals, bool], bool] | None:  # fmt: skip
    """Whether forces of fingers along edges (m, k), over units, make a mode where the object wants to go by
    `want` (k,), and with `pressing` each with at least its part of the load; None where the mode does not."""
    support, kinds, hoped = carried(ground, seen), np.array(mode, np.int64), np.empty(len(want))
    memory = _seen(ground, seen)
    if not projected(kinds, want, hoped, memory) or hoped @ want < GAIN * float(want @ want):
        return None
    end = contact_edges(kinds, hoped, ground.fingers[0].reserve, memory, 0)
    others = memory.edges[:end].copy()
    weight = seen.touches.loads[ground.columns] / ground.units
    scale = _scale(ground, weight)

    def makes(edges: Reals, pressing: bool) -> bool:
        memory, count = _seen(ground, seen, len(edges) + end), len(edges)
        if support is not None:
            turn(support[0], memory)
        memory.edges[:count], memory.edges[count : count + end] = edges, others
        if support is not None:
            return leans(count + end, kinds, want, memory)
        least = np.full(count, 0.5 * press * scale if pressing else 0.0)
        return balances(count + end, count // 2, weight, scale, least, memory)

    return makes


def held_edges(ground: Ground, seen: Seen, used: Ints) -> Reals:
    """Edges (2 f, k), over units, of the forces of fingers that hold the object (f,)."""
    memory = _seen(ground, seen)
    count = _gripped(ground, seen, used, memory)
    return memory.edges[: 2 * count].copy()


def rests(ground: Ground, seen: Seen, used: Ints, press: float = 0.0) -> Reals | None:
    """What fingers (f,) press with on their coordinates (n,) where the object rests between them; None where
    it cannot."""
    if carried(ground, seen) is not None:
        return np.zeros(len(seen.q))
    still, sticks = np.zeros(len(ground.columns)), np.full(len(seen.closed), STICK)
    return _balanced(ground, seen, used, sticks, still, press, _seen(ground, seen))


def _seen(ground: Ground, seen: Seen, edges: int = 0) -> Memory:
    """Memory in which the contacts of the object with its surroundings are written."""
    memory, touches = ground.memory(len(seen.closed), edges), seen.touches
    see(touches.rows, touches.friction, seen.closed, ground.columns, ground.units, memory)
    return memory


def _gripped(ground: Ground, seen: Seen, used: Ints, memory: Memory) -> int:
    """Write the edges of fingers that are used (f,); how many these are."""
    held, touches = np.where(used > 0, seen.held, -1), seen.touches
    return grip(touches.rows, touches.friction, held, ground.kept, ground.columns, ground.units, memory)


def _balanced(
    ground: Ground, seen: Seen, used: Ints, mode: Ints, change: Reals, least: float, memory: Memory
) -> Reals | None:  # fmt: skip
    """What fingers (f,) press with, on their own coordinates (n,), at least with this part of the load, where
    they and forces at the contacts that a mode keeps balance what acts on the object; None where nothing
    does."""
    weight = seen.touches.loads[ground.columns] / ground.units
    scale, count = _scale(ground, weight), _gripped(ground, seen, used, memory)
    own = 0.5 * np.repeat([max(least * scale, finger.press[0]) for finger in _of(ground, used)], 2)
    end = contact_edges(mode, change, ground.fingers[0].reserve, memory, 2 * count)
    if not balances(end, count, weight, scale, own, memory):
        return None
    center(end, count, scale, own, memory)
    held, touches = np.where(used > 0, seen.held, -1), seen.touches
    holds = presses(
        touches.rows, touches.friction, held, ground.kept, ground.strongest, LONGEST * scale, memory
    )  # fmt: skip
    return memory.pushes.copy() if holds else None


def _scale(ground: Ground, weight: Reals) -> float:
    """The size of the forces about an object of this weight (k,)."""
    pressing = max((finger.press[0] for finger in ground.fingers), default=0.0)
    return float(np.linalg.norm(weight)) or pressing or 1.0


def _of(ground: Ground, used: Ints) -> list[Finger]:
    return [ground.fingers[f] for f in np.flatnonzero(used)]


def _on_support(
    ground: Ground, seen: Seen, used: Ints, mode: Ints, want: Reals, support: tuple[Reals, float],
    memory: Memory,
) -> Motion | None:  # fmt: skip
    """The motion of an object on a support: along A G x for forces x of at least 0 along edges G, where
    A = (S^T S)^-1 turns forces into motions by the limit surface with rows S."""
    rows, limit = support
    held, touches = np.where(used > 0, seen.held, -1), seen.touches
    moves = pushed(
        touches.rows, touches.friction, held, ground.kept, ground.columns, ground.units, mode, want, rows,
        limit, ground.fingers[0].reserve, ground.strongest, memory,
    )  # fmt: skip
    return Motion(memory.change / ground.units, memory.pushes.copy()) if moves else None
