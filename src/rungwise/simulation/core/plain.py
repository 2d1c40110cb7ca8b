"""Systems that are Python objects, as the steps see them: their steps are plain Python, and take longer."""

from __future__ import annotations

from dataclasses import dataclass, field

from rungwise.kernel import Ints, Reals
from rungwise.simulation.core.laws.further import Further
from rungwise.simulation.core.state import Trial
from rungwise.system.moving import Crowded, Moment, System
from rungwise.system.terms import Terms


@dataclass
class PlainSystem:
    """A system, and its further laws of contact if it has any, with the methods of `system.contract`.
    `crowded` is what the last `fill` without room raised."""

    system: System
    further: Further | None
    crowded: Crowded = field(init=False)

    def fill(
        self, moment: Moment, terms: Terms, reach: float, slots: Ints, fresh: Ints, driving: Reals
    ) -> int:
        try:
            found, new = self.system.fill(moment, terms, reach)
        except Crowded as error:
            self.crowded = error
            return -1
        slots[: len(found)], fresh[: len(found)] = found, new
        driving[:] = self.system.driving
        return len(found)

    def integrate(self, q: Reals, v: Reals, h: float, after: Reals) -> None:
        after[:] = self.system.integrate(q, v, h)

    def least_gap(self, q: Reals) -> float:
        return self.system.least_gap(q)

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        return self.system.passes(q, v, h)

    def fastest(self, q: Reals, v: Reals) -> float:
        return self.system.fastest(q, v)

    def tell_laws(self, trial: Trial, at_start: bool) -> None:
        if self.further is not None:
            self.further.fill(trial, at_start)
