"""Overlap at the end of a step: how much is allowed, and how what the way there adds is opened."""

from __future__ import annotations

import math

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.simulation.core.state import Trial
from rungwise.simulation.core.tolerances import EXACT, OVERLAP, SINKING
from rungwise.system.moving import Size
from rungwise.system.terms import Terms

UNSEEN = 1e-3
"""Overlap over the system's length that a compliant step may have beyond what its linear contacts foresee."""
SUNK = 0.2
"""Deformation over the system's length beyond which long steps are halved: runs end where the model fails."""


def least_allowed(rung: Rung, size: Size, step: Trial, v: Reals, way: float, before: float) -> float:
    """The least gap that is allowed at the end of a step to v, which moves things by `way`, after a least gap
    of `before`; inf where contacts yield too much. Gaps of compliant contacts are linear over the way."""
    if not rung.compliant:
        allowed = (EXACT if rung.metric else OVERLAP) * size.length
        return min(before - float(step.terms.rounding[0]), -allowed)
    rows = step.terms.rows[: step.contacts * size.directions : size.directions]
    foreseen = step.terms.gap[: step.contacts] + step.h * (rows @ v)
    deepest = float(foreseen.min(initial=0.0))
    if deepest < -SUNK * size.length and way > SINKING * size.length:
        return math.inf
    return deepest - UNSEEN * size.length


def crushes(rung: Rung, size: Size, step: Trial) -> bool:
    """Whether a contact yields too far for its model under forces that solve a step without momentum: then no
    step is short enough for what it moves."""
    if not rung.compliant or rung.inertia > 0.0:
        return False
    force = step.scratch.contact_force[: step.contacts * size.directions : size.directions]
    yields = force / step.terms.contact_stiffness[: step.contacts, 0, 0]
    return bool((yields > SINKING * size.length).any())


def open_added(terms: Terms, contacts: int, h: float, deep: float) -> None:
    """Let overlap that the way to a trial place adds to what was there, `deep`, be gone at the end of a step
    of length h. The models take a `pause` for overlap, which is meant for what was there before."""
    gap = terms.gap[:contacts]
    added = gap < -max(deep, float(terms.rounding[0]))
    slower = max(1.0, float(terms.pause[0]) / h)
    gap[added] = slower * (gap[added] + deep) - deep
