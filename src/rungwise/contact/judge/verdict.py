"""The worth of a candidate, from the problem alone: no solver has a say in the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from rungwise.contact.judge.natural import contact_map, natural_map
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import Sparse, compressed, fitted, part
from rungwise.contact.problem import Array, Laws, Matrix, Problem
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

OWN = 0.03
"""Weight of a violation in a row's own terms: at a tolerance of 1e-9 none may be more than 3e-8 of these
terms. With a larger weight, answers that are as good as rounding of the norm of all rows allows would not
count as solutions."""
_FINE = 1e-9
"""A violation of a row by no more than this share of its own terms does not count: the rounding of larger
rows may cause it, and tolerances finer than 1e-9 concern the norm of all rows."""
_ROUNDING, _FLOOR = 2.0**-54, 1e-6
"""Least residual, over the norm of the rates' terms: half a rounding of double precision. Least terms of a
free row, over the greatest of all, by trial: at a tolerance of 1e-9 it may err by 1e-15 of these, a few
roundings."""
_AT_REST, _FAINT = 2.0**-44, 1e-5
"""A row whose terms are no more than the first share of the terms of all rows is at rest: its terms are
rounding of other rows, and count beside the second share, of which 1e-11 / `OWN` is 30 roundings. The first
is 512 roundings of double precision, chosen by trial."""


class Units(NamedTuple):
    """Units of forces and rates (n,) of the kept unknowns, and the places of these (n,)."""

    kept: Ints
    force: Array
    rate: Array


@dataclass(frozen=True)
class Residuals:
    """Violations of each law by forces r and rates u = A x + b.

    `natural` and `balance` have no unit and decide: the norm of the natural map of the exact law, each
    contact measured in a unit of its own, over the norm of the rates without forces; and the largest
    imbalance of a free row over the sum of its terms, unit forces included. `natural` is no less than any
    penetration in these units, which great friction would hide, nor than `OWN` times `in_own_terms`, the
    largest violation of a row of the problem as it was given beside the terms of this row alone. The others
    tell where the fault is, in the problem's own units: penetration [velocity] the greatest -u_n; cone
    [force] the greatest |r_t| - mu r_n, or -r_n; complementarity [power] the greatest |r_n u_n|; dissipation
    [power] the greatest |mu r_n |u_t| + r_t . u_t|; limits [of the unknown] the greatest excess over its
    limits.
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
        """The residual to hold against a tolerance."""
        return max(self.natural, self.balance)


def judge(problem: Problem, system: System, x: Array) -> Residuals:
    """Residuals of x (N,); `system` gives the units only. Infinite where x is not finite."""
    return judged(problem, system, x)[0]


@np.errstate(over="ignore", invalid="ignore")  # iterates that ran away are not finite, which is told
def judged(problem: Problem, system: System, x: Array) -> tuple[Residuals, Array]:
    """Residuals of x (N,), and its rates y = A x + b (N,)."""
    y = problem.A @ x + problem.b
    if not math.isfinite(float(y @ y)):
        return Residuals(*[np.inf] * 7), y
    scales, found = _scales(problem), np.empty(7)
    terms = scales.absolute @ np.abs(x)
    units, scratch = Units(system.kept, system.force, system.rate), np.empty((3, len(system.kept)))
    violations(x, y, terms, units, system.laws, problem.lower, problem.upper, scratch, found)
    found[1] = _imbalance(problem, system, scales, x, y)
    own = _in_own_terms(problem, system, x, y, terms)
    found[0] = max(found[0], OWN * own if own > _FINE else 0.0)
    return Residuals(*found.tolist()), y


@kernel
def violations(
    x: Reals,
    y: Reals,
    terms: Reals,
    units: Units,
    scaled: Laws,
    lower: Reals,
    upper: Reals,
    scratch: Reals,
    found: Reals,
) -> None:
    """Fill `found` in the order of `Residuals`, without the balance; terms = |A| |x|, `scaled` the laws in
    these units."""
    own, slope, out = scratch[0], scratch[1], scratch[2]
    kept, force, rate = units
    mu, d = scaled.mu, scaled.d
    # Rounding in the rates: no residual is known better than this.
    doubt = 0.0
    for i in range(len(kept)):
        own[i], slope[i] = x[kept[i]] / force[i], y[kept[i]] / rate[i]
        doubt += (terms[kept[i]] / rate[i]) ** 2
    for i in range(len(found)):
        found[i] = 0.0
    natural = natural_map(own, slope, scaled, out)
    found[0] = max(natural, _ROUNDING * math.sqrt(doubt))
    for k in range(len(mu)):
        n, pull, slip, power = k * d, 0.0, 0.0, 0.0
        for i in range(n + 1, n + d):
            pull += x[i] * x[i]
            slip += y[i] * y[i]
            power += x[i] * y[i]
        found[2] = max(found[2], -y[n])
        found[3] = max(found[3], math.sqrt(pull) - mu[k] * x[n], -x[n])
        found[4] = max(found[4], abs(x[n] * y[n]))
        found[5] = max(found[5], abs(mu[k] * x[n] * math.sqrt(slip) + power))
    for j in range(len(lower)):
        i = d * len(mu) + j
        found[6] = max(found[6], lower[j] - x[i], x[i] - upper[j])


@kernel
def judge_rows(
    A: Sparse,
    b: Reals,
    units: Units,
    scaled: Laws,
    laws: Laws,
    free: Ints,
    unit: Reals,
    x: Reals,
    y: Reals,
    scratch: Reals,
    found: Reals,
) -> None:
    """Fill y and `found` as `judged` does, without the balance of free rows; free (g,), unit (g,) among the
    free unknowns; scratch (6, N), whose first row becomes the terms."""
    terms, total = scratch[0], 0.0
    for i in range(len(x)):
        y[i], terms[i] = b[i], 0.0
        for k in range(A.start[i], A.start[i + 1]):
            y[i] += A.value[k] * x[A.place[k]]
            terms[i] += abs(A.value[k] * x[A.place[k]])
        total += y[i] * y[i]
    if not total < math.inf:
        for i in range(len(found)):
            found[i] = math.inf
        return
    violations(x, y, terms, units, scaled, laws.lower, laws.upper, scratch[1:4], found)
    own_terms(A, terms, b, units, laws.d * len(laws.mu), laws.d, free, unit, scratch[2:])
    own = own_violation(A, x, y, laws, scratch[2:])
    found[0] = max(found[0], OWN * own if own > _FINE else 0.0)


class _Scales(NamedTuple):
    """Numbers that the judge keeps for a problem: |A|, its rows, the free rows, and units of free unknowns
    among themselves."""

    absolute: Matrix
    rows: Sparse
    free: Ints
    unit: Array


_known: WeakKeyDictionary[Problem, _Scales] = WeakKeyDictionary()


def _scales(problem: Problem) -> _Scales:
    found = _known.get(problem)
    if found is None:
        free = problem.free.nonzero()[0] + problem.rows
        absolute, unit = abs(problem.A), np.empty(len(free))
        if len(free):
            fitted(compressed(part(absolute, free, free)), 0, 1, unit)
        found = _known[problem] = _Scales(absolute, compressed(absolute), free, unit)
    return found


def absolute(problem: Problem) -> Matrix:
    """|A|, made once."""
    return _scales(problem).absolute


def in_own_terms(problem: Problem, system: System, x: Array, y: Array) -> float:
    """The largest violation by x of a law of the problem as it was given, whatever the units of its rows and
    of its unknowns: rates count by the size of their terms, forces by their terms in the rows, over the terms
    of the rows; each contact in a unit of its own.

    Where small rows stand beside large ones, the rates of an x that is far from all solutions may be nothing
    beside the norm of all. Only a row whose own terms are rounding beside that norm (`_AT_REST`) counts
    beside a share of the norm; and a free row beside a share of the terms of the other free rows.
    """
    return _in_own_terms(problem, system, x, y, _scales(problem).absolute @ np.abs(x))


def _in_own_terms(problem: Problem, system: System, x: Array, y: Array, terms: Array) -> float:
    scales, scratch = _scales(problem), _own_terms(problem, system, terms)
    return float(own_violation(scales.rows, x, y, problem.laws, scratch))


def own_units(problem: Problem, system: System, x: Array) -> tuple[Array, Array]:
    """The units in which `in_own_terms` counts rates (N,) and forces (N,); one where there is nothing to
    count by."""
    scales = _scales(problem)
    scratch = _own_terms(problem, system, scales.absolute @ np.abs(x))
    own_size(scales.rows, problem.rows, problem.directions, scratch[0], scratch[1])
    rate, each = scratch[0], scratch[1]
    return np.where(rate > 0.0, rate, 1.0), 1.0 / np.where(each > 0.0, each, 1.0)


def _own_terms(problem: Problem, system: System, terms: Array) -> Array:
    """The scratch (4, N) as `own_terms` fills it, where `terms` (N,) are the sums of each row's terms."""
    p, scales, scratch = problem, _scales(problem), np.empty((4, len(terms)))
    units = Units(system.kept, system.force, system.rate)
    own_terms(scales.rows, terms, p.b, units, p.rows, p.directions, scales.free, scales.unit, scratch)
    return scratch


@kernel
def own_terms(
    A: Sparse,
    terms: Reals,
    b: Reals,
    units: Units,
    rows: int,
    d: int,
    free: Ints,
    unit: Reals,
    scratch: Reals,
) -> None:
    """Fill the first row of scratch (3, N) with the size of each row's terms, where `terms` is |A| |x|.

    Where the terms of a row are rounding beside the norm of all rates, its size is raised to that norm, but
    to no more than the row's share of the unknowns that the terms of the free rows allow.
    """
    own, others, speed, most = scratch[0], scratch[1], scratch[2], 0.0
    kept, rate = units.kept, units.rate
    for i in range(len(b)):
        own[i], others[i], speed[i] = terms[i] + abs(b[i]), math.inf, 0.0
    for i in free:
        for k in range(A.start[i], A.start[i + 1]):
            if A.place[k] == i and A.value[k] != 0.0:
                speed[i] = own[i] / abs(A.value[k])
    for i in range(len(b) if len(free) else 0):
        others[i] = 0.0
        for k in range(A.start[i], A.start[i + 1]):
            others[i] += abs(A.value[k]) * speed[A.place[k]]
    for i in range(len(kept)):
        others[kept[i]] = min(others[kept[i]], rate[i])
    for i in range(len(free)):
        most = max(most, unit[i] * own[free[i]])
    for i in range(len(free)):
        others[free[i]] = most / unit[i]
    _largest_of_each(own, rows, d)
    _largest_of_each(others, rows, d)
    for i in range(len(b)):
        if own[i] <= _AT_REST * others[i]:
            own[i] += _FAINT * others[i]


@kernel
def own_violation(A: Sparse, x: Reals, y: Reals, laws: Laws, scratch: Reals) -> float:
    """The violation that `in_own_terms` returns; the first row of scratch (4, N) holds the rows' terms."""
    mu, d, lower, upper = laws
    rate, each, own, out = scratch[0], scratch[1], scratch[2], scratch[3]
    worst, rows = 0.0, d * len(mu)
    own_size(A, rows, d, rate, each)
    for i in range(len(x)):
        own[i], rate[i] = x[i] * each[i], y[i] / rate[i] if rate[i] > 0.0 else y[i]
    for k in range(len(mu)):
        contact_map(own, rate, mu[k], d, k * d, out)
        for i in range(k * d, k * d + d):
            worst = max(worst, abs(out[i]))
    for j in range(len(lower)):
        i = rows + j
        above = (x[i] - lower[j]) * each[i] if lower[j] > -math.inf else math.inf
        below = (upper[j] - x[i]) * each[i] if upper[j] < math.inf else math.inf
        room = above if rate[i] > 0.0 else below
        worst = max(worst, min(abs(rate[i]), abs(room)), -min(above, below))
    return worst


@kernel
def own_size(A: Sparse, rows: int, d: int, rate: Reals, each: Reals) -> None:
    """Fill `each` (N,) with the most that a unit of each unknown does to a row, beside the row's terms
    `rate`."""
    for i in range(len(each)):
        each[i] = 0.0
    for i in range(len(rate)):
        for k in range(A.start[i], A.start[i + 1]):
            if rate[i] > 0.0:
                each[A.place[k]] = max(each[A.place[k]], abs(A.value[k]) / rate[i])
    _largest_of_each(each, rows, d)


@inner_kernel
def _largest_of_each(values: Reals, rows: int, d: int) -> None:
    """Make the values of each contact the largest of them."""
    for first in range(0, rows, d):
        largest = 0.0
        for i in range(first, first + d):
            largest = max(largest, values[i])
        for i in range(first, first + d):
            values[i] = largest


def _imbalance(problem: Problem, system: System, scales: _Scales, x: Array, y: Array) -> float:
    """The largest |y| of a free row, over the sum of the row's terms and of the terms of unit forces in it.

    A row whose terms are nothing beside the terms of other rows, in units of its unknown, is not held to its
    own terms. No unit force is beyond its limits.
    """
    free, unit = scales.free, scales.unit
    if len(free) == 0:
        return 0.0
    size = np.abs(x)
    most = np.concatenate([np.full(problem.rows, np.inf), np.maximum(abs(problem.lower), abs(problem.upper))])
    size[system.kept] += np.minimum(system.force, most[system.kept])
    terms = (scales.absolute @ size)[free] + np.abs(problem.b[free])
    return float(imbalance(y[free], terms, unit))


@kernel
def imbalance(y: Reals, terms: Reals, unit: Reals) -> float:
    """The largest |y| (g,) over the row's terms, which count as no less than a share of the terms of other
    rows."""
    most, worst = 0.0, 0.0
    for i in range(len(y)):
        most = max(most, unit[i] * terms[i])
    for i in range(len(y)):
        size = terms[i] + _FLOOR * most / unit[i]
        worst = max(worst, abs(y[i]) / size if size > 0.0 else abs(y[i]))
    return worst
