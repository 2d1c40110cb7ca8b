"""The natural map of the exact law: zero at solutions and nowhere else.

For contacts it is x - P(x - yhat), P the Euclidean projection on the friction cone |x_t| <= mu x_n and yhat
the rate with mu |y_t| added to its normal part, which turns maximum dissipation and Signorini's law into one
complementarity of a cone and its dual; for the others x - clip(x - y, lower, upper), computed
without the difference where that is y. Source: De Saxce and
Feng, Math. Comput. Modelling 28 (1998) 225-245.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, kernel


@kernel
def natural_map(x: Reals, y: Reals, mu: Reals, d: int, lower: Reals, upper: Reals, out: Reals) -> float:
    """Fill `out` with the map at x (k d + m,) and rates y; returns its Euclidean norm."""
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


@kernel
def contact_map(x: Reals, y: Reals, mu: float, d: int, first: int, out: Reals) -> None:
    """The map of one contact whose normal row is `first`."""
    rate, length = 0.0, 0.0
    for i in range(first + 1, first + d):
        rate += y[i] * y[i]
        length += (x[i] - y[i]) ** 2
    rate, length = math.sqrt(rate), math.sqrt(length)
    normal = x[first] - y[first] - mu * rate
    if mu * length <= -normal:
        for i in range(first, first + d):
            out[i] = x[i]
    elif length <= mu * normal:
        for i in range(first, first + d):
            out[i] = y[i]
        out[first] += mu * rate
    else:
        onto = (normal + mu * length) / (1.0 + mu * mu)
        out[first] = x[first] - onto
        shrink = mu * onto / length if length > 0.0 else 0.0
        for i in range(first + 1, first + d):
            out[i] = x[i] - shrink * (x[i] - y[i])
