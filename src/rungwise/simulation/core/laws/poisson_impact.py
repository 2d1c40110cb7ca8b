"""Impacts in two phases: Poisson's restitution, beside Newton's.

Compression is the step without restitution: it ends when contacts approach no more, and leaves impulses P.
Expansion gives the contacts that were hit e P along the normal at least, friction within mu times what it
gives in all, and begins with the velocities at the end of compression. So friction that stops or reverses
the slip in one of the phases has its own direction in the other, and the impact of one contact cannot add
energy, which with Newton's law it can. Source: Poisson 1817; Glocker and Pfeiffer, Nonlinear Dynamics 7
(1995) 471-497.

Friction of the impulse e P is dry friction of limited force, so both phases are problems of the step's kind
(`contact.step.problem`): in the plane it is a limited row; in space, where its directions share a ball, it
is a further contact that a spring presses with e P, and that presses nothing itself. What else pushes or
holds, as loads, drives, joints and supports do, acts in the balance of both as in any step.
"""

from __future__ import annotations

from rungwise.contact.step import OPEN, SOLVED, STICK, Sizes
from rungwise.kernel import kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.simulation.core.chains import solve_scratch
from rungwise.simulation.core.state import IMPULSIVE, Trial, columns_of, sizes_in
from rungwise.system.entries import is_crowded

RESTITUTION, GAP, NORMAL = 0, 1, 2
"""Rows of `scratch.impact`: of each contact that is hit its restitution, and 0 of all others; its gap; from
the third on the impulses of compression over h, normal first."""
PLASTIC = 1e-200
"""Restitution for which a contact is hit, and does not bounce."""


@rare_kernel
def compress(trial: Trial) -> None:
    """Let contacts with Poisson's restitution that are hit in the step be without restitution in it."""
    rung, h, terms, contacts, state, scratch, _ = trial
    d = terms.contact_stiffness.shape[1]
    for k in range(contacts if scratch.impact.shape[1] > 0 else 0):
        scratch.impact[RESTITUTION, k] = 0.0
        hit = state.laws[IMPULSIVE, scratch.slots[k]] > 0.0 and terms.restitution[k] > 0.0
        if hit and rung[0].inertia > 0.0 and not rung[0].compliant:
            g = approach(d * k, terms, state.v, state.speed, state.free, state.clock[0].free, rung[0].inertia)
            if g < 0.0 and terms.gap[k] + h * g <= 0.0:
                scratch.impact[RESTITUTION, k], scratch.impact[GAP, k] = terms.restitution[k], terms.gap[k]
                terms.restitution[k], terms.gap[k] = PLASTIC, max(terms.gap[k], 0.0)


@rare_kernel
def end_impact(trial: Trial) -> None:
    """Give the terms back what `compress` took."""
    terms, scratch = trial.terms, trial.scratch
    for k in range(trial.contacts if scratch.impact.shape[1] > 0 else 0):
        if scratch.impact[RESTITUTION, k] > 0.0:
            terms.restitution[k], terms.gap[k] = scratch.impact[RESTITUTION, k], scratch.impact[GAP, k]


@rare_kernel
def expand(trial: Trial) -> int:
    """From the solution of compression to the end of the impact, in the scratch; returns the status."""
    contacts, scratch, problem = trial.contacts, trial.scratch, trial.problem
    n, _, limited = sizes_in(trial)
    if not _is_hit(trial):
        return SOLVED
    d, added = problem.R.shape[1], 0
    for k in range(contacts):
        normal, e = scratch.contact_force[d * k], scratch.impact[RESTITUTION, k]
        first, middle, second, last = columns_of(trial, k)
        for part in range(2):
            begin, end = (first, middle) if part == 0 else (second, last)
            for j in range(begin, end):
                push = problem.W[d * k, j] * (1.0 + e) * normal
                for i in range(1, d):
                    push += problem.W[d * k + i, j] * scratch.contact_force[d * k + i]
                problem.c[j] += push
        if e * normal * problem.mu[k] > 0.0 and d > 2:
            _press(trial, k, e * normal, contacts + added)
            added += 1
        elif e * normal * problem.mu[k] > 0.0:
            _rub(trial, k, e * normal * problem.mu[k], limited + added)
            added += 1
        for i in range(d):
            scratch.impact[NORMAL + i, k] = scratch.contact_force[d * k + i] if i > 0 else (1.0 + e) * normal
            scratch.contact_force[d * k + i] = 0.0
        scratch.mode[k] = OPEN
    for r in range(added if d == 2 else 0):
        scratch.mode[contacts + limited + r], scratch.limited_force[limited + r] = STICK, 0.0
    return _solve(
        trial, Sizes(n, contacts, limited + added) if d == 2 else Sizes(n, contacts + added, limited)
    )


@kernel
def _is_hit(trial: Trial) -> bool:
    hit, d = False, trial.terms.contact_stiffness.shape[1]
    for k in range(trial.contacts if trial.scratch.impact.shape[1] > 0 else 0):
        pushed = trial.scratch.contact_force[d * k] > 0.0
        hit |= trial.scratch.impact[RESTITUTION, k] > 0.0 and pushed
    return hit


@kernel
def _rub(trial: Trial, k: int, most: float, r: int) -> None:
    """Let row r be dry friction of contact k, of at most `most`."""
    problem = trial.problem
    first, middle, second, last = columns_of(trial, k)
    for j in range(trial.state.clock[0].free):
        within = first <= j < middle or second <= j < last
        problem.S[r, j] = problem.W[2 * k + 1, j] if within else 0.0
    problem.R_s[r], problem.w_s[r], problem.F[r] = 0.0, problem.w[2 * k + 1], most


@kernel
def _press(trial: Trial, k: int, least: float, own: int) -> None:
    """Let contact `own` rub as contact k does, pressed with `least` by a spring on nothing that moves."""
    _, _, terms, _, _, scratch, problem = trial
    d, yields = problem.R.shape[1], 0.0
    first, middle, second, last = columns_of(trial, k)
    for j in range(trial.state.clock[0].free):
        within = first <= j < middle or second <= j < last
        problem.W[d * own, j] = 0.0
        for i in range(1, d):
            problem.W[d * own + i, j] = problem.W[d * k + i, j] if within else 0.0
            yields += problem.W[d * own + i, j] ** 2 / problem.H[j, j]
    yields /= d - 1.0
    for i in range(d):
        for j in range(d):
            problem.R[own, i, j] = 0.0
        problem.w[d * own + i] = problem.w[d * k + i] if i > 0 else -yields * least
        scratch.contact_force[d * own + i] = (
            scratch.impact[RESTITUTION, k] * scratch.contact_force[d * k + i] if i > 0 else least
        )
    problem.R[own, 0, 0], problem.mu[own], scratch.mode[own] = yields, problem.mu[k], STICK
    if is_crowded(terms.entries):
        for i in range(terms.entries.columns.shape[1]):
            terms.entries.columns[own, i] = terms.entries.columns[k, i]


@kernel
def _solve(trial: Trial, sizes: Sizes) -> int:
    """Solve the problem of expansion, and add the impulses of both phases."""
    _, _, terms, contacts, state, scratch, problem = trial
    clock, d = state.clock[0], problem.R.shape[1]
    status, found, _ = solve_scratch(problem, sizes, terms, scratch, bool(clock.surfaces))
    for r in range(sizes.limited if d > 2 else 0):
        scratch.mode[contacts + r] = scratch.mode[sizes.contacts + r]
    clock.residual = max(clock.residual, found)
    if status != SOLVED:
        return status
    added = 0
    for k in range(contacts):
        rubs = scratch.impact[RESTITUTION, k] * problem.mu[k] > 0.0 and scratch.impact[NORMAL, k] > 0.0
        if rubs and d == 2 and clock.limited + added < sizes.limited:
            scratch.contact_force[2 * k + 1] += scratch.limited_force[clock.limited + added]
            added += 1
        elif rubs and contacts + added < sizes.contacts:
            for i in range(1, d):
                scratch.contact_force[d * k + i] += scratch.contact_force[d * (contacts + added) + i]
            added += 1
        for i in range(d):
            scratch.contact_force[d * k + i] += scratch.impact[NORMAL + i, k]
    return status
