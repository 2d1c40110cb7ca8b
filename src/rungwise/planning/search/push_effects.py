"""What single pushes do to an object, and plans that are put together from them.

On a support that is alike everywhere a push moves an object by the same change in the object's own frame,
wherever it lies. So changes that were seen once are composed to plans of several pushes, and asked the
inverse question: for what is left of the way to the goal the push is looked up that makes it (a tree of
nearest neighbours). What such plans do beside other bodies is seen when they are run.
"""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.task.task import Task

MOST, TRIED, KEPT = 8_000, 4_000, 400
"""Changes of an object that are kept, ways to go on with plans that are tried, and those of these that are
followed, the nearest to the goal."""
FAR = 0.25
"""How near to its goal a plan must bring an object in composed changes, in parts of its size."""


class Pushes:
    """Moves (N, d) and what they changed (N, 3) for each object that slides freely: place and angle, in the
    frame of the object before, where nothing else was moved."""

    def __init__(self, task: Task) -> None:
        names = task.scene.template.coordinates
        self._task = task
        self._columns = dict[str, Ints]()
        for name in task.scene.template.bodies:
            own = [f"{name}.{part}" for part in ("x", "y", "angle")]
            if task.slides and all(each in names for each in own):
                columns = np.array([names.index(each) for each in own])
                if (task.rates[columns] > 0.0).all():
                    self._columns[name] = columns
        self._vectors = {name: list[Reals]() for name in self._columns}
        self._changes = {name: list[Reals]() for name in self._columns}

    def note(self, vectors: Reals, before: Reals, after: Reals) -> None:
        """Remember what moves (m, d) did, which led from places (m, n) to others, where objects rest."""
        least = 1e-3 * self._task.size
        off = np.abs(after - before) * self._task.weights
        for name, columns in self._columns.items():
            others = np.delete(off, columns, axis=1)
            alone = (off[:, columns].max(axis=1) > least) & (others.max(axis=1, initial=0.0) < least)
            rows = np.flatnonzero(alone & np.isfinite(after).all(axis=1))
            if len(rows):
                self._vectors[name].append(vectors[rows])
                self._changes[name].append(_seen_from(before[rows][:, columns], after[rows][:, columns]))

    def plans(
        self, name: str, q: Reals, goals: Reals, count: int, most: int, rng: np.random.Generator
    ) -> Reals:
        """Plans (r, count, d) of pushes at an object that bring it from its place at q (n,) nearest to its
        place at one of the goals (g, n), best first and at most so many; none where no push was seen."""
        none = np.zeros((0, count, 0))
        if not self._vectors.get(name):
            return none
        vectors, changes = (np.concatenate(kept[name])[-MOST:] for kept in (self._vectors, self._changes))
        columns, scale = self._columns[name], self._task.rates[self._columns[name]]
        aims, far = goals[:, columns], np.linalg.norm(changes * scale, axis=1)
        poses, chosen = q[None, columns], np.zeros((1, 0), np.int64)
        for k in range(count - 1):
            begun = rng.integers(len(poses), size=TRIED)
            drawn = rng.choice(len(vectors), size=TRIED, p=far / far.sum())
            poses = _moved(poses[begun], changes[drawn])
            chosen = np.concatenate([chosen[begun], drawn[:, None]], axis=1)
            if k < count - 2:
                near = np.argsort(_away(poses, aims, scale), kind="stable")[:KEPT]
                poses, chosen = poses[near], chosen[near]
        last, away = _last(changes, poses, aims, scale)
        best = np.argsort(away, kind="stable")[:most]
        best = best[away[best] <= FAR * self._task.size]
        return np.asarray(vectors[np.concatenate([chosen[best], last[best, None]], axis=1)])


def _away(poses: Reals, goals: Reals, scale: Reals) -> Reals:
    """How far poses (m, 3) are from the nearest goal (g, 3)."""
    return np.asarray(np.linalg.norm((poses[:, None] - goals) * scale, axis=2).min(axis=1))


def _last(changes: Reals, poses: Reals, goals: Reals, scale: Reals) -> tuple[Ints, Reals]:
    """The push that leads from each pose (m, 3) nearest to a goal (g, 3), and how near."""
    from scipy.spatial import cKDTree

    tree = cKDTree(changes * scale)
    found, away = np.zeros(len(poses), np.int64), np.full(len(poses), np.inf)
    for goal in goals:
        near, nearest = tree.query(_seen_from(poses, goal[None]) * scale)
        found, away = np.where(near < away, nearest, found), np.minimum(near, away)
    return found, away


def _seen_from(before: Reals, after: Reals) -> Reals:
    """Poses (m, 3) in the frames of others."""
    way = after - before
    c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
    return np.stack([c * way[:, 0] + s * way[:, 1], c * way[:, 1] - s * way[:, 0], way[:, 2]], axis=1)


def _moved(poses: Reals, changes: Reals) -> Reals:
    """Poses (m, 3) after changes in their own frames."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, turn = changes.T
    return np.asarray(poses + np.stack([c * x - s * y, s * x + c * y, turn], axis=1))
