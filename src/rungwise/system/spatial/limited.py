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

    def fill(self, d: mujoco.MjData, moment: Reals, acting: Reals, loads: bool, terms: Terms) -> None:
        """Rows of equalities, of dry friction, and of servos; lengths, as for contacts; `loads`: whether the
        rung has loads."""
        drive = self.drives
        ne, nf, ns = int(d.ne), int(d.nf), len(drive.servos)
        if ne + nf + ns == 0:
            return
        S = terms.limited
        S[: ne + nf] = _rows(d, ne + nf, S.shape[1])
        S[ne + nf :] = moment[drive.servos]
        unit = _units(S, self.lever)
        S *= unit[:, None]
        terms.limit[:ne] = np.inf
        terms.limit[ne : ne + nf] = d.efc_frictionloss[ne : ne + nf] / unit[ne : ne + nf]
        terms.limit[ne + nf :] = drive.limit[drive.servos] / unit[ne + nf :]
        terms.account[:ne], terms.account[ne : ne + nf], terms.account[ne + nf :] = JOINT, SUPPORT, DRIVE
        terms.gains[:ne] = np.inf, 0.0
        terms.gains[ne : ne + nf] = 0.0
        open_by = d.efc_pos[:ne] * unit[:ne]
        # As with gaps: what closes an opening by rounding would be great forces of friction.
        terms.error[:ne, 0] = np.where(np.abs(open_by) > terms.rounding[0], -open_by, 0.0)
        if ne > 1:
            self._agree(S[:ne], terms)
        terms.error[ne : ne + nf] = 0.0
        own = unit[ne + nf :]
        terms.gains[ne + nf :] = drive.gains / (own * own)[:, None]
        wish = drive.errors(acting, d.actuator_length, loads)
        # K_p e + K_d v_d is what counts: all of it is put into the one that is there.
        stiff, damp = drive.gains.T
        with np.errstate(divide="ignore", invalid="ignore"):
            terms.error[ne + nf :, 0] = np.where(stiff > 0.0, wish / stiff, 0.0) * own
            terms.error[ne + nf :, 1] = np.where(stiff > 0.0, 0.0, wish / damp) * own

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
    import mujoco

    rows = np.zeros((count, n))
    if count:
        own = slice(count)
        mujoco.mju_sparse2dense(rows, d.efc_J, d.efc_J_rownnz[own], d.efc_J_rowadr[own], d.efc_J_colind)
    return rows


def _units(rows: Reals, lever: Reals) -> Reals:
    """Factors (r,) that make rows (r, n) lengths: a row of one translation keeps its unit, and so does one
    that is nothing beside the longest."""
    most = np.abs(rows / lever).max(axis=1, initial=0.0)
    return np.asarray(1.0 / np.where(most > NOISE * most.max(initial=0.0), most, 1.0))
