"""Laws of contact that a scene names beside Coulomb's friction and Newton's restitution, for the contacts of
any system (see `system.moving.FurtherLaws`): records say of each contact what it names, and the laws
themselves are in `scene.fields.laws`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals, RecordArray, rare_kernel
from rungwise.scene.fields.laws.contact import (
    POISSON,
    PULLS,
    REBOUNDS,
    STICKS,
    pull,
    pulls_within,
    rebound,
    until_edge,
)


@dataclass
class NamedLaws:
    """The laws of contacts whose records (l,) are of type `RECORD`; `record_of` gives the record (c,) of each
    slot (c,) in the last `fill` of the system."""

    records: RecordArray
    record_of: Callable[[Ints], Ints]
    holds: bool = field(init=False)
    bounces: bool = field(init=False)
    yields: bool = field(init=False)
    within: float = field(init=False)

    def __post_init__(self) -> None:
        named = self.records["laws"]
        self.holds, self.bounces = bool((named & STICKS).any()), bool((named & POISSON).any())
        self.yields = bool((named & REBOUNDS).any())
        pulls = np.flatnonzero(named & PULLS)
        self.within = max((float(pulls_within(self.records[k])) for k in pulls), default=-np.inf)

    def static(self, slots: Ints, friction: Reals) -> Reals:
        own = self.records[self.record_of(slots)]
        sticks = ((own["laws"] & STICKS) != 0) & ((friction > 0.0) | (own["friction"] == 0.0))
        return np.where(sticks, np.maximum(own["static_friction"], friction), friction)

    def impulsive(self, slots: Ints) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = (self.records["laws"][self.record_of(slots)] & POISSON) != 0
        return found

    def rebound(self, slots: Ints, speed: Reals, restitution: Reals) -> None:
        _rebounds(self.records, self.record_of(slots), speed, restitution)

    def pull(self, slots: Ints, gap: Reals, pushed: Ints) -> Reals:
        found = np.zeros(len(slots))
        _pulls(self.records, self.record_of(slots), gap, pushed, found)
        return found

    def until_edge(
        self, slots: Ints, gap: Reals, rate: Reals, across: float, rounding: float, h: float
    ) -> float:
        return float(_until_edges(self.records, self.record_of(slots), gap, rate, across, rounding, h))


def laws_named(records: RecordArray, record_of: Callable[[Ints], Ints]) -> NamedLaws | None:
    """The laws of contacts; None where no record names any."""
    return NamedLaws(records, record_of) if records["laws"].any() else None


@rare_kernel
def _rebounds(records: RecordArray, of: Ints, speed: Reals, restitution: Reals) -> None:
    for k in range(of.shape[0]):
        if restitution[k] > 0.0 and records[of[k]].laws & REBOUNDS:
            restitution[k] = rebound(records[of[k]], restitution[k], speed[k])


@rare_kernel
def _pulls(records: RecordArray, of: Ints, gap: Reals, pushed: Ints, found: Reals) -> None:
    for k in range(of.shape[0]):
        found[k] = pull(records[of[k]], gap[k], pushed[k] != 0)


@rare_kernel
def _until_edges(
    records: RecordArray, of: Ints, gap: Reals, rate: Reals, across: float, rounding: float, h: float
) -> float:
    for k in range(of.shape[0]):
        h = until_edge(records[of[k]], gap[k], rate[k], across, rounding, h)
    return h
