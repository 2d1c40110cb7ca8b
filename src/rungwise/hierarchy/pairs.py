"""The pairs of models that a comparison measures, and the paths that lead from one to the other."""

from __future__ import annotations

from typing import NamedTuple

from rungwise.hierarchy.paths import BOTH, LIGHT, PROPORTIONAL, RATIO, UNDAMPED, Path
from rungwise.models.ladder import (
    DYNAMIC_COMPLIANT,
    DYNAMIC_RIGID,
    KINEMATIC,
    QUASISTATIC_COMPLIANT,
    QUASISTATIC_RIGID,
    Rung,
)


class Pair(NamedTuple):
    """A richer and a simpler model; the definition by which the paper's Table 1 relates them, 0 where it does
    not; the paths that lead from one to the other."""

    richer: Rung
    simpler: Rung
    definition: int
    paths: tuple[Path, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.richer.name} -> {self.simpler.name}"


PAIRS = (
    Pair(DYNAMIC_COMPLIANT, DYNAMIC_RIGID, 2, (RATIO, PROPORTIONAL, UNDAMPED)),
    Pair(DYNAMIC_COMPLIANT, QUASISTATIC_RIGID, 2, (BOTH,)),
    Pair(DYNAMIC_RIGID, QUASISTATIC_RIGID, 2, (LIGHT,)),
    Pair(QUASISTATIC_RIGID, KINEMATIC, 1),
    Pair(DYNAMIC_COMPLIANT, QUASISTATIC_COMPLIANT, 0, (LIGHT,)),
    Pair(QUASISTATIC_COMPLIANT, QUASISTATIC_RIGID, 0, (PROPORTIONAL,)),
)
"""The four of the paper's Table 1, in its order, and two that join the quasistatic compliant model."""
