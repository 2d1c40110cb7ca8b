"""A design looked for on earlier rungs first, from which the search on the last one starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.kernel import Reals
from rungwise.models.ladder import LADDER, Rung
from rungwise.outcome import OUTCOMES
from rungwise.planning.design.optimise import Tuner
from rungwise.simulation.options import moving_rung
from rungwise.world.carriers import TaskError


@dataclass(frozen=True)
class Earlier:
    """What an earlier rung made of a design: its best rate of success, the runs that took, and how they
    ended. A rung on which none of the first designs succeeds is skipped."""

    model: Rung
    rate: float
    runs: int
    outcomes: dict[str, int]

    def __str__(self) -> str:
        if self.rate > 0.0:
            return f"{self.model.name}: a design with a rate of {self.rate:.3g}, in {self.runs} runs"
        return f"{self.model.name}: skipped, {nothing(self.runs, self.outcomes)}"


def nothing(runs: int, outcomes: dict[str, int]) -> str:
    """That no design succeeds, and how runs ended instead."""
    most = sorted(outcomes.items(), key=lambda item: -item[1])
    ended = ", ".join(f"{name} {count}" for name, count in most)
    meaning = next(each.meaning for each in OUTCOMES.values() if each.name == most[0][0])
    return f"no design of {runs} runs succeeds: {ended}; most often: {meaning}"


def earlier_rungs(first: Rung | str | None, last: Rung) -> tuple[Rung, ...]:
    """Rungs of the ladder from the first to before the last; none without a first."""
    if first is None:
        return ()
    begin = LADDER.index(moving_rung(first))
    end = LADDER.index(last) if last in LADDER else len(LADDER)
    if begin >= end:
        raise TaskError(f"from: {LADDER[begin].name} is not below {last.name}")
    return LADDER[begin:end]


def searched_earlier(
    rungs: tuple[Rung, ...],
    tuner_of: Callable[[Rung], Tuner],
    size: int,
    budget: int,
    rng: np.random.Generator,
) -> tuple[Reals | None, tuple[Earlier, ...]]:
    """The best design of the last of the rungs on which one succeeds, and what became of each rung, as far
    as there was time."""
    best, told = None, list[Earlier]()
    for rung in rungs:
        tuner = tuner_of(rung)
        low, side = tuner.box[:, 0], np.ptp(tuner.box, axis=1)
        designs = low + side * rng.random((size, len(low)))
        if best is not None:
            designs[0] = best
        try:
            rates, margins = tuner.tried(designs)
            rate = float(rates.max())
            if rate > 0.0:
                best, rate = designs[np.lexsort((-margins, -rates))[0]], rate
                best = tuner.searched(best, size, budget, rng)[0]
                rate = float(tuner.tried(best[None])[0][0])
        except TimeOver:
            break
        told.append(Earlier(rung, rate, tuner.count, dict(tuner.outcomes)))
    return best, tuple(told)
