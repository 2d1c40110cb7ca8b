"""The chain that a planar step of many bodies runs: islands, each by the proximal point method on its few
entries; where the modes of one do not settle, the chain of steps in space, which follows forces and not
modes, and whose answer the first method makes finer; where that ends without an answer, other starts, and the
chain of few bodies on the whole.

Accepts: d = 2, H positive definite. Promises: as `solve_planar`, and the same residual in the same rows.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.solvers.plane.judge import exertion_of, residual_of
from rungwise.contact.solvers.plane.part import Part, compress, cut, guess, hand_back, island
from rungwise.contact.solvers.plane.proximal import TURNS, solve_part
from rungwise.contact.solvers.space.chain import solve_spatial
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.contact.step.solve import (
    ENOUGH,
    PROXIMAL,
    SOLVED,
    SPARE,
    TOLERANCE,
    WEDGED,
    solve_planar,
)
from rungwise.contact.step.steady import correct_velocities
from rungwise.kernel import Ints, allocating_kernel, inner_kernel

TRIES = 3
"""Starts of an island where neither the first nor the chain of steps in space leads to an answer."""
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
    found = _given(sizes, unknowns)
    solved = _solve_apart(whole, found, 1, halt) and _is_solved(whole, found)
    if not solved:
        found = _given(sizes, unknowns)
        status, _, _ = solve_spatial(problem, sizes, found, columns, couplings, halt)
        if status == SOLVED:
            _tell_signs(contacts, found)
            finer = Unknowns(found.mode.copy(), found.v.copy(), found.force.copy(), found.tau.copy())
            solved = _solve_apart(whole, finer, 1, halt) and _is_solved(whole, finer)
            found = finer if solved else found
            solved = solved or _is_solved(whole, found)
    if not solved:
        found = _given(sizes, unknowns)
        solved = _solve_apart(whole, found, TRIES, halt) and _is_solved(whole, found)
    if not solved:
        return solve_planar(problem, sizes, unknowns, _room(sizes), halt)
    unknowns.mode[: contacts + limited] = found.mode
    unknowns.v[:n], unknowns.force[: 2 * contacts] = found.v, found.force
    unknowns.tau[:limited] = found.tau
    return SOLVED, residual_of(whole, found), PROXIMAL


@inner_kernel
def _is_solved(whole: Part, found: Unknowns) -> bool:
    return bool(residual_of(whole, found) <= TOLERANCE and exertion_of(whole, found) <= WEDGED)


@allocating_kernel
def _given(sizes: Sizes, unknowns: Unknowns) -> Unknowns:
    """What is given, to start from."""
    n, contacts, limited = sizes
    return Unknowns(
        unknowns.mode[: contacts + limited].copy(), unknowns.v[:n].copy(),
        unknowns.force[: 2 * contacts].copy(), unknowns.tau[:limited].copy(),
    )  # fmt: skip


@inner_kernel
def _tell_signs(contacts: int, found: Unknowns) -> None:
    """Tell modes of slip by the signs of forces: in space a slip is FORWARD whatever its heading."""
    mode, force, tau = found.mode, found.force, found.tau
    for g in range(len(mode)):
        drags = force[2 * g + 1] if g < contacts else tau[g - contacts]
        if mode[g] == FORWARD and drags > 0.0:
            mode[g] = BACKWARD


@allocating_kernel
def correct_many(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> None:
    """Correct velocities as `correct_velocities`."""
    correct_velocities(problem, sizes, unknowns, _room(sizes))


@allocating_kernel
def _room(sizes: Sizes) -> Elimination:
    size = sizes.n + 2 * sizes.contacts + sizes.limited + SPARE
    return Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))


@allocating_kernel
def _solve_apart(whole: Part, found: Unknowns, tries: int, halt: Ints) -> bool:
    """Solve island after island, until one is left unsolved; returns whether none is."""
    apart = cut(whole)
    islands, contacts = len(apart.start) - 1, len(whole.mu)
    if islands == 1:
        return _solve_island(whole, found, tries, halt)
    for i in range(islands):
        part, own = island(whole, apart, i), guess(apart, i, found, contacts)
        if not _solve_island(part, own, tries, halt):
            return False
        hand_back(apart, i, own, found, contacts)
    return True


@allocating_kernel
def _solve_island(part: Part, found: Unknowns, tries: int, halt: Ints) -> bool:
    """Solve from the guess, or, with more tries, from where that led and from none; returns whether that is a
    solution. What rested goes on resting, by the same forces."""
    found.v[:] = 0.0
    if residual_of(part, found) <= RESTS:
        return exertion_of(part, found) <= WEDGED
    turns = 1 if tries == 1 else TURNS
    for _ in range(min(tries, TRIES - 1)):
        if solve_part(part, found, ENOUGH, turns, halt) <= TOLERANCE and exertion_of(part, found) <= WEDGED:
            return True
    if tries < TRIES:
        return False
    found.mode[:], found.force[:], found.tau[:] = OPEN, 0.0, 0.0
    for r in range(len(part.F)):
        found.mode[len(part.mu) + r] = STICK
    return bool(solve_part(part, found, ENOUGH, turns, halt) <= TOLERANCE)
