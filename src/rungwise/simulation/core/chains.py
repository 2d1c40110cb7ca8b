"""Which chain solves a step's problem: of few bodies in the plane, of many, on supports, or in space."""

from __future__ import annotations

from rungwise.contact.step import ContactProblem, Sizes, Unknowns, correct_velocities, solve_planar
from rungwise.kernel import Ints, imported_kernel, inner_kernel
from rungwise.simulation.core.state import Scratch, elimination_in, unknowns_in
from rungwise.system.entries import is_crowded
from rungwise.system.terms import Terms


@imported_kernel("rungwise.contact.solvers.plane.chain")
def solve_sparse(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, columns: Ints, couplings: Ints, halt: Ints
) -> tuple[int, float, int]:
    """Solve the step's problem of many bodies in the plane, as `solve_planar`."""
    raise NotImplementedError


@imported_kernel("rungwise.contact.solvers.plane.chain")
def correct_many(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> None:
    """Correct the velocities of many bodies in the plane, as `correct_velocities`."""
    raise NotImplementedError


@imported_kernel("rungwise.contact.solvers.space.chain")
def solve_spatial(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, columns: Ints, couplings: Ints, halt: Ints
) -> tuple[int, float, int]:
    """Solve the step's problem where contacts have three directions; v holds velocities to start from."""
    raise NotImplementedError


@imported_kernel("rungwise.contact.solvers.space.balls")
def solve_with_balls(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    surface: Ints,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> float:
    """Solve the step's problem where limited rows share balls; returns the residual."""
    raise NotImplementedError


@inner_kernel
def solve_in_space(
    problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch
) -> tuple[int, float, int]:
    """Solve from the forces and velocities of the scratch, into these; returns as `solve_spatial`."""
    entries = terms.entries
    return solve_spatial(
        problem, sizes, unknowns_in(scratch), entries.columns, entries.couplings, scratch.halt
    )


@inner_kernel
def solve_on_surfaces(problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch) -> float:
    """Solve from the forces and velocities of the scratch, into these, with rows that share surfaces as they
    are; returns the residual."""
    entries = terms.entries
    return solve_with_balls(
        problem, sizes, unknowns_in(scratch), terms.surface, entries.columns, entries.couplings, scratch.halt
    )


@inner_kernel
def solve_in_plane(
    problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch
) -> tuple[int, float, int]:
    """Solve from the modes and forces of the scratch, into these; returns as `solve_planar`."""
    unknowns = unknowns_in(scratch)
    if is_crowded(terms.entries):
        return solve_sparse(
            problem, sizes, unknowns, terms.entries.columns, terms.entries.couplings, scratch.halt
        )
    return solve_planar(problem, sizes, unknowns, elimination_in(scratch), scratch.halt)


@inner_kernel
def correct_in_plane(problem: ContactProblem, sizes: Sizes, terms: Terms, scratch: Scratch) -> None:
    """Correct the velocities of an answer by the contacts that hold."""
    if is_crowded(terms.entries):
        correct_many(problem, sizes, unknowns_in(scratch))
    else:
        correct_velocities(problem, sizes, unknowns_in(scratch), elimination_in(scratch))
