"""Joined bodies that turn far in a step: the energy that they gain or lose because forces change on the way.

A step from q and v to q' and v' takes weight where it begins, and inertial forces with v and v' (see
`rotors`), p, as in M (v' - v) = h (f - p). With kinetic energy T and the weight's potential V it adds

    T(q', v') - v'.M v' / 2 - T(q, v) + v.M v / 2 + V(q') - V(q) - h p.(v + v') / 2

beside the work of all other forces f: nothing if p were followed along the way. Free bodies keep their
momentum (see `spins`), fall on parabolas, and are left out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import stretch
from rungwise.kernel import Ints, Reals, RecordArray, kernel, record_type

if TYPE_CHECKING:
    import mujoco

PART, NOTHING = 0.05, 1e-9
"""Energy gained, over the greatest kinetic energy and the greatest change of the potential, from which on a
remark is made; and over the potential itself, up to which it is rounding. The first is held by
tests/simulation/spatial/test_turning.py."""

LOST = 0.5
"""Energy lost, over the same, from which on it is told: less is left than was lost. As a run begins, steps of
first order lose more than `PART` of what little there is."""


NUMBERS = record_type("counts", "eps gained most greatest low high kinetic height")
"""counts: whether any body is joined, and has momentum, of which the rung keeps the part `eps`; the energy
gained in its steps, and the most that was gained or lost, the greatest kinetic energy, the least and the
greatest potential; kinetic energy and potential where the last step ended."""


class Turning(Block):
    """Of the joined bodies of a run: numbers (1,), see `NUMBERS`; their velocities `old` and `new` (n,);
    gravity (3,), centres of masses (b, 3) in MuJoCo's memory; momentum (n,) is scratch."""

    numbers: RecordArray
    old: Reals
    new: Reals
    gravity: Reals
    centre: Reals
    momentum: Reals


def allocate_turning(model: mujoco.MjModel, data: mujoco.MjData) -> Turning:
    n = model.nv
    return Turning(
        numbers=np.zeros(1, NUMBERS), old=np.zeros(n), new=np.zeros(n), gravity=model.opt.gravity.copy(),
        centre=data.xipos, momentum=np.zeros(n),
    )  # fmt: skip


def remarks(turning: Turning) -> tuple[str, ...]:
    """A line where the energy gained is much."""
    own = turning.numbers[0]
    size, most, low, high = (
        float(x) for x in (own.greatest + own.high - own.low, own.most, own.low, own.high)
    )
    part, rounding = PART if most > 0.0 else LOST, NOTHING * max(abs(high), abs(low))
    if not own.counts or (math.isfinite(most) and not abs(most) > max(part * size, rounding)):
        return ()
    what = "gained" if most > 0.0 else "lost"
    return (
        f"step: joined bodies turn so far in a step that they {what} up to {abs(most):.3g} of energy"
        f" by it, beside {size:.3g} at most: weight is that where a step begins, and inertial forces"
        " those of its middle; a shorter step, or tol, follows them",
    )


@kernel
def take_energy(turning: Turning, mass: Reals) -> None:
    """Take over the kinetic energy of the velocities `new`, whose momentum is known, and the potential of
    masses (b,)."""
    own = turning.numbers[0]
    kinetic, own.height = potential(turning.new, turning.momentum, mass, turning.centre, turning.gravity)
    own.kinetic = own.eps * kinetic
    own.greatest = max(own.greatest, own.kinetic)
    own.low, own.high = min(own.low, own.height), max(own.high, own.height)


@kernel
def gain(turning: Turning, before: float, work: float) -> None:
    """Add what a step gained that began with an energy of `before`."""
    own = turning.numbers[0]
    own.gained += own.kinetic + own.height - before - work
    if abs(own.gained) > abs(own.most):
        own.most = own.gained
    if not math.isfinite(own.gained):
        own.most = math.inf


@kernel
def keep_joined(v: Reals, joined: Ints, own: Reals) -> None:
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
