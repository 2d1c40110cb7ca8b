"""The chain that a planar step runs: warm mode guess, then Lemke, then, for few contacts, every mode.

Accepts: d = 2, H positive definite. Promises: SOLVED only with a residual within `TOLERANCE`; NO_SOLUTION is
a hint for the caller to shorten the step and, in the end, to look for a certificate.
"""

from __future__ import annotations

from rungwise.contact.modes import OPEN, STICK
from rungwise.contact.problem import ContactProblem
from rungwise.contact.solvers.enumerate_modes import MAX_MODES, mode_count, solve_by_enumeration
from rungwise.contact.solvers.lemke import SOLVED as LEMKE_SOLVED
from rungwise.contact.solvers.lemke import solve_lemke
from rungwise.contact.solvers.mode_newton import MAX_FLIPS, solve_by_modes
from rungwise.kernel import Ints, Reals, kernel

TOLERANCE = 1e-8
_ACCEPT = 1e-9
SOLVED, NO_SOLUTION = 0, 1
WARM, PIVOTED, PIVOTED_AS_IS = 0, 1, 2


def matrix_size(n: int, contacts: int, limited: int) -> int:
    """Side of the scratch matrix that `solve_planar` needs, one more in columns."""
    return n + 2 * contacts + limited


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
    """Solve, starting from `mode`, into v, force, tau and `mode`; returns (status, residual)."""
    found = 0.0
    for stage in (WARM, PIVOTED, PIVOTED_AS_IS):
        flips = MAX_FLIPS if stage == WARM else 1 if stage == PIVOTED else 0
        if stage != WARM and solve_lemke(problem, n, contacts, limited, mode, v, force, tau) != LEMKE_SOLVED:
            break
        found = solve_by_modes(problem, n, contacts, limited, mode, v, force, tau, matrix, order, flips)
        if found <= (_ACCEPT if stage == WARM else TOLERANCE):
            return SOLVED, found
        if contacts + limited == 0:
            return NO_SOLUTION, found
    if mode_count(contacts, limited) <= MAX_MODES:
        found = solve_by_enumeration(
            problem, n, contacts, limited, mode, v, force, tau, matrix, order, TOLERANCE
        )
        if found <= TOLERANCE:
            return SOLVED, found
    for k in range(contacts):
        mode[k] = OPEN
    for r in range(limited):
        mode[contacts + r] = STICK
    return NO_SOLUTION, found
