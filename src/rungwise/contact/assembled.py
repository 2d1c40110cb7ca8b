"""What compiled steps run (`contact/solver/problem.py`), called on one step's problem from Python.

Algorithm and promises: as there. Accepts: problems of a step, as models assemble them, with H positive
definite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.step import NO_SURFACES, matrix_size
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.kernel import Ints


def accepts(step: ContactProblem) -> bool:
    """Whether H is positive definite."""
    if len(step.c) == 0:
        return False
    try:
        np.linalg.cholesky(step.H)
    except np.linalg.LinAlgError:
        return False
    return True


def solve_assembled(step: ContactProblem, start: NDArray[np.float64], halt: Ints) -> NDArray[np.float64]:
    """Unknowns (lambda, v, tau) (2 k + n + b,), from `start`, whose modes are guessed from its forces, until
    halt (1,) is set."""
    contacts, n, limited, d = len(step.mu), len(step.c), len(step.F), step.R.shape[1]
    force, v, tau = (np.array(part) for part in np.split(start, [d * contacts, d * contacts + n]))
    normal, tangential = force[::d], force[1::d]
    modes = np.where(normal <= 0.0, OPEN, STICK)
    slips = (modes == STICK) & (np.abs(tangential) >= step.mu * normal * (1.0 - 1e-9)) & (step.mu > 0.0)
    modes = np.where(slips, np.where(tangential > 0.0, BACKWARD, FORWARD), modes)
    mode = np.concatenate([modes, np.full(limited, STICK)]).astype(np.int64)
    size = matrix_size(n, contacts, limited) if d == 2 else 0
    room, nowhere = (
        Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64)),
        np.empty((0, 4), np.int64),
    )
    solve_problem(
        step,
        Sizes(n, contacts, limited),
        Unknowns(mode, v, force, tau),
        NO_SURFACES,
        nowhere,
        nowhere,
        room,
        halt,
    )
    return np.concatenate([force, v, tau])
