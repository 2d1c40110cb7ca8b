"""The chain that a planar step of many bodies runs: islands, each by the proximal point method on its few
entries; where that does not solve one, the chain of few bodies on the whole.

Accepts: d = 2, H positive definite. Promises: as `solve_planar`, and the same residual in the same rows.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.solvers.plane.judge import exertion_of, residual_of
from rungwise.contact.solvers.plane.part import Part, compress, cut, guess, hand_back, island
from rungwise.contact.solvers.plane.proximal import solve_part
from rungwise.contact.step.modes import OPEN, STICK
from rungwise.contact.step.planar import (
    ENOUGH,
    PROXIMAL,
    SOLVED,
    SPARE,
    TOLERANCE,
    WEDGED,
    solve_planar,
)
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.contact.step.steady import correct_velocities
from rungwise.kernel import Ints, allocating_kernel

RESTS = 1e-10
"""Residual up to which forces of the last step let an island rest. Chosen by trial, to a decade, between the
tolerance of steps and what solved steps have."""


@allocating_kernel
def solve_sparse(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> tuple[int, float, int]:
    """Solve as `solve_planar`, with the same results. Contact k has entries in the columns of two spans,
    `columns` (k, 4), a row of H in the stretch `couplings` (n, 2)."""
    n, contacts, limited = sizes
    whole = compress(problem, sizes, columns, couplings)
    found = Unknowns(
        unknowns.mode[: contacts + limited].copy(), np.zeros(n), unknowns.force[: 2 * contacts].copy(),
        unknowns.tau[:limited].copy(),
    )  # fmt: skip
    if _solve_apart(whole, found, halt):
        error = residual_of(whole, found)
        if error <= TOLERANCE and exertion_of(whole, found) <= WEDGED:
            unknowns.mode[: contacts + limited] = found.mode
            unknowns.v[:n], unknowns.force[: 2 * contacts] = found.v, found.force
            unknowns.tau[:limited] = found.tau
            return SOLVED, error, PROXIMAL
    return solve_planar(problem, sizes, unknowns, _room(sizes), halt)


@allocating_kernel
def correct_many(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> None:
    """Correct velocities as `correct_velocities`."""
    correct_velocities(problem, sizes, unknowns, _room(sizes))


@allocating_kernel
def _room(sizes: Sizes) -> Elimination:
    size = sizes.n + 2 * sizes.contacts + sizes.limited + SPARE
    return Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))


@allocating_kernel
def _solve_apart(whole: Part, found: Unknowns, halt: Ints) -> bool:
    """Solve island after island, until one is left unsolved; returns whether none is."""
    apart = cut(whole)
    islands, contacts = len(apart.start) - 1, len(whole.mu)
    if islands == 1:
        return _solve_island(whole, found, halt)
    for i in range(islands):
        part, own = island(whole, apart, i), guess(apart, i, found, contacts)
        if not _solve_island(part, own, halt):
            return False
        hand_back(apart, i, own, found, contacts)
    return True


@allocating_kernel
def _solve_island(part: Part, found: Unknowns, halt: Ints) -> bool:
    """Solve from the guess, from where that led, or else from none; returns whether that is a solution. What
    rested goes on resting, by the same forces."""
    found.v[:] = 0.0
    if residual_of(part, found) <= RESTS:
        return exertion_of(part, found) <= WEDGED
    for _ in range(2):
        if solve_part(part, found, ENOUGH, halt) <= TOLERANCE and exertion_of(part, found) <= WEDGED:
            return True
    found.mode[:], found.force[:], found.tau[:] = OPEN, 0.0, 0.0
    for r in range(len(part.F)):
        found.mode[len(part.mu) + r] = STICK
    return bool(solve_part(part, found, ENOUGH, halt) <= TOLERANCE)
