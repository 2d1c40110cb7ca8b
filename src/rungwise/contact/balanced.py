"""Answers whose forces balance to the last digit.

Beside a very heavy body, or far below the forces that carry it, a balance of forces that is rounding of
others may be far from its own terms. Algorithm: velocities are kept; least squares for the change of forces
that closes the balance, each counted by its own size, so that forces stay in their cones and what does not
push does not begin to. Accepts: up to `LARGEST` unknowns. Promises nothing: whether it is a solution is for
the judge to say.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, lstsq

from rungwise.contact.problem import Array, Problem

LARGEST = 1500
"""Unknowns up to which least squares of the dense balance take less than a second or two."""
_ROUNDS = 3
"""Corrections of the balance: the second and the third take out the rounding of the first."""


@np.errstate(all="ignore")  # what is not finite is judged
def balanced(problem: Problem, x: Array) -> Array:
    """x (N,) with the nearest forces that balance; or x, where there are no velocities, too many unknowns, or
    no forces."""
    p = problem
    moving = np.zeros(len(x), bool)
    moving[p.rows : p.rows + p.velocities] = True
    pushing = ~moving
    pushing[: p.rows] = np.repeat(x[: p.rows : p.directions] > 0.0, p.directions)
    size = _sizes(p, x)[pushing]
    if not moving.any() or not size.any() or len(x) > LARGEST:
        return x
    rows = sp.csr_array(p.A)[moving]
    terms, bearing = abs(rows) @ np.abs(x) + np.abs(p.b[moving]), rows[:, pushing].toarray()
    own, made = np.maximum(terms, np.finfo(float).tiny), x.copy()
    for _ in range(_ROUNDS):
        left = (rows @ made + p.b[moving]) / own
        try:
            change = lstsq(bearing * size / own[:, None], left, lapack_driver="gelsd")[0]
        except (LinAlgError, ValueError):
            return x
        made[pushing] -= size * change
    return made


def _sizes(p: Problem, x: Array) -> Array:
    """How large each unknown (N,) is; forces of a contact count alike."""
    size = np.abs(x)
    if p.rows > 0:
        each = size[: p.rows].reshape(-1, p.directions).max(axis=1)
        size[: p.rows] = np.repeat(each, p.directions)
    return np.asarray(size)
