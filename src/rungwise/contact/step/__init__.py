"""The problem of one compiled step, and the chain that solves it in the plane."""

from rungwise.contact.step.associated import start_associated
from rungwise.contact.step.modes import ANY, BACKWARD, FORWARD, NAMES, OPEN, STICK
from rungwise.contact.step.problem import (
    ContactProblem,
    Elimination,
    Sizes,
    Unknowns,
    allocate_problem,
    keep_contacts,
    trim,
)
from rungwise.contact.step.solve import (
    GUESS,
    NO_SOLUTION,
    PROXIMAL,
    SEARCH,
    SOLVED,
    TOLERANCE,
    matrix_size,
    solve_problem,
)

__all__ = [
    "ANY", "BACKWARD", "FORWARD", "GUESS", "NAMES", "NO_SOLUTION", "OPEN", "PROXIMAL", "SEARCH", "SOLVED",
    "STICK", "TOLERANCE", "ContactProblem", "Elimination", "Sizes", "Unknowns", "allocate_problem",
    "keep_contacts", "matrix_size", "solve_problem", "start_associated", "trim",
]  # fmt: skip
