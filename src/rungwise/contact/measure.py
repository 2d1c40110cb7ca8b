"""Distance of a scaled iterate from a solution, by which solvers steer. Answers are judged elsewhere."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.judge.natural import natural_map
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
    """Norm of the natural map of x (N,), with the part that rounding hides."""
    return float(distance(system.form.entries, system.b, x, system.laws, np.empty((2, system.size))))


def natural_parts(system: System, x: Array) -> Array:
    """The natural map (N,), enlarged by the rounding of large unknowns; infinite where the map is not
    finite."""
    out = np.empty((2, system.size))
    distance(system.form.entries, system.b, x, system.laws, out)
    return np.where(np.isfinite(out[1]), out[1], np.inf)


@kernel
def distance(A: Sparse, b: Reals, x: Reals, laws: Laws, out: Reals) -> float:
    """Fill out[1] (N,) with the natural map's sizes and rounding; returns its norm, or infinity."""
    y, sizes, total = out[0], out[1], 0.0
    for i in range(len(b)):
        y[i] = b[i] + row_times(A, i, x)
    natural_map(x, y, laws, sizes)
    for i in range(len(x)):
        sizes[i] = abs(sizes[i]) + _ROUNDING * abs(x[i])
        total += sizes[i] * sizes[i]
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
    actual, out = float((terms[kept] / system.rate).max(initial=0.0)), np.empty(len(kept))
    if not 0.0 < actual < SMALL:
        return 0.0
    return natural_map(x[kept] / system.force, y[kept] / system.rate, system.laws, out) / actual


def rate_terms(problem: Problem, x: Array) -> Array:
    """The sums of the sizes of the terms of the rates of x."""
    return np.asarray(absolute(problem) @ np.abs(x) + np.abs(problem.b))
