"""Rows of a model besides contacts: equalities, dry friction, servos with limited force, and travel
limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import span
from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.system.entries import clear_rows, is_crowded, set_spans
from rungwise.system.products import dot
from rungwise.system.spatial.drives import BALL, Drives
from rungwise.system.spatial.loads import Actuators, Rows, fill_row
from rungwise.system.spatial.native import (
    COUNTS,
    DATA,
    INTEGER,
    REAL,
    integer_at,
    offsets,
    pointer_at,
    real_at,
)
from rungwise.system.terms import DRIVE, JOINT, SUPPORT, Terms

if TYPE_CHECKING:
    import mujoco

SPARE = 1e-8
"""Part of an equality's row that is not a sum of others before it, over its length, that is rounding."""
NOISE = 1e-12
"""Length of an equality's row, over the longest, that is rounding: it says nothing."""
KIND, NUMBER, MANY, FIRST, COLUMN, VALUE, PLACE, LOSS = range(len(COUNTS), len(COUNTS) + 8)
"""Places in `offsets` of what MuJoCo says of a constraint."""
LIMIT_OF_TENDON = 4
"""MuJoCo's number of constraints that limit tendons."""


class Limited(Block):
    """What fills these rows. address (2,) and offsets of MuJoCo's data; lever (n,): the length that a unit of
    each velocity stands for; free (n,): whether it is not prescribed.

    servos (s,), their limits of force (a,), gains (s, 2), lengths of actuators (a,) in MuJoCo's memory; wish
    (s,) and unit (r,), row (n,), basis and own (e, n + 1) are scratch.

    slots (j, 2), of_tendons (t, 2): the slots of travel limits, the upper end's first, -1 without; kind (j,)
    and first (j,) of joints; tendons: their rows.
    """

    address: Ints
    offsets: Ints
    lever: Reals
    free: Ints
    servos: Ints
    limit: Reals
    gains: Reals
    length: Reals
    wish: Reals
    unit: Reals
    row: Reals
    rate: Reals
    basis: Reals
    own: Reals
    slots: Ints
    of_tendons: Ints
    kind: Ints
    first: Ints
    tendons: Rows


def limited(
    model: mujoco.MjModel, data: mujoco.MjData, drives: Drives, lever: Reals, free: Ints, first: int
) -> Limited:
    """What fills the rows of a model whose data have been placed; `first`: the slot of the first travel
    limit."""
    m, n, count = model, model.nv, first
    slots = np.full((m.njnt, 2), -1), np.full((m.ntendon, 2), -1)
    for table, bounded in zip(slots, (m.jnt_limited, m.tendon_limited), strict=True):
        for number in np.flatnonzero(bounded):
            table[number] = count, count + 1
            count += 2
    rows = int(data.ne + data.nf) + len(drives.servos)
    return Limited(
        address=np.array([model._address, data._address]), offsets=offsets(), lever=lever, free=free,
        servos=drives.servos.astype(np.int64), limit=np.array(drives.limit), gains=np.array(drives.gains),
        length=data.actuator_length, wish=np.zeros(len(drives.servos)), unit=np.zeros(rows), row=np.zeros(n),
        rate=np.zeros(n), basis=np.zeros((int(data.ne), n + 1)), own=np.zeros((int(data.ne), n + 1)),
        slots=slots[0], of_tendons=slots[1], kind=m.jnt_type.astype(np.int64),
        first=m.jnt_dofadr.astype(np.int64),
        tendons=Rows(
            many=m.ten_J_rownnz, first=m.ten_J_rowadr, column=m.ten_J_colind, value=data.ten_J.reshape(-1)
        ),
    )  # fmt: skip


def limit_count(of: Limited) -> int:
    """How many slots travel limits have."""
    return int((of.slots >= 0).sum() + (of.of_tendons >= 0).sum())


@kernel
def fill_limited(of: Limited, actuators: Actuators, loads: bool, terms: Terms) -> None:
    """Rows of equalities, of dry friction, and of servos; lengths, as for contacts; `loads`: whether the
    rung has loads."""
    ne, nf = _count(of, 0), _count(of, 1)
    if ne + nf + len(of.servos) == 0:
        return
    rows = terms.limited
    for r in range(ne + nf):
        put_row(of, r, rows[r])
    for k in range(len(of.servos)):
        a = of.servos[k]
        copy(actuators.moment[a], rows[ne + nf + k])
        # K_p times the error of place, plus K_d times the speed wished for; middles of servos act beside it
        of.wish[k] = actuators.gain[a] * actuators.acting[a] + actuators.bias[a]
        of.wish[k] -= actuators.middle[a] if loads else 0.0
        of.wish[k] -= of.gains[k, 0] * of.length[a]
    fill_rows(of, ne, nf, terms)
    if ne > 1:
        _agree(of, ne, terms)


@kernel
def _agree(of: Limited, count: int, terms: Terms) -> None:
    """Let so many equalities that say what others say, as those of a closed loop do, ask for what the others
    ask for: a difference by rounding would be a contradiction."""
    rows, n = terms.limited, len(of.lever)
    for r in range(count):
        for i in range(n):
            of.own[r, i] = rows[r, i] / of.lever[i]
        of.own[r, n] = terms.error[r, 0]
    agree(of.own, of.basis)
    for r in range(count):
        terms.error[r, 0], says = of.own[r, n], False
        for i in range(n):
            says |= of.own[r, i] != 0.0
        for i in range(0 if says else n):
            rows[r, i] = 0.0


@kernel
def fill_limits(of: Limited, reach: float, count: int, terms: Terms, slots: Ints) -> int:
    """Travel limits of joints and tendons within `reach`, after `count` contacts: rows of one direction.
    Returns how many there are with these."""
    k, D, first = count, terms.contact_stiffness.shape[1], _count(of, 0) + _count(of, 1)
    for r in range(first, first + _count(of, 2)):
        put_row(of, r, of.row)
        unit, gap, moves = unit_of(of.row, of.lever), real_at(_at(of, PLACE, r, REAL)), False
        for i in range(len(of.row)):
            moves |= of.free[i] == 1 and of.row[i] != 0.0
        if gap * unit > reach or not moves:
            continue
        if is_crowded(terms.entries):
            first, end = hull(of.row)
            set_spans(terms.entries.rows, k, first, end, end, end)
        clear_rows(terms.entries, k, D, terms.rows)
        first, end, shift = span(terms.entries.rows, k, 0, len(of.row))
        for i in range(first, end):
            terms.rows[k * D, i - shift] = unit * of.row[i]
        terms.gap[k], terms.lever[k] = unit * gap, unit
        for j in range(3 if terms.skew.shape[0] > 0 else 0):
            terms.skew[k, j] = 0.0 if j == 1 else 1.0
        terms.friction[k] = terms.restitution[k] = 0.0
        for i in range(D):
            for j in range(D):
                terms.contact_stiffness[k, i, j] = terms.contact_damping[k, i, j] = 0.0
        terms.contact_stiffness[k, 0, 0] = math.inf
        slots[k] = _slot(of, r)
        k += 1
    return k


@kernel
def _slot(of: Limited, r: int) -> int:
    """The slot of the limit in row r, which is in `row`. It is of the lower end where the row is the
    derivative of the joint's place or of the tendon's length, and of the upper end where it is the opposite;
    what turns in space has one end, whatever the axis."""
    number, rate = integer_at(_at(of, NUMBER, r, INTEGER)), 0.0
    if integer_at(_at(of, KIND, r, INTEGER)) == LIMIT_OF_TENDON:
        fill_row(of.tendons, number, of.rate)
        rate = dot(of.row, of.rate, len(of.row))
        return int(of.of_tendons[number, 1 if rate > 0.0 else 0])
    if of.kind[number] != BALL:
        rate = of.row[of.first[number]]
    return int(of.slots[number, 1 if rate > 0.0 else 0])


@kernel
def _count(of: Limited, which: int) -> int:
    """How many rows of equalities, dry friction or limits there are."""
    return integer_at(of.address[DATA] + of.offsets[which])


@kernel
def _at(of: Limited, what: int, r: int, size: int) -> int:
    """The address of what MuJoCo says of row r, of so many bytes."""
    return pointer_at(of.address[DATA] + of.offsets[what]) + r * size


@kernel
def put_row(of: Limited, r: int, row: Reals) -> None:
    """Write row r of MuJoCo's Jacobian into row (n,)."""
    for i in range(len(row)):
        row[i] = 0.0
    first = integer_at(_at(of, FIRST, r, INTEGER))
    for e in range(first, first + integer_at(_at(of, MANY, r, INTEGER))):
        row[integer_at(_at(of, COLUMN, e, INTEGER))] = real_at(_at(of, VALUE, e, REAL))


@kernel
def hull(row: Reals) -> tuple[int, int]:
    """The least stretch outside of which a row (n,) is zero."""
    first, end = 0, len(row)
    while end > 0 and row[end - 1] == 0.0:
        end -= 1
    while first < end and row[first] == 0.0:
        first += 1
    return first, end


@kernel
def unit_of(row: Reals, lever: Reals) -> float:
    """The factor that makes a row (n,) a length."""
    most = 0.0
    for i in range(len(row)):
        most = max(most, abs(row[i] / lever[i]))
    return 1.0 / most if most > 0.0 else 1.0


def violations(of: Limited, data: mujoco.MjData) -> list[tuple[float, int, int]]:
    """How far each equality is open and each travel limit is passed, as a length, with MuJoCo's kind of
    the row and the number of its element."""
    first = int(data.ne + data.nf)
    own = [*range(int(data.ne)), *range(first, first + int(data.nl))]
    rows, units = _rows(of, own), np.ones(len(own))
    put_units(rows, of.lever, units)
    at = data.efc_pos[own]
    by = units * np.where(np.array(own) < data.ne, np.abs(at), np.maximum(-at, 0.0))
    return list(zip(by.tolist(), data.efc_type[own].tolist(), data.efc_id[own].tolist(), strict=True))


def passed_rows(of: Limited, data: mujoco.MjData) -> tuple[Reals, Reals]:
    """Rows (k, n_v) of the equalities, and of the travel limits that are passed, in MuJoCo's units, and
    by how much (k,) they are open or passed."""
    first = int(data.ne + data.nf)
    passed = [r for r in range(first, first + int(data.nl)) if data.efc_pos[r] < 0.0]
    own = [*range(int(data.ne)), *passed]
    return _rows(of, own), data.efc_pos[own].copy()


def _rows(of: Limited, own: list[int]) -> Reals:
    """These rows (k, n_v) of MuJoCo's Jacobian."""
    rows = np.zeros((len(own), len(of.lever)))
    for k, r in enumerate(own):
        put_row(of, r, rows[k])
    return rows


@kernel
def fill_rows(of: Limited, ne: int, nf: int, terms: Terms) -> None:
    """Scale the rows of `terms.limited` (r, n) to lengths, and fill what goes with them: of so many
    equalities, of dry friction, and of servos with their wishes."""
    S, unit = terms.limited, of.unit
    put_units(S, of.lever, unit)
    for r in range(S.shape[0]):
        u = unit[r]
        for i in range(S.shape[1]):
            S[r, i] *= u
        terms.error[r, 0] = terms.error[r, 1] = terms.gains[r, 0] = terms.gains[r, 1] = 0.0
        if r < ne:
            opening = real_at(_at(of, PLACE, r, REAL))
            terms.account[r], terms.limit[r], terms.gains[r, 0] = JOINT, math.inf, math.inf
            # As with gaps: what closes an opening by rounding would be great forces of friction.
            if abs(opening * u) > terms.rounding[0]:
                terms.error[r, 0] = -(opening * u)
        elif r < ne + nf:
            terms.account[r], terms.limit[r] = SUPPORT, real_at(_at(of, LOSS, r, REAL)) / u
        else:
            k = r - ne - nf
            stiff, damp = of.gains[k, 0], of.gains[k, 1]
            terms.account[r], terms.limit[r] = DRIVE, of.limit[of.servos[k]] / u
            terms.gains[r, 0], terms.gains[r, 1] = stiff / (u * u), damp / (u * u)
            # K_p e + K_d v_d is what counts: all of it is put into the one that is there.
            if stiff > 0.0:
                terms.error[r, 0] = of.wish[k] / stiff * u
            else:
                terms.error[r, 1] = of.wish[k] / damp * u


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
