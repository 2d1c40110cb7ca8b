"""The worth of a candidate, from the problem alone: no solver has a say in the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from rungwise.contact.judge.laws import fill_violations
from rungwise.contact.prepare.magnitudes import Magnitudes, faint_terms, largest, magnitudes
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import Sparse, compressed
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
free row, over its faint terms, by trial: at a tolerance of 1e-9 it may err by 1e-15 of these, a few
roundings."""
_HIDDEN, _MOST = 2.0**-50, 1e-3
"""Rounding of the rates of a plain problem, over the norm of their terms: eight roundings of double
precision; and the most that it may hide, over the norm of the loads. Unknowns that run away from a
contradiction leave it whole, until their terms are that large. Chosen by trial, to a decade."""
_AT_REST, _FAINT = 2.0**-44, 1e-5
"""A row whose terms are no more than the first share of its faint terms is at rest: its terms are rounding of
other rows, and count beside the second share, of which 1e-11 / `OWN` is 30 roundings. The first is 512
roundings of double precision, chosen by trial."""


class Units(NamedTuple):
    """Units of forces and rates (n,) of the unknowns that are measured, and the places of these (n,)."""

    kept: Ints
    force: Array
    rate: Array


@dataclass(frozen=True)
class Residuals:
    """Violations of each law by forces r and rates u = A x + b.

    `natural` and `balance` have no unit and decide: the norm of the violations of all laws, each contact
    measured in a unit of its own, over the norm of the rates without forces; and the largest imbalance of a
    free row over the sum of the terms that it has. `natural` is no less than `OWN` times `in_own_terms`, the
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
    terms, faint = scales.absolute @ np.abs(x), _faint(problem, x)
    units, laws = _units(problem, system)
    scratch = np.empty((3, len(units.kept)))
    plain = is_plain(problem.rows, problem.velocities)
    violations(x, y, terms, units, laws, problem.lower, problem.upper, plain, scratch, found)
    found[1] = imbalance(y, terms, problem.b, faint, scales.free)
    own = _in_own_terms(problem, x, y, terms, faint)
    found[0] = max(found[0], OWN * own if own > _FINE else 0.0)
    return Residuals(*found.tolist()), y


def _units(problem: Problem, system: System) -> tuple[Units, Laws]:
    """The units of the violations, and the laws in them: those of the system, which know contacts and
    inertia; without either, magnitudes of rows and of unknowns."""
    if not is_plain(problem.rows, problem.velocities):
        return Units(system.kept, system.force, system.rate), system.laws
    p, sizes = problem, magnitudes_of(problem)
    limits = Laws(p.mu, p.directions, p.lower / sizes.force, p.upper / sizes.force)
    return Units(np.arange(len(p.b)), sizes.force, sizes.rate), limits


@kernel
def is_plain(rows: int, velocities: int) -> bool:
    """Whether there are neither contacts nor velocities: an LCP, a circuit, relays."""
    return rows == 0 and velocities == 0


@kernel
def violations(
    x: Reals,
    y: Reals,
    terms: Reals,
    units: Units,
    scaled: Laws,
    lower: Reals,
    upper: Reals,
    plain: bool,
    scratch: Reals,
    found: Reals,
) -> None:
    """Fill `found` in the order of `Residuals`, without the balance; terms = |A| |x|, `scaled` the laws in
    these units. In a plain problem, whose rows all have magnitudes, what rounding hides is no violation."""
    own, slope, out = scratch[0], scratch[1], scratch[2]
    kept, force, rate = units
    mu, d = scaled.mu, scaled.d
    doubt = 0.0
    for i in range(len(kept)):
        own[i], slope[i] = x[kept[i]] / force[i], y[kept[i]] / rate[i]
        doubt += (terms[kept[i]] / rate[i]) ** 2
    for i in range(len(found)):
        found[i] = 0.0
    natural = fill_violations(scaled, own, slope, out[: len(mu) + len(lower)])
    doubt = math.sqrt(doubt)
    if plain and _HIDDEN * doubt <= _MOST:
        found[0] = max(natural - _HIDDEN * doubt, 0.0)
    else:  # no residual is known better than the rounding of the rates
        found[0] = max(natural, _ROUNDING * doubt)
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


class _Scales(NamedTuple):
    """Numbers that the judge keeps for a problem: |A|, its rows, the free rows, and the magnitudes of rows
    and unknowns."""

    absolute: Matrix
    rows: Sparse
    free: Ints
    magnitudes: Magnitudes


_known: WeakKeyDictionary[Problem, _Scales] = WeakKeyDictionary()


def _scales(problem: Problem) -> _Scales:
    found = _known.get(problem)
    if found is None:
        absolute = abs(problem.A)
        rows, free = compressed(absolute), problem.free.nonzero()[0] + problem.rows
        found = _known[problem] = _Scales(absolute, rows, free, magnitudes(rows, problem.b, problem.laws))
    return found


def absolute(problem: Problem) -> Matrix:
    """|A|, made once."""
    return _scales(problem).absolute


def magnitudes_of(problem: Problem) -> Magnitudes:
    """The magnitudes of the problem's rows and unknowns, made once."""
    return _scales(problem).magnitudes


def in_own_terms(problem: Problem, x: Array, y: Array) -> float:
    """The largest violation by x of a law of the problem as it was given, whatever the units of its rows and
    of its unknowns: rates count by the size of their terms, forces by their terms in the rows, over the terms
    of the rows; each contact in a unit of its own.

    Where small rows stand beside large ones, the rates of an x that is far from all solutions may be nothing
    beside the norm of all. Only a row whose own terms are rounding (`_AT_REST`) of the terms that unknowns as
    large as the largest would have in it, in their magnitudes (see `magnitudes`), counts beside a share of
    these: its faint terms. A free row always counts beside a far smaller share of them. Source: Arioli,
    Demmel, Duff, SIAM J. Matrix Anal. Appl. 10 (1989) 165-190.
    """
    return _in_own_terms(problem, x, y, _scales(problem).absolute @ np.abs(x), _faint(problem, x))


def misses(problem: Problem, x: Array, y: Array) -> float:
    """The largest violation by x of a law or of a free row, beside the row's own terms, whatever is
    rounding."""
    none, terms = np.zeros(len(x)), _scales(problem).absolute @ np.abs(x)
    free = float(imbalance(y, terms, problem.b, none, _scales(problem).free))
    return max(free, _in_own_terms(problem, x, y, terms, none))


def _faint(problem: Problem, x: Array) -> Array:
    """The faint terms (N,) of all rows: see `in_own_terms`."""
    scales, faint, size = _scales(problem), np.empty(len(x)), np.empty(2 * len(x))
    largest(problem.b, x, scales.magnitudes, size)
    faint_terms(scales.rows, scales.magnitudes, size, problem.rows, faint)
    return faint


def _in_own_terms(problem: Problem, x: Array, y: Array, terms: Array, faint: Array) -> float:
    scratch = np.empty((6, len(x)))
    own_terms(terms, problem.b, faint, problem.rows, problem.directions, scratch[0])
    return float(own_violation(_scales(problem).rows, x, y, problem.laws, scratch))


def own_units(problem: Problem, x: Array) -> tuple[Array, Array]:
    """The units in which `in_own_terms` counts rates (N,) and forces (N,); one where there is nothing to
    count by."""
    scales, rate, each = _scales(problem), np.empty(len(x)), np.empty(len(x))
    terms = scales.absolute @ np.abs(x)
    own_terms(terms, problem.b, _faint(problem, x), problem.rows, problem.directions, rate)
    own_size(scales.rows, problem.rows, problem.directions, rate, each)
    return np.where(rate > 0.0, rate, 1.0), 1.0 / np.where(each > 0.0, each, 1.0)


@kernel
def own_terms(terms: Reals, b: Reals, faint: Reals, rows: int, d: int, own: Reals) -> None:
    """Fill `own` (N,) with the size of each row's terms, where `terms` is |A| |x|; and of its faint terms
    where these make it rounding. The rows of a contact count alike."""
    for i in range(len(b)):
        own[i] = terms[i] + abs(b[i])
    _largest_of_each(own, rows, d)
    for first in range(0, rows, d):
        _raise(own, faint, first, first + d)
    for i in range(rows, len(b)):
        _raise(own, faint, i, i + 1)


@inner_kernel
def _raise(own: Reals, faint: Reals, first: int, end: int) -> None:
    """Raise the terms of these rows, all alike, where they are at rest."""
    most = 0.0
    for i in range(first, end):
        most = max(most, faint[i])
    for i in range(first, end):
        if own[i] <= _AT_REST * most:
            own[i] += _FAINT * most


@kernel
def own_violation(A: Sparse, x: Reals, y: Reals, laws: Laws, scratch: Reals) -> float:
    """The violation that `in_own_terms` returns; the first row of scratch (6, N) holds the rows' terms."""
    mu, d, lower, upper = laws
    rate, each, own, out = scratch[0], scratch[1], scratch[2], scratch[3]
    rows, m = d * len(mu), len(lower)
    low, high = scratch[4, :m], scratch[5, :m]
    own_size(A, rows, d, rate, each)
    for i in range(len(x)):
        own[i], rate[i] = x[i] * each[i], y[i] / rate[i] if rate[i] > 0.0 else y[i]
    for j in range(m):  # an infinite limit stays one where a unit of the unknown does nothing
        low[j] = lower[j] * each[rows + j] if lower[j] > -math.inf else -math.inf
        high[j] = upper[j] * each[rows + j] if upper[j] < math.inf else math.inf
    fill_violations(Laws(mu, d, low, high), own, rate, out[: len(mu) + m])
    worst = 0.0
    for k in range(len(mu) + m):
        worst = max(worst, out[k])
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


@kernel
def imbalance(y: Reals, terms: Reals, b: Reals, faint: Reals, free: Ints) -> float:
    """The largest |y_i| of a free row, over the sum of the terms that it has and a share of its faint
    terms."""
    worst = 0.0
    for i in free:
        size = terms[i] + abs(b[i]) + _FLOOR * faint[i]
        worst = max(worst, abs(y[i]) / size if size > 0.0 else abs(y[i]))
    return worst
