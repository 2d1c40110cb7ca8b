"""Bodies of a MuJoCo model as a system that the core takes steps of (see `system.moving`).

MuJoCo gives places, inertia, loads, and rows of limits, equalities and tendons at (q, v), `patch` contacts;
all forces of contacts, limits, equalities, dry friction and servos are found by the models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals, RecordArray, steady
from rungwise.scene.space.laws import touching
from rungwise.system.entries import CROWDED
from rungwise.system.moving import LOOKS, SLIP, Crowded, Moment, Size
from rungwise.system.named_laws import laws_named
from rungwise.system.spatial.drives import Drives, drives
from rungwise.system.spatial.features import (
    FREE,
    Features,
    Seen,
    Solids,
    allocate_features,
    fill_contacts,
    least_gap,
)
from rungwise.system.spatial.limited import Limited
from rungwise.system.spatial.loads import Loads
from rungwise.system.spatial.passing import Passing, frames
from rungwise.system.spatial.patch.contacts import Contacts
from rungwise.system.spatial.reach import fastest_point, moved_by, reaches, vectors
from rungwise.system.spatial.resting import Resting
from rungwise.system.spatial.rotors import Rotors
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco


ROOM, SPARE, BEGINS = 16, 64, 1.5
"""Contacts that there is room for: so many for each geom that may touch something, and more; doubled until
they are so many times those of the start."""
CLOSINGS, SHUT = 10, 1e-12
"""Gauss-Newton steps at most in which equalities are closed, and by what part of the length they may be open
afterwards."""
AHEAD = 2.0
"""Contacts are looked for this many times farther than a step asks for, so that they are known for the next
ones as well."""
FALLEN = 32.0
"""Where contacts are looked for this many times farther than a step asks for, that becomes less: the nearer,
the fewer are found."""
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
    """A model at given controls (a,) and speeds (n,), nan where a velocity is free; both may change between
    steps. `place`, `motion` and `begun`, the activations (k,), are the start; `activation` (k,) are those at
    the start of a step, and `acting` (a,) is what actuators act by in it. `kept` are the features of the
    last step that was taken, and `found` those of the last `fill`."""

    model: mujoco.MjModel
    laws: Laws
    place: Reals
    motion: Reals
    control: Reals
    pace: Reals
    begun: Reals
    activation: Reals = field(init=False)
    acting: Reals = field(init=False)
    size: Size = field(init=False)
    kept: Features = field(init=False)
    found: Features = field(init=False)
    directions: int = field(init=False)

    def __post_init__(self) -> None:
        import mujoco

        self._mujoco = mujoco
        m = self.model
        _set_options(m)
        self.data = mujoco.MjData(m)
        self.directions = directions(m)
        self.reaches, self._vectors = reaches(m), vectors(m)
        self._lengths = np.zeros(len(self._vectors) - 1)
        self.passing = Passing(m, self.reaches)
        self.drives: Drives = drives(m)
        self.contacts = Contacts(m, self.data, self.passing.shapes)
        touches = touching(m)
        moving = touches & (m.body_weldid[m.geom_bodyid] != 0)
        self.room = ROOM * int(moving.sum()) + SPARE
        sizes = np.where(m.geom_rbound > 0.0, m.geom_rbound, np.inf)
        length = float(sizes[moving].min(initial=np.inf))
        length = length if math.isfinite(length) else float(self.reaches.max(initial=0.0)) or 1.0
        self.lever = self.reaches.max(axis=0, initial=0.0)
        self.lever[self.lever == 0.0] = length
        self.solids = Solids(
            body=m.geom_bodyid.astype(np.int64), size=sizes, law=self.laws.law, laws=self.laws.rows,
            free=np.isnan(self.pace).astype(np.int64), span=moved_by(m),
            centre=self.data.xpos, turn=self.data.xmat,
        )  # fmt: skip
        self._q: Reals | None = None
        self._least: float | None = None
        self._resting: Resting | None = None
        self._framed: mujoco.MjData | None = None
        self._near = AHEAD * NEAR * length
        self.look_within(self._near)
        self._at(self.place)
        while self.room < BEGINS * len(self._seen.dist):
            self.room *= 2
        # As many slots again: a contact may be new while the feature that it displaces still has its slot.
        self.most = 2 * self.room
        self.loads = Loads(m, self.drives)
        self._rotors = Rotors(m, self.loads.joined) if self.loads.any_joined else None
        self.limited = Limited(m, self.drives, self.lever, self.solids.free, self.most)
        slots, rows = self.most + len(self.limited.limits.keys), int(self.data.ne + self.data.nf)
        limited, thin = rows + len(self.drives.servos), SLIP * self.passing.thin
        crowded = m.nv >= CROWDED
        named = laws_named(self.laws.named, self._laws_of)
        self.size = Size(m.nq, m.nv, slots, self.directions, limited, length, thin, crowded, named, skewed(m))
        self._all_free = bool(self.solids.free.all())
        self.falls = np.where(self.solids.free, self.loads.falls, 0.0)
        self.activation = self.begun.copy()
        self.forget()
        self._fill_contacts, self._least_gap = steady(fill_contacts), steady(least_gap)
        self._fastest_point = steady(fastest_point)
        self._slots, self._fresh = np.zeros(slots, np.int64), np.zeros(slots, np.int64)

    def start(self) -> tuple[Reals, Reals]:
        return self.place, self.motion

    @property
    def driving(self) -> Reals:
        return self.loads.driving

    def speeds(self, _time: float) -> Reals:
        return self.pace

    def integrate(self, q: Reals, v: Reals, h: float) -> Reals:
        after = q.copy()
        self._mujoco.mj_integratePos(self.model, after, v, h)
        return after

    def least_gap(self, q: Reals) -> float:
        self._at(q)
        if self._least is None:
            self._least = self._least_gap(self._seen)
        return self._least

    def seen(self, q: Reals) -> Seen:
        """The contacts at q (n_q,) within `margin`."""
        self._at(q)
        return self._seen

    def overlaps(self, q: Reals) -> list[tuple[float, int, int]]:
        """Gap and geoms of each contact that overlaps."""
        self._at(q)
        seen = self._seen
        return [
            (float(gap), int(a), int(b))
            for gap, (a, b), row in zip(seen.dist, seen.geom, seen.address, strict=True)
            if gap < 0.0 and row >= 0
        ]

    def violations(self, q: Reals) -> list[tuple[float, int, int]]:
        """How far equalities are open and travel limits are passed (see `Limited.violations`)."""
        self._at(q)
        return self.limited.violations(self.data)

    def closed(self, q: Reals) -> Reals:
        """The place (n_q,) next to q at which equalities hold and no limit is passed, by Gauss-Newton steps;
        where there is none, near what comes nearest."""
        for _ in range(CLOSINGS):
            self._at(q)
            rows, by = self.limited.open(self.data)
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
        if self._q is None or q.tobytes() != self._q.tobytes():
            d = self._framed = self._framed or self._mujoco.MjData(self.model)
            d.qpos[:] = q
            self._mujoco.mj_kinematics(self.model, d)
        return np.hstack([d.xpos, d.xmat])

    def paces(self, q: Reals, v: Reals) -> Reals:
        """Speeds (b,) of the farthest points of bodies: of their centres of mass, and of turns about them."""
        if self._resting is None:
            self._resting = Resting(self.model)
        return self._resting.paces(q, v)

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
        return 2.0 * self._fastest_point(self.reaches, self._vectors, v, self._lengths)

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        deep = max(-self.least_gap(q), 0.0)
        if not self.passing.may_pass(self._seen, v, h, deep):
            return False
        begin, span, start = 0.0, 1.0, frames(self.data)
        for _ in range(LOOKS):
            end = min(1.0, begin + span)
            self.data.qpos[:] = after = self.integrate(q, v, h * end)
            self._mujoco.mj_kinematics(self.model, self.data)
            self._q, stop = np.full(len(q), np.nan), frames(self.data)
            clear = self.passing.is_clear(self._seen, v, h * (end - begin), deep, start, stop)
            if clear and end == 1.0:
                return False
            if clear:
                self._at(after)
                begin, start = end, stop
            span *= 2.0 if clear else 0.5
        return True

    def energy(self, q: Reals, v: Reals) -> float:
        momentum = np.zeros(self.model.nv)
        self.put_momentum(q, v, momentum)
        self._mujoco.mj_energyPos(self.model, self.data)
        with np.errstate(over="ignore", invalid="ignore"):
            energy = float(self.data.energy[0] + 0.5 * v @ momentum)
        return math.inf if math.isnan(energy) else energy  # of what has run away it is inf

    def put_momentum(self, q: Reals, v: Reals, momentum: Reals) -> None:
        """Fill momentum (n,) with M v at q."""
        self._at(q)
        self._mujoco.mj_mulM(self.model, self.data, momentum, v)

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
        self.kept, self.found = self.found, self.kept

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        d = self.data
        if reach > self.margin or FALLEN * reach < self.margin > self._near:
            self.look_within(max(AHEAD * reach, self._near))
        self._at(moment.q)
        self.loads.fill(d, moment, self.acting, self.pace, self._all_free, terms)
        self.limited.fill(d, self.loads.moment, self.acting, not moment.metric, terms)
        if self._rotors is not None and moment.inertia > 0.0:
            self._turn(self._rotors, moment, terms)
        count = self._fill_contacts(
            self._seen, self.solids, self.kept, self.found, reach, self.room, terms, self._slots, self._fresh
        )
        if count < 0:
            self.look_within(self._near)
            raise Crowded(
                f"scene: more than {self.room} contacts are within {reach:.3g} at once: there is room for"
                f" {ROOM} for each geom, or {BEGINS:g} times those of the start; begin nearer, or take"
                " simpler geoms"
            )
        known, count = count, self.limited.fill_limits(d, reach, count, terms, self._slots)
        self._fresh[known:count] = 0
        return self._slots[:count], self._fresh[:count]

    def _turn(self, rotors: Rotors, moment: Moment, terms: Terms) -> None:
        """Let inertial forces of joined bodies be those of a step's middle."""
        if rotors.fill(self.data, moment, self.pace, terms, self.loads.taken):
            self.loads.fall(self.data, self.pace, self._all_free, terms)

    def forget(self) -> None:
        """Know no contact, look for contacts as near as at first, and begin with the activations of the
        start."""
        self.activation[:] = self.begun
        self.expect(0.0)
        self.kept, self.found = allocate_features(self.most), allocate_features(self.most)
        self.look_within(self._near)

    def expect(self, h: float) -> None:
        """Let actuators act as they do at the end of a step of length h."""
        drives = self.drives
        self.acting = drives.acting(self.control, drives.activated(self.activation, self.control, h))

    def took(self, h: float) -> None:
        """Let activations go on by a step of length h that was taken."""
        self.activation[:] = self.drives.activated(self.activation, self.control, h)

    def look_within(self, margin: float) -> None:
        """Look for contacts within a distance from now on."""
        m, self.margin = self.model, margin
        if m.njnt:
            m.jnt_margin[:] = margin / self.lever[m.jnt_dofadr]
        m.tendon_margin[:] = margin
        self._q = None

    def _at(self, q: Reals) -> None:
        """Make MuJoCo's data those of q."""
        if self._q is None or (q is not self._q and q.tobytes() != self._q.tobytes()):
            m, d = self.model, self.data
            d.qpos[:] = q
            self._mujoco.mj_kinematics(m, d)
            self._mujoco.mj_comPos(m, d)
            self._mujoco.mj_tendon(m, d)
            self._mujoco.mj_makeM(m, d)
            self._mujoco.mj_factorM(m, d)
            self._mujoco.mj_makeConstraint(m, d)
            self._mujoco.mj_transmission(m, d)
            self._seen, self._least = self.contacts.within(self.margin), None
        self._q = q


def directions(model: mujoco.MjModel) -> int:
    """Directions of the contacts of a model: 3, or 4 with torsion, or 6 with rolling friction as well."""
    dims = np.concatenate([model.geom_condim[touching(model)], model.pair_dim])
    most = int(dims.max(initial=3))
    return max(most, 3)


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
