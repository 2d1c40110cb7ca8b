"""Systems that are Python objects, as the steps see them: their steps are plain Python, and take longer."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.simulation.core.laws.further import Further
from rungwise.simulation.core.state import Trial
from rungwise.system import contract
from rungwise.system.moving import OF_GAPS, POSED, RESTS, Asked, Crowded, Moment, System
from rungwise.system.terms import Terms


class ToldSystem:
    """A system of kernels (its `mechanism`) whose contacts have further laws, which are Python; what steps
    ask beside these, the kernels answer."""

    def __init__(self, system: Any, further: Further | None) -> None:
        self._system, self._further = system, further

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(contract, name), self._system.mechanism)

    def tell_laws(self, trial: Trial, at_start: bool) -> None:
        if self._further is not None:
            self._further.fill(trial, at_start)

    def until_edge(self, trial: Trial) -> float:
        return trial.h if self._further is None else self._further.until_edge(trial)


@dataclass
class PlainSystem:
    """A system, and its further laws of contact if it has any, with the methods of `system.contract`.
    `crowded` is what the last `fill` without room raised; pairs of bodies are those of the frames' gaps."""

    system: System
    further: Further | None
    crowded: Crowded = field(init=False)
    pairs: list[tuple[int, int]] = field(default_factory=list)
    _middle: Reals = field(init=False)
    _kept: list[NDArray[Any]] = field(init=False)

    def fill(
        self, moment: Moment, terms: Terms, reach: float, slots: Ints, fresh: Ints, driving: Reals
    ) -> int:
        try:
            found, new = self.system.fill(moment, terms, reach)
        except Crowded as error:
            self.crowded = error
            return -1
        slots[: len(found)], fresh[: len(found)] = found, new
        driving[:] = self.system.driving
        return len(found)

    def integrate(self, q: Reals, v: Reals, h: float, after: Reals) -> None:
        after[:] = self.system.integrate(q, v, h)

    def least_gap(self, q: Reals) -> float:
        return self.system.least_gap(q)

    def passes(self, q: Reals, v: Reals, h: float) -> bool:
        return self.system.passes(q, v, h)

    def fastest(self, q: Reals, v: Reals) -> float:
        return self.system.fastest(q, v)

    def tell_laws(self, trial: Trial, at_start: bool) -> None:
        if self.further is not None:
            self.further.fill(trial, at_start)

    def fill_speeds(self, time: float, speeds: Reals) -> None:
        speeds[:] = self.system.speeds(time)

    def follow(self, values: Reals, _h: float, ends: bool) -> None:
        if not hasattr(self.system, "follow"):
            return
        if not ends:
            self._middle = values.copy()
        else:
            self.system.follow(self._middle, values)

    def lacks_room(self) -> bool:
        return False

    def until_edge(self, trial: Trial) -> float:
        return trial.h if self.further is None else self.further.until_edge(trial)

    def accept(self, _q: Reals, _v: Reals, _trial: Trial) -> None:
        self.system.accept()

    def keep(self) -> None:
        self._kept = [part.copy() for part in getattr(self.system, "kept", ())]

    def take_back(self) -> None:
        for part, kept in zip(getattr(self.system, "kept", ()), self._kept, strict=True):
            part[...] = kept

    def tell_values(self, asked: Asked, q: Reals, v: Reals, values: Reals) -> bool:
        """See `system.contract`; ways are those of bodies that do not turn, unless the system has `paces`."""
        system: Any = self.system
        poses, gaps, ways = asked.firsts
        if asked.reads[POSED]:
            frames = system.frames(q).ravel()
            values[poses : poses + len(frames)] = frames
        for place, (a, b) in zip(asked.place, asked.pairs, strict=True):
            values[gaps + place] = system.gap(q, int(a), int(b))
        if asked.reads[RESTS]:
            bodies = len(values) - 1 - int(ways)
            own = (np.linalg.norm(v[asked.owner == b]) for b in range(bodies))
            paces = system.paces(q, v) if hasattr(system, "paces") else np.fromiter(own, float, bodies)
            values[ways:-1] = asked.step[0] * paces
        return True

    def hear(self, asked: Asked, force: Reals, h: float, values: Reals) -> None:
        system: Any = self.system
        first, count = int(asked.firsts[OF_GAPS]), int(asked.contacts[0])
        place = {(int(a), int(b)): int(k) for k, (a, b) in zip(asked.place, asked.pairs, strict=True)}
        for a, b, push in system.pushes(force) if place else ():
            at = place.get((min(a, b), max(a, b)), -1)
            if at >= 0:
                values[first + count + at] += push
                values[first + 2 * count + at] += h * push

    def remember(self, setting: Any, out: Reals, _bits: Ints, at: int) -> int:
        for part in kept_arrays(setting, self.system):
            if at + part.size > len(out):
                return -1
            out[at : at + part.size] = np.ascontiguousarray(part).view(np.float64).ravel()
            at += part.size
        return at

    def tell_frame(self, setting: Any, out: Reals, at: int) -> int:
        """Energy, and gaps and normal forces (c,) of the pairs."""
        system: Any = self.system
        q, state, count = setting.attempt.q, setting.state, len(self.pairs)
        if at + 1 + 2 * count > len(out):
            return -1
        out[at] = system.energy(q, state.v)
        out[at + 1 : at + 1 + count] = [system.gap(q, a, b) for a, b in self.pairs]
        out[at + 1 + count : at + 1 + 2 * count] = pushed(system, self.pairs, state.force)
        return at + 1 + 2 * count


def kept_arrays(setting: Any, system: System) -> list[NDArray[Any]]:
    """All that steps of a system in Python hand on: of the core, and what the system keeps itself."""
    state, scratch = setting.state, setting.scratch
    return [
        setting.attempt.clock, scratch.limited_force, scratch.limited_mode, setting.terms.fall,
        state.modes, state.deformation, state.force, state.impulse, *getattr(system, "kept", ()),
    ]  # fmt: skip


def pushed(system: Any, pairs: list[tuple[int, int]], force: Reals) -> Reals:
    """Normal forces (c,) of pairs of bodies, from forces by slot (s, d)."""
    found = dict.fromkeys(pairs, 0.0)
    for a, b, push in system.pushes(force):
        pair = (min(a, b), max(a, b))
        found[pair] = found.get(pair, 0.0) + push
    return np.array([found[pair] for pair in pairs])
