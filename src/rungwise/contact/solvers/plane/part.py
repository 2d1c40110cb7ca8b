"""A planar step's problem with compressed rows, and its islands: parts that no row and no inertia joins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.contact.prepare.components import number, unite
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel


class Part(NamedTuple):
    """A problem, or an island of one, of n velocities, k contacts and b limited rows, which are k + b groups.

    H_first (n + 1,): where the rows of H begin in H_column and H_value; diagonal (n,) of H; c (n,); first (k
    + b + 1,): where the entries of groups begin in column, normal (of W_n or S) and tangential; R, w, mu,
    R_s, w_s, F and quantum as in `ContactProblem`.
    """

    H_first: Ints
    H_column: Ints
    H_value: Reals
    diagonal: Reals
    c: Reals
    first: Ints
    column: Ints
    normal: Reals
    tangential: Reals
    R: Reals
    w: Reals
    mu: Reals
    R_s: Reals
    w_s: Reals
    F: Reals
    quantum: float


@inner_kernel
def sizes_of(part: Part) -> Sizes:
    return Sizes(len(part.c), len(part.mu), len(part.F))


class Cut(NamedTuple):
    """Islands of a part, one after another: velocities (n,), contacts (k,) and limited (b,) list what belongs
    to them, start (islands + 1, 3) says where those of each begin; place (n,) of a velocity in its island."""

    velocities: Ints
    contacts: Ints
    limited: Ints
    start: Ints
    place: Ints


@allocating_kernel
def compress(p: ContactProblem, sizes: Sizes, columns: Ints, couplings: Ints) -> Part:
    """The problem's rows in use, where they have entries: contact k in the columns of two spans, `columns`
    (k, 4), a row of H in the stretch `couplings` (n, 2), limited rows where they are not zero."""
    n, contacts, limited = sizes
    H_first, first = np.zeros(n + 1, np.int64), np.zeros(contacts + limited + 1, np.int64)
    for i in range(n):
        H_first[i + 1] = H_first[i] + couplings[i, 1] - couplings[i, 0]
    for k in range(contacts):
        first[k + 1] = first[k] + columns[k, 1] - columns[k, 0] + columns[k, 3] - columns[k, 2]
    for r in range(limited):
        count = 0
        for i in range(n):
            count += p.S[r, i] != 0.0
        first[contacts + r + 1] = first[contacts + r] + count
    H_column, H_value = np.empty(H_first[n], np.int64), np.empty(H_first[n])
    column, normal = np.empty(first[-1], np.int64), np.empty(first[-1])
    tangential, diagonal, at = np.zeros(first[-1]), np.empty(n), 0
    for i in range(n):
        diagonal[i] = p.H[i, i]
        for j in range(couplings[i, 0], couplings[i, 1]):
            H_column[at], H_value[at] = j, p.H[i, j]
            at += 1
    at = 0
    for k in range(contacts):
        for side in range(0, 4, 2):
            for i in range(columns[k, side], columns[k, side + 1]):
                column[at], normal[at], tangential[at] = i, p.W[2 * k, i], p.W[2 * k + 1, i]
                at += 1
    for r in range(limited):
        for i in range(n):
            if p.S[r, i] != 0.0:
                column[at], normal[at] = i, p.S[r, i]
                at += 1
    return Part(
        H_first, H_column, H_value, diagonal, p.c[:n], first, column, normal, tangential, p.R[:contacts],
        p.w[: 2 * contacts], p.mu[:contacts], p.R_s[:limited], p.w_s[:limited], p.F[:limited], p.quantum[0],
    )  # fmt: skip


@allocating_kernel
def cut(part: Part) -> Cut:
    """The islands of a part, by their first velocities; groups without entries belong to the first."""
    n, contacts, limited = len(part.c), len(part.mu), len(part.F)
    label = np.empty(n, np.int64)
    for i in range(n):
        label[i] = i
    for i in range(n):
        for e in range(part.H_first[i], part.H_first[i + 1]):
            unite(label, i, part.H_column[e])
    for g in range(contacts + limited):
        for e in range(part.first[g] + 1, part.first[g + 1]):
            unite(label, part.column[part.first[g]], part.column[e])
    count = number(label, n)
    start, place = np.zeros((count + 1, 3), np.int64), np.empty(n, np.int64)
    for i in range(n):
        start[label[i] + 1, 0] += 1
    for g in range(contacts + limited):
        start[_owner(part, g, label) + 1, 1 if g < contacts else 2] += 1
    for i in range(count):
        for j in range(3):
            start[i + 1, j] += start[i, j]
    velocities, members = np.empty(n, np.int64), np.empty(contacts, np.int64)
    rows, at = np.empty(limited, np.int64), start.copy()
    for i in range(n):
        own = label[i]
        velocities[at[own, 0]] = i
        place[i] = at[own, 0] - start[own, 0]
        at[own, 0] += 1
    for g in range(contacts + limited):
        own = _owner(part, g, label)
        if g < contacts:
            members[at[own, 1]] = g
            at[own, 1] += 1
        else:
            rows[at[own, 2]] = g - contacts
            at[own, 2] += 1
    return Cut(velocities, members, rows, start, place)


@inner_kernel
def _owner(part: Part, g: int, label: Ints) -> int:
    """The island of a group, given those of velocities."""
    return int(label[part.column[part.first[g]]]) if part.first[g] < part.first[g + 1] else 0


@allocating_kernel
def island(part: Part, apart: Cut, i: int) -> Part:
    """A copy of island i, with columns counted within it."""
    contacts = len(part.mu)
    own = apart.velocities[apart.start[i, 0] : apart.start[i + 1, 0]]
    members = apart.contacts[apart.start[i, 1] : apart.start[i + 1, 1]]
    rows = apart.limited[apart.start[i, 2] : apart.start[i + 1, 2]]
    n, k, b = len(own), len(members), len(rows)
    H_first, first = np.zeros(n + 1, np.int64), np.zeros(k + b + 1, np.int64)
    for j in range(n):
        H_first[j + 1] = H_first[j] + part.H_first[own[j] + 1] - part.H_first[own[j]]
    for j in range(k + b):
        g = members[j] if j < k else contacts + rows[j - k]
        first[j + 1] = first[j] + part.first[g + 1] - part.first[g]
    H_column, H_value = np.empty(H_first[n], np.int64), np.empty(H_first[n])
    column, normal, tangential = np.empty(first[-1], np.int64), np.empty(first[-1]), np.empty(first[-1])
    for j in range(n):
        begin = part.H_first[own[j]]
        for e in range(H_first[j + 1] - H_first[j]):
            H_column[H_first[j] + e] = apart.place[part.H_column[begin + e]]
            H_value[H_first[j] + e] = part.H_value[begin + e]
    for j in range(k + b):
        begin = part.first[members[j] if j < k else contacts + rows[j - k]]
        for e in range(first[j + 1] - first[j]):
            column[first[j] + e] = apart.place[part.column[begin + e]]
            normal[first[j] + e] = part.normal[begin + e]
            tangential[first[j] + e] = part.tangential[begin + e]
    diagonal, c, w, mu = np.empty(n), np.empty(n), np.empty(2 * k), np.empty(k)
    R, R_s, w_s, F = np.empty((k, 2, 2)), np.empty(b), np.empty(b), np.empty(b)
    for j in range(n):
        diagonal[j], c[j] = part.diagonal[own[j]], part.c[own[j]]
    for j in range(k):
        g = members[j]
        mu[j], w[2 * j], w[2 * j + 1] = part.mu[g], part.w[2 * g], part.w[2 * g + 1]
        for d in range(2):
            R[j, d, 0], R[j, d, 1] = part.R[g, d, 0], part.R[g, d, 1]
    for j in range(b):
        R_s[j], w_s[j], F[j] = part.R_s[rows[j]], part.w_s[rows[j]], part.F[rows[j]]
    return Part(
        H_first, H_column, H_value, diagonal, c, first, column, normal, tangential, R, w, mu, R_s, w_s, F,
        part.quantum,
    )  # fmt: skip


@allocating_kernel
def guess(apart: Cut, i: int, whole: Unknowns, limits: int) -> Unknowns:
    """The unknowns of island i, with their values in `whole`, which has so many contacts."""
    own = apart.velocities[apart.start[i, 0] : apart.start[i + 1, 0]]
    members = apart.contacts[apart.start[i, 1] : apart.start[i + 1, 1]]
    rows = apart.limited[apart.start[i, 2] : apart.start[i + 1, 2]]
    n, k, b = len(own), len(members), len(rows)
    mode, v, force, tau = np.empty(k + b, np.int64), np.empty(n), np.empty(2 * k), np.empty(b)
    for j in range(n):
        v[j] = whole.v[own[j]]
    for j in range(k):
        mode[j] = whole.mode[members[j]]
        force[2 * j], force[2 * j + 1] = whole.force[2 * members[j]], whole.force[2 * members[j] + 1]
    for j in range(b):
        mode[k + j], tau[j] = whole.mode[limits + rows[j]], whole.tau[rows[j]]
    return Unknowns(mode, v, force, tau)


@kernel
def hand_back(apart: Cut, i: int, found: Unknowns, whole: Unknowns, limits: int) -> None:
    """Write the unknowns of island i into those of the whole, which has so many contacts."""
    begin, end, k = apart.start[i], apart.start[i + 1], len(found.force) // 2
    for j in range(end[0] - begin[0]):
        whole.v[apart.velocities[begin[0] + j]] = found.v[j]
    for j in range(k):
        g = apart.contacts[begin[1] + j]
        whole.mode[g] = found.mode[j]
        whole.force[2 * g], whole.force[2 * g + 1] = found.force[2 * j], found.force[2 * j + 1]
    for j in range(end[2] - begin[2]):
        r = apart.limited[begin[2] + j]
        whole.mode[limits + r], whole.tau[r] = found.mode[k + j], found.tau[j]
