"""Which rung explains measured motions: each is fitted on some trials and scored on the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rungwise.content import ByContent
from rungwise.deadline import NEVER, Deadline, LimitError, seconds
from rungwise.fitting.found import Fit
from rungwise.fitting.measured.errors import MotionError
from rungwise.fitting.measured.layout import Layout
from rungwise.fitting.measured.motions import Motions
from rungwise.fitting.measured.spans import MOMENTS
from rungwise.fitting.predict import Predictor
from rungwise.fitting.prepare import Options, Prepared, prepare
from rungwise.fitting.score import PHASES, Score, phase_of, scored, sizes, worse
from rungwise.fitting.stages import INTERRUPTED, Search
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import LADDER, Rung
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.simulation.options import count, moving_rung

ALIKE = 2.0
"""Deviations of the mean difference of trials within which two rungs are as near to the motions."""


class Explained(NamedTuple):
    """A rung fitted on some trials, and its score on the others."""

    fit: Fit
    score: Score


@dataclass(frozen=True, repr=False, eq=False)
class Explanation(ByContent):
    """Rungs of a scene in the order of the ladder, with fits and scores on trials that were not fitted.

    fitted, held_out: numbers of trials; known: the deviation of the measurement, as a displacement of the
    farthest point; unfinished: rungs that a limit left out, in words.
    """

    scene: Any
    rungs: dict[str, Explained]
    fitted: int
    held_out: int
    known: float
    unfinished: str = ""

    @property
    def best(self) -> str:
        """The rung of least error."""
        return min(self.rungs, key=lambda name: self.rungs[name].score.whole.value)

    def as_good(self, name: str) -> bool:
        """Whether the rung of this name is as near to the motions as the best rung, within the error of
        measurement or the uncertainty of so few trials."""
        mean, deviation = worse(self.rungs[name].score.trials, self.rungs[self.best].score.trials)
        return bool(mean <= max(ALIKE * deviation, self.known))

    @property
    def adequate(self) -> str:
        """The simplest rung that is as good as the best."""
        return next(name for name in self.rungs if self.as_good(name))

    @property
    def ok(self) -> bool:
        """Whether all rungs were tried."""
        return not self.unfinished

    @property
    def verdict(self) -> str:
        """Which rung explains the motions, and where the others fail."""
        lines = [f"{self.adequate} explains the motions as well as any"]
        if self.adequate != self.best:
            lines = [
                f"{self.adequate} explains the motions as well as {self.best} does, within the error of"
                " measurement"
            ]
        return "; ".join([*lines, *(self.failure(name) for name in self.rungs if not self.as_good(name))])

    def failure(self, name: str) -> str:
        """Where the rung of this name is farther from the motions than the best rung, in words."""
        own = {phase.name: phase for phase in self.rungs[name].score.phases}
        other = {phase.name: phase for phase in self.rungs[self.best].score.phases}
        ratios = {
            phase: own[phase].whole / max(other[phase].whole, 1e-300)
            for phase in PHASES
            if phase in own and phase in other
        }
        if not ratios:
            return f"{name} is farther from the motions"
        worst = max(ratios, key=lambda phase: ratios[phase])
        return f"{name} fails in {worst}: errors are {ratios[worst]:.3g} times as large there"

    def __repr__(self) -> str:
        return f"<Explanation of {cut(self.scene.name)}: {self.adequate} of {', '.join(self.rungs)}>"

    def __str__(self) -> str:
        head = f"{self.scene.name}: {self.fitted} trials fitted, {self.held_out} held out"
        lines = [head]
        for name, (fit, score) in self.rungs.items():
            values = ", ".join(f"{k} = {v:.4g}" for k, v in fit.values.items() if k not in fit.open)
            lines.append(f"  {name}: {values or 'no parameter is determined'}")
            lines.append(
                f"    error of place {score.place}, of turn {score.turn};"
                f" {score.cost:.2g} s per second simulated"
            )
            lines.append("    " + "; ".join(f"{p.name} {p.place:.3g}, {p.turn:.3g}" for p in score.phases))
        lines += [f"  {self.verdict}"] + ([f"  {self.unfinished}"] if self.unfinished else [])
        return "\n".join(lines)

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise fit --model all --json` prints them."""
        return {
            "scene": self.scene.name, "fitted": self.fitted, "held_out": self.held_out, "best": self.best,
            "adequate": self.adequate, "verdict": self.verdict, "unfinished": self.unfinished,
            "rungs": {n: _plain(each) | {"as_good": self.as_good(n)} for n, each in self.rungs.items()},
        }  # fmt: skip


def _plain(each: Explained) -> dict[str, Any]:
    score = each.score
    means = {name: vars(getattr(score, name)) for name in ("place", "turn", "whole")}
    determined = [name for name in each.fit.over if name not in each.fit.open]
    return {
        "fit": each.fit.summary(), "parameters": len(determined), "cost": score.cost,
        "phases": [vars(phase) for phase in score.phases],
    } | means  # fmt: skip


@keywords
def explain(
    scene: AnyScene | str | Path | Mapping[str, Any],
    motions: Motions,
    over: Sequence[str] | str,
    *,
    models: Sequence[Rung | str] | None = None,
    held_out: float | Motions = 0.5,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    span: float | None = None,
    moments: int = MOMENTS,
    step: float | None = None,
    tol: float | None = None,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    keep_interrupted: bool = False,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> Explanation:
    """Fit every rung on a part of the trials and score it on the others. The answer says which rung explains
    the motions, and where simpler ones fail.

    Args:
        models: rungs; all that move if not given.
        held_out: the part of the trials that is not fitted, drawn by the seed; or other motions.
        scene, motions, over, box, parameters, span, moments, step, tol: as for `fit`, which is called for
            each rung. Parameters that a rung does not read are left out of its fit.
        limit, seed, threads, out, resume, keep_interrupted: as for `fit`; each rung has a folder of its own
            in `out`.
        on_progress: as for `fit`, and besides told the name of the rung.

    Scores are errors over spans of the same length for all rungs.

    Raises what `fit` raises, and MotionError where no trial is left to hold out.
    """
    deadline, loaded = Deadline(seconds(limit)), load(scene)
    rungs = [moving_rung(each) for each in (models or [each for each in LADDER if each.moves])]
    options = Options(span, count("moments", moments, 1), step, tol, threads, count("seed", seed, 0))
    train, test = _parts(motions, held_out, options.seed)
    fits, unfinished = dict[str, tuple[Prepared, Fit]](), ""
    for number, rung in enumerate(rungs):
        told = None if on_progress is None else _named(on_progress, rung.name)
        one = prepare(loaded, rung, train, over, box, parameters, options)
        folder = None if out is None else Path(out) / rung.name
        part = Deadline(deadline.share(len(rungs) - number))
        try:
            with part.running():
                fit = Search(one, part, one.log(folder, resume), told).found(keep_interrupted)
            fits[rung.name] = one, fit
        except LimitError as error:
            if not fits:
                raise
            unfinished = f"{rung.name} was not fitted: {error}"
        if INTERRUPTED in fits[next(reversed(fits))][1].unfinished:
            unfinished = f"{INTERRUPTED} at {rung.name}"
            break
    return Explanation(loaded, _scored(fits, test), len(train), len(test), _deviation(one), unfinished)


def _parts(motions: Motions, held_out: float | Motions, seed: int) -> tuple[Motions, Motions]:
    """Motions to fit, and motions to score on."""
    if not isinstance(motions, Motions):
        raise MotionError(f"motions: must be rw.Motions, not {shown(motions)}")
    if isinstance(held_out, Motions):
        return motions, held_out
    return motions.split(1.0 - held_out, seed=seed)


def _scored(fits: dict[str, tuple[Prepared, Fit]], test: Motions) -> dict[str, Explained]:
    """The scores of fits on motions that they have not seen; phases are told by the clearest one."""
    clearest = min(fits, key=lambda name: np.nan_to_num(fits[name][1].misfit, nan=np.inf))
    _, shorter, told, best = _unseen(*fits[clearest], test)
    which = phase_of(shorter, told, best)
    found = {}
    for name, (one, fit) in fits.items():
        spans, short, layout, point = _unseen(one, fit, test)
        found[name] = Explained(fit, scored(spans, short, layout, point, which))
    return found


def _unseen(one: Prepared, fit: Fit, test: Motions) -> tuple[Predictor, Predictor, Layout, Reals]:
    """What runs spans, and short spans, of other motions; their layout; and the values found (k,)."""
    other = prepare(one.scene, one.rung, test, one.box.names, _ends(one), one.given, one.options)
    spans, short = (other.predictor(each, NEVER) for each in (other.spans(), other.short()))
    return spans, short, other.layout, np.array([fit.values[name] for name in fit.over])


def _ends(one: Prepared) -> dict[str, tuple[float, float]]:
    """The box of a fit, by name."""
    return {name: (float(low), float(high)) for name, low, high in zip(*one.box[:3], strict=True)}


def _deviation(one: Prepared) -> float:
    """The measurement's deviation as the way of the farthest point of an object."""
    return float(sizes(one.scene, one.layout.compared, one.layout.sigma[None]).whole[0])


def _named(
    on_progress: Callable[[str, int, int], None], name: str
) -> Callable[[str, int, int], None]:  # fmt: skip
    return lambda what, done, known: on_progress(f"{name}, {what}", done, known)
