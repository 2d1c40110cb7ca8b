"""Dry friction of a body along several coordinates, one force in an ellipsoid against the motion, where it is
left out: what may be proved without it.

    t in argmin over |t| <= 1 of t . u,   t_i = tau_i / F_i,   u_i = F_i s_i  (power)

for the rows i of one limit surface. Source: Goyal, Ruina, Papadopoulos, Wear 143 (1991) 307-330.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.step import EXACT_ROW, ContactProblem, trim
from rungwise.kernel import Ints, Reals
from rungwise.system.terms import APART, Terms, whole


def in_boxes(problem: ContactProblem, terms: Terms, forces: Reals) -> ContactProblem:
    """A trimmed problem in which each row of a surface has a force within an interval of its own: the box
    about the ball, along its force of those of all limited rows (b,), or about the limit surface of a
    pressure, along its rows. What has no solution so has none."""
    forces, pressed = forces[: len(problem.F)], terms.exact[:, EXACT_ROW]
    surface = terms.surface[: len(problem.F)]
    for each in np.unique(surface[surface != APART]):
        rows = np.flatnonzero(surface == each)
        if rows[0] in pressed:
            continue
        part, unit = forces[rows] / problem.F[rows], problem.F[rows[0]]
        along = (
            np.linalg.qr(np.column_stack([part, np.eye(len(rows))]))[0].T if part.any() else np.eye(len(rows))
        )
        turned = along * (problem.F[rows] / unit)
        problem.S[rows], problem.w_s[rows] = turned @ problem.S[rows], turned @ problem.w_s[rows]
        problem.F[rows] = unit
    return problem


def without_law(problem: ContactProblem, terms: Terms, free: Ints, inertia: float) -> ContactProblem:
    """A trimmed problem of a rung with this `inertia`, without surfaces: if it has no solution, the law has
    none.

    Where one surface alone resists, its force is -(S^T F^2 S) v / power: velocities are as with a damper, and
    forces a multiple. Elsewhere each row of a surface may have any force within its own limit; it yields, so
    that certificates read no more of it than this interval.
    """
    n = len(problem.c)
    rows = np.flatnonzero(terms.surface[: len(problem.F)] != APART)
    if len(rows) == 0:
        return problem
    S = terms.limited[rows][:, free[:n]]
    if inertia == 0.0 and len(terms.exact) == 0 and _resists_alone(problem, terms, rows, free[:n]):
        damper = (S.T * terms.limit[rows] ** 2) @ S
        problem.H[:] = damper * (np.trace(problem.H) / np.trace(damper))
        return trim(problem, n, len(problem.mu), 0)
    problem.S[rows] = S
    with np.errstate(all="ignore"):  # steps as short as numbers can be
        yields = (S**2 / np.diagonal(problem.H)).sum(1)
    problem.R_s[rows] = np.nan_to_num(yields)
    problem.F[rows], problem.w_s[rows] = terms.limit[rows], 0.0
    return problem


def _resists_alone(problem: ContactProblem, terms: Terms, rows: Ints, free: Ints) -> bool:
    """Whether rows of one surface hold all that moves, and nothing else yields, resists or pulls."""
    alone = len(rows) == len(problem.F) and len(set(terms.surface[rows])) == 1
    grid = np.ix_(free, free)
    still = not (
        whole(terms, terms.stiffness)[grid].any()
        or whole(terms, terms.damping)[grid].any()
        or problem.c.any()
    )
    carried = np.delete(terms.limited[rows], free, axis=1).any()
    holds = np.linalg.matrix_rank(terms.limited[rows][:, free]) == len(free)
    return bool(alone and still and not carried and holds and not problem.R.any())
