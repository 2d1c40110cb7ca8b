"""Static above kinetic friction: what sticks may be held by more than what slides.

A contact that stuck in the last step, or that closes without sliding, is tried with its static friction. If
it slides in the solution, the step is solved again with its kinetic friction, and so on until none slides
that is held by more: one solve, and one more where something starts. (By the modes of the step before alone
it would slide against static friction for a step.) A solution with kinetic friction everywhere always meets
the law, for what sticks with less also sticks with more: so it is taken, too, where the step has no solution
with static friction.
"""

from __future__ import annotations

from rungwise.contact.step import OPEN, STICK, span
from rungwise.kernel import kernel, rare_kernel
from rungwise.simulation.core.state import KINETIC, STATIC, State, Trial
from rungwise.system.entries import rate
from rungwise.system.terms import Terms


@rare_kernel
def hold_still(trial: Trial) -> None:
    """Let contacts that do not slide where the step begins have their static friction."""
    terms, state, slots = trial.terms, trial.state, trial.scratch.slots
    for k in range(trial.contacts):
        own = terms.friction[k] == state.laws[KINETIC, slots[k]]
        if own and _sticks(trial, k):
            terms.friction[k] = state.laws[STATIC, slots[k]]


@kernel
def _sticks(trial: Trial, k: int) -> bool:
    """Whether contact k stuck in the last step, or its sides do not slide along each other."""
    _, h, terms, _, state, scratch, _ = trial
    d = terms.contact_stiffness.shape[1]
    for i in range(1, d if state.modes[scratch.slots[k]] != STICK else 1):
        if h * abs(_slip(d * k + i, d, terms, state)) > terms.rounding[0]:
            return False
    return True


@kernel
def _slip(r: int, d: int, terms: Terms, state: State) -> float:
    """Rate of row r where the step begins."""
    slip = rate(terms.entries, terms.rows, r, d, state.speed)
    for side in range(2):
        first, end, shift = span(terms.entries.rows, r // d, side, len(state.v))
        for i in range(first, end):
            slip += 0.0 if state.prescribed[i] else terms.rows[r, i - shift] * state.v[i]
    return slip


@rare_kernel
def lets_slide(trial: Trial, unsolved: bool, supported: bool) -> bool:
    """Whether the step just solved must be solved again, with kinetic friction where a contact slides that
    had more, or everywhere if it is unsolved; what static friction cannot support no other can. Where not,
    frictions are kinetic afterwards."""
    terms, state, slots, again = trial.terms, trial.state, trial.scratch.slots, False
    if unsolved or supported:
        for k in range(trial.contacts):
            held = terms.friction[k] > state.laws[KINETIC, slots[k]]
            if held and (unsolved or _slides(trial, k)):
                terms.friction[k], again = state.laws[KINETIC, slots[k]], True
    if not again:
        for k in range(trial.contacts):
            if terms.friction[k] > state.laws[KINETIC, slots[k]]:
                terms.friction[k] = state.laws[KINETIC, slots[k]]
    return again


@kernel
def _slides(trial: Trial, k: int) -> bool:
    """Whether contact k slides in the solution by more than rounding: where forces are not determined, some
    contacts of a rigid body may be at their limits though the body sticks."""
    scratch, problem, d = trial.scratch, trial.problem, trial.terms.contact_stiffness.shape[1]
    if scratch.mode[k] == OPEN or scratch.mode[k] == STICK:
        return False
    columns, n = trial.terms.entries.columns, trial.state.clock[0].free
    for i in range(1, d):
        slip = problem.w[d * k + i]
        for side in range(2):
            first, end, shift = span(columns, k, side, n)
            for j in range(first, end):
                slip += problem.W[d * k + i, j - shift] * scratch.x[j]
        for j in range(d):
            slip += problem.R[k, i, j] * scratch.contact_force[d * k + j]
        if abs(slip) > problem.quantum[0]:
            return True
    return False
