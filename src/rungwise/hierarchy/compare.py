"""The paper's Table 1, measured on a scene: how far its models are apart, and what leads between them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as File
from typing import Any

import numpy as np

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.hierarchy.comparison import FAILS, Comparison, Measured
from rungwise.hierarchy.counterexample import Counterexample, levers, side
from rungwise.hierarchy.inputs import inputs_of
from rungwise.hierarchy.limits import INDEPENDENT, STAYS, first, fit
from rungwise.hierarchy.motions import MOVING, Bench
from rungwise.hierarchy.nearest import nearest
from rungwise.hierarchy.pairs import PAIRS, Pair
from rungwise.hierarchy.refine import Settled, settle
from rungwise.hierarchy.stages import Cost, cheapest, costs
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import DYNAMIC_COMPLIANT, Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.options import ModelError, RunOptions, count, moving_rung
from rungwise.world.find import world_of

PART = 1e-2
"""Error allowed per step of runs that choose and search, as a part of the accuracy asked for."""

Progress = Callable[[str, int, int], None]


@keywords
def compare(
    scene: AnyScene | str | File | Mapping[str, Any],
    model: Rung | str | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    samples: int = 8,
    seed: int = 0,
    accuracy: float = 0.01,
    duration: float | None = None,
    threads: int | None = None,
    limit: float | None = None,
    on_progress: Progress | None = None,
) -> Comparison:
    """Measure how far apart the models are on a scene: the paper's Table 1.

    Args:
        scene, parameters: as for `simulate`.
        model: only pairs with this rung; all if not given.
        samples: number of inputs that are drawn with `seed`, in addition to the scene's own.
        accuracy: greatest distance of motions that count as alike, as a part of the scene's extent.
        duration: end of the runs; if not given, each ends when the runs on all rungs have ended, at the
            scene's duration at the latest.
        threads: how many; as many as there are cores if not given. The results do not
            depend on it.
        limit: seconds after which the call returns with the rungs, pairs and stages that are measured; see
            `unfinished` of the result.
        on_progress: called with what was measured, and how many parts of the work are done and known.

    Raises SceneError or ModelError for wrong input, and LimitError where the limit is over before the scene's
    parameters are matched. Ctrl-C raises KeyboardInterrupt."""
    deadline = Deadline(seconds(limit))
    loaded, samples = load(scene), count("samples", samples, 0)
    rng = np.random.default_rng(count("seed", seed, 0))
    accuracy = _part(accuracy)
    fixed = RunOptions(duration=duration).duration
    chosen = [] if model is None else [moving_rung(model).name]
    pairs = [p for p in PAIRS if not chosen or chosen[0] in (p.richer.name, p.simpler.name)]
    values = loaded.parameters(parameters)
    longest = _duration(loaded, values) if fixed is None else fixed
    steps = _Steps(on_progress, 2 + len(MOVING) + sum(1 + len(pair.paths) for pair in pairs))
    with deadline.needed_for("parameters of the scene were matched"):
        extent, lengths = world_of(loaded).measures(values, longest, deadline)
        match = world_of(loaded).matched(values, longest, deadline)
    pairs = [pair._replace(paths=tuple(p for p in pair.paths if p.is_within(match))) for pair in pairs]
    bench = Bench(match, inputs_of(loaded, values), longest, extent, lengths, threads, deadline)
    drawn = bench.inputs.draw(samples, rng)
    part = _Part(np.full(len(drawn), math.nan if fixed is None else longest))
    try:
        _fill(part, bench, pairs, drawn, accuracy, rng, steps)
    except TimeOver:
        if not deadline.is_over:
            raise  # by what is told of progress
    runs = part.runs
    shown = [each for found in part.pairs for each in _counterexamples(bench, found, runs, drawn, part.until)]
    return Comparison(
        scene=loaded, parameters=values, accuracy=accuracy, extent=extent, inputs=bench.inputs, samples=drawn,
        until=part.until, notes=match.notes, ends={name: each.motions.ends for name, each in runs.items()},
        errors={name: each.error for name, each in runs.items()}, pairs=tuple(part.pairs),
        costs=tuple(part.costs), cheapest=cheapest(part.costs, accuracy), counterexamples=tuple(shown),
        unfinished=part.unfinished(pairs),
    )  # fmt: skip


@dataclass
class _Part:
    """What is measured so far: until when runs go (m,), the rungs' runs, pairs, and stages, if `staged`."""

    until: Reals
    runs: dict[str, Settled] = field(default_factory=dict)
    pairs: list[Measured] = field(default_factory=list)
    costs: list[Cost] = field(default_factory=list)
    staged: bool = False

    def unfinished(self, pairs: Sequence[Pair]) -> str:
        """What is not measured, in words; empty where all is."""
        left = [rung.name for rung in MOVING if rung.name not in self.runs]
        left += [pair.name for pair in pairs[len(self.pairs) :]] + ["the stages"] * (not self.staged)
        return f"the time was over before these were measured: {', '.join(left)}" if left else ""


def _fill(
    part: _Part, bench: Bench, pairs: Sequence[Pair], drawn: Reals, accuracy: float,
    rng: np.random.Generator, steps: _Steps,
) -> None:  # fmt: skip
    """Measure all that a comparison has. Raises TimeOver, and keeps what is measured then."""
    if np.isnan(part.until).any():
        part.until = bench.last(drawn, PART * accuracy)
    steps.done("parameters matched")
    for rung in MOVING:
        part.runs[rung.name] = settle(bench, rung, drawn, part.until, accuracy)
        steps.done(rung.name)
    for pair in pairs:
        part.pairs.append(_measure(bench, pair, part.runs, drawn, part.until, accuracy, rng, steps))
    part.costs += costs(bench, drawn, part.until, part.runs[DYNAMIC_COMPLIANT.name].motions)
    part.staged = True
    steps.done("stages")


def _duration(scene: AnyScene, values: dict[str, float]) -> float:
    """How long runs of a scene go on at most."""
    return world_of(scene).at(values).duration


class _Steps:
    """Counts parts of the work that are done."""

    def __init__(self, told: Progress | None, known: int) -> None:
        self._told, self._known, self._done = told, known, 0

    def done(self, what: str) -> None:
        self._done += 1
        if self._told is not None:
            self._told(what, self._done, self._known)


def _part(accuracy: float) -> float:
    if isinstance(accuracy, bool) or not isinstance(accuracy, int | float) or not 1e-6 <= accuracy <= 1.0:
        raise ModelError(f"accuracy: must be a number in 1e-6..1, not {str(accuracy)[:60]!r}")
    return float(accuracy)


def _measure(
    bench: Bench, pair: Pair, runs: dict[str, Settled], inputs: Reals, until: Reals, accuracy: float,
    rng: np.random.Generator, steps: _Steps,
) -> Measured:  # fmt: skip
    name, tol = pair.name, PART * accuracy
    richer, simpler = runs[pair.richer.name].motions, runs[pair.simpler.name].motions
    near = nearest(bench, pair.richer, simpler, richer, inputs, until, tol, accuracy, rng)
    steps.done(name)
    fits, both = [], first(richer, simpler, until)
    for path in pair.paths:
        fits.append(fit(bench, path, pair.richer, pair.simpler, inputs, both))
        steps.done(f"{name}: {path.name}")
    return Measured(pair, near, tuple(fits), accuracy)


def _counterexamples(
    bench: Bench, found: Measured, runs: dict[str, Settled], inputs: Reals, until: Reals
) -> list[Counterexample]:
    """What shows that a definition fails: the worst input of Definition 1 where the paper claims it, and the
    end of each path that does not lead to the simpler model."""
    pair, near = found.pair, found.nearest
    name, shown = pair.name, list[Counterexample]()
    if pair.definition == 1 and found.first == FAILS:
        k = near.worst
        end, tol = float(until[k]), float(runs[pair.simpler.name].tol[k])
        shown.append(
            Counterexample(
                f"{name}, Definition 1: the nearest motion found",
                side(bench, pair.richer, near.inputs[k], end, {}, tol),
                side(bench, pair.simpler, inputs[k], end, {}, tol),
                near.value, False, levers(bench), bench.matched.scene,
            )
        )  # fmt: skip
    for each in found.fits:
        if each.verdict in (STAYS, INDEPENDENT):
            path, drive, bounce = each.path, inputs[each.sample], bench.matched.bouncing(each.path.bounce)
            last = max(k for k, distance in enumerate(each.distances) if distance == distance)
            at, tol = each.values[last], float(each.known.tols[last])
            factors = path.factors(at) | bounce
            shown.append(
                Counterexample(
                    f"{name}, Definition 2: {path.words}, at {path.name} = {at:g}",
                    side(bench, path.rung(pair.richer, at), drive, each.until, factors, tol, each.known.step),
                    side(bench, pair.simpler, drive, each.until, bounce, tol, each.known.step),
                    each.distances[last], True, levers(bench), bench.matched.bare,
                )
            )  # fmt: skip
    return shown
