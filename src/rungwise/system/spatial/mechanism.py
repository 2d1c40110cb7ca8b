"""Bodies of a MuJoCo model as the kernels of steps know them (see `system.contract`).

MuJoCo gives places, inertia, loads, and rows of limits, equalities and tendons at (q, v), `patch` contacts;
all forces of contacts, limits, equalities, dry friction and servos are found by the models.
"""

from __future__ import annotations

import math
from typing import Any

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, copy, inline, inner_kernel, kernel
from rungwise.system import contract
from rungwise.system.moving import LOOKS, OF_GAPS, OF_POSES, OF_WAYS, POSED, RESTS, Moment
from rungwise.system.spatial.features import Features, Solids, fill_contacts, least_gap
from rungwise.system.spatial.limited import Limited, fill_limited, fill_limits
from rungwise.system.spatial.loads import Loads, fill_loads, let_act
from rungwise.system.spatial.native import (
    DATA,
    MODEL,
    mj_comPos,
    mj_comVel,
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
from rungwise.system.spatial.passing import Rates, is_clear, may_pass
from rungwise.system.spatial.patch.contacts import Finder, look
from rungwise.system.spatial.patch.geoms import nearest
from rungwise.system.spatial.patch.shapes import Frames
from rungwise.system.spatial.reach import fastest_point
from rungwise.system.spatial.resting import Resting, pace
from rungwise.system.spatial.rotors import Rotors, turn_joined
from rungwise.system.spatial.turning import Turning, change, gain, keep_joined, take_energy
from rungwise.system.terms import Terms

AHEAD = 2.0
"""Contacts are looked for this many times farther than a step asks for, so that they are known for the next
ones as well."""
FALLEN = 32.0
"""Where contacts are looked for this many times farther than a step asks for, that becomes less: the nearer,
the fewer are found."""


class Saved(Block):
    """What a step changes: which features are the last step's, how far contacts are looked for, activations
    (k,), and of turns the numbers (1,) and velocities (n,)."""

    turn: Ints
    margin: Reals
    activation: Reals
    numbers: RecordArray
    velocity: Reals


class Mechanism(Block):
    """A model as kernels know it. address (2,) of the model and its data; q (n_q,), the place of these, and
    whether contacts and all else are of that place, `current` (1,); whether there was no room for contacts in
    the finder, `short` (1,); contacts are looked for within `margin` (1,), the
    least gap of these is `least` (1,), and `near` (1,) is the margin at first; room (1,) for contacts.

    numbers (a + n,): controls, and speeds, nan where a velocity is free; activation (k,): at the start of a
    step, and `expected` at its end. Of bodies: place, axes (b, 3; b, 9), in MuJoCo's memory, and which geoms
    their distances are those of: geoms (k,), of each from firsts (b + 1,) on.

    Margins of joints (j,) and tendons (t,) are in MuJoCo's memory; joint_lever (j,) is that of each joint.
    `one` and `other` are the features of the last step that was taken and those of the last `fill`, the other
    way round where `turn` (1,) says so (see `kept_in`, `found_in`); `saved` is what `keep` keeps; after
    (n_q,), slots that are `active` or `known` (s,), momentum, lengths (n,) and the geoms' frames `begun`
    and `ended` are scratch; `energy` (2,) is in MuJoCo's memory.
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
    one: Features
    other: Features
    turn: Ints
    numbers: Reals
    activation: Reals
    expected: Reals
    place: Reals
    axes: Reals
    geoms: Ints
    firsts: Ints
    resting: Resting
    turning: Turning
    saved: Saved
    active: Ints
    known: Ints
    energy: Reals
    momentum: Reals
    after: Reals
    lengths: Reals
    begun: Frames
    ended: Frames


@inline
def kept_in(m: Mechanism) -> Features:
    """The features of the last step that was taken."""
    return m.one if m.turn[0] == 0 else m.other


@inline
def found_in(m: Mechanism) -> Features:
    """The features of the last `fill`."""
    return m.other if m.turn[0] == 0 else m.one


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
    kept, found = kept_in(m), found_in(m)
    known = fill_contacts(m.finder.contacts, m.solids, kept, found, reach, m.room[0], terms, slots, fresh)
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


@contract.fill_speeds.given_by(Mechanism)
@kernel
def fill_paces(m: Mechanism, _time: float, speeds: Reals) -> None:
    copy(m.numbers[len(m.numbers) - len(speeds) :], speeds)


@contract.follow.given_by(Mechanism)
@kernel
def follow_controls(m: Mechanism, _values: Reals, h: float, ends: bool) -> None:
    """Let actuators act as they do at the end of a step of length h."""
    if ends:
        let_act(m.loads.actuators, m.numbers, m.activation, h, m.expected)


@contract.lacks_room.given_by(Mechanism)
@kernel
def is_short(m: Mechanism) -> bool:
    return bool(m.short[0] != 0)


@contract.until_edge.given_by(Mechanism)
@kernel
def step_of(_m: Mechanism, trial: Any) -> float:
    return float(trial.h)


@contract.accept.given_by(Mechanism)
@kernel
def accept_step(m: Mechanism, q: Reals, v: Reals, trial: Any) -> None:
    """Let activations go on, and account for the energy of joined bodies."""
    m.turn[0] = 1 - m.turn[0]
    let_act(m.loads.actuators, m.numbers, m.activation, trial.h, m.activation)
    t = m.turning
    if t.numbers[0].counts:
        before = t.numbers[0].kinetic + t.numbers[0].height
        copy(t.new, t.old)
        look_at_energy(m, q, v)
        M, stretches = trial.terms.inertia, trial.terms.entries.matrices
        work = change(M, stretches, m.loads.taken, t.old, t.new, t.numbers[0].eps, trial.h)
        gain(t, before, work)


@kernel
def look_at_energy(m: Mechanism, q: Reals, v: Reals) -> None:
    """Take over the energy of joined bodies at q and v, where a step begins or has led."""
    t = m.turning
    if t.numbers[0].counts:
        keep_joined(v, m.loads.joined, t.new)
        put_at(m, q)
        put_momentum(m, t.new, t.momentum)
        take_energy(t, m.loads.weighs)


@contract.keep.given_by(Mechanism)
@kernel
def keep_state(m: Mechanism) -> None:
    m.saved.turn[0], m.saved.margin[0] = m.turn[0], m.margin[0]
    copy(m.activation, m.saved.activation)
    m.saved.numbers[0] = m.turning.numbers[0]
    copy(m.turning.new, m.saved.velocity)


@contract.take_back.given_by(Mechanism)
@kernel
def take_back_state(m: Mechanism) -> None:
    m.turn[0] = m.saved.turn[0]
    copy(m.saved.activation, m.activation)
    m.turning.numbers[0] = m.saved.numbers[0]
    copy(m.saved.velocity, m.turning.new)
    if m.margin[0] != m.saved.margin[0]:
        look_within(m, m.saved.margin[0])


@contract.tell_values.given_by(Mechanism)
@kernel
def tell_values(m: Mechanism, asked: Any, q: Reals, v: Reals, values: Reals) -> bool:
    known = put_at(m, q)
    if asked.reads[POSED]:
        first, wide = asked.firsts[OF_POSES], 12
        for b in range(len(m.place)):
            for i in range(3):
                values[first + wide * b + i] = m.place[b, i]
            for i in range(9):
                values[first + wide * b + 3 + i] = m.axes[b, i]
    for k in range(len(asked.place)):
        values[asked.firsts[OF_GAPS] + asked.place[k]] = gap_of(m, asked.pairs[k, 0], asked.pairs[k, 1])
    if asked.reads[RESTS]:
        copy(v, m.loads.v)
        mj_comVel(m.address[MODEL], m.address[DATA])
        first = asked.firsts[OF_WAYS]
        for b in range(len(m.place)):
            values[first + b] = asked.step[0] * (pace(m.resting, b) if b > 0 else 0.0)
    return known


@kernel
def gap_of(m: Mechanism, a: int, b: int) -> float:
    """The distance of two bodies, negative where they overlap, where the data are."""
    f, least = m.finder, math.inf
    for i in range(m.firsts[a], m.firsts[a + 1]):
        for j in range(m.firsts[b], m.firsts[b + 1]):
            gap = nearest(m.geoms[i], m.geoms[j], math.inf, f.shapes, f.fields, f.frames, f.scratch, f.near)
            least = min(least, gap)
    return least


@contract.hear.given_by(Mechanism)
@kernel
def hear(m: Mechanism, asked: Any, force: Reals, h: float, values: Reals) -> None:
    first, count = asked.firsts[OF_GAPS], asked.contacts[0]
    kept, body = kept_in(m), m.solids.body
    for s in range(kept.used[0] if len(asked.place) > 0 else 0):
        push = force[s, 0]
        if push > 0.0 and kept.geoms[s, 0] >= 0:
            one, other = body[kept.geoms[s, 0]], body[kept.geoms[s, 1]]
            for k in range(len(asked.place)):
                if asked.pairs[k, 0] == min(one, other) and asked.pairs[k, 1] == max(one, other):
                    values[first + count + asked.place[k]] += push
                    values[first + 2 * count + asked.place[k]] += h * push


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
