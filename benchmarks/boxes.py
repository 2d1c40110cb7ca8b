"""Contact problems of boxes at rest or pushed: stacks and piles, as many contacts as one likes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

import rungwise as rw

STEP, GRAVITY = 1e-2, 9.81
CORNERS = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])

Contact = tuple[int, int, tuple[float, float, float]]
"""Body below (-1 the ground), body above, point; all normals are vertical."""


def resting(contacts: list[Contact], centres: np.ndarray, mu: float, push: float) -> rw.Problem:
    """One step from rest of unit boxes (mass 1) under gravity and random loads of size `push` (newtons)."""
    n, rng = 6 * len(centres), np.random.default_rng(0)
    W = sp.lil_array((3 * len(contacts), n))
    for k, (below, above, point) in enumerate(contacts):
        for row, direction in enumerate(np.eye(3)[[2, 0, 1]]):
            for body, sign in ((above, 1.0), (below, -1.0)):
                if body >= 0:
                    turn = np.cross(np.array(point) - centres[body], direction)
                    W[3 * k + row, 6 * body : 6 * body + 6] = sign * np.concatenate([direction, turn])
    mass = np.tile([1.0, 1.0, 1.0, 1 / 6, 1 / 6, 1 / 6], len(centres))
    load = np.zeros((len(centres), 6))
    load[:, :3] = push * rng.normal(size=(len(centres), 3))
    load[:, 2] -= GRAVITY
    w = np.zeros(3 * len(contacts))
    return rw.Problem.balance(
        sp.diags_array(mass / STEP), load.ravel(), sp.csr_array(W), w, np.full(len(contacts), mu)
    )


def stack(boxes: int, push: float = 0.0, mu: float = 0.5) -> rw.Problem:
    """Boxes one on another, four contacts each."""
    centres = np.array([[0.0, 0.0, 0.5 + i] for i in range(boxes)])
    contacts = [(i - 1, i, (x, y, float(i))) for i in range(boxes) for x, y in CORNERS]
    return resting(contacts, centres, mu, push)


def pile(boxes: int, push: float = 0.0, mu: float = 0.5) -> rw.Problem:
    """Each box on two below: four contacts with the ground, or eight with boxes; filled from below."""
    base = next(n for n in range(1, boxes + 1) if n * (n + 1) >= 2 * boxes)
    levels = [(level, j) for level in range(base) for j in range(base - level)]
    place = {(level, j): (1.02 * j + 0.51 * level, level) for level, j in levels[:boxes]}
    number = {key: i for i, key in enumerate(place)}
    centres = np.array([[x, 0.0, 0.5 + level] for x, level in place.values()])
    contacts: list[Contact] = []
    for (level, j), (x, _) in place.items():
        own = number[level, j]
        if level == 0:
            contacts += [(-1, own, (x + a, b, 0.0)) for a, b in CORNERS]
            continue
        for under in (j, j + 1):
            below = place[level - 1, under][0]
            ends = (max(x, below) - 0.5, min(x, below) + 0.5)
            contacts += [
                (number[level - 1, under], own, (a, b, float(level))) for a in ends for b in (-0.5, 0.5)
            ]
    return resting(contacts, centres, mu, push)


def generated() -> Iterator[tuple[str, rw.Problem]]:
    for boxes in (3, 10, 20):
        for push in (0.0, 3.0):
            yield f"stack of {boxes}, push {push:g}", stack(boxes, push)
    for boxes in (6, 20):
        for push in (0.0, 3.0, 10.0):
            yield f"pile of {boxes}, push {push:g}", pile(boxes, push)
