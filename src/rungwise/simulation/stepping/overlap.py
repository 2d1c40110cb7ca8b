"""Overlap at the end of a step: how much is allowed, and how what the way there adds is opened."""

from __future__ import annotations

import math

from rungwise.kernel import Reals, kernel
from rungwise.models.ladder import Rung
from rungwise.simulation.core.state import Trial
from rungwise.simulation.core.tolerances import EXACT, OVERLAP, SINKING
from rungwise.system.entries import rate
from rungwise.system.moving import Size
from rungwise.system.terms import Terms

UNSEEN = 1e-3
"""Overlap over the system's length that a compliant step may have beyond what its linear contacts foresee."""
SUNK = 0.2
"""Deformation over the system's length beyond which long steps are halved: runs end where the model fails."""


@kernel
def least_allowed(step: Trial, v: Reals, length: float, way: float, before: float) -> float:
    """The least gap that is allowed at the end of a step to v, which moves things by `way`, after a least gap
    of `before`, in a system of this length; inf where contacts yield too much. Gaps of compliant contacts are
    linear over the way."""
    rung, h, terms, contacts, _, _, _ = step
    if not rung[0].compliant:
        allowed = (EXACT if rung[0].metric else OVERLAP) * length
        return float(min(before - terms.rounding[0], -allowed))
    deepest, d = 0.0, terms.contact_stiffness.shape[1]
    for k in range(contacts):
        deepest = min(deepest, terms.gap[k] + h * rate(terms.entries, terms.rows, d * k, d, v))
    if deepest < -SUNK * length and way > SINKING * length:
        return math.inf
    return deepest - UNSEEN * length


def crushes(rung: Rung, size: Size, step: Trial) -> bool:
    """Whether a contact yields too far for its model under forces that solve a step without momentum: then no
    step is short enough for what it moves."""
    if not rung.compliant or rung.inertia > 0.0:
        return False
    force = step.scratch.contact_force[: step.contacts * size.directions : size.directions]
    yields = force / step.terms.contact_stiffness[: step.contacts, 0, 0]
    return bool((yields > SINKING * size.length).any())


@kernel
def open_added(terms: Terms, contacts: int, h: float, deep: float) -> None:
    """Let overlap that the way to a trial place adds to what was there, `deep`, be gone at the end of a step
    of length h. The models take a `pause` for overlap, which is meant for what was there before."""
    slower = max(1.0, terms.pause[0] / h)
    for k in range(contacts):
        if terms.gap[k] < -max(deep, terms.rounding[0]):
            terms.gap[k] = slower * (terms.gap[k] + deep) - deep
