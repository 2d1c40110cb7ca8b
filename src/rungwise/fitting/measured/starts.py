"""Measured starts that overlap, moved out by the least motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.world.find import world_of

ROUNDS = 30
"""Times that the deepest overlap of each start is removed: a part in a corner takes several."""
CLEAR, STEP = 1e-6, 1e-4
"""Gap that is left, and change of a coordinate by which gaps are differentiated, as parts of the size of what
is moved: far above rounding, far below what is measured."""
FREE = 1e3
"""Times by which what was not measured may change more than what was, for joints to hold."""
PROBE = 0.437
"""Part of an interval at which it is seen whether a parameter moves bodies: no round number."""


class Apart(NamedTuple):
    """Starts q (s, n_q) moved out of overlaps, and by how far each was moved (s,), in lengths."""

    q: Reals
    moved: Reals


class Parting:
    """Moves starts of one scene out of overlaps. Where bodies are does not depend on most parameters: starts
    are moved once for all values of these. ends: the interval of each parameter that varies."""

    def __init__(self, scene: Any, ends: Mapping[str, tuple[float, float]]) -> None:
        self._world, self._ends = world_of(scene), ends
        self._moved = self._world.at().moved
        names = (*scene.template.coordinates, *self._world.velocities)
        self._led = np.isin(names, list(self._world.prescribed))
        self._known: dict[bytes, Apart] = {}
        self._placing: set[str] | None = None

    def placing(self, q: Reals, parameters: Mapping[str, float]) -> set[str]:
        """Those of the parameters that vary which change gaps or joints at places (s, n_q), others being as
        these, where they go from one end of their interval through its middle to the other."""
        if self._placing is None:
            self._placing = set()
            for name, (low, high) in self._ends.items():
                values = (low, PROBE * low + (1.0 - PROBE) * high, high)
                told = [self._told(q, dict(parameters) | {name: x}) for x in values]
                if any((each != told[0]).any() for each in told):
                    self._placing.add(name)
        return self._placing

    def _told(self, q: Reals, parameters: Mapping[str, float]) -> Reals:
        """Gaps at places (s, n_q), and the places at which joints hold."""
        place, freedom = self._world.place(parameters), np.ones(len(self._led))
        closed = place.closed(q, np.zeros((len(q), len(self._led) - q.shape[1])), freedom)[0]
        return np.concatenate([place.geometry(q)[0], closed], axis=1)

    def closed(self, starts: Reals, parameters: Mapping[str, float], known: Reals) -> Reals:
        """Starts (s, n_q + n_v) at which joints hold, at these parameters; known (n_q + n_v,): deviations of
        what was measured, 0 of all else, which follows where joints lead it."""
        n = len(self._moved.weights)
        freedom = np.where(known > 0.0, known, FREE * max(float(known.max()), 1e-12))
        freedom[self._led] = 0.0
        found = self._world.place(parameters).closed(starts[:, :n], starts[:, n:], freedom)
        return np.concatenate(found, axis=1)

    def __call__(self, q: Reals, parameters: Mapping[str, float]) -> Apart:
        """The places (s, n_q), each moved until no bodies overlap, at these parameters."""
        place = self._world.place(parameters)
        gaps = place.geometry(q)[0]
        key = q.tobytes() + gaps.tobytes()
        if key not in self._known:
            self._known[key] = self._apart(place, q, gaps)
        return self._known[key]

    def _apart(self, place: Any, q: Reals, gaps: Reals) -> Apart:
        moved, size = self._moved, self._moved.size
        free = np.flatnonzero(moved.weights > 0.0)
        found = q.copy()
        least = gaps.min(axis=1, initial=np.inf)
        left = np.flatnonzero(least < 0.0)
        for _ in range(ROUNDS):
            if not len(left):
                break
            which = gaps[left].argmin(axis=1)
            slope = np.zeros((len(left), len(free)))
            for j, column in enumerate(free):
                change = STEP * size / moved.weights[column]
                sides = []
                for sign in (1.0, -1.0):
                    tried = found[left].copy()
                    tried[:, column] += sign * change
                    sides.append(place.geometry(tried)[0][np.arange(len(left)), which])
                slope[:, j] = (sides[0] - sides[1]) / (2.0 * change)
            scaled = slope / moved.weights[free] ** 2
            power = np.maximum((slope * scaled).sum(axis=1), 1e-12)
            lack = CLEAR * size - gaps[left, which]
            found[np.ix_(left, free)] += (lack / power)[:, None] * scaled
            for four in moved.turns:
                turned = found[np.ix_(left, four)]
                found[np.ix_(left, four)] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
            gaps = gaps.copy()
            gaps[left] = place.geometry(found[left])[0]
            left = left[gaps[left].min(axis=1) < 0.0]
        return Apart(found, np.linalg.norm((found - q) * moved.weights, axis=1))
