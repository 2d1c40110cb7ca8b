"""What laws of contact beside the common ones do in the steps of a system that names them.

Friction of what sticks, and which impacts have two phases, are told to the state; restitution is that at the
speed of an approach; what pulls is a load, with its value where the step begins, and steps end where a point
enters or leaves the range of a pull, which would otherwise do far more work than the range allows.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.step import OPEN
from rungwise.kernel import Reals, rare_kernel, steady
from rungwise.models.assemble import approach
from rungwise.simulation.core.state import IMPULSIVE, KINETIC, STATIC, Trial
from rungwise.simulation.core.tolerances import ACROSS
from rungwise.system.moving import FurtherLaws, Size, fall_freely
from rungwise.system.terms import normals_of


def law_arrays(size: Size) -> tuple[Reals, Reals]:
    """`State.laws` and `Scratch.impact` of a system; empty where it names no law that needs them."""
    named = size.laws
    slots = size.slots if named is not None and (named.holds or named.bounces) else 0
    hits = size.slots if named is not None and named.bounces else 0
    return np.zeros((3, slots)), np.zeros((2 + size.directions, hits))


def further_rows(size: Size) -> int:
    """Limited rows of the friction of impacts in two phases, at most (see `core.laws.poisson_impact`)."""
    bounces = size.laws is not None and size.laws.bounces
    return (size.directions - 1) * size.slots if bounces else 0


class Further:
    """The named laws of a system of n velocities, what pulls (n,) where the step begins, and whether anything
    may."""

    def __init__(self, named: FurtherLaws, velocities: int) -> None:
        self.named, self._pull, self.pulls = named, np.zeros(velocities), named.within > -np.inf
        self._approaches = steady(_approaches)

    def fill(self, trial: Trial, begins: bool) -> None:
        """Add to the terms of a step, just filled, what the laws say of its contacts; `begins`: where the
        step begins, not where it is linearised again."""
        rung, _, terms, count, state, scratch, _ = trial
        slots, named = scratch.slots[:count], self.named
        if self.pulls and rung[0].loads:
            if begins:
                pushed = (state.modes[slots] != OPEN).astype(np.int64)
                self._pull[:] = -named.pull(
                    slots, terms.gap[:count] - terms.rounding[0], pushed
                ) @ normals_of(terms, count)
            terms.load[:] += self._pull
            fall_freely(terms, np.where(state.prescribed == 1, 0.0, np.nan))
        if state.laws.shape[1] > 0:
            friction = terms.friction[:count]
            state.laws[KINETIC, slots], state.laws[STATIC, slots] = friction, named.static(slots, friction)
            state.laws[IMPULSIVE, slots] = named.impulsive(slots)
        if named.yields and rung[0].inertia > 0.0:
            speed = np.zeros(count)
            self._approaches(trial, speed)
            named.rebound(slots, speed, terms.restitution[:count])

    def until_edge(self, trial: Trial) -> float:
        """The step, from terms where it begins, but no longer than a point that is pulled takes at its
        present rate to a place just across the edge of a range. Without momentum none has a rate of its own,
        and neither has one at which rigid bodies pushed in the last step, and did not bounce."""
        rung, h, terms, count, state, scratch, _ = trial
        if not rung[0].inertia > 0.0:
            return h
        slots = scratch.slots[:count]
        held = (state.modes[slots] != OPEN) & (not rung[0].compliant and not state.clock[0].bounced)
        rate = normals_of(terms, count) @ np.where(state.prescribed == 1, state.speed, state.v)
        rate[held] = 0.0
        return self.named.until_edge(slots, terms.gap[:count], rate, ACROSS, float(terms.rounding[0]), h)


@rare_kernel
def _approaches(trial: Trial, speed: Reals) -> None:
    """Write the speeds at which contacts with restitution approach."""
    rung, _, terms, contacts, state, _, _ = trial
    d, free = terms.contact_stiffness.shape[1], state.clock[0].free
    for k in range(contacts):
        if terms.restitution[k] > 0.0:
            speed[k] = -approach(d * k, terms, state.v, state.speed, state.free, free, rung[0].inertia)
