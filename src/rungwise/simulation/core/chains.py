"""The problem of a step, from the forces, velocities and modes of its scratch, into these."""

from __future__ import annotations

from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.step import ContactProblem, Sizes, Surfaces, Unknowns
from rungwise.kernel import Ints, imported_kernel, inner_kernel
from rungwise.simulation.core.state import Scratch, elimination_in, unknowns_in
from rungwise.system.terms import Terms


@imported_kernel("rungwise.contact.solver.associated")
def start_associated(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> bool:
    """See the module."""
    raise NotImplementedError


@inner_kernel
def surfaces_in(terms: Terms, shared: bool) -> Surfaces:
    """Those of the terms, if limited rows share any."""
    return Surfaces(terms.surface if shared else terms.surface[:0], terms.exact, terms.pressures)


@inner_kernel
def start_scratch(
    problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch, shared: bool
) -> bool:
    """Let the scratch start from the forces that let bodies rest, as `start_associated`."""
    entries = terms.entries
    return start_associated(
        problem,
        sizes,
        unknowns_in(scratch),
        surfaces_in(terms, shared),
        entries.columns,
        entries.couplings,
        scratch.halt,
    )


@inner_kernel
def solve_scratch(
    problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch, shared: bool
) -> tuple[int, float, int]:
    """Solve as `solve_problem`; `shared`: limited rows share surfaces."""
    entries = terms.entries
    return solve_problem(
        problem, sizes, unknowns_in(scratch), surfaces_in(terms, shared), entries.columns, entries.couplings,
        elimination_in(scratch), scratch.halt,
    )  # fmt: skip
