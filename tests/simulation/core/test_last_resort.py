"""What a step asks for that the compiled chain does not solve."""

from __future__ import annotations

from typing import Any

import numpy as np

from rungwise.contact.step import allocate_problem
from rungwise.deadline import NEVER
from rungwise.simulation.core.last_resort import ask


def test_a_step_whose_sizes_no_numbers_scale_is_not_solved() -> None:
    """It ends a run as not converged, as every step that nothing solves; nothing is raised."""
    problem, unused = allocate_problem(3, 1, 0, 3), None
    problem.H[:], problem.W[:], problem.mu[:] = 1e-200 * np.eye(3), np.eye(3), 0.5
    problem.c[:], problem.w[:] = (-1e200, 0.0, 0.0), (-1e-200, -4e-201, 0.0)
    given: Any = (problem, unused, unused, unused, NEVER)
    assert ask(*given) == (None, False)
