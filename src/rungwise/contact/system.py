"""A problem as solvers see it: free unknowns eliminated where they can be, and free of units.

With A_ff regular the free unknowns (velocities, joint forces) follow from the others, and what is left is the
Delassus form. Each contact is then measured in a unit s of its own: s^2 is one over the mean diagonal of its
block, so that its block has a unit diagonal, all its directions alike, and friction is what it was. Forces
and rates are divided by |s q|, the norm of the rates without forces: `natural_map` of the scaled system is
the residual by which answers are judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from rungwise.contact.mixed import Array, Matrix, Problem
from rungwise.kernel import Ints, Reals, kernel

_REGULAR = 1e-13
_ROUNDING, _ACCURATE = 2.0**-51, 1e-5
_ROUNDS = 10
_GREATEST = 1e140
_LIGHT = 1e-9
Solve = Callable[[Matrix], Any]
_SMALL = 200
"""Unknowns up to which sparse arithmetic takes longer than zeros do."""
_LARGEST = 30_000_000
"""Entries of the dense response that elimination from a sparse form may make."""
_FEW, _MOST = 2, 400
"""Eliminated unknowns that are worth to be remembered: one for so many others, and no more than that."""


class Condensed(NamedTuple):
    """A = F - B own^-1 C as it was before elimination: own (g, g); front (N, 3), the rows of F's blocks.

    back_start (N + 1,), back_column, back_value: the rows of B; across_start (N + 1,), across_row,
    across_value: the columns of C.
    """

    own: Array
    front: Array
    back_start: Ints
    back_column: Ints
    back_value: Array
    across_start: Ints
    across_row: Ints
    across_value: Array

    def scaled(self, s: Array) -> Condensed:
        """The parts of s A s, s (N,)."""
        back, across = s.repeat(np.diff(self.back_start)), s.repeat(np.diff(self.across_start))
        return self._replace(back_value=back * self.back_value, across_value=across * self.across_value)


@dataclass(frozen=True)
class System:
    """The scaled system in kept unknowns, rows in CSR; x = force x', y = rate y', elsewhere `recover`.

    row_start (N + 1,), column, value: A; blocks (k, d, d): its diagonal blocks; diagonal (m,): that of the
    others; kept (N,): places of the unknowns in the problem; condensed: A's parts, where far fewer unknowns
    were eliminated than are left.
    """

    row_start: Ints
    column: Ints
    value: Array
    blocks: Array
    diagonal: Array
    b: Array
    mu: Array
    directions: int
    lower: Array
    upper: Array
    force: Array
    rate: Array
    kept: Ints
    recover: Callable[[Array], Array]
    condensed: Condensed | None

    @property
    def size(self) -> int:
        return len(self.b)

    @property
    def rows(self) -> int:
        return self.directions * len(self.mu)

    def dense(self) -> Array:
        """A (N, N)."""
        A = np.zeros((self.size, self.size))
        expand(self.row_start, self.column, self.value, A)
        return A

    def matrix(self) -> sp.csr_array:
        return sp.csr_array((self.value, self.column, self.row_start), shape=(self.size, self.size))


Eliminated: TypeAlias = tuple[Ints, Matrix, Array, Callable[[Array], Array], Condensed | None, bool]
_prepared: WeakKeyDictionary[Problem, System] = WeakKeyDictionary()


def scaled(problem: Problem) -> System:
    """The system of `problem`, made once; ValueError where its sizes are beyond the range of numbers."""
    made = _prepared.get(problem)
    if made is None:
        made = _prepared[problem] = _scaled(problem, *_eliminated(problem))
    return made


def uneliminated(problem: Problem) -> System:
    """The system in all unknowns."""
    return _scaled(problem, *_whole(problem, problem.A))


def _scaled(
    problem: Problem,
    kept: Ints,
    A: Matrix,
    b: Array,
    recover: Callable[[Array], Array],
    condensed: Condensed | None,
    light: bool,
) -> System:
    rows, d, size = problem.rows, problem.directions, len(b)
    lower, upper = problem.lower, problem.upper
    if len(kept) < len(problem.b):
        lower, upper = lower[kept[rows:] - rows], upper[kept[rows:] - rows]
    row_start, column, value = compressed(A)
    s, force, rate, offset = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    blocks, diagonal = np.zeros((rows // d, d, d)), np.zeros(len(lower))
    lowest, highest = lower.copy(), upper.copy()
    if light:
        _fit_massless(problem, row_start, column, value, s)
    else:
        fitted(row_start, column, value, rows, d, s)
    if not measured(s, b, lowest, highest, rows, force, rate, offset):
        raise ValueError("A: its sizes, and those of b, are beyond what double precision can scale")
    rescaled(row_start, column, s, value, blocks, diagonal)
    return System(
        row_start, column, value, blocks, diagonal, offset, problem.mu.copy(), d, lowest, highest,
        force, rate, kept, recover, condensed and condensed.scaled(s),
    )  # fmt: skip


def _fit_massless(problem: Problem, row_start: Ints, column: Ints, value: Array, s: Array) -> None:
    """s (N,) as without inertia: demanded rates and loads, each in units of their own, are of one size."""
    first, last = problem.rows, problem.rows + problem.velocities
    row = np.arange(len(s)).repeat(np.diff(row_start))
    inertia = (first <= np.minimum(row, column)) & (np.maximum(row, column) < last)
    fitted(row_start, column, np.where(inertia, 0.0, value), problem.rows, problem.directions, s)
    demands, loads = s * problem.b, s[first:last] * problem.b[first:last]
    demands[first:last] = 0.0
    ratio = np.linalg.norm(loads) / np.linalg.norm(demands)
    s *= ratio**0.5
    s[first:last] /= ratio


def compressed(A: Matrix) -> tuple[Ints, Ints, Array]:
    """Starts of the rows, columns in order and values (copies) of what is not zero in A, dense or CSR."""
    if sp.issparse(A):
        A = A if A.has_sorted_indices else A.sorted_indices()
        return A.indptr.astype(np.int64), A.indices.astype(np.int64), A.data.copy()
    start, column, value = np.empty(len(A) + 1, np.int64), np.empty(A.size, np.int64), np.empty(A.size)
    used = compress(A, start, column, value)
    return start, column[:used], value[:used]


@kernel
def expand(row_start: Ints, column: Ints, value: Reals, A: Reals) -> None:
    """Fill A, zero before, from its rows."""
    for i in range(len(A)):
        for k in range(row_start[i], row_start[i + 1]):
            A[i, column[k]] = value[k]


@kernel
def compress(A: Reals, row_start: Ints, column: Ints, value: Reals) -> int:
    """Fill the rows of A's entries that are not zero; returns how many."""
    used = 0
    for i in range(A.shape[0]):
        row_start[i] = used
        for j in range(A.shape[1]):
            if A[i, j] != 0.0:
                column[used], value[used] = j, A[i, j]
                used += 1
    row_start[len(row_start) - 1] = used
    return used


@kernel
def fitted(row_start: Ints, column: Ints, value: Reals, rows: int, d: int, s: Reals) -> None:
    """s (N,): one over the root of the mean diagonal, per contact; where there is none, it equilibrates."""
    size, least, some, every = len(s), math.inf, False, True
    for i in range(size):
        s[i] = 0.0
        for k in range(row_start[i], row_start[i + 1]):
            if column[k] == i:
                s[i] = abs(value[k])
    for first in range(0, rows, d):
        mean = 0.0
        for i in range(first, first + d):
            mean += s[i] / d
        for i in range(first, first + d):
            s[i] = mean
        if mean > 0.0:
            least, some = min(least, mean), True
    for i in range(size):
        if i < rows and some and not s[i] > 0.0:
            s[i] = least
        every = every and s[i] > 0.0
        s[i] = -1.0 / math.sqrt(s[i]) if s[i] > 0.0 else 1.0
    if not every:
        equilibrate(row_start, column, value, rows, d, s)
    for i in range(size):
        s[i] = abs(s[i])


@kernel
def measured(
    s: Reals, b: Reals, lower: Reals, upper: Reals, rows: int, force: Reals, rate: Reals, offset: Reals
) -> bool:
    """Units of forces and rates from s; b as `offset`, lower and upper in them; whether in range."""
    size, largest = 0.0, 0.0
    for i in range(len(s)):
        size += (s[i] * b[i]) ** 2
        if not 1.0 / _GREATEST < s[i] < _GREATEST:
            return False
    size = math.sqrt(size)
    if not size < _GREATEST:
        return False
    if size == 0.0:
        for j in range(len(lower)):
            for limit in (lower[j], upper[j]):
                if not math.isinf(limit):
                    largest = max(largest, abs(limit))
        size = largest if largest > 0.0 else 1.0
    for i in range(len(s)):
        force[i], rate[i] = s[i] * size, size / s[i]
        offset[i] = b[i] / rate[i]
    for j in range(len(lower)):
        lower[j] /= force[rows + j]
        upper[j] /= force[rows + j]
    return True


@kernel
def rescaled(row_start: Ints, column: Ints, s: Reals, value: Reals, blocks: Reals, diagonal: Reals) -> None:
    """Scale the values by s on both sides, and gather the blocks of contacts and the others' diagonal."""
    d, rows = blocks.shape[1], blocks.shape[0] * blocks.shape[1]
    for i in range(len(s)):
        for k in range(row_start[i], row_start[i + 1]):
            j = column[k]
            value[k] *= s[i] * s[j]
            if i < rows and j < rows and i // d == j // d:
                blocks[i // d, i % d, j % d] = value[k]
            elif i == j:
                diagonal[i - rows] = value[k]


@kernel
def equilibrate(row_start: Ints, column: Ints, value: Reals, rows: int, d: int, s: Reals) -> None:
    """Change s where it is not fixed (negative), so that the largest s_i |A_ij| s_j are about one."""
    size = len(s)
    for _ in range(_ROUNDS):
        for i in range(size):
            largest = 0.0
            for k in range(row_start[i], row_start[i + 1]):
                largest = max(largest, abs(value[k] * s[column[k]]))
            if s[i] > 0.0 and largest > 0.0:
                s[i] = math.sqrt(s[i] / largest)
        for first in range(0, rows, d):
            least = math.inf
            for i in range(first, first + d):
                least = min(least, s[i])
            for i in range(first, first + d):
                s[i] = least


def _whole(problem: Problem, A: Matrix, light: bool = False) -> Eliminated:
    return np.arange(len(problem.b)), A, problem.b, lambda x: x, None, light


def _eliminated(problem: Problem) -> Eliminated:
    """What is left: kept places, matrix, offset, the way back to all unknowns, and the matrix's parts.

    The free ones are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so, or inertia is
    so small that rates without forces would hide the demanded ones.
    """
    free = np.isneginf(problem.lower) & np.isposinf(problem.upper)
    everything, A, b = np.arange(len(problem.b)), problem.A, problem.b
    if sp.issparse(A) and len(b) <= _SMALL:
        A = A.toarray()
    whole = _whole(problem, A)
    fixed = np.concatenate([np.zeros(problem.rows, bool), free])
    kept, gone = everything[~fixed], everything[fixed]
    sparse = sp.issparse(A)
    if len(gone) == 0 or (sparse and len(kept) * len(gone) > _LARGEST):
        return whole
    rows, above = A[gone], A[kept]
    own, across, back, front = rows[:, gone], rows[:, kept], above[:, gone], above[:, kept]
    solve = _eliminate_sparse(own) if sparse else _eliminate_dense(own)
    if solve is None:
        return whole
    response = solve(across)
    correction = solve(own @ response - across)
    if not abs(correction).max() <= _ACCURATE * abs(response).max() if len(kept) else False:
        return whole
    response = response - correction
    noise = abs(correction) + _ROUNDING * abs(response)
    if isinstance(response, np.ndarray):
        # A column is no better known than its largest entry, in units of the unknowns.
        unit = np.empty(len(gone))
        fitted(*compressed(own), 0, 1, unit)
        noise += _ROUNDING * unit[:, None] * (np.abs(response) / unit[:, None]).max(axis=0, initial=0.0)

    def recover(x: Array) -> Array:
        full = np.zeros(len(b))
        full[kept] = x
        for _ in range(2):
            full[gone] -= solve(rows @ full + b[gone])
        return full

    left = _without_rounding(front - back @ response, front, back, noise)
    offset = b[kept] + back @ recover(np.zeros(len(kept)))[gone]
    if _is_light(problem, offset):
        return _whole(problem, A, light=True)
    return kept, left, offset, recover, _condensed(problem, own, across, back, front), False


def _is_light(problem: Problem, without_forces: Array) -> bool:
    """Whether the rates without forces are so large that a residual beside them says nothing of demands."""
    rows, velocities = problem.rows, problem.velocities
    if velocities == 0 or not problem.b[rows : rows + velocities].any():
        return False
    demands = np.abs(np.delete(problem.b, np.s_[rows : rows + velocities])).max(initial=0.0)
    return bool(0.0 < demands < _LIGHT * np.abs(without_forces).max(initial=0.0))


def _condensed(
    problem: Problem, own: Matrix, across: Matrix, back: Matrix, front: Matrix
) -> Condensed | None:
    """The parts, where they are few and `front` has only the blocks of contacts."""
    if not _FEW * own.shape[0] <= front.shape[0]:
        return None
    rows, d = problem.rows, problem.directions
    entries = sp.coo_array(front)
    row, column = entries.coords
    apart = np.where(np.maximum(row, column) < rows, row // d != column // d, row != column)
    if apart.any() or own.shape[0] > _MOST:
        return None
    blocks = np.zeros((front.shape[0], 3))
    blocks[row, np.where(row < rows, column % d, 0)] = entries.data
    start, place, value = compressed(across.T.tocsr() if sp.issparse(across) else across.T)
    dense = own.toarray() if sp.issparse(own) else own
    return Condensed(dense, blocks, *compressed(back), start, place, value)


def _eliminate_dense(own: Array) -> Solve | None:
    size = np.abs(own).max(axis=1, initial=0.0) * np.abs(own).max(axis=0, initial=0.0)
    if not (size > 0.0).all():
        return None
    s = size**-0.25
    factor, exchanges, _ = dgetrf(own * s[:, None] * s)
    pivots = np.abs(np.diag(factor))
    if not pivots.min() > _REGULAR * pivots.max():
        return None

    def solve(right: Array) -> Array:
        scale = s[:, None] if right.ndim == 2 else s
        return np.asarray(dgetrs(factor, exchanges, scale * right)[0] * scale)

    return solve


def _eliminate_sparse(own: sp.csr_array) -> Solve | None:
    diagonal = own.diagonal()
    if own.nnz == np.count_nonzero(diagonal) == own.shape[0]:
        inverse = sp.diags_array(1.0 / diagonal)
        return lambda right: inverse @ right
    try:
        factor = splu(sp.csc_array(own))
    except RuntimeError:
        return None
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > _REGULAR * pivots.max():
        return None
    return lambda right: factor.solve(right.toarray() if sp.issparse(right) else right)


def _without_rounding(left: Matrix, front: Matrix, back: Matrix, noise: Matrix) -> Matrix:
    """`left` less what is nothing beside the rounding in its diagonal; `noise` is that of the response."""
    product = abs(back) * abs(noise.T)
    terms = _ROUNDING * np.abs(front.diagonal()) + np.asarray(product.sum(axis=1)).ravel()
    least = 2.0 * np.sqrt(terms)
    if not sp.issparse(left):
        return np.where(np.abs(left) > least[:, None] * least, left, 0.0)
    made = sp.csr_array(left)
    prune(made.indptr, made.indices, made.data, least)
    made.eliminate_zeros()
    return made


@kernel
def prune(row_start: NDArray[np.int32], column: NDArray[np.int32], value: Reals, least: Reals) -> None:
    """Make zero what is at most the product of the least values of its row and column."""
    for i in range(len(least)):
        for k in range(row_start[i], row_start[i + 1]):
            if abs(value[k]) <= least[i] * least[column[k]]:
                value[k] = 0.0
