"""Which contacts of a part contradict their modes, as `flip` of `contact.step.mode_newton` has it."""

from __future__ import annotations

from rungwise.contact.solvers.plane.judge import rates
from rungwise.contact.solvers.plane.part import Part
from rungwise.contact.step.mode_newton import (
    BY_SLIP,
    CONTRADICTED,
    asked_by_force,
    asked_by_limit,
    sign,
    turned_to,
)
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.problem import Unknowns
from rungwise.kernel import Reals, kernel


@kernel
def flip(part: Part, unknowns: Unknowns, give: Reals, centre: Reals, most: int) -> bool:
    """Move at most `most` contacts that contradict their modes to the modes they ask for; whether any did.

    Row r yields by give[r] per unit of force beyond centre[r] (2 contacts + limited,), beside R.
    """
    contacts, limited = len(part.mu), len(part.F)
    mode, v, force, tau = unknowns
    velocity, largest, changed = part.quantum, 0.0, 0
    for r in range(2 * contacts):
        velocity = max(velocity, abs(part.w[r]), give[r] * abs(centre[r]))
        largest = max(largest, abs(force[r]))
    for e in range(part.first[contacts]):
        speed = v[part.column[e]]
        velocity = max(velocity, abs(part.normal[e] * speed), abs(part.tangential[e] * speed))
    slack, tiny = CONTRADICTED * velocity, CONTRADICTED * largest
    for k in range(contacts):
        wanted = _contact_mode(part, k, unknowns, slack, tiny, give, centre)
        changed += turned_to(wanted, mode, k, changed < most)
    for r in range(limited):
        at, own = contacts + r, 2 * contacts + r
        wanted = asked_by_limit(mode[at], tau[r], part.F[r])
        if wanted == BY_SLIP:
            moving, _ = rates(part, at, v)
            s = part.R_s[r] * tau[r] + part.w_s[r] + give[own] * (tau[r] - centre[own]) + moving
            wanted = STICK if s * tau[r] > 0.0 else mode[at]
        changed += turned_to(wanted, mode, at, changed < most)
    return changed > 0


@kernel
def _contact_mode(
    part: Part, k: int, unknowns: Unknowns, slack: float, tiny: float, give: Reals, centre: Reals
) -> int:
    mode, mu = unknowns.mode[k], part.mu[k]
    normal, tangential = unknowns.force[2 * k], unknowns.force[2 * k + 1]
    if mode == OPEN:
        opening, _ = rates(part, k, unknowns.v)
        if part.w[2 * k] - give[2 * k] * centre[2 * k] + opening >= -slack:
            return OPEN
        return STICK if mu > 0.0 else FORWARD
    wanted = asked_by_force(mode, mu, normal, tangential, tiny)
    if wanted != BY_SLIP:
        return wanted
    _, moving = rates(part, k, unknowns.v)
    slip = part.w[2 * k + 1] + part.R[k, 1, 0] * normal + part.R[k, 1, 1] * tangential
    slip += give[2 * k + 1] * (tangential - centre[2 * k + 1]) + moving
    return STICK if slip * sign(mode) > slack else mode
