"""How good an answer to a planar step's problem is that did not come from its chain."""

from __future__ import annotations

import math

from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.contact.step.proximal import exertion
from rungwise.contact.step.solve import WEDGED
from rungwise.contact.step.step_residual import residual
from rungwise.kernel import kernel


@kernel
def judged(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """The residual, as `solve_planar` returns it; inf where forces belong to a singular mode."""
    if not exertion(problem, sizes, unknowns) <= WEDGED:
        return math.inf
    return float(residual(problem, sizes, unknowns))
