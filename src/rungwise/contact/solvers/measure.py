"""Distance of a scaled iterate from a solution, by which solvers steer. Answers are judged elsewhere."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.judge.natural import natural_map
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array, Laws
from rungwise.kernel import Reals, inner_kernel, kernel, summing_kernel

_ROUNDING = 2.0**-53
"""Largest relative error of one rounding in double precision."""


def natural(system: System, x: Array, b: Array | None = None, shift: float = 0.0) -> float:
    """Norm of the natural map of x (N,) in the system A + shift with offset b, with the part that rounding
    hides."""
    s, out = system, np.empty((2, system.size))
    b = s.b if b is None else b
    if s.product is None:
        return float(distance(s.form.entries, b, shift, x, s.laws, out))
    all_rates(s, x, b, shift, out[0])
    return float(distance_at(out[0], x, s.laws, out[1]))


def natural_parts(system: System, x: Array) -> Array:
    """The natural map (N,), enlarged by the rounding of large unknowns; infinite where the map is not
    finite."""
    s, y, out = system, np.empty(system.size), np.empty(system.size)
    all_rates(s, x, s.b, 0.0, y)
    distance_at(y, x, s.laws, out)
    return np.where(np.isfinite(out), out, np.inf)


def all_rates(system: System, x: Array, b: Array, shift: float, y: Array) -> None:
    """y = (A + shift) x + b."""
    s, p = system, system.product
    if p is None:
        rates(s.form.entries, b, shift, x, y)
    else:
        rates_by_parts(
            p.front, p.back, p.response, b, shift, x, s.rows, s.directions, np.empty(p.velocities), y
        )


@inner_kernel
def distance(A: Sparse, b: Reals, shift: float, x: Reals, laws: Laws, out: Reals) -> float:
    """Fill out[1] (N,) with the natural map's sizes and rounding; returns its norm, or infinity."""
    rates(A, b, shift, x, out[0])
    return distance_at(out[0], x, laws, out[1])


@inner_kernel
def distance_at(y: Reals, x: Reals, laws: Laws, out: Reals) -> float:
    """The norm that `distance` returns, for given rates y; `out` (N,) gets the sizes."""
    natural_map(x, y, laws, out)
    total = 0.0
    for i in range(len(x)):
        out[i] = abs(out[i]) + _ROUNDING * abs(x[i])
        total += out[i] * out[i]
    return math.sqrt(total) if total < math.inf else math.inf


@inner_kernel
def rates(A: Sparse, b: Reals, shift: float, x: Reals, y: Reals) -> None:
    """y = (A + shift) x + b."""
    for i in range(len(b)):
        y[i] = b[i] + shift * x[i] + row_times(A, i, x)


@kernel
def rates_by_parts(
    front: Reals,
    back: Sparse,
    response: Sparse,
    b: Reals,
    shift: float,
    x: Reals,
    rows: int,
    d: int,
    v: Reals,
    y: Reals,
) -> None:
    """y = (F - B R + shift) x + b; v, as long as R has rows, becomes R x."""
    for i in range(len(v)):
        v[i] = 0.0
    for i in range(len(x)):
        for k in range(response.start[i], response.start[i + 1]):
            v[response.place[k]] += response.value[k] * x[i]
    for i in range(len(x)):
        first, width = (i // d * d, d) if i < rows else (i, 1)
        total = b[i] + shift * x[i]
        for j in range(width):
            total += front[i, j] * x[first + j]
        for k in range(back.start[i], back.start[i + 1]):
            total -= back.value[k] * v[back.place[k]]
        y[i] = total


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
