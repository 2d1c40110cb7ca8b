"""How far the laws of a problem are from being met: by the kinds of its groups, as in steps."""

from __future__ import annotations

import math

from rungwise.contact.kinds import cone, interval, nothing
from rungwise.contact.problem import Laws
from rungwise.kernel import Reals, inner_kernel


@inner_kernel
def fill_violations(laws: Laws, x: Reals, y: Reals, out: Reals) -> float:
    """Fill out (laws,) with the violation of each law, contacts first, by x (N,) and rates y (N,), in units
    in which both are alike; returns their Euclidean norm. Not a number where something is not finite."""
    mu, d, lower, upper = laws
    total, rows = 0.0, d * len(mu)
    for k in range(len(mu)):
        force, rate = x[k * d : (k + 1) * d], y[k * d : (k + 1) * d]
        out[k] = cone.violation(mu[k : k + 1], 1.0, d, force, rate) + nothing(d, force, rate)
        total += out[k] * out[k]
    for j in range(len(lower)):
        k, force, rate = len(mu) + j, x[rows + j : rows + j + 1], y[rows + j : rows + j + 1]
        out[k] = interval.violation((lower[j], upper[j]), 1.0, 1, force, rate) + nothing(1, force, rate)
        total += out[k] * out[k]
    return math.sqrt(total)
