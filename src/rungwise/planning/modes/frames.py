"""Places of objects as numbers: what turns weigh, distances between poses, and places that are drawn."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Surroundings, turn_of

ROAMS, TURN = 1.5, 1.0
"""Room about start and goals in which places are drawn, in parts of the size and in radians."""
TURNS = ("angle", "rx", "ry", "rz")
"""How the turns of a body are called."""
ROUND, AROUND = 1e-9, 240
"""Part of its size by which the outline of a round object is off a circle, or a ball; and how many places of
an outline are looked at, there and where those are sought that are opposite of others, or face alike."""


class Placed(Protocol):
    """What is known of an object here: its task and surroundings, its columns of velocities (k,) with their
    units (k,) as lengths, which of them are to come to the goal, its columns of coordinates (p,), and of
    quaternions (r, 4), none in the plane."""

    @property
    def task(self) -> Task: ...

    @property
    def around(self) -> Surroundings: ...

    @property
    def columns(self) -> Ints: ...

    @property
    def units(self) -> Reals: ...

    @property
    def aims(self) -> NDArray[np.bool_]: ...

    @property
    def places(self) -> Ints: ...

    @property
    def turns(self) -> Ints: ...


def marks(of: Placed, q: Reals) -> Reals:
    """Numbers (m,) whose distances are those of places (n,) of what is to come to the goal, nearly. In space
    these are its place, and its rotation, scaled so that small turns are as far apart as its points move."""
    if not len(of.turns):
        return np.asarray(q[of.places] * of.units * of.aims)
    plain, reach = np.setdiff1d(of.places, of.turns), float(of.units[-1])
    turned = [0.5**0.5 * reach * turn_of(q[row]).ravel() for row in of.turns]
    return np.concatenate([q[plain], *turned])


def drawn_about(of: Placed, home: Reals, rows: Reals, rng: np.random.Generator) -> Reals:
    """A place (n,) with the object anywhere about where it is at others (m, n), and all else at home."""
    q, own, size = home.copy(), rows[:, of.places], ROAMS * of.task.size
    room = size if len(of.turns) else np.where(of.units == 1.0, size, TURN)
    q[of.places] = rng.uniform(own.min(axis=0) - room, own.max(axis=0) + room)
    if not len(of.turns):
        return q
    q[of.turns] = rows[int(rng.integers(len(rows)))][of.turns]
    change = np.zeros(len(of.around.owners))
    change[of.columns[-3:]] = rng.uniform(-TURN, TURN, 3)
    return of.around.changed(q, change)


def weights_of(task: Task, columns: Ints) -> Reals:
    """What velocities (k,) weigh in lengths: as their coordinates, where these are the same, and a turn that
    the task does not weigh as its lever."""
    weights = task.rates if len(task.turns) else task.weights
    return np.where(weights > 0.0, weights, task.rates)[columns]


def asks_turn(task: Task, body: str) -> bool:
    """Whether the goal speaks of a body's turn."""
    goal = task.scene.file.goal or ""
    return any(f"{body}.{turn}" in goal for turn in (*TURNS, "q")) or f"angle_about({body}" in goal


def is_round(around: Surroundings, body: int) -> bool:
    """Whether the outline of a body is a circle, or a ball, about the origin of its pose."""
    points, _ = around.outline(body)(np.arange(0.5, AROUND) / AROUND)
    away = np.linalg.norm(points, axis=1)
    return bool(np.ptp(away) <= ROUND * away.max())
