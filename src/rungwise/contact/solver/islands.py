"""Parts of a problem that nothing joins: each is solved alone, so that what rests does so beside what
moves."""

from __future__ import annotations

from rungwise.contact.solver.groups import LAW, Counts, Groups, groups_in
from rungwise.kernel import Ints, Reals, inner_kernel, kernel


@kernel
def label_islands(g: Groups, label: Ints, root: Ints) -> int:
    """Write the island of each velocity and then of each group into label (n + groups,); root (n +
    groups,) is scratch. Returns how many there are: what neither H nor groups join is apart, and all that
    no group touches is one."""
    n, groups = len(g.c), len(g.kind)
    for i in range(n + groups):
        root[i], label[i] = i, -1
    for i in range(n):
        for e in range(g.H_first[i], g.H_first[i + 1]):
            _join(root, i, g.H_column[e])
    for k in range(groups):
        for e in range(g.first[k], g.first[k + 1]):
            _join(root, n + k, g.column[e])
    for k in range(groups):
        label[_root(root, n + k)] = 0
    count, bare = 0, -1
    for i in range(n + groups):  # the least member of an island is its root
        own = _root(root, i)
        if own != i:
            label[i] = label[own]
        elif label[i] < 0 and bare >= 0:
            label[i] = bare
        else:
            bare = count if label[i] < 0 else bare
            label[i] = count
            count += 1
    return count


@inner_kernel
def _root(root: Ints, i: int) -> int:
    while root[i] != i:
        root[i] = root[root[i]]
        i = root[i]
    return i


@inner_kernel
def _join(root: Ints, i: int, j: int) -> None:
    a, b = _root(root, i), _root(root, j)
    root[max(a, b)] = min(a, b)


@kernel
def count_island(g: Groups, whole: Counts, label: Ints, which: int, place: Ints, own: Ints) -> Counts:
    """What `fill_island` will need room for. Writes the velocities of the island into own (n,), and where
    they are there into place (n,)."""
    n, count, groups, rows, filled, touched, entries = len(g.c), 0, 0, 0, 0, 0, 0
    for i in range(n):
        if label[i] == which:
            place[i], own[count] = count, i
            filled += g.H_first[i + 1] - g.H_first[i]
            count += 1
    for k in range(len(g.kind)):
        if label[n + k] == which:
            groups += 1
            rows += g.row[k + 1] - g.row[k]
            touched += g.first[k + 1] - g.first[k]
            entries += g.entry[k + 1] - g.entry[k]
    apart = entries if whole.apart > 0 else 0
    return Counts(count, groups, rows, filled, touched, entries, whole.d, apart)


@kernel
def fill_island(g: Groups, label: Ints, which: int, place: Ints, own: Ints, part: Groups) -> None:
    """Fill the groups of one island; neither is yet counted in units."""
    n, at = len(g.c), 0
    part.noise[0] = g.noise[0]
    part.H_first[0] = part.row[0] = part.first[0] = part.entry[0] = 0
    for i in range(len(part.c)):
        for e in range(g.H_first[own[i]], g.H_first[own[i] + 1]):
            part.H_column[at], part.H[at] = place[g.H_column[e]], g.H[e]
            at += 1
        part.H_first[i + 1], part.c[i], part.diagonal[i] = at, g.c[own[i]], g.diagonal[own[i]]
    m = 0
    for k in range(len(g.kind)):
        if label[n + k] != which:
            continue
        size, width, row = g.row[k + 1] - g.row[k], g.first[k + 1] - g.first[k], part.row[m]
        part.kind[m] = g.kind[k]
        for i in range(LAW):
            part.law[m, i] = g.law[k, i]
        part.row[m + 1], part.first[m + 1] = row + size, part.first[m] + width
        part.entry[m + 1] = part.entry[m] + size * width
        for e in range(width):
            part.column[part.first[m] + e] = place[g.column[g.first[k] + e]]
        for e in range(size * width):
            part.W[part.entry[m] + e] = g.W[g.entry[k] + e]
            part.C[part.entry[m] + e] = g.C[g.entry[k] + e]
        for i in range(size):
            part.w[row + i], part.origin[row + i] = g.w[g.row[k] + i], g.origin[g.row[k] + i]
            part.force[row + i] = g.force[g.row[k] + i]
            for j in range(size):
                part.R[m, i, j] = g.R[k, i, j]
        m += 1


@kernel
def cut_island(
    reals: Reals,
    integers: Ints,
    whole: Counts,
    numbers: Reals,
    scratch: Ints,
    which: int,
    own_reals: Reals,
    own_integers: Ints,
) -> Counts:
    """Fill the groups of an island, whose velocities follow the labels and as much room in `scratch`: first
    which they are, then their places."""
    g, members = groups_in(reals, integers, whole, numbers), whole.n + whole.groups
    label, own, place = scratch[:members], scratch[2 * members :], scratch[2 * members + whole.n :]
    part = count_island(g, whole, label, which, place, own)
    fill_island(g, label, which, place, own, groups_in(own_reals, own_integers, part, numbers))
    return part
