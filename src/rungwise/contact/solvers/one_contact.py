"""One contact, solved exactly while all other forces are held.

Algorithm: the contact is open, or sticks, or slides; in the plane the two ways of sliding are tried, in space
the slip a > 0 with y_t = -a x_t is the root of |x_t| = mu x_n, found by safeguarded Newton steps. Source:
Bonnefon and Daviet, Quartic formulation of Coulomb 3D frictional contact (2011), for the equation in a.
Accepts: blocks with a positive normal entry, not necessarily symmetric. Promises: a solution if the block is
positive definite.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, inner_kernel


@inner_kernel
def solve_contact(block: Reals, shift: float, b: Reals, mu: float, accuracy: float, x: Reals) -> None:
    """Solve one contact with rates (block + shift) x + b; block (d, d); x (d,) holds a guess at first."""
    d = len(x)
    if b[0] >= 0.0 or d == 1 or mu == 0.0:
        x[0] = max(0.0, -b[0] / (block[0, 0] + shift))
        for i in range(1, d):
            x[i] = 0.0
    elif d == 2:
        _solve_planar(block, shift, b, mu, x)
    else:
        _solve_spatial(block, shift, b, mu, accuracy, x)


@inner_kernel
def _solve_planar(block: Reals, shift: float, b: Reals, mu: float, x: Reals) -> None:
    own = block[0, 0] + shift
    stiff = block[1, 1] + shift - block[1, 0] * block[0, 1] / own
    t = (block[1, 0] * b[0] / own - b[1]) / stiff if stiff > 0.0 else 0.0
    n = -(b[0] + block[0, 1] * t) / own
    if not (stiff > 0.0 and abs(t) <= mu * n):
        sign = 1.0 if t > 0.0 or (t == 0.0 and b[1] < 0.0) else -1.0
        for _ in range(2):
            n = -b[0] / (own + sign * mu * block[0, 1])
            t = sign * mu * n
            if n >= 0.0 and sign * (block[1, 0] * n + (block[1, 1] + shift) * t + b[1]) <= 0.0:
                break
            sign = -sign
        if not (0.0 <= n < math.inf):
            n, t = -b[0] / own, 0.0
    x[0], x[1] = n, t


@inner_kernel
def _solve_spatial(block: Reals, shift: float, b: Reals, mu: float, accuracy: float, x: Reals) -> None:
    inverse = 1.0 / (block[0, 0] + shift)
    p, q = block[0, 1] * inverse, block[0, 2] * inverse
    a11, a12 = block[1, 1] + shift - block[1, 0] * p, block[1, 2] - block[1, 0] * q
    a21, a22 = block[2, 1] - block[2, 0] * p, block[2, 2] + shift - block[2, 0] * q
    free = -b[0] * inverse
    g1, g2 = b[1] + block[1, 0] * free, b[2] + block[2, 0] * free
    # Times the determinant, the tangential force is linear in the slip, the normal force quadratic.
    u1, u2 = a12 * g2 - a22 * g1, a21 * g1 - a11 * g2
    e, f, coupling = a11 * a22 - a12 * a21, a11 + a22, 1e-14 * abs(a12 * a21)
    c0, c1 = free * e - p * u1 - q * u2, free * f + p * g1 + q * g2
    if e > coupling + 1e-14 * abs(a11 * a22) and c0 >= 0.0 and u1 * u1 + u2 * u2 <= (mu * c0) ** 2:
        slip, last = 0.0, True
    else:
        slip, last = _slip(a11, a12, a21, a22, g1, g2, x), False
    low, high = 0.0, math.inf
    for _ in range(0 if last else 60):
        newer = low
        determinant = e + slip * (f + slip)
        if determinant > coupling + 1e-14 * abs((a11 + slip) * (a22 + slip)):
            t1, t2 = u1 - slip * g1, u2 - slip * g2
            n = c0 + slip * (c1 + slip * free)
            square = t1 * t1 + t2 * t2
            rate = mu * ((c1 + 2.0 * slip * free) * square + n * (t1 * g1 + t2 * g2))
            length = math.sqrt(square)
            excess = length - mu * n
            if excess > 0.0:
                low = slip
            else:
                high = slip
            # Newton on mu n / |t| - 1, which is nearly linear in the slip a.
            newer = slip + excess * (square / rate) if rate != 0.0 else low
            last = abs(excess) <= accuracy * (length + mu * abs(n)) or low >= high * (1.0 - 1e-16)
        else:
            low = slip
        if not low < newer < high:
            if last:
                break
            newer = 0.5 * (low + high) if high < math.inf else 2.0 * low + 0.5 * (abs(a11) + abs(a22))
        slip = newer
        if last:
            break
    determinant = e + slip * (f + slip)
    per = 1.0 / determinant if determinant > 0.0 else 0.0
    t1, t2 = (u1 - slip * g1) * per, (u2 - slip * g2) * per
    x[0], x[1], x[2] = free - p * t1 - q * t2, t1, t2


@inner_kernel
def _slip(a11: float, a12: float, a21: float, a22: float, g1: float, g2: float, x: Reals) -> float:
    """The slip of the guessed force on a closed contact; 0 if the force pulls nowhere."""
    pull = x[1] * x[1] + x[2] * x[2]
    if not pull > 0.0:
        return 0.0
    along = (a11 * x[1] + a12 * x[2] + g1) * x[1] + (a21 * x[1] + a22 * x[2] + g2) * x[2]
    return max(0.0, -along / pull)
