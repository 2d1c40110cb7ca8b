"""Falls along parabolas, in steps of controlled length in which nothing touches, and where they end."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.simulation.core.state import Trial
from rungwise.system.moving import System
from rungwise.system.terms import Terms

CLOSED = 1e-12
"""Part of the time until a contact closes that is rounding."""


class Fall:
    """How weight leads the free bodies of a system; `follows`: whether steps follow parabolas; `fell` (n_v,):
    the velocities that weight gave in the last step, where they did."""

    def __init__(self, system: System, rung: Rung, pulls: bool) -> None:
        """`pulls`: whether contacts pull before they close, so that parabolas bend."""
        weighs = rung.inertia == 1.0 and rung.loads and not (system.size.limited or pulls)
        self._system, self._still, self.follows = system, np.zeros(system.size.velocities), False
        self._falls = getattr(system, "falls", self._still) if weighs else self._still
        self._may_fall, self.fell = bool(self._falls.any()), self._still

    def leads(self, step: Trial, q: Reals, v: Reals) -> Reals:
        """The velocities by which places q go on in a step to v: where nothing touches, weight leads along
        parabolas whose chords leave none by more than things are thick."""
        self.fell, h, size = self._still, step.h, self._system.size
        if not (self._may_fall and self.follows) or _pushes(step).any():
            return v
        if 0.25 * h * h * self._system.fastest(q, np.abs(self._falls)) > size.thin:
            return v
        self.fell = h * self._falls
        return v - 0.5 * self.fell

    def lands(self, step: Trial) -> float:
        """See `landing`; 0 where contacts pushed before the step."""
        if not self._may_fall or step.state.force.any():
            return 0.0
        return landing(step.terms, _pushes(step), step.state.v, step.h)


def _pushes(step: Trial) -> Reals:
    """Forces (c d,) of contacts at the end of a step."""
    return step.scratch.contact_force[: step.contacts * step.terms.contact_stiffness.shape[1]]


def landing(terms: Terms, force: Reals, v: Reals, h: float) -> float:
    """The longest step from velocities v (n_v,) after which none of the open contacts has closed that push,
    by forces (c d,), at the end of one of length h; 0 where none does."""
    d, rounding = terms.contact_stiffness.shape[1], float(terms.rounding[0])
    count = len(force) // d
    pushes = (force[::d] > 0.0) & (terms.gap[:count] > rounding)
    rows, gaps = terms.rows[: count * d : d][pushes], terms.gap[:count][pushes]
    rate, falls = -rows @ v, -rows @ terms.fall
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = 2.0 * gaps / (rate + np.sqrt(rate * rate + 4.0 * falls * gaps))
    least = (1.0 - CLOSED) * float(ends[ends > 0.0].min(initial=h))
    return least if least < (1.0 - CLOSED) * h else 0.0
