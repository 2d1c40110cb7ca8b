"""Generated contact problems: one step of boxes, planks, voussoirs or balls that lie, fall or are pushed.

Bodies have six velocities, the three of the centre first; coordinates are those of the space, z is up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

import rungwise as rw

STEP, GRAVITY = 1e-2, 9.81
UP = (0.0, 0.0, 1.0)
CORNERS = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])

Vector = tuple[float, float, float]


class Contact(NamedTuple):
    """Bodies below and above (-1 is the ground), a point, the normal from below to above, and the gap."""

    below: int
    above: int
    point: Vector
    normal: Vector = UP
    gap: float = 0.0


class Bodies(NamedTuple):
    """centres (n, 3); mass (n,); inertia (n, 3) about the axes of the space, through the centre."""

    centres: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray


def boxes(centres: list[Vector], halves: list[Vector], mass: np.ndarray | None = None) -> Bodies:
    """Boxes along the axes with these half sides; of density 1 where no mass is given."""
    half = np.array(halves)
    mass = 8.0 * half.prod(axis=1) if mass is None else mass
    square = half**2
    return Bodies(np.array(centres), mass, mass[:, None] / 3.0 * (square.sum(axis=1)[:, None] - square))


def step(
    bodies: Bodies,
    contacts: list[Contact],
    mu: float,
    push: float = 0.0,
    speed: float = 0.0,
) -> rw.Problem:
    """One step under gravity and random loads of `push` times the mass, from rest, or from falling at `speed`
    and drifting at random at a third of it."""
    n, rng = len(bodies.mass), np.random.default_rng(0)
    W = sp.lil_array((3 * len(contacts), 6 * n))
    for k, contact in enumerate(contacts):
        for row, direction in enumerate(_frame(contact.normal)):
            for body, sign in ((contact.above, 1.0), (contact.below, -1.0)):
                if body >= 0:
                    turn = np.cross(np.array(contact.point) - bodies.centres[body], direction)
                    W[3 * k + row, 6 * body : 6 * body + 6] = sign * np.concatenate([direction, turn])
    H = np.column_stack([bodies.mass, bodies.mass, bodies.mass, bodies.inertia]).ravel() / STEP
    load, before = np.zeros((n, 6)), np.zeros((n, 6))
    load[:, :3] = push * bodies.mass[:, None] * rng.normal(size=(n, 3))
    load[:, 2] -= GRAVITY * bodies.mass
    before[:, :2] = 0.3 * speed * rng.normal(size=(n, 2))
    before[:, 2] = -speed
    w = np.zeros(3 * len(contacts))
    w[::3] = [contact.gap / STEP for contact in contacts]
    c = load.ravel() + H * before.ravel()
    return rw.Problem.balance(sp.diags_array(H), c, sp.csr_array(W), w, np.full(len(contacts), mu))


def turning(problem: rw.Problem, size: float = 1e-2) -> rw.Problem:
    """The same in forces alone, of bodies that spin: a W that is not quite symmetric, of the same rank."""
    rows, rng, A = problem.rows, np.random.default_rng(0), problem.A.toarray()
    W, H = A[:rows, rows:], A[rows:, rows:].copy()
    for i in range(0, len(H), 6):
        a, b, c = size * H[i + 3, i + 3] * rng.normal(size=3)
        H[i + 3 : i + 6, i + 3 : i + 6] += [[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]
    response = np.linalg.solve(H, np.column_stack([W.T, problem.b[rows:]]))
    delassus = W @ response[:, :-1]
    delassus[np.abs(delassus) < 1e-14 * np.abs(delassus).max()] = 0.0
    q = problem.b[:rows] - W @ response[:, -1]
    return rw.Problem.local(sp.csr_array(delassus), q, problem.mu)


def stack(boxes_: int, push: float = 0.0, mu: float = 0.5, ratio: float = 1.0) -> rw.Problem:
    """Unit boxes one on another, four contacts each; the topmost is so many times as heavy as the lowest."""
    centres = [(0.0, 0.0, 0.5 + i) for i in range(boxes_)]
    contacts = [Contact(i - 1, i, (x, y, float(i))) for i in range(boxes_) for x, y in CORNERS]
    mass = ratio ** (np.arange(boxes_) / max(boxes_ - 1, 1))
    return step(boxes(centres, [(0.5, 0.5, 0.5)] * boxes_, mass), contacts, mu, push)


def pile(boxes_: int, push: float = 0.0, mu: float = 0.5) -> rw.Problem:
    """Each box on two below: four contacts with the ground, or eight with boxes; filled from below."""
    base = next(n for n in range(1, boxes_ + 1) if n * (n + 1) >= 2 * boxes_)
    levels = [(level, j) for level in range(base) for j in range(base - level)]
    place = {(level, j): (1.02 * j + 0.51 * level, level) for level, j in levels[:boxes_]}
    number = {key: i for i, key in enumerate(place)}
    centres = [(x, 0.0, 0.5 + level) for x, level in place.values()]
    contacts: list[Contact] = []
    for (level, j), (x, _) in place.items():
        own = number[level, j]
        if level == 0:
            contacts += [Contact(-1, own, (x + a, b, 0.0)) for a, b in CORNERS]
            continue
        for under in (j, j + 1):
            below = place[level - 1, under][0]
            ends = (max(x, below) - 0.5, min(x, below) + 0.5)
            contacts += [
                Contact(number[level - 1, under], own, (a, b, float(level)))
                for a in ends
                for b in (-0.5, 0.5)
            ]
    return step(boxes(centres, [(0.5, 0.5, 0.5)] * boxes_), contacts, mu, push)


def tower(layers: int, planks: int, push: float = 0.0, mu: float = 0.5, speed: float = 0.0) -> rw.Problem:
    """Layers of planks (117 by 23.4 by 7.8 mm), each across the one below, four contacts at each crossing."""
    length, width, height = 0.117, 0.0234, 0.0078
    centres: list[Vector] = []
    halves: list[Vector] = []
    for layer in range(layers):
        for across in np.linspace(-0.5, 0.5, planks) * (length - width):
            x, y, a, b = (across, 0.0, width, length) if layer % 2 else (0.0, across, length, width)
            centres.append((x, y, (layer + 0.5) * height))
            halves.append((0.5 * a, 0.5 * b, 0.5 * height))
    return step(boxes(centres, halves), _touching(centres, halves), mu, push, speed)


def wall(rows: int, columns: int, push: float = 0.0, mu: float = 0.5, speed: float = 0.0) -> rw.Problem:
    """Bricks (2 by 1 by 1) in bond: each touches its neighbours at all faces, four contacts at each."""
    centres = [(2.0 * j + row % 2, 0.0, row + 0.5) for row in range(rows) for j in range(columns - row % 2)]
    halves = [(1.0, 0.5, 0.5)] * len(centres)
    return step(boxes(centres, halves), _touching(centres, halves), mu, push, speed)


def arch(voussoirs: int, push: float = 0.0, mu: float = 0.6, thickness: float = 0.3) -> rw.Problem:
    """Half a ring of mean radius 1 and depth 0.5 between two abutments, four contacts at each joint."""
    depth, angle = 0.5, np.pi / voussoirs
    middle = angle * (0.5 + np.arange(voussoirs))
    square = np.array([thickness, depth, angle]) ** 2 / 12.0
    mass = np.full(voussoirs, thickness * depth * angle)
    centres = np.column_stack([np.cos(middle), np.zeros(voussoirs), np.sin(middle)])
    bodies = Bodies(centres, mass, mass[:, None] * (square.sum() - square))
    contacts = [
        Contact(
            joint - 1,
            joint if joint < voussoirs else -1,
            (r * np.cos(angle * joint), y, r * np.sin(angle * joint)),
            (-np.sin(angle * joint), 0.0, np.cos(angle * joint)),
        )
        for joint in range(voussoirs + 1)
        for r in (1.0 - thickness / 2, 1.0 + thickness / 2)
        for y in (-depth / 2, depth / 2)
    ]
    return step(bodies, contacts, mu, push)


def balls(count: int, side: int, mu: float = 0.3, speed: float = 0.0, loose: float = 0.0) -> rw.Problem:
    """Balls of about diameter 1 in a square box, packed like cannon balls, then displaced by `loose`."""
    rng = np.random.default_rng(0)
    grid = [(x, y, z) for z in range(count) for y in range(side) for x in range(side)][:count]
    centre = np.array([(x + 0.5 * (z % 2), y + 0.5 * (z % 2), z * 0.5**0.5) for x, y, z in grid]) + 0.5
    centre += 0.5 * loose * rng.normal(size=centre.shape)
    radius = 0.5 + 0.3 * loose * (rng.random(count) - 0.5)
    mass = (2.0 * radius) ** 3
    contacts: list[Contact] = []
    for i in range(count):
        for axis, sign, wall in (
            (2, 1, 0.0),
            (0, 1, 0.0),
            (0, -1, side + 0.5),
            (1, 1, 0.0),
            (1, -1, side + 0.5),
        ):
            normal = sign * np.eye(3)[axis]
            gap = sign * (centre[i, axis] - wall) - radius[i]
            if gap < 0.05:
                contacts.append(
                    Contact(-1, i, tuple(centre[i] - radius[i] * normal), tuple(normal), max(gap, 0.0))
                )
        for j in range(i):
            apart = centre[i] - centre[j]
            distance = float(np.linalg.norm(apart))
            gap, normal = distance - radius[i] - radius[j], apart / distance
            if gap < 0.05:
                contacts.append(
                    Contact(j, i, tuple(centre[j] + radius[j] * normal), tuple(normal), max(gap, 0.0))
                )
    bodies = Bodies(centre, mass, np.repeat(0.4 * mass * radius**2, 3).reshape(-1, 3))
    return step(bodies, contacts, mu, 0.0, speed)


def generated() -> Iterator[tuple[str, rw.Problem]]:
    """The problems that the benchmark times."""
    for count in (3, 10, 20):
        for push in (0.0, 3.0):
            yield f"stack of {count}, push {push:g}", stack(count, push)
    for count in (6, 20):
        for push in (0.0, 3.0, 10.0):
            yield f"pile of {count}, push {push:g}", pile(count, push)


def _frame(normal: Vector) -> np.ndarray:
    """The normal and two tangents, in rows."""
    n = np.array(normal) / np.linalg.norm(normal)
    if abs(n[2]) == 1.0:
        return np.array([n, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    t = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    t /= np.linalg.norm(t)
    return np.array([n, t, np.cross(n, t)])


def _touching(centres: list[Vector], halves: list[Vector]) -> list[Contact]:
    """Contacts at the corners of the faces that boxes along the axes share, and on the ground at z = 0."""
    low, high = np.array(centres) - np.array(halves), np.array(centres) + np.array(halves)
    contacts = [
        Contact(-1, i, (x, y, 0.0))
        for i in np.flatnonzero(np.abs(low[:, 2]) < 1e-9).tolist()
        for x in (low[i, 0], high[i, 0])
        for y in (low[i, 1], high[i, 1])
    ]
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for below in range(len(low)):
            for above in np.flatnonzero(np.abs(low[:, axis] - high[below, axis]) < 1e-9).tolist():
                start, end = np.maximum(low[below], low[above]), np.minimum(high[below], high[above])
                if (end - start)[others].min() < 1e-6:
                    continue
                for first in (start, end):
                    for second in (start, end):
                        point = start.copy()
                        point[others[0]], point[others[1]] = first[others[0]], second[others[1]]
                        point[axis] = high[below, axis]
                        contacts.append(Contact(below, above, tuple(point), tuple(np.eye(3)[axis])))
    return contacts
