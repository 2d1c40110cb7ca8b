"""Balance without momentum: whether what is left to inertia is nothing beside loads and resistances, and what
servos lead."""

from __future__ import annotations

import math

from rungwise.contact.step import diagonal, stretch
from rungwise.kernel import Reals, kernel, rare_kernel
from rungwise.models.limit import STIR, greatest_load, noticed_load
from rungwise.simulation.core.state import Trial
from rungwise.system.terms import METRIC

_ROUNDING = 1e-6
"""Loads that are `unbalanced` of this part of the greatest may be rounding, and need no support: ten times
the part that `limit_inertia` leaves to inertia. Chosen by trial, to a decade."""


@kernel
def is_balanced(trial: Trial, unbalanced: float) -> bool:
    """Whether the inertia that the limit eps -> 0+ leaves in the balance of each coordinate is negligible
    beside the load and the resistance there, of springs, dampers, and drives and friction with a limit."""
    h, terms, state, scratch = trial.h, trial.terms, trial.state, trial.scratch
    clock = state.clock[0]
    force, acceleration = greatest_load(terms, clock.free, state.free)
    balanced = True
    for i in range(clock.free):
        a = state.free[i]
        load = noticed_load(terms, a, force, acceleration, _ROUNDING)
        left, resisted = 0.0, 0.0
        low, high = stretch(terms.entries.matrices, a, state.v.shape[0])
        for b in range(low, high):
            if not state.prescribed[b]:
                left += clock.eps / h * terms.inertia[a, b - low] * (scratch.v_new[b] - state.wish[b])
                held = h * terms.stiffness[a, b - low] + terms.damping[a, b - low]
                resisted += abs(held * scratch.v_new[b])
        for r in range(clock.limited):
            if math.isfinite(terms.limit[r]):
                resisted += abs(terms.limited[r, a] * scratch.limited_force[r])
                resisted += terms.limited[r, a] ** 2 * _gain(trial, r) * abs(scratch.v_new[a])
        if force > 0.0 and abs(left) > unbalanced * (load + resisted):
            load += _passed_on(trial, unbalanced, a)
            balanced &= abs(left) <= unbalanced * (load + resisted)
    return balanced


@rare_kernel
def _passed_on(trial: Trial, unbalanced: float, a: int) -> float:
    """What the loads of other coordinates, and their own dampers, springs and drives, would ask of coordinate
    a by inertia alone, and what the least motion that counts asks of its own: beside this, inertia that is
    left of motion against the others is negligible where its own spring, damper or servo holds it."""
    h, terms, state, clock = trial.h, trial.terms, trial.state, trial.state.clock[0]
    held = _held(trial, a)
    low, high = stretch(terms.entries.matrices, a, len(state.v))
    if clock.eps / h * terms.inertia[a, a - low] > unbalanced * held:
        return _tied_to(trial, a)
    asked: float = held * STIR * terms.rounding[0] / (h * math.sqrt(terms.heft[a, METRIC]))
    for b in state.free[: clock.free]:
        if b != a and low <= b < high:
            own = diagonal(terms.inertia, terms.entries.matrices, b)
            asked += abs(terms.inertia[a, b - low]) / own * _borne(trial, b)
    return asked


@rare_kernel
def _tied_to(trial: Trial, a: int) -> float:
    """What the loads and resistances of other coordinates ask of coordinate a through equalities, however
    many lie between, where its own are nothing beside them: an equality's force, by the motion that it alone
    forbids, is an average of the forces that act on its coordinates."""
    terms, state, scratch = trial.terms, trial.state, trial.scratch
    clock, passed, tied, own = state.clock[0], scratch.x, 0.0, _borne(trial, a)
    for i in range(clock.free):
        passed[i] = _borne(trial, state.free[i])
    for _ in range(clock.limited):
        for r in range(clock.limited):
            if math.isinf(terms.limit[r]) and math.isinf(terms.gains[r, 0]):
                _pass_on(trial, r, passed)
    for i in range(clock.free):
        if state.free[i] == a:
            tied = passed[i]
        passed[i] = scratch.v_new[state.free[i]]  # as the solution was
    return tied if own <= _ROUNDING * tied else 0.0


@rare_kernel
def _pass_on(trial: Trial, r: int, passed: Reals) -> None:
    """Let the forces `passed` (n,) on the free coordinates of equality r act on all of them."""
    terms, free = trial.terms, trial.state.free
    n, force, mobility = trial.state.clock[0].free, 0.0, 0.0
    for i in range(n):
        own = terms.limited[r, free[i]]
        force += abs(own) * passed[i] / terms.heft[free[i], METRIC]
        mobility += own * own / terms.heft[free[i], METRIC]
    if mobility > 0.0:
        for i in range(n):
            passed[i] = max(passed[i], abs(terms.limited[r, free[i]]) * force / mobility)


@rare_kernel
def _borne(trial: Trial, b: int) -> float:
    """Force of the load, and of the own springs, dampers, servos and dry friction, on coordinate b."""
    terms, scratch = trial.terms, trial.scratch
    own = _yielding(trial, b)
    force: float = abs(terms.load[b]) + abs(own * scratch.v_new[b])
    for r in range(trial.state.clock[0].limited):
        if math.isfinite(terms.limit[r]):
            force += abs(terms.limited[r, b] * scratch.limited_force[r])
    return force


@rare_kernel
def _yielding(trial: Trial, a: int) -> float:
    """Force per speed of coordinate a, by its own springs and dampers."""
    terms, stretches = trial.terms, trial.terms.entries.matrices
    return trial.h * diagonal(terms.stiffness, stretches, a) + diagonal(terms.damping, stretches, a)


@rare_kernel
def _held(trial: Trial, a: int) -> float:
    """Force per speed of coordinate a, by its own springs, dampers, and servos that are within their
    limits."""
    terms, state = trial.terms, trial.state
    held: float = _yielding(trial, a)
    for r in range(state.clock[0].limited):
        held += terms.limited[r, a] ** 2 * _gain(trial, r)
    return held


@kernel
def ask_speeds(trial: Trial, asked: Reals) -> None:
    """Fill asked (n,) with how fast coordinates move, at most, where servos that are within their limits in
    the solution move them by no force: what these lead is as good as driven."""
    terms, state = trial.terms, trial.state
    for a in range(asked.shape[0]):
        asked[a] = abs(state.speed[a])
    for r in range(state.clock[0].limited):
        gain, square = _gain(trial, r), 0.0
        if gain == 0.0:
            continue
        for i in range(state.clock[0].free):
            square += terms.limited[r, state.free[i]] ** 2
        force = terms.gains[r, 0] * terms.error[r, 0] + terms.gains[r, 1] * terms.error[r, 1]
        for i in range(state.clock[0].free):
            a = state.free[i]
            asked[a] = max(asked[a], abs(terms.limited[r, a] * force) / (gain * square))


@kernel
def _gain(trial: Trial, r: int) -> float:
    """Force per rate of limited row r, where it is a servo within its limit; else 0."""
    terms = trial.terms
    gain: float = trial.h * terms.gains[r, 0] + terms.gains[r, 1]
    within = math.isfinite(gain) and abs(trial.scratch.limited_force[r]) < terms.limit[r]
    return gain if within else 0.0
