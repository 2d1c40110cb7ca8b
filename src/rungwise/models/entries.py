"""The assembly of many bodies: the lines of `assemble` that write rows and matrices, on their entries alone.

The arrays of a problem are kept from step to step: what the last assembly wrote is cleared first.
"""

from __future__ import annotations

from typing import NamedTuple

from rungwise.contact.step import ContactProblem
from rungwise.kernel import Ints, Reals, RecordArray, rare_kernel
from rungwise.system.entries import clear_spans, number_free, set_spans, spans
from rungwise.system.terms import Terms


class Velocities(NamedTuple):
    """Which velocities a step asks for: those of the first n of the coordinates `free`; v (n_v,) before it;
    speed (n_v,) of the others, zero where they are free."""

    free: Ints
    n: int
    v: Reals
    speed: Reals


@rare_kernel
def fill_entries(
    rung: RecordArray, step: float, eps: float, terms: Terms, velocities: Velocities, problem: ContactProblem
) -> None:
    """Fill in H and c of the free coordinates, of the kinematic rung, too."""
    free, n, v, speed = velocities
    entries, metric = terms.entries, rung[0].metric
    number_free(entries, free, n)
    place, couplings = entries.place, entries.couplings
    inertia = eps / step
    momentum = inertia if rung[0].inertia > 0.0 else 0.0
    for i in range(couplings.shape[0]):
        for j in range(couplings[i, 0], couplings[i, 1]):
            problem.H[i, j] = 0.0
        couplings[i, 0] = couplings[i, 1] = 0
    for i in range(n):
        a = free[i]
        first, end = entries.matrices[a, 0], entries.matrices[a, 1]
        couplings[i, 0], couplings[i, 1] = place[first], place[end]
        problem.c[i] = terms.load[a] if rung[0].loads and not metric else 0.0
        for b in range(first, end):
            resist = inertia * terms.inertia[a, b] + step * terms.stiffness[a, b] + terms.damping[a, b]
            if not metric:
                problem.c[i] += momentum * terms.inertia[a, b] * v[b] - resist * speed[b]
            if place[b + 1] > place[b]:
                problem.H[i, place[b]] = terms.metric[a, b] if metric else resist


@rare_kernel
def take_entries(k: int, d: int, terms: Terms, problem: ContactProblem) -> None:
    """Copy the free coordinates of the rows of contact k."""
    entries = terms.entries
    place, columns = entries.place, entries.columns
    clear_spans(entries.columns, k, d, problem.W)
    first, end, second, last = spans(entries.rows, k)
    for r in range(k * d, k * d + d):
        for i in range(first, end):
            if place[i + 1] > place[i]:
                problem.W[r, place[i]] = terms.rows[r, i]
        for i in range(second, last):
            if place[i + 1] > place[i]:
                problem.W[r, place[i]] = terms.rows[r, i]
    set_spans(columns, k, place[first], place[end], place[second], place[last])
