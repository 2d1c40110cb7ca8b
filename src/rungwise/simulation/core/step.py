"""One step: terms -> problem -> solution -> forces and deformations. No geometry."""

from __future__ import annotations

import math

from rungwise.contact.solver.settings import NOTHING
from rungwise.contact.step import (
    NO_SOLUTION,
    OPEN,
    SOLVED,
    STICK,
    ContactProblem,
    diagonal,
)
from rungwise.kernel import Reals, RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.models.assemble import Step, assemble, lean
from rungwise.models.entries import Velocities
from rungwise.models.limit import STIR, limit_inertia
from rungwise.simulation.core.balance import is_balanced
from rungwise.simulation.core.chains import solve_scratch, start_scratch
from rungwise.simulation.core.laws.poisson_impact import compress, end_impact, expand
from rungwise.simulation.core.laws.static_friction import hold_still, lets_slide
from rungwise.simulation.core.notes import note, note_start, notes_all
from rungwise.simulation.core.state import State, Trial, sizes_in
from rungwise.system.skew import is_skew, widened
from rungwise.system.terms import APART, METRIC, Terms

SUPPORTED, UNSUPPORTED, UNSOLVED = 0, 1, 2
_UNBALANCED = 1e-4
"""Part of the load and of the resistance that inertia may make up in a balance without inertia. Chosen by
trial, to a decade; tests/simulation/test_faint.py and test_squeezed.py hold it."""
SLOWER = 0.1
"""Pace over another beside which the other is far faster. Chosen by trial, to a decade."""


@kernel
def solve_step(trial: Trial) -> int:
    """Velocities after a step of length h into scratch.v_new; returns SUPPORTED, UNSUPPORTED or UNSOLVED.

    Contact modes and forces start from the values of the slots, and `state.modes` is left as it was.
    """
    lawful = trial.state.laws.shape[1] > 0
    if lawful:
        hold_still(trial)
        compress(trial)
    while True:
        status = _solve_or_hold(trial)
        if not lawful:
            return status
        if not lets_slide(trial, status == UNSOLVED, status == SUPPORTED):
            end_impact(trial)
            return status


@kernel
def _solve_or_hold(trial: Trial) -> int:
    """See `solve_step`."""
    rung, terms, state, scratch = trial.rung, trial.terms, trial.state, trial.scratch
    status = _solve_balanced(trial, False)
    clock, dynamic = state.clock[0], rung[0].inertia > 0.0
    if not rung[0].loads or clock.leans or not _is_pressed(terms, state) or (dynamic and rung[0].compliant):
        return status
    doubtful = status == SUPPORTED and (_starts(trial) if dynamic else _lands(trial))
    if (status == SUPPORTED or dynamic) and not doubtful:
        return status
    before, first = pace(terms, scratch.v_new), scratch.other[-1] < 0.0 and status != UNSOLVED
    if first:
        copy(scratch.v_new, scratch.other[:-1])
    held = _solve_balanced(trial, True) == SUPPORTED
    if held and doubtful:
        held = _is_still(trial, scratch.v_new) if dynamic else pace(terms, scratch.v_new) <= SLOWER * before
    if doubtful and not held:
        return _solve_balanced(trial, False)
    if held and first:
        scratch.other[-1] = clock.time
    return SUPPORTED if held else status


@kernel
def _is_pressed(terms: Terms, state: State) -> bool:
    """Whether loads, or drives whose force has a limit, may hold bodies against each other."""
    clock = state.clock[0]
    pressed: bool = clock.limited > 0
    for i in range(clock.free):
        pressed |= terms.load[state.free[i]] != 0.0
    return bool(pressed)


@kernel
def _lands(trial: Trial) -> bool:
    """Whether something moves far faster than before, or than what is driven, to where open contacts stop it:
    it may have been held instead."""
    _, h, terms, contacts, state, scratch, _ = trial
    now, before = pace(terms, scratch.v_new), max(pace(terms, state.v), pace(terms, state.speed))
    if h * now <= STIR * terms.rounding[0] or now * SLOWER <= before:
        return False
    d = state.force.shape[1]
    for k in range(contacts):
        if scratch.contact_force[d * k] > 0.0 and terms.gap[k] > terms.rounding[0]:
            return True
    return False


@kernel
def _starts(trial: Trial) -> bool:
    """Whether something begins to move where all rested, though rigid contacts may have held it."""
    _, _, terms, contacts, state, scratch, _ = trial
    closed = False
    for k in range(contacts):
        closed |= terms.gap[k] <= terms.rounding[0]
    rested = _is_still(trial, state.v) and _is_still(trial, state.speed)
    return bool(closed and rested and not _is_still(trial, scratch.v_new))


@kernel
def _is_still(trial: Trial, v: Reals) -> bool:
    """Whether nothing moves but for rounding beside what loads would cause in the step: contacts whose levers
    are rounding turn bodies about axes that nothing resists."""
    terms, moves, falls = trial.terms, 0.0, 0.0
    for i in range(v.shape[0]):
        weight = math.sqrt(diagonal(terms.inertia, terms.entries.matrices, i))
        moves, falls = max(moves, weight * abs(v[i])), max(falls, weight * abs(terms.fall[i]))
    return bool(moves <= NOTHING * trial.h * falls)


@kernel
def pace(terms: Terms, v: Reals) -> float:
    """Greatest speed of a coordinate; an angle counts by its radius of gyration."""
    fastest = 0.0
    for i in range(v.shape[0]):
        fastest = max(fastest, abs(v[i]) * math.sqrt(terms.heft[i, METRIC]))
    return fastest


@kernel
def _solve_balanced(trial: Trial, convex: bool) -> int:
    """Solve the step, whose forces have to balance where the rung leaves inertia out; `convex`: from the
    forces that let bodies rest."""
    rung, h, terms, contacts, state, _, _ = trial
    clock = state.clock[0]
    clock.eps = limit_inertia(rung, h, terms, contacts, clock.limited, clock.free, state.free, state.speed)
    if _solve_in_turn(trial, convex) != SOLVED:
        return UNSOLVED
    _take_over(trial)
    if rung[0].inertia > 0.0 or not rung[0].loads or is_balanced(trial, _UNBALANCED):
        return SUPPORTED
    return UNSUPPORTED


@kernel
def _solve_in_turn(trial: Trial, convex: bool) -> int:
    """Solve with restitution or else without it, with theta = 1 where something rigid holds, and with overlap
    as it is where bodies that hold each other on all sides cannot come apart."""
    rung, h, terms, contacts, state, scratch, problem = trial
    clock = state.clock[0]
    sizes, ease = sizes_in(trial), terms.pause[0]
    n, _, limited = sizes
    bounced = rung[0].inertia > 0.0
    clock.theta = rung[0].theta
    status = NO_SOLUTION
    for _ in range(4):
        bounced = assemble(
            rung, Step(h, clock.theta, clock.eps, ease), terms, contacts, limited,
            Velocities(state.free, n, state.v, state.speed), bounced, problem,
        )  # fmt: skip
        if clock.leans:
            lean(rung, h, clock.eps, terms, contacts, state.free, n, state.wish, problem)
        for i in range(n):
            scratch.x[i] = state.v[state.free[i]]
        status = solve_assembled(trial, convex)
        if bounced and status == SOLVED and state.laws.shape[1] > 0:
            status = expand(trial)
        if status == SOLVED and clock.theta < 1.0 and _is_held(trial):
            clock.theta = 1.0
        elif status == SOLVED:
            break
        elif bounced:
            bounced = False
        elif math.isfinite(ease) and _is_pressed(terms, state) and _overlap(trial):
            ease = math.inf
        else:
            break
    clock.bounced = bounced
    return status


@rare_kernel
def _overlap(trial: Trial) -> bool:
    """Whether bodies whose contact is rigid overlap by more than rounding."""
    rung, terms, contacts = trial.rung, trial.terms, trial.contacts
    overlap = False
    for k in range(contacts):
        yields = rung[0].compliant and math.isfinite(terms.contact_stiffness[k, 0, 0])
        overlap |= terms.gap[k] < -terms.rounding[0] and not yields
    return overlap and not rung[0].metric


@kernel
def _take_over(trial: Trial) -> None:
    """Write all velocities into scratch.v_new, and forces with their values in the limit."""
    rung, _, terms, contacts, state, scratch, problem = trial
    n, _, limited = sizes_in(trial)
    if _is_free_of_load(rung, n, state.clock[0].eps, problem):
        for r in range(contacts * terms.contact_stiffness.shape[1]):
            scratch.contact_force[r] = 0.0
        for r in range(limited):
            scratch.limited_force[r] = 0.0
    for i in range(state.v.shape[0]):
        scratch.v_new[i] = state.speed[i]
    for i in range(n):
        scratch.v_new[state.free[i]] = scratch.x[i]


@inner_kernel
def solve_assembled(trial: Trial, convex: bool) -> int:
    """Solve the problem as it stands, from the modes and forces of the slots or, if `convex`, from
    the forces that let bodies rest; velocities go to scratch.x, where in space those to start from are. None
    where the step is to be given up: each of many tries would go on for a while."""
    terms, state, scratch, problem = trial.terms, trial.state, trial.scratch, trial.problem
    sizes, d = sizes_in(trial), state.force.shape[1]
    _, contacts, limited = sizes
    if scratch.halt[0] != 0:
        return NO_SOLUTION
    state.clock[0].solves += 1
    for k in range(contacts):
        slot = scratch.slots[k]
        scratch.mode[k] = state.modes[slot]
        for i in range(d):
            force = state.force[slot, i] / terms.lever[k] if state.modes[slot] != OPEN else 0.0
            scratch.contact_force[k * d + i] = force
        if is_skew(terms.skew):
            x, y = scratch.contact_force[k * d + 1], scratch.contact_force[k * d + 2]
            scratch.contact_force[k * d + 1], scratch.contact_force[k * d + 2] = widened(terms.skew, k, x, y)
    for r in range(limited):
        scratch.mode[contacts + r] = scratch.limited_mode[r]
    shared = bool(state.clock[0].surfaces)
    if convex and not start_scratch(problem, sizes, terms, scratch, shared):
        return NO_SOLUTION
    noted = scratch.hard.shape[0] > 0
    if noted:
        note_start(problem, sizes, scratch)
    status, found, stage = solve_scratch(problem, sizes, terms, scratch, shared)
    state.clock[0].residual = found
    if noted and (status != SOLVED or notes_all(scratch)):
        note(problem, sizes, terms, status, stage, state, scratch)
    return status


@kernel
def _is_held(trial: Trial) -> bool:
    """Whether something rigid holds: a contact, a travel limit, or dry friction that does not slip.

    The rigid part stops a body within the step; with theta below 1 the body would bounce back.
    """
    terms, scratch = trial.terms, trial.scratch
    _, contacts, limited = sizes_in(trial)
    d = terms.contact_stiffness.shape[1]
    held = False
    for k in range(contacts):
        held |= math.isinf(terms.contact_stiffness[k, 0, 0]) and scratch.contact_force[k * d] > 0.0
    for r in range(limited):
        yields = 0.0 < terms.gains[r, 0] < math.inf or terms.gains[r, 1] > 0.0
        holds = abs(scratch.limited_force[r]) < terms.limit[r]
        if terms.surface[r] != APART:
            holds = scratch.mode[contacts + r] == STICK
        held |= not yields and holds
    return held


@kernel
def _is_free_of_load(rung: RecordArray, n: int, eps: float, problem: ContactProblem) -> bool:
    """Whether contact forces vanish in the limit eps -> 0+, where the forces found belong to eps = 1."""
    loaded = rung[0].inertia > 0.0 or not rung[0].loads or rung[0].compliant or eps < 1.0
    for i in range(n):
        loaded |= problem.c[i] != 0.0
    return not loaded
