"""Linear systems of Newton steps in small problems, reduced to unknowns that depend on each other.

With D the derivative of the projections, (I + damping - kept D + rho D A) dx = F gives the forces of open
contacts and of unknowns at limits at once; where a contact slides, the normal force gives the friction along
the slip. Directions u of forces remain, with one equation l each: the normal force of a closed contact (with
its friction if the contact slides), both tangential forces where the contact sticks, the force across the
slip where the contact slides.
"""

from __future__ import annotations

from rungwise.contact.linear import factorise, substitute
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.solvers.measure import row_times
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

INTS, REALS = 3, 4
"""How many integers and reals describe a direction: its block, the row that is l (or -1), the unknown that is
u (or -1); u in its block, and the part of D along u."""


@kernel
def directions(D: Reals, mu: Reals, d: int, place: Ints, u: Reals) -> int:
    """Fill place (N, 3) and u (N, 4); returns how many directions remain. D (N, 3) holds rows within
    blocks."""
    m, rows = 0, d * len(mu)
    for k in range(len(mu)):
        n, a, b = k * d, k * d + min(1, d - 1), k * d + d - 1
        if D[n, 0] == 0.0:
            continue
        if d == 1 or (D[a, 1] == 1.0 and D[a, 0] == 0.0):
            for i in range(d):
                m = _add(place, u, m, n, n + i, n + i, 0.0, 0.0, 0.0, 1.0)
            continue
        along, across = D[a, 0], D[b, 0] if d == 3 else 0.0
        m = _add(place, u, m, n, n, n if mu[k] == 0.0 else -1, 1.0, along, across, 1.0)
        if d == 3 and D[a, 1] + D[b, 2] > 0.0:
            m = _add(place, u, m, n, -1, -1, 0.0, -across / mu[k], along / mu[k], D[a, 1] + D[b, 2])
    for i in range(rows, len(D)):
        if D[i, 0] != 0.0:
            m = _add(place, u, m, i, i, i, 0.0, 0.0, 0.0, 1.0)
    return m


@inner_kernel
def _add(
    place: Ints, u: Reals, m: int, first: int, row: int, own: int, n: float, a: float, b: float, part: float
) -> int:
    place[m, 0], place[m, 1], place[m, 2] = first, row, own
    u[m, 0], u[m, 1], u[m, 2], u[m, 3] = n, a, b, part
    return m + 1


@inner_kernel
def factorise_reduced(
    A: Reals,
    d: int,
    place: Ints,
    u: Reals,
    rho: float,
    kept: float,
    damping: float,
    scratch: Reals,
    K: Reals,
    order: Ints,
) -> bool:
    """Factors of l (I + damping - kept D + rho D A) u in K, False if it is singular; place (m, 3) and u
    (m, 4) as `directions` filled them; scratch (N,)."""
    m, a, b = len(place), min(1, d - 1), d - 1
    for p in range(m):
        first, line, part = place[p, 0], place[p, 1], rho * u[p, 3]
        row = A[line] if line >= 0 else scratch
        if line < 0:
            along, across, s, t = A[first + a], A[first + b], u[p, 1], u[p, 2]
            for c in range(len(row)):
                row[c] = s * along[c] + t * across[c]
        for q in range(m):
            own, at = place[q, 2], place[q, 0]
            if own >= 0:
                K[p, q] = part * row[own]
            else:
                K[p, q] = part * (u[q, 0] * row[at] + u[q, 1] * row[at + a] + u[q, 2] * row[at + b])
        K[p, p] += 1.0 + damping - kept * u[p, 3]
    return factorise(K, m, order)


@inner_kernel
def solve_reduced(
    A: Sparse,
    F: Reals,
    d: int,
    place: Ints,
    u: Reals,
    rho: float,
    damping: float,
    K: Reals,
    order: Ints,
    z: Reals,
    dx: Reals,
) -> None:
    """Fill dx (N,), from the factors in K; z (N,) is scratch."""
    m, a, b, per, at_once = len(place), min(1, d - 1), d - 1, 1.0 / (1.0 + damping), 0.0
    for i in range(len(dx)):
        dx[i] = per * F[i]
    for p in range(m):
        first, line, own = place[p, 0], place[p, 1], place[p, 2]
        z[p] = F[line] if line >= 0 else u[p, 1] * F[first + a] + u[p, 2] * F[first + b]
        if own >= 0:
            dx[own] = 0.0
        else:
            dx[first] -= per * z[p] * u[p, 0]
            dx[first + a] -= per * z[p] * u[p, 1]
            dx[first + b] -= per * z[p] * u[p, 2]
    for i in range(len(dx)):
        at_once += abs(dx[i])
    for p in range(m if at_once > 0.0 else 0):
        first, line = place[p, 0], place[p, 1]
        if line >= 0:
            change = row_times(A, line, dx)
        else:
            change = u[p, 1] * row_times(A, first + a, dx) + u[p, 2] * row_times(A, first + b, dx)
        z[p] -= rho * u[p, 3] * change
    substitute(K, m, order, z)
    for p in range(m):
        first, own = place[p, 0], place[p, 2]
        if own >= 0:
            dx[own] = z[p]
        else:
            dx[first] += u[p, 0] * z[p]
            dx[first + a] += u[p, 1] * z[p]
            dx[first + b] += u[p, 2] * z[p]
