"""What a candidate is worth, from the problem alone: no solver has a say in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from rungwise.contact.mixed import Array, Problem
from rungwise.contact.natural import natural_map
from rungwise.contact.system import System, units

_ROUNDING, _FLOOR = 2.0**-54, 1e-6


@dataclass(frozen=True)
class Residuals:
    """Violations of each law by forces r and rates u = A x + b.

    `natural` and `balance` have no unit and decide: the norm of the natural map of the exact law, each
    contact measured in a unit of its own, over the norm of the rates without forces; and the largest
    imbalance of a free row over the sum of its terms, unit forces included. The others tell where the fault
    is, in the problem's own units: penetration [velocity] the greatest -u_n; cone [force] the greatest
    |r_t| - mu r_n, or -r_n; complementarity [power] the greatest |r_n u_n|; dissipation [power] the greatest
    |mu r_n |u_t| + r_t . u_t|; limits [of the unknown] the greatest excess over its limits.
    """

    natural: float
    balance: float
    penetration: float
    cone: float
    complementarity: float
    dissipation: float
    limits: float

    @property
    def worst(self) -> float:
        """The one to hold against a tolerance."""
        return max(self.natural, self.balance)


def judge(problem: Problem, system: System, x: Array) -> Residuals:
    """Residuals of x (N,); `system` gives the units only. Infinite where x is not finite."""
    if not np.isfinite(x).all():
        return Residuals(*[np.inf] * 7)
    rows, d = problem.rows, problem.directions
    y = problem.A @ x + problem.b
    kept = system.kept
    natural = natural_map(
        x[kept] / system.force,
        y[kept] / system.rate,
        system.mu,
        d,
        system.lower,
        system.upper,
        np.empty(len(kept)),
    )
    # What rounding leaves in the rates: no residual is known better than that.
    doubt = _ROUNDING * float(np.linalg.norm((abs(problem.A) @ np.abs(x))[kept] / system.rate))
    r, u = x[:rows].reshape(-1, d), y[:rows].reshape(-1, d)
    pull, slip = np.linalg.norm(r[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    return Residuals(
        max(float(natural), doubt),
        _imbalance(problem, system, x, y),
        float((-u[:, 0]).max(initial=0.0)),
        float(np.maximum(pull - problem.mu * r[:, 0], -r[:, 0]).max(initial=0.0)),
        float(np.abs(r[:, 0] * u[:, 0]).max(initial=0.0)),
        float(np.abs(problem.mu * r[:, 0] * slip + (r[:, 1:] * u[:, 1:]).sum(axis=1)).max(initial=0.0)),
        float(np.maximum(problem.lower - x[rows:], x[rows:] - problem.upper).max(initial=0.0)),
    )


def _imbalance(problem: Problem, system: System, x: Array, y: Array) -> float:
    """The largest |y| of a free row, over the sum of the row's terms and of what unit forces do in it.

    A row whose terms are nothing beside those of others, in units of its unknown, is not held to them.
    """
    free = problem.rows + np.flatnonzero(np.isneginf(problem.lower) & np.isposinf(problem.upper))
    if len(free) == 0:
        return 0.0
    rows = abs(problem.A[free])
    size = np.abs(x)
    size[system.kept] += system.force
    terms = rows @ size + np.abs(problem.b[free])
    unit = units(sp.csr_array(rows[:, free]), 0, 1)
    floor = _FLOOR * float((unit * terms).max()) / unit
    return float((np.abs(y[free]) / np.where(terms + floor > 0.0, terms + floor, 1.0)).max())
