"""Steps that are taken back, because a condition begins to hold on their way: as in the plane (see
`planar.state.verdicts.look_back` and `planar.state.inputs.shortened`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.moving.held_since import Times
from rungwise.simulation.moving.values import Values
from rungwise.simulation.watched.inputs import LOCATED
from rungwise.simulation.watched.verdicts import SIGHTS

DATED = 0.25
"""Part of the nominal step to which the first condition on the way of a longer one is dated."""


@dataclass(frozen=True)
class Begun:
    """A run before a step: all that the step changes; `core`: its core's memory."""

    time: float
    q: Reals
    v: Reals
    core: Reals
    values: Reals
    residual: float

    @classmethod
    def of(cls, stepper: Stepper, values: Values, core: Reals) -> Begun:
        return cls(stepper.time, stepper.q, stepper.v.copy(), core, values.all.copy(), stepper.residual)

    def restore(self, stepper: Stepper, values: Values) -> None:
        """Take the step back, once the run has recalled the core's memory."""
        stepper.time, stepper.q, stepper.residual = self.time, self.q, self.residual
        stepper.state.v[:], values.all[:] = self.v, self.values
        stepper.outcome, stepper.certificate = Code.RUNNING, None


def sooner(
    begun: Begun, values: Values, times: Times, segment: int, h: float, step: float, longest: float,
    past: bool,
) -> float:  # fmt: skip
    """The length of step to take instead of the one just taken, of length h, so that conditions of the
    scene are seen to a nominal step, parts of them turn that must hold for a time, and the one that ends
    the segment as well as its time is wanted; h where the step may stay. `past`: whether one was taken
    back before."""
    if h > step:
        clear = _clear(begun.values, values, times, segment, h, step, longest)
        if clear < 1.0:
            return max(min(clear, 0.5) * h if past else clear * h, step)
    after = values.until_margin(segment)
    if not after >= 0.0 or h <= LOCATED * step:
        return h
    ended = values.all.copy()
    values.all[:] = begun.values
    before = values.until_margin(segment)
    values.all[:] = ended
    part = before / (before - after) if before != after else 0.5
    return h * (min(max(part, 0.1), 0.5) if math.isfinite(part) else 0.5)


def _clear(
    begun: Reals, values: Values, times: Times, segment: int, h: float, step: float, longest: float
) -> float:
    """Part of the step up to which no condition holds, and no part of one turns that must hold for a time; 1
    if there is none."""
    ended = values.all.copy()

    def met(part: float) -> bool:
        values.between(part, begun, ended)
        if values.judge()[0] != Code.RUNNING or values.until_margin(segment) >= 0.0:
            return True
        return times.turned(segment)

    count = max(1, math.ceil(SIGHTS * h / longest - 1e-9))
    before, after = 0.0, next((k / count for k in range(1, count + 1) if met(k / count)), np.inf)
    found = after <= 1.0
    if found:
        before = after - 1.0 / count
    while found and (after - before) * h > DATED * step:
        middle = 0.5 * (before + after)
        if not before < middle < after:
            break
        before, after = (before, middle) if met(middle) else (middle, after)
    values.all[:] = ended
    return max(before, 0.0) if found else 1.0
