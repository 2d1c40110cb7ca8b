"""Impacts in two phases: Poisson's restitution, beside Newton's.

Compression is the step without restitution: it ends when contacts approach no more, and leaves impulses P.
Expansion gives the contacts that were hit e P along the normal at least, friction within mu times what it
gives in all, and begins with the velocities at the end of compression. So friction that stops or reverses
the slip in one of the phases has its own direction in the other, and the impact of one contact cannot add
energy, which with Newton's law it can. Source: Poisson 1817; Glocker and Pfeiffer, Nonlinear Dynamics 7
(1995) 471-497.

Friction of the impulse e P is dry friction of limited force: a limited row for each direction of slip, which
in space share a ball. So both phases are problems of the step's kind (`contact.step.problem`), of the same
groups in the plane and in space. There are two by the law itself, which asks of the second what the first
has exerted: this is the one law that takes two solves. What else pushes or holds, as loads, drives, joints
and supports do, acts in the balance of both as in any step.
"""

from __future__ import annotations

from rungwise.contact.step import OPEN, SOLVED, STICK, Sizes, has_column, place_in, span
from rungwise.kernel import kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.simulation.core.chains import solve_scratch
from rungwise.simulation.core.state import IMPULSIVE, Trial, sizes_in
from rungwise.system.terms import APART

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
        for side in range(2):
            first, end, shift = span(trial.terms.entries.columns, k, side, n)
            for j in range(first, end):
                push = problem.W[d * k, j - shift] * (1.0 + e) * normal
                for i in range(1, d):
                    push += problem.W[d * k + i, j - shift] * scratch.contact_force[d * k + i]
                problem.c[j] += push
        if e * normal * problem.mu[k] > 0.0:
            _rub(trial, k, e * normal * problem.mu[k], limited + added)
            added += d - 1
        for i in range(d):
            scratch.impact[NORMAL + i, k] = scratch.contact_force[d * k + i] if i > 0 else (1.0 + e) * normal
            scratch.contact_force[d * k + i] = 0.0
        scratch.mode[k] = OPEN
    return _solve(trial, Sizes(n, contacts, limited + added))


@kernel
def _is_hit(trial: Trial) -> bool:
    hit, d = False, trial.terms.contact_stiffness.shape[1]
    for k in range(trial.contacts if trial.scratch.impact.shape[1] > 0 else 0):
        pushed = trial.scratch.contact_force[d * k] > 0.0
        hit |= trial.scratch.impact[RESTITUTION, k] > 0.0 and pushed
    return hit


@kernel
def _rub(trial: Trial, k: int, most: float, first: int) -> None:
    """Let rows from `first` on be dry friction of contact k, of at most `most`, in a ball if there are
    several."""
    terms, scratch, problem = trial.terms, trial.scratch, trial.problem
    d, e = problem.R.shape[1], scratch.impact[RESTITUTION, k]
    columns = terms.entries.columns
    for i in range(1, d):
        r = first + i - 1
        for j in range(trial.state.clock[0].free):
            kept = has_column(columns, k, j)
            problem.S[r, j] = problem.W[d * k + i, place_in(columns, k, j)] if kept else 0.0
        problem.R_s[r], problem.w_s[r], problem.F[r] = 0.0, problem.w[d * k + i], most
        terms.surface[r] = first if d > 2 else APART
        scratch.mode[trial.contacts + r] = STICK
        scratch.limited_force[r] = e * scratch.contact_force[d * k + i]


@kernel
def _solve(trial: Trial, sizes: Sizes) -> int:
    """Solve the problem of expansion, and add the impulses of both phases."""
    _, _, terms, contacts, state, scratch, problem = trial
    clock, d = state.clock[0], problem.R.shape[1]
    status, found, _ = solve_scratch(problem, sizes, terms, scratch, bool(clock.surfaces) or d > 2)
    clock.residual = max(clock.residual, found)
    for r in range(clock.limited, sizes.limited):
        terms.surface[r] = APART
    if status != SOLVED:
        return status
    row = int(clock.limited)
    for k in range(contacts):
        rubs = scratch.impact[RESTITUTION, k] * problem.mu[k] > 0.0 and scratch.impact[NORMAL, k] > 0.0
        for i in range(1, d if rubs and row < sizes.limited else 1):
            scratch.contact_force[d * k + i] += scratch.limited_force[row]
            row += 1
        for i in range(d):
            scratch.contact_force[d * k + i] += scratch.impact[NORMAL + i, k]
    return status
