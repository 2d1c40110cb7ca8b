"""The chain that a planar step runs: warm mode guess, proximal point, Lemke, and for few contacts every mode.

Large systems, and those with more closed rows than coordinates, skip the guess. Accepts: d = 2, H positive
definite. Promises: SOLVED only with a residual within `TOLERANCE`; NO_SOLUTION is a hint for the caller to
shorten the step and, in the end, to look for a certificate.
"""

from __future__ import annotations

from rungwise.contact.modes import OPEN, STICK
from rungwise.contact.problem import ContactProblem
from rungwise.contact.residual import residual
from rungwise.contact.solvers.enumerate_modes import MAX_MODES, mode_count, solve_by_enumeration
from rungwise.contact.solvers.lemke import SOLVED as LEMKE_SOLVED
from rungwise.contact.solvers.lemke import solve_lemke
from rungwise.contact.solvers.mode_newton import MAX_FLIPS, solve_by_modes
from rungwise.contact.solvers.proximal import collect, solve_proximal, spread
from rungwise.kernel import Ints, Reals, kernel

TOLERANCE = 1e-8
_ACCEPT = 1e-9
LARGE = 16
"""Size from which on complete pivoting of a mode's system takes longer than a proximal step."""
SOLVED, NO_SOLUTION = 0, 1
_SPARE = 8


def matrix_size(n: int, contacts: int, limited: int) -> int:
    """Side of the scratch matrix that `solve_planar` needs, one more in columns."""
    return n + 2 * contacts + limited + _SPARE


@kernel
def solve_planar(
    problem: ContactProblem,
    n: int,
    contacts: int,
    limited: int,
    mode: Ints,
    v: Reals,
    force: Reals,
    tau: Reals,
    matrix: Reals,
    order: Ints,
) -> tuple[int, float]:
    """Solve, starting from `mode`, `force` and `tau`, into these and v; returns (status, residual)."""
    if _is_determined(problem, n, contacts, limited, mode):
        kept = matrix[matrix.shape[0] - 2]
        collect(contacts, limited, force, tau, kept)
        found = solve_by_modes(problem, n, contacts, limited, mode, v, force, tau, matrix, order, MAX_FLIPS)
        if found <= _ACCEPT:
            return SOLVED, found
        spread(contacts, limited, kept, force, tau)
    found = solve_proximal(problem, n, contacts, limited, mode, v, force, tau, matrix, order, _ACCEPT)
    if found <= TOLERANCE:
        return SOLVED, found
    if contacts + limited == 0:
        return NO_SOLUTION, found
    for polish in (True, False):
        if solve_lemke(problem, n, contacts, limited, mode, v, force, tau) != LEMKE_SOLVED:
            break
        if polish:
            found = solve_proximal(problem, n, contacts, limited, mode, v, force, tau, matrix, order, _ACCEPT)
        else:
            found = residual(problem, n, contacts, limited, v, force, tau)
        if found <= TOLERANCE:
            return SOLVED, found
    if mode_count(contacts, limited) <= MAX_MODES:
        found = solve_by_enumeration(
            problem, n, contacts, limited, mode, v, force, tau, matrix, order, TOLERANCE
        )
        if found <= TOLERANCE:
            return SOLVED, found
    for k in range(contacts):
        mode[k] = OPEN
        force[2 * k] = force[2 * k + 1] = 0.0
    for r in range(limited):
        mode[contacts + r] = STICK
        tau[r] = 0.0
    return NO_SOLUTION, found


@kernel
def _is_determined(p: ContactProblem, n: int, contacts: int, limited: int, mode: Ints) -> bool:
    """Whether the mode's system is small and may determine forces: no more rigid rows than coordinates."""
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
    return rigid <= n and n + rows <= LARGE
