"""All solutions, closure, sensitivities."""

from rungwise.contact.analysis.all_solutions import extreme_motions, solutions
from rungwise.contact.analysis.closure import Closure, force_closure, form_closure
from rungwise.contact.analysis.pieces import Kind, Piece, Solutions
from rungwise.contact.analysis.sensitivity import DATA, RightHandSide, Sensitivity, sensitivity

__all__ = [
    "DATA", "Closure", "Kind", "Piece", "RightHandSide", "Sensitivity", "Solutions", "extreme_motions",
    "force_closure", "form_closure", "sensitivity", "solutions",
]  # fmt: skip
