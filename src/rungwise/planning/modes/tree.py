"""A tree over places of an object and its fingers, grown along contact modes; nothing is run.

After Cheng, Huang, Hou and Mason (arXiv 2105.14431): nodes are extended towards a drawn place of the object
in one of the modes of its contacts, by the fingers that hold it or by others, where forces balance. Fingers
change places only where the object rests without them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.balance import (
    carried,
    could,
    drags,
    finger_edges,
    held_edges,
    is_led,
    modes,
    motion,
    rests,
)
from rungwise.planning.modes.follow import Way, follow
from rungwise.planning.modes.frames import drawn_about, marks
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.pushed import led_target
from rungwise.planning.modes.tried import covered, draws, pool, supposed
from rungwise.planning.search.problem import LEGS, TREES

AIMED = 0.7
"""Part of the places that are drawn on the path, where one is given, and of all others that are drawn at the
goal."""
BEEN, AHEAD = 0.3, 3
"""How near to a place of a path, in parts of the size, nodes count as there; and how many places ahead are
drawn."""
ONWARD = 3
"""Places of a path by which a tree that does not come to the goal must have come on, that its legs be run."""
BEHIND, BACK = 0.5, 0.3
"""How often such places are drawn behind the farthest that was reached, and the chance to go back no farther,
place by place."""
FRUGAL = 1.0
"""How much farther from a place of a path a node counts as where no changes of fingers are left."""
ROWS = 200
"""Nodes for which room is made at a time."""
CHOSEN, GREEDY = 4, 0.3
"""Modes that a node is extended in, and how often these are the best."""
PLACED, ENOUGH = 24, 6
"""How often fingers that are drawn are placed, for a mode; and those that fit after which no more are."""
REGRASPS = 0.3
"""How often fingers change places where they need not."""
NO_MODE, NO_BALANCE, NO_PLACE = "no mode", "no balance", "no place for fingers"
TOO_WEAK = "fingers press too weakly"
"""Why nodes were not extended."""


class Leg(NamedTuple):
    """A part of a way: which fingers change their places (f,) before it, and the way."""

    changes: Ints
    way: Way


@dataclass
class Tree:
    """Nodes: what touches there, the fingers that hold the object (f,), and how often these may still change
    places; their parents, the legs that led there, and how often each was chosen; the object's places (m, k)
    there, over units, in the first rows; and the farthest place of a path where one has been, with the first
    node that was there."""

    seen: list[Seen]
    used: list[Ints]
    left: list[int]
    parents: list[int] = field(default_factory=lambda: [-1])
    legs: list[Leg | None] = field(default_factory=lambda: [None])
    chosen: list[int] = field(default_factory=lambda: [0])
    rows: Reals = field(default_factory=lambda: np.zeros((0, 0)))
    been: int = 0
    first: int = 0

    @property
    def places(self) -> Reals:
        """Places (m, k) of the object at the nodes, over units."""
        return self.rows[: len(self.seen)]

    def note(self, place: Reals, far: int) -> None:
        """Note the place (k,) of the object at the last node, over units, and how far on a path it is."""
        if len(self.rows) < len(self.seen):
            self.rows = np.vstack([self.rows.reshape(-1, len(place)), np.zeros((ROWS, len(place)))])
        self.rows[len(self.seen) - 1] = place
        if far > self.been:
            self.been, self.first = far, len(self.seen) - 1

    def add(self, ground: Ground, node: int, leg: Leg, path: Reals) -> int:
        """The node at the end of a leg from another one; a path (p, n), if one is known, tells how far."""
        seen = ground.look(leg.way.places[-1])
        self.seen.append(seen)
        self.used.append(leg.way.used)
        self.left.append(self.left[node] - int(leg.changes.any()))
        self.parents.append(node)
        self.legs.append(leg)
        self.chosen.append(0)
        self.note(marks(ground, seen.q), far(ground, seen.q, path))
        return len(self.seen) - 1

    def way(self, node: int) -> list[Leg]:
        """The legs that lead to a node."""
        found = list[Leg]()
        while self.parents[node] >= 0:
            leg = self.legs[node]
            assert leg is not None
            found.append(leg)
            node = self.parents[node]
        return found[::-1]


def propose(
    ground: Ground, q: Reals, home: Reals, goals: Reals, reached: Callable[[Reals], bool], press: float,
    rng: np.random.Generator, rounds: int, failed: Counter[str], look: Callable[[int], None], path: Reals,
    most: int, grown: Counter[str],
) -> list[Leg] | None:  # fmt: skip
    """Legs from q (n,) to where the goal is `reached`, towards goals (g, n), in so many rounds; else as far
    as they lead on a path. `failed` counts why nodes were not extended; `look` is called with the steps and
    the draws that are made, and may raise. `home` (n,): where fingers are when idle; `path` (p, n): places on
    the way, towards which most legs go, none where it is not known; most: how often fingers may change
    places; `grown` counts trees and their legs."""
    begun = ground.look(q)
    tree = Tree([begun], [(begun.held >= 0).astype(np.int64)], [most])
    tree.note(marks(ground, q), far(ground, q, path))
    room = np.vstack([q, home, goals, path])
    begins = tree.been
    if reached(q):
        return []
    grown[TREES] += 1
    for _ in range(rounds):
        look(1)
        if len(path) and rng.random() < AIMED:
            at = tree.been - (int(rng.geometric(BACK)) if rng.random() < BEHIND else 0)
            target = path[min(max(at, 0) + int(rng.integers(1, AHEAD + 1)), len(path) - 1)]
        elif rng.random() < AIMED:
            target = goals[min(int(rng.geometric(0.5)) - 1, len(goals) - 1)]
        else:
            target = drawn_about(ground, home, room, rng)
        node = _chosen(ground, tree, target, rng, len(path) > 0)
        for leg in _extended(ground, tree, node, target, home, press, rng, failed, look):
            last: int = node
            on: Leg | None = leg
            while on is not None:
                last = tree.add(ground, last, on, path)
                grown[LEGS] += 1
                if reached(tree.seen[last].q):
                    return tree.way(last)
                on = _led_on(ground, tree, last, path, press, look)
    return tree.way(tree.first) if tree.been >= begins + ONWARD else None


def far(ground: Ground, q: Reals, path: Reals) -> int:
    """The last place of a path (p, n) that q (n,) is near to; the first where it is near to none."""
    if not len(path):
        return 0
    off = np.array([ground.away(q, place) for place in path])
    near = np.flatnonzero(off < BEEN * ground.task.size)
    return int(near.max(initial=0))


def _led_on(
    ground: Ground, tree: Tree, node: int, path: Reals, press: float, look: Callable[[int], None]
) -> Leg | None:  # fmt: skip
    """The leg that leads an object farthest on a path (p, n) from a node with the fingers that hold it there;
    None where none does."""
    seen, used = tree.seen[node], tree.used[node]
    best, begun = None, far(ground, seen.q, path)
    if begun + 1 >= len(path) or not used.any():
        return None
    target = path[min(begun + AHEAD, len(path) - 1)]
    most, want = begun, ground.off(seen.q, target)
    for mode, _ in modes(ground, seen, want)[:CHOSEN]:
        if not _makes(ground, seen, used, mode, want, press):
            continue
        way = follow(ground, seen, used, mode, target, press, look)
        come = far(ground, way.places[-1], path)
        if come > most:
            best, most = Leg(np.zeros_like(used), way), come
    return best


def _chosen(ground: Ground, tree: Tree, target: Reals, rng: np.random.Generator, frugal: bool) -> int:
    """The node to go on from: near to the target, and not often chosen before; where fingers are to change
    places seldom, one that has left as many changes as possible."""
    away = np.linalg.norm(tree.places - marks(ground, target), axis=1)
    weighed = away * rng.uniform(1.0, 1.3, len(away)) * (1.0 + 0.1 * np.array(tree.chosen))
    if frugal:
        weighed *= 1.0 + FRUGAL * (1.0 - np.array(tree.left) / max(tree.left[0], 1))
    node = int(weighed.argmin())
    tree.chosen[node] += 1
    return node


def _extended(
    ground: Ground, tree: Tree, node: int, target: Reals, home: Reals, press: float,
    rng: np.random.Generator, failed: Counter[str], look: Callable[[int], None],
) -> Iterator[Leg]:  # fmt: skip
    """Legs from a node towards a target, in some of its modes: the best, and at times others."""
    seen, used = tree.seen[node], tree.used[node]
    target = led_target(ground, seen, target, rng)
    want = ground.off(seen.q, target)
    if not want.any():
        return
    every = modes(ground, seen, want)
    if not every:
        failed[NO_MODE] += 1
        return
    count = min(CHOSEN, len(every))
    picked = range(count) if rng.random() < GREEDY else rng.permutation(len(every))[:count].tolist()
    for k in picked:
        mode = every[k][0]
        grasps = list(
            _grasps(ground, seen, used, mode, want, home, press, rng, failed, look, tree.left[node] > 0)
        )
        ways = list[tuple[float, int, Leg]]()
        for begun, own, changes in grasps:
            way = follow(ground, begun, own, mode, target, press, look)
            if len(way.places) > 1:
                ways.append((ground.away(way.places[-1], target), len(ways), Leg(changes, way)))
        if grasps and not ways:
            failed[NO_BALANCE] += 1
        ways.sort(key=lambda each: each[:2])
        for _, _, leg in ways[: 1 + int(rng.integers(3))]:
            yield leg


def _grasps(
    ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, home: Reals, press: float,
    rng: np.random.Generator, failed: Counter[str], look: Callable[[int], None], may_change: bool,
) -> Iterator[tuple[Seen, Ints, Ints]]:  # fmt: skip
    """Places of fingers with which a mode can be made: what touches there, fingers that hold (f,), and those
    that changed (f,), where they may."""
    kept = False
    if used.any() and _makes(ground, seen, used, mode, want, press):
        kept = True
        yield seen, used, np.zeros_like(used)
    if not may_change or (kept and rng.random() > REGRASPS):
        return
    may = could(ground, seen, mode, want, press)
    parts = pool(ground, seen, used, rng)
    count = len(ground.columns)
    edges = finger_edges(ground, seen, parts) if ground.is_free_body and not ground.is_wide else None
    if may is None or (edges is not None and not may(edges.reshape(-1, count), False)):
        failed[NO_BALANCE] += not kept
        return
    found, fits, placed, fitting = 0, carried(ground, seen) is not None, 0, None
    # Arms with joints to spare come to the very place that is drawn, but that takes them long.
    dear = edges is not None and any(f.is_redundant for f in ground.fingers) and ground.around.tangents == 2
    barred = covered(ground, seen, parts) if dear else np.zeros(len(parts), bool)
    for changes, own, picked in draws(ground, used, rng):
        look(1)
        staying = used * (1 - changes)
        if edges is not None:
            holding = held_edges(ground, seen, staying) if staying.any() else np.zeros((0, count))
            every = np.vstack([holding, *edges[picked[own * changes > 0]]])
            if barred[picked[own * changes > 0]].any() or not may(every, True):
                continue
        if not fits and staying.sum() < used.sum() and rests(ground, seen, staying) is None:
            continue
        if dear:
            hoped = supposed(ground, seen, changes, own, parts[picked])
            if not _makes(ground, hoped, own, mode, want, press):
                continue
        begun = _placed(ground, seen, changes, own, parts[picked], used, home, rng)
        placed += 1
        if begun is not None and _makes(ground, begun, own, mode, want, press):
            yield begun, own, changes
            found += 1
        elif begun is not None:
            fitting = begun, own
        if found >= ENOUGH or placed >= PLACED:
            break
    if found or kept:
        return
    if fitting is not None and _makes(ground.stronger, *fitting, mode, want, press):
        failed[TOO_WEAK] += 1
    else:
        failed[NO_PLACE if placed and fitting is None else NO_BALANCE] += 1


def _makes(ground: Ground, seen: Seen, used: Ints, mode: tuple[int, ...], want: Reals, press: float) -> bool:
    """Whether fingers can make a mode."""
    if (
        carried(ground, seen) is None
        and not is_led(ground, seen, used, mode)
        and not drags(ground, seen, mode)
    ):
        return False
    return motion(ground, seen, used, mode, want, press) is not None


def _placed(
    ground: Ground, seen: Seen, changes: Ints, own: Ints, parts: Reals, used: Ints, home: Reals,
    rng: np.random.Generator,
) -> Seen | None:  # fmt: skip
    """What touches with fingers changed so; None where they do not fit."""
    q: Reals | None = seen.q
    for f in np.flatnonzero(changes):
        assert q is not None
        if own[f]:
            q = ground.placed(q, int(f), float(parts[f]))
        else:
            q = _idle(ground, seen, q, int(f), used, home, rng)
        if q is None:
            return None
    assert q is not None
    begun = ground.look(q)
    return begun if ground.begins_free(begun, own) and ground.is_held(begun, own) else None


def _idle(
    ground: Ground, seen: Seen, q: Reals, f: int, used: Ints, home: Reals, rng: np.random.Generator
) -> Reals:
    """The place (n,) with a finger that touches nothing: where it is, at home, or somewhere about the
    object."""
    finger, found, draw = ground.fingers[f], q.copy(), rng.random()
    if draw < 0.3 and not used[f]:
        return found
    if draw < 0.6:
        found[finger.places] = home[finger.places]
        return found
    if finger.arm is not None:
        near, low, high = finger.arm.units * math.pi, *finger.arm.bounds
        if len(ground.turns):
            now = finger.arm.joints(q)
            return finger.put(q, rng.uniform(np.maximum(low, now - near), np.minimum(high, now + near)))
        return finger.put(q, rng.uniform(*(np.clip(bound, -math.pi, math.pi) for bound in (low, high))))
    turn, far = rng.uniform(0.0, 2.0 * math.pi), ground.task.size * rng.uniform(1.2, 3.0)
    about = ground.around.poses(seen.q)[ground.body, :2]
    found[finger.columns] = np.clip(about + far * np.array([math.cos(turn), math.sin(turn)]), *finger.bounds)
    return found
