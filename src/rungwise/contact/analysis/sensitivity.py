"""Derivatives of a solved step with respect to its data, by the implicit function theorem on its pieces.

With the active `pieces` the change of a solution solves, for a change of the data,

    H dv - P^T df = dc - dH v + dP^T f                  P = (W, S),  f = (lambda, tau)
    df = B x + limits dlimit,   du = P dv + R df + dP v + dR f + dw,   laws of x in C^T du + D x

which is linear where no contact is weakly active, and one small contact problem per direction where some
contact is: then the derivative is one-sided. Where it is linear it is one more right-hand side of a Newton
step of the contact solver. Its factors do not serve, though: they eliminate forces, which rigid contacts that
hold allow with the proximal term alone, and they do not tell which forces are determined. Sources: Robinson,
Math. Oper. Res. 5 (1980) 43-62; Pang, Math. Oper. Res. 15 (1990) 311-341 (B-derivatives of complementarity
problems).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from rungwise.contact.analysis.active import pieces
from rungwise.contact.problem import MOST_DIRECTIONS, Array, Problem, numbers
from rungwise.contact.solution import ContactSolution, Status
from rungwise.contact.solve import solve
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords

DATA = ("H", "c", "W", "R", "w", "mu", "S", "R_s", "w_s", "F")
ACTIVE = 1e-7
"""Values below this part of the scale of their kind count as zero. Chosen by trial, to a decade, above the
residual 1e-8 that a solved step may have."""
_SINGULAR, _SHARE, _AGREES, _NOISE = 1e-11, 1e-7, 1e-6, 1e-8
"""Zero for singular values, over the greatest; for entries of null vectors; for remainders, over the norm of
the right-hand side; for rounding of changes, over their terms. Chosen by trial, to a decade."""
_ROUNDS, _ROUNDING = 30, 1e-12
"""Rounds that equilibrate the matrix; closing rate, over its terms, that counts as zero: about ten thousand
roundings of double precision. Both chosen by trial, the rate to a decade."""

_CLEAR = 100.0
"""An estimate of the reciprocal condition leaves no doubt from so many times the least that singular values
of a matrix of this size allow: it may be ten times too large."""


class Change(NamedTuple):
    """Directional derivatives, a column each: v (n, m), force (k d, m), tau (b, m). NaN where the solution is
    not determined, and in all of a column where no solution nearby keeps redundant contacts as they are."""

    v: Array
    force: Array
    tau: Array


class RightHandSide(NamedTuple):
    """Right-hand sides of the linearised laws along m directions: `laws` (n + unknowns, m), the changes of
    forces that limits cause themselves, `force` (k d + b, m), and the sizes of the terms of `laws`."""

    laws: Array
    force: Array
    size: Array

    def along(self, by: Array) -> RightHandSide:
        """The right-hand sides along combinations `by` (m, p) of the directions."""
        return RightHandSide(self.laws @ by, self.force @ by, self.size @ np.abs(by))


class Sensitivity:
    """The linearised step.

    `weak` and `weak_rows` index the contacts and limited rows that are weakly active: at rest without force,
    or at the limit of friction without slip. Where there are some, derivatives are one-sided: the derivative
    along -d is not the negative of the one along d. `forces_determined` is False where redundant contacts
    share the load in more than one way, `velocities_determined` where even the motion is not determined.

    Args:
        problem: the step.
        v, force, tau: its solution (n,), (k d,), (b,).
        active: size below which a value counts as zero, relative to the scale of forces, or of a row's rates.

    Raises:
        ValueError: naming the array that has the wrong size or is not finite.
    """

    def __init__(
        self, problem: ContactProblem, v: ArrayLike, force: ArrayLike, tau: ArrayLike, active: float = ACTIVE
    ) -> None:
        p = self.problem = problem
        if not isinstance(active, int | float | np.number) or not 0.0 <= active < 1.0:
            raise ValueError(f"active: must be from 0 to 1, not {active!r}")
        self.v, lam, t = (numbers(*given) for given in (("v", v), ("force", force), ("tau", tau)))
        for name, value, like in (("v", self.v, p.c), ("force", lam, p.w), ("tau", t, p.w_s)):
            if value.shape != like.shape:
                raise ValueError(f"{name}: has shape {value.shape}; the problem makes it {like.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: must be finite")
        self.force = np.concatenate([lam, t])
        self._pieces = q = pieces(p, self.v, lam, t, active)
        n, k, d = len(p.c), len(p.mu), p.R.shape[1]
        self.weak = tuple(int(i) for i in np.flatnonzero(q.weak[:k]))
        self.weak_rows = tuple(int(i) for i in np.flatnonzero(q.weak[k:]))
        self._rows = np.vstack([p.W, p.S])
        self._yield = np.zeros((len(self.force),) * 2)
        for i in range(k):
            self._yield[i * d : i * d + d, i * d : i * d + d] = p.R[i]
        self._yield[k * d :, k * d :] = np.diag(p.R_s)
        own = q.C.T @ self._yield @ q.B + np.diag(q.D)
        self._matrix = np.block([[p.H, -self._rows.T @ q.B], [q.C.T @ self._rows, own]])
        self._unit, self._regular = _units(self._matrix), False
        self._whole, null = self._inverse(np.arange(len(self._unit)))
        self._regular = null.shape[1] == 0
        share = self._unit[n:, None] * null[n:]
        self._loose_v = np.abs(null[:n]).max(axis=1, initial=0.0) > _SHARE
        size = np.abs(share).max(initial=0.0)
        self._loose_f = np.abs(q.B @ share).max(axis=1, initial=0.0) > _SHARE * size
        self.forces_determined = not self._loose_f.any()
        self.velocities_determined = not self._loose_v.any()

    def forward(
        self, sizes: dict[str, Array] | None = None, *, limit: float | None = None, **data: ArrayLike
    ) -> Change:
        """Derivatives along changes of `data` (names of the problem's fields), of a field's shape or with one
        more axis, last, for many directions at once.

        `sizes`, of the same shapes, are the sizes of the terms that the changes are sums of, where the
        changes come from differences: redundant contacts agree where they differ by rounding of these sizes.

        Raises ValueError for an unknown name or a wrong shape, and for a change of a friction or limit of
        zero where nothing slips, which has no derivative; LimitError where `limit` seconds are over before
        all directions are done, which are contact problems of their own where contacts are weakly active.
        """
        return self.solved(self.right_hand_side(data, sizes), limit=limit)

    def right_hand_side(
        self, data: Mapping[str, ArrayLike], sizes: Mapping[str, ArrayLike] | None = None
    ) -> RightHandSide:
        """The right-hand side of the linearised laws along changes of `data`; it is linear in them.

        The arguments `data` and `sizes`, and ValueErrors, are those of `forward`. Where there are many
        directions, combine the right-hand sides of few changes: changes of H and W take n (n + k d) numbers
        a direction.
        """
        change = self._columns(data)
        limit = np.vstack([change["mu"], change["F"]])
        if self._pieces.undefined.any() and limit[self._pieces.undefined].any():
            k = len(self.problem.mu)
            at = int(np.flatnonzero(self._pieces.undefined & limit.any(axis=1))[0])
            name, at = ("mu", at) if at < k else ("F", at - k)
            raise ValueError(f"{name}: entry {at} is zero where nothing slips, and has no derivative")
        laws = self._right(change)
        size = np.zeros(laws.shape) if sizes is None else self._right(self._columns(sizes), sizes=True)
        return RightHandSide(laws, self._pieces.limits @ limit, size)

    def solved(self, right: RightHandSide, *, limit: float | None = None) -> Change:
        """Derivatives along the directions of the right-hand side `right`. Raises LimitError if they take
        more than `limit` seconds."""
        deadline = Deadline(seconds(limit))
        with deadline.needed_for("all directions were differentiated"):
            deadline.look()
            noise = _NOISE * right.size
            laws = self._agreeing(right.laws, noise) if noise.any() else right.laws
            deadline.look()
            z = self._one_sided(laws, noise, deadline) if self._pieces.weak.any() else self._linear(laws)
        n, rows = len(self.problem.c), len(self.problem.w)
        v, f = z[:n].copy(), self._pieces.B @ z[n:] + right.force
        v[self._loose_v], f[self._loose_f] = np.nan, np.nan
        return Change(v, f[:rows], f[rows:])

    def _right(self, change: dict[str, Array], sizes: bool = False) -> Array:
        """Right-hand side of the linearised laws, or the sizes of its terms."""
        p, q, side = self.problem, self._pieces, 1.0 if sizes else -1.0
        parts = (self.v, self.force, self._rows, self._yield, q.C, q.limits)
        v, f, rows, own, C, limits = (np.abs(part) for part in parts) if sizes else parts
        lam, tau, d = f[: len(p.w)], f[len(p.w) :], p.R.shape[1]
        balance = change["c"] + side * np.einsum("ijm,j->im", change["H"], v)
        balance += np.einsum("rim,r->im", change["W"], lam) + np.einsum("rim,r->im", change["S"], tau)
        soft = np.einsum("kijm,kj->kim", change["R"], lam.reshape(-1, d))
        soft = soft.reshape(len(lam), change["c"].shape[1])
        rate = np.vstack(
            [
                change["w"] + np.einsum("rim,i->rm", change["W"], v) + soft,
                change["w_s"] + np.einsum("rim,i->rm", change["S"], v) + change["R_s"] * tau[:, None],
            ]
        )
        direct = limits @ np.vstack([change["mu"], change["F"]])
        return np.vstack([balance + rows.T @ direct, side * (C.T @ (own @ direct + rate))])

    def _agreeing(self, right: Array, noise: Array) -> Array:
        """`right` less the disagreement of redundant equations, where that is no more than noise."""
        keep = np.concatenate([np.ones(len(self.v), bool), self._pieces.free])
        if self._regular:
            return right  # no equation follows from others
        unit = self._unit[keep, None]
        left, size, _ = np.linalg.svd(self._matrix[keep] * unit * self._unit)
        spare = left[:, int(np.sum(size > _SINGULAR * size.max(initial=0.0))) :]
        apart = spare.T @ (unit * right[keep])
        apart[np.abs(apart) > np.abs(spare.T) @ (unit * noise[keep])] = 0.0
        right = right.copy()
        right[keep] -= spare @ apart / unit
        return right

    def gradient(
        self,
        v: ArrayLike | None = None,
        force: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        *,
        released: bool = False,
    ) -> dict[str, Array]:
        """Gradient of a scalar with respect to all data, from its gradient with respect to the solution.

        Args:
            v, force, tau: derivatives of the scalar by the velocities, the contact forces, and the forces of
                limited rates; 0 if not given.
            released: whether to take one piece where contacts are weakly active.


        The entries of H are taken as independent. NaN at a friction or limit of zero where nothing slips.
        With weakly active contacts there is no gradient, only that of one piece: `released` takes the piece
        on which contacts at rest without force stay without force, and contacts at the limit of friction
        slip.

        Raises ValueError where there is no gradient, or the scalar depends on forces that are not determined.
        """
        p, q, n = self.problem, self._pieces, len(self.problem.c)
        if q.weak.any() and not released:
            raise ValueError(
                f"no gradient: weakly active are contacts {list(self.weak)}, rows {list(self.weak_rows)};"
                " ask for one-sided derivatives, or with `released` for one piece"
            )
        given = []
        for name, value, like in (("v", v, p.c), ("force", force, p.w), ("tau", tau, p.w_s)):
            given.append(np.zeros(len(like)) if value is None else numbers(name, value))
            if given[-1].shape != like.shape:
                raise ValueError(f"{name}: has shape {given[-1].shape}; the problem makes it {like.shape}")
            if not np.isfinite(given[-1]).all():
                raise ValueError(f"{name}: must be finite")
        on_v, on_f = given[0], np.concatenate(given[1:])
        keep = np.concatenate([np.arange(n), n + np.flatnonzero(q.free)])
        inverse, null = self._inverse(keep)
        right = np.concatenate([on_v, q.B.T @ on_f])[keep] * self._unit[keep]
        if np.abs(null.T @ right).max(initial=0.0) > _AGREES * np.linalg.norm(right):
            raise ValueError("gradient: depends on forces or velocities that are not determined")
        y = np.zeros(len(self._unit))
        y[keep] = self._unit[keep] * (inverse.T @ right)
        a, b = y[:n], q.C @ y[n:]
        k, d, rows = len(p.mu), p.R.shape[1], len(p.w)
        limit = q.limits.T @ (self._rows @ a - self._yield.T @ b + on_f)
        limit[q.undefined] = np.nan
        lam, t = self.force[:rows], self.force[rows:]
        return {
            "H": -np.outer(a, self.v),
            "c": a,
            "W": np.outer(lam, a) - np.outer(b[:rows], self.v),
            "R": -np.einsum("ki,kj->kij", b[:rows].reshape(-1, d), lam.reshape(-1, d)),
            "w": -b[:rows],
            "mu": limit[:k],
            "S": np.outer(t, a) - np.outer(b[rows:], self.v),
            "R_s": -b[rows:] * t,
            "w_s": -b[rows:],
            "F": limit[k:],
        }

    def _columns(self, data: Mapping[str, ArrayLike]) -> dict[str, Array]:
        """The change of every field, with the directions as last axis."""
        for name in data:
            if name not in DATA:
                raise ValueError(f"{name}: is none of {', '.join(DATA)}")
        given = {name: numbers(name, value) for name, value in data.items()}
        for name, value in given.items():
            shape = getattr(self.problem, name).shape
            if value.shape == shape:
                given[name] = value[..., None]
            elif value.shape[:-1] != shape:
                raise ValueError(f"{name}: has shape {value.shape}; the problem makes it {shape} or (*, m)")
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: must be finite")
        count = max((value.shape[-1] for value in given.values()), default=1)
        columns = {}
        for name in DATA:
            like = getattr(self.problem, name)
            value = given.get(name, np.zeros((*like.shape, 1)))
            if value.shape[-1] not in (1, count):
                raise ValueError(f"{name}: has {value.shape[-1]} directions; others have {count}")
            columns[name] = np.broadcast_to(value, (*like.shape, count))
        return columns

    def _inverse(self, keep: NDArray[np.int64]) -> tuple[Array, Array]:
        """Pseudo-inverse and null space, as columns, of the kept part of the matrix in its own units."""
        if len(keep) == len(self._unit) and self._regular:
            return self._whole, np.zeros((len(keep), 0))
        unit = self._unit[keep]
        scaled = self._matrix[np.ix_(keep, keep)] * unit[:, None] * unit
        inverse = _clear_inverse(scaled)
        if inverse is not None:
            return inverse, np.zeros((len(keep), 0))
        left, size, right = np.linalg.svd(scaled)
        rank = int(np.sum(size > _SINGULAR * size.max(initial=0.0)))
        return (right[:rank].T / size[:rank]) @ left[:, :rank].T, right[rank:].T

    def _linear(self, right: Array) -> Array:
        unit = self._unit[:, None]
        z: Array = unit * (self._whole @ (unit * right))
        z += unit * (self._whole @ (unit * (right - self._matrix @ z)))
        left_over = np.linalg.norm(unit * (right - self._matrix @ z), axis=0)
        z[:, left_over > _AGREES * np.linalg.norm(unit * right, axis=0)] = np.nan
        return z

    def _released(self, right: Array, noise: Array) -> Array:
        """Solutions in which one-sided unknowns do not act; NaN in columns where they must, noise aside."""
        q, n = self._pieces, len(self.problem.c)
        keep = np.concatenate([np.arange(n), n + np.flatnonzero(q.free)])
        rows = n + np.setdiff1d(np.flatnonzero(~q.free), [i for _, own in q.cones for i in own[1:]])
        inverse, _ = self._inverse(keep)
        z, unit = np.zeros(right.shape), self._unit[keep, None]
        z[keep] = unit * (inverse @ (unit * right[keep]))
        z[keep] += unit * (inverse @ (unit * (right - self._matrix @ z)[keep]))
        left_over = np.linalg.norm(unit * (right - self._matrix @ z)[keep], axis=0)
        agrees = left_over <= _AGREES * np.linalg.norm(unit * right[keep], axis=0)
        rates = np.abs(self._matrix[rows])
        rounded = _ROUNDING * (rates @ np.abs(z) + np.abs(right[rows])) + noise[rows]
        rounded += rates[:, keep] @ (unit * (np.abs(inverse) @ (unit * noise[keep])))
        opens = (self._matrix[rows] @ z - right[rows] >= -rounded).all(axis=0)
        z[:, ~(agrees & opens)] = np.nan
        return z

    def _one_sided(self, right: Array, noise: Array, deadline: Deadline) -> Array:
        """Solutions of one contact problem per direction, NaN where contacts that may begin to act resist
        turning: `solve` knows no such contacts. Raises TimeOver."""
        q, n = self._pieces, len(self.problem.c)
        cones = [n + columns for _, columns in q.cones]
        first = np.concatenate(cones) if cones else np.zeros(0, np.int64)
        others = np.setdiff1d(np.arange(len(self._unit)), first)
        order = np.concatenate([first, others])
        free = np.concatenate([np.ones(n, bool), q.free])[others]
        z, d = self._released(right, noise), self.problem.R.shape[1] if cones else 1
        for j, column in enumerate(right.T if d <= MOST_DIRECTIONS else ()):
            if not np.isnan(z[:, j]).any():
                continue
            deadline.look()
            found = solve(
                Problem(
                    self._matrix[np.ix_(order, order)],
                    -column[order],
                    self.problem.mu[[i for i, _ in q.cones]],
                    d,
                    np.where(free, -np.inf, 0.0),
                    np.full(len(others), np.inf),
                ),
                limit=deadline.seconds,
            )
            if found.unfinished:
                deadline.look()
            if found.status == Status.SOLVED:
                z[order, j] = found.x
        return z


def _clear_inverse(matrix: Array) -> Array | None:
    """The inverse, by elimination, where an estimate of the condition leaves no doubt that no singular value
    is zero (Higham, ACM Trans. Math. Softw. 14 (1988) 381-396); else None."""
    if not len(matrix):
        return None
    factors, _, _ = lapack.dgetrf(matrix)
    reciprocal, _ = lapack.dgecon(factors, np.abs(matrix).sum(axis=0).max())
    if not reciprocal > _CLEAR * len(matrix) * _SINGULAR:
        return None
    return np.asarray(np.linalg.inv(matrix), np.float64)


def _units(matrix: Array) -> Array:
    """Units of the unknowns in which the largest entry of every row is about one (Ruiz, RAL-TR-2001-034): a
    matrix that is singular in these units is singular for all masses and stiffnesses."""
    unit, size = np.ones(len(matrix)), np.abs(matrix)
    for _ in range(_ROUNDS):
        largest = (size * unit[:, None] * unit).max(axis=1, initial=0.0)
        unit /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return unit


@keywords
def sensitivity(problem: ContactProblem, solution: ContactSolution, active: float = ACTIVE) -> Sensitivity:
    """Sensitivity at the answer (`solution`) of `solve(problem)`; `active`: relative size below which forces
    and rates of a contact count as zero. Raises ValueError unless the answer is
    solved, and belongs to `problem`."""
    if not isinstance(problem, ContactProblem) or not isinstance(solution, ContactSolution):
        raise ValueError("problem, solution: must be a ContactProblem and what `solve` gives for it")
    if solution.status != Status.SOLVED:
        raise ValueError(f"solution: is {solution.status}, and has no derivative")
    if not solution.problem.equals(Problem.of_step(problem)):
        raise ValueError("solution: is that of another problem")
    return Sensitivity(problem, solution.v, solution.r, solution.z, active)
