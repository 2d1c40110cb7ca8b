"""What a step runs: of few bodies in the plane a warm guess of modes, then the contact solver.

A mode with more closed rows than coordinates is no guess. Promises: SOLVED only with a residual within
`TOLERANCE`; NO_SOLUTION is a hint for the caller to shorten the step and, in the end, to look for a
certificate.
"""

from __future__ import annotations

from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.guess import MAX_FLIPS, solve_by_modes
from rungwise.contact.step.modes import OPEN, STICK
from rungwise.contact.step.problem import SPARE, ContactProblem, Elimination, Sizes, Surfaces, Unknowns
from rungwise.contact.step.status import GUESS, SOLVED
from rungwise.kernel import Ints, Reals, imported_kernel, kernel

EXACT, NEAR = 1e-14, 1e-9
"""Residual up to which a guess is taken, and up to which the solver starts from it: where next to nothing
resists a motion, a residual above rounding moves bodies far."""
LARGE = 24
"""Size of a mode's system from which on the contact solver is faster."""


@imported_kernel("rungwise.contact.solver.step")
def solve_groups(
    p: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    law: int,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> tuple[int, float, int, int]:
    """See the module."""
    raise NotImplementedError


@kernel
def solve_problem(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    room: Elimination,
    halt: Ints,
) -> tuple[int, float, int]:
    """Solve, starting from `mode`, v, `force` and `tau`, into these; returns (status, residual, what
    answered). It ends without when halt (1,) is set. `surfaces`, `columns` and `couplings`: see
    `solve_groups`; `room` is too small (see `matrix_size`) where no modes are guessed."""
    fits = len(room.order) >= sizes.n + 2 * sizes.contacts + sizes.limited + SPARE
    if fits and problem.R.shape[1] == 2 and len(surfaces.number) == 0:
        size = _determined_size(problem, sizes, unknowns.mode)
        if 0 < size <= LARGE:
            forces, v = room.matrix[room.matrix.shape[0] - 2], room.matrix[room.matrix.shape[0] - 3]
            collect(sizes, unknowns, forces, v)
            found = solve_by_modes(problem, sizes, unknowns, room, MAX_FLIPS, halt)
            if found <= EXACT:
                return SOLVED, found, GUESS
            if found > NEAR:
                spread(sizes, forces, v, unknowns)
    status, found, stage, _ = solve_groups(problem, sizes, unknowns, CONE, surfaces, columns, couplings, halt)
    return status, found, stage


@kernel
def collect(sizes: Sizes, unknowns: Unknowns, all_forces: Reals, v: Reals) -> None:
    """Copy the forces of contacts and limited rows into one vector, and velocities into another."""
    for i in range(sizes.n):
        v[i] = unknowns.v[i]
    rows = 2 * sizes.contacts
    for r in range(rows):
        all_forces[r] = unknowns.force[r]
    for r in range(sizes.limited):
        all_forces[rows + r] = unknowns.tau[r]


@kernel
def spread(sizes: Sizes, all_forces: Reals, v: Reals, unknowns: Unknowns) -> None:
    """Copy forces from one vector into those of contacts and limited rows, and velocities from another."""
    for i in range(sizes.n):
        unknowns.v[i] = v[i]
    rows = 2 * sizes.contacts
    for r in range(rows):
        unknowns.force[r] = all_forces[r]
    for r in range(sizes.limited):
        unknowns.tau[r] = all_forces[rows + r]


@kernel
def _determined_size(p: ContactProblem, sizes: Sizes, mode: Ints) -> int:
    """Size of the mode's system; 0 if it cannot determine forces: more rigid rows than coordinates."""
    n, contacts, limited = sizes
    rigid, rows = 0, 0
    for k in range(contacts):
        if mode[k] != OPEN:
            closed = 2 if mode[k] == STICK and p.mu[k] > 0.0 else 1
            rows += closed
            rigid += closed if p.R[k, 0, 0] == 0.0 else 0
    for r in range(limited):
        if mode[contacts + r] == STICK:
            rows += 1
            rigid += 1 if p.R_s[r] == 0.0 else 0
    return n + rows if rigid <= n else 0
