"""A problem as solvers see it: free unknowns eliminated where they can be, and free of units.

Each contact is measured in a unit s of its own: s^2 is one over the mean diagonal of its block, so that its
block has a unit diagonal, all its directions share that unit, and friction coefficients stay the same. Forces
and rates are divided by |s q|, the norm of the rates without forces: the norm of the violations of the laws
(`judge.laws`) of the scaled system is the residual by which answers are judged. Rates without forces may hide
the demanded rates, because inertia is next to zero or because the demands are next to zero. Only the answer
tells which holds: an answer that moves is judged by the first system, any other answer by a second system,
`massless`, in all unknowns, whose measures are the demanded rates and the loads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare.elimination import Left, eliminated, everything
from rungwise.contact.prepare.units import Sparse, compressed, expand, fitted, measured, rescaled
from rungwise.contact.problem import Array, BeyondScale, Laws, Problem
from rungwise.kernel import Ints, Reals, kernel


class Form(NamedTuple):
    """The scaled matrix A: entries, its rows; blocks (k, d, d), its diagonal blocks; diagonal (m,), the
    diagonal entries of the other unknowns."""

    entries: Sparse
    blocks: Array
    diagonal: Array


@dataclass(frozen=True, eq=False)
class System:
    """The scaled system in kept unknowns; x = force x', y = rate y', elsewhere `recover`.

    kept (N,): places of the unknowns in the problem; demanded: the largest demanded rate over the largest
    rate without forces, or infinite; load: the largest load over the least unit of a contact's force, or one.
    """

    form: Form
    b: Array
    mu: Array
    directions: int
    lower: Array
    upper: Array
    force: Array
    rate: Array
    kept: Ints
    recover: Callable[[Array], Array]
    demanded: float = math.inf
    load: float = 1.0

    @cached_property
    def laws(self) -> Laws:
        return Laws(self.mu, self.directions, self.lower, self.upper)

    @property
    def size(self) -> int:
        return len(self.b)

    @property
    def rows(self) -> int:
        return self.directions * len(self.mu)

    @cached_property
    def has_free(self) -> bool:
        """Whether there are unknowns without limits, which were not eliminated."""
        return bool((np.isneginf(self.lower) & np.isposinf(self.upper)).any())

    def dense(self) -> Array:
        """A (N, N)."""
        A = np.zeros((self.size, self.size))
        expand(self.form.entries, A)
        return A

    def matrix(self) -> sp.csr_array:
        return sp.csr_array(self.form.entries[::-1], shape=(self.size, self.size))


_prepared: WeakKeyDictionary[Problem, System] = WeakKeyDictionary()
_massless: WeakKeyDictionary[Problem, System] = WeakKeyDictionary()


def scaled(problem: Problem, massless: bool = False) -> System:
    """The system of `problem`, made once; BeyondScale where its sizes are beyond the range of numbers.

    `massless`: the system in all unknowns, measured by demanded rates and loads; only where velocities can be
    eliminated.
    """
    known = _massless if massless else _prepared
    made = known.get(problem)
    if made is None:
        left = everything(problem) if massless else eliminated(problem)
        made = known[problem] = _scaled(problem, left, massless)
    return made


def uneliminated(problem: Problem) -> System:
    """The system in all unknowns."""
    return _scaled(problem, everything(problem))


def _scaled(problem: Problem, left: Left, massless: bool = False) -> System:
    kept, b, size = left.kept, left.b, len(left.b)
    rows, d = problem.rows, problem.directions
    lower, upper = problem.lower, problem.upper
    if len(kept) < len(problem.b):
        lower, upper = lower[kept[rows:] - rows], upper[kept[rows:] - rows]
    s, force, rate, offset = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    lowest, highest = lower.copy(), upper.copy()
    entries = compressed(left.matrix)
    if massless or (problem.velocities > 0 and len(kept) == len(problem.b) and not _has_diagonal(entries)):
        _fit_massless(problem, entries, s)
    else:
        fitted(entries, rows, d, s)
    if not measured(s, b, lowest, highest, rows, force, rate, offset):
        raise BeyondScale("A: its sizes, and those of b, are beyond what double precision can scale")
    form = Form(entries, np.zeros((rows // d, d, d)), np.zeros(size - rows))
    rescaled(entries, s, form.blocks, form.diagonal)
    return System(
        form, offset, problem.mu.copy(), d, lowest, highest, force, rate, kept, left.recover, left.demanded,
        _load(problem, force[: len(problem.mu) * d]) if len(kept) < len(problem.b) else 1.0,
    )  # fmt: skip


def _load(problem: Problem, unit: Array) -> float:
    if len(unit) == 0 or problem.velocities == 0:
        return 1.0
    own = slice(problem.rows, problem.rows + problem.velocities)
    lever = np.empty(problem.velocities)
    largest(compressed(problem.A[own, : problem.rows]), lever)
    loads = np.abs(problem.b[own])[lever > 0.0] / lever[lever > 0.0]
    return max(1.0, float(loads.max(initial=0.0) / unit.min()))


@kernel
def largest(A: Sparse, out: Reals) -> None:
    """Fill `out` with the largest size of each row's entries, or zero."""
    for i in range(len(out)):
        out[i] = 0.0
        for k in range(A.start[i], A.start[i + 1]):
            out[i] = max(out[i], abs(A.value[k]))


def _has_diagonal(entries: Sparse) -> bool:
    """Whether inertia or compliance gives A a diagonal: only these say how large a rate is for a force."""
    own = entries.place == np.arange(len(entries.start) - 1).repeat(np.diff(entries.start))
    return bool(entries.value[own].any())


def _fit_massless(problem: Problem, entries: Sparse, s: Array) -> None:
    """Fill s (N,) as without inertia: demanded rates and loads, each in their own units, are of one size."""
    first, last = problem.rows, problem.rows + problem.velocities
    row, column = np.arange(len(s)).repeat(np.diff(entries.start)), entries.place
    inertia = (first <= np.minimum(row, column)) & (np.maximum(row, column) < last)
    others = entries._replace(value=np.where(inertia, 0.0, entries.value))
    fitted(others, problem.rows, problem.directions, s)
    limits = np.concatenate([problem.lower, problem.upper]) / np.tile(s[first:], 2)
    loads = np.concatenate([s[first:last] * problem.b[first:last], limits[np.isfinite(limits)]])
    demands = s * problem.b
    demands[first:last] = 0.0
    demands[problem.rows :][problem.lower == problem.upper] = 0.0
    ratio = np.linalg.norm(loads) / (np.linalg.norm(demands) or 1.0)
    if ratio > 0.0 and demands.any():
        s *= ratio**0.5
        s[first:last] /= ratio
