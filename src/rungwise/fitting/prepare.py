"""A fit before its first run: the scene, the motions laid out for it, and what makes its runs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.deadline import Deadline
from rungwise.errors import InputError
from rungwise.fitting.box import Box, box_of
from rungwise.fitting.measured.errors import MotionError
from rungwise.fitting.measured.layout import Layout, laid_out
from rungwise.fitting.measured.motions import Motions, check_names, check_parameters
from rungwise.fitting.measured.spans import Spans, spans_of
from rungwise.fitting.predict import Log, Predictor
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.world.find import impossible, world_of

FINE = 1e-3
"""Error allowed per step, as a part of the size of what moves: coarser steps damp, and errors add up."""
FINE_YIELDING = 1e-5
"""The same where contacts yield to momentum: an impact lasts a few steps, and these damp it."""
FINEST = 1e-6
"""The least that is taken where values are known so well that coarser steps change them."""
DENSE = 3
"""Moments of whole trials by which these are tested, over those of a span in a fit."""
SHORT = 5
"""Short spans, by which phases are told apart, in one of the default length; and their moments."""


@dataclass(frozen=True)
class Options:
    """How runs are made: as of `rungwise.fit`."""

    span: float | None
    moments: int
    step: float | None
    tol: float | None
    threads: int | None
    seed: int


@dataclass(frozen=True)
class Prepared:
    """What a fit on a rung is about: scene, rung, box of the parameters that are sought, values of others,
    motions as the scene's states."""

    scene: AnyScene
    rung: Rung
    motions: Motions
    box: Box
    given: dict[str, float]
    layout: Layout
    options: Options

    @property
    def tol(self) -> float | None:
        """The error allowed per step: as given, or by the size of what moves."""
        if self.options.tol is not None or self.options.step is not None:
            return self.options.tol
        part = FINE_YIELDING if self.rung.compliant and self.rung.inertia > 0.0 else FINE
        return part * world_of(self.scene).at(self.given).moved.size

    @property
    def finest(self) -> float:
        """The least error per step that a fit takes by itself."""
        return FINEST * world_of(self.scene).at(self.given).moved.size

    def predictor(self, spans: Spans, deadline: Deadline, log: Log | None = None) -> Predictor:
        """What runs the spans."""
        return Predictor(
            self.scene, self.rung, spans, self.layout.compared, self.box.ends, self.given,
            tol=self.tol, step=self.options.step, threads=self.options.threads, deadline=deadline,
            log=log,
        )  # fmt: skip

    def spans(self) -> Spans:
        """The spans of the fit."""
        return spans_of(self.scene, self.layout, self.options.span, self.options.moments, self.given)

    def whole_trials(self) -> Spans:
        """Spans that last as long as the trials."""
        return spans_of(self.scene, self.layout, float("inf"), DENSE * self.options.moments, self.given)

    def short(self) -> Spans:
        """Short spans."""
        frames = self.layout.trials
        length = float(np.median([each.times[-1] - each.times[0] for each in frames])) / (4.0 * SHORT)
        step = max(float(np.median(np.diff(each.times))) for each in frames)
        return spans_of(self.scene, self.layout, max(length, 2.0 * step), SHORT, self.given)

    def log(self, out: str | Path | None, resume: bool) -> Log | None:
        """The log of this fit in a folder. Raises FitError."""
        if out is None:
            return None
        options = self.options
        request = {
            "scene": hashlib.sha256(self.scene.content.encode()).hexdigest(), "model": self.rung.name,
            "inertia": self.rung.inertia, "motions": _digest(self.motions), "over": list(self.box.names),
            "low": self.box.low.tolist(), "high": self.box.high.tolist(), "parameters": self.given,
            "span": str(options.span), "moments": options.moments, "step": str(options.step),
            "tol": str(self.tol), "seed": options.seed,
        }  # fmt: skip
        return Log(Path(out), request, resume)


def prepare(
    scene: AnyScene | str | Path | Mapping[str, Any], rung: Rung, motions: Motions,
    over: Sequence[str] | str, box: Mapping[str, tuple[float, float]] | None,
    parameters: Mapping[str, float] | None, options: Options,
) -> Prepared:  # fmt: skip
    """What a fit is about. Raises MotionError, SceneError or InputError for wrong input."""
    loaded = load(scene)
    if not isinstance(motions, Motions):
        raise MotionError(f"motions: must be rw.Motions, not {shown(motions)}")
    within = box_of(loaded, over, box)
    for name in parameters or {}:
        if name in within.names:
            raise InputError(f"parameters.{name}: is given, and `over` asks for it")
    values = loaded.parameters(parameters)
    given = {name: values[name] for name in (parameters or {})}
    wrong = impossible(loaded, within.ends, given)
    if wrong:
        raise InputError(f"box: {wrong}; narrow it, or write one number by another in the scene")
    check_names(motions, loaded.template.coordinates, world_of(loaded).velocities)
    counted = motions.counted_in(loaded)
    check_parameters(counted, within.names, loaded.file.parameters, loaded.template.inputs)
    return Prepared(loaded, rung, counted, within, given, laid_out(loaded, counted), options)


def _digest(motions: Motions) -> str:
    """What tells motions apart."""
    found = hashlib.sha256(repr((motions.coordinates, motions.rates, motions.deviations)).encode())
    for trial in motions.trials:
        found.update(repr((trial.parameters, sorted(trial.inputs))).encode())
        for array in (trial.times, trial.q, trial.v, *(trial.inputs[name] for name in sorted(trial.inputs))):
            found.update(b"" if array is None else array.tobytes())
    return found.hexdigest()
