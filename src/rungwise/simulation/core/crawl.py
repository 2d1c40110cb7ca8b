"""Runs whose steps lead nowhere, and what keeps steps short: the same in the plane and in space.

Steps that are refused, or end early, vote for the cause and the slot of the contact at fault. The vote is
that of Boyer and Moore (MJRTY, 1991): what more than half of the steps name is what is left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.kernel import Ints, Reals, inner_kernel, kernel

INSOLUBLE, OVERLAPPING, TORN, MISSING, MEETING, FAR, BENT = 1, 2, 3, 4, 5, 6, 7
"""Causes: the step's problem has no solution; bodies would overlap; a rigid joint would open; contacts would
be missed on the way; bodies meet that may bounce; things move farther than contacts can be followed; the
error is above what is allowed."""
CAUSES = 8
"""A vote is CAUSES slot + cause; where no slot is to blame, it is the cause alone, less CAUSES."""
PATIENCE, LEAST = 100_000, 0.1
"""Attempts at steps that may lead no farther than one nominal step, and the least part of it for which they
are counted. Shipped scenes need up to 4000, where the error allowed is a millionth of their shapes."""


class Leap(NamedTuple):
    """A step without momentum that goes far: from a time, of length h, how far as a length, and its motion v
    (n,)."""

    time: float
    h: float
    far: float
    v: Reals


@inner_kernel
def lead_nowhere(attempts: int, span: float, step: float) -> bool:
    """Whether so many attempts, which led on by `span`, are more than nominal steps of length `step` need."""
    return bool(attempts > PATIENCE * max(span / step, LEAST))


@kernel
def culprit(cause: int, contacts: int, slots: Ints, force: Reals, gap: Reals) -> int:
    """The slot of the contact at fault in an attempt that was refused, or -1: of the deepest overlap, or of
    the greatest force before it; slots, gap (k,) of the contacts, force (s, d) by slot."""
    if cause == FAR:
        return -1
    found, pressed, most, least = -1, -1, 0.0, math.inf
    for k in range(contacts):
        before = force[slots[k], 0]
        if before > most:
            pressed, most = slots[k], before
        if gap[k] < least:
            found, least = slots[k], gap[k]
    return int(pressed if pressed >= 0 and cause != OVERLAPPING else found)


@inner_kernel
def voted(ballot: int, blamed: int, votes: int) -> tuple[int, int]:
    """What is blamed after one more vote, and by how many votes."""
    if votes == 0:
        return ballot, 1
    return blamed, votes + 1 if blamed == ballot else votes - 1


def why_nowhere(attempts: int, span: float, step: float, short: str) -> str:
    """The rule in words; `short` says what keeps steps short, or is empty."""
    because = f": {short}" if short else ""
    return (
        f"{attempts} attempts at steps advanced by {span:.3g} in all, less than one step of {step:g}{because}"
    )
