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
    ENUMERATION,
    NO_SOLUTION,
    PIVOTING,
    PROXIMAL,
    SOLVED,
    TOLERANCE,
    matrix_size,
    solve_planar,
)
from rungwise.contact.step.steady import correct_velocities
from rungwise.contact.step.worth import judged

__all__ = [
    "ANY", "BACKWARD", "ENUMERATION", "FORWARD", "NAMES", "NO_SOLUTION", "OPEN", "PIVOTING", "PROXIMAL",
    "SOLVED", "STICK", "TOLERANCE", "ContactProblem", "Elimination", "Sizes", "Unknowns", "allocate_problem",
    "correct_velocities", "judged", "keep_contacts", "matrix_size", "solve_planar", "start_associated",
    "trim",
]  # fmt: skip
