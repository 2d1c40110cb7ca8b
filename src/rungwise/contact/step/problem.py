"""One step's contact problem, whatever model it came from.

    (1) balance     H v - W^T lambda - S^T tau = c                    (rows of W and S are rates)
    (2) Signorini   0 <= lambda_n  _|_  (W v + R lambda + w)_n >= 0
    (3) friction    lambda_t in argmin over |lambda_t| <= mu lambda_n of s . lambda_t,
                    s = (W v + R lambda + w)_t                        (maximum dissipation, exact cone)
    (4) joints      S v + R_s tau + w_s = 0                           (rows with infinite F)
    (5) drives      tau in argmin over |tau| <= F of tau (S v + R_s tau + w_s)

The code bears these numbers where it writes a line of them.

The number of directions d per contact (normal first) is the problem's: 2 in the plane, 3 in space.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step.spans import NO_SPANS, NO_STRETCHES, Widths, whole_matrix, whole_rows
from rungwise.kernel import Ints, Reals


class ContactProblem(Block):
    """Arrays of one problem: n velocities, k contacts of d directions, b force-limited rows.

    H (n, n) symmetric positive definite; c (n,); W (k d, n); R (k, d, d); w (k d,); mu (k,);
    S (b, n); R_s (b,); w_s (b,); F (b,). Units: H is force per velocity, lambda and tau are forces.
    quantum (1,): the velocity that rounding of positions amounts to over the step; smaller ones are noise.
    Of many velocities H and W keep their entries alone, in spans that are told beside (see `step.spans`).
    """

    H: NDArray[np.float64]
    c: NDArray[np.float64]
    W: NDArray[np.float64]
    R: NDArray[np.float64]
    w: NDArray[np.float64]
    mu: NDArray[np.float64]
    S: NDArray[np.float64]
    R_s: NDArray[np.float64]
    w_s: NDArray[np.float64]
    F: NDArray[np.float64]
    quantum: NDArray[np.float64]


class Sizes(NamedTuple):
    """Rows of a problem that are in use: of n velocities, of contacts and of limited rows."""

    n: int
    contacts: int
    limited: int


EXACT_ROW, EXACT_COS, EXACT_SIN, EXACT_BEGIN = 0, 1, 2, 3
"""Columns of `Surfaces.exact`."""


class Surfaces(NamedTuple):
    """Which limited rows share a force: number (limited,), the same for rows that share, negative for a row
    that does not; empty if none does. They share a ball, or the limit surface of a pressure (see
    `contact.kinds.pressure`), of which there are m: exact (m, 4), its first row (-1: none), cosine and sine
    of the body's angle, and where its own numbers begin in `pressures`."""

    number: Ints
    exact: Reals
    pressures: Reals


NO_SURFACES = Surfaces(np.empty(0, np.int64), np.empty((0, 4)), np.empty(0))
"""No rows share a force."""


class Unknowns(NamedTuple):
    """An answer to a problem of such sizes, and before it is found the guess to start from: mode (contacts +
    limited,), v (n,), force (contacts d,) and tau (limited,)."""

    mode: Ints
    v: Reals
    force: Reals
    tau: Reals


class Elimination(NamedTuple):
    """Room for linear systems with one right-hand side: matrix (size, size + 1), and order (size,) of its
    pivots; how large, `matrix_size` says."""

    matrix: Reals
    order: Ints


SPARE = 5
"""Rows of the room for linear systems beside those of the largest system: three to judge in, and two for
where the guess began."""


def matrix_size(n: int, contacts: int, limited: int) -> int:
    """Side of the room that guesses of modes need, one more in columns."""
    return n + 2 * contacts + limited + SPARE


def allocate_problem(
    n: int, contacts: int, limited: int, directions: int = 2, widths: Widths | None = None
) -> ContactProblem:
    """Zeroed problem for at most so many rows; with `widths` what H and W have in these columns is kept (see
    `step.spans`)."""
    d, wide = directions, Widths(n, n) if widths is None else widths
    return ContactProblem(
        H=np.zeros((n, wide.matrices)),
        c=np.zeros(n),
        W=np.zeros((contacts * d, wide.rows)),
        R=np.zeros((contacts, d, d)),
        w=np.zeros(contacts * d),
        mu=np.zeros(contacts),
        S=np.zeros((limited, n)),
        R_s=np.zeros(limited),
        w_s=np.zeros(limited),
        F=np.zeros(limited),
        quantum=np.zeros(1),
    )


def trim(
    problem: ContactProblem,
    n: int,
    contacts: int,
    limited: int,
    spans: Ints = NO_SPANS,
    stretches: Ints = NO_STRETCHES,
) -> ContactProblem:
    """A dense copy of the rows in use, of a problem that keeps what W has in these spans, and H in these
    stretches."""
    p = problem
    d = p.R.shape[1]
    k = contacts * d
    return ContactProblem(
        H=whole_matrix(p.H[:n], stretches, n),
        c=p.c[:n].copy(),
        W=whole_rows(p.W[:k], spans, d, n),
        R=p.R[:contacts].copy(),
        w=p.w[:k].copy(),
        mu=p.mu[:contacts].copy(),
        S=p.S[:limited, :n].copy(),
        R_s=p.R_s[:limited].copy(),
        w_s=p.w_s[:limited].copy(),
        F=p.F[:limited].copy(),
        quantum=p.quantum.copy(),
    )


def keep_contacts(problem: ContactProblem, kept: NDArray[np.bool_]) -> ContactProblem:
    """A copy with the contacts `kept` (k,) alone."""
    p, rows = problem, np.repeat(kept, problem.R.shape[1])
    return ContactProblem(
        H=p.H.copy(),
        c=p.c.copy(),
        W=p.W[rows],
        R=p.R[kept],
        w=p.w[rows],
        mu=p.mu[kept],
        S=p.S.copy(),
        R_s=p.R_s.copy(),
        w_s=p.w_s.copy(),
        F=p.F.copy(),
        quantum=p.quantum.copy(),
    )
