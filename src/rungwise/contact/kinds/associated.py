"""The associated law of friction: forces in Coulomb's cone, rates in its dual cone, and the two orthogonal,
so that a contact opens at mu times its slip, or more. It is convex; where it lets things rest Coulomb's law
does.

law = (mu,). x = P(x - y) with the Euclidean projection P on the cone. Source: Acary, Cadoux, Lemarechal,
Malick, ZAMM 91 (2011) 155-175.
"""

from __future__ import annotations

import math

from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.kernel import Reals, kernel

KIND = 4


@kernel
def natural_map(law: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`."""
    mu, ahead, length = law[0], x[0] - u[0], 0.0
    for i in range(1, d):
        length += (x[i] - u[i]) ** 2
    length = math.sqrt(length)
    inside, away = length <= mu * ahead and ahead > 0.0, mu * length <= -ahead
    for i in range(d):
        F[i] = u[i] if inside else x[i]
        for j in range(d):
            S[i, j] = 1.0 if inside and i == j else 0.0
    if inside or away:
        return STICK if inside else OPEN
    per, scale = 1.0 / (1.0 + mu * mu), 1.0 / length if length > 0.0 else 0.0
    top = (ahead + mu * length) * per
    F[0], S[0, 0] = x[0] - top, per
    for i in range(1, d):
        along = (x[i] - u[i]) * scale
        F[i] = x[i] - mu * top * along
        S[0, i] = S[i, 0] = mu * per * along
        for j in range(1, d):
            other = (x[j] - u[j]) * scale
            S[i, j] = (mu * mu * per - mu * top * scale) * along * other
        S[i, i] += mu * top * scale
    return BACKWARD if d == 2 and x[1] - u[1] > 0.0 else FORWARD


@kernel
def violation(law: Reals, unit: float, d: int, x: Reals, y: Reals) -> float:
    """See `kinds.violation`."""
    mu, ahead, length, total = law[0], x[0] - y[0], 0.0, 0.0
    for i in range(1, d):
        length += (x[i] - y[i]) ** 2
    length = math.sqrt(length)
    top, shrink = ahead, 1.0
    if mu * length <= -ahead:
        top, shrink = 0.0, 0.0
    elif length > mu * ahead:
        top = (ahead + mu * length) / (1.0 + mu * mu)
        shrink = mu * top / length
    for i in range(1, d):
        total += (x[i] - shrink * (x[i] - y[i])) ** 2
    return math.sqrt((x[0] - top) ** 2 + total)
