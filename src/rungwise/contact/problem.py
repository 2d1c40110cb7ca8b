"""Contact problems of any origin: one matrix, one offset, and a law for every unknown.

    y = A x + b,   x = (contacts, k d; others, m)

    contact i, normal first:  0 <= x_n  _|_  y_n >= 0,   x_t in argmin over |x_t| <= mu x_n of y_t . x_t
    other j:                  lower <= x <= upper, and y = 0 inside, y >= 0 at lower, y <= 0 at upper

Every problem has this form with some values fixed: an LCP has no contacts and limits (0, inf); a free unknown
(a velocity, the force of a joint) has limits (-inf, inf) and so y = 0; dry friction or a drive has limits
(-F, F). A need be neither symmetric nor regular, and may be sparse. Source of the law: Acary, Bremond, Huber,
in Advanced Topics in Nonsmooth Dynamics (2018), chapter 10; De Saxce and Feng, Math. Comput. Modelling 28
(1998) 225-245.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from rungwise.contact.step.problem import ContactProblem

Array: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = Any
"""A dense (n, n) array or a scipy sparse matrix of that shape."""

MOST_DIRECTIONS = 3
"""Directions of a contact: normal, and two tangents in space. Those of a step may also resist turning."""


class BeyondScale(ValueError):
    """The sizes of a problem are beyond the range of numbers."""


def _empty() -> Array:
    return np.zeros(0)


class Laws(NamedTuple):
    """The laws of k contacts, with friction mu (k,) and d directions each, and of m other unknowns, with
    limits lower, upper (m,)."""

    mu: Array
    d: int
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """A (N, N) dense or sparse; b (N,); mu (k,) friction; lower, upper (m,); N = k directions + m.

    `directions` is 3 in space, 2 in the plane, 1 without friction; `velocities` says how many of the m
    others, counted from the first, are velocities of a mixed form (for files and reports only).

    Raises
    ------
    ValueError
        naming the field: not a number, infinite, of the wrong shape, negative friction, limits that cross.
    """

    A: Matrix
    b: Array
    mu: Array = field(default_factory=_empty)
    directions: int = 3
    lower: Array = field(default_factory=_empty)
    upper: Array = field(default_factory=_empty)
    velocities: int = 0

    def __post_init__(self) -> None:
        _known(self.directions)
        for name in ("b", "mu", "lower", "upper"):
            object.__setattr__(self, name, vector(name, getattr(self, name), finite=name in ("b", "mu")))
        object.__setattr__(self, "A", matrix("A", self.A))
        self._lock()
        size = self.rows + len(self.lower)
        if len(self.b) != size:
            raise ValueError(
                f"b: has {len(self.b)} entries; {len(self.mu)} contacts of {self.directions} directions"
                f" and {len(self.lower)} other unknowns make {size}"
            )
        if self.A.shape != (size, size):
            raise ValueError(f"A: has shape {self.A.shape}; b makes it {(size, size)}")
        if len(self.mu) and self.mu.min() < 0.0:
            raise ValueError(f"mu: friction must not be negative, and entry {int(np.argmin(self.mu))} is")
        if len(self.upper) != len(self.lower):
            raise ValueError(f"upper: has {len(self.upper)} entries, and lower has {len(self.lower)}")
        if len(self.lower) and not (
            (self.lower <= self.upper).all() and self.lower.max() < np.inf and self.upper.min() > -np.inf
        ):
            raise ValueError("lower: must not exceed upper, nor either lie at the wrong infinity")
        if not isinstance(self.velocities, int | np.integer) or not 0 <= self.velocities <= len(self.lower):
            raise ValueError(f"velocities: must be 0 to {len(self.lower)}, not {self.velocities!r}")

    def __repr__(self) -> str:
        return (
            f"<Problem of {len(self.b)} unknowns, {len(self.mu)} contacts in {self.directions} directions"
            " among them>"
        )

    def _lock(self) -> None:
        """Lock the numbers, as own copies: systems prepared from a problem are kept."""
        for name in ("A", "b", "mu", "lower", "upper"):
            own = getattr(self, name).copy()
            for array in (own.data, own.indices, own.indptr) if sp.issparse(own) else (own,):
                array.flags.writeable = False
            object.__setattr__(self, name, own)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which of the others (m,) have no limits."""
        without: NDArray[np.bool_] = (self.lower == -np.inf) & (self.upper == np.inf)
        return without

    @property
    def laws(self) -> Laws:
        """Friction and bounds of the problem's groups and rows, as solvers take them."""
        return Laws(self.mu, self.directions, self.lower, self.upper)

    @property
    def demands(self) -> Array:
        """The demanded rates: b of contacts and of other unknowns, except velocities and fixed unknowns."""
        asked = self.lower < self.upper
        asked[: self.velocities] = False
        return np.asarray(self.b[np.concatenate([np.ones(self.rows, bool), asked])])

    @property
    def rows(self) -> int:
        """Contact rows k d; they come first."""
        return self.directions * len(self.mu)

    def equals(self, other: Problem) -> bool:
        """Whether all numbers of both are the same."""
        if (self.directions, self.velocities) != (other.directions, other.velocities):
            return False
        vectors = ("b", "mu", "lower", "upper")
        if not all(np.array_equal(getattr(self, name), getattr(other, name)) for name in vectors):
            return False
        return not abs(sp.csr_array(self.A) - sp.csr_array(other.A)).sum()

    @classmethod
    def local(cls, W: Matrix, q: ArrayLike, mu: ArrayLike, directions: int = 3) -> Problem:
        """u = W r + q: W (k d, k d) the Delassus matrix, symmetric or not, q (k d,), mu (k,)."""
        _known(directions)
        W, q, mu = matrix("W", W), vector("q", q), vector("mu", mu)
        sized("q", q, directions * len(mu))
        _shaped("W", W, (len(q), len(q)))
        return cls(W, q, mu, directions)

    @classmethod
    def balance(
        cls,
        H: Matrix,
        c: ArrayLike,
        W: Matrix,
        w: ArrayLike,
        mu: ArrayLike,
        *,
        directions: int = 3,
        R: Matrix | None = None,
        S: Matrix | None = None,
        w_s: ArrayLike = (),
        R_s: ArrayLike | None = None,
        F: ArrayLike | None = None,
    ) -> Problem:
        """H v = c + W^T r + S^T tau, u = W v + R r + w, limited rates S v + R_s tau + w_s, |tau| <= F.

        H (n, n) may be singular; c (n,); W (k d, n); w (k d,); R (k d, k d); S (b, n); w_s, R_s, F (b,), and
        an infinite F (the default) is a joint. Unknowns are x = (r, v, tau).
        """
        _known(directions)
        H, c, W, w, mu = matrix("H", H), vector("c", c), matrix("W", W), vector("w", w), vector("mu", mu)
        n, rows = len(c), directions * len(mu)
        tau_offset = vector("w_s", w_s)
        limited = len(tau_offset)
        yielding = vector("R_s", np.zeros(limited) if R_s is None else R_s)
        limit = vector("F", np.full(limited, np.inf) if F is None else F, finite=False)
        S = sp.csr_array((limited, n)) if S is None else matrix("S", S)
        R = sp.csr_array((rows, rows)) if R is None else matrix("R", R)
        for name, value, shape in (
            ("H", H, (n, n)), ("W", W, (rows, n)), ("R", R, (rows, rows)), ("S", S, (limited, n)),
        ):  # fmt: skip
            _shaped(name, value, shape)
        for name, value, size in (("w", w, rows), ("R_s", yielding, limited), ("F", limit, limited)):
            sized(name, value, size)
        if (limit < 0.0).any():
            raise ValueError("F: a limit must not be negative")
        parts = [
            [sp.csr_array(R), W, None],
            [-W.T, sp.csr_array(H), -S.T],
            [None, S, sp.diags_array(yielding)],
        ]
        A = sp.block_array(parts if limited else [row[:2] for row in parts[:2]], format="csr")
        free = np.full(n, np.inf)
        return cls(
            A if sp.issparse(H) or sp.issparse(W) else A.toarray(),
            np.concatenate([w, -c, tau_offset]),
            mu,
            directions,
            np.concatenate([-free, -limit]),
            np.concatenate([free, limit]),
            n,
        )

    @classmethod
    def of(cls, problem: Problem | ContactProblem) -> Problem:
        """The problem itself, or the problem of a step; ValueError for anything else."""
        if isinstance(problem, ContactProblem):
            return cls.of_step(problem)
        if not isinstance(problem, Problem):
            raise ValueError(f"problem: must be a Problem or a ContactProblem, not {type(problem).__name__}")
        return problem

    @classmethod
    def of_step(cls, step: ContactProblem) -> Problem:
        """The problem of a step, as assembled by a model; unknowns are x = (lambda, v, tau)."""
        p = step
        for name in ContactProblem.__annotations__:
            given = getattr(p, name)
            if given.dtype != np.float64 or given.ndim == 0:
                raise ValueError(
                    f"{name}: must be an array of float64, not {given.dtype} of shape {given.shape}"
                )
        quantum = vector("quantum", p.quantum)
        if quantum.shape != (1,) or quantum[0] < 0.0:
            raise ValueError("quantum: must be one number that is not negative")
        k, d = len(p.mu), p.R.shape[-1] if p.R.ndim else 0
        if p.R.shape != (k, d, d):
            raise ValueError(f"R: has shape {p.R.shape}; mu makes it {(k, d, d)}")
        R = sp.block_diag(list(map(sp.coo_array, p.R)), format="csr") if len(p.R) else None
        return cls.balance(p.H, p.c, p.W, p.w, p.mu, directions=d, R=R, S=p.S, w_s=p.w_s, R_s=p.R_s, F=p.F)

    @classmethod
    def lcp(cls, M: Matrix, q: ArrayLike) -> Problem:
        """0 <= z  _|_  M z + q >= 0; M (n, n), q (n,)."""
        q = vector("q", q)
        return cls.boxes(M, q, np.zeros(len(q)), np.full(len(q), np.inf))

    @classmethod
    def mlcp(cls, M: Matrix, q: ArrayLike, complementary: ArrayLike) -> Problem:
        """Rows where `complementary` (n,) holds as in `lcp`; the others M z + q = 0 with z free."""
        q, given = vector("q", q), vector("complementary", complementary)
        sized("complementary", given, len(q))
        if not np.isin(given, (0.0, 1.0)).all():
            raise ValueError("complementary: must be true or false for each row")
        law = given == 1.0
        return cls.boxes(M, q, np.where(law, 0.0, -np.inf), np.full(len(q), np.inf))

    @classmethod
    def boxes(cls, M: Matrix, q: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> Problem:
        """lower <= z <= upper with M z + q normal to the box: relays, dry friction, bounded drives."""
        M, q = matrix("M", M), vector("q", q)
        _shaped("M", M, (len(q), len(q)))
        lower, upper = vector("lower", lower, finite=False), vector("upper", upper, finite=False)
        sized("lower", lower, len(q))
        return cls(M, q, np.zeros(0), 3, lower, upper)


def vector(name: str, value: ArrayLike, finite: bool = True) -> Array:
    """`value` (n,) as contiguous floats; ValueError naming the field when it is no vector."""
    array = numbers(name, value)
    if array.ndim != 1:
        raise ValueError(f"{name}: must have one dimension, not {np.ndim(value)}")
    known = np.isfinite(array) if finite else ~np.isnan(array)
    if not known.all():
        raise ValueError(f"{name}: entry {int(np.argmin(known))} is not a finite number")
    return array


def numbers(name: str, value: object) -> Array:
    """`value`, of one dimension or more, as contiguous floats; ValueError naming the field where a part would
    be lost: complex or masked entries, text, dates."""
    if np.ma.is_masked(value):
        raise ValueError(f"{name}: has masked entries, which have no value")
    try:
        array = np.ascontiguousarray(value)
        if array.dtype.kind not in "biufO":
            raise TypeError
        return array.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: must be numbers") from None
    except OverflowError:
        raise ValueError(f"{name}: has entries beyond double precision") from None


def matrix(name: str, value: Matrix) -> Matrix:
    """`value` (m, n) as contiguous floats, canonical CSR if sparse; ValueError naming the field otherwise."""
    if sp.issparse(value):
        made = _rows(name, value)
        entries = made.data
    else:
        made = entries = numbers(name, value)
    if made.ndim != 2:
        raise ValueError(f"{name}: must have two dimensions, not {np.ndim(value)}")
    if not np.isfinite(entries).all():
        raise ValueError(f"{name}: has entries that are not finite numbers")
    return made


def _rows(name: str, value: Any) -> sp.csr_array:
    """Rows of a sparse matrix, whose indices are checked: code that reads the rows does not check them."""
    try:
        if value.format in ("csr", "csc", "bsr"):
            value.check_format(full_check=True)
        made = sp.csr_array(value)
    except ValueError as error:
        raise ValueError(f"{name}: is no sparse matrix ({error})") from None
    made = made.astype(numbers(name, made.data).dtype)
    if not made.has_canonical_format:
        made.sum_duplicates()
    return made


def _known(directions: int) -> None:
    whole = isinstance(directions, int | np.integer) and not isinstance(directions, bool)
    if not whole or not 1 <= directions <= MOST_DIRECTIONS:
        raise ValueError(f"directions: must be 1, 2 or 3, not {directions!r}")


def _shaped(name: str, value: Matrix, shape: tuple[int, int]) -> None:
    if value.shape != shape:
        raise ValueError(f"{name}: has shape {value.shape}; the other fields make it {shape}")


def sized(name: str, value: NDArray[Any], size: int) -> None:
    if value.shape != (size,):
        raise ValueError(f"{name}: has {len(value)} entries; the other fields make it {size}")
