"""The stages of a fit: what is sought, the whole box, least squares, and how sure the values are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.deadline import Deadline, LimitError, TimeOver
from rungwise.fitting.certainty import Certainty, certainty
from rungwise.fitting.found import OUTSIDE, Alike, Fit, Residual
from rungwise.fitting.least_squares import (
    BOX_PRECISION,
    Best,
    best_of,
    derivatives,
    descend,
    deviations,
    merged,
    samples,
    slices,
    spread_apart,
    worse,
)  # fmt: skip
from rungwise.fitting.loss import EXPECTED, bend, by_trial, losses, typical_losses
from rungwise.fitting.measured.spans import Spans
from rungwise.fitting.measured.touching import touching
from rungwise.fitting.predict import Log, Predictor
from rungwise.fitting.prepare import Prepared
from rungwise.fitting.score import Phase, phase_of, phases
from rungwise.fitting.telling import telling
from rungwise.fitting.unlike import SPANS, Unlike, begins_clear, unlike
from rungwise.fitting.weights import NORMAL_MEDIAN, Weights, by_sensitivity, free_flight, unexplained
from rungwise.kernel import Ints, Reals

FEW, MANY, MOST = 60, 120, 500
"""Spans on which the whole box is sampled, on which least squares works, and from which values and intervals
come in the end, at most."""
ROUGHLY = 10.0
"""Times the error allowed per step with which the box is sampled."""
WEIGHED = 3
"""Times that starts' sensitivities are found anew, at the values found with those before."""
STEPS = 2
"""Rounds of least squares between."""
MOVED = 5e-3
"""Change of the values, as a part of the box, below which the weights are settled."""
BRIEF = 500
"""Short spans by which phases are told, at most."""
COARSE, FINER = 0.25, 0.1
"""Steps are too coarse where a part `FINER` of the error allowed in each changes the values by more than
a part `COARSE` of their deviation; then that is taken."""
ALL = 1.5
"""And where so many deviations of it are the same in all trials: runs that scatter change with any step."""
FIRST, KNOWN = 2, 0.02
"""Rounds of a descent after which it ends where it is worse than another by more than chance, or within this
part of the box from a minimum that is known."""
OTHERS = 2
"""Other minima that are followed at most."""
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
        self._rows: Ints = np.arange(len(self._whole.spans.trial))
        self._parts = dict[int, Predictor]()
        self._box, self._fixed = prepared.box, dict[str, float]()
        self._state: _State | None = None
        self._minima: list[Best] = []
        self._stage = "candidates had run"

    def found(self, keep_interrupted: bool = False) -> Fit:
        """The fit, as far as the time allows. Raises LimitError."""
        unfinished, sure, told = "", None, _Told((), float("nan"), (), float("nan"), None)
        try:
            self._drop_unread()
            if self._box.names:
                self._sample()
                self._settle(refine=True)
                self._look_along()
                self._others()
                self._last()
                self._enter("intervals were found")
                sure = self._certainty()
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
        box = self._box
        told = telling(self._whole, self._layout, box, self._seed)
        defaults = self._prepared.scene.parameters(self._prepared.given)
        pairs = zip(box.names, told.read, strict=True)
        self._fixed = {name: defaults[name] for name, each in pairs if not each}
        self._box = box.take(np.flatnonzero(told.read))
        self._whole = self._whole.over_only(self._box.names)
        self._rows, self._parts = told.rows, {}

    def _sample(self) -> None:
        """Sample the box on few spans, by rough runs, and descend from the best samples that are apart."""
        few, box = self._part(FEW), self._box
        if self._prepared.options.tol is None and few.tol is not None:
            few = few.at_tol(ROUGHLY * few.tol)
        defaults = self._prepared.scene.parameters()
        start = box.unit(np.array([defaults[name] for name in box.names]))
        places = samples(box, self._seed, start)
        self._tell("samples", len(places) * len(few.spans.trial))
        weights = free_flight(self._layout, few, np.zeros(len(self._layout.sigma)))
        errors = few(box.values(places)).errors
        rough = np.array([_loudness(weights.whitened(errors[i : i + 1])[0]) for i in range(len(places))])
        extra = unexplained(weights, few, errors[int(rough.argmin())], weights.extra)
        weights = free_flight(self._layout, few, extra)
        loss = np.concatenate(
            [losses(weights.whitened(errors[i : i + 1]), weights.free) for i in range(len(places))]
        )
        order = spread_apart(places, loss)
        self._state = _State(Best(places[order[0]], float(loss[order[0]]), np.zeros((0, 0))), weights)
        self._enter("the search had ended")
        for number, i in enumerate(order):
            self._tell(f"descent {number + 1} of {len(order)}", 0)
            self._descend_apart(few, weights, places[i])
        best = min(self._minima, key=lambda each: each.loss)
        self._minima = merged(self._minima, derivatives(few, box, weights, best)[2].sum(axis=0))

    def _descend_apart(self, few: Predictor, weights: Weights, unit: Reals) -> None:
        """Descend from a sample, as long as it leads to no minimum that is known, or to a worse one."""
        told = self._better(weights)
        if not self._minima:
            self._minima.append(descend(few, self._box, weights, unit, told=told))
            return
        best = min(self._minima, key=lambda each: each.loss)
        found = descend(few, self._box, weights, unit, FIRST, told)
        near = min(float(np.abs(found.unit - each.unit).max()) for each in self._minima)
        if near > KNOWN and not worse(found, best, weights.free):
            found = descend(few, self._box, weights, found.unit, told=told)
        self._minima.append(found)

    def _settle(self, refine: bool = False, most: int | None = None, left: int = WEIGHED) -> None:
        """Least squares on many spans, with weights by the sensitivities of runs at the best so far."""
        assert self._state is not None
        spans = MANY if most is None else most
        while left > 0:
            self._tell(f"least squares on {spans} spans", 0)
            unit, many = self._state.best.unit, self._part(spans)
            point = self._box.values(unit)
            errors = many(point[None]).errors
            weights = by_sensitivity(self._layout, many, point, errors[0])
            whitened = weights.whitened(errors)
            loss = float(losses(whitened, weights.free)[0])
            self._state = _State(Best(unit, loss, whitened[0]), weights)
            descend(many, self._box, weights, unit, STEPS, self._better(weights))
            settled = np.abs(self._state.best.unit - unit).max() < MOVED
            if refine and self._refine():
                continue
            left = 0 if settled else left - 1

    def _look_along(self) -> None:
        """Begin anew where, along one parameter, the loss is less: a search does not leave a plain on which a
        parameter decides nothing, as great friction does not."""
        assert self._state is not None
        (best, weights), many = self._state, self._part(MANY)
        found = best_of(many, self._box, weights, slices(best.unit))
        if found.loss < best.loss:
            self._better(weights)(found)
            descend(many, self._box, weights, found.unit, told=self._better(weights))
            self._settle()

    def _refine(self) -> bool:
        """Take finer steps where their error changes the values found; whether that was so."""
        assert self._state is not None
        tol, (best, weights) = self._whole.tol, self._state
        if self._prepared.options.tol is not None or tol is None or tol < self._prepared.finest:
            return False
        many, point = self._part(MANY), self._box.values(self._state.best.unit)
        fine = weights.whitened(many.at_tol(FINER * tol)(point[None]).errors)[0]
        slope, first, second = derivatives(many, self._box, weights, best)
        change = by_trial(many.spans.trial, bend(slope, fine, weights.free)[0] - first)
        total = second.sum(axis=0)
        moved = change @ np.linalg.inv(total + BOX_PRECISION * np.eye(len(total)))
        far = np.abs(moved.sum(axis=0)) > COARSE * deviations(total)
        if not (far & (np.abs(moved.sum(axis=0)) > ALL * np.linalg.norm(moved, axis=0))).any():
            return False
        self._whole, self._parts = self._whole.at_tol(FINER * tol), {}
        return True

    def _others(self) -> None:
        """Follow other minima on many spans by the weights of the best, which may turn out not to be it."""
        assert self._state is not None
        (best, weights), many, box = self._state, self._part(MANY), self._box
        curvature, found = derivatives(many, box, weights, best)[2].sum(axis=0), [best]
        here = [best_of(many, box, weights, each.unit[None]) for each in self._minima[1:]]
        others = [x for x in merged([best, *here], curvature) if x is not best]
        for each in [x for x in others if not worse(x, best, weights.free)][:OTHERS]:
            self._tell("other minima", 0)
            told = self._better(weights)
            found.append(descend(many, box, weights, each.unit, STEPS, told))
        if len(merged([best, self._state.best], curvature)) > 1:
            self._settle()
            (settled, weights), many = self._state, self._part(MANY)
            found = [settled, *(best_of(many, box, weights, each.unit[None]) for each in found)]
        else:
            found.append(self._state.best)
        kept = merged(found, curvature)
        self._minima = [each for each in kept if not worse(each, kept[0], weights.free)]

    def _last(self) -> None:
        """The values, and other minima, by as many spans as there may be, by the weights of the best."""
        if len(self._rows) <= MANY:
            return
        self._settle(most=self._most, left=1)
        assert self._state is not None
        (best, weights), most, box = self._state, self._part(self._most), self._box
        curvature, found = derivatives(most, box, weights, best)[2].sum(axis=0), [best]
        for each in self._minima[1:]:
            here = best_of(most, box, weights, each.unit[None])
            if not worse(here, best, weights.free):
                found.append(descend(most, box, weights, each.unit, 1, self._better(weights)))
        kept = merged([self._state.best, *found], curvature)
        self._minima = [each for each in kept if not worse(each, kept[0], weights.free)]

    def _certainty(self) -> Certainty:
        """How sure the values are, by all the spans there may be, and what is open by many of them."""
        all_, many = (np.sort(self._rows[:most]) for most in (self._most, MANY))
        some = np.searchsorted(all_, many)
        return certainty(self._part(self._most), self._box, self._weights, self._minima, self._seed, some)

    def _better(self, weights: Weights) -> Callable[[Best], None]:
        """Keeps what is better than the best so far."""

        def told(best: Best) -> None:
            if self._state is None or best.loss < self._state.best.loss:
                self._state = _State(best, weights)

        return told

    def _part(self, most: int) -> Predictor:
        """The runs of so many of the spans that tell of the parameters; the same ones for the same number."""
        if most not in self._parts:
            self._parts[most] = self._whole.on(self._whole.spans.take(np.sort(self._rows[:most])))
        return self._parts[most]

    def _enter(self, stage: str) -> None:
        """What is not yet done, should the time be over."""
        self._stage = stage

    def _tell(self, what: str, needed: int) -> None:
        if self._on_progress is not None:
            self._on_progress(what, int(self._whole.made[0]), int(self._whole.made[0]) + needed)

    @property
    def _most(self) -> int:
        """The spans of the end: as many as there may be where that is more than before."""
        return MOST if len(self._rows) > MANY else MANY

    @property
    def _weights(self) -> Weights:
        """The weights by which the best is the best."""
        assert self._state is not None
        return self._state.weights

    @property
    def _point(self) -> Reals:
        """The best values (k,) of the parameters that are sought."""
        return self._box.values(np.zeros(0) if self._state is None else self._state.best.unit)

    def _told(self) -> _Told:
        """Residuals by coordinate and phase, the misfit, and the part of runs that came to their ends."""
        some, point = self._part(MANY), self._point
        weights = by_sensitivity(self._layout, some, point)
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
        unlike_ = None if misfit > OUTSIDE else self._unlike()
        return _Told(tuple(found), misfit, by_phase, float(predicted.ended.mean()), unlike_)

    def _unlike(self) -> Unlike | None:
        """The test of the errors against those that the rung makes itself, in whole trials, and in spans
        where velocities were measured: those by regression beside an impact are off by more than noise, as is
        how far contacts yield that do. Runs without inertia do not read them."""
        prepared, box, k = self._prepared, self._box, len(self._box.names)
        unit, covariance = np.zeros(0), np.zeros((0, 0))
        if self._state is not None:
            (best, weights), most = self._state, self._part(self._most)
            unit = best.unit
            here = best_of(most, box, weights, unit[None])
            total = derivatives(most, box, weights, here)[2].sum(axis=0)
            covariance = np.linalg.inv(total + BOX_PRECISION * np.eye(k))
        closed = touching(prepared.scene, self._layout, prepared.given)
        lengths = []
        lengths_of = {"whole trials": prepared.whole_trials()}
        fast = prepared.rung.inertia > 0.0
        measured = all(each.trial.v is not None for each in self._layout.trials)
        if (measured or not fast) and len(self._whole.spans.trial) > len(lengths_of["whole trials"].trial):
            lengths_of["spans"] = self._whole.spans
        for name, spans in lengths_of.items():
            yields = fast and prepared.rung.compliant
            clear = np.flatnonzero(begins_clear(self._layout, closed, spans, yields) | (not fast))
            rows = np.random.default_rng(self._seed).permutation(clear)[:SPANS]
            if len(rows):
                lengths.append((name, self._whole.on(spans.take(np.sort(rows)))))
        if not lengths:
            return None
        known = set(prepared.motions.coordinates) <= set(prepared.motions.deviations)
        return unlike(lengths, self._layout, box, unit, covariance, self._seed, known)

    def _fit(self, sure: Certainty | None, told: _Told, unfinished: str) -> Fit:
        sought, box, whole = self._prepared.box, self._box, self._whole
        values = dict(zip(box.names, self._point.tolist(), strict=True)) | self._fixed
        ends = {n: (float(low), float(high)) for n, low, high in zip(*sought[:3], strict=True)}
        k = len(sought.names)
        correlation, open_, alike = np.eye(k), dict[str, str](), tuple[Alike, ...]()
        if sure is not None:
            ends |= {
                n: (float(low), float(high))
                for n, low, high in zip(box.names, sure.lower, sure.upper, strict=True)
            }
            rows = [sought.names.index(name) for name in box.names]
            correlation[np.ix_(rows, rows)] = sure.correlation
            open_ |= sure.open_
            alike = tuple(
                Alike(dict(zip(box.names, each.tolist(), strict=True)), float(share))
                for each, share in zip(sure.alike, sure.shares, strict=True)
                if len(sure.shares) > 1
            )
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
            open=open_, alike=alike, residuals=told.residuals, phases=told.phases, misfit=told.misfit,
            trials=len(set(whole.spans.trial.tolist())), spans=len(whole.spans.trial),
            span=float(whole.spans.durations.sum(axis=1).max()), moved=float(whole.moved.max(initial=0.0)),
            ended=told.ended, loss=best, runs=int(whole.made[0]), wall_s=time.monotonic() - self._began,
            unfinished=unfinished, unlike=told.unlike,
        )  # fmt: skip


class _Told(NamedTuple):
    """What is said of the errors at the values found."""

    residuals: tuple[Residual, ...]
    misfit: float
    phases: tuple[Phase, ...]
    ended: float
    unlike: Unlike | None


def _misfit(spans: Spans, weights: Weights, errors: Reals) -> float:
    """The loss of a trial over what it is where measurement and starts make all errors, the median over
    trials."""
    loss = typical_losses(weights.whitened(errors[None]))[0]
    free = EXPECTED * spans.counts.sum(axis=1) * errors.shape[-1]
    trials = np.unique(spans.trial)
    ratios = [loss[spans.trial == i].sum() / max(free[spans.trial == i].sum(), EXPECTED) for i in trials]
    return float(np.median(ratios))


def _loudness(whitened: Reals) -> float:
    """The mean size of errors (s, d), large ones by their logarithm: comparable whatever their scale."""
    return float(np.log1p(np.abs(whitened)).mean())
