"""Bodies of a MuJoCo model as a system that the core takes steps of (see `system.moving`).

MuJoCo gives places, inertia, loads, and rows of limits, equalities and tendons at (q, v), `patch` contacts;
all forces of contacts, limits, equalities, dry friction and servos are found by the models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.contact.step import Widths
from rungwise.kernel import Ints, Reals, RecordArray, steady
from rungwise.scene.space.laws import touching
from rungwise.system.entries import CROWDED
from rungwise.system.moving import SLIP, Crowded, Moment, Size
from rungwise.system.named_laws import laws_named
from rungwise.system.spatial.drives import drives
from rungwise.system.spatial.features import FREE, Features, Seen, Solids, allocate_features, seen_in
from rungwise.system.spatial.limited import limit_count, limited, passed_rows, violations
from rungwise.system.spatial.loads import loads, unit_masses, with_unit_masses
from rungwise.system.spatial.mechanism import (
    AHEAD,
    Mechanism,
    Saved,
    energy_of,
    fill_terms,
    follow_controls,
    look_at_energy,
    look_within,
    may_go_through,
    put_at,
    put_momentum,
)
from rungwise.system.spatial.native import load
from rungwise.system.spatial.passing import rates
from rungwise.system.spatial.patch.contacts import Contacts
from rungwise.system.spatial.patch.shapes import Frames, shapes, thinnest
from rungwise.system.spatial.reach import fastest_point, kept_reaches, moved_by, vectors
from rungwise.system.spatial.resting import resting
from rungwise.system.spatial.rotors import rotors
from rungwise.system.spatial.turning import NUMBERS, allocate_turning
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco


ROOM, SPARE, BEGINS = 16, 64, 1.5
"""Contacts that there is room for: so many for each geom that may touch something, and more; doubled until
they are so many times those of the start."""
CLOSINGS, SHUT = 10, 1e-12
"""Gauss-Newton steps at most in which equalities are closed, and by what part of the length they may be open
afterwards."""
NEAR = 0.05
"""How far contacts are looked for at first, over the length of the smallest geom."""


class Laws(NamedTuple):
    """Laws of contact: law (g, g), the row for two geoms; rows (l, 8): normal and tangential stiffness and
    damping, restitution, and sliding, torsional and rolling friction, nan for the model's; named (l,): what
    scenes name besides (`scene.fields.laws.contact.RECORD`)."""

    law: Ints
    rows: Reals
    named: RecordArray


@dataclass
class Space:
    """A model at given `numbers` (a + n,): controls (a,), and speeds (n,), nan where a velocity is free; both
    may change between steps. `place`, `motion` and `begun`, the activations (k,), are the start; `activation`
    (k,) are those at the start of a step. `kept` are the features of the last step that was taken, and
    `found` those of the last `fill`."""

    model: mujoco.MjModel
    laws: Laws
    place: Reals
    motion: Reals
    numbers: Reals
    begun: Reals
    activation: Reals = field(init=False)
    size: Size = field(init=False)
    directions: int = field(init=False)

    def __post_init__(self) -> None:
        import mujoco

        load()
        self._mujoco = mujoco
        m = self.model
        _set_options(m)
        self.data = mujoco.MjData(m)
        self.directions = directions(m)
        span = moved_by(m)
        self.reaches = kept_reaches(m, span)
        made = shapes(m)
        thin, self.drives = thinnest(m, made), drives(m)
        self.contacts = Contacts(m, self.data, made)
        touches = touching(m)
        moving = touches & (m.body_weldid[m.geom_bodyid] != 0)
        sizes = np.where(m.geom_rbound > 0.0, m.geom_rbound, np.inf)
        length = float(sizes[moving].min(initial=np.inf))
        length = length if math.isfinite(length) else float(self.reaches.max(initial=0.0)) or 1.0
        self.lever = np.zeros(m.nv)
        for (first, end), own in zip(span, self.reaches, strict=True):
            self.lever[first:end] = np.maximum(self.lever[first:end], own[: end - first])
        self.lever[self.lever == 0.0] = length
        self.solids = Solids(
            body=m.geom_bodyid.astype(np.int64), size=sizes, law=self.laws.law, laws=self.laws.rows,
            free=np.isnan(self.pace).astype(np.int64), span=span,
            centre=self.data.xpos, turn=self.data.xmat,
        )  # fmt: skip
        self._framed: mujoco.MjData | None = None
        self._unit: tuple[mujoco.MjModel, mujoco.MjData] | None = None
        near = AHEAD * NEAR * length
        self.data.qpos[:] = self.place
        mujoco.mj_fwdPosition(m, self.data)
        room = ROOM * int(moving.sum()) + SPARE
        while room < BEGINS * len(self.contacts.within(near).dist):
            room *= 2
        # As many slots again: a contact may be new while the feature that it displaces still has its slot.
        self.room, self.most = room, 2 * room
        self.loads = loads(m, self.data, self.drives, self.pace)
        self.rotors = rotors(m, self.loads.joined)
        self.limited = limited(m, self.data, self.drives, self.lever, self.solids.free, self.most)
        slots, rows = self.most + limit_count(self.limited), int(self.data.ne + self.data.nf)
        self._features = allocate_features(self.most), allocate_features(self.most)
        self._slots, self._fresh = np.zeros(slots, np.int64), np.zeros(slots, np.int64)
        self._margin, self._near = np.array([near]), np.array([near])
        self._current, self._short, self._least = np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(1)
        self.activation, self._turn, self.turning = (
            self.begun.copy(),
            np.zeros(1, np.int64),
            allocate_turning(m, self.data),
        )
        self._make_mechanism()
        named = laws_named(self.laws.named, self._laws_of)
        self.size = Size(
            m.nq, m.nv, slots, self.directions, rows + len(self.drives.servos), length, SLIP * thin,
            widths(m, self.solids.span, self.loads.stretch) if m.nv >= CROWDED else None, named, skewed(m),
            self.room + limit_count(self.limited),
        )  # fmt: skip
        self.falls = self.loads.falls
        self._put_at, self._fill, self._passes = steady(put_at), steady(fill_terms), steady(may_go_through)
        self._fastest_point, self._energy = steady(fastest_point), steady(energy_of)
        self.forget()

    def _make_mechanism(self) -> None:
        """What kernels know, by the contacts' finder and the loads as they are now."""
        m, data, geoms = self.model, self.data, self.model.ngeom
        frames = [Frames(place=np.zeros((geoms, 3)), axes=np.zeros((geoms, 9))) for _ in range(2)]
        which, (one, other) = vectors(m), self._features
        own = [self._geoms_of(b) for b in range(m.nbody)]
        self.mechanism = Mechanism(
            address=self.loads.address, q=data.qpos, current=self._current, short=self._short,
            margin=self._margin, least=self._least, near=self._near, room=np.array([self.room]),
            joint_margin=m.jnt_margin, joint_lever=self.lever[m.jnt_dofadr], tendon_margin=m.tendon_margin,
            finder=self.contacts.finder, loads=self.loads, rotors=self.rotors, limited=self.limited,
            solids=self.solids, rates=rates(m, self.solids.span, self.reaches), reaches=self.reaches,
            vectors=which,
            one=one, other=other, turn=self._turn, numbers=self.numbers, activation=self.activation,
            expected=self.begun.copy(), place=data.xpos, axes=data.xmat,
            geoms=np.array([g for geoms in own for g in geoms], np.int64),
            firsts=np.cumsum([0, *map(len, own)]), resting=resting(m, data), turning=self.turning,
            saved=Saved(
                turn=np.zeros(1, np.int64), margin=np.zeros(1), activation=np.zeros(m.na),
                numbers=np.zeros(1, NUMBERS), velocity=np.zeros(m.nv),
            ),
            active=np.zeros(len(self._slots), np.int64), known=np.zeros(self.most, np.int64),
            energy=data.energy, momentum=np.zeros(m.nv), after=np.zeros(m.nq),
            lengths=np.zeros(m.nv), begun=frames[0], ended=frames[1],
        )  # fmt: skip

    @property
    def control(self) -> Reals:
        """Controls (a,)."""
        return self.numbers[: self.model.nu]

    @property
    def pace(self) -> Reals:
        """Speeds (n,), nan where a velocity is free."""
        return self.numbers[self.model.nu :]

    @property
    def kept(self) -> Features:
        """The features of the last step that was taken."""
        return self._features[int(self._turn[0])]

    @property
    def found(self) -> Features:
        """The features of the last `fill`."""
        return self._features[1 - int(self._turn[0])]

    def start(self) -> tuple[Reals, Reals]:
        return self.place, self.motion

    @property
    def driving(self) -> Reals:
        return self.loads.actuators.driving

    def speeds(self, _time: float) -> Reals:
        return self.pace

    def integrate(self, q: Reals, v: Reals, h: float) -> Reals:
        after = q.copy()
        self._mujoco.mj_integratePos(self.model, after, v, h)
        return after

    def least_gap(self, q: Reals) -> float:
        self._at(q)
        return float(self._least[0])

    def seen(self, q: Reals) -> Seen:
        """The contacts at q (n_q,) within `margin`."""
        self._at(q)
        return seen_in(self.contacts.finder.contacts)

    def overlaps(self, q: Reals) -> list[tuple[float, int, int]]:
        """Gap and geoms of each contact that overlaps."""
        seen = self.seen(q)
        return [
            (float(gap), int(a), int(b))
            for gap, (a, b), row in zip(seen.dist, seen.geom, seen.address, strict=True)
            if gap < 0.0 and row >= 0
        ]

    def violations(self, q: Reals) -> list[tuple[float, int, int]]:
        """How far equalities are open and travel limits are passed (see `limited.violations`)."""
        self._at(q)
        return violations(self.limited, self.data)

    def closed(self, q: Reals) -> Reals:
        """The place (n_q,) next to q at which equalities hold and no limit is passed, by Gauss-Newton steps;
        where there is none, near what comes nearest."""
        for _ in range(CLOSINGS):
            self._at(q)
            rows, by = passed_rows(self.limited, self.data)
            if not np.abs(by).max(initial=0.0) > SHUT * self.size.length:
                break
            q = self.integrate(q, np.asarray(-np.linalg.lstsq(rows, by, rcond=None)[0], float), 1.0)
        return q

    def gap(self, q: Reals, a: int, b: int) -> float:
        """The distance of two bodies, negative where they overlap: of their geoms that may touch something,
        or of all geoms of a body that has none."""
        self._at(q)
        pairs = ((i, j) for i in self._geoms_of(a) for j in self._geoms_of(b))
        return min((self.contacts.distance(i, j)[0] for i, j in pairs), default=math.inf)

    def frames(self, q: Reals) -> Reals:
        """Where bodies are at q (n_q,): their origins, and row by row the matrices of their axes (b, 12)."""
        d = self.data
        if not (self._current[0] and np.array_equal(q, d.qpos)):
            d = self._framed = self._framed or self._mujoco.MjData(self.model)
            d.qpos[:] = q
            self._mujoco.mj_kinematics(self.model, d)
        return np.hstack([d.xpos, d.xmat])

    def pushes(self, force: Reals) -> list[tuple[int, int, float]]:
        """Two bodies and the normal force of each contact, from forces by slot (s, d), normal first."""
        geoms, body = self.kept.geoms, self.solids.body
        return [
            (int(body[geoms[s, 0]]), int(body[geoms[s, 1]]), float(force[s, 0]))
            for s in np.flatnonzero(geoms[:, 0] >= 0)
            if force[s, 0] > 0.0
        ]

    def _geoms_of(self, body: int) -> list[int]:
        own = self.model.geom_bodyid == body
        solid = own & touching(self.model)
        return [int(g) for g in np.flatnonzero(solid if solid.any() else own)]

    def fastest(self, _q: Reals, v: Reals) -> float:
        return 2.0 * self._fastest_point(
            self.reaches, self.solids.span, self.mechanism.vectors, v, self.mechanism.lengths
        )

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        found = self._passes(self.mechanism, q, v, h)
        while self.makes_room():
            found = self._passes(self.mechanism, q, v, h)
        return bool(found)

    def begin(self, q: Reals, v: Reals) -> None:
        """A run begins at q and v."""
        look_at_energy(self.mechanism, q, v)

    def energy(self, q: Reals, v: Reals) -> float:
        self._at(q)
        return float(self._energy(self.mechanism, v))

    def put_momentum(self, q: Reals, v: Reals, momentum: Reals) -> None:
        """Fill momentum (n,) with M v at q."""
        self._at(q)
        put_momentum(self.mechanism, v, momentum)

    def geoms(self, slots: Ints) -> Ints:
        """Geoms (k, 2) of the contacts in these slots, as last seen; `FREE` where there is none."""
        seen = self.found.geoms[slots]
        return np.where(seen[:, :1] == FREE, self.kept.geoms[slots], seen)

    def _laws_of(self, slots: Ints) -> Ints:
        """The row of laws (k,) of the contacts in these slots in the last `fill`, 0 for travel limits."""
        own = np.where(slots < self.most, slots, 0)
        geoms = self.found.geoms[own]
        return np.where(slots < self.most, self.laws.law[geoms[:, 0], geoms[:, 1]], 0)

    def accept(self) -> None:
        self._turn[0] = 1 - self._turn[0]

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        count = self._fill(self.mechanism, moment, terms, reach, self._slots, self._fresh)
        while self.makes_room():
            count = self._fill(self.mechanism, moment, terms, reach, self._slots, self._fresh)
        if count < 0:
            raise self.crowded(reach)
        return self._slots[:count], self._fresh[:count]

    def crowded(self, reach: float) -> Crowded:
        """What says that there is no room for all contacts within reach."""
        return Crowded(
            f"scene: more than {self.room} contacts are within {reach:.3g} at once: there is room for"
            f" {ROOM} for each geom, or {BEGINS:g} times those of the start; begin nearer, or take"
            " simpler geoms"
        )

    def prepare(self, inertia: float) -> None:
        """A run begins that keeps this part of inertia, with terms of its own; without inertia they need the
        metric."""
        self.loads.joints.filled[0] = 0
        own = self.turning.numbers
        own[:] = np.zeros(1, NUMBERS)
        own["low"], own["high"], own["eps"] = math.inf, -math.inf, inertia
        own["counts"] = inertia > 0.0 and bool(self.loads.joined.any())
        if inertia == 0.0 and self._unit is None:
            self._unit = unit_masses(self.model)
            self.loads = with_unit_masses(self.loads, *self._unit)
            self._make_mechanism()

    def forget(self) -> None:
        """Know no contact, look for contacts as near as at first, and begin with the activations of the
        start."""
        self.activation[:] = self.begun
        follow_controls(self.mechanism, self.activation, 0.0, True)
        for features in self._features:
            features.geoms[:], features.used[0] = FREE, 0
            features.place[:] = features.along[:] = features.world[:] = 0.0
        self.look_within(float(self._near[0]))

    @property
    def margin(self) -> float:
        """The distance within which contacts are looked for."""
        return float(self._margin[0])

    def look_within(self, margin: float) -> None:
        """Look for contacts within a distance from now on."""
        look_within(self.mechanism, margin)

    def _at(self, q: Reals) -> None:
        """Make MuJoCo's data, and contacts, those of q."""
        while not self._put_at(self.mechanism, q):
            self.makes_room()

    def makes_room(self) -> bool:
        """Whether the finder had no room for all contacts; then there is room for twice as many."""
        if not self._short[0]:
            return False
        self._short[0] = 0
        self.contacts.give_room()
        self._make_mechanism()
        return True


def directions(model: mujoco.MjModel) -> int:
    """Directions of the contacts of a model: 3, or 4 with torsion, or 6 with rolling friction as well."""
    dims = np.concatenate([model.geom_condim[touching(model)], model.pair_dim])
    most = int(dims.max(initial=3))
    return max(most, 3)


def widths(model: mujoco.MjModel, moved: Ints, coupled: Ints) -> Widths:
    """Columns at most of a contact, whose bodies the velocities in the stretches moved (b, 2) may move, or of
    a limit, and of a row of matrices, in the stretches coupled (n, 2)."""
    m, rows = model, 2 * int((moved[:, 1] - moved[:, 0]).max(initial=0))
    for t in np.flatnonzero(m.tendon_limited):
        own = m.ten_J_colind[m.ten_J_rowadr[t] :][: m.ten_J_rownnz[t]]
        rows = max(rows, int(own.max() - own.min()) + 1) if len(own) else rows
    return Widths(min(rows, m.nv), int((coupled[:, 1] - coupled[:, 0]).max(initial=0)))


def skewed(model: mujoco.MjModel) -> bool:
    """Whether friction of contacts of a model may differ by direction."""
    one, other = model.pair_friction[:, 0], model.pair_friction[:, 1]
    return bool(((one != other) & (model.pair_dim > 1)).any())


def _set_options(model: mujoco.MjModel) -> None:
    """What the rows need: each in full."""
    import mujoco

    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
