"""Designs: parameters with which a scene succeeds best, and how far each of them may drift."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.content import ByContent
from rungwise.deadline import LimitError, TimeOver
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.plain import cut
from rungwise.planning.design.coarse_to_fine import Earlier, earlier_rungs, nothing, searched_earlier
from rungwise.planning.design.optimise import GRID, Tuner, centre
from rungwise.planning.execution.verify import bound_below
from rungwise.planning.motion.budget import Budget
from rungwise.planning.task.task import fields_of
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.sets.feasible.feasible import feasible_set
from rungwise.sets.request import ACCURACY, box_of, smallest
from rungwise.simulation.options import moving_rung
from rungwise.simulation.threads import names_of
from rungwise.world.carriers import TaskError
from rungwise.world.find import impossible

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BUDGET = 200_000
"""Most runs, if not given."""
DESIGNS, DRAWS = 40, 50
"""Designs of a round of the search, and samples with which each is tried if not given."""
NEAR = 0.1
"""Deviation of the first round of a search from another rung's design, in sides of the box."""
ENDS = {"feasible": "goal"} | {label: label for label in ("doomed", "unsafe", "jammed", "invalid")}
"""How runs ended, by the label of a set; the other labels leave it open. Where nothing is feasible and labels
leave it open, a search goes on: by the margin, and its runs tell how they ended."""
SEARCHED = "the time was over before the search ended"
UNTRIED, UNSCANNED = "the time was over before fresh runs", "the time was over before drifts were known"
KEPT = 0.98
"""A design may drift as long as its rate stays at this part of its best one."""


@dataclass(frozen=True, eq=False)
class Design(ByContent):
    """Parameters with which a scene succeeds best, on a rung.

    model: the rung; over: names of the designed parameters; parameters: values of all others; values: best
    values of the designed ones, by name; box: the intervals searched; how: "in the middle of the
    set" or "by a search"; margin: distance from the set's boundary in sides of the box, nan after a search;
    drift: for each parameter the interval in which success is kept while the others stay; successes: number
    of successes in `samples` fresh runs; runs: number of all runs; outcomes: how they ended; earlier: results
    of earlier rungs, if there were any; unfinished: the work that a limit in seconds left undone, in words.
    """

    scene: AnyScene
    model: Rung
    over: tuple[str, ...]
    box: dict[str, tuple[float, float]]
    parameters: dict[str, float]
    values: dict[str, float]
    how: str
    margin: float
    drift: dict[str, tuple[float, float]]
    samples: int
    successes: int
    runs: int
    outcomes: dict[str, int]
    earlier: tuple[Earlier, ...] = ()
    unfinished: str = ""

    @property
    def found(self) -> bool:
        """Whether any design succeeds."""
        return bool(self.values)

    @property
    def ok(self) -> bool:
        """Whether a design was found, and one of its fresh runs at least succeeded."""
        return self.found and self.successes > 0

    @property
    def lower(self) -> float:
        """Lower bound of the rate of success (Clopper and Pearson, one-sided, 95 %)."""
        return bound_below(self.successes, self.samples)

    @property
    def decides(self) -> str:
        """The parameter that may drift least, as a part of its interval; empty where none ends within."""
        room = {name: self._room(name) for name in self.drift}
        return min(room, key=lambda name: room[name]) if room and min(room.values()) < 1.0 else ""

    def _room(self, name: str) -> float:
        (low, high), (first, last) = self.drift[name], self.box[name]
        return (high - low) / (last - first)

    @property
    def reason(self) -> str:
        """What blocks, where no design succeeds."""
        if self.found:
            return ""
        told = nothing(self.runs, self.outcomes) if self.outcomes else "no design was tried"
        wrong = impossible(self.scene, self.box, self.parameters) if "invalid" in self.outcomes else ""
        told += f"; {wrong}" if wrong else ""
        return f"{told}; {self.unfinished}" if self.unfinished else told

    def summary(self) -> dict[str, Any]:
        """All of it as plain values."""
        return {
            "scene": self.scene.name, "model": self.model.name, "found": self.found, "how": self.how,
            "values": self.values, "margin": None if np.isnan(self.margin) else self.margin,
            "box": {name: list(interval) for name, interval in self.box.items()},
            "drift": {name: list(interval) for name, interval in self.drift.items()},
            "decides": self.decides, "samples": self.samples, "successes": self.successes,
            "lower": self.lower if self.found else 0.0, "runs": self.runs, "outcomes": self.outcomes,
            "reason": self.reason, "unfinished": self.unfinished,
            "earlier": [
                {"model": e.model.name, "rate": e.rate, "runs": e.runs, "outcomes": e.outcomes}
                for e in self.earlier
            ],
        }  # fmt: skip

    def __repr__(self) -> str:
        told = ", ".join(f"{name} {value:.6g}" for name, value in self.values.items()) or "none"
        return f"<Design of {cut(self.scene.name)} on {self.model.name}: {cut(told, 200)}>"

    def __str__(self) -> str:
        head = f"{self.scene.name} on {self.model.name}"
        if not self.found:
            return "\n  ".join([f"{head}: {self.reason}", *map(str, self.earlier)])
        lines = [
            f"{head}: {self._confirmed}",
            f"  {'parameter':14s} {'best':>11s} {'may drift':>25s} {'within':>25s}",
        ]
        for name, value in self.values.items():
            drift = "?" if name not in self.drift else "{:.6g} to {:.6g}".format(*self.drift[name])
            box = "{:.6g} to {:.6g}".format(*self.box[name])
            lines.append(f"  {name:14s} {value:11.6g} {drift:>25s} {box:>25s}")
        if self.unfinished:
            lines.append(f"  {self.unfinished}")
        none = "; none decides within its interval" if self.drift else ""
        decides = f"; {self.decides} decides" if self.decides else none
        lines.append(f"  found {self.how}, in {self.runs} runs{decides}")
        return "\n".join([*lines, *(f"  {each}" for each in self.earlier)])

    @property
    def _confirmed(self) -> str:
        if self.samples == 0:
            return "succeeds, in the search alone"
        if self.samples == 1:
            return "reaches the goal" if self.ok else "misses the goal, although designs near it reach it"
        return (
            f"{self.successes} of {self.samples} fresh runs succeed, at least {self.lower:.3f} with a"
            " confidence of 95%"
        )

    def designed(self) -> AnyScene:
        """The scene with the best values as defaults."""
        values, declared = self.parameters | self.values, self.scene.file.parameters
        best = {name: each.model_copy(update={"default": values[name]}) for name, each in declared.items()}
        return self.scene.changed(parameters=best)

    def plot(self) -> Figure:
        """The best values and how far they may drift (see `rungwise.plot`)."""
        import rungwise

        return rungwise.plot(self)


@keywords
def design(
    scene: AnyScene | str | Path | Mapping[str, Any],
    over: Sequence[str],
    *,
    model: Rung | str = "dynamic-compliant",
    from_: Rung | str | None = None,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    robust: bool = False,
    samples: int = 200,
    draws: int = DRAWS,
    tol: float = 0.01,
    accuracy: float | None = None,
    budget: int = BUDGET,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> Design:
    """Choose parameters with which the scene succeeds, as far from failure as possible.

    Up to four parameters are taken from the middle of their feasible set: the point farthest from its
    boundary and from the sides of the box. With `robust`, and for more parameters, a search continues from
    there. It maximizes the rate of success under the uncertainty of the task, then the margin of the worst
    tenth of the samples.

    Args:
        scene, model, parameters: as for `simulate`.
        from_: rung on which the search begins; it climbs rung after rung up to the model. Each search starts
            at the design of the rung before, and the feasible set is left out.
        over: names of the parameters to choose.
        box: interval (low, high) by name, as for `feasible_set`.
        robust: vary the parameters that the scene's task calls uncertain.
        samples: number of fresh runs that confirm a robust design; without uncertainty there is one run.
        draws: number of uncertain samples with which the search tries each design.
        tol: of the set, as for `feasible_set`.
        accuracy: error allowed per step of a run.
        budget: greatest number of runs; limit: seconds after which the call returns with the best design so
            far; see `unfinished`.
        seed: of the search and of the draws.
        threads, on_progress: as for `feasible_set`.

    Raises SceneError, SetError, ModelError or TaskError for wrong input.
    """
    loaded, rung, time = load(scene), moving_rung(model), Budget(None, limit)
    if loaded.file.goal is None:
        raise TaskError("goal: the scene has none; a design needs one")
    values = loaded.parameters(parameters)
    names = names_of(loaded, over)
    if robust and not fields_of(loaded).uncertain:
        raise TaskError("robust: the scene's task calls nothing uncertain")
    if samples < 1:
        raise TaskError(f"samples: must be at least 1, not {samples}")
    if draws < 1:
        raise TaskError(f"draws: must be at least 1, not {draws}")
    samples = samples if robust else 1
    intervals = box_of(loaded, names, box)
    rng = np.random.default_rng(seed)
    count = len(fields_of(loaded).uncertain) if robust else 0
    per_design = draws if robust else 1
    allowed = ACCURACY * smallest(loaded, values) if accuracy is None else accuracy
    quantiles, rungs = _quantiles(rng, per_design, count), earlier_rungs(from_, rung)

    def tuner_of(rung: Rung) -> Tuner:
        return Tuner(loaded, rung, names, intervals, values, quantiles, allowed, threads, on_progress, time)

    start, earlier = searched_earlier(rungs, tuner_of, DESIGNS, budget, rng)
    tuner = tuner_of(rung)
    best, how, margin, rate = _found(tuner, tol, budget, robust, rng, start)
    rate = _rate(tuner, best, rate)
    searched = Design(
        scene=loaded, model=rung, over=names, parameters=values, values={}, how=how, margin=np.nan,
        box={name: (float(a), float(b)) for name, (a, b) in zip(names, intervals, strict=True)},
        drift={}, samples=samples, successes=0, runs=tuner.count, outcomes=dict(tuner.outcomes),
        earlier=earlier, unfinished="" if time.is_in_time() else SEARCHED,
    )  # fmt: skip
    if best is None or rate == 0.0:
        return searched
    named = replace(searched, values=dict(zip(names, best.tolist(), strict=True)), margin=margin)
    fresh = _quantiles(rng, samples, count)
    return _confirmed(tuner, named, best, KEPT * rate, fresh)


def _confirmed(tuner: Tuner, named: Design, best: Reals, rate: float, fresh: Reals) -> Design:
    """The design with what fresh samples (n, k) make of it, and how far it may drift at this rate."""
    left = UNTRIED
    try:
        succeeded = round(tuner.tried(best[None], fresh)[0][0] * len(fresh))
        named, left = replace(named, successes=succeeded), UNSCANNED
        drift = tuner.drift(best, rate).tolist()
        named, left = replace(named, drift=dict(zip(named.over, map(tuple, drift), strict=True))), ""
    except TimeOver:
        named = replace(named, samples=0 if left == UNTRIED else named.samples)
    unfinished = "; ".join(each for each in (named.unfinished, left) if each)
    return replace(named, unfinished=unfinished, runs=tuner.count, outcomes=dict(tuner.outcomes))


def _found(
    tuner: Tuner, tol: float, budget: int, robust: bool, rng: np.random.Generator, start: Reals | None
) -> tuple[Reals | None, str, float, float]:
    """The best design, how it was found, its distance from the set's boundary, and its rate of success there:
    0 where it was not tried."""
    if start is not None:
        near, rate = tuner.searched(start, DESIGNS, budget, rng, NEAR)
        return near, "by a search", np.nan, rate
    best, margin = start, np.nan
    if len(tuner.names) in GRID:
        box = {name: (float(a), float(b)) for name, (a, b) in zip(tuner.names, tuner.box, strict=True)}
        try:
            found = feasible_set(
                tuner.scene, tuner.model, tuner.names, tol=tol, box=box, parameters=tuner.parameters,
                accuracy=tuner.tol, budget=budget // 2, limit=tuner.time.seconds, threads=tuner.threads,
            )  # fmt: skip
        except LimitError:
            return None, "in the middle of the set", np.nan, 0.0
        tuner.count += found.evaluations
        labels = found.volumes(10_000)
        for label in labels.keys() & ENDS.keys():
            tuner.outcomes[ENDS[label]] += round(labels[label] * found.evaluations)
        middle = centre(found)
        if middle is not None:
            best, margin = middle
        if not robust and (middle is not None or labels.keys() <= ENDS.keys()):
            return best, "in the middle of the set", margin, float(best is not None)
    widest, rate = tuner.searched(best, DESIGNS, budget, rng)
    return widest, "by a search", np.nan, rate


def _rate(tuner: Tuner, best: Reals | None, known: float) -> float:
    """The rate of success of a design; the one that is known where no time is left."""
    try:
        return 0.0 if best is None else float(tuner.tried(best[None])[0][0])
    except TimeOver:
        return known


def _quantiles(rng: np.random.Generator, samples: int, count: int) -> Reals:
    """Points (samples, count) in 0..1, a Latin hypercube."""
    columns = [(rng.permutation(samples) + rng.random(samples)) / samples for _ in range(count)]
    return np.column_stack(columns) if columns else np.empty((samples, 0))
