"""How far a scaled iterate is from a solution: what solvers steer by. Answers are judged elsewhere."""

from __future__ import annotations

import numpy as np

from rungwise.contact.mixed import Array
from rungwise.contact.natural import natural_map
from rungwise.contact.system import System
from rungwise.kernel import Ints, Reals, kernel

_ROUNDING = 2.0**-53


def natural(system: System, x: Array, b: Array | None = None, shift: float = 0.0) -> float:
    """Norm of the natural map of x (N,) in the system A + shift with offset b, and what rounding hides."""
    return float(np.linalg.norm(natural_parts(system, x, b, shift)))


def natural_parts(system: System, x: Array, b: Array | None = None, shift: float = 0.0) -> Array:
    """The natural map (N,), enlarged by the rounding of large unknowns; infinite where it is not finite."""
    s, y, out = system, np.empty(system.size), np.empty(system.size)
    rates(s.row_start, s.column, s.value, s.b if b is None else b, shift, x, y)
    natural_map(x, y, s.mu, s.directions, s.lower, s.upper, out)
    out = np.abs(out) + _ROUNDING * np.abs(x)
    return np.where(np.isfinite(out), out, np.inf)


@kernel
def rates(row_start: Ints, column: Ints, value: Reals, b: Reals, shift: float, x: Reals, y: Reals) -> None:
    """y = (A + shift) x + b."""
    for i in range(len(b)):
        total = b[i] + shift * x[i]
        for k in range(row_start[i], row_start[i + 1]):
            total += value[k] * x[column[k]]
        y[i] = total
