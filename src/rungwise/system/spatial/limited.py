"""Rows of a model besides contacts: equalities, dry friction, servos with limited force, and travel
limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.system.entries import fill_span
from rungwise.system.products import dot
from rungwise.system.spatial.drives import Drives
from rungwise.system.spatial.loads import tendon_rows
from rungwise.system.terms import DRIVE, JOINT, SUPPORT, Terms

if TYPE_CHECKING:
    import mujoco

SPARE = 1e-8
"""Part of an equality's row that is not a sum of others before it, over its length, that is rounding."""
NOISE = 1e-12
"""Length of an equality's row, over the longest, that is rounding: it says nothing."""


class Limited:
    """What fills these rows; lever (n,) is the length that a unit of each velocity stands for, and `first`
    the slot of the first travel limit."""

    def __init__(self, model: mujoco.MjModel, drives: Drives, lever: Reals, free: Ints, first: int) -> None:
        self.drives, self.lever, self.free, self.first = drives, lever, free, first
        self.limits = Limits(model)
        self._basis = self._own = np.zeros((0, len(lever) + 1))
        self._unit = np.zeros(0)

    def fill(self, d: mujoco.MjData, moment: Reals, acting: Reals, loads: bool, terms: Terms) -> None:
        """Rows of equalities, of dry friction, and of servos; lengths, as for contacts; `loads`: whether the
        rung has loads."""
        drive = self.drives
        ne, nf, ns = int(d.ne), int(d.nf), len(drive.servos)
        if ne + nf + ns == 0:
            return
        if len(self._unit) < ne + nf + ns:
            self._unit = np.zeros(ne + nf + ns)
        rows = terms.limited
        if ne + nf:
            _put_rows(d, rows[: ne + nf])
        rows[ne + nf :] = moment[drive.servos]
        wish = drive.errors(acting, d.actuator_length, loads)
        fill_rows(
            (ne, nf), d.efc_pos, d.efc_frictionloss, drive.servos, drive.limit, drive.gains, wish, self.lever,
            self._unit, terms,
        )  # fmt: skip
        if ne > 1:
            self._agree(rows[:ne], terms)

    def _agree(self, rows: Reals, terms: Terms) -> None:
        """Let equalities that say what others say, as those of a closed loop do, ask for what the others ask
        for: a difference by rounding would be a contradiction."""
        if len(self._basis) < len(rows):
            self._basis = np.zeros((len(rows), len(self.lever) + 1))
            self._own = self._basis.copy()
        own = self._own[: len(rows)]
        np.divide(rows, self.lever, out=own[:, :-1])
        own[:, -1] = terms.error[: len(rows), 0]
        agree(own, self._basis)
        terms.error[: len(rows), 0] = own[:, -1]
        rows[(own[:, :-1] == 0.0).all(axis=1)] = 0.0

    def fill_limits(self, d: mujoco.MjData, reach: float, count: int, terms: Terms, slots: Ints) -> int:
        """Travel limits of joints and tendons, after `count` contacts: rows of one direction."""
        k, D = count, terms.contact_stiffness.shape[1]
        first = int(d.ne + d.nf)
        if d.nl == 0:
            return k
        rows = _rows(d, first + int(d.nl), len(self.lever))
        sides = self.limits.sides(d, rows)
        for r in range(first, first + int(d.nl)):
            row = rows[r]
            unit = float(_units(row[None], self.lever)[0])
            if d.efc_pos[r] * unit > reach or not (row[self.free == 1] != 0.0).any():
                continue
            terms.rows[k * D : k * D + D] = 0.0
            fill_span(terms.entries, k, len(row))
            terms.rows[k * D] = unit * row
            terms.gap[k], terms.lever[k] = unit * d.efc_pos[r], unit
            terms.skew[k : k + 1] = 1.0, 0.0, 1.0
            terms.friction[k] = terms.restitution[k] = 0.0
            terms.contact_stiffness[k], terms.contact_damping[k] = 0.0, 0.0
            terms.contact_stiffness[k, 0, 0] = np.inf
            slots[k] = self.first + sides[r - first]
            k += 1
        return k

    def violations(self, d: mujoco.MjData) -> list[tuple[float, int, int]]:
        """How far each equality is open and each travel limit is passed, as a length, with MuJoCo's kind of
        the row and the number of its element."""
        first = int(d.ne + d.nf)
        rows = _rows(d, first + int(d.nl), len(self.lever))
        own = [*range(int(d.ne)), *range(first, first + int(d.nl))]
        open_by = np.where(np.array(own) < d.ne, np.abs(d.efc_pos[own]), np.maximum(-d.efc_pos[own], 0.0))
        lengths = open_by * _units(rows[own], self.lever)
        return list(zip(lengths.tolist(), d.efc_type[own].tolist(), d.efc_id[own].tolist(), strict=True))

    def open(self, d: mujoco.MjData) -> tuple[Reals, Reals]:
        """Rows (k, n_v) of the equalities, and of the travel limits that are passed, in MuJoCo's units, and
        by how much (k,) they are open or passed."""
        first = int(d.ne + d.nf)
        rows = _rows(d, first + int(d.nl), len(self.lever))
        passed = [r for r in range(first, first + int(d.nl)) if d.efc_pos[r] < 0.0]
        own = [*range(int(d.ne)), *passed]
        return rows[own], d.efc_pos[own].copy()


@kernel
def fill_rows(
    counts: tuple[int, int], opening: Reals, loss: Reals, servos: Ints, force: Reals, gains: Reals,
    wish: Reals, lever: Reals, unit: Reals, terms: Terms,
) -> None:  # fmt: skip
    """Scale the rows of `terms.limited` (r, n) to lengths, and fill what goes with them: of so many
    equalities, which are open by `opening` (k,), of dry friction with `loss` (k,), and of servos (s,) with
    these limits of force (a,), gains (s, 2) and errors (s,) of `Drives.errors`; unit (r,) is filled, too."""
    S, (ne, nf) = terms.limited, counts
    put_units(S, lever, unit)
    for r in range(S.shape[0]):
        u = unit[r]
        for i in range(S.shape[1]):
            S[r, i] *= u
        terms.error[r, 0] = terms.error[r, 1] = terms.gains[r, 0] = terms.gains[r, 1] = 0.0
        if r < ne:
            terms.account[r], terms.limit[r], terms.gains[r, 0] = JOINT, math.inf, math.inf
            # As with gaps: what closes an opening by rounding would be great forces of friction.
            if abs(opening[r] * u) > terms.rounding[0]:
                terms.error[r, 0] = -(opening[r] * u)
        elif r < ne + nf:
            terms.account[r], terms.limit[r] = SUPPORT, loss[r] / u
        else:
            k = r - ne - nf
            stiff, damp = gains[k, 0], gains[k, 1]
            terms.account[r], terms.limit[r] = DRIVE, force[servos[k]] / u
            terms.gains[r, 0], terms.gains[r, 1] = stiff / (u * u), damp / (u * u)
            # K_p e + K_d v_d is what counts: all of it is put into the one that is there.
            if stiff > 0.0:
                terms.error[r, 0] = wish[k] / stiff * u
            else:
                terms.error[r, 1] = wish[k] / damp * u


@kernel
def put_units(rows: Reals, lever: Reals, unit: Reals) -> None:
    """Fill factors (r,) that make rows (r, n) lengths: a row of one translation keeps its unit, and so does
    one that is nothing beside the longest."""
    longest = 0.0
    for r in range(rows.shape[0]):
        unit[r] = 0.0
        for i in range(rows.shape[1]):
            unit[r] = max(unit[r], abs(rows[r, i] / lever[i]))
        longest = max(longest, unit[r])
    for r in range(rows.shape[0]):
        unit[r] = 1.0 / unit[r] if unit[r] > NOISE * longest else 1.0


@kernel
def agree(rows: Reals, basis: Reals) -> None:
    """Rows (r, n + 1) are equalities a v = e, with e last. Where a is a sum of multiples of those before, up
    to `SPARE` of its length, e becomes the same sum of theirs; a row that is nothing beside the longest
    becomes 0. `basis`, of the same shape, is scratch for orthogonal unit rows."""
    known, longest, n = 0, 0.0, rows.shape[1] - 1
    for r in range(rows.shape[0]):
        longest = max(longest, dot(rows[r], rows[r], n))
    for r in range(rows.shape[0]):
        length = dot(rows[r], rows[r], n)
        if length <= NOISE * NOISE * longest:
            rows[r, :] = 0.0
            continue
        copy(rows[r], basis[known])
        for _ in range(2):  # once more, for what rounding left
            for k in range(known):
                part = dot(basis[k], basis[known], n)
                for i in range(n + 1):
                    basis[known, i] -= part * basis[k, i]
        left = dot(basis[known], basis[known], n)
        if left <= SPARE * SPARE * length:
            rows[r, n] -= basis[known, n]
            continue
        left = math.sqrt(left)
        for i in range(n + 1):
            basis[known, i] /= left
        known += 1


@dataclass(frozen=True)
class Limits:
    """Slots of travel limits: two of each joint and tendon with a range, the upper end's first."""

    model: Any
    keys: dict[tuple[int, int, int], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        import mujoco

        m = self.model
        for kind, limited in (
            (mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT, m.jnt_limited),
            (mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON, m.tendon_limited),
        ):
            for number in np.flatnonzero(limited):
                for side in (0, 1):
                    self.keys[int(kind), int(number), side] = len(self.keys)

    def sides(self, d: mujoco.MjData, rows: Reals) -> list[int]:
        """The slot of each row of a limit (l,). It is of the lower end where the row is the derivative of the
        joint's place or of the tendon's length, and of the upper end where it is the opposite; what turns in
        space has one end, whatever the axis."""
        import mujoco

        first, m = int(d.ne + d.nf), self.model
        kinds, numbers = d.efc_type[first : first + d.nl].tolist(), d.efc_id[first : first + d.nl].tolist()
        of_tendon = int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON)
        lengths = tendon_rows(m, d) if of_tendon in kinds else rows
        found = []
        for row, kind, number in zip(rows[first:], kinds, numbers, strict=False):
            if kind == of_tendon:
                rate = float(row @ lengths[number])
            else:
                turns = m.jnt_type[number] == mujoco.mjtJoint.mjJNT_BALL
                rate = 0.0 if turns else float(row[m.jnt_dofadr[number]])
            found.append(self.keys[kind, number, int(rate > 0.0)])
        return found


def _rows(d: mujoco.MjData, count: int, n: int) -> Reals:
    """The first rows (count, n) of MuJoCo's Jacobian."""
    rows = np.zeros((count, n))
    if count:
        _put_rows(d, rows)
    return rows


def _put_rows(d: mujoco.MjData, rows: Reals) -> None:
    """Fill rows (k, n) with the first of MuJoCo's Jacobian."""
    import mujoco

    own = slice(len(rows))
    mujoco.mju_sparse2dense(rows, d.efc_J, d.efc_J_rownnz[own], d.efc_J_rowadr[own], d.efc_J_colind)


def _units(rows: Reals, lever: Reals) -> Reals:
    """Factors (r,) that make rows (r, n) lengths (see `put_units`)."""
    unit = np.empty(len(rows))
    put_units(rows, lever, unit)
    return unit
