"""Bodies of a MuJoCo model as a system that the core takes steps of (see `simulation.core.system`).

MuJoCo gives places, inertia, loads, and rows and gaps of contacts, limits, equalities and tendons at (q, v);
all forces of contacts, limits, equalities, dry friction and servos are found by the models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.system.moving import Moment, Size, fall_freely
from rungwise.system.spatial.boxes import Boxes
from rungwise.system.spatial.drives import Drives, drives
from rungwise.system.spatial.features import Features, Seen, Solids, allocate_features, fill_contacts, keep
from rungwise.system.spatial.reach import reaches
from rungwise.system.terms import DRIVE, JOINT, SUPPORT, Terms

if TYPE_CHECKING:
    import mujoco


ROOM, SPARE = 16, 64
"""Contacts that there is room for: so many for each geom that may touch something, and more."""
AHEAD = 2.0
"""MuJoCo looks for contacts this many times farther than a step asks for, so that it is seldom told anew."""
NEAR = 0.05
"""How far contacts are looked for at first, over the length of the smallest geom."""


class Laws(NamedTuple):
    """Laws of contact: law (g, g), the row for two geoms; rows (l, 6): normal and tangential stiffness and
    damping, restitution, and friction, nan for the model's."""

    law: Ints
    rows: Reals


@dataclass
class Space:
    """A model at given controls (a,) and speeds (n,), nan where a velocity is free; both may change between
    steps. `place` and `motion` are the start."""

    model: mujoco.MjModel
    laws: Laws
    place: Reals
    motion: Reals
    control: Reals
    pace: Reals
    size: Size = field(init=False)
    kept: Features = field(init=False)
    directions: int = field(init=False)

    def __post_init__(self) -> None:
        import mujoco

        m = self.model
        _set_options(m)
        self.data = mujoco.MjData(m)
        self.unit: tuple[mujoco.MjModel, mujoco.MjData] | None = None
        self.directions = directions(m)
        self.reaches = reaches(m)
        self.drives: Drives = drives(m)
        self.boxes = Boxes(m)
        touching = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
        moving = touching & (m.body_weldid[m.geom_bodyid] != 0)
        self.room = ROOM * int(moving.sum()) + SPARE
        sizes = np.where(m.geom_rbound > 0.0, m.geom_rbound, np.inf)
        length = float(sizes[moving].min(initial=np.inf))
        length = length if math.isfinite(length) else float(self.reaches.max(initial=0.0)) or 1.0
        self.lever = self.reaches.max(axis=0, initial=0.0)
        self.lever[self.lever == 0.0] = length
        self.solids = Solids(
            body=m.geom_bodyid.astype(np.int64), size=sizes, law=self.laws.law, laws=self.laws.rows,
            free=np.isnan(self.pace).astype(np.int64), centre=self.data.xpos, turn=self.data.xmat,
        )  # fmt: skip
        self._q, self._fetched = np.full(m.nq, np.nan), False
        self._least: float | None = None
        self._near = AHEAD * NEAR * length
        self.look_within(self._near)
        self._at(self.place)
        self.limits = _Limits(m)
        rows = int(self.data.ne + self.data.nf)
        # As many slots again: a contact may be new while the feature that it displaces still has its slot.
        self.most = 2 * self.room
        self.size = Size(
            m.nq,
            m.nv,
            self.most + len(self.limits.keys),
            self.directions,
            rows + len(self.drives.servos),
            length,
        )
        self.forget()
        self._slots, self._fresh = np.zeros(self.size.slots, np.int64), np.zeros(self.size.slots, np.int64)
        self._moment = np.zeros((m.nu, m.nv))
        self._row = np.zeros(m.nv)
        self._all_free = bool(self.solids.free.all())
        self._springs = bool(
            m.jnt_stiffness.any()
            or m.body_gravcomp.any()
            or m.tendon_stiffness.any()
            or m.tendon_damping.any()
        )
        self._filled: Terms | None = None
        self._damping, self._stiffness = np.diag(m.dof_damping), np.diag(m.jnt_stiffness[m.dof_jntid])

    def start(self) -> tuple[Reals, Reals]:
        return self.place, self.motion

    def speeds(self, _time: float) -> Reals:
        return self.pace

    def integrate(self, q: Reals, v: Reals, h: float) -> Reals:
        import mujoco

        after = q.copy()
        mujoco.mj_integratePos(self.model, after, v, h)
        return after

    def least_gap(self, q: Reals) -> float:
        self._at(q)
        if self._least is None:
            contact = self.data.contact
            self._least = np.inf
            if self.data.ncon:
                self._least = float(contact.dist[contact.efc_address >= 0].min(initial=np.inf))
        return self._least

    def overlaps(self, q: Reals) -> list[tuple[float, int, int]]:
        """Gap and geoms of each contact that overlaps."""
        self._at(q)
        contact = self.data.contact
        return [
            (float(gap), int(a), int(b))
            for gap, (a, b), row in zip(contact.dist, contact.geom, contact.efc_address, strict=True)
            if gap < 0.0 and row >= 0
        ]

    def gap(self, q: Reals, a: int, b: int) -> float:
        """The distance of two bodies, negative where they overlap."""
        import mujoco

        self._at(q)
        m, nothing = self.model, None
        far = 10.0 * float(m.stat.extent)
        least = np.inf
        for i in self._geoms_of(a):
            for j in self._geoms_of(b):
                least = min(least, mujoco.mj_geomDistance(m, self.data, i, j, far, nothing))
        return float(least)

    def _geoms_of(self, body: int) -> range:
        first = int(self.model.body_geomadr[body])
        return range(first, first + int(self.model.body_geomnum[body]))

    def fastest(self, _q: Reals, v: Reals) -> float:
        return 2.0 * float((self.reaches @ np.abs(v)).max(initial=0.0))

    def energy(self, q: Reals, v: Reals) -> float:
        import mujoco

        self._at(q)
        mujoco.mj_energyPos(self.model, self.data)
        product = np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, self.data, product, v)
        return float(self.data.energy[0] + 0.5 * v @ product)

    def accept(self) -> None:
        keep(self.kept, self._found)

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        import mujoco

        m, d = self.model, self.data
        if reach > self.margin:
            self.look_within(AHEAD * reach)
        self._at(moment.q)
        mujoco.mj_fullM(m, d, terms.inertia)
        if moment.inertia == 0.0:
            self._fill_metric(moment.q, terms)
        self._fill_loads(moment, terms)
        rows = d.efc_J.reshape(-1, m.nv)
        self._fill_limited(rows, terms, not moment.metric)
        count = 0
        if d.ncon:
            c = d.contact
            seen = Seen(c.dist, c.pos, c.frame, c.friction, c.dim, c.geom, c.efc_address, rows)
            count = fill_contacts(
                seen, self.solids, self.kept, self._found, reach, self.room, terms, self._slots, self._fresh
            )
            if count < 0:
                raise InputError(f"scene: more than {self.room} contacts are within {reach:.3g} at once")
        else:
            self._found.geoms[:], self._found.used[0] = -1, 0
        count = self._fill_limits(rows, reach, count, terms)
        return self._slots[:count], self._fresh[:count]

    def forget(self) -> None:
        """Know no contact, and look for contacts as near as at first."""
        self.kept, self._found = allocate_features(self.most), allocate_features(self.most)
        self.look_within(self._near)

    def look_within(self, margin: float) -> None:
        """Look for contacts within a distance from now on."""
        m, self.margin = self.model, margin
        m.geom_margin[:], m.pair_margin[:] = 0.5 * margin, margin
        if m.njnt:
            m.jnt_margin[:] = margin / self.lever[m.jnt_dofadr]
        m.tendon_margin[:] = margin
        self._q = np.full(m.nq, np.nan)

    def _at(self, q: Reals) -> None:
        """Make MuJoCo's data those of q."""
        import mujoco

        if q is not self._q and not np.array_equal(q, self._q):
            m, d = self.model, self.data
            d.qpos[:] = q
            if self.boxes.is_box.sum() < 2:
                mujoco.mj_fwdPosition(m, d)
            else:
                mujoco.mj_kinematics(m, d)
                mujoco.mj_comPos(m, d)
                mujoco.mj_tendon(m, d)
                mujoco.mj_makeM(m, d)
                mujoco.mj_factorM(m, d)
                mujoco.mj_collision(m, d)
                self.boxes.mend(d)
                mujoco.mj_makeConstraint(m, d)
                mujoco.mj_transmission(m, d)
            self._least = None
        self._q = q

    def _fill_metric(self, q: Reals, terms: Terms) -> None:
        """M of the same bodies with mass 1 each."""
        import mujoco

        if self.unit is None:
            model = _of_unit_mass(self.model)
            self.unit = model, mujoco.MjData(model)
        model, data = self.unit
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_fullM(model, data, terms.metric)

    def _fill_loads(self, moment: Moment, terms: Terms) -> None:
        import mujoco

        m, d, eps, load = self.model, self.data, moment.inertia, terms.load
        load[:] = 0.0
        d.qvel[:] = moment.v if eps > 0.0 else 0.0
        mujoco.mj_comVel(m, d)
        mujoco.mj_rne(m, d, 0, self._row)
        if 0.0 < eps < 1.0:
            load -= eps * self._row
            d.qvel[:] = 0.0
            mujoco.mj_comVel(m, d)
            mujoco.mj_rne(m, d, 0, self._row)
            load -= (1.0 - eps) * self._row
        else:
            load -= self._row
        if self._springs:
            mujoco.mj_passive(m, d)
            load += d.qfrc_spring + d.qfrc_gravcomp
        if terms is not self._filled or self._springs:
            self._fill_yielding(terms)
            self._filled = terms
        if m.nu:
            _dense_moments(d, self._moment)
            load += self.drives.load(self.control, self._moment)
        if self._all_free:
            mujoco.mj_solveM(m, d, terms.fall[None], terms.load[None])
        else:
            fall_freely(terms, self.pace)

    def _fill_yielding(self, terms: Terms) -> None:
        """Springs and dampers of joints and tendons, which a step takes at its end."""
        m, d = self.model, self.data
        terms.damping[:] = self._damping
        terms.stiffness[:] = self._stiffness
        if m.ntendon and (m.tendon_damping.any() or m.tendon_stiffness.any()):
            rows = np.zeros((m.ntendon, m.nv))
            _dense_tendons(m, d, rows)
            low, high = m.tendon_lengthspring.T
            pulls = (d.ten_length < low) | (d.ten_length > high)
            terms.damping[:] += (rows.T * m.tendon_damping) @ rows
            terms.stiffness[:] += (rows.T * (m.tendon_stiffness * pulls)) @ rows

    def _fill_limited(self, rows: Reals, terms: Terms, loads: bool) -> None:
        """Rows of equalities, of dry friction, and of servos; lengths, as for contacts; `loads`: whether the
        rung has loads."""
        d, drive = self.data, self.drives
        ne, nf, ns = int(d.ne), int(d.nf), len(drive.servos)
        if ne + nf + ns == 0:
            return
        S = terms.limited
        S[: ne + nf] = rows[: ne + nf]
        S[ne + nf :] = self._moment[drive.servos]
        unit = _units(S, self.lever)
        S *= unit[:, None]
        terms.limit[:ne] = np.inf
        terms.limit[ne : ne + nf] = d.efc_frictionloss[ne : ne + nf] / unit[ne : ne + nf]
        terms.limit[ne + nf :] = drive.limit[drive.servos] / unit[ne + nf :]
        terms.account[:ne], terms.account[ne : ne + nf], terms.account[ne + nf :] = JOINT, SUPPORT, DRIVE
        terms.gains[:ne] = np.inf, 0.0
        terms.gains[ne : ne + nf] = 0.0
        terms.error[:ne, 0] = -d.efc_pos[:ne] * unit[:ne]
        terms.error[ne : ne + nf] = 0.0
        own = unit[ne + nf :]
        terms.gains[ne + nf :] = drive.gains / (own * own)[:, None]
        wish = drive.errors(self.control, d.actuator_length, loads)
        # K_p e + K_d v_d is what counts: all of it is put into the one that is there.
        stiff, damp = drive.gains.T
        with np.errstate(divide="ignore", invalid="ignore"):
            terms.error[ne + nf :, 0] = np.where(stiff > 0.0, wish / stiff, 0.0) * own
            terms.error[ne + nf :, 1] = np.where(stiff > 0.0, 0.0, wish / damp) * own

    def _fill_limits(self, rows: Reals, reach: float, count: int, terms: Terms) -> int:
        """Travel limits of joints and tendons, after `count` contacts: rows of one direction."""
        d, k, D = self.data, count, self.directions
        first = int(d.ne + d.nf)
        for r in range(first, first + int(d.nl)):
            row = rows[r]
            unit = float(_units(row[None], self.lever)[0])
            if d.efc_pos[r] * unit > reach or not (row[self.solids.free == 1] != 0.0).any():
                continue
            terms.rows[k * D : k * D + D] = 0.0
            terms.rows[k * D] = unit * row
            terms.gap[k], terms.lever[k] = unit * d.efc_pos[r], unit
            terms.friction[k] = terms.restitution[k] = 0.0
            terms.contact_stiffness[k], terms.contact_damping[k] = 0.0, 0.0
            terms.contact_stiffness[k, 0, 0] = np.inf
            slot = self.most + self.limits.slot(int(d.efc_type[r]), int(d.efc_id[r]), row)
            self._slots[k], self._fresh[k] = slot, 0
            k += 1
        return k


@dataclass(frozen=True)
class _Limits:
    """Slots of travel limits: two of each joint and tendon with a range."""

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

    def slot(self, kind: int, number: int, row: Reals) -> int:
        return self.keys[kind, number, int(row.sum() > 0.0)]


def moments(model: mujoco.MjModel, q: Reals) -> Reals:
    """What each actuator does to each velocity (a, n_v) at q."""
    import mujoco

    data, found = mujoco.MjData(model), np.zeros((model.nu, model.nv))
    data.qpos[:] = q
    mujoco.mj_fwdPosition(model, data)
    if model.nu:
        _dense_moments(data, found)
    return found


def _dense_moments(data: mujoco.MjData, found: Reals) -> None:
    import mujoco

    mujoco.mju_sparse2dense(
        found, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )


def directions(model: mujoco.MjModel) -> int:
    """Directions of the contacts of a model: 3, or 4 with torsion, or 6 with rolling friction as well."""
    dims = np.concatenate(
        [model.geom_condim[(model.geom_contype | model.geom_conaffinity) != 0], model.pair_dim]
    )
    most = int(dims.max(initial=3))
    return max(most, 3)


def _set_options(model: mujoco.MjModel) -> None:
    """What the rows need: one row per direction of a contact, in full."""
    import mujoco

    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    model.geom_gap[:], model.pair_gap[:] = 0.0, 0.0


def _of_unit_mass(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same bodies with mass 1 each and the same radii of gyration."""
    import copy

    unit = copy.copy(model)
    mass = np.where(model.body_mass > 0.0, model.body_mass, 1.0)
    unit.body_inertia[:] = model.body_inertia / mass[:, None]
    unit.body_mass[:] = np.where(model.body_mass > 0.0, 1.0, 0.0)
    unit.dof_armature[:] = 0.0
    unit.tendon_armature[:] = 0.0
    return unit


def _units(rows: Reals, lever: Reals) -> Reals:
    """Factors (r,) that make rows (r, n) lengths: a row of one translation keeps its unit."""
    most = np.abs(rows / lever).max(axis=1, initial=0.0)
    return np.asarray(1.0 / np.where(most > 0.0, most, 1.0))


def _dense_tendons(model: mujoco.MjModel, data: mujoco.MjData, rows: Reals) -> None:
    import mujoco

    if data.ten_J.shape == rows.shape:
        rows[:] = data.ten_J
        return
    mujoco.mju_sparse2dense(
        rows, data.ten_J.ravel(), model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    )
