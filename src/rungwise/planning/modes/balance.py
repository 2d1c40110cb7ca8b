"""How an object moves in a contact mode, and the forces with which it does.

An object that supports carry moves as the forces of its fingers make it, by the normal of the limit surface;
others move as their fingers lead them, and forces balance their weight. Sliding contacts push against the
slip with all their friction; those that stick, and fingers, keep a reserve of it. Forces are least squares
over the edges of the cones (Lawson and Hanson 1974).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.fingers import Finger
from rungwise.planning.modes.ground import Ground, Seen

PART, SLIDE, STICK = 0, 1, 2
"""What a contact does in a mode; which way it slides follows from the motion."""
MOST = 5
"""Contacts of which modes are told apart; more are kept or parted together with the nearest of these."""
TINY, UNBALANCED = 1e-9, 1e-6
"""Slip, over the motion, that counts as none; force, over the load, that counts as balanced."""
AMID = 3e-3
"""Weight of the forces themselves, beside their balance: of all that balance the least, amid the cones."""
RIGIDLY = 1e3
"""Weight with which contacts of an object on supports are kept."""
LONGEST = 20.0
"""Forces of fingers without a limit, in parts of the load."""
GAIN = 1e-3
"""Part of the wanted motion, squared, that a mode must make."""


class Motion(NamedTuple):
    """A change (k,) of the object, and what fingers press with on their own coordinates (n,)."""

    change: Reals
    pushes: Reals


class Rows(NamedTuple):
    """Normals and tangents (e, k) of the object's contacts, over its units; friction (e,)."""

    normals: Reals
    tangents: Reals
    friction: Reals


def rows_of(ground: Ground, seen: Seen, which: Ints) -> Rows:
    """The rows of some contacts (e,)."""
    rows = seen.touches.rows[which][:, :, ground.columns] / ground.units
    return Rows(rows[:, 0], rows[:, 1], seen.touches.friction[which])


def modes(ground: Ground, seen: Seen, want: Reals) -> list[tuple[tuple[int, ...], Reals]]:
    """Modes of the closed contacts (e,), with the motion of each, over units, that is nearest to the wanted
    one (k,); those first that make most of it."""
    own = rows_of(ground, seen, seen.closed)
    count, found = min(len(seen.closed), MOST), list[tuple[float, tuple[int, ...], Reals]]()
    least = GAIN * float(want @ want)
    for kept in chain.from_iterable(combinations(range(count), size) for size in range(count, -1, -1)):
        for sticking in ((), *((k,) for k in kept), *([kept] if len(kept) > 1 else [])):
            mode = tuple(
                STICK if k in sticking else SLIDE if k in kept else PART for k in range(len(seen.closed))
            )
            motion = projected(own, mode, want)
            if motion is None or motion @ want < least:
                continue
            if not any(np.allclose(motion, other, atol=TINY) for _, _, other in found):
                found.append((float(motion @ want), mode, motion))
    found.sort(key=lambda each: -each[0])
    return [(mode, motion) for _, mode, motion in found]


def projected(own: Rows, mode: tuple[int, ...], want: Reals) -> Reals | None:
    """The motion (k,) of a mode nearest to the wanted one; None where it opens or closes other contacts."""
    kept, sticking = np.array(mode, int) != PART, np.array(mode, int) == STICK
    held = np.vstack([own.normals[kept], own.tangents[sticking]])
    motion = want
    if len(held):
        _, sizes, axes = np.linalg.svd(held)
        free = axes[int((sizes > 1e-7 * sizes[0]).sum()) :]
        motion = free.T @ (free @ want)
    tol = TINY * (1.0 + float(np.linalg.norm(motion)))
    if (own.normals[~kept] @ motion < -tol).any():
        return None
    return motion


def is_led(ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...]) -> bool:
    """Whether fingers (f,) and kept contacts leave the object no other motion."""
    own, held = rows_of(ground, seen, seen.closed), rows_of(ground, seen, seen.held[used > 0])
    kinds = np.array(mode, int)
    rows = np.vstack([own.normals[kinds != PART], own.tangents[kinds == STICK], held.normals, held.tangents])
    return int(np.linalg.matrix_rank(rows, tol=1e-4)) == len(ground.columns)


def carried(ground: Ground, seen: Seen) -> tuple[Reals, float] | None:
    """The rows (r, k) of the support under the object, over its units, and the greatest force; None where
    there is none."""
    surfaces = ground.around.supports(seen.q)
    rows = surfaces.rows[:, ground.columns] / ground.units
    on = np.abs(rows).max(axis=1, initial=0.0) > 0.0
    return (rows[on], float(surfaces.limits[on].max())) if on.sum() > 1 else None


def load_of(ground: Ground, seen: Seen) -> float:
    """The size of the forces about the object: its weight, or its friction on a support."""
    weight = float(np.linalg.norm(ground.around.loads(seen.q)[ground.columns] / ground.units))
    support = carried(ground, seen)
    return max(weight, 0.0 if support is None else support[1])


def motion(
    ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, press: float
) -> Motion | None:
    """How the object moves in a mode where it wants to go by `want` (k,), over units, and how fingers push,
    at least with this part of the load; None where it does not, or nothing balances."""
    support = carried(ground, seen)
    if support is not None:
        return _on_support(ground, seen, used, mode, want, support)
    own = rows_of(ground, seen, seen.closed)
    change = projected(own, mode, want)
    if change is None or change @ want < GAIN * float(want @ want):
        return None
    pushes = balanced(ground, seen, used, _edges(own, mode, change, ground.fingers[0].reserve), press)
    return None if pushes is None else Motion(change / ground.units, pushes)


def could(
    ground: Ground, seen: Seen, mode: tuple[int, ...], want: Reals, press: float
) -> Callable[[Reals, bool], bool] | None:  # fmt: skip
    """Whether forces of fingers along edges (m, k), over units, make a mode where the object wants to go by
    `want` (k,), and with `pressing` each with at least its part of the load; None where the mode does not."""
    own, support = rows_of(ground, seen, seen.closed), carried(ground, seen)
    hoped = projected(own, mode, want)
    if hoped is None or hoped @ want < GAIN * float(want @ want):
        return None
    others = _edges(own, mode, hoped, ground.fingers[0].reserve)
    if support is not None:
        turned, kinds = np.linalg.pinv(support[0].T @ support[0], rcond=1e-12), np.array(mode, int)
        held = np.vstack([own.normals[kinds != PART], own.tangents[kinds == STICK]])
        target = np.append(want, np.zeros(len(held))) / float(np.linalg.norm(want))

        def moves(edges: Reals, _pressing: bool) -> bool:
            made = turned @ np.vstack([edges, others]).T
            made = made / np.linalg.norm(made, axis=0)
            forces, _ = nnls(np.vstack([made, RIGIDLY * held @ made]), target)
            return bool((made @ forces) @ target[: len(want)] >= GAIN)

        return moves
    weight = ground.around.loads(seen.q)[ground.columns] / ground.units
    scale = _scale(ground, weight)

    def balances(edges: Reals, pressing: bool) -> bool:
        matrix = np.vstack([edges, others]).T
        wanted = -weight / scale - (0.5 * press * edges.sum(axis=0) if pressing else 0.0)
        if not matrix.shape[1]:
            return not wanted.any()
        return bool(nnls(matrix, wanted)[1] <= UNBALANCED * (1.0 + float(np.linalg.norm(wanted))))

    return balances


def held_edges(ground: Ground, seen: Seen, used: Ints) -> Reals:
    """Edges (2 f, k), over units, of the forces of fingers that hold the object (f,)."""
    return _finger_edges(ground, seen, used)[0]


def rests(ground: Ground, seen: Seen, used: Ints, press: float = 0.0) -> Reals | None:
    """What fingers (f,) press with on their coordinates (n,) where the object rests between them; None where
    it cannot."""
    if carried(ground, seen) is not None:
        return np.zeros(len(seen.q))
    own = rows_of(ground, seen, seen.closed)
    still = np.zeros(len(ground.columns))
    edges = _edges(own, (STICK,) * len(seen.closed), still, ground.fingers[0].reserve)
    return balanced(ground, seen, used, edges, press)


def _edges(own: Rows, mode: tuple[int, ...], change: Reals, reserve: float) -> Reals:
    """Edges (m, k) of the forces on the object at contacts that are kept."""
    found, tol = list[Reals](), TINY * (1.0 + float(np.linalg.norm(change)))
    for k, kind in enumerate(mode):
        if kind == PART:
            continue
        normal, tangent, mu = own.normals[k], own.tangents[k], own.friction[k]
        slip = float(tangent @ change)
        if kind == STICK or abs(slip) <= tol:
            found += [normal + (1.0 - reserve) * mu * tangent, normal - (1.0 - reserve) * mu * tangent]
        else:
            found.append(normal - np.sign(slip) * mu * tangent)
    return np.array(found).reshape(-1, len(change))


def _finger_edges(ground: Ground, seen: Seen, used: Ints) -> tuple[Reals, Reals]:
    """Edges of the fingers' forces on the object (2 f, k), over units, and on all coordinates (2 f, n)."""
    edges, whole = list[Reals](), list[Reals]()
    for f in np.flatnonzero(used):
        normal, tangent = seen.touches.rows[seen.held[f]]
        mu = (1.0 - ground.fingers[f].reserve) * seen.touches.friction[seen.held[f]]
        for sign in (1.0, -1.0):
            whole.append(normal + sign * mu * tangent)
            edges.append(whole[-1][ground.columns] / ground.units)
    n = len(seen.q)
    return np.array(edges).reshape(-1, len(ground.columns)), np.array(whole).reshape(-1, n)


def balanced(ground: Ground, seen: Seen, used: Ints, others: Reals, press: float) -> Reals | None:
    """What fingers (f,) press with, on their own coordinates (n,), where they and forces along other edges
    (m, k) balance what acts on the object; None where nothing does."""
    loads = ground.around.loads(seen.q)
    edges, whole = _finger_edges(ground, seen, used)
    weight = loads[ground.columns] / ground.units
    scale = _scale(ground, weight)
    least = 0.5 * np.repeat([max(press * scale, finger.press[0]) for finger in _of(ground, used)], 2)
    matrix = np.vstack([edges, others]).T
    if not matrix.shape[1]:
        return np.zeros(len(seen.q)) if not weight.any() else None
    wanted = -(weight + least @ edges) / scale
    _, residual = nnls(matrix, wanted)
    if residual > UNBALANCED * (1.0 + float(np.linalg.norm(wanted))):
        return None
    size = matrix.shape[1]
    amid, _ = nnls(np.vstack([matrix, AMID * np.eye(size)]), np.append(wanted, np.zeros(size)))
    forces = scale * amid[: len(edges)] + least
    return _pressed(ground, used, forces, whole, scale)


def _scale(ground: Ground, weight: Reals) -> float:
    """The size of the forces about an object of this weight (k,)."""
    pressing = max((finger.press[0] for finger in ground.fingers), default=0.0)
    return float(np.linalg.norm(weight)) or pressing or 1.0


def _of(ground: Ground, used: Ints) -> list[Finger]:
    return [ground.fingers[f] for f in np.flatnonzero(used)]


def _pressed(ground: Ground, used: Ints, forces: Reals, whole: Reals, scale: float) -> Reals | None:
    """What fingers press with (n,) for forces (2 f,) along their edges (2 f, n); None where one is too
    weak."""
    for k, finger in enumerate(_of(ground, used)):
        if forces[2 * k : 2 * k + 2].sum() > min(finger.press[1], LONGEST * scale):
            return None
    return -(forces @ whole) if len(whole) else np.zeros(whole.shape[1])


def _on_support(
    ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, support: tuple[Reals, float]
) -> Motion | None:  # fmt: skip
    """The motion of an object on a support: along A G x for forces x of at least 0 along edges G, where
    A = (S^T S)^-1 turns forces into motions by the limit surface with rows S."""
    rows, limit = support
    turned = np.linalg.pinv(rows.T @ rows, rcond=1e-12)
    own = rows_of(ground, seen, seen.closed)
    edges, whole = _finger_edges(ground, seen, used)
    if not len(edges):
        return None
    hoped = projected(own, mode, want)
    if hoped is None:
        return None
    every = np.vstack([edges, _edges(own, mode, hoped, ground.fingers[0].reserve)])
    moves = turned @ every.T
    scale = float(np.linalg.norm(want))
    unit = np.linalg.norm(moves, axis=0)
    moves = moves / unit
    kinds = np.array(mode, int)
    held = np.vstack([own.normals[kinds != PART], own.tangents[kinds == STICK]])
    forces, _ = nnls(np.vstack([moves, RIGIDLY * held @ moves]), np.append(want, np.zeros(len(held))) / scale)
    change = moves @ forces * scale
    parts = (forces / unit)[: len(edges)].reshape(-1, 2).sum(axis=1)
    if change @ want < GAIN * scale**2 or parts.min() < 1e-3 * parts.max():
        return None
    if (np.abs(held @ change) > 1e-4 * scale).any() or (own.normals @ change < -1e-4 * scale).any():
        return None
    slips, hoped_slips = own.tangents @ change, own.tangents @ hoped
    if ((kinds == SLIDE) & (slips * hoped_slips < 0.0)).any():
        return None
    wrench = np.linalg.pinv(rows).T @ (every.T @ (forces / unit))
    forces = forces / unit * limit / float(np.linalg.norm(wrench))
    pushes = _pressed(ground, used, forces[: len(edges)], whole, limit)
    return None if pushes is None else Motion(change / ground.units, pushes)
