"""Since when parts of conditions hold that must hold for a time: as in the plane (see
`planar.state.held_since`)."""

from __future__ import annotations

import math

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.language.expression import CONDITIONS, STACK, TIMES, Lasting, Programs, evaluate, holds
from rungwise.simulation.moving.values import Values
from rungwise.simulation.watched.held_since import HALVES, REACHED


class _Part:
    """A part that must hold for a time."""

    def __init__(self, path: str, part: Lasting) -> None:
        self.path, self.slot = path, part.slot
        self._programs, self._stack = Programs([part.held, part.span]), np.zeros(STACK)

    def holds(self, values: Reals) -> bool:
        first, last = self._programs.table[0]
        return bool(holds(self._programs.code, self._programs.constants, first, last, values, self._stack))

    def span(self, values: Reals) -> float:
        first, last = self._programs.table[1]
        return float(
            evaluate(self._programs.code, self._programs.constants, first, last, values, self._stack)
        )


class Times:
    """The times since when parts of the scene's conditions, and of those of its segments, have held, in
    slots of the `values`: inf where one does not hold, -inf once it has held long enough."""

    def __init__(self, values: Values) -> None:
        self._values = values
        own = values.scene.conditions
        self._own = [_Part(name, part) for name, code in own.items() for part in code.lasting]
        self._until = [
            [_Part(f"inputs.{k}.until", part) for part in code.lasting] for k, code in enumerate(values.until)
        ]
        self._segment = -1

    def parts(self, segment: int) -> list[_Part]:
        """Those of the scene and of a segment."""
        return self._own + (self._until[segment] if segment < len(self._until) else [])

    def impossible(self) -> str:
        """What is wrong with a time to hold for, empty if nothing is."""
        for part in (*self._own, *(part for parts in self._until for part in parts)):
            span = part.span(self._values.all)
            if not 0.0 <= span < math.inf:
                return f"{part.path}: the time after 'for' must be finite and >= 0, not {span:g}"
        return ""

    def go_on(self, segment: int) -> None:
        """Go on in this segment with the times in the values."""
        self._segment = segment

    def enter(self, segment: int) -> None:
        """Begin to note the times of a segment, unless it is on."""
        if segment != self._segment and segment < len(self._until):
            first = self._values.first_time + TIMES * (len(CONDITIONS) - 1)
            self._values.all[first : first + TIMES] = math.inf
            self._segment = segment
            self.note(segment)
            self.end(segment, self._values.now)

    def note(self, segment: int, begun: Reals | None = None) -> None:
        """Note since when parts hold, after a step that began with the values `begun`; since now if there was
        none."""
        now = self._values.all
        for part in self.parts(segment):
            if not part.holds(now):
                now[part.slot] = math.inf
            elif now[part.slot] == math.inf:
                now[part.slot] = self._values.now if begun is None else self._turned(part, begun)

    def end(self, segment: int, reached: float = -math.inf) -> float:
        """When the first part will have held long enough, inf if none waits; those that have by the time
        `reached` do from now on."""
        values, soonest = self._values.all, math.inf
        for part in self.parts(segment):
            since = float(values[part.slot])
            if not math.isfinite(since):
                continue
            span = part.span(values)
            over = since + span if span > 0.0 else -math.inf
            if over <= reached:
                values[part.slot] = -math.inf
            else:
                soonest = min(soonest, over)
        return soonest

    def turned(self, segment: int) -> bool:
        """Whether some part holds that did not at the start of the step, or the other way round."""
        values = self._values.all
        return any(part.holds(values) != (values[part.slot] < math.inf) for part in self.parts(segment))

    def ended(self, segment: int, h: float, begun: Reals, exact: bool) -> float:
        """Note the times after a step of length h; returns when the first of them is over, inf if none waits.
        With `exact` this may be within the step, which is then to be taken back."""
        now = self._values.now
        self.note(segment, begun)
        end = self.end(segment)
        if exact and now - h < end < now - REACHED * h:
            return end
        return self.end(segment, now + REACHED * h)

    def _turned(self, part: _Part, begun: Reals) -> float:
        """When a part began to hold on the way of a step, places being linear in time."""
        values, ended = self._values, self._values.all.copy()
        low, high = 0.0, 1.0
        for _ in range(HALVES):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            values.between(middle, begun, ended)
            low, high = (low, middle) if part.holds(values.all) else (middle, high)
        values.all[:] = ended
        return values.now - (1.0 - high) * (values.now - float(begun[values.time]))
