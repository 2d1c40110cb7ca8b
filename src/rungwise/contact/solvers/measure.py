"""How far a scaled iterate is from a solution: what solvers steer by. Answers are judged elsewhere."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.mixed import Array
from rungwise.contact.natural import natural_map
from rungwise.contact.system import System
from rungwise.kernel import Ints, Reals, inner_kernel, summing_kernel

_ROUNDING = 2.0**-53


def natural(system: System, x: Array, b: Array | None = None, shift: float = 0.0) -> float:
    """Norm of the natural map of x (N,) in the system A + shift with offset b, and what rounding hides."""
    s, out = system, np.empty((2, system.size))
    b = s.b if b is None else b
    return float(
        distance(s.row_start, s.column, s.value, b, shift, x, s.mu, s.directions, s.lower, s.upper, out)
    )


def natural_parts(system: System, x: Array) -> Array:
    """The natural map (N,), enlarged by the rounding of large unknowns; infinite where it is not finite."""
    s, out = system, np.empty((2, system.size))
    distance(s.row_start, s.column, s.value, s.b, 0.0, x, s.mu, s.directions, s.lower, s.upper, out)
    return np.where(np.isfinite(out[1]), out[1], np.inf)


@inner_kernel
def distance(
    row_start: Ints,
    column: Ints,
    value: Reals,
    b: Reals,
    shift: float,
    x: Reals,
    mu: Reals,
    d: int,
    lower: Reals,
    upper: Reals,
    out: Reals,
) -> float:
    """Fill out[1] (N,) with the natural map's sizes and rounding; returns its norm, or infinity."""
    y, error, total = out[0], out[1], 0.0
    rates(row_start, column, value, b, shift, x, y)
    natural_map(x, y, mu, d, lower, upper, error)
    for i in range(len(x)):
        error[i] = abs(error[i]) + _ROUNDING * abs(x[i])
        total += error[i] * error[i]
    return math.sqrt(total) if total < math.inf else math.inf


@inner_kernel
def rates(row_start: Ints, column: Ints, value: Reals, b: Reals, shift: float, x: Reals, y: Reals) -> None:
    """y = (A + shift) x + b."""
    for i in range(len(b)):
        y[i] = b[i] + shift * x[i] + row_times(row_start, column, value, i, x)


@summing_kernel
def row_times(row_start: Ints, column: Ints, value: Reals, i: int, x: Reals) -> float:
    """Row i of A times x (N,)."""
    row, place, total = value[row_start[i] : row_start[i + 1]], column[row_start[i] : row_start[i + 1]], 0.0
    if len(row) == len(x):
        for k in range(len(row)):
            total += row[k] * x[k]
    else:
        for k in range(len(row)):
            total += row[k] * x[place[k]]
    return total
