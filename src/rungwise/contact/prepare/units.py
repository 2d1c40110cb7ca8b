"""The units in which a system is solved: kernels on its rows in CSR.

Each contact is measured in a unit s of its own, and each other unknown in one: s A s has a diagonal of about
one. Forces are then s |s b| and rates |s b| / s.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from rungwise.contact.problem import Array, Matrix
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

_ROUNDS = 10
"""Rounds in which units follow each other."""
_GREATEST, _LEAST = 1e140, 1e-290
"""Greatest unit or scaled offset, and least unit of forces and rates, as plain numbers: the square of the
first stays below the greatest double 1.8e308, the second above the least normal double 2.2e-308."""


class Sparse(NamedTuple):
    """A sparse matrix by rows, or by columns: where each begins (n + 1,), and the places and values of all
    entries."""

    start: Ints
    place: Ints
    value: Array

    def scaled(self, s: Array) -> Sparse:
        """Rows (or columns) times s (n,)."""
        return self._replace(value=s.repeat(np.diff(self.start)) * self.value)

    def part(self, which: Ints) -> Sparse:
        """These rows (or columns)."""
        length = np.diff(self.start)[which]
        start = np.concatenate([[0], np.cumsum(length)])
        taken = np.arange(start[-1]) + (self.start[which] - start[:-1]).repeat(length)
        return Sparse(start, self.place[taken], self.value[taken])


def compressed(A: Matrix) -> Sparse:
    """The rows of A, dense or CSR: copies of the entries that are not zero, columns in order."""
    if sp.issparse(A):
        A = A if A.has_sorted_indices else A.sorted_indices()
        return Sparse(A.indptr.astype(np.int64), A.indices.astype(np.int64), A.data.copy())
    made = Sparse(np.empty(len(A) + 1, np.int64), np.empty(A.size, np.int64), np.empty(A.size))
    used = compress(A, made)
    return Sparse(made.start, made.place[:used], made.value[:used])


def part(A: Matrix, rows: Ints, columns: Ints) -> Matrix:
    """A in these rows and columns, both in order."""
    if not sp.issparse(A):
        return A[rows[:, None], columns]
    number = np.full(A.shape[1], -1)
    number[columns] = np.arange(len(columns))
    start, column, value = np.empty(len(rows) + 1, np.int32), np.empty(A.nnz, np.int32), np.empty(A.nnz)
    used = gather(A.indptr, A.indices, A.data, rows, number, start, column, value)
    return sp.csr_array((value[:used], column[:used], start), shape=(len(rows), len(columns)))


@kernel
def gather(
    row_start: NDArray[np.int32],
    column: NDArray[np.int32],
    value: Reals,
    rows: Ints,
    number: Ints,
    start: NDArray[np.int32],
    place: NDArray[np.int32],
    entry: Reals,
) -> int:
    """Fill the entries of these rows whose columns have a number, with that number; returns how many."""
    used = 0
    for i in range(len(rows)):
        start[i] = used
        for k in range(row_start[rows[i]], row_start[rows[i] + 1]):
            if number[column[k]] >= 0:
                place[used], entry[used] = number[column[k]], value[k]
                used += 1
    start[len(rows)] = used
    return used


@kernel
def expand(A: Sparse, whole: Reals) -> None:
    """Fill the whole of A (n, n), zero before, from its rows."""
    for i in range(len(whole)):
        for k in range(A.start[i], A.start[i + 1]):
            whole[i, A.place[k]] = A.value[k]


@kernel
def compress(whole: Reals, A: Sparse) -> int:
    """Fill the rows of A with the entries that are not zero; returns how many."""
    used = 0
    for i in range(whole.shape[0]):
        A.start[i] = used
        for j in range(whole.shape[1]):
            if whole[i, j] != 0.0:
                A.place[used], A.value[used] = j, whole[i, j]
                used += 1
    A.start[len(A.start) - 1] = used
    return used


@kernel
def fitted(A: Sparse, rows: int, d: int, s: Reals) -> None:
    """Fill s (N,): one over the root of the mean diagonal, per contact; equilibrate it where that is zero."""
    size, least, some, every = len(s), math.inf, False, True
    for i in range(size):
        s[i] = 0.0
        for k in range(A.start[i], A.start[i + 1]):
            if A.place[k] == i:
                s[i] = abs(A.value[k])
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
        equilibrate(A, rows, d, s)
    for i in range(size):
        s[i] = abs(s[i])


@kernel
def measured(
    s: Reals, b: Reals, lower: Reals, upper: Reals, rows: int, force: Reals, rate: Reals, offset: Reals
) -> bool:
    """Units of forces and rates from s; b as `offset`, lower and upper in them; whether in range.

    An unknown with two equal limits counts with its force, and not with its rate, which no law restricts.
    """
    size, total = 0.0, 0.0
    for i in range(len(s)):
        if not 1.0 / _GREATEST < s[i] < _GREATEST:
            return False
        size = max(size, _size_alone(i, s, b, lower, upper, rows))
    if not size < _GREATEST:
        return False
    if size > 0.0:  # squares of small numbers are zero
        for i in range(len(s)):
            total += (_size_alone(i, s, b, lower, upper, rows) / size) ** 2
        size *= math.sqrt(total)
    else:
        for j in range(len(lower)):
            for limit in (lower[j], upper[j]):
                if not math.isinf(limit):
                    size = max(size, abs(limit) / s[rows + j])
        size = size if size > 0.0 else 1.0
    for i in range(len(s)):
        force[i], rate[i] = s[i] * size, size / s[i]
        if not min(force[i], rate[i]) > _LEAST:
            return False
        offset[i] = b[i] / rate[i]
        if not abs(offset[i]) < _GREATEST:
            return False
    for j in range(len(lower)):
        lower[j] /= force[rows + j]
        upper[j] /= force[rows + j]
    return True


@inner_kernel
def _size_alone(i: int, s: Reals, b: Reals, lower: Reals, upper: Reals, rows: int) -> float:
    """The size of unknown i without other forces, as rate or force in the unit s."""
    if i >= rows and lower[i - rows] == upper[i - rows]:
        return float(abs(lower[i - rows] / s[i]))
    return float(abs(s[i] * b[i]))


@kernel
def rescaled(A: Sparse, s: Reals, blocks: Reals, diagonal: Reals) -> None:
    """Scale A by s on both sides, and gather the blocks of contacts and the others' diagonal."""
    d, rows = blocks.shape[1], blocks.shape[0] * blocks.shape[1]
    for i in range(len(s)):
        for k in range(A.start[i], A.start[i + 1]):
            j = A.place[k]
            A.value[k] *= s[i] * s[j]
            if i < rows and j < rows and i // d == j // d:
                blocks[i // d, i % d, j % d] = A.value[k]
            elif i == j:
                diagonal[i - rows] = A.value[k]


@kernel
def settle(x: Reals, rows: int, lower: Reals, upper: Reals, share: float) -> None:
    """Move each limited unknown to a limit from which it differs by no more than this share of the largest
    unknown."""
    largest = 0.0
    for i in range(len(x)):
        largest = max(largest, abs(x[i]))
    for j in range(len(lower)):
        for limit in (lower[j], upper[j]):
            if abs(x[rows + j] - limit) <= share * largest:
                x[rows + j] = limit


@kernel
def spread(A: Sparse, s: Reals) -> None:
    """Fill a first s where it is not fixed (negative), from neighbour to neighbour; one where nothing is
    fixed."""
    for i in range(len(s)):
        s[i] = min(s[i], 0.0)
    reached = True
    while reached:
        reached = False
        for i in range(len(s)):
            largest = 0.0
            for k in range(A.start[i], A.start[i + 1]):
                largest = max(largest, abs(A.value[k] * s[A.place[k]]))
            if s[i] == 0.0 and largest > 0.0:
                s[i], reached = 1.0 / largest, True
    for i in range(len(s)):
        if s[i] == 0.0:
            s[i] = 1.0


@kernel
def equilibrate(A: Sparse, rows: int, d: int, s: Reals) -> None:
    """Change s where it is not fixed (negative), so that the largest s_i |A_ij| s_j are about one.

    There are many such s. The one found starts from the fixed entries, and so follows their units.
    """
    size = len(s)
    spread(A, s)
    for _ in range(_ROUNDS):
        for i in range(size):
            largest = 0.0
            for k in range(A.start[i], A.start[i + 1]):
                largest = max(largest, abs(A.value[k] * s[A.place[k]]))
            if s[i] > 0.0 and largest > 0.0:
                s[i] = math.sqrt(s[i] / largest)
        for first in range(0, rows, d):
            least = math.inf
            for i in range(first, first + d):
                least = min(least, s[i])
            for i in range(first, first + d):
                s[i] = least
