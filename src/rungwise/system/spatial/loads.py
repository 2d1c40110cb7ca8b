"""Inertia and loads of a model: what acts besides contacts, limits and servos."""

from __future__ import annotations

import inspect
import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.contact.linear import factorise, substitute
from rungwise.contact.step import entry, stretch
from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene.space.mujoco_model import of_unit_mass
from rungwise.system.moving import Moment
from rungwise.system.spatial.drives import INTEGRATOR, Drives
from rungwise.system.spatial.native import (
    DATA,
    MODEL,
    Ints32,
    mj_comPos,
    mj_comVel,
    mj_kinematics,
    mj_makeM,
    mj_passive,
    mj_rne,
    mj_solveM,
)
from rungwise.system.spatial.spins import Spins, spins, turn_freely
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco


class Rows(Block):
    """Rows (r,) in MuJoCo's memory: how many entries each has, the first of them, and their columns. Of a
    symmetric matrix they are the lower half."""

    many: Ints32
    first: Ints32
    column: Ints32
    value: Reals


class Joints(Block):
    """Springs and dampers: of joints damping and stiffness (n,); damping of actuators (a,); of tendons
    damping and stiffness (t,), lengths in MuJoCo's memory, and between which they are slack (t, 2);
    `any` (3,): whether there are springs or dampers that change with the place, such of actuators, and such
    of tendons; `filled` (1,): the terms in which they were filled last."""

    damping: Reals
    stiffness: Reals
    drag: Reals
    tendon_damping: Reals
    tendon_stiffness: Reals
    tendon_length: Reals
    slack: Reals
    any: Ints
    filled: Ints


class Actuators(Block):
    """controls (a, 2), activations (a, 2): ranges of these; activated (a,): where the activation of each is
    among all, -1 without; kind (a,): MuJoCo's number of how it follows the control, and constant (a,) the
    time of a filter.

    acting (a,): what actuators act by; gain, bias, middle and limit (a,) of their force (see `Drives`),
    and whether each is a servo; rows that MuJoCo has, and as a matrix, moment (a, n); driving (n,): the part
    of the load that they are."""

    controls: Reals
    activations: Reals
    activated: Ints
    kind: Ints
    constant: Reals
    acting: Reals
    gain: Reals
    bias: Reals
    middle: Reals
    limit: Reals
    servo: Ints
    rows: Rows
    moment: Reals
    driving: Reals


class Loads(Block):
    """What fills M, metric, loads, springs and dampers of a model.

    address (2,) of the model and its data, and `unit` (2,) of those of the same bodies with mass 1 each, 0 if
    nothing asked for these; q and unit_q (n_q,), v (n,), axes of bodies (b, 9), forces of springs and of
    compensated weight (n,), M, and, of unit masses, metric, in MuJoCo's memory; tendons: rows of tendons.

    taken (n,): inertial forces and weight that were taken off the load; falls (n,): accelerations of free
    bodies by weight, 0 where more than weight and contacts may act; joined (n,): the velocities of bodies
    that do not turn freely; weighs (b,): the masses of these bodies; stretch (n, 2): the velocities that
    inertia, springs and dampers couple with each; free (n,): whether a velocity is not prescribed. row (n,),
    tendon (t, n), matrix (w, w) and order (w,), of as many as are coupled, are scratch.
    """

    address: Ints
    unit: Ints
    q: Reals
    unit_q: Reals
    v: Reals
    axes: Reals
    spring: Reals
    weight: Reals
    inertia: Rows
    metric: Rows
    spins: Spins
    joints: Joints
    actuators: Actuators
    tendons: Rows
    taken: Reals
    falls: Reals
    joined: Ints
    weighs: Reals
    stretch: Ints
    free: Ints
    row: Reals
    tendon: Reals
    matrix: Reals
    order: Ints


TINY = 2.0**-1022
"""Time of a filter at least: the smallest normal number."""
SPRINGS, DRAGS, TENDONS = range(3)
"""Places in `Joints.any`."""


def loads(model: mujoco.MjModel, data: mujoco.MjData, drives: Drives, pace: Reals) -> Loads:
    """What fills the loads of a model at speeds (n,), nan where a velocity is free; without unit masses."""
    m, n = model, model.nv
    drag = np.array(m.actuator_damping)
    parts = (m.jnt_stiffness, m.body_gravcomp, m.tendon_stiffness, m.tendon_damping, drag)
    springs = any(bool(part.any()) for part in parts)
    tied = bool(m.tendon_damping.any() or m.tendon_stiffness.any())
    joints = Joints(
        damping=np.array(m.dof_damping), stiffness=np.array(m.jnt_stiffness[m.dof_jntid]), drag=drag,
        tendon_damping=np.array(m.tendon_damping), tendon_stiffness=np.array(m.tendon_stiffness),
        tendon_length=data.ten_length, slack=np.array(m.tendon_lengthspring),
        any=np.array([springs, drag.any(), tied], np.int64), filled=np.zeros(1, np.int64),
    )  # fmt: skip
    servo = np.zeros(m.nu, np.int64)
    servo[drives.servos] = 1
    lasting, activated = np.flatnonzero(m.actuator_dyntype), np.full(m.nu, -1)
    activated[lasting[np.argsort(m.actuator_actadr[lasting])]] = np.arange(len(lasting))
    actuators = Actuators(
        controls=np.stack(drives.control_ranges(), axis=1),
        activations=np.stack(drives.activation_ranges(), axis=1), activated=activated,
        kind=m.actuator_dyntype.astype(np.int64), constant=np.array(m.actuator_dynprm[:, 0]),
        acting=np.zeros(m.nu), gain=np.array(m.actuator_gainprm[:, 0]), bias=np.array(drives.bias),
        middle=np.array(drives.middle), limit=np.array(drives.limit), servo=servo,
        rows=Rows(
            many=data.moment_rownnz, first=data.moment_rowadr, column=data.moment_colind,
            value=data.actuator_moment,
        ),
        moment=np.zeros((m.nu, n)), driving=np.zeros(n),
    )  # fmt: skip
    own, joined = spins(m), np.ones(n, np.int64)
    joined[(own.first[:, None] + np.arange(6)).ravel()] = 0
    free = np.isnan(pace)
    stretches = _stretches(m, bool(drag.any()))
    side = 0 if free.all() else _widest(stretches)
    return Loads(
        address=np.array([model._address, data._address]), unit=np.zeros(2, np.int64), q=data.qpos,
        unit_q=data.qpos, v=data.qvel, axes=data.xmat, spring=data.qfrc_spring, weight=data.qfrc_gravcomp,
        inertia=_inertia(m, data), metric=_inertia(m, data), spins=own, joints=joints, actuators=actuators,
        tendons=Rows(
            many=m.ten_J_rownnz, first=m.ten_J_rowadr, column=m.ten_J_colind, value=data.ten_J.reshape(-1)
        ),
        taken=np.zeros(n), falls=np.zeros(n) if springs or m.nu else np.where(free, _weights(m, own), 0.0),
        joined=joined, weighs=np.where(np.isin(m.body_rootid, own.body), 0.0, m.body_mass),
        stretch=stretches, free=free.astype(np.int64), row=np.zeros(n),
        tendon=np.zeros((m.ntendon, n)), matrix=np.zeros((side, side)), order=np.zeros(side, np.int64),
    )  # fmt: skip


def with_unit_masses(loads: Loads, unit: mujoco.MjModel, data: mujoco.MjData) -> Loads:
    """The same that knows M of these, which `unit_masses` made."""
    known = {name: getattr(loads, name) for name in inspect.get_annotations(Loads)}
    own = {
        "unit": np.array([unit._address, data._address]),
        "unit_q": data.qpos,
        "metric": _inertia(unit, data),
    }
    return Loads(**(known | own))


def unit_masses(model: mujoco.MjModel) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The same bodies with mass 1 each, and their data."""
    import mujoco

    unit = of_unit_mass(model)
    data = mujoco.MjData(unit)
    mujoco.mj_setConst(unit, data)  # it keeps M of bodies whose M is constant
    return unit, data


def _inertia(model: mujoco.MjModel, data: mujoco.MjData) -> Rows:
    return Rows(many=model.M_rownnz, first=model.M_rowadr, column=model.M_colind, value=data.M)


def _weights(model: mujoco.MjModel, own: Spins) -> Reals:
    """Accelerations (n,) by weight of free bodies that nothing damps."""
    import mujoco

    found = np.zeros(model.nv)
    weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    for first in [] if weightless else own.first.tolist():
        if not model.dof_damping[first : first + 3].any():
            found[first : first + 3] = model.opt.gravity
    return found


def _stretches(m: mujoco.MjModel, drags: bool) -> Ints:
    """The stretch (n, 2) of the velocities that inertia, springs and dampers couple with each: those of its
    mechanism and of others that tendons tie it to, or all where dampers of actuators may couple."""
    if drags:
        return np.tile(np.array([0, m.nv]), (m.nv, 1))
    first = m.tree_dofadr[m.dof_treeid]
    found = np.stack([first, first + m.tree_dofnum[m.dof_treeid]], axis=1).astype(np.int64)
    kinds = m.tendon_stiffness, m.tendon_damping, m.tendon_armature
    ties = [t for t in range(m.ntendon) if any(kind[t].any() for kind in kinds)]
    own = [m.ten_J_colind[m.ten_J_rowadr[t] :][: m.ten_J_rownnz[t]] for t in ties]
    for _ in ties:  # what is tied to one that is tied to others is tied to these
        for columns in own:
            tied = np.isin(m.dof_treeid, m.dof_treeid[columns])
            found[tied] = found[tied, 0].min(initial=m.nv), found[tied, 1].max(initial=0)
    return found


def _widest(stretches: Ints) -> int:
    """How many velocities at most are coupled with each other and no others."""
    ends = [0]
    while ends[-1] < len(stretches):
        ends.append(int(block_end(stretches, ends[-1])))
    return int(np.diff(ends).max(initial=0))


@kernel
def block_end(stretches: Ints, begin: int) -> int:
    """The end of the least block of velocities from `begin` on that are coupled with no others."""
    i, end = begin, begin + 1
    while i < end:
        end = max(end, stretches[i, 1])
        i += 1
    return int(end)


@kernel
def let_act(a: Actuators, control: Reals, activation: Reals, h: float, after: Reals) -> None:
    """Fill what actuators act by at the end of a step of length h, at controls (a,) and activations (k,): the
    controls within their ranges, or activations after it, of a filter and of an integrator exactly; these
    are filled into after (k,), which may be the same array."""
    for i in range(len(a.acting)):
        told = min(max(control[i], a.controls[i, 0]), a.controls[i, 1])
        at = a.activated[i]
        if at >= 0:
            now = activation[at]
            if a.kind[i] == INTEGRATOR:
                told = now + h * told
            else:
                told = now - (told - now) * math.expm1(-h / max(a.constant[i], TINY))
            told = min(max(told, a.activations[i, 0]), a.activations[i, 1])
            after[at] = told
        a.acting[i] = told


@kernel
def fill_loads(of: Loads, moment: Moment, terms: Terms) -> None:
    """Fill terms at the place of the model's data."""
    eps = moment.inertia
    if of.joints.filled[0] != terms.damping.ctypes.data:
        copy(of.stretch[: len(terms.entries.matrices)], terms.entries.matrices)
    fill_symmetric(of.inertia, terms.entries.matrices, terms.inertia)
    if eps == 0.0 and of.unit[MODEL] != 0:
        copy(moment.q, of.unit_q)
        mj_kinematics(of.unit[MODEL], of.unit[DATA])
        mj_comPos(of.unit[MODEL], of.unit[DATA])
        mj_makeM(of.unit[MODEL], of.unit[DATA])
        fill_symmetric(of.metric, terms.entries.matrices, terms.metric)
    _take_inertial(of, moment.v, eps)
    for i in range(len(of.taken)):
        terms.load[i] = 0.0 - of.taken[i]
    if eps > 0.0 and len(of.spins.first) > 0:
        turn_freely(of.spins, of.axes, moment.v, moment.h, eps, terms.load)
    if of.joints.any[SPRINGS]:
        mj_passive(of.address[MODEL], of.address[DATA])
        for i in range(len(of.taken)):
            terms.load[i] += of.spring[i] + of.weight[i]
    if len(of.actuators.acting) > 0:
        _drive(of.actuators, terms.load)
    if of.joints.any[SPRINGS] or of.joints.filled[0] != terms.damping.ctypes.data:
        _fill_yielding(of, terms)
        of.joints.filled[0] = terms.damping.ctypes.data
    fill_fall(of, terms)


@kernel
def fill_fall(of: Loads, terms: Terms) -> None:
    """Fill in the accelerations without contacts."""
    if len(of.order) == 0:
        mj_solveM(of.address[MODEL], of.address[DATA], terms.fall.ctypes.data, terms.load.ctypes.data, 1)
    else:
        _fall_of_free(of, terms)


@kernel
def _take_inertial(of: Loads, v: Reals, eps: float) -> None:
    """Fill the inertial forces at v, times eps, and the weight."""
    model, data = of.address[MODEL], of.address[DATA]
    for i in range(len(v)):
        of.v[i] = v[i] if eps > 0.0 else 0.0
    mj_comVel(model, data)
    mj_rne(model, data, 0, of.taken.ctypes.data)
    if 0.0 < eps < 1.0:
        for i in range(len(v)):
            of.v[i] = 0.0
        mj_comVel(model, data)
        mj_rne(model, data, 0, of.row.ctypes.data)
        for i in range(len(v)):
            of.taken[i] = eps * of.taken[i] + (1.0 - eps) * of.row[i]


@kernel
def _drive(a: Actuators, load: Reals) -> None:
    """Add what actuators do: forces, within their ranges, and the middles of servos."""
    n = len(load)
    for i in range(n):
        a.driving[i] = 0.0
    for k in range(len(a.acting)):
        fill_row(a.rows, k, a.moment[k])
        force = a.middle[k]
        if a.servo[k] == 0:
            own = a.gain[k] * a.acting[k] + a.bias[k] - a.middle[k]
            force += min(max(own, -a.limit[k]), a.limit[k])
        for i in range(n):
            a.driving[i] += force * a.moment[k, i]
    for i in range(n):
        load[i] += a.driving[i]


@kernel
def fill_row(rows: Rows, r: int, row: Reals) -> None:
    """Write a row of MuJoCo's into one (n,)."""
    for i in range(len(row)):
        row[i] = 0.0
    for e in range(rows.first[r], rows.first[r] + rows.many[r]):
        row[rows.column[e]] = rows.value[e]


@kernel
def fill_symmetric(rows: Rows, stretches: Ints, matrix: Reals) -> None:
    """Write the entries of a symmetric matrix (n, n), which has no others, where they are kept."""
    n = len(rows.many)
    for i in range(n):
        low, _ = stretch(stretches, i, n)
        for e in range(rows.first[i], rows.first[i] + rows.many[i]):
            j = rows.column[e]
            other, _ = stretch(stretches, j, n)
            matrix[i, j - low] = matrix[j, i - other] = rows.value[e]


@kernel
def _fill_yielding(of: Loads, terms: Terms) -> None:
    """Springs and dampers of joints, tendons and actuators, which a step takes at its end."""
    joints, n, stretches = of.joints, len(of.taken), terms.entries.matrices
    for i in range(n):  # all else is zero since these terms were made
        low, _ = stretch(stretches, i, n)
        for j in range(of.stretch[i, 0], of.stretch[i, 1]):
            terms.damping[i, j - low] = terms.stiffness[i, j - low] = 0.0
        terms.damping[i, i - low], terms.stiffness[i, i - low] = joints.damping[i], joints.stiffness[i]
    for k in range(len(joints.drag) if joints.any[DRAGS] else 0):
        _add_product(joints.drag[k], of.actuators.moment[k], stretches, terms.damping)
    for k in range(len(joints.tendon_length) if joints.any[TENDONS] else 0):
        row, length = of.tendon[k], joints.tendon_length[k]
        fill_row(of.tendons, k, row)
        _add_product(joints.tendon_damping[k], row, stretches, terms.damping)
        if length < joints.slack[k, 0] or length > joints.slack[k, 1]:
            _add_product(joints.tendon_stiffness[k], row, stretches, terms.stiffness)


@kernel
def _add_product(part: float, row: Reals, stretches: Ints, matrix: Reals) -> None:
    """Add a part of the product of a row (n,) with itself."""
    for i in range(len(row)):
        if part * row[i] != 0.0:
            low, high = stretch(stretches, i, len(row))
            for j in range(low, high):
                matrix[i, j - low] += part * row[i] * row[j]


@kernel
def _fall_of_free(of: Loads, terms: Terms) -> None:
    """Fill in accelerations without contacts where some velocities are prescribed."""
    begin = 0
    while begin < len(terms.load):
        end = block_end(of.stretch, begin)
        _fall_of_block(of, begin, end, terms)
        begin = end


@kernel
def _fall_of_block(of: Loads, begin: int, end: int, terms: Terms) -> None:
    """The same of the velocities begin..end, which M couples with no others."""
    count = 0
    for i in range(begin, end):
        terms.fall[i] = 0.0
        if of.free[i] == 1:
            at = 0
            for j in range(begin, end):
                if of.free[j] == 1:
                    of.matrix[count, at] = entry(terms.inertia, terms.entries.matrices, i, j)
                    at += 1
            of.row[count] = terms.load[i]
            count += 1
    if count > 0 and factorise(of.matrix, count, of.order):
        substitute(of.matrix, count, of.order, of.row)
    count = 0
    for i in range(begin, end):
        if of.free[i] == 1:
            terms.fall[i] = of.row[count]
            count += 1
