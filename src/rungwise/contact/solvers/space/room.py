"""What the solvers of islands work in: a problem's rows sorted by islands, and points of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.solvers.space.measure import Island, Point, Span
from rungwise.contact.solvers.space.newton import Steps, is_wide, plan_blocks
from rungwise.contact.solvers.space.path import Duals
from rungwise.contact.solvers.space.rows import (
    Bodies,
    Groups,
    Order,
    count_groups,
    fill_bodies,
    fill_groups,
    sort_rows,
)
from rungwise.contact.solvers.space.sweeps import Answers
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.contact.step.touched import Touched
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel


class Sorted(NamedTuple):
    """Bodies and groups of a problem of n velocities and so many rows, sorted; ends (islands, 2) of each
    island's coordinates and groups; whether H is positive definite."""

    bodies: Bodies
    groups: Groups
    ends: Ints
    rows: int
    solid: bool


class Room(NamedTuple):
    """What solvers of islands work in: `point` is where they are and end, `trial` where they look, `attempt`
    where the proximal point method begins on the path, and `best` the least residual met."""

    point: Point
    trial: Point
    attempt: Point
    best: Point
    answers: Answers
    duals: Duals
    steps: Steps


@allocating_kernel
def sort_problem(
    p: ContactProblem, sizes: Sizes, touched: Touched, awake: Ints, lead: Ints, most: int
) -> Sorted:
    """Sort rows and coordinates; groups have less than `most` rows where they are balls, else up to `most`.
    Contacts that are not `awake` (contacts,) are left out; `lead` as of `lead_rows`."""
    n, contacts, limited = sizes
    rows, count = contacts * p.R.shape[1] + limited, count_groups(awake, lead)
    sorted_by = Order(
        np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    )
    ends, order = np.empty((n + count, 2), np.int64), np.empty(count, np.int64)
    islands = sort_rows(p, sizes, touched, awake, lead, sorted_by, ends, order)
    bodies, entries = _bodies(sorted_by), touched.first[contacts + limited]
    groups = Groups(
        np.empty(count + 1, np.int64), np.empty(count + 1, np.int64), np.empty(count + 1, np.int64),
        np.empty(count, np.int64), np.empty(rows, np.int64), np.empty(rows), np.empty(count),
        np.empty(count), np.empty((count, most, most)), np.empty(rows), np.empty(entries, np.int64),
        np.empty(most * entries), np.empty(count), np.empty(count),
    )  # fmt: skip
    solid = fill_bodies(p, n, bodies)
    if solid:
        fill_groups(p, contacts, touched, lead, sorted_by, bodies, order, groups)
    return Sorted(bodies, groups, ends[:islands], rows, solid)


@allocating_kernel
def allocate_room(by: Sorted, quantum: float, halt: Ints) -> Room:
    """Room for the islands, but for what a wide one needs besides."""
    bodies, groups, ends, rows, _ = by
    n, count, d, narrow = len(bodies.c), len(groups.mu), groups.R.shape[1], _narrow(ends)
    vectors, dual = np.empty((4, 2 * n + 3 * rows)), np.empty((4, rows))
    answers = Answers(
        np.empty(count + 1, np.int64), np.empty(count + 1, np.int64), np.empty(count * n, np.int64),
        np.empty(rows * n), np.empty((count, d, d)),
    )  # fmt: skip
    steps = Steps(
        np.empty(narrow * narrow), np.empty(narrow, np.int64),
        plan_blocks(Island(bodies, groups, Span(0, 0, 0, 0), quantum, halt)), np.empty(d * n), np.empty(n),
        np.empty(rows), np.empty((count, d, 2 * d)), np.empty((count, d, 2 * d)), np.zeros(rows),
    )  # fmt: skip
    return Room(
        _point(vectors[0], n, rows), _point(vectors[1], n, rows), _point(vectors[2], n, rows),
        _point(vectors[3], n, rows), answers, Duals(dual[0], dual[1], dual[2], dual[3]), steps,
    )  # fmt: skip


@allocating_kernel
def room_for(island: Island, room: Room) -> Room:
    """The same room, with what this island needs if it is wide."""
    point, trial, attempt, best, answers, duals, shared = room
    steps = Steps(
        shared.matrix, shared.order, plan_blocks(island), shared.push, shared.dv, shared.dx, shared.slope,
        shared.inverse, shared.centre,
    )  # fmt: skip
    return Room(point, trial, attempt, best, answers, duals, steps)


@inner_kernel
def span_of(ends: Ints, i: int) -> Span:
    """Island i."""
    low, first = (ends[i - 1, 0], ends[i - 1, 1]) if i > 0 else (0, 0)
    return Span(low, ends[i, 0], first, ends[i, 1])


@allocating_kernel
def _bodies(sorted_by: Order) -> Bodies:
    """Room for the blocks of H and their factors."""
    place, _, first, last = sorted_by
    n, room = len(place), 0
    at = np.empty(n, np.int64)
    for i in range(n):
        at[i] = room - first[i]
        room += last[i] - first[i]
    return Bodies(np.empty(room), np.empty(room), at, first, last, np.empty(n), place, np.empty(n))


@inner_kernel
def _narrow(ends: Ints) -> int:
    """Coordinates of the greatest island that is not wide."""
    most, low = 0, 0
    for i in range(len(ends)):
        if not is_wide(ends[i, 0] - low):
            most = max(most, ends[i, 0] - low)
        low = ends[i, 0]
    return most


@allocating_kernel
def _point(vector: Reals, n: int, rows: int) -> Point:
    at = 2 * n
    return Point(
        vector[:n], vector[at : at + rows], vector[at + rows : at + 2 * rows],
        vector[at + 2 * rows : at + 3 * rows], vector[n:at],
    )  # fmt: skip


@kernel
def take_start(by: Sorted, sizes: Sizes, directions: int, unknowns: Unknowns, going: Reals, x: Reals) -> None:
    """Fill in the forces to start from, x, and the velocities `going` (n,), sorted; where a force is not
    finite there is none."""
    bodies, groups, base = by.bodies, by.groups, sizes.contacts * directions
    for i in range(sizes.n):
        going[i] = unknowns.v[bodies.place[i]] / bodies.unit[i]
    for r in range(groups.row[len(groups.mu)]):
        own = groups.origin[r]
        given = unknowns.force[own] if own < base else unknowns.tau[own - base]
        given /= groups.share[r]
        x[r] = given if math.isfinite(given) else 0.0


@kernel
def give_back(by: Sorted, sizes: Sizes, directions: int, point: Point, unknowns: Unknowns) -> None:
    """Write velocities and forces of the point into the unknowns."""
    bodies, groups, base = by.bodies, by.groups, sizes.contacts * directions
    for i in range(sizes.n):
        unknowns.v[bodies.place[i]] = bodies.unit[i] * point.v[i]
    for r in range(base):
        unknowns.force[r] = 0.0
    for r in range(groups.row[len(groups.mu)]):
        own, force = groups.origin[r], groups.share[r] * point.x[r]
        if own < base:
            unknowns.force[own] = force
        else:
            unknowns.tau[own - base] = force
