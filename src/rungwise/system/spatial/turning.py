"""Joined bodies that turn far in a step: the energy that they gain or lose because forces change on the way.

A step from q and v to q' and v' takes weight where it begins, and inertial forces with v and v' (see
`rotors`), p, as in M (v' - v) = h (f - p). With kinetic energy T and the weight's potential V it adds

    T(q', v') - v'.M v' / 2 - T(q, v) + v.M v / 2 + V(q') - V(q) - h p.(v + v') / 2

beside the work of all other forces f: nothing if p were followed along the way. Free bodies keep their
momentum (see `spins`), fall on parabolas, and are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rungwise.contact.step import stretch
from rungwise.kernel import Ints, Reals, kernel, steady
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    from rungwise.system.spatial.space import Space

PART, NOTHING = 0.05, 1e-9
"""Energy gained, over the greatest kinetic energy and the greatest change of the potential, from which on a
remark is made; and over the potential itself, up to which it is rounding. The first is held by
tests/simulation/spatial/test_turning.py."""

LOST = 0.5
"""Energy lost, over the same, from which on it is told: less is left than was lost. As a run begins, steps of
first order lose more than `PART` of what little there is."""


@dataclass
class Turning:
    """Of the joined bodies of a run in `space`, on a rung that keeps the part `eps` of inertia: the energy
    gained in its steps, and the most that was gained or lost, the greatest kinetic energy, and the least and
    the greatest potential."""

    space: Space
    eps: float
    gained: float = 0.0
    most: float = 0.0
    energy: float = 0.0
    low: float = math.inf
    high: float = -math.inf
    _place: Reals | None = field(init=False, default=None)
    _kinetic: float = field(init=False, default=0.0)
    _height: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        space = self.space
        self._counts = self.eps > 0.0 and bool(space.loads.joined.any())
        self._old, self._new = np.zeros(space.model.nv), np.zeros(space.model.nv)
        self._product = np.zeros(space.model.nv)
        self._gravity, self._centres = space.model.opt.gravity.copy(), space.data.xipos
        self._keep, self._potential, self._change = steady(keep), steady(potential), steady(change)

    def begin(self, q: Reals, v: Reals) -> None:
        """A step begins at q and v, if not where the last one ended."""
        if self._counts and q is not self._place:
            self._look(q, v)

    def end(self, q: Reals, v: Reals, h: float, terms: Terms) -> None:
        """It has led to q and v within h, with the terms of its last `fill`."""
        if not self._counts:
            return
        before, (self._old, self._new) = self._kinetic + self._height, (self._new, self._old)
        self._look(q, v)
        work = self._change(
            terms.inertia, terms.entries.matrices, self.space.loads.taken, self._old, self._new, self.eps, h
        )
        self.gained += self._kinetic + self._height - before - work
        if abs(self.gained) > abs(self.most):
            self.most = self.gained
        if not math.isfinite(self.gained):
            self.most = math.inf

    def _look(self, q: Reals, v: Reals) -> None:
        """Take over velocities of joined bodies, their kinetic energy, and the potential of their weight."""
        space, loads = self.space, self.space.loads
        self._place = q
        self._keep(v, loads.joined, self._new)
        space.put_momentum(q, self._new, self._product)
        found = self._potential(self._new, self._product, loads.weighs, self._centres, self._gravity)
        self._kinetic, self._height = self.eps * found[0], found[1]
        self.energy = max(self.energy, self._kinetic)
        self.low, self.high = min(self.low, self._height), max(self.high, self._height)

    def remarks(self) -> tuple[str, ...]:
        """A line where the energy gained is much."""
        size = self.energy + self.high - self.low
        part, rounding = PART if self.most > 0.0 else LOST, NOTHING * max(abs(self.high), abs(self.low))
        if math.isfinite(self.most) and not abs(self.most) > max(part * size, rounding):
            return ()
        what = "gained" if self.most > 0.0 else "lost"
        return (
            f"step: joined bodies turn so far in a step that they {what} up to {abs(self.most):.3g} of energy"
            f" by it, beside {size:.3g} at most: weight is that where a step begins, and inertial forces"
            " those of its middle; a shorter step, or tol, follows them",
        )


@kernel
def keep(v: Reals, joined: Ints, own: Reals) -> None:
    """Fill own (n,) with the velocities of joined bodies."""
    for i in range(len(v)):
        own[i] = v[i] if joined[i] else 0.0


@kernel
def potential(v: Reals, momentum: Reals, mass: Reals, centre: Reals, gravity: Reals) -> tuple[float, float]:
    """Kinetic energy, and the potential of masses (b,) at centres (b, 3)."""
    kinetic, height = 0.0, 0.0
    for i in range(len(v)):
        kinetic += 0.5 * v[i] * momentum[i]
    for b in range(len(mass)):
        if mass[b] > 0.0:
            for i in range(3):
                height -= mass[b] * centre[b, i] * gravity[i]
    return kinetic, height


@kernel
def change(M: Reals, stretches: Ints, taken: Reals, old: Reals, new: Reals, eps: float, h: float) -> float:
    """The work of what changes velocities (n,) from old to new, and of the forces taken, in a step of h."""
    work = 0.0
    for i in range(len(old)):
        push = h * taken[i]
        low, high = stretch(stretches, i, len(old))
        for j in range(low, high):
            push += eps * M[i, j - low] * (new[j] - old[j])
        work += 0.5 * (old[i] + new[i]) * push
    return work
