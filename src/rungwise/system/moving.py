"""The contract between a system that moves and the core, which takes its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.system.terms import Terms


@dataclass(frozen=True)
class Moment:
    """Where a step of length h begins: coordinates q (n_q,), velocities v (n_v,), and the rung."""

    time: float
    q: Reals
    v: Reals
    h: float
    rung: Rung


@dataclass(frozen=True)
class Size:
    """n_q coordinates and n_v velocities; slots for contact features, each of d directions, the normal first;
    limited rows; and a length: the size of the smallest thing that may be hit."""

    coordinates: int
    velocities: int
    slots: int
    directions: int
    limited: int
    length: float


class System(Protocol):
    """Bodies that move as q' = G(q) v. Terms follow `system.terms`, in the units of the system."""

    size: Size

    def start(self) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) at t = 0, without overlap."""

    def speeds(self, time: float) -> Reals:
        """Prescribed velocities (n_v,); nan for velocities that are free."""

    def fill(self, moment: Moment, terms: Terms, reach: float) -> Sequence[int]:
        """Fill `terms` with M, metric, loads, gains, and with all contacts whose gap is at most `reach` and
        can be changed by something free, but not `heft`, `fall` and deformations; returns the slot of each
        contact. A slot belongs to one feature (a vertex and a face, two spheres) for the whole run."""

    def integrate(self, q: Reals, v: Reals, h: float) -> Reals:
        """The coordinates (n_q,) that v reaches from q within h."""

    def least_gap(self, q: Reals) -> float:
        """The smallest gap of all contacts; inf where there is none."""

    def fastest(self, q: Reals, v: Reals) -> float:
        """A bound on the speed with which any two points approach each other."""

    def energy(self, q: Reals, v: Reals) -> float:
        """Kinetic energy, and the potential energy of loads that have one."""
