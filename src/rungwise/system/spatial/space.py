"""Bodies of a MuJoCo model as a system that the core takes steps of (see `system.moving`).

MuJoCo gives places, inertia, loads, and rows of limits, equalities and tendons at (q, v), `patch` contacts;
all forces of contacts, limits, equalities, dry friction and servos are found by the models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import Widths
from rungwise.kernel import Ints, Reals, RecordArray, copy, inner_kernel, kernel, steady
from rungwise.scene.space.laws import touching
from rungwise.system import contract
from rungwise.system.entries import CROWDED
from rungwise.system.moving import LOOKS, SLIP, Crowded, Moment, Size
from rungwise.system.named_laws import laws_named
from rungwise.system.spatial.drives import drives
from rungwise.system.spatial.features import (
    FREE,
    Features,
    Seen,
    Solids,
    allocate_features,
    fill_contacts,
    least_gap,
    seen_in,
)
from rungwise.system.spatial.limited import (
    Limited,
    fill_limited,
    fill_limits,
    limit_count,
    limited,
    passed_rows,
    violations,
)
from rungwise.system.spatial.loads import Loads, fill_loads, let_act, loads, unit_masses, with_unit_masses
from rungwise.system.spatial.native import (
    DATA,
    MODEL,
    load,
    mj_comPos,
    mj_energyPos,
    mj_factorM,
    mj_integratePos,
    mj_kinematics,
    mj_makeConstraint,
    mj_makeM,
    mj_mulM,
    mj_tendon,
    mj_transmission,
)
from rungwise.system.spatial.passing import Rates, is_clear, may_pass, rates
from rungwise.system.spatial.patch.contacts import Contacts, Finder, look
from rungwise.system.spatial.patch.shapes import Frames, shapes, thinnest
from rungwise.system.spatial.reach import fastest_point, kept_reaches, moved_by, vectors
from rungwise.system.spatial.resting import Resting
from rungwise.system.spatial.rotors import Rotors, rotors, turn_joined
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


class Mechanism(Block):
    """A model as kernels know it. address (2,) of the model and its data; q (n_q,), the place of these, and
    whether contacts and all else are of that place, `current` (1,); whether there was no room for contacts in
    the finder, `short` (1,); contacts are looked for within `margin` (1,), the
    least gap of these is `least` (1,), and `near` (1,) is the margin at first; room (1,) for contacts.

    Margins of joints (j,) and tendons (t,) are in MuJoCo's memory; joint_lever (j,) is that of each joint.
    `kept` are the features of the last step that was taken, `found` those of the last `fill`; after (n_q,),
    momentum, lengths (n,) and the geoms' frames `begun` and `ended` are scratch; `energy` (2,) is in
    MuJoCo's memory.
    """

    address: Ints
    q: Reals
    current: Ints
    short: Ints
    margin: Reals
    least: Reals
    near: Reals
    room: Ints
    joint_margin: Reals
    joint_lever: Reals
    tendon_margin: Reals
    finder: Finder
    loads: Loads
    rotors: Rotors
    limited: Limited
    solids: Solids
    rates: Rates
    reaches: Reals
    vectors: Ints
    kept: Features
    found: Features
    energy: Reals
    momentum: Reals
    after: Reals
    lengths: Reals
    begun: Frames
    ended: Frames


@dataclass
class Space:
    """A model at given controls (a,) and speeds (n,), nan where a velocity is free; both may change between
    steps. `place`, `motion` and `begun`, the activations (k,), are the start; `activation` (k,) are those at
    the start of a step. `kept` are the features of the last step that was taken, and `found` those of the
    last `fill`."""

    model: mujoco.MjModel
    laws: Laws
    place: Reals
    motion: Reals
    control: Reals
    pace: Reals
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
        self._resting: Resting | None = None
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
        self._make_mechanism()
        named = laws_named(self.laws.named, self._laws_of)
        self.size = Size(
            m.nq, m.nv, slots, self.directions, rows + len(self.drives.servos), length, SLIP * thin,
            widths(m, self.solids.span, self.loads.stretch) if m.nv >= CROWDED else None, named, skewed(m),
            self.room + limit_count(self.limited),
        )  # fmt: skip
        self.falls = self.loads.falls
        self.activation = self.begun.copy()
        self._let_act, self._expected = steady(let_act), self.begun.copy()
        self._put_at, self._fill, self._passes = steady(put_at), steady(fill_terms), steady(may_go_through)
        self._fastest_point, self._energy = steady(fastest_point), steady(energy_of)
        self.forget()

    def _make_mechanism(self) -> None:
        """What kernels know, by the contacts' finder and the loads as they are now."""
        m, data, geoms = self.model, self.data, self.model.ngeom
        frames = [Frames(place=np.zeros((geoms, 3)), axes=np.zeros((geoms, 9))) for _ in range(2)]
        which, (one, other) = vectors(m), self._features
        same: dict[str, Any] = {
            "address": self.loads.address, "q": data.qpos, "current": self._current, "short": self._short,
            "margin": self._margin, "least": self._least, "near": self._near,
            "room": np.array([self.room]), "joint_margin": m.jnt_margin,
            "joint_lever": self.lever[m.jnt_dofadr], "tendon_margin": m.tendon_margin,
            "finder": self.contacts.finder, "loads": self.loads, "rotors": self.rotors,
            "limited": self.limited, "solids": self.solids, "rates": rates(m, self.solids.span, self.reaches),
            "reaches": self.reaches, "vectors": which,
        }  # fmt: skip
        rest: dict[str, Any] = {
            "energy": data.energy, "momentum": np.zeros(m.nv), "after": np.zeros(m.nq),
            "lengths": np.zeros(m.nv), "begun": frames[0], "ended": frames[1],
        }  # fmt: skip
        self.mechanism = Mechanism(**same, kept=one, found=other, **rest)
        self._turned = Mechanism(**same, kept=other, found=one, **rest)

    @property
    def kept(self) -> Features:
        """The features of the last step that was taken."""
        return self.mechanism.kept

    @property
    def found(self) -> Features:
        """The features of the last `fill`."""
        return self.mechanism.found

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
        return 2.0 * self._fastest_point(
            self.reaches, self.solids.span, self.mechanism.vectors, v, self.mechanism.lengths
        )

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        found = self._passes(self.mechanism, q, v, h)
        while self.makes_room():
            found = self._passes(self.mechanism, q, v, h)
        return bool(found)

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
        self.mechanism, self._turned = self._turned, self.mechanism
        self._features = self._features[1], self._features[0]

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
        if inertia == 0.0 and self._unit is None:
            self._unit = unit_masses(self.model)
            self.loads = with_unit_masses(self.loads, *self._unit)
            self._make_mechanism()

    def forget(self) -> None:
        """Know no contact, look for contacts as near as at first, and begin with the activations of the
        start."""
        self.activation[:] = self.begun
        self.expect(0.0)
        for features in self._features:
            features.geoms[:], features.used[0] = FREE, 0
            features.place[:] = features.along[:] = features.world[:] = 0.0
        self.look_within(float(self._near[0]))

    def expect(self, h: float) -> None:
        """Let actuators act as they do at the end of a step of length h."""
        self._let_act(self.loads.actuators, self.control, self.activation, h, self._expected)

    def took(self, h: float) -> None:
        """Let activations go on by a step of length h that was taken."""
        self._let_act(self.loads.actuators, self.control, self.activation, h, self.activation)

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


@kernel
def look_within(m: Mechanism, margin: float) -> None:
    """See `Space.look_within`."""
    m.margin[0], m.current[0] = margin, 0
    for j in range(len(m.joint_margin)):
        m.joint_margin[j] = margin / m.joint_lever[j]
    for t in range(len(m.tendon_margin)):
        m.tendon_margin[t] = margin


@kernel
def put_at(m: Mechanism, q: Reals) -> bool:
    """Make MuJoCo's data, and contacts, those of q (n_q,); False where there is no room for these."""
    same = m.current[0] != 0
    for i in range(len(q)):
        same &= m.q[i] == q[i]
    if same:
        return True
    model, data = m.address[MODEL], m.address[DATA]
    copy(q, m.q)
    mj_kinematics(model, data)
    mj_comPos(model, data)
    mj_tendon(model, data)
    mj_makeM(model, data)
    mj_factorM(model, data)
    mj_makeConstraint(model, data)
    mj_transmission(model, data)
    m.current[0] = look(m.margin[0], m.finder)
    m.short[0] = 1 - m.current[0]
    m.least[0] = least_gap(m.finder.contacts)
    return bool(m.current[0] != 0)


@kernel
def fill_terms(m: Mechanism, moment: Moment, terms: Terms, reach: float, slots: Ints, fresh: Ints) -> int:
    """Fill terms, and the slots of contacts and whether each is new; returns how many there are, or a number
    below 0 where there is no room for all."""
    margin, near = m.margin[0], m.near[0]
    if reach > margin or FALLEN * reach < margin > near:
        look_within(m, max(AHEAD * reach, near))
    if not put_at(m, moment.q):
        return -1
    fill_loads(m.loads, moment, terms)
    fill_limited(m.limited, m.loads.actuators, not moment.metric, terms)
    if moment.inertia > 0.0 and len(m.rotors.trees) > 0:
        turn_joined(m.rotors, m.loads, moment, terms)
    known = fill_contacts(m.finder.contacts, m.solids, m.kept, m.found, reach, m.room[0], terms, slots, fresh)
    if known < 0:
        look_within(m, near)
        return -1
    count = fill_limits(m.limited, reach, known, terms, slots)
    for k in range(known, count):
        fresh[k] = 0
    return count


@kernel
def put_momentum(m: Mechanism, v: Reals, momentum: Reals) -> None:
    """Fill momentum (n,) with M v, where the data are."""
    mj_mulM(m.address[MODEL], m.address[DATA], momentum.ctypes.data, v.ctypes.data)


@kernel
def energy_of(m: Mechanism, v: Reals) -> float:
    """The energy at velocities v (n,), where the data are; inf of what has run away."""
    put_momentum(m, v, m.momentum)
    mj_energyPos(m.address[MODEL], m.address[DATA])
    energy = m.energy[0]
    for i in range(len(v)):
        energy += 0.5 * v[i] * m.momentum[i]
    return math.inf if math.isnan(energy) else float(energy)


@contract.fill.given_by(Mechanism)
@kernel
def fill_for_step(
    m: Mechanism, moment: Moment, terms: Terms, reach: float, slots: Ints, fresh: Ints, driving: Reals
) -> int:
    count = fill_terms(m, moment, terms, reach, slots, fresh)
    copy(m.loads.actuators.driving, driving)
    return count


@contract.integrate.given_by(Mechanism)
@kernel
def integrate(m: Mechanism, q: Reals, v: Reals, h: float, after: Reals) -> None:
    copy(q, after)
    mj_integratePos(m.address[MODEL], after.ctypes.data, v.ctypes.data, h)


@contract.least_gap.given_by(Mechanism)
@kernel
def least_gap_at(m: Mechanism, q: Reals) -> float:
    put_at(m, q)
    return float(m.least[0])


@contract.fastest.given_by(Mechanism)
@kernel
def fastest_at(m: Mechanism, _q: Reals, v: Reals) -> float:
    return 2.0 * fastest_point(m.reaches, m.solids.span, m.vectors, v, m.lengths)


@contract.tell_laws.given_by(Mechanism)
@kernel
def tell_no_laws(_m: Mechanism, _trial: Any, _at_start: bool) -> None:
    """A model whose contacts have further laws is stepped in plain Python."""


@contract.passes.given_by(Mechanism)
@kernel
def may_go_through(m: Mechanism, q: Reals, v: Reals, h: float) -> bool:
    """Whether v may lead anything through another within h of q (n_q,), where the data are."""
    model, data, contacts, shapes = m.address[MODEL], m.address[DATA], m.finder.contacts, m.finder.shapes
    if not put_at(m, q):
        return True
    deep = max(-m.least[0], 0.0)
    if not may_pass(contacts, shapes, m.rates, v, h, deep):
        return False
    first, span = 0.0, 1.0
    _take_frames(m, m.begun)
    for _ in range(LOOKS):
        end = min(1.0, first + span)
        integrate(m, q, v, h * end, m.after)
        copy(m.after, m.q)
        m.current[0] = 0
        mj_kinematics(model, data)
        _take_frames(m, m.ended)
        clear = is_clear(contacts, shapes, m.rates, v, h * (end - first), deep, m.begun, m.ended)
        if clear and end == 1.0:
            return False
        if clear:
            if not put_at(m, m.after):
                return True
            first = end
            _take_frames(m, m.begun)
        span *= 2.0 if clear else 0.5
    return True


@inner_kernel
def _take_frames(m: Mechanism, frames: Frames) -> None:
    copy(m.finder.geom_place, frames.place)
    copy(m.finder.geom_axes, frames.axes)


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
