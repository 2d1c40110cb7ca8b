"""Certificates that a problem has no solution, and the checker, which knows no solver.

* kinematic: normal forces lambda >= 0 (and forces of joints) that balance on every coordinate while the rates
  that the contacts demand are impossible: W^T lambda = 0 and w . lambda < 0. This kind concerns speeds alone,
  neither loads nor momentum.
* frictional: for every contact mode multipliers of the rates and of the balance that contradict each other
  (see `farkas`). A mode that leaves contacts undecided has fewer rows, and its multipliers serve all its
  completions. Rows that yield have no part in it.
* unsupported: a motion d along which the loads do work that contacts, friction and drives cannot resist:
  c . d > F |S d|, (W_n +- mu W_t) d >= 0 and H_0 d = 0; joints do not move at all.
* unbalanced: as frictional, of the problem with H_0 in the place of H, where rows that yield count with their
  rates: no motion, however fast, balances the loads without inertia. So a part slips out of a grip whose
  drive limits its force.

Each certificate is a combination of the problem's equations and inequalities that reads 0 >= gain > 0. In
floating point a remainder `left` multiplies the unknowns, and the proof says that no solution x has |x|_1 <=
gain / left. A certificate counts when that bound is `REACH` times larger than the motion that the loads alone
would cause, all in the problem's natural units (a kinematic certificate: than the motion that changes gaps as
fast as they must change); rounding in the check itself is charged against it. Near a singular position, where
a pushed body would have to be far faster than the body that pushes it, `left` is not rounding, and only the
bound holds. The bound of certificates of modes is that of `farkas`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from rungwise.contact.step.modes import natural_units, yielding
from rungwise.contact.step.problem import ContactProblem, trim

if TYPE_CHECKING:
    from rungwise.contact.problem import Problem

REACH = 1e3
"""Size of motions that a certificate must exclude, over the size of the motion that loads alone would cause.
Chosen by trial, to a decade."""
_ROUNDING = 2.0**-52
"""Rounding of a sum, over the sum of its terms' sizes, per term: two roundings of double precision."""


@dataclass(frozen=True)
class Certificate:
    """Why there is no solution. `vectors` has one row (kinematic, unsupported) or one row for each of `modes`
    (frictional, unbalanced), which together cover all."""

    kind: str
    vectors: tuple[NDArray[np.float64], ...]
    modes: tuple[tuple[int, ...], ...] = ()


class Balance(NamedTuple):
    """A balance of loads without inertia: modes (contacts, then limited rows), and forces (k d,) and (b,)."""

    modes: NDArray[np.int64]
    force: NDArray[np.float64]
    tau: NDArray[np.float64]


def check(
    problem: ContactProblem, certificate: Certificate, resisting: NDArray[np.float64] | None = None
) -> bool:
    """Whether the certificate proves that the problem has no solution (unsupported, unbalanced: no balance
    without inertia).

    `resisting` is H_0 (n, n), the part of H that is not inertia, for unsupported and unbalanced; zero if not
    given. "Proves" means up to the bound that the module states.
    """
    if not certificate.vectors or not all(np.isfinite(vector).all() for vector in certificate.vectors):
        return False
    rest = np.zeros_like(problem.H) if resisting is None else resisting
    match certificate.kind:
        case "kinematic":
            return _check_kinematic(problem, certificate.vectors[0])
        case "frictional":
            return _check_modes(problem, certificate, held=True)
        case "unsupported":
            return _check_unsupported(problem, certificate.vectors[0], rest)
        case "unbalanced":
            return _check_modes(without_inertia(problem, rest), certificate, held=False)
    return False


def without_inertia(problem: ContactProblem, resisting: NDArray[np.float64]) -> ContactProblem:
    """The problem with H_0 (n, n) in the place of H."""
    limit = trim(problem, len(problem.c), len(problem.mu), len(problem.F))
    limit.H[...] = resisting
    return limit


def rigid_rows(problem: ContactProblem) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Rows and offsets of constraints that cannot yield: rigid contacts' normals, then joints; and how many
    contacts."""
    d = problem.R.shape[1]
    soft, soft_rows = yielding(problem)
    rigid, joints = ~soft, np.isinf(problem.F) & ~soft_rows
    rows = np.vstack([problem.W[::d][rigid], problem.S[joints]])
    offset = np.concatenate([problem.w[::d][rigid], problem.w_s[joints]])
    return rows, offset, int(rigid.sum())


def demanded(offset: NDArray[np.float64], contacts: int) -> float:
    """The fastest rate that some row demands, of a gap that would close or of a joint; 1 when none does."""
    greatest = max((-offset[:contacts]).max(initial=0.0), np.abs(offset[contacts:]).max(initial=0.0))
    return float(greatest) or 1.0


def _excludes(gain: NDArray[np.float64], left: NDArray[np.float64], least: float = 1.0) -> bool:
    """Whether 0 >= sum(gain) + x . (sum of left's rows) is impossible for every |x|_1 <= REACH * least."""
    rounding = _ROUNDING * (len(gain) + 1)
    surely = float(gain.sum()) - rounding * float(np.abs(gain).sum())
    at_most = np.abs(left.sum(axis=0)) + rounding * np.abs(left).sum(axis=0)
    return surely > REACH * least * float(at_most.max(initial=0.0))


def _check_kinematic(problem: ContactProblem, force: NDArray[np.float64]) -> bool:
    rows, offset, contacts = rigid_rows(problem)
    if force.shape != offset.shape or (force[:contacts] < 0.0).any():
        return False
    units = natural_units(problem)
    left = force[:, None] * rows * (units.coordinates / units.velocity)
    return _excludes(-force * offset / demanded(offset, contacts), left)


def without_yields(problem: ContactProblem) -> Problem:
    """The problem in which rows that yield have no rates: to a force so large that a float no longer tells
    the difference, they give way to any motion. If it has no solution, the problem has none, however little
    they yield."""
    from rungwise.contact.problem import Problem

    given, (contacts, rows) = Problem.of_step(problem), yielding(problem)
    gone = np.concatenate([contacts.repeat(given.directions), np.zeros(len(problem.c), bool), rows])
    A = given.A.toarray() if sp.issparse(given.A) else given.A
    return Problem(
        np.where(gone[:, None], 0.0, A), np.where(gone, 0.0, given.b), given.mu, given.directions,
        given.lower, given.upper, given.velocities,
    )  # fmt: skip


def _check_modes(problem: ContactProblem, certificate: Certificate, held: bool) -> bool:
    """Whether multipliers of the scaled problem, in units of its rates without forces or of demanded rates,
    exclude each of the modes; where `held`, without rates of rows that yield."""
    # Few runs need what scaled problems need, and it takes long to import.
    from rungwise.contact.judge.farkas import Infeasible, proves
    from rungwise.contact.prepare.system import scaled
    from rungwise.contact.problem import Problem

    try:
        given = without_yields(problem) if held else Problem.of_step(problem)
        systems = scaled(given), scaled(given, massless=True)
    except ValueError:  # directions, or numbers, for which there is no such proof
        return False
    proof = Infeasible("jammed", certificate.modes, certificate.vectors)
    return any(proves(given, system, proof) for system in systems)


def _check_unsupported(
    problem: ContactProblem, motion: NDArray[np.float64], resisting: NDArray[np.float64]
) -> bool:
    """The motion's power: loads less drives, against the power that rates, contact forces and joint forces
    may still have, with forces counted beside the greatest load."""
    if motion.shape != problem.c.shape:
        return False
    d, units = problem.R.shape[1], natural_units(problem)
    power = float(np.abs(problem.c * units.coordinates).max(initial=0.0)) or 1.0
    joints = np.isinf(problem.F)
    rates = problem.S @ motion
    slip = np.sqrt(sum((problem.W[i::d] @ motion) ** 2 for i in range(1, d))) if d > 1 else 0.0
    closing = np.maximum(problem.mu * slip - problem.W[::d] @ motion, 0.0) / units.velocity
    gain = np.concatenate([problem.c * motion, -problem.F[~joints] * np.abs(rates[~joints])]) / power
    size = float(np.abs(motion / units.coordinates).max(initial=0.0))
    per_joint = np.abs(rates[joints]) / units.velocity
    # A rate counts as one when it takes a force of one: H_0 limits how fast things move that loads drive.
    stiff = np.abs(np.diag(resisting)) * units.coordinates**2
    resist = np.abs(resisting @ motion) * units.coordinates / max(float(stiff.max(initial=0.0)), 1e-300)
    left = np.concatenate([closing, per_joint, resist])
    slack = np.full_like(left, _ROUNDING * len(left) * size)
    return _excludes(gain, np.vstack([left, slack]))
