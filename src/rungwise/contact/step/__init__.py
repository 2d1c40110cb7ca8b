"""The problem of one step, whatever model it came from, and what comes of it."""

from rungwise.contact.step.modes import BACKWARD, FORWARD, NAMES, OPEN, STICK
from rungwise.contact.step.problem import (
    EXACT_BEGIN,
    EXACT_COS,
    EXACT_ROW,
    EXACT_SIN,
    NO_SURFACES,
    ContactProblem,
    Elimination,
    Sizes,
    Surfaces,
    Unknowns,
    allocate_problem,
    keep_contacts,
    matrix_size,
    trim,
)
from rungwise.contact.step.status import GUESS, NO_SOLUTION, PROXIMAL, SOLVED, TOLERANCE

__all__ = [
    "BACKWARD", "EXACT_BEGIN", "EXACT_COS", "EXACT_ROW", "EXACT_SIN", "FORWARD", "GUESS", "NAMES",
    "NO_SOLUTION", "NO_SURFACES", "OPEN", "PROXIMAL", "SOLVED", "STICK", "TOLERANCE",
    "ContactProblem", "Elimination", "Sizes", "Surfaces", "Unknowns", "allocate_problem", "keep_contacts",
    "matrix_size", "trim",
]  # fmt: skip
