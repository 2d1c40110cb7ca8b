"""What is seen of a run between two steps: places, velocities, inputs, and contacts with their forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rungwise.content import ByContent
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.plain import brief
from rungwise.wording import choices


class ObservationError(InputError):
    """An observation was asked for something that the scene does not have; one line that names it."""


@dataclass(frozen=True, eq=False)
class Contacts(ByContent):
    """Contacts (k) that were closed in the last step, in a world of d dimensions, 2 in the plane and 3 in
    space; worlds without places of contacts leave points, normals and forces empty (k, 0).

    bodies: the two of each; points (k, d): where they touch; normals (k, d): unit, into the second body;
    forces (k, d): on the second body, in the world's axes; pushes (k,): their normal parts, >= 0; gaps (k,):
    distances, below 0 where compliant contacts yield; modes: stick, slip or open. Forces are nan on the
    kinematic rung, which has none. In a step with an impact on a rigid rung a force is impulse over step.
    """

    bodies: tuple[tuple[str, str], ...]
    points: Reals
    normals: Reals
    forces: Reals
    pushes: Reals
    gaps: Reals
    modes: tuple[str, ...]

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.bodies)

    def of(self, one: str, other: str | None = None) -> list[int]:
        """Numbers of the contacts of the body `one`, or of those that it has with the body `other`."""
        wanted = {one} if other is None else {one, other}
        return [k for k, pair in enumerate(self.bodies) if wanted <= set(pair)]


@dataclass(frozen=True, eq=False)
class Observation(ByContent):
    """The state of a run between two steps, for a controller.

    time: of the scene; q (n_q,): places, in the order of `names`; v (n_v,): velocities, in the order of
    `rates`; inputs: their values now; bodies: names; contacts: those of the last step, none before the first.
    """

    time: float
    names: tuple[str, ...]
    q: Reals
    rates: tuple[str, ...]
    v: Reals
    inputs: Mapping[str, float]
    bodies: tuple[str, ...]
    contacts: Contacts = field(repr=False)

    __repr__ = brief

    def __getitem__(self, name: str) -> float:
        """The place of a coordinate ("part.x"). Raises ObservationError."""
        return float(self.q[_number(name, self.names)])

    def speed(self, name: str) -> float:
        """The velocity with this name ("part.x", in space also "part.rx"). Raises ObservationError for an
        unknown name."""
        return float(self.v[_number(name, self.rates)])

    def force(self, one: str, other: str | None = None) -> float:
        """The normal force between the bodies `one` and `other`, or the sum of the normal forces on `one`; 0
        if nothing touches. Raises ObservationError for an unknown body."""
        for name in (one,) if other is None else (one, other):
            _number(name, self.bodies)
        return float(self.contacts.pushes[self.contacts.of(one, other)].sum())


def _number(name: str, known: Sequence[str]) -> int:
    if name not in known:
        raise ObservationError(f"observation: unknown {name!r}{choices(name, known)}")
    return known.index(name)


def without_places(pairs: Sequence[tuple[str, str]], pushes: Sequence[float]) -> Contacts:
    """Contacts of a world that knows only which bodies push each other."""
    count = len(pairs)
    none, unknown = np.zeros((count, 0)), np.full(count, np.nan)
    return Contacts(
        tuple(pairs), none, none, none, np.array(pushes, float), unknown, ("stick or slip",) * count
    )
