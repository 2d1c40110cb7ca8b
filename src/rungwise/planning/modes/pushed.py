"""Objects that push others: where the one that fingers lead is to go, that the other comes to its target; and
which others it may push aside."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.forces.cones import TINY
from rungwise.planning.modes.frames import AROUND
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Surroundings
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of

ROAM = 0.15
"""How often the object that pushes is led anywhere, while the other stays."""
AS_IT_IS = 0.7
"""How often it is turned by no more than it takes to lie on a side of the other."""
BEHIND = 0.3
"""Least part of the way of a place that goes into the object, where that place is pushed."""
TRIED = 8
"""Places behind it of which the nearest is taken."""
INTO = 2.0
"""How far it is led into the other, in gaps that count as closed, so that they touch."""


def loose(task: Task, around: Surroundings, asked: Collection[str]) -> frozenset[int]:
    """The numbers of objects that may be pushed aside: supports carry them, nothing joins them to others, and
    the goal, in which these names are, does not speak of them."""
    world = world_of(task.scene)
    roles, names = world.roles(task.parameters), list(task.scene.template.bodies)
    rows = around.touches(world.at(task.parameters).q, 0.0).supports.rows
    carried = np.abs(rows).max(axis=0, initial=0.0) > 0.0
    return frozenset(
        k
        for k, name in enumerate(names)
        if roles[name] == OBJECT and name not in asked and carried[around.owners == k].sum() == 3
    )


def led_target(ground: Ground, seen: Seen, target: Reals, rng: np.random.Generator) -> Reals:
    """The place (n,) to lead the objects to: as it is for an object that fingers lead alone. Where one pushes
    another, the other goes to its target with it, if they touch on a side from which that is a push; else it
    stays, and the first goes behind it."""
    if not ground.pushes:
        return target
    first, last = ground.columns[~ground.aims], ground.columns[ground.aims]
    q, found = seen.q, target.copy()
    now, then = q[last], target[last]
    if not rng.random() >= ROAM:
        found[last] = now
        return found
    if _pushes(ground, seen, now, then):
        found[first] = _carried(q[first], now, then)
        return found
    found[last] = now
    place = _behind(ground, seen, now, then, rng)
    found[first] = q[first] if place is None else place
    return found


def _carried(pose: Reals, now: Reals, then: Reals) -> Reals:
    """A pose (3,) after the motion that takes another one from `now` to `then`."""
    c, s = math.cos(then[2] - now[2]), math.sin(then[2] - now[2])
    moved = then[:2] + np.array([[c, -s], [s, c]]) @ (pose[:2] - now[:2])
    return np.array([*moved, pose[2] + then[2] - now[2]])


def _ways(points: Reals, now: Reals, then: Reals) -> Reals:
    """How points (m, 2) of a body go as it goes from `now` to `then`."""
    c, s = math.cos(then[2] - now[2]), math.sin(then[2] - now[2])
    return np.asarray(then[:2] + (points - now[:2]) @ np.array([[c, s], [-s, c]]) - points)


def _pushes(ground: Ground, seen: Seen, now: Reals, then: Reals) -> bool:
    """Whether the first object touches the last one where this goes away from it, on the whole."""
    touches, rows = seen.touches, [k for k in seen.closed if seen.touches.pairs[k] == ground.between[0]]
    if not rows:
        return False
    into = ground.between[1] * touches.normals[rows]
    ways = _ways(touches.points[rows], now, then)
    along = (ways * into).sum(axis=1)
    return bool(along.max() > 0.0 and along.sum() > 0.0)


def _behind(ground: Ground, seen: Seen, now: Reals, then: Reals, rng: np.random.Generator) -> Reals | None:
    """A pose (3,) of the first object at a place of the last one's outline that goes into it on its way to
    `then`; None where there is none."""
    every = np.arange(0.5, AROUND) / AROUND
    poses = seen.touches.poses
    points, inward = _outline(ground, ground.last, poses[ground.last], every)
    into = (_ways(points, now, then) * inward).sum(axis=1)
    into[into < BEHIND * into.max(initial=0.0)] = 0.0
    if not into.sum() > 0.0:
        return None
    own, facing = _outline(ground, ground.body, poses[ground.body], every)
    pose, best, least = seen.q[ground.columns[~ground.aims]], None, math.inf
    for k in rng.choice(AROUND, size=TRIED, p=into / into.sum()).tolist():
        turns = np.arctan2(inward[k, 1], inward[k, 0]) - np.arctan2(-facing[:, 1], -facing[:, 0])
        turns = (turns + math.pi) % (2.0 * math.pi) - math.pi
        flat = np.flatnonzero(np.abs(turns) <= np.abs(turns).min() + TINY)
        j = int(rng.choice(flat) if rng.random() < AS_IT_IS else rng.integers(AROUND))
        c, s = math.cos(turns[j]), math.sin(turns[j])
        arm = np.array([[c, -s], [s, c]]) @ (own[j] - pose[:2])
        place = np.array([*(points[k] - arm + INTO * ground.closed * inward[k]), pose[2] + turns[j]])
        far = float(np.linalg.norm((place - pose) * ground.units[~ground.aims]))
        if far < least:
            best, least = place, far
    return best


def _outline(ground: Ground, body: int, pose: Reals, parts: Reals) -> tuple[Reals, Reals]:
    """Points of a body's outline in the world, and normals that go inward there (m, 2)."""
    points, normals = ground.around.outline(body)(parts)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, s], [-s, c]])
    return pose[:2] + points @ turn, -normals @ turn
