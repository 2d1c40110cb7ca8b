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
from rungwise.contact.step.spans import (
    NO_SPANS,
    NO_STRETCHES,
    Widths,
    diagonal,
    entry,
    has_column,
    place_in,
    span,
    stretch,
    whole_matrix,
    whole_rows,
)
from rungwise.contact.step.status import GUESS, NO_SOLUTION, PROXIMAL, SOLVED, TOLERANCE

__all__ = [
    "BACKWARD", "EXACT_BEGIN", "EXACT_COS", "EXACT_ROW", "EXACT_SIN", "FORWARD", "GUESS", "NAMES",
    "NO_SOLUTION", "NO_SPANS", "NO_STRETCHES", "NO_SURFACES", "OPEN", "PROXIMAL", "SOLVED", "STICK",
    "TOLERANCE", "ContactProblem", "Elimination", "Sizes", "Surfaces", "Unknowns", "Widths",
    "allocate_problem", "diagonal", "entry", "has_column", "keep_contacts", "matrix_size", "place_in", "span",
    "stretch", "trim", "whole_matrix", "whole_rows",
]  # fmt: skip
