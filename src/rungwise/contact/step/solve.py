"""The chain that a planar step runs: warm mode guess, proximal point, Lemke, and for few contacts every mode,
else every mode of few contacts that touch.

A mode with more closed rows than coordinates is no guess; the mode guess of a large system comes after the
proximal point. Accepts: d = 2, H positive definite. Promises: SOLVED only with a residual within `TOLERANCE`;
NO_SOLUTION is a hint for the caller to shorten the step and, in the end, to look for a certificate.
"""

from __future__ import annotations

import math

from rungwise.contact.step.enumerate_modes import MAX_MODES, mode_count, solve_by_enumeration
from rungwise.contact.step.mode_newton import MAX_FLIPS, solve_by_modes
from rungwise.contact.step.modes import OPEN, STICK
from rungwise.contact.step.pivoting import solve_by_pivoting
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.contact.step.proximal import collect, exertion, solve_proximal, spread
from rungwise.contact.step.step_residual import residual
from rungwise.kernel import Ints, kernel, rare_kernel

TOLERANCE = 1e-8
"""Residual, without unit (see `residual`), up to which a step is solved. Chosen by trial, to a decade."""
ENOUGH = 1e-9
"""Residual up to which a guess is taken, and a proximal point that improves no more. Chosen by trial, a
decade below `TOLERANCE`."""
WEDGED = 1e8
"""Forces that exceed the needs of loads and demanded rates by this factor belong to a singular mode: beside
them any other error looks small. Chosen by trial, to a decade."""
LARGE = 24
"""Size from which on complete pivoting of a mode's system takes longer than a proximal step."""
LARGEST = 600
"""Size up to which it takes no more than some tenths of a second, within which no halt is heard."""
SOLVED, NO_SOLUTION = 0, 1
GUESS, PROXIMAL, PIVOTING, ENUMERATION = 0, 1, 2, 3
"""Stages of the chain."""
_OPPOSITE = 1e-12
"""Two rows are opposite, and demands in conflict, to this relative error: about ten thousand roundings of
double precision. Chosen by trial, to a decade."""
SPARE = 8
"""Rows of the scratch matrix for vectors, beside the rows of the largest system."""


def matrix_size(n: int, contacts: int, limited: int) -> int:
    """Side of the scratch matrix that a step's chain needs, one more in columns."""
    return n + 2 * contacts + limited + SPARE


@kernel
def solve_planar(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination, halt: Ints
) -> tuple[int, float, int]:
    """Solve, starting from `mode`, `force` and `tau`, into these and v; returns (status, residual, the stage
    that the chain came to). It ends without when halt (1,) is set."""
    size = _determined_size(problem, sizes, unknowns.mode)
    kept = room.matrix[room.matrix.shape[0] - 2]
    if 0 < size <= LARGE:
        collect(sizes, unknowns, kept)
        found = solve_by_modes(problem, sizes, unknowns, room, MAX_FLIPS, halt)
        if found <= ENOUGH and exertion(problem, sizes, unknowns) <= WEDGED:
            return SOLVED, found, GUESS
        spread(sizes, kept, unknowns)
    if halt[0] != 0 or _is_squeezed(problem, sizes.n, sizes.contacts):
        _clear(sizes, unknowns)
        return NO_SOLUTION, residual(problem, sizes, unknowns), GUESS
    found = solve_proximal(problem, sizes, unknowns, room, ENOUGH, halt)
    if found > TOLERANCE and LARGE < size <= LARGEST:
        found = solve_by_modes(problem, sizes, unknowns, room, MAX_FLIPS, halt)
    if found <= TOLERANCE and exertion(problem, sizes, unknowns) <= WEDGED:
        return SOLVED, found, PROXIMAL
    if sizes.contacts + sizes.limited == 0:
        return NO_SOLUTION, found, PROXIMAL
    for polish in (True, False):
        if not solve_by_pivoting(problem, sizes, unknowns, False, halt):
            break
        if polish:
            found = solve_proximal(problem, sizes, unknowns, room, ENOUGH, halt)
        else:
            found = residual(problem, sizes, unknowns)
        if found <= TOLERANCE and exertion(problem, sizes, unknowns) <= WEDGED:
            return SOLVED, found, PIVOTING
    touching = mode_count(problem, sizes, False) > MAX_MODES
    if mode_count(problem, sizes, touching) <= MAX_MODES:
        found = solve_by_enumeration(problem, sizes, unknowns, room, touching, TOLERANCE)
        if found <= TOLERANCE and exertion(problem, sizes, unknowns) <= WEDGED:
            return SOLVED, found, ENUMERATION
    _clear(sizes, unknowns)
    if not math.isfinite(found):  # the last iterate has no measure; what is handed over has
        found = residual(problem, sizes, unknowns)
    return NO_SOLUTION, found, ENUMERATION


@rare_kernel
def _clear(sizes: Sizes, unknowns: Unknowns) -> None:
    """Set forces and velocities to zero, contacts open."""
    contacts, limited = sizes.contacts, sizes.limited
    mode, v, force, tau = unknowns
    v[:] = 0.0
    for k in range(contacts):
        mode[k] = OPEN
        force[2 * k] = force[2 * k + 1] = 0.0
    for r in range(limited):
        mode[contacts + r] = STICK
        tau[r] = 0.0


@kernel
def _is_squeezed(p: ContactProblem, n: int, contacts: int) -> bool:
    """Whether two rigid contacts push in opposite directions and demand more room than there is: W_i + ratio
    W_j = 0 while w_i + ratio w_j < 0."""
    for i in range(contacts):
        for j in range(i):
            a, b = 2 * i, 2 * j
            across, own, other = 0.0, 0.0, 0.0
            for k in range(n):
                across += p.W[a, k] * p.W[b, k] / p.H[k, k]
                own += p.W[a, k] * p.W[a, k] / p.H[k, k]
                other += p.W[b, k] * p.W[b, k] / p.H[k, k]
            if across >= 0.0 or p.R[i, 0, 0] != 0.0 or p.R[j, 0, 0] != 0.0:
                continue
            ratio, left = -across / other, 0.0
            for k in range(n):
                left = max(left, (p.W[a, k] + ratio * p.W[b, k]) ** 2 / p.H[k, k])
            demand = p.w[a] + ratio * p.w[b]
            sure = demand < -_OPPOSITE * (abs(p.w[a]) + ratio * abs(p.w[b]))
            if sure and left <= _OPPOSITE**2 * own:
                return True
    return False


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
