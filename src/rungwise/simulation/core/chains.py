"""The problem of a step, from the forces, velocities and modes of its scratch, into these."""

from __future__ import annotations

from rungwise.contact.step import ContactProblem, Sizes
from rungwise.contact.step.solve import solve_problem
from rungwise.kernel import inner_kernel
from rungwise.simulation.core.state import Scratch, elimination_in, unknowns_in
from rungwise.system.terms import Terms


@inner_kernel
def solve_scratch(
    problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch, shared: bool
) -> tuple[int, float, int]:
    """Solve as `solve_problem`; `shared`: limited rows share the balls of their surfaces."""
    entries = terms.entries
    surface = terms.surface if shared else terms.surface[:0]
    return solve_problem(
        problem, sizes, unknowns_in(scratch), surface, entries.columns, entries.couplings,
        elimination_in(scratch), scratch.halt,
    )  # fmt: skip
