"""What a model predicts, at an accuracy: many moves from many states, and the steps that they take."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.world import contract
from rungwise.world.contract import Runs
from rungwise.world.find import world_of

GOES_ON = (Code.MISSED, Code.TIMEOUT)
"""Outcomes after which a plan may go on with its next move."""

PATIENCE = 10
"""How many times as many steps patient runs may take, such as those of plans that are laid out."""


class Places(NamedTuple):
    """Where m plans have come to: q (m, n_q), v (m, n_v), time (m,), and memories (m, w) to go on from, or no
    row where bodies were placed by hand since; (m,) arrays where their lengths differ."""

    q: Reals
    v: Reals
    time: Reals
    memory: NDArray[Any]

    def take(self, rows: Ints) -> Places:
        return Places(*(a[rows] if len(a) else a for a in self))


class Ends(NamedTuple):
    """How m runs ended: outcomes (m,), where, the segments that ended (m,), the work of drives (m,); `at`
    gives the places of some rows at the end of a segment, where the stage keeps them."""

    outcome: Ints
    places: Places
    switches: Ints
    work: Reals
    at: Callable[[int, Ints], Places]


class Predictor:
    """Runs of a scene at fixed parameters on one stage, with an error `tol` allowed per step, as parts of one
    that lasts for `span`, if that is given; quick ones end where they take long."""

    def __init__(
        self, scene: Any, stage: Stage, tol: float, parameters: dict[str, float], budget: Budget,
        threads: int | None = None, *, quick: bool = True, span: float | None = None,
    ) -> None:  # fmt: skip
        self.scene, self.stage, self.budget = scene, stage, budget
        self._parameters = parameters
        self._options: dict[str, Any] = {"tol": tol, "threads": threads, "span": span}
        self._quick = quick
        self._runs: dict[tuple[tuple[bool, ...], tuple[str | None, ...], bool], Runs] = {}

    def run(
        self, places: Places, levels: Reals, durations: Reals, *, ramps: tuple[bool, ...] | None = None,
        until: tuple[str | None, ...] | None = None, patient: bool = False,
    ) -> Ends:  # fmt: skip
        """Segments with inputs `levels` (m, s, u) and `durations` (m, s), from the places; `patient` runs may
        take more steps than quick ones."""
        m, s = durations.shape
        runs = self._segments(ramps or (False,) * s, until or (None,) * s, patient)
        found = runs.run(
            np.zeros((m, 0)), _begun(places), durations, levels, keeps=True,
            chunk=max(1, min(64, math.ceil(m / runs.threads / 2))), deadline=self.budget.deadline,
            on_progress=self.budget.look,
        )  # fmt: skip
        slow = (found.outcome == Code.NOT_CONVERGED) & (found.steps >= runs.budget)
        self.budget.take(self.stage, int(found.attempts.sum()), found.outcome[~slow], int(slow.sum()))

        def at(segment: int, rows: Ints) -> Places:
            return _places(found.at(segment, rows))

        return Ends(found.outcome, _places(found.places), found.switches, found.work, at)

    def taken_over(self, now: Places, scene: Any, levels: Reals) -> Places:
        """One place to which a run of `scene` at other parameters has come, on this stage's rung, as these
        runs go on from it, after inputs `levels` (u,)."""
        runs = self._segments((False,), (None,))
        return _places(runs.taken_over(_begun(now), scene, levels))

    def measured(self, q: Reals, v: Reals, levels: Reals) -> Places:
        """A place (n_q,) with velocities (n_v,) that was measured, as these runs go on from it, after inputs
        `levels` (u,). Raises StateError where bodies overlap."""
        return _places(self._segments((False,), (None,)).measured(q, v, levels))

    def _segments(
        self, ramps: tuple[bool, ...], until: tuple[str | None, ...], patient: bool = False
    ) -> Runs:
        key = ramps, until, patient
        if key not in self._runs:
            patience = (PATIENCE if patient else 1) if self._quick else None
            self._runs[key] = world_of(self.scene).runs(
                self.stage.model, (), self._parameters, until=until, ramps=ramps, patience=patience,
                **self._options,
            )  # fmt: skip
        return self._runs[key]


def _begun(places: Places) -> contract.Places:
    goes_on = np.full(len(places.q), len(places.memory) > 0)
    return contract.Places(places.q, places.v, places.time, places.memory, goes_on)


def _places(found: contract.Places) -> Places:
    return Places(found.q, found.v, found.time, found.memory if found.goes_on.any() else found.memory[:0])
