"""The contract between a system that moves and the core of the simulation, which takes its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step import Widths
from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.system.terms import Terms, whole

SLIP = 0.25
"""Relative motion of a pair, or overlap on the way, as a part of its thickness (the sum of both widths), that
needs no further look: a shape half through the other is seen, from the side on which it entered."""
LOOKS = 64
"""Parts in which the way of a pair is looked at; a way that needs more is taken in shorter steps."""


class Moment(NamedTuple):
    """Where a step of length h begins: coordinates q (n_q,), velocities v (n_v,), and eps, the part of
    inertia that the rung keeps; `metric`: whether the rung asks for motions of unit masses instead."""

    time: float
    q: Reals
    v: Reals
    h: float
    inertia: float
    metric: bool


class Asked(Block):
    """What conditions read of a state beside the time, places and speeds: gaps and forces of pairs of bodies
    (k, 2), the lower number first, and the place (k,) of each among all contacts; whether they read anything
    at all, poses, and how far bodies go in a nominal step, `reads` (3,).

    firsts (3,): where among the values poses, gaps and ways begin; contacts (1,): how many there are; owner
    (n_v,): the body of each velocity; step (1,) is the nominal one.
    """

    pairs: Ints
    place: Ints
    reads: Ints
    firsts: Ints
    contacts: Ints
    owner: Ints
    step: Reals


ANYTHING, POSED, RESTS = 0, 1, 2
"""Places in `Asked.reads`."""
OF_POSES, OF_GAPS, OF_WAYS = 0, 1, 2
"""Places in `Asked.firsts`."""


class FurtherLaws(Protocol):
    """Laws of contact beside Coulomb's friction and Newton's restitution, of the contacts of a system's last
    `fill`, which are given by their slots (c,). holds, bounces, yields: whether a contact has static
    friction, Poisson's restitution, or one that falls with speed; within: the greatest gap at which one
    pulls, -inf where none does."""

    holds: bool
    bounces: bool
    yields: bool
    within: float

    def static(self, slots: Ints, friction: Reals) -> Reals:
        """Friction (c,) of contacts while they stick, from their kinetic `friction` (c,)."""

    def impulsive(self, slots: Ints) -> NDArray[np.bool_]:
        """Whether restitution (c,) is of impulses."""

    def rebound(self, slots: Ints, speed: Reals, restitution: Reals) -> None:
        """Let restitution (c,) be that at speeds of approach (c,)."""

    def pull(self, slots: Ints, gap: Reals, pushed: Ints) -> Reals:
        """The forces (c,) with which contacts pull, by gaps (c,) and whether they pushed in the last step
        (c,)."""

    def until_edge(
        self, slots: Ints, gap: Reals, rate: Reals, across: float, rounding: float, h: float
    ) -> float:
        """A step of length h, but no longer than any contact takes, with gaps (c,) at these rates (c,), to a
        place beyond the edge of its pull, by `across` of its range, or by the rounding of gaps."""


@dataclass(frozen=True)
class Size:
    """n_q coordinates and n_v velocities; slots for contact features, each of d directions, the normal first;
    limited rows; a length: the size of the smallest thing that may be hit; how far two things may move to
    each other before one can be through the other; the widths of entries where
    terms say where they are, and keep no others; further laws of
    its contacts, None where they have none; whether friction may differ by direction; and how many contacts
    may be within reach at once, None where as many as there are slots."""

    coordinates: int
    velocities: int
    slots: int
    directions: int
    limited: int
    length: float
    thin: float = math.inf
    widths: Widths | None = None
    laws: FurtherLaws | None = None
    skewed: bool = False
    at_once: int | None = None


class Crowded(InputError):
    """More contacts are within reach than a system has room for."""


class System(Protocol):
    """Bodies that move as q' = G(q) v. Terms follow `system.terms`, in the units of the system.

    A system may also have `falls` (n_v,): the accelerations that constant loads give velocities which nothing
    else but contacts changes, 0 of the others. Steps of controlled length in which nothing touches lead
    these along parabolas.
    """

    size: Size

    @property
    def driving(self) -> Reals:
        """The part of the load in the last `fill` that drives are (n_v,)."""

    def start(self) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) at t = 0, without overlap."""

    def speeds(self, time: float) -> Reals:
        """Prescribed velocities (n_v,); nan for velocities that are free."""

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        """Fill `terms` with M, metric (where eps is 0), loads, `fall` (see `fall_freely`), gains, and with
        all contacts whose gap is at most `reach` and can be changed by something free, but not `heft` and
        deformations; returns the slot of each contact, and whether the last accepted step did not have it. A
        slot belongs to one feature (a vertex and a face, two spheres) as long as steps see it. Raises Crowded
        where there is no room for all."""

    def accept(self) -> None:
        """The contacts of the last `fill` are those of a step that is taken."""

    def integrate(self, q: Reals, v: Reals, h: float) -> Reals:
        """The coordinates (n_q,) that v reaches from q within h."""

    def least_gap(self, q: Reals) -> float:
        """The smallest gap of all contacts; inf where there is none."""

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        """Whether v may lead anything through another within h, seen neither at q nor at the end. Asked only
        where two things move to each other by more than `size.thin`, after a `fill` that reached as far."""

    def fastest(self, q: Reals, v: Reals) -> float:
        """A bound on the speed with which any two points approach each other."""

    def energy(self, q: Reals, v: Reals) -> float:
        """Kinetic energy, and the potential energy of loads that have one."""


def fall_freely(terms: Terms, speeds: Reals) -> None:
    """Fill in `fall` from M and the load, by a dense solution, where `speeds` (n_v,) are nan."""
    free = np.flatnonzero(np.isnan(speeds))
    terms.fall[:] = 0.0
    terms.fall[free] = np.linalg.solve(whole(terms, terms.inertia)[np.ix_(free, free)], terms.load[free])
