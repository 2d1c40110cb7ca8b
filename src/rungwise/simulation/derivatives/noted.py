"""The problems that the core solves in a step in space, noted while it is taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import ContactProblem, Unknowns, trim
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.derivatives.steps import Array, Held
from rungwise.simulation.options import ModelError
from rungwise.system.spatial.features import Features
from rungwise.system.spatial.space import Space

OF_CONTACTS = ("gap", "friction", "restitution", "contact_stiffness", "contact_damping")
"""Terms with one entry for each contact."""
OF_FEATURES = ("geoms", "place", "along", "world", "used")


@dataclass(frozen=True, kw_only=True)
class SpaceHeld(Held):
    """Choices, the features of the step's contacts and their terms; `pushing` (c,): whether one is closed, or
    may be; `speed` (n,) in the step; how deep things overlapped before it, `ease` (see `models.assemble`),
    and how far contacts were looked for."""

    features: tuple[NDArray[Any], ...]
    terms: dict[str, Array]
    pushing: NDArray[np.bool_]
    speed: Array
    deep: float
    ease: float
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

    def _again(self, h: float) -> int:
        status = super()._again(h)
        if status == SUPPORTED:
            if self.noted and self.noted[-1].trial is self._trial:
                self.noted.pop()
            self.noted.append(self._solved())
        return status

    def _solved(self) -> Solved:
        terms, scratch, count, clock = self.terms, self.scratch, self.contacts, self.clock
        space = cast(Space, self.system)
        n, limited, d = int(clock["free"]), int(clock["limited"]), self.system.size.directions
        held = SpaceHeld(
            slots=scratch.slots[:count].copy(), gap=terms.gap[:count].copy(),
            stiffness=terms.contact_stiffness[:count].copy(), damping=terms.contact_damping[:count].copy(),
            bounced=np.zeros(count, bool), eps=float(clock["eps"]), theta=float(clock["theta"]),
            features=copied(space.found),
            terms=of_contacts(self, count), pushing=np.zeros(count, bool), speed=scratch.v_new.copy(),
            deep=self._deep, ease=float(terms.pause[0]), margin=space.margin,
        )  # fmt: skip
        problem = trim(self.problem, n, count, limited)
        found = Unknowns(
            scratch.mode[: count + limited].copy(), scratch.x[:n].copy(),
            scratch.contact_force[: count * d].copy(), scratch.limited_force[:limited].copy(),
        )  # fmt: skip
        return Solved(self._trial, problem, found, held)


def of_contacts(stepper: Stepper, count: int) -> dict[str, Array]:
    """The terms of the first contacts, rows (c, d n) and deformations (c, d) among them."""
    terms, d = stepper.terms, stepper.system.size.directions
    found = {name: getattr(terms, name)[:count].copy() for name in OF_CONTACTS}
    found["rows"] = terms.rows[: count * d].reshape(count, d * terms.rows.shape[1]).copy()
    found["deformation"] = terms.deformation[: count * d].reshape(count, d).copy()
    return found


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
