"""The stages of a fit: what is sought, the whole box, least squares, and how sure the values are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.deadline import Deadline, LimitError, TimeOver
from rungwise.fitting.certainty import Certainty, certainty
from rungwise.fitting.found import Fit, Residual
from rungwise.fitting.log import Log
from rungwise.fitting.measured.spans import Spans
from rungwise.fitting.predict import Predictor
from rungwise.fitting.prepare import Prepared
from rungwise.fitting.score import Phase, phase_of, phases
from rungwise.fitting.search import EXPECTED, STARTS, Best, descend, losses, samples, trial_losses
from rungwise.fitting.weights import NORMAL_MEDIAN, Weights, by_sensitivity, free_flight, unexplained
from rungwise.kernel import Reals

FEW, MANY = 80, 300
"""Spans on which the whole box is sampled, and on which least squares works at most: more of them tell little
more of the values than these."""
PROBED = 10
"""Spans on which it is seen whether runs depend on a parameter at all."""
WEIGHED = 3
"""Times that starts' sensitivities are found anew, at the values found with those before."""
MOVED = 5e-3
"""Change of the values, as a part of the box, below which the weights are settled."""
BRIEF = 1000
"""Short spans by which phases are told, at most."""
INTERRUPTED = "the search was interrupted"


class _State(NamedTuple):
    """How far a search has come: the best place and the weights by which it is the best."""

    best: Best
    weights: Weights


class Search:
    """The search of one fit, in stages; the best so far is kept. Raises LimitError where there is none."""

    def __init__(
        self, prepared: Prepared, deadline: Deadline, log: Log | None,
        on_progress: Callable[[str, int, int], None] | None = None,
    ) -> None:  # fmt: skip
        self._began, self._on_progress = time.monotonic(), on_progress
        self._prepared, self._layout, self._seed = prepared, prepared.layout, prepared.options.seed
        self._whole = prepared.predictor(prepared.spans(), deadline, log)
        self._parts = dict[int, Predictor]()
        self._box, self._fixed = prepared.box, dict[str, float]()
        self._state: _State | None = None
        self._stage = "candidates had run"

    def found(self, keep_interrupted: bool = False) -> Fit:
        """The fit, as far as the time allows. Raises LimitError."""
        unfinished, sure, told = "", None, _Told((), float("nan"), (), float("nan"))
        try:
            self._drop_unread()
            if self._box.names:
                self._sample()
                self._settle()
                self._enter("intervals were found")
                assert self._state is not None
                sure = certainty(
                    self._part(MANY), self._box, self._state.weights, self._state.best.unit, self._seed
                )
            self._enter("errors were looked at")
            told = self._told()
        except (TimeOver, KeyboardInterrupt) as stop:
            if isinstance(stop, KeyboardInterrupt) and not keep_interrupted:
                raise
            why = "the time was over" if isinstance(stop, TimeOver) else INTERRUPTED
            if self._state is None:
                raise LimitError(f"limit: {why} before {self._stage}; give more time") from None
            unfinished = f"{why} before {self._stage}; the values are the best so far"
        return self._fit(sure, told, unfinished)

    def _drop_unread(self) -> None:
        """Leave parameters out that the runs do not read: these stay as they are."""
        probe = self._part(PROBED)
        box, rng = self._box, np.random.default_rng(self._seed)
        k = len(box.names)
        bases = rng.uniform(size=(2, 1, k))
        points = np.repeat(bases, k + 1, axis=1)
        points[:, np.arange(1, k + 1), np.arange(k)] = rng.uniform(size=(2, k))
        errors = probe(box.values(points.reshape(-1, k))).errors.reshape(2, k + 1, -1)
        read = (errors[:, 1:] != errors[:, :1]).any(axis=(0, 2))
        defaults = self._prepared.scene.parameters(self._prepared.given)
        self._fixed = {name: defaults[name] for name, each in zip(box.names, read, strict=True) if not each}
        self._box = box.take(np.flatnonzero(read))
        self._whole = self._whole.over_only(self._box.names)
        self._parts = {}

    def _sample(self) -> None:
        """Sample the box on few spans, and descend from the best samples."""
        few, box = self._part(FEW), self._box
        defaults = self._prepared.scene.parameters()
        start = box.unit(np.array([defaults[name] for name in box.names]))
        places = samples(box, self._seed, start)
        self._tell("samples", len(places) * len(few.spans.trial))
        weights = free_flight(self._layout, few, np.zeros(len(self._layout.sigma)))
        errors = few(box.values(places)).errors
        rough = np.array([_loudness(weights.whitened(errors[i : i + 1])[0]) for i in range(len(places))])
        extra = unexplained(weights, few, errors[int(rough.argmin())], weights.extra)
        weights = free_flight(self._layout, few, extra)
        loss = np.concatenate([losses(weights.whitened(errors[i : i + 1])) for i in range(len(places))])
        order = np.argsort(loss, kind="stable")[:STARTS]
        self._state = _State(Best(places[order[0]], float(loss[order[0]]), np.zeros((0, 0))), weights)
        self._enter("the search had ended")
        for number, i in enumerate(order):
            self._tell(f"descent {number + 1} of {STARTS}", 0)
            descend(few, box, weights, places[i], told=self._better(weights))

    def _settle(self) -> None:
        """Least squares on many spans, with weights by the sensitivities of runs at the best so far."""
        assert self._state is not None
        many, none = self._part(MANY), np.zeros(len(self._layout.sigma))
        for number in range(WEIGHED):
            self._tell(f"least squares {number + 1} of {WEIGHED}", 0)
            unit = self._state.best.unit
            point = self._box.values(unit)
            weights = by_sensitivity(self._layout, many, point, none)
            errors = many(point[None]).errors
            extra = unexplained(weights, many, errors[0], none)
            if extra.any():
                weights = by_sensitivity(self._layout, many, point, extra)
            whitened = weights.whitened(errors)
            self._state = _State(Best(unit, float(losses(whitened)[0]), whitened[0]), weights)
            descend(many, self._box, weights, unit, told=self._better(weights))
            if np.abs(self._state.best.unit - unit).max() < MOVED:
                break

    def _better(self, weights: Weights) -> Callable[[Best], None]:
        """Keeps what is better than the best so far."""

        def told(best: Best) -> None:
            if self._state is None or best.loss < self._state.best.loss:
                self._state = _State(best, weights)

        return told

    def _part(self, most: int) -> Predictor:
        """The runs of so many spans, spread over trials; the same ones for the same number."""
        s = len(self._whole.spans.trial)
        if s <= most:
            return self._whole
        if most not in self._parts:
            rows = np.sort(np.random.default_rng(self._seed).permutation(s)[:most])
            self._parts[most] = self._whole.on(self._whole.spans.take(rows))
        return self._parts[most]

    def _enter(self, stage: str) -> None:
        """What is not yet done, should the time be over."""
        self._stage = stage

    def _tell(self, what: str, needed: int) -> None:
        if self._on_progress is not None:
            self._on_progress(what, int(self._whole.made[0]), int(self._whole.made[0]) + needed)

    @property
    def _point(self) -> Reals:
        """The best values (k,) of the parameters that are sought."""
        return self._box.values(np.zeros(0) if self._state is None else self._state.best.unit)

    def _told(self) -> _Told:
        """Residuals by coordinate and phase, the misfit, and the part of runs that came to their ends."""
        some, point = self._part(MANY), self._point
        weights = by_sensitivity(self._layout, some, point, np.zeros(len(self._layout.sigma)))
        misfit = _misfit(some.spans, weights, some(point[None]).errors[0])
        predicted, counts = self._whole(point[None]), self._whole.spans.counts
        expected = NORMAL_MEDIAN * np.median(weights.spread[some.spans.counts], axis=0)
        found = []
        for e, name in enumerate(self._layout.compared.names):
            own = predicted.errors[0, ..., e][counts]
            measures = float(np.sqrt((own**2).mean())), float(np.median(np.abs(own)))
            found.append(Residual(name, *measures, float(self._layout.sigma[e]), float(expected[e])))
        short = self._whole.on(self._prepared.short())
        if len(short.spans.trial) > BRIEF:
            rows = np.random.default_rng(self._seed).permutation(len(short.spans.trial))[:BRIEF]
            short = short.on(short.spans.take(np.sort(rows)))
        by_phase = phases(short, self._layout, point, phase_of(short, self._layout, point))
        return _Told(tuple(found), misfit, by_phase, float(predicted.ended.mean()))

    def _fit(self, sure: Certainty | None, told: _Told, unfinished: str) -> Fit:
        sought, box, whole = self._prepared.box, self._box, self._whole
        values = dict(zip(box.names, self._point.tolist(), strict=True)) | self._fixed
        ends = {n: (float(low), float(high)) for n, low, high in zip(*sought[:3], strict=True)}
        k = len(sought.names)
        correlation, open_ = np.eye(k), dict[str, str]()
        if sure is not None:
            ends |= {
                n: (float(low), float(high))
                for n, low, high in zip(box.names, sure.lower, sure.upper, strict=True)
            }
            rows = [sought.names.index(name) for name in box.names]
            correlation[np.ix_(rows, rows)] = sure.correlation
            open_ |= sure.open_
        open_ |= dict.fromkeys(self._fixed, f"no run of {whole.model.name} depends on it")
        if sure is not None:
            defaults = self._prepared.scene.parameters(self._prepared.given)
            for name, explains, *whole_box in zip(box.names, sure.explains, box.low, box.high, strict=True):
                if name in open_ and np.allclose(explains, whole_box):
                    values[name] = defaults[name]  # as good as any
        best = 0.0 if self._state is None else self._state.best.loss
        return Fit(
            measured_on=self._prepared.scene, model=whole.model, over=sought.names,
            values={name: values[name] for name in sought.names}, intervals=ends, correlation=correlation,
            open=open_, residuals=told.residuals, phases=told.phases, misfit=told.misfit,
            trials=len(set(whole.spans.trial.tolist())), spans=len(whole.spans.trial),
            span=float(whole.spans.durations.sum(axis=1).max()), moved=float(whole.moved.max(initial=0.0)),
            ended=told.ended, loss=best, runs=int(whole.made[0]), wall_s=time.monotonic() - self._began,
            unfinished=unfinished,
        )  # fmt: skip


class _Told(NamedTuple):
    """What is said of the errors at the values found."""

    residuals: tuple[Residual, ...]
    misfit: float
    phases: tuple[Phase, ...]
    ended: float


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
