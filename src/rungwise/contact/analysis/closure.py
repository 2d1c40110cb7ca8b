"""Form and force closure of a planar set of contacts on one body, each verdict with its certificate.

Closure holds iff the contacts' wrenches positively span all wrenches (Reuleaux 1876; Nguyen, Int. J. Robotics
Research 7(3), 1988): their matrix has full rank, and some strictly positive combination of them vanishes.
Otherwise some twist lets no contact object: the body can move (form closure), or a load along it cannot be
balanced by contact forces inside their cones (force closure). Both questions are linear programs, and
`check`, which solves none, checks both answers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.content import ByContent
from rungwise.keywords import keywords
from rungwise.plain import brief

_SMALL = 1e-9
"""Forces over the greatest force, singular values over the greatest, and power in units of the unit wrenches,
that count as zero. Chosen by trial, to a decade, far above rounding."""


@dataclass(frozen=True, eq=False)
class Closure(ByContent):
    """Whether a set of contacts closes, and why.

    `wrenches` (3, m): force and moment over `length` about `centre`, of unit forces, one column for each
    contact (form closure) or two, the edges of its friction cone (force closure). If it holds, `certificate`
    (m,) are strictly positive forces whose wrenches cancel, and `margin` the least of these forces over the
    largest; otherwise `certificate` is a twist (3,) (velocity, and angular velocity times `length`) with
    non-negative power on every wrench.
    """

    holds: bool
    wrenches: NDArray[np.float64]
    certificate: NDArray[np.float64]
    margin: float
    centre: NDArray[np.float64]
    length: float

    __repr__ = brief

    def __bool__(self) -> bool:
        return self.holds


@keywords
def form_closure(points: ArrayLike, normals: ArrayLike) -> Closure:
    """First-order form closure of a body by frictionless contacts that do not move.

    Args:
        points: (k, 2), where the contacts touch the body.
        normals: (k, 2), into the body, of any length.

    Raises ValueError for wrong shapes, numbers that are not finite or a normal without length.
    """
    where, directions = _contacts(points, normals)
    return _closure(where, directions, np.arange(len(where)))


@keywords
def force_closure(points: ArrayLike, normals: ArrayLike, friction: ArrayLike) -> Closure:
    """Force closure of a body by contacts with Coulomb friction (a number, or one for each contact): points
    (k, 2) where they touch the body, and normals (k, 2) into it.

    Two contacts with friction close iff the line between them lies strictly inside both cones.
    """
    where, directions = _contacts(points, normals)
    mu = _numbers("friction", friction)
    if mu.shape not in ((), (len(where),)):
        raise ValueError(f"friction: must be a number, or one for each of {len(where)} contacts")
    mu = np.broadcast_to(mu, (len(where),))
    if not np.all(np.isfinite(mu) & (mu >= 0.0)):
        raise ValueError("friction: must be finite and not negative")
    tangents = np.column_stack([-directions[:, 1], directions[:, 0]]) * mu[:, None]
    edges = np.vstack([directions + tangents, directions - tangents])
    return _closure(where, edges, np.tile(np.arange(len(where)), 2))


def check(closure: Closure) -> bool:
    """Whether the certificate proves the verdict, to rounding."""
    wrenches, certificate = closure.wrenches, closure.certificate
    if not np.all(np.isfinite(certificate)):
        return False
    if closure.holds:
        if certificate.shape != wrenches.shape[1:] or not certificate.min(initial=1.0) > 0.0:
            return False
        left = np.abs(wrenches @ certificate).max(initial=0.0)
        return bool(
            left <= _SMALL * certificate.max(initial=0.0) and np.linalg.matrix_rank(wrenches, _SMALL) == 3
        )
    if certificate.shape != (3,) or not np.abs(certificate).max() > 0.0:
        return False
    power = certificate @ wrenches
    return bool(power.min(initial=0.0) >= -_SMALL * np.abs(certificate).max())


def _numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: must be an array of numbers") from None


def _contacts(points: ArrayLike, normals: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    where, directions = _numbers("points", points), _numbers("normals", normals)
    for name, array in (("points", where), ("normals", directions)):
        if array.ndim != 2 or array.shape[1] != 2:
            raise ValueError(f"{name}: must have shape (contacts, 2), not {array.shape}")
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{name}: must be finite")
    if len(where) != len(directions):
        raise ValueError(f"normals: {len(directions)} for {len(where)} points")
    lengths = np.hypot(directions[:, 0], directions[:, 1])
    if not np.all(lengths > 0.0):
        raise ValueError("normals: each must have a length")
    return where, directions / lengths[:, None]


def _closure(points: NDArray[np.float64], forces: NDArray[np.float64], of: NDArray[np.int64]) -> Closure:
    """Closure by the wrenches of `forces` (m, 2) at the points numbered `of` (m,)."""
    centre = points.mean(axis=0) if len(points) else np.zeros(2)
    arms = (points - centre)[of]
    length = float(np.hypot(arms[:, 0], arms[:, 1]).max(initial=0.0)) or 1.0
    moments = (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]) / length
    wrenches = np.vstack([forces.T, moments])
    balanced, margin = _cancelling(wrenches)
    if margin > _SMALL and np.linalg.matrix_rank(wrenches, _SMALL) == 3:
        closure = Closure(True, wrenches, balanced, margin, centre, length)
        if check(closure):
            return closure
    return Closure(False, wrenches, _free_twist(wrenches), 0.0, centre, length)


def _cancelling(wrenches: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Forces of at most 1 that cancel and whose least is greatest, and the least force."""
    from scipy.optimize import linprog

    m = wrenches.shape[1]
    if m == 0:
        return np.zeros(0), 0.0
    cost = np.concatenate([np.zeros(m), [-1.0]])
    above = np.hstack([-np.eye(m), np.ones((m, 1))])
    found = linprog(
        cost,
        above,
        np.zeros(m),
        np.hstack([wrenches, np.zeros((3, 1))]),
        np.zeros(3),
        bounds=[(0.0, 1.0)] * (m + 1),
    )
    forces = np.asarray(found.x[:m])
    forces -= np.linalg.pinv(wrenches) @ (wrenches @ forces)
    return forces, float(forces.min() / forces.max()) if forces.max() > 0.0 else 0.0


def _free_twist(wrenches: NDArray[np.float64]) -> NDArray[np.float64]:
    """The twist of components up to 1 that does most work on the wrenches without any against one.

    Where none does any work, one that is orthogonal to all of them.
    """
    from scipy.optimize import linprog

    if wrenches.shape[1] == 0:
        return np.array([1.0, 0.0, 0.0])
    found = linprog(-wrenches.sum(axis=1), -wrenches.T, np.zeros(wrenches.shape[1]), bounds=[(-1.0, 1.0)] * 3)
    twist = np.asarray(found.x)
    if float(twist @ wrenches.sum(axis=1)) > _SMALL:
        return twist
    return np.asarray(np.linalg.svd(wrenches.T)[2][-1])
