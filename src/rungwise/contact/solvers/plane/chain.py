"""The chain that a planar step of many bodies runs: islands, each by the proximal point method on its few
entries; where that does not solve one, the chain of few bodies on the whole.

Accepts: d = 2, H positive definite. Promises: as `solve_planar`, and the same residual in the same rows.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.solvers.plane.judge import exertion_of, residual_of
from rungwise.contact.solvers.plane.part import Part, compress, cut, guess, hand_back, island
from rungwise.contact.solvers.plane.proximal import solve_part
from rungwise.contact.step.planar import ENOUGH, PROXIMAL, SOLVED, TOLERANCE, WEDGED, solve_planar
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.kernel import allocating_kernel


@allocating_kernel
def solve_sparse(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination
) -> tuple[int, float, int]:
    """Solve as `solve_planar`, with the same arguments and results."""
    n, contacts, limited = sizes
    whole = compress(problem, sizes)
    found = Unknowns(
        unknowns.mode[: contacts + limited].copy(), np.zeros(n), unknowns.force[: 2 * contacts].copy(),
        unknowns.tau[:limited].copy(),
    )  # fmt: skip
    if _solve_apart(whole, found):
        error = residual_of(whole, found)
        if error <= TOLERANCE and exertion_of(whole, found) <= WEDGED:
            unknowns.mode[: contacts + limited] = found.mode
            unknowns.v[:n], unknowns.force[: 2 * contacts] = found.v, found.force
            unknowns.tau[:limited] = found.tau
            return SOLVED, error, PROXIMAL
    return solve_planar(problem, sizes, unknowns, room)


@allocating_kernel
def _solve_apart(whole: Part, found: Unknowns) -> bool:
    """Solve island after island, until one is left unsolved; returns whether none is."""
    apart = cut(whole)
    islands, contacts = len(apart.start) - 1, len(whole.mu)
    if islands == 1:
        return bool(solve_part(whole, found, ENOUGH) <= TOLERANCE)
    for i in range(islands):
        part, own = island(whole, apart, i), guess(apart, i, found, contacts)
        if not solve_part(part, own, ENOUGH) <= TOLERANCE:
            return False
        hand_back(apart, i, own, found, contacts)
    return True
