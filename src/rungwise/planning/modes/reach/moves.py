"""Inputs over time that lead an arm along places: ramps of the targets of its servos, which carry its
weight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.reach.arm import Arm, turned_by

PACE, ENTERS = 0.5, 0.1
"""Parts of the rates of inputs with which joints turn: through free space, and straight into the goal."""
HOLDS = 8.0
"""How long an arm waits after a way, over how much its joints lag behind their targets."""
FREE, HOLD, ENTER = "transit", "rest", "enter"
"""Labels of segments: a way through free space, a wait, and a straight way into the goal."""


class Ramp(NamedTuple):
    """A segment: inputs (u,) at its end, how long it lasts, and its label."""

    levels: Reals
    duration: float
    label: str


def ramps(
    arm: Arm, way: Reals, before: Reals, label: str, pace: float, shift: Reals | None = None
) -> list[Ramp]:
    """Ramps from inputs `before` (u,) along the places (m, n_q) of a way, at a part of the rates of
    inputs; with the targets of the joints shifted (k,), where that is given."""
    found, last = list[Ramp](), before
    for place in way:
        own = place if shift is None else arm.posed(place, place[arm.places] + shift)
        levels = arm.levels(own, before)
        took = lasts(arm, last, levels, pace)
        if took > 0.0:
            found.append(Ramp(levels, took, label))
            last = levels
    return found


def lasts(arm: Arm, a: Reals, b: Reals, pace: float) -> float:
    """How long a ramp from inputs (u,) to others takes at a part of their rates."""
    found = 0.0
    at = 0
    for _, driven in arm.chains:
        columns = list(driven.columns)
        turns = np.abs(driven.led.matrix @ (b - a)[columns])
        rates = arm.rates[at : at + len(turns)]
        found, at = max(found, float((turns / rates).max(initial=0.0))), at + len(turns)
    return found / pace


def hold(arm: Arm, levels: Reals) -> Ramp:
    """A wait at inputs (u,) until joints have come to their targets."""
    return Ramp(levels, HOLDS * arm.lag, HOLD)


def beyond(arm: Arm, way: Reals, direction: Reals, length: float, count: int) -> Reals:
    """Places (count, n_q) that go on straight (3,) from the end of a way (m, n_q), so far together."""
    q, found = way[-1], list[Reals]()
    begun = arm.poses(q)
    for part in np.linspace(0.0, length, count + 1)[1:]:
        aims = begun.copy()
        aims[:, :3] += part * direction
        q, _ = arm.brought(q, aims)
        found.append(q)
    return np.array(found)


def shifted(arm: Arm, q: Reals, by: Reals, turn: Reals) -> Reals:
    """By how much joints (k,) are to differ so that bodies are shifted (3,) and turned (3,) from where
    they are at a place (n_q,)."""
    aims = arm.poses(q)
    aims[:, :3] += by
    for pose in aims:
        pose[3:] = turned_by(pose[3:], turn)
    found, _ = arm.brought(q, aims)
    return np.asarray((found - q)[arm.places])
