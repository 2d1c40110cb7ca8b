"""One attempt at a step of any system: its terms, their solution, the motion, and a look at the gaps there.

`attempt` asks the system for terms, solves (`core.step.solve_step`, which assembles the rung's problem and
chooses inertia and restitution), moves, and looks at the gaps; where gaps are not linear over the step, it
solves again from there.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import ContactProblem, stretch
from rungwise.kernel import (
    Ints,
    Reals,
    RecordArray,
    copy,
    inline,
    inner_kernel,
    kernel,
    record_type,
    system_kernel,
)
from rungwise.simulation.core.balance import ask_speeds
from rungwise.simulation.core.crawl import FAR, INSOLUBLE, OVERLAPPING
from rungwise.simulation.core.held import keep_near, pushes_far, solve_alone, vanishes
from rungwise.simulation.core.state import Scratch, State, Trial
from rungwise.simulation.core.step import SUPPORTED, UNSOLVED, UNSUPPORTED, solve_step
from rungwise.simulation.core.tolerances import DRIVEN, LINEARISATIONS, NEAR
from rungwise.simulation.core.update_state import fill_pace, take_slots
from rungwise.simulation.stepping.overlap import least_allowed, open_added
from rungwise.simulation.watched.inputs import Inputs
from rungwise.simulation.watched.values import Watched
from rungwise.system.contract import fastest, fill, integrate, least_gap, passes, tell_laws
from rungwise.system.entries import rate
from rungwise.system.moving import Moment, Size
from rungwise.system.terms import INERTIA, METRIC, Terms

HALTED, CROWDED = 3, 4
"""Statuses beside SUPPORTED, UNSUPPORTED and UNSOLVED: the step is to be given up; and more contacts than
there is room for are within reach of a short step."""
ROUNDED = 4
"""Linearisations on the rungs with forces, where bodies that roll would overlap by curvature; chosen by
trial."""
SEEN = 2.0
"""Distance within which contacts are looked for, over the farthest motion in the step."""
ON_TIME = 1e-12
"""Part of the time until a contact closes that is rounding."""
STUCK = 1e-3
"""Motion over the system's length in a step: below this a step without solution has none, however short."""
NOTE = record_type(
    "contacts cause count follows falls outran leaps",
    "length thin reach deep leaping far allowed within resumed step",
)
"""What is known of a system and of the last attempt. contacts: of the terms; cause: see `core.crawl`; count:
of linearisations; follows: whether free bodies fall along parabolas, and `falls` whether any may; outran:
whether a step was refused because things move too far in it, by `far`. length and thin: see `Size`; reach of
the last terms; deep: how deep things overlap where the step begins; leaping: how far a step without momentum
leapt, and how many `leaps` there were in the run; allowed: what it may leave open; within: the greatest gap
at which a contact pulls, -inf without one; resumed: the length at which the search for the length of a step
goes on, 0 where it begins; step: the nominal one."""


class Attempt(Block):
    """note (1,); clock (k,): the state's numbers; q (n_q,) where steps begin, and `trial` (n_q,), where
    the velocities of the attempt lead; v (n,): these, or how fast things would move if the attempt is
    refused; fell (n,): what weight gave them; falls (n,): accelerations by weight; slots, fresh (s,): of the
    contacts of the terms; places (k, n_q) and ways (k, n): where terms were linearised, and the velocities
    that led there. leapt, ran (3 + n,): of the first leap, and of the first step that was refused because
    things move too far in it: time, length, how far as a length, and the motion. pace, led, fastest, solved,
    asked (n,) are scratch."""

    note: RecordArray
    clock: Reals
    q: Reals
    trial: Reals
    v: Reals
    fell: Reals
    falls: Reals
    slots: Ints
    fresh: Ints
    places: Reals
    ways: Reals
    leapt: Reals
    ran: Reals
    pace: Reals
    led: Reals
    fastest: Reals
    solved: Reals
    asked: Reals


def allocate_attempt(size: Size, clock: Reals, falls: Reals, within: float, step: float) -> Attempt:
    """Of a system with this clock (k,), which weight gives accelerations falls (n_v,) and whose contacts pull
    within a gap, in steps of this length."""
    n, n_q = size.velocities, size.coordinates
    note = np.zeros(1, NOTE)
    note["length"], note["thin"], note["within"] = size.length, size.thin, within
    note["step"] = step
    note["falls"] = bool(falls.any())
    return Attempt(
        note=note, clock=clock, q=np.zeros(n_q),
        trial=np.zeros(n_q), v=np.zeros(n), fell=np.zeros(n), falls=falls.copy(),
        slots=np.zeros(size.slots, np.int64), fresh=np.zeros(size.slots, np.int64),
        places=np.zeros((LINEARISATIONS, n_q)), ways=np.zeros((LINEARISATIONS, n)), leapt=np.zeros(3 + n),
        ran=np.zeros(3 + n), pace=np.zeros(n),
        led=np.zeros(n), fastest=np.zeros(n), solved=np.zeros(n), asked=np.zeros(n),
    )  # fmt: skip


class Setting(NamedTuple):
    """What steps of a run are taken with; the `inputs` write into the `buffer` of the scene's numbers."""

    rung: RecordArray
    terms: Terms
    state: State
    scratch: Scratch
    problem: ContactProblem
    attempt: Attempt
    watched: Watched
    inputs: Inputs
    buffer: Reals


@inline
def trial_of(s: Setting, h: float) -> Trial:
    """The step of length h with the terms that there are."""
    return Trial(s.rung, h, s.terms, s.attempt.note[0].contacts, s.state, s.scratch, s.problem)


@system_kernel
def attempt(system: Any, s: Setting, h: float) -> int:
    """The status of a step of length h; see `Attempt` for what it comes to."""
    rung, state, scratch, a = s.rung[0], s.state, s.scratch, s.attempt
    note, at_start, reach = a.note[0], True, reach_of(system, s, h)
    note.cause, note.leaping, note.count = INSOLUBLE, 0.0, 0
    state.clock[0].tried = h
    before = -math.inf if rung.compliant else least_gap(system, a.q)
    copy(a.q, a.trial)
    copy(state.v, a.led)
    for i in range(len(a.v)):
        a.fastest[i] = abs(state.v[i])
    for _ in range(LINEARISATIONS if rung.metric else ROUNDED):
        status = fill_terms(system, s, h, reach, at_start)
        if status != SUPPORTED:
            note.cause = FAR
            for i in range(len(a.v)):
                a.v[i] = max(abs(a.pace[i]), a.fastest[i])
            return status
        status = _solve(s, h)
        if status != SUPPORTED:
            copy(state.v, a.v)
            return status
        way = h * fastest(system, a.q, scratch.v_new)
        if at_start and _leads_far(s, way):
            status = _walk(system, s, h, way, reach)
            if status != SUPPORTED:
                return status
        if way > reach:
            reach = SEEN * way
            for i in range(len(a.v)):
                a.pace[i] = abs(scratch.v_new[i])
            continue
        _note_place(a)
        for i in range(len(a.v)):
            a.v[i] = scratch.v_new[i]
            a.fastest[i] = max(a.fastest[i], abs(a.v[i]))
        _let_fall(system, s, h)
        if way > note.thin and passes(system, a.q, a.led, h):
            break
        integrate(system, a.q, a.led, h, a.trial)
        if _fits(system, s, h, way, before):
            return SUPPORTED
        if at_start:
            note.deep, at_start = _deepest(s), False
    note.cause = OVERLAPPING
    copy(a.fastest, a.v)
    return UNSOLVED


@inner_kernel
def _note_place(a: Attempt) -> None:
    """Note where the last terms were linearised."""
    count = a.note[0].count
    copy(a.trial, a.places[count])
    copy(a.led, a.ways[count])
    a.note[0].count = count + 1


@kernel
def _deepest(s: Setting) -> float:
    """How deep things overlap by the gaps of the terms."""
    deepest = 0.0
    for k in range(s.attempt.note[0].contacts):
        deepest = max(deepest, -s.terms.gap[k])
    return deepest


@kernel
def _solve(s: Setting, h: float) -> int:
    """Solve the step of length h from the terms that there are."""
    status = solve_step(trial_of(s, h))
    return HALTED if s.scratch.halt[0] != 0 else status


@inner_kernel
def _leads_far(s: Setting, way: float) -> bool:
    """Whether a step without momentum goes so far that it may leap."""
    rung = s.rung[0]
    return bool(rung.inertia == 0.0 and rung.loads and way > NEAR * s.attempt.note[0].length)


@system_kernel
def _walk(system: Any, s: Setting, h: float, way: float, reach: float) -> int:
    """Whether balance is held along the way of a step without momentum that was just solved, of length h:
    SUPPORTED with its solution as it was, or another status and how fast things would move.

    What nothing holds where the step begins would come to rest against whatever lies in its way, however
    far. So the contacts that are closed, or that driven motion closes in the step, have to balance the
    loads alone. A motion that vanishes with the step is taken in steps no longer than the smallest thing,
    unless servos lead it: their speed bounds it. One that does not leads out of balance: it settles, because
    loads or drives have jumped, or goes on (`Stepper.snaps_on`).
    """
    state, scratch, a = s.state, s.scratch, s.attempt
    note = a.note[0]
    copy(scratch.v_new, a.solved)
    driven, near = h * fastest(system, a.q, state.speed), NEAR * note.length
    ask_speeds(trial_of(s, h), a.asked)
    asked = h * fastest(system, a.q, a.asked)
    lone = pushes_far(trial_of(s, h), near)
    if lone:
        note.contacts = keep_near(trial_of(s, h), near)
        status = solve_alone(trial_of(s, h))
        if scratch.halt[0] != 0:
            return HALTED
        if status != SUPPORTED:
            held = driven < STUCK * note.length
            copy(state.v if held else state.speed, a.v)
            return UNSUPPORTED if held else UNSOLVED
        fill_terms(system, s, h, reach, True)
    far = way > max(2.0 * note.length, DRIVEN * driven)
    if far:
        goes = vanishes(trial_of(s, h))
        if scratch.halt[0] != 0:
            return HALTED
        if goes and way > DRIVEN * asked:
            note.outran, note.far, note.cause = 1, 0.5 * way, FAR
            copy(a.solved, a.v)
            return UNSOLVED
        note.leaping = 0.0 if goes else 0.5 * way
    if (far or lone) and _solve(s, h) == HALTED:
        return HALTED
    return SUPPORTED


@system_kernel
def _fits(system: Any, s: Setting, h: float, way: float, before: float) -> bool:
    """Whether things overlap no more at the end of a step than is allowed or was so `before`."""
    note, a = s.attempt.note[0], s.attempt
    if s.rung[0].compliant and way <= STUCK * note.length:
        return True
    least = least_allowed(trial_of(s, h), a.v, note.length, way, before)
    return bool(least_gap(system, a.trial) >= least)


@system_kernel
def _let_fall(system: Any, s: Setting, h: float) -> None:
    """Fill in the velocities by which places go on in the step: where nothing touches, weight leads along
    parabolas whose chords leave none by more than things are thick."""
    a, note = s.attempt, s.attempt.note[0]
    falls = bool(note.falls and note.follows) and not pushes(s)
    if falls and 0.25 * h * h * fastest(system, a.q, a.falls) > note.thin:
        falls = False
    for i in range(len(a.v)):
        a.fell[i] = h * a.falls[i] if falls else 0.0
        a.led[i] = a.v[i] - 0.5 * a.fell[i]


@kernel
def pushes(s: Setting) -> bool:
    """Whether a contact has a force at the end of the step."""
    for r in range(s.attempt.note[0].contacts * s.terms.contact_stiffness.shape[1]):
        if s.scratch.contact_force[r] != 0.0:
            return True
    return False


@kernel
def landing(s: Setting, h: float) -> float:
    """The longest step after which none of the open contacts has closed that push at the end of one of length
    h, where all falls freely; 0 where none does, where nothing falls, or where contacts pushed before."""
    terms, v, d = s.terms, s.state.v, s.terms.contact_stiffness.shape[1]
    least, lands = h, s.attempt.note[0].falls != 0
    for slot in range(s.state.force.shape[0]):
        for i in range(d):
            lands &= s.state.force[slot, i] == 0.0
    for k in range(s.attempt.note[0].contacts if lands else 0):
        gap = terms.gap[k]
        if s.scratch.contact_force[d * k] > 0.0 and gap > terms.rounding[0]:
            closes = -rate(terms.entries, terms.rows, d * k, d, v)
            falls = -rate(terms.entries, terms.rows, d * k, d, terms.fall)
            inside = closes * closes + 4.0 * falls * gap
            ends = 2.0 * gap / (closes + math.sqrt(inside)) if inside >= 0.0 else 0.0
            least = min(least, ends) if ends > 0.0 else least
    least *= 1.0 - ON_TIME
    return least if least < (1.0 - ON_TIME) * h else 0.0


@system_kernel
def reach_of(system: Any, s: Setting, h: float) -> float:
    """How far contacts are looked for in a step of length h, for what is known before it."""
    a, note = s.attempt, s.attempt.note[0]
    fill_pace(s.state.v, s.state.speed, s.terms.fall, h if s.rung[0].inertia > 0.0 else 0.0, a.pace)
    reach = SEEN * h * fastest(system, a.q, a.pace) + STUCK * note.length
    return float(max(max(reach, note.allowed), note.within))  # steps may leave what pushes so far open


@system_kernel
def fill_terms(system: Any, s: Setting, h: float, reach: float, at_start: bool) -> int:
    """Fill in terms at `trial`, as a step from q sees them: gaps less the contribution of what led there.
    Returns SUPPORTED, or why there are none: UNSOLVED where more contacts than there is room for are within
    reach of a long step."""
    rung, terms, state, a = s.rung[0], s.terms, s.state, s.attempt
    note = a.note[0]
    note.reach = reach
    moment = Moment(state.clock[0].time, a.trial, state.v, h, rung.inertia, bool(rung.metric))
    count = fill(system, moment, terms, reach, a.slots, a.fresh, state.passive)
    if count < 0:
        return UNSOLVED if reach > 2.0 * STUCK * note.length else CROWDED
    note.contacts = count
    if not at_start:
        _take_off(terms, count, h, a.led)
        if not (rung.compliant or rung.metric):
            open_added(terms, count, h, note.deep)
    take_slots(a.slots[:count], a.fresh[:count], bool(rung.compliant), state, terms, s.scratch)
    tell_laws(system, trial_of(s, h), at_start)
    if rung.inertia == 0.0:
        _fill_heft(terms)
    for i in range(len(terms.load)):
        state.passive[i] = terms.load[i] - state.passive[i]
    return SUPPORTED


@kernel
def _take_off(terms: Terms, contacts: int, h: float, v: Reals) -> None:
    """Take what velocities v do in the step off the gaps."""
    d = terms.contact_stiffness.shape[1]
    for k in range(contacts):
        terms.gap[k] -= h * rate(terms.entries, terms.rows, d * k, d, v)


@kernel
def _fill_heft(terms: Terms) -> None:
    """Fill in the row sums of inertia and metric."""
    n = terms.inertia.shape[0]
    for i in range(n):
        inertia, metric = 0.0, 0.0
        low, high = stretch(terms.entries.matrices, i, n)
        for j in range(low, high):
            inertia += abs(terms.inertia[i, j - low])
            metric += abs(terms.metric[i, j - low])
        terms.heft[i, INERTIA], terms.heft[i, METRIC] = inertia, metric
