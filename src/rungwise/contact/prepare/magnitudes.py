"""Magnitudes of rows and of unknowns: what is rounding beside them.

Row i has a magnitude r_i and unknown j a magnitude c_j, such that the entries |A_ij| c_j / r_i are as near
to one as they can be: the sum of the squares of their logarithms is least. Diagonals have no special part. In
each part of the unknowns that entries join the magnitudes are determined but for one common factor, and so
follow the units of rows and of unknowns, whatever these are. Algorithm: conjugate gradients, begun at the
magnitudes that a tree of entries gives, which follow the units already; therefore so do all iterates. Source:
Curtis and Reid, J. Inst. Math. Appl. 10 (1972) 118-124.

Entries alone do not tell whether the force of a stiff contact is large. Loads do: offsets and limits reach
the unknowns of their own rows, from there the rows without a load, and so on. An unknown counts as no larger
than the least load of the rows that reach it first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array, Laws
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel

_MOST = 40
"""Most iterations: some ten are enough (Curtis and Reid)."""
_ENOUGH = 1e-2
"""Gradient, over the first gradient of entries that are e apart, at which the iteration ends: magnitudes need
no digits."""


class Magnitudes(NamedTuple):
    """row (N,) of the rows, column (N,) of the unknowns; label (2 N,): the part to which each row, and then
    each unknown, belongs; load (N,), the load that reaches a row, and most (N,), an unknown; rate (N,) and
    force (N,), the same magnitudes times the norm of the loads of the part, infinite where it has none."""

    row: Reals
    column: Reals
    label: Ints
    load: Reals
    most: Reals
    rate: Reals
    force: Reals


def magnitudes(A: Sparse, b: Array, laws: Laws) -> Magnitudes:
    """The magnitudes of the rows A and of their unknowns."""
    numbers, n = np.zeros((6, len(b))), len(b)
    made = Magnitudes(numbers[0], numbers[1], np.empty(2 * n, np.int64), *numbers[2:])
    measure(A, b, laws, made)
    return made


@allocating_kernel
def measure(A: Sparse, b: Reals, laws: Laws, found: Magnitudes) -> None:
    """Fill the magnitudes."""
    row, column, label, load, most, rate, force = found
    n = len(row)
    z, queue = np.zeros(2 * n), np.empty(2 * n, np.int64)
    columns = Sparse(np.zeros(n + 1, np.int64), np.empty(A.start[n], np.int64), np.empty(A.start[n]))
    _transpose(A, columns)
    for i in range(2 * n):
        label[i] = -1
    _along_a_tree(A, columns, z, label, queue)
    _fit(A, z, np.empty((4, 2 * n)))
    for i in range(n):
        row[i], column[i] = math.exp(-z[i]), math.exp(z[n + i])
    _loads(A, b, laws, load)
    _fill_units(row, column, label, load, np.zeros(2 * n), rate, force)
    _spread(A, columns, load, most, queue)


@kernel
def largest(b: Reals, x: Reals, sizes: Magnitudes, size: Reals) -> None:
    """Fill size (2 N,), by labels: the largest |x_j| / c_j and |b_i| / r_i of each part."""
    row, column, label = sizes.row, sizes.column, sizes.label
    n = len(b)
    for i in range(2 * n):
        size[i] = 0.0
    for i in range(n):
        size[label[i]] = max(size[label[i]], abs(b[i]) / row[i])
        size[label[n + i]] = max(size[label[n + i]], abs(x[i]) / column[i])


@kernel
def faint_terms(A: Sparse, sizes: Magnitudes, size: Reals, rows: int, faint: Reals) -> None:
    """Fill faint (N,): the terms that each row would have if all unknowns were as large as the largest of
    their part, in their magnitudes; no more than if its entries were one; nor, but for the first `rows`, of
    contacts, which loads reach through one another, than the load that reaches it. `size` as `largest` fills
    it."""
    row, column, label = sizes.row, sizes.column, sizes.label
    for i in range(len(faint)):
        terms = 0.0
        for k in range(A.start[i], A.start[i + 1]):
            terms += abs(A.value[k]) * column[A.place[k]]
        faint[i] = min(terms, row[i]) * size[label[i]]
        if i >= rows:
            faint[i] = min(faint[i], sizes.load[i])


@inner_kernel
def _loads(A: Sparse, b: Reals, laws: Laws, load: Reals) -> None:
    """Fill load (N,): the sizes of offsets, and of what limited unknowns do at most."""
    rows = laws.d * len(laws.mu)
    for i in range(len(b)):
        load[i] = abs(b[i])
        for k in range(A.start[i], A.start[i + 1]):
            j = A.place[k] - rows
            limit = max(abs(laws.lower[j]), abs(laws.upper[j])) if j >= 0 else math.inf
            if limit < math.inf:
                load[i] += abs(A.value[k]) * limit


@inner_kernel
def _fill_units(
    row: Reals, column: Reals, label: Ints, load: Reals, size: Reals, rate: Reals, force: Reals
) -> None:
    """Fill rate and force (N,); size (2 N,) is zero."""
    n = len(row)
    for i in range(n):
        size[label[i]] += (load[i] / row[i]) ** 2
    for i in range(2 * n):
        size[i] = math.sqrt(size[i]) if size[i] > 0.0 else math.inf
    for i in range(n):
        rate[i], force[i] = row[i] * size[label[i]], column[i] * size[label[n + i]]


@inner_kernel
def _spread(A: Sparse, columns: Sparse, load: Reals, most: Reals, queue: Ints) -> None:
    """Fill most (N,), infinite where no load reaches an unknown, and load where it is zero; queue (2 N,)."""
    n = len(load)
    head, tail = 0, 0
    for i in range(n):
        most[i] = math.inf
        if load[i] > 0.0:
            queue[tail] = i
            tail += 1
    while head < tail:  # the rows of one more layer, then the unknowns that they reach
        end, reached = tail, n
        for at in range(head, end):
            i = queue[at]
            for k in range(A.start[i], A.start[i + 1]):
                j = A.place[k]
                if A.value[k] == 0.0:
                    continue
                if most[j] == math.inf:
                    queue[reached] = j
                    reached += 1
                    most[j] = -math.inf
                if most[j] <= 0.0:
                    most[j] = max(most[j], -load[i] / abs(A.value[k]))
        for at in range(n, reached):
            most[queue[at]] = -most[queue[at]]
        for at in range(n, reached):
            j = queue[at]
            for k in range(columns.start[j], columns.start[j + 1]):
                i = columns.place[k]
                if load[i] == 0.0 and columns.value[k] != 0.0:
                    load[i] = _reaching(A, i, most)
                    queue[tail] = i
                    tail += 1
        head = end


@inner_kernel
def _reaching(A: Sparse, i: int, most: Reals) -> float:
    """What the unknowns that loads reach do to a row."""
    total = 0.0
    for k in range(A.start[i], A.start[i + 1]):
        if most[A.place[k]] < math.inf:
            total += abs(A.value[k]) * most[A.place[k]]
    return total


@inner_kernel
def _transpose(A: Sparse, columns: Sparse) -> None:
    """Fill the columns of A; their starts are zero before."""
    start, place, value = columns
    n = len(start) - 1
    for k in range(A.start[n]):
        start[A.place[k]] += 1
    total = 0
    for j in range(n):
        total += start[j]
        start[j] = total
    start[n] = total
    for i in range(n - 1, -1, -1):
        for k in range(A.start[i], A.start[i + 1]):
            j = A.place[k]
            start[j] -= 1
            place[start[j]], value[start[j]] = i, A.value[k]


@inner_kernel
def _along_a_tree(A: Sparse, columns: Sparse, z: Reals, label: Ints, queue: Ints) -> None:
    """Fill z (2 N,), logarithms that make the entries of a tree one, and the labels, -1 before."""
    n, count = len(z) // 2, 0
    for root in range(2 * n):
        if label[root] >= 0:
            continue
        label[root], queue[0] = count, root
        head, tail = 0, 1
        while head < tail:
            node = queue[head]
            head += 1
            lines = A if node < n else columns
            own, other = node if node < n else node - n, n if node < n else 0
            for k in range(lines.start[own], lines.start[own + 1]):
                next_one = lines.place[k] + other
                if lines.value[k] != 0.0 and label[next_one] < 0:
                    label[next_one] = count
                    z[next_one] = -math.log(abs(lines.value[k])) - z[node]
                    queue[tail] = next_one
                    tail += 1
        count += 1


@inner_kernel
def _fit(A: Sparse, z: Reals, scratch: Reals) -> None:
    """Improve z by conjugate gradients; scratch (4, 2 N)."""
    n, left, step, image, count = len(z) // 2, scratch[0], scratch[1], scratch[2], scratch[3]
    for i in range(2 * n):
        left[i] = image[i] = count[i] = 0.0
    for i in range(n):
        for k in range(A.start[i], A.start[i + 1]):
            j = n + A.place[k]
            if A.value[k] != 0.0:
                off = math.log(abs(A.value[k])) + z[i] + z[j]
                left[i] -= off
                left[j] -= off
                count[i] += 1.0
                count[j] += 1.0
    size, goal = 0.0, 0.0
    for i in range(2 * n):
        step[i] = left[i] / count[i] if count[i] > 0.0 else 0.0
        size += left[i] * step[i]
        goal += count[i] * _ENOUGH**2
    for _ in range(_MOST):
        if not size > goal:
            return
        for i in range(2 * n):
            image[i] = 0.0
        for i in range(n):
            for k in range(A.start[i], A.start[i + 1]):
                j = n + A.place[k]
                if A.value[k] != 0.0:
                    both = step[i] + step[j]
                    image[i] += both
                    image[j] += both
        along = 0.0
        for i in range(2 * n):
            along += step[i] * image[i]
        if not along > 0.0:
            return
        length, before, size = size / along, size, 0.0
        for i in range(2 * n):
            z[i] += length * step[i]
            left[i] -= length * image[i]
            size += left[i] * left[i] / count[i] if count[i] > 0.0 else 0.0
        for i in range(2 * n):
            own = left[i] / count[i] if count[i] > 0.0 else 0.0
            step[i] = own + size / before * step[i]
