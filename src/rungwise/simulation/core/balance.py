"""Steps without momentum: which contacts have to balance the loads where a step begins.

Without inertia a step's problem asks for balance at its end alone. What nothing holds where the step begins
then comes to rest against whatever lies in its way, however far. So contacts that are closed when the step
begins, or that driven motion closes in it, have to balance the loads alone, with springs, dampers, drives and
dry friction: what balances only against others got there by momentum, which the rung leaves out.
"""

from __future__ import annotations

from rungwise.kernel import Reals, kernel
from rungwise.simulation.core.state import Scratch
from rungwise.system.entries import fill_span, rate
from rungwise.system.terms import Terms


@kernel
def keep_near(h: float, near: float, contacts: int, speed: Reals, terms: Terms, scratch: Scratch) -> int:
    """How many contacts are closer than `near`, or closed by driven motion within h; they come first then, in
    place of the others. Where none of the others pushes, all stay."""
    d, far = terms.contact_stiffness.shape[1], False
    for k in range(contacts):
        far |= scratch.contact_force[d * k] > 0.0 and not _is_near(k, d, h, near, speed, terms)
    if not far:
        return contacts
    count = 0
    for k in range(contacts):
        if _is_near(k, d, h, near, speed, terms):
            _put(k, count, d, terms, scratch)
            count += 1
    return count


@kernel
def _is_near(k: int, d: int, h: float, near: float, speed: Reals, terms: Terms) -> bool:
    return bool(terms.gap[k] <= max(near, -h * rate(terms.entries, terms.rows, d * k, d, speed)))


@kernel
def _put(k: int, at: int, d: int, terms: Terms, scratch: Scratch) -> None:
    """Write what belongs to contact k in the place of contact `at`."""
    scratch.slots[at] = scratch.slots[k]
    terms.gap[at], terms.lever[at] = terms.gap[k], terms.lever[k]
    terms.friction[at], terms.restitution[at] = terms.friction[k], terms.restitution[k]
    for i in range(d):
        terms.deformation[d * at + i] = terms.deformation[d * k + i]
        for j in range(d):
            terms.contact_stiffness[at, i, j] = terms.contact_stiffness[k, i, j]
            terms.contact_damping[at, i, j] = terms.contact_damping[k, i, j]
        for j in range(terms.rows.shape[1]):
            terms.rows[d * at + i, j] = terms.rows[d * k + i, j]
    fill_span(terms.entries, at, terms.rows.shape[1])
