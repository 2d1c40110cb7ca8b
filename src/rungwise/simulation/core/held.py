"""Steps without momentum: the one question whether what is closed where a step begins can balance the loads.

Without inertia a step's problem asks for balance at its end alone. What nothing holds where the step begins
then comes to rest against whatever lies in its way, however far. So contacts that are closed when the step
begins, or that driven motion closes in it, have to balance the loads alone, with springs, dampers, drives and
dry friction: what balances only against others got there by momentum, which the rung leaves out. A motion
that does not vanish with the step leads out of balance: it settles, because loads or drives have jumped, and
is in balance after one step, or it goes on (von Mises' truss).
"""

from __future__ import annotations

from rungwise.contact.step import OPEN, SOLVED, stretch
from rungwise.kernel import kernel, rare_kernel
from rungwise.models.limit import LIMIT
from rungwise.simulation.core.balance import is_balanced
from rungwise.simulation.core.state import Scratch, Trial
from rungwise.simulation.core.step import SUPPORTED, UNSUPPORTED, pace, solve_assembled, solve_step
from rungwise.simulation.core.tolerances import SHORTER
from rungwise.system.entries import is_crowded, rate
from rungwise.system.skew import is_skew
from rungwise.system.terms import Terms


@kernel
def pushes_far(trial: Trial, near: float) -> bool:
    """Whether a contact pushes in the solution that is far where the step begins (see `is_near`)."""
    d = trial.terms.contact_stiffness.shape[1]
    for k in range(trial.contacts):
        if trial.scratch.contact_force[d * k] > 0.0 and not is_near(trial, near, k):
            return True
    return False


@kernel
def keep_near(trial: Trial, near: float) -> int:
    """How many contacts are near where the step begins (see `is_near`); they come first then, in place of the
    others."""
    count, d = 0, trial.terms.contact_stiffness.shape[1]
    for k in range(trial.contacts):
        if is_near(trial, near, k):
            _put(k, count, d, trial.terms, trial.scratch)
            count += 1
    return count


@kernel
def is_near(trial: Trial, near: float, k: int) -> bool:
    """Whether contact k is no farther than `near`, driven motion closes it in the step, or it pushed in the
    last step: a step that takes faces as flat may leave it a little open."""
    _, h, terms, _, state, scratch, _ = trial
    d, gap = terms.contact_stiffness.shape[1], terms.gap[k]
    if gap <= near or state.modes[scratch.slots[k]] != OPEN:
        return True
    return bool(gap <= -h * rate(terms.entries, terms.rows, d * k, d, state.speed))


@kernel
def _put(k: int, at: int, d: int, terms: Terms, scratch: Scratch) -> None:
    """Write what belongs to contact k in the place of contact `at`."""
    scratch.slots[at] = scratch.slots[k]
    terms.gap[at], terms.lever[at] = terms.gap[k], terms.lever[k]
    terms.friction[at], terms.restitution[at] = terms.friction[k], terms.restitution[k]
    for i in range(3 if is_skew(terms.skew) else 0):
        terms.skew[at, i] = terms.skew[k, i]
    for i in range(d):
        terms.deformation[d * at + i] = terms.deformation[d * k + i]
        for j in range(d):
            terms.contact_stiffness[at, i, j] = terms.contact_stiffness[k, i, j]
            terms.contact_damping[at, i, j] = terms.contact_damping[k, i, j]
        for j in range(terms.rows.shape[1]):
            terms.rows[d * at + i, j] = terms.rows[d * k + i, j]
    for i in range(4 if is_crowded(terms.entries) else 0):
        terms.entries.rows[at, i] = terms.entries.rows[k, i]


@rare_kernel
def vanishes(trial: Trial) -> bool:
    """Whether the motion just solved vanishes with the step: less than half of it is left in a part of the
    step, under the same loads, whose solution is left in the scratch. If not, what is closed where the step
    begins is out of balance there."""
    rung, h, terms, contacts, state, scratch, problem = trial
    whole = pace(terms, scratch.v_new)
    status = solve_step(Trial(rung, SHORTER * h, terms, contacts, state, scratch, problem))
    return bool(status == SUPPORTED and SHORTER * pace(terms, scratch.v_new) < 0.5 * whole)


@rare_kernel
def solve_alone(trial: Trial) -> int:
    """Solve a step with the contacts alone that have to balance the loads (see `keep_near`): UNSUPPORTED
    where inertia bounds the motion."""
    status = solve_step(trial)
    return UNSUPPORTED if status == SUPPORTED and _is_bound_by_inertia(trial) else status


@rare_kernel
def _is_bound_by_inertia(trial: Trial) -> bool:
    """Whether the inertia that stands for none makes up a part of the balance in the step just solved, and
    less than half of the motion is left where it is far more. The solution is left as it was."""
    _, h, terms, _, state, scratch, problem = trial
    if is_balanced(trial, LIMIT / SHORTER):
        return False
    clock, whole = state.clock[0], pace(terms, scratch.v_new)
    more = (1.0 / SHORTER - 1.0) * clock.eps / h
    for i in range(clock.free):
        a = state.free[i]
        first, end = stretch(terms.entries.matrices, a, state.v.shape[0])
        for b in range(first, end):
            problem.c[i] -= more * terms.inertia[a, b - first] * state.speed[b]
        low, high = stretch(terms.entries.couplings, i, clock.free)
        for j in range(low, high):
            problem.H[i, j - low] += more * terms.inertia[a, state.free[j] - first]
    solved = solve_assembled(trial, False) == SOLVED
    for i in range(clock.free):
        scratch.v_new[state.free[i]] = scratch.x[i]
    bound = not solved or pace(terms, scratch.v_new) < 0.5 * whole
    solve_step(trial)
    return bool(bound)
