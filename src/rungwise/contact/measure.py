"""Distance of a scaled iterate from a solution, by which solvers steer. Answers are judged elsewhere."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.judge.laws import fill_violations
from rungwise.contact.judge.residuals import absolute
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array, Laws, Problem
from rungwise.kernel import Reals, kernel, summing_kernel

_ROUNDING = 2.0**-53
"""Largest relative error of one rounding in double precision."""
SMALL = 1e-6
"""Rates below this share of the rates without forces mean that inertia does not matter; chosen by trial, to
a decade."""


def natural(system: System, x: Array) -> float:
    """Norm of the violations of the laws by x (N,), with the part that rounding hides."""
    rates, found = np.empty(system.size), np.empty(len(system.mu) + len(system.lower))
    return float(distance(system.form.entries, system.b, x, system.laws, rates, found))


def of_each_law(system: System, x: Array) -> Array:
    """The violation of each law by x (N,), contacts first; infinite where it is not finite."""
    rates, found = np.empty(system.size), np.empty(len(system.mu) + len(system.lower))
    distance(system.form.entries, system.b, x, system.laws, rates, found)
    return np.where(np.isfinite(found), found, np.inf)


@kernel
def distance(A: Sparse, b: Reals, x: Reals, laws: Laws, y: Reals, found: Reals) -> float:
    """Fill y (N,) with the rates and found (laws,) with the violations of the laws; returns their norm, with
    the rounding of the unknowns, or infinity."""
    total = 0.0
    for i in range(len(b)):
        y[i] = b[i] + row_times(A, i, x)
        total += (_ROUNDING * x[i]) ** 2
    total += fill_violations(laws, x, y, found) ** 2
    return math.sqrt(total) if total < math.inf else math.inf


@summing_kernel
def row_times(A: Sparse, i: int, x: Reals) -> float:
    """Row i of A times x (N,)."""
    first, end, total = A.start[i], A.start[i + 1], 0.0
    row, place = A.value[first:end], A.place[first:end]
    if len(row) == len(x):
        for k in range(len(row)):
            total += row[k] * x[k]
    else:
        for k in range(len(row)):
            total += row[k] * x[place[k]]
    return total


def rate_error(problem: Problem, system: System, x: Array) -> float:
    """The natural map beside the largest sum of a rate's terms, in units of the rates without forces; zero
    unless the rates without forces are far larger."""
    kept = system.kept
    y, terms = problem.A @ x + problem.b, rate_terms(problem, x)
    actual = float((terms[kept] / system.rate).max(initial=0.0))
    found = np.empty(len(system.mu) + len(system.lower))
    if not 0.0 < actual < SMALL:
        return 0.0
    return fill_violations(system.laws, x[kept] / system.force, y[kept] / system.rate, found) / actual


def rate_terms(problem: Problem, x: Array) -> Array:
    """The sums of the sizes of the terms of the rates of x."""
    return np.asarray(absolute(problem) @ np.abs(x) + np.abs(problem.b))
