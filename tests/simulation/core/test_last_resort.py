"""What a step asks for that the compiled chain does not solve."""

from __future__ import annotations

from typing import Any

import numpy as np

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.simulation.core.last_resort import ask


def test_a_step_whose_sizes_no_numbers_scale_is_not_solved() -> None:
    """It ends a run as not converged, as every step that nothing solves; nothing is raised."""
    problem: Any = rw.Problem.local(1e200 * np.diag([2.0, 1.0, 1.0]), [-1e-200, -4e-201, 0.0], [0.5])
    unused: Any = None
    assert ask(problem, unused, unused, unused, NEVER) == (False, None)
