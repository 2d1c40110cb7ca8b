"""Connected parts of the unknowns that the entries of a matrix join."""

from __future__ import annotations

from rungwise.contact.prepare.units import Sparse
from rungwise.kernel import Ints, inner_kernel, kernel


@kernel
def join(A: Sparse, rows: int, d: int, offset: int, label: Ints) -> None:
    """Let all unknowns for which a row of A has entries be one part: labels, at first each its own place,
    then lead from each contact (d of the first `rows` rows) and each other unknown to one before it, or to
    itself.

    Columns are counted from `offset`.
    """
    contacts = rows // d
    for i in range(len(A.start) - 1):
        mine = i // d if i < rows else contacts + i - rows
        for k in range(A.start[i], A.start[i + 1]):
            if A.value[k] == 0.0:
                continue
            j = A.place[k] + offset
            unite(label, mine, j // d if j < rows else contacts + j - rows)


@inner_kernel
def unite(label: Ints, a: int, b: int) -> None:
    """Let two trees of labels, each of which leads to its least member, be one."""
    while label[a] != a:
        label[a] = label[label[a]]
        a = label[a]
    while label[b] != b:
        label[b] = label[label[b]]
        b = label[b]
    label[max(a, b)] = min(a, b)


@kernel
def number(label: Ints, size: int) -> int:
    """Replace the labels of the first so many by the numbers of their parts; returns how many there are."""
    count = 0
    for k in range(size):
        if label[k] == k:
            label[k] = count
            count += 1
        else:
            label[k] = label[label[k]]
    return count
