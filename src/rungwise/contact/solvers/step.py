"""The chain of compiled steps (`contact/step/solve.py`), called on one step's problem from Python.

Algorithm and promises: as there. Accepts: problems of a step in the plane, as models assemble them, with H
positive definite. The chain solves in velocities, not in forces: it is the fastest for stacks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.contact.step.solve import matrix_size, solve_planar
from rungwise.kernel import Ints

NAME = "step"


def accepts(step: ContactProblem) -> bool:
    """Whether the problem is planar and its H positive definite."""
    if step.R.shape[1] != 2 or len(step.c) == 0:
        return False
    try:
        np.linalg.cholesky(step.H)
    except np.linalg.LinAlgError:
        return False
    return True


def solve(step: ContactProblem, start: NDArray[np.float64], halt: Ints) -> NDArray[np.float64]:
    """Unknowns (lambda, v, tau) (2 k + n + b,), from `start`, whose modes are guessed from its forces, until
    halt (1,) is set."""
    contacts, n, limited = len(step.mu), len(step.c), len(step.F)
    force, v, tau = (np.array(part) for part in np.split(start, [2 * contacts, 2 * contacts + n]))
    normal, tangential = force[::2], force[1::2]
    modes = np.where(normal <= 0.0, OPEN, STICK)
    slips = (modes == STICK) & (np.abs(tangential) >= step.mu * normal * (1.0 - 1e-9)) & (step.mu > 0.0)
    modes = np.where(slips, np.where(tangential > 0.0, BACKWARD, FORWARD), modes)
    mode = np.concatenate([modes, np.full(limited, STICK)]).astype(np.int64)
    size = matrix_size(n, contacts, limited)
    room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
    solve_planar(step, Sizes(n, contacts, limited), Unknowns(mode, v, force, tau), room, halt)
    return np.concatenate([force, v, tau])
