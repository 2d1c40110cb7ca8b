"""Gaussian elimination.

With complete pivoting, for the small and possibly singular systems of contact modes: promises the solution of
a regular system to rounding, and for a singular but consistent one a vector whose dependent unknowns are
zero; the residual says whether it is a solution. With row pivoting and factors that are kept, for regular
systems; this variant skips zeros.
"""

from __future__ import annotations

from rungwise.kernel import Ints, Reals, inner_kernel, kernel, summing_kernel

_RANK = 1e-13
"""Pivot, over the greatest pivot so far, up to which a matrix counts as singular: about a thousand roundings
of double precision, as they add up in elimination. Chosen by trial, to a decade."""


@kernel
def solve_in_place(a: Reals, size: int, columns: int, order: Ints) -> int:
    """Solve for `columns` right-hand sides in a[:size, size:size + columns]; the solutions replace them.

    `order` (size,) is scratch. Returns the rank.
    """
    width = size + columns
    for i in range(size):
        order[i] = i
    rank, largest = size, 0.0
    row, column, pivot = 0, 0, 0.0
    for i in range(size):
        for j in range(size):
            x = abs(a[i, j])
            if x > pivot:
                row, column, pivot = i, j, x
    for k in range(size):
        largest = max(largest, pivot)
        if not pivot > _RANK * largest:
            rank = k
            break
        _exchange(a, k, row, column, size, width, order)
        inverse = 1.0 / a[k, k]
        pivot = 0.0
        for i in range(k + 1, size):
            factor = a[i, k] * inverse
            for j in range(k + 1, size):
                a[i, j] -= factor * a[k, j]
                x = abs(a[i, j])
                if x > pivot:
                    row, column, pivot = i, j, x
            for j in range(size, width):
                a[i, j] -= factor * a[k, j]
    _substitute_back(a, size, columns, rank)
    _restore_order(a, size, columns, order)
    return rank


@kernel
def _exchange(a: Reals, k: int, row: int, column: int, size: int, width: int, order: Ints) -> None:
    if row != k:
        for j in range(k, width):
            x = a[k, j]
            a[k, j] = a[row, j]
            a[row, j] = x
    if column != k:
        for i in range(size):
            x = a[i, k]
            a[i, k] = a[i, column]
            a[i, column] = x
        index = order[k]
        order[k] = order[column]
        order[column] = index


@kernel
def _substitute_back(a: Reals, size: int, columns: int, rank: int) -> None:
    for c in range(size, size + columns):
        for i in range(rank, size):
            a[i, c] = 0.0
        for i in range(rank - 1, -1, -1):
            total = a[i, c]
            for j in range(i + 1, rank):
                total -= a[i, j] * a[j, c]
            a[i, c] = total / a[i, i]


@kernel
def _restore_order(a: Reals, size: int, columns: int, order: Ints) -> None:
    """Put unknown order[i] back in place order[i]; column 0 of the spent matrix carries the values."""
    for c in range(size, size + columns):
        for i in range(size):
            a[order[i], 0] = a[i, c]
        for i in range(size):
            a[i, c] = a[i, 0]


@summing_kernel
def factorise(a: Reals, size: int, order: Ints) -> bool:
    """Replace a[:size, :size] by its triangular factors, two columns at a time; False if singular.

    Rows are exchanged as `order` (size,) says; the diagonal holds one over the pivots.
    """
    for k in range(0, size, 2):
        if not _pivot(a, k, size, order):
            return False
        right = k + 1
        if right == size:
            return True
        for i in range(right, size):
            if a[i, k] != 0.0:
                a[i, k] *= a[k, k]
                a[i, right] -= a[i, k] * a[k, right]
        if not _pivot(a, right, size, order):
            return False
        upper, lower, factor = a[k, k + 2 : size], a[right, k + 2 : size], a[right, k]
        for j in range(len(upper)):
            lower[j] -= factor * upper[j]
        for i in range(k + 2, size):
            first, second, row = a[i, k], a[i, right] * a[right, right], a[i, k + 2 : size]
            a[i, right] = second
            if first != 0.0 or second != 0.0:
                for j in range(len(row)):
                    row[j] -= first * upper[j] + second * lower[j]
    return True


@inner_kernel
def _pivot(a: Reals, k: int, size: int, order: Ints) -> bool:
    """Bring the largest entry of column k up, and replace it by its reciprocal; False if the entry is
    zero."""
    row, largest = k, abs(a[k, k])
    for i in range(k + 1, size):
        if abs(a[i, k]) > largest:
            row, largest = i, abs(a[i, k])
    order[k] = row
    if row != k:
        for j in range(size):
            x = a[k, j]
            a[k, j] = a[row, j]
            a[row, j] = x
    a[k, k] = 1.0 / a[k, k]
    return bool(largest > 0.0)


@inner_kernel
def _exchange_rows(size: int, order: Ints, x: Reals) -> None:
    for k in range(size):
        row = order[k]
        value = x[row]
        x[row] = x[k]
        x[k] = value


@summing_kernel
def substitute(a: Reals, size: int, order: Ints, x: Reals) -> None:
    """Solve with the factors of `factorise` for the right-hand side x (size,), in place."""
    _exchange_rows(size, order, x)
    # By pairs of columns: entries do not wait for each other, as the terms of a sum would.
    for j in range(0, size - 1, 2):
        first = x[j]
        second = x[j + 1] = x[j + 1] - a[j + 1, j] * first
        for i in range(j + 2, size):
            x[i] -= a[i, j] * first + a[i, j + 1] * second
    for j in range(size - 1, 0, -2):
        second = x[j] = x[j] * a[j, j]
        first = x[j - 1] = (x[j - 1] - a[j - 1, j] * second) * a[j - 1, j - 1]
        for i in range(j - 1):
            x[i] -= a[i, j - 1] * first + a[i, j] * second
    if size % 2 == 1:
        x[0] *= a[0, 0]


@inner_kernel
def invert(a: Reals, size: int) -> None:
    """Invert a positive definite matrix a[:size, :size] in place (Gauss-Jordan; no pivoting is needed)."""
    for k in range(size):
        pivot = 1.0 / a[k, k]
        a[k, k] = 1.0
        for j in range(size):
            a[k, j] *= pivot
        for i in range(size):
            if i != k:
                factor = a[i, k]
                a[i, k] = 0.0
                for j in range(size):
                    a[i, j] -= factor * a[k, j]
