"""Measured starts, moved out of overlaps and onto contacts that last.

A body that another one pushes touches it; a measured start overlaps it, or leaves a gap, by noise. If
overlaps alone were removed, runs would begin to push late in the mean. Contacts that last, in the frames
about a start, are closed, too. Of all states at which that is so, the most probable one is taken: the
nearest by the deviations of the measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.simulation.state import PlaceError
from rungwise.world.contract import Moved
from rungwise.world.find import world_of
from rungwise.world.nearest import Nearest

ROUNDS = 30
"""Times that the deepest overlap of each start is removed: a part in a corner takes several."""
CLEAR, STEP = 1e-6, 1e-4
"""Gap that is left, and change of a coordinate by which gaps are differentiated, as parts of the size of what
is moved: far above rounding, far below what is measured."""
FREE = 1e3
"""Times by which what was not measured may change more than what was, for joints to hold."""
FAR, MEAN = 4.0, 2.5
"""A contact lasts about a start where none of its gaps differs from 0 by so many deviations, nor their mean
by so many of its own."""
SURE = 1e-3
"""Part of the least deviation, in lengths, by which coordinates are off that were not measured: these begin
at the scene's start, and are moved only where nothing else can be."""
PROBE = 0.437
"""Part of an interval at which it is seen whether a parameter moves bodies: no round number."""


class Apart(NamedTuple):
    """Starts q (s, n_q) moved out of overlaps, and by how far each was moved (s,), in lengths."""

    q: Reals
    moved: Reals


class Parting:
    """Moves starts of one scene out of overlaps. Where bodies are does not depend on most parameters: starts
    are moved once for all values of these. ends: the interval of each parameter that varies; deviations
    (n_q,): of the measured places, 0 of those that were not measured."""

    def __init__(self, scene: Any, ends: Mapping[str, tuple[float, float]], deviations: Reals) -> None:
        self._scene, self._world, self._ends = scene, world_of(scene), ends
        self._moved = self._world.at().moved
        self._scale = _likely(deviations, self._moved)
        names = (*scene.template.coordinates, *self._world.velocities)
        self._led = np.isin(names, list(self._world.prescribed))
        self._known: dict[bytes, Apart] = {}
        self._lasting: dict[bytes, NDArray[np.bool_]] = {}
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

    def lasting(self, q: Reals, around: Reals, parameters: Mapping[str, float]) -> NDArray[np.bool_]:
        """Which contacts (s, c) last about the starts q (s, n_q): their gaps in the measured frames around
        these (s, w, n_q), nan where there is none, differ from 0 by no more than noise. There must be such
        frames before and after: a trial may begin at a small gap."""
        key = q.tobytes() + around.tobytes() + repr(sorted(parameters.items())).encode()
        if key not in self._lasting:
            place = self._world.place(parameters)
            known = np.asarray(np.isfinite(around).all(axis=2))
            places = np.where(known[..., None], around, q[:, None]).reshape(-1, q.shape[1])
            gaps = place.geometry(places)[0]
            gaps = np.where(known[..., None], gaps.reshape(*known.shape, -1), 0.0)
            noise = np.sqrt(((self._slopes(place, q) * self._scale) ** 2).sum(axis=2))
            middle = known.shape[1] // 2
            both = known[:, :middle].any(axis=1) & known[:, middle + 1 :].any(axis=1)
            frames = np.maximum(known.sum(axis=1), 1)[:, None]
            mean = np.abs(gaps.sum(axis=1)) / frames
            near = np.asarray((np.abs(gaps) <= FAR * noise[:, None]).all(axis=1))
            near &= (mean <= MEAN * noise / np.sqrt(frames)) & np.asarray(both)[:, None] & (noise > 0.0)
            self._lasting[key] = near
        return self._lasting[key]

    def __call__(self, q: Reals, parameters: Mapping[str, float], lasting: NDArray[np.bool_]) -> Apart:
        """The places (s, n_q), each moved until no bodies overlap and contacts that last (s, c) are closed,
        at these parameters."""
        place = self._world.place(parameters)
        gaps = place.geometry(q)[0]
        key = q.tobytes() + gaps.tobytes() + lasting.tobytes() + repr(sorted(parameters.items())).encode()
        if key not in self._known:
            found = self._apart(place, q, gaps, lasting)
            self._known[key] = self._accepted(place, q, found, parameters)
        return self._known[key]

    def _accepted(self, place: Any, q: Reals, found: Reals, parameters: Mapping[str, float]) -> Apart:
        """Places (s, n_q) that were found from q, those at which no run begins moved to the nearest one at
        which one does, where that is near."""

        def begins(at: Reals) -> Reals:
            if place.geometry(at[None])[1][0]:
                raise PlaceError("overlaps")
            return at

        nearest = Nearest(self._scene, parameters)
        for i in np.flatnonzero(place.geometry(found)[1]):
            with suppress(PlaceError):
                found[i], _ = nearest(found[i], begins)
        return Apart(found, np.linalg.norm((found - q) * self._moved.weights, axis=1))

    def _slopes(self, place: Any, q: Reals) -> Reals:
        """Changes (s, c, n_q) of gaps at places (s, n_q) with coordinates that may be moved, 0 of others."""
        moved, contacts = self._moved, place.geometry(q)[0].shape[1]
        found = np.zeros((len(q), contacts, q.shape[1]))
        for column in np.flatnonzero(self._scale > 0.0):
            change = STEP * moved.size / moved.weights[column]
            sides = []
            for sign in (1.0, -1.0):
                tried = q.copy()
                tried[:, column] += sign * change
                sides.append(place.geometry(tried)[0])
            found[..., column] = (sides[0] - sides[1]) / (2.0 * change)
        return found

    def _apart(self, place: Any, q: Reals, gaps: Reals, lasting: NDArray[np.bool_]) -> Reals:
        moved, clear, found = self._moved, CLEAR * self._moved.size, q.copy()
        lack = _lack(gaps, lasting, clear)
        left = np.flatnonzero(lack.any(axis=1))
        for _ in range(ROUNDS):
            if not len(left):
                break
            own = np.arange(len(left))
            which = np.abs(lack[left]).argmax(axis=1)
            slope = self._slopes(place, found[left])[own, which]
            scaled = slope * self._scale**2
            power = np.maximum((slope * scaled).sum(axis=1), 1e-300)
            found[left] += (lack[left, which] / power)[:, None] * scaled
            for four in moved.turns:
                turned = found[np.ix_(left, four)]
                found[np.ix_(left, four)] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
            lack[left] = _lack(place.geometry(found[left])[0], lasting[left], clear)
            left = left[lack[left].any(axis=1)]
        return found


def _lack(gaps: Reals, lasting: NDArray[np.bool_], clear: float) -> Reals:
    """By how much gaps (s, c) are too small, or too great where contacts last; 0 where they are neither."""
    wrong = (gaps < 0.0) | (lasting & (gaps > 2.0 * clear))
    return np.asarray(np.where(wrong, clear - gaps, 0.0))


def _likely(deviations: Reals, moved: Moved) -> Reals:
    """How far each coordinate (n_q,) may be off, 0 of those that are not moved: as far as the measurement is,
    and what was not measured hardly, beside it. Where nothing was measured, all are as far as lengths are."""
    found = np.zeros(len(deviations))
    free = moved.weights > 0.0
    lengths = (deviations * moved.weights)[free & (deviations > 0.0)]
    least = SURE * float(lengths.min()) if len(lengths) else 1.0
    found[free] = np.maximum(deviations[free], least / moved.weights[free])
    return found
