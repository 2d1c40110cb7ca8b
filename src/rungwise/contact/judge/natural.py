"""The natural map of the exact law: zero at solutions and nowhere else.

For contacts it is x - P(x - yhat), P the Euclidean projection on the friction cone |x_t| <= mu x_n and yhat
the rate with mu |y_t| added to its normal part, which turns maximum dissipation and Signorini's law into one
complementarity of a cone and its dual. The map may be 1 / mu of a penetration, which is tiny where mu is
large, and so its normal part is made no less than the penetration. For other unknowns the map is x - clip(x -
y, lower, upper), computed without the difference where the result is y. Source: De Saxce and Feng, Math.
Comput. Modelling 28 (1998) 225-245.
"""

from __future__ import annotations

import math

from rungwise.contact.problem import Laws
from rungwise.kernel import Reals, inner_kernel


@inner_kernel
def natural_map(x: Reals, y: Reals, laws: Laws, out: Reals) -> float:
    """Fill `out` with the map at x (k d + m,) and rates y; returns its Euclidean norm."""
    mu, d, lower, upper = laws
    total, rows = 0.0, d * len(mu)
    for k in range(len(mu)):
        contact_map(x, y, mu[k], d, k * d, out)
    for j in range(len(lower)):
        i = rows + j
        ahead = x[i] - y[i]
        out[i] = x[i] - lower[j] if ahead < lower[j] else x[i] - upper[j] if ahead > upper[j] else y[i]
    for i in range(rows + len(lower)):
        total += out[i] * out[i]
    return math.sqrt(total)


@inner_kernel
def contact_map(x: Reals, y: Reals, mu: float, d: int, first: int, out: Reals) -> None:
    """The map of one contact whose normal row is `first`."""
    # In the plane b is a, and without friction both are n: there the value written last counts.
    n, a, b = first, first + min(1, d - 1), first + d - 1
    y_a, y_b = y[a] if d > 1 else 0.0, y[b] if d == 3 else 0.0
    s, t = x[a] - y[a] if d > 1 else 0.0, x[b] - y[b] if d == 3 else 0.0
    rate, length = mu * math.sqrt(y_a * y_a + y_b * y_b), math.sqrt(s * s + t * t)
    normal = x[n] - y[n] - rate
    if mu * length <= -normal:
        out[b], out[a], out[n] = x[b], x[a], x[n]
    elif length <= mu * normal:
        out[b], out[a], out[n] = y[b], y[a], y[n] + rate
    else:
        onto = (normal + mu * length) / (1.0 + mu * mu)
        shrink = mu * onto / length
        out[b], out[a], out[n] = x[b] - shrink * t, x[a] - shrink * s, x[n] - onto
    if abs(out[n]) < -y[n]:
        out[n] = y[n]
