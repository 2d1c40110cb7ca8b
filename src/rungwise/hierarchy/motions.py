"""Motions of many runs at the same moments, and how far they are apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.deadline import NEVER, Deadline, TimeOver
from rungwise.hierarchy.distance import farthest
from rungwise.hierarchy.inputs import Inputs
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import LADDER, Rung
from rungwise.outcome import Code
from rungwise.simulation.result import texts
from rungwise.simulation.state import State
from rungwise.world.contract import Marks
from rungwise.world.find import world_of
from rungwise.world.matching import Matched
from rungwise.world.rollout import rollout

MOVING = tuple(rung for rung in LADDER if rung.moves)
MOMENTS = 60
"""Moments of a run at which motions are compared."""


class Motions(NamedTuple):
    """Places (m, s, p, d) at s moments, angles and axes times a lever, as parts of the extent, at rest
    after the end; outcomes, times of the end, steps and problems solved (m,)."""

    places: Reals
    outcome: Ints
    time: Reals
    steps: Ints
    solves: Ints

    @property
    def ends(self) -> list[str]:
        return [str(text) for text in texts(self.outcome)]

    def rows(self, rows: Ints) -> Motions:
        """Those of these rows."""
        return Motions(
            self.places[rows], self.outcome[rows], self.time[rows], self.steps[rows], self.solves[rows]
        )

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which runs say something (m,): not those that did not begin, did not converge, or took too many
        steps."""
        return ~np.isin(self.outcome, (Code.INVALID, Code.NOT_CONVERGED))


@dataclass(frozen=True)
class Bench:
    """What runs of a comparison have in common: the matched scene, inputs, the longest duration, the extent,
    levers (p,) of places (see `Marks`), threads, and when they end at the latest."""

    matched: Matched
    inputs: Inputs
    duration: float
    extent: float
    levers: Reals
    threads: int | None
    deadline: Deadline = NEVER

    @property
    def budget(self) -> int:
        """Most steps of one run."""
        return world_of(self.matched.scene).comparison_steps

    @cached_property
    def places(self) -> Marks:
        """What motions are compared by."""
        return world_of(self.matched.scene).marks(self.matched.parameters)

    def run(
        self,
        model: Rung,
        inputs: Reals,
        until: Reals,
        tol: float | None,
        *,
        step: float | None = None,
        bare: bool = False,
        budget: int | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        moments: int = MOMENTS,
        halved: bool = False,
    ) -> Motions:
        """Runs (m,) under inputs (m, k) until times (m,), with the error allowed per step as a part
        of the extent, or a step; `bare`: whatever the scene's conditions say; `halved`: steps end in the
        middle between moments, too. Raises TimeOver where the deadline ends one."""
        scene = self.matched.bare if bare else self.matched.scene
        parts = 2 * moments if halved else moments
        times = until[:, None] * np.arange(1, parts + 1) / parts
        given = self.inputs.options(inputs, times, self.duration)
        values: dict[str, Any] = (
            self.matched.values(model) | given.pop("parameters", {}) | dict(parameters or {})
        )
        found = rollout(
            scene, model, None, given.pop("inputs", None),
            np.repeat(until[:, None] / parts, parts, axis=1),
            parameters=values, step=step, tol=None if tol is None else tol * self.extent,
            budget=self.budget if budget is None else min(budget, self.budget), threads=self.threads,
            limit=self.deadline.seconds, **given,
        )  # fmt: skip
        if (found.outcome == Code.RUNNING).any():
            raise TimeOver("in a run of a comparison")
        places = found.q.copy()
        start = State.of(scene, parameters=self.matched.values(model)).q
        for k in range(parts):
            before = places[:, k - 1] if k else np.broadcast_to(start, places[:, 0].shape)
            places[:, k] = np.where(np.isnan(places[:, k]), before, places[:, k])
        places = self.places(places[:, parts // moments - 1 :: parts // moments])
        places = places * (self.levers / self.extent)[:, None]
        return Motions(places, found.outcome, found.time, found.steps, found.solves)

    def last(self, inputs: Reals, tol: float) -> Reals:
        """When the last of the rungs has come to an end (m,)."""
        whole = np.full(len(inputs), self.duration)
        times = [self.run(model, inputs, whole, tol, moments=1).time for model in MOVING]
        latest: Reals = np.array(times).max(axis=0)
        return np.maximum(latest, 1e-6 * self.duration)


def joined(parts: list[Motions]) -> Motions:
    """Runs one after another, as one."""
    return Motions(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def apart(a: Motions, b: Motions, *, late: bool = False) -> Reals:
    """The greatest difference of a place (m,), in the whole run or in its second half; nan where a run
    says nothing."""
    first = a.places.shape[1] // 2 if late else 0
    away = farthest(a.places[:, first:] - b.places[:, first:])
    return np.where(a.known & b.known, away, math.nan)
