"""The assembly of many bodies: the lines of `assemble` that write rows and matrices, by their entries."""

from __future__ import annotations

from typing import NamedTuple

from rungwise.contact.step import ContactProblem, span, trim
from rungwise.kernel import Ints, Reals, RecordArray, rare_kernel
from rungwise.system.entries import number_free, set_spans
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
    for i in range(n):
        a = free[i]
        first, end = entries.matrices[a, 0], entries.matrices[a, 1]
        couplings[i, 0], couplings[i, 1] = place[first], place[end]
        problem.c[i] = terms.load[a] if rung[0].loads and not metric else 0.0
        for b in range(first, end):
            e = b - first
            resist = inertia * terms.inertia[a, e] + step * terms.stiffness[a, e] + terms.damping[a, e]
            if not metric:
                problem.c[i] += momentum * terms.inertia[a, e] * v[b] - resist * speed[b]
            if place[b + 1] > place[b]:
                problem.H[i, place[b] - place[first]] = terms.metric[a, e] if metric else resist


@rare_kernel
def take_entries(k: int, d: int, terms: Terms, problem: ContactProblem) -> None:
    """Copy the free coordinates of the rows of contact k."""
    rows, columns, place, n = terms.entries.rows, terms.entries.columns, terms.entries.place, len(terms.load)
    set_spans(columns, k, place[rows[k, 0]], place[rows[k, 1]], place[rows[k, 2]], place[rows[k, 3]])
    for side in range(2):
        first, end, shift = span(rows, k, side, n)
        _, _, moved = span(columns, k, side, n)
        for r in range(k * d, k * d + d):
            for i in range(first, end):
                if place[i + 1] > place[i]:
                    problem.W[r, place[i] - moved] = terms.rows[r, i - shift]


def trimmed(problem: ContactProblem, terms: Terms, n: int, contacts: int, limited: int) -> ContactProblem:
    """A dense copy of the rows in use, of a problem that was assembled from these terms."""
    return trim(problem, n, contacts, limited, terms.entries.columns, terms.entries.couplings)
