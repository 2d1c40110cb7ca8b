"""Problems without contacts in units in which their entries are as near to one as they can be.

What elimination takes for a pivot, and solvers for rounding, depends on units: rows and unknowns are measured
by their magnitudes (see `magnitudes`), rounded to powers of two, so that no digit changes.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare.magnitudes import magnitudes
from rungwise.contact.prepare.units import compressed
from rungwise.contact.problem import Array, Problem


def in_even_units(problem: Problem) -> tuple[Problem, Array]:
    """The same problem, and the units (N,) of its unknowns."""
    p = problem
    sizes = magnitudes(compressed(p.A), p.b, p.laws)
    row, unit = (np.exp2(np.rint(np.log2(each))) for each in (sizes.row, sizes.column))
    A = sp.diags_array(1.0 / row) @ sp.csr_array(p.A) @ sp.diags_array(unit)
    return Problem.boxes(A, p.b / row, p.lower / unit, p.upper / unit), unit
