"""The problems that the core solves in a step in space, noted while it is taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import ContactProblem, Unknowns
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.derivatives.steps import Array, Held, found_in, terms_of
from rungwise.simulation.options import ModelError
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.spatial.features import Features
from rungwise.system.spatial.space import Space

OF_FEATURES = ("geoms", "place", "along", "world", "used")


@dataclass(frozen=True, kw_only=True)
class SpaceHeld(Held):
    """Choices, and the features of the step's contacts; `pushing` (c,): whether one is closed, or may be;
    `speed` (n,) in the step; how deep things overlapped before it, and how far contacts were looked for."""

    features: tuple[NDArray[Any], ...]
    pushing: NDArray[np.bool_]
    speed: Array
    deep: float
    margin: float


class Solved(NamedTuple):
    """What the core solved at a place: its problem, what it found, and its choices."""

    trial: Array
    problem: ContactProblem
    found: Unknowns
    held: SpaceHeld


class Noting(Stepper):
    """A stepper that notes the last problem that it solved at each place."""

    noted: list[Solved]

    def attempt(self, h: float) -> int:
        """An attempt that holds is looked at again, from place to place."""
        status = super().attempt(h)
        tried, reach = self.tried, float(self.note["reach"])
        end, v, places, ways = (part.copy() for part in (tried.trial, tried.v, tried.places, tried.ways))
        self.noted = []
        for k in range(int(self.note["count"]) if status == SUPPORTED else 0):
            if k > 0:
                self.fill_at(places[k], ways[k], h, reach)
            else:
                self.fill(h, reach)
            self.again(h)
            self.noted.append(
                Solved(places[k] if k > 0 else self.q.copy(), *found_in(self.trial(h)), self._held())
            )
        tried.trial[:], tried.v[:] = end, v
        return status

    def _held(self) -> SpaceHeld:
        terms, scratch, count, clock = self.terms, self.scratch, self.contacts, self.clock
        space, none = cast(Space, self.system), np.zeros(count, bool)
        return SpaceHeld(
            slots=scratch.slots[:count].copy(), terms=terms_of(terms, count), bounced=none,
            eps=float(clock["eps"]), theta=float(clock["theta"]), ease=float(terms.pause[0]),
            features=copied(space.found), pushing=none, speed=scratch.v_new.copy(),
            deep=float(self.note["deep"]),
            margin=space.margin,
        )  # fmt: skip


def copied(features: Features) -> tuple[NDArray[Any], ...]:
    """The arrays of features."""
    return tuple(getattr(features, name).copy() for name in OF_FEATURES)


def restore(kept: Features, features: tuple[NDArray[Any], ...]) -> None:
    """Know these features. Raises ModelError where another model has room for others."""
    for name, array in zip(OF_FEATURES, features, strict=True):
        target = getattr(kept, name)
        if target.shape != array.shape:
            raise ModelError("step: room for contacts is about to change; there is no derivative here")
        target[:] = array
