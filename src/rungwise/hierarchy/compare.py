"""The paper's Table 1, measured on a scene: how far its models are apart, and what leads between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path as File
from typing import Any

import numpy as np

from rungwise.hierarchy.comparison import FAILS, Comparison, Measured
from rungwise.hierarchy.counterexample import Counterexample, levers, side
from rungwise.hierarchy.inputs import inputs_of
from rungwise.hierarchy.limits import INDEPENDENT, STAYS, first, fit
from rungwise.hierarchy.motions import MOVING, Bench
from rungwise.hierarchy.nearest import nearest
from rungwise.hierarchy.pairs import PAIRS, Pair
from rungwise.hierarchy.refine import Settled, settle
from rungwise.hierarchy.stages import cheapest, costs
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
    on_progress: Progress | None = None,
) -> Comparison:
    """Measure how far the models are apart on a scene: the paper's Table 1.

    Args:
        scene, parameters: as for `simulate`.
        model: only pairs with this rung; all if not given.
        samples: how many inputs are drawn, besides the scene's own, from `seed`.
        accuracy: within which motions count as alike, as a part of the scene's extent.
        duration: end of the runs; if not given, each ends when the last rung has come to an end, at the
            scene's duration at the latest.
        threads: how many, in space processes; as many as there are cores if not given. The results do not
            depend on it.
        on_progress: called with what was measured, and how many parts of the work are done and known.

    Raises SceneError or ModelError for wrong input. Ctrl-C raises KeyboardInterrupt."""
    loaded, samples = load(scene), count("samples", samples, 0)
    rng = np.random.default_rng(count("seed", seed, 0))
    accuracy = _part(accuracy)
    fixed = RunOptions(duration=duration).duration
    chosen = [] if model is None else [moving_rung(model).name]
    pairs = [p for p in PAIRS if not chosen or chosen[0] in (p.richer.name, p.simpler.name)]
    values = loaded.parameters(parameters)
    longest = _duration(loaded, values) if fixed is None else fixed
    steps = _Steps(on_progress, 2 + len(MOVING) + sum(1 + len(pair.paths) for pair in pairs))
    extent, lengths = world_of(loaded).measures(values, longest)
    match = world_of(loaded).matched(values, longest)
    pairs = [pair._replace(paths=tuple(p for p in pair.paths if p.is_within(match))) for pair in pairs]
    bench = Bench(match, inputs_of(loaded, values), longest, extent, lengths, threads)
    drawn = bench.inputs.draw(samples, rng)
    until = bench.last(drawn, PART * accuracy) if fixed is None else np.full(len(drawn), longest)
    steps.done("parameters matched")
    runs = dict[str, Settled]()
    for rung in MOVING:
        runs[rung.name] = settle(bench, rung, drawn, until, accuracy)
        steps.done(rung.name)
    measured = [_measure(bench, pair, runs, drawn, until, accuracy, rng, steps) for pair in pairs]
    stages = costs(bench, drawn, until, runs[DYNAMIC_COMPLIANT.name].motions)
    steps.done("stages")
    shown = [each for part in measured for each in _counterexamples(bench, part, runs, drawn, until)]
    return Comparison(
        scene=loaded, parameters=values, accuracy=accuracy, extent=extent, inputs=bench.inputs, samples=drawn,
        until=until, notes=match.notes, ends={name: each.motions.ends for name, each in runs.items()},
        errors={name: each.error for name, each in runs.items()}, pairs=tuple(measured), costs=tuple(stages),
        cheapest=cheapest(stages, accuracy), counterexamples=tuple(shown),
    )  # fmt: skip


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
    name, tol = f"{pair.richer.name} -> {pair.simpler.name}", PART * accuracy
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
    name, shown = f"{pair.richer.name} -> {pair.simpler.name}", list[Counterexample]()
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
            at, tol = each.values[last], each.tols[last]
            factors = path.factors(at) | bounce
            shown.append(
                Counterexample(
                    f"{name}, Definition 2: {path.words}, at {path.name} = {at:g}",
                    side(bench, path.rung(pair.richer, at), drive, each.until, factors, tol, each.step),
                    side(bench, pair.simpler, drive, each.until, bounce, tol, each.step),
                    each.distances[last], True, levers(bench), bench.matched.bare,
                )
            )  # fmt: skip
    return shown
