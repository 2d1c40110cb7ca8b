"""Parameters under which runs come nearest to measured motions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rungwise.deadline import Deadline, LimitError, TimeOver, seconds
from rungwise.errors import InputError
from rungwise.fitting.box import Box, box_of
from rungwise.fitting.certainty import Certainty, certainty
from rungwise.fitting.errors import MotionError
from rungwise.fitting.found import Fit, Residual
from rungwise.fitting.layout import Layout, laid_out
from rungwise.fitting.motions import Motions, check_parameters
from rungwise.fitting.predict import Predictor
from rungwise.fitting.search import EXPECTED, STARTS, Best, descend, losses, samples, trial_losses
from rungwise.fitting.spans import MOMENTS, Spans, spans_of
from rungwise.fitting.weights import NORMAL_MEDIAN, Weights, by_sensitivity, free_flight, unexplained
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.simulation.options import count, moving_rung

FEW, MANY = 80, 300
"""Spans on which the whole box is sampled, and on which least squares works at most: more of them tell little
more of the values than these."""
WEIGHED = 3
"""Times that starts' sensitivities are found anew, at the values found with those before."""
MOVED = 5e-3
"""Change of the values, as a part of the box, below which the weights are settled."""


@keywords
def fit(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    motions: Motions,
    over: Sequence[str] | str,
    *,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    span: float | None = None,
    moments: int = MOMENTS,
    step: float | None = None,
    tol: float | None = 1e-3,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> Fit:
    """The parameters `over` under which runs of a scene on a rung come nearest to measured motions.

    Runs begin at measured states and last `span`; their errors are weighed by the deviation of the
    measurement and by what it makes of the start (`rungwise.fitting.weights`), with a robust loss. The whole
    box is sampled first, then least squares goes on from the best (`rungwise.fitting.search`).

    Args:
        scene, model: as for `simulate`. Goals and other conditions of the scene end no run.
        motions: measured trials. Starts that overlap are moved out by the least motion.
        over: names of the parameters to find, each in its range, or in `box`.
        parameters: values of other parameters; what the motions know of each trial comes before.
        span: how long runs last, in the scene's time; a quarter of the median trial if not given, and whole
            trials where it is `inf`.
        moments: frames of a span that are compared, at most.
        step, tol, threads: as for `rollout`.
        limit: seconds after which the best so far is returned; see `Fit.unfinished`.
        seed: of samples, of spans that are chosen, and of the bootstrap.
        on_progress: called with what is done, runs done, and runs known to be needed (0 if not known).

    Raises MotionError, SceneError, ModelError or InputError for wrong input, and LimitError where the limit
    was over before one candidate had run.
    """
    deadline, began = Deadline(seconds(limit)), time.monotonic()
    loaded, rung = load(scene), moving_rung(model)
    if not isinstance(motions, Motions):
        raise MotionError(f"motions: must be rw.Motions, not {shown(motions)}")
    within = box_of(loaded, over, box)
    _no_twice(within, parameters)
    given = {name: loaded.parameters(parameters)[name] for name in (parameters or {})}
    check_parameters(motions, within.names, loaded.file.parameters, loaded.template.inputs)
    layout = laid_out(loaded, motions)
    spans = spans_of(loaded, layout, span, count("moments", moments, 1))
    predictor = Predictor(
        loaded, rung, spans, layout.compared, within.names, given, tol=tol, step=step, threads=threads,
        deadline=deadline,
    )  # fmt: skip
    search = Search(predictor, layout, within, count("seed", seed, 0), on_progress)
    with deadline.running():
        return search.found(loaded, began)


def _no_twice(box: Box, parameters: Mapping[str, float] | None) -> None:
    for name in parameters or {}:
        if name in box.names:
            raise InputError(f"parameters.{name}: is given, and `over` asks for it")


class _State(NamedTuple):
    """How far a search has come: the best place and the weights by which it is the best."""

    best: Best
    weights: Weights


class Search:
    """The search of one fit, in stages; the best so far is kept."""

    def __init__(
        self, predictor: Predictor, layout: Layout, box: Box, seed: int,
        on_progress: Callable[[str, int, int], None] | None = None,
    ) -> None:  # fmt: skip
        self.predictor, self.layout, self.box, self.seed = predictor, layout, box, seed
        self._on_progress = on_progress
        self._rng = np.random.default_rng(seed)
        self._parts: list[Predictor] = []
        self.state: _State | None = None

    def found(self, scene: Any, began: float) -> Fit:
        """The fit, as far as the time allows. Raises LimitError."""
        unfinished, sure = "", None
        try:
            self._sample()
            self._settle()
            sure = self._certainty()
        except TimeOver:
            if self.state is None:
                words = "limit: the time was over before candidates had run; give more time"
                raise LimitError(words) from None
            stage = "intervals were found" if self.state.weights.inverse.any() else "the search had ended"
            unfinished = f"the time was over before {stage}; the values are the best so far"
        return self._fit(scene, sure, unfinished, began)

    def _sample(self) -> None:
        """Sample the box on few spans, and descend from the best samples."""
        few = self._part(FEW)
        scene_values = self.predictor.scene.parameters()
        start = self.box.unit(np.array([scene_values[name] for name in self.box.names]))
        places = samples(self.box, self.seed, start)
        self._tell("samples", len(places) * len(few.spans.trial))
        weights = free_flight(self.layout, few, np.zeros(len(self.layout.sigma)))
        errors = few(self.box.values(places)).errors
        rough = np.array([_loudness(weights.whitened(errors[i : i + 1])[0]) for i in range(len(places))])
        extra = unexplained(weights, few, errors[int(rough.argmin())], weights.extra)
        weights = free_flight(self.layout, few, extra)
        loss = np.concatenate([losses(weights.whitened(errors[i : i + 1])) for i in range(len(places))])
        order = np.argsort(loss)[:STARTS]
        first = Best(places[order[0]], float(loss[order[0]]), np.zeros((0, 0)))
        self.state = _State(first, weights)
        for number, i in enumerate(order):
            self._tell(f"descent {number + 1} of {STARTS}", 0)
            best = descend(few, self.box, weights, places[i])
            if best.loss < self.state.best.loss:
                self.state = _State(best, weights)

    def _settle(self) -> None:
        """Least squares on many spans, with weights by the sensitivities of runs at the best so far."""
        assert self.state is not None
        many = self._part(MANY)
        for number in range(WEIGHED):
            self._tell(f"least squares {number + 1} of {WEIGHED}", 0)
            unit = self.state.best.unit
            point = self.box.values(unit)
            none = np.zeros(len(self.layout.sigma))
            weights = by_sensitivity(self.layout, many, point, none)
            errors = many(point[None]).errors[0]
            extra = unexplained(weights, many, errors, none)
            if extra.any():
                weights = by_sensitivity(self.layout, many, point, extra)
            best = descend(many, self.box, weights, unit)
            self.state = _State(best, weights)
            if np.abs(best.unit - unit).max() < MOVED:
                break

    def _certainty(self) -> Certainty:
        assert self.state is not None
        self._tell("intervals", 0)
        return certainty(self._part(MANY), self.box, self.state.weights, self.state.best.unit, self.seed)

    def _part(self, most: int) -> Predictor:
        """The runs of so many spans, spread over trials; the same ones for the same number."""
        s = len(self.predictor.spans.trial)
        if s <= most:
            return self.predictor
        rows = np.sort(np.random.default_rng(self.seed).permutation(s)[:most])
        part = self.predictor.on(self.predictor.spans.take(rows))
        self._parts.append(part)
        return part

    def _tell(self, what: str, needed: int) -> None:
        if self._on_progress is not None:
            self._on_progress(what, self.runs, self.runs + needed)

    @property
    def runs(self) -> int:
        """How many were made."""
        return self.predictor.runs + sum(part.runs for part in self._parts)

    def _fit(self, scene: Any, sure: Certainty | None, unfinished: str, began: float) -> Fit:
        assert self.state is not None
        best, box = self.state.best, self.box
        point = box.values(best.unit)
        k = len(box.names)
        values = dict(zip(box.names, point.tolist(), strict=True))
        ends = np.stack([box.low, box.high], 1) if sure is None else np.stack([sure.lower, sure.upper], 1)
        whole = self.predictor
        try:
            residuals, misfit, ended = self._residuals(point)
        except TimeOver:
            residuals, misfit, ended = (), float("nan"), float("nan")
        return Fit(
            measured_on=scene, model=whole.model, over=box.names, values=values,
            intervals={n: (float(low), float(high)) for n, (low, high) in zip(box.names, ends, strict=True)},
            correlation=np.eye(k) if sure is None else sure.correlation,
            open={} if sure is None else sure.open_, residuals=residuals, misfit=misfit,
            trials=len(set(whole.spans.trial.tolist())), spans=len(whole.spans.trial),
            span=float(whole.spans.durations.sum(axis=1).max()), moved=float(whole.moved.max(initial=0.0)),
            ended=ended, loss=best.loss, runs=self.runs, wall_s=time.monotonic() - began,
            unfinished=unfinished,
        )  # fmt: skip

    def _residuals(self, point: Reals) -> tuple[tuple[Residual, ...], float, float]:
        """Residuals by coordinate, the misfit, and the part of runs that came to their ends."""
        some = self._part(MANY)
        weights = by_sensitivity(self.layout, some, point, np.zeros(len(self.layout.sigma)))
        misfit = _misfit(some.spans, weights, some(point[None]).errors[0])
        predicted, counts = self.predictor(point[None]), self.predictor.spans.counts
        expected = NORMAL_MEDIAN * np.median(weights.spread[some.spans.counts], axis=0)
        found = []
        for e, name in enumerate(self.layout.compared.names):
            own = predicted.errors[0, ..., e][counts]
            sizes = float(np.sqrt((own**2).mean())), float(np.median(np.abs(own)))
            found.append(Residual(name, *sizes, float(self.layout.sigma[e]), float(expected[e])))
        return tuple(found), misfit, float(predicted.ended.mean())


def _misfit(spans: Spans, weights: Weights, errors: Reals) -> float:
    """The loss of a trial over what it is where measurement and starts make all errors, the median over
    trials."""
    loss = trial_losses(weights.whitened(errors[None]))[0]
    free = EXPECTED * spans.counts.sum(axis=1) * errors.shape[-1]
    trials = np.unique(spans.trial)
    ratios = [loss[spans.trial == i].sum() / max(free[spans.trial == i].sum(), EXPECTED) for i in trials]
    return float(np.median(ratios))


def _loudness(whitened: Reals) -> float:
    """The mean size of errors (s, d), large ones by their logarithm: comparable whatever their scale."""
    return float(np.log1p(np.abs(whitened)).mean())
