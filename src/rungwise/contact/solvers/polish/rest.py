"""Answers in which everything is exactly at rest.

Below a very heavy body a force that is rounding beside those it carries moves a light one: an iterate whose
forces hold everything, and whose velocities are rounding of the heavy bodies' scale, may be far from the laws
of the light ones. With velocities of exactly zero and the nearest forces that balance, all laws hold.
Algorithm: least squares for the change of forces that closes the balance, each counted by its own size, so
that forces stay in their cones and what does not push does not begin to. Accepts: up to `LARGEST` unknowns.
Promises nothing: whether rest is a solution is for the judge to say.
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


def rested(problem: Problem, x: Array) -> Array:
    """x (N,) with all velocities zero and the nearest forces that balance; or x, where there are no
    velocities, too many unknowns, or no forces."""
    p = problem
    moving = np.zeros(len(x), bool)
    moving[p.rows : p.rows + p.velocities] = True
    pushing = ~moving
    pushing[: p.rows] = np.repeat(x[: p.rows : p.directions] > 0.0, p.directions)
    size = _sizes(p, x)[pushing]
    if not moving.any() or not size.any() or len(x) > LARGEST:
        return x
    A = p.A.toarray() if sp.issparse(p.A) else p.A
    bearing = A[np.ix_(moving, pushing)]
    own = np.maximum(np.abs(bearing) @ size + np.abs(p.b[moving]), np.finfo(float).tiny)
    rest = np.where(pushing, x, 0.0)
    for _ in range(_ROUNDS):
        left = (bearing @ rest[pushing] + p.b[moving]) / own
        try:
            change = lstsq(bearing * size / own[:, None], left, lapack_driver="gelsd")[0]
        except (LinAlgError, ValueError):
            return x
        rest[pushing] -= size * change
    return rest


def _sizes(p: Problem, x: Array) -> Array:
    """How large each unknown (N,) is; forces of a contact count alike."""
    size = np.abs(x)
    if p.rows > 0:
        each = size[: p.rows].reshape(-1, p.directions).max(axis=1)
        size[: p.rows] = np.repeat(each, p.directions)
    return np.asarray(size)
