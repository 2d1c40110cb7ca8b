"""Errors of place and turn, trial by trial, and what happens in the parts of a motion.

A phase is read from what was measured: where nothing touches is flight; where a body hardly moves while it
touches is rest; where it touches throughout is sliding (or rolling); and where it comes to touch, or leaves,
is an impact. Errors of a phase are those of short spans that begin at measured states.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.fitting.measured.layout import Compared, Layout
from rungwise.fitting.measured.spans import Spans
from rungwise.fitting.measured.touching import within
from rungwise.fitting.predict import Predictor
from rungwise.kernel import Ints, Reals
from rungwise.scene.language.terms import ANGLE
from rungwise.world.find import world_of

DRAWS = 2000
CONFIDENCE = 0.95
PHASES = ("flight", "impact", "sliding", "rest")


class Columns(NamedTuple):
    """Columns of errors that are places, and turns, of each body."""

    places: tuple[Ints, ...]
    turns: tuple[Ints, ...]


class Sizes(NamedTuple):
    """Errors of place, of turn (radians), and of both by the way of the farthest point, each (s, g)."""

    place: Reals
    turn: Reals
    whole: Reals


@dataclass(frozen=True)
class Mean:
    """A mean over trials, and its 95 % interval (bootstrap over trials)."""

    value: float
    lower: float
    upper: float

    def __str__(self) -> str:
        return f"{self.value:.3g} ({self.lower:.3g} to {self.upper:.3g})"


@dataclass(frozen=True)
class Phase:
    """Errors of short spans by what happens in them: their number, means of the error of place and of turn
    at their ends, and of both by the way of the farthest point of an object."""

    name: str
    spans: int
    place: float
    turn: float
    whole: float


@dataclass(frozen=True, eq=False)
class Score(ByContent):
    """Errors of a rung on trials that were not fitted: means over trials of the error of place, of turn
    (radians) and of both by the way of the farthest point; phases; cost: processor seconds for each second
    simulated, which does not count in `==`; trials (t,): the last of these errors, trial by trial."""

    place: Mean
    turn: Mean
    whole: Mean
    phases: tuple[Phase, ...]
    cost: float = field(compare=False)
    trials: Reals = field(repr=False)


def columns_of(scene: Any, compared: Compared) -> Columns:
    """Which errors are places and which are turns, body by body."""
    dimensions, names = world_of(scene).place(None).dimensions()[0], scene.template.coordinates
    places: dict[str, list[int]] = {}
    turns: dict[str, list[int]] = {}
    for e, column in enumerate(compared.plain):
        body = names[column].rsplit(".", 1)[0]
        (turns if dimensions[column] == ANGLE else places).setdefault(body, []).append(e)
    for r, four in enumerate(compared.turns):
        first = len(compared.plain) + 3 * r
        turns.setdefault(names[four[0]].rsplit(".", 1)[0], []).extend(range(first, first + 3))
    return Columns(
        tuple(np.array(each) for each in places.values()), tuple(np.array(each) for each in turns.values())
    )


def sizes(scene: Any, compared: Compared, errors: Reals) -> Sizes:
    """Sizes of errors (..., e), means over bodies."""
    columns = columns_of(scene, compared)
    place, turn = (
        np.mean([np.linalg.norm(errors[..., c], axis=-1) for c in each], axis=0)
        if each
        else np.zeros(errors.shape[:-1])
        for each in columns
    )
    return Sizes(place, turn, place + world_of(scene).at().moved.size * turn)


def by_trial(spans: Spans, values: Reals) -> Reals:
    """Means (t,) over the moments of each trial of values (s, g)."""
    trials = np.unique(spans.trial)
    rows = [(spans.trial == each)[:, None] & spans.counts for each in trials]
    return np.array([values[each].mean() if each.any() else np.nan for each in rows])


def mean_of(values: Reals) -> Mean:
    """The mean of values (t,) of trials, with its interval."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Mean(np.nan, np.nan, np.nan)
    rows = np.random.default_rng(0).integers(0, len(known), (DRAWS, len(known)))
    share = 0.5 - CONFIDENCE / 2.0
    low, high = np.quantile(known[rows].mean(axis=1), [share, 1.0 - share])
    return Mean(float(known.mean()), float(low), float(high))


def scored(predictor: Predictor, short: Predictor, layout: Layout, point: Reals, which: Ints) -> Score:
    """The score of a rung at a point (k,), on the spans of `predictor`, and on short spans of phases `which`
    (s,)."""
    scene, compared = predictor.scene, layout.compared
    began = time.process_time()
    errors = predictor(point[None]).errors[0]
    cost = (time.process_time() - began) / max(predictor.spans.seconds, 1e-300)
    found = sizes(scene, compared, errors)
    place, turn, both = (by_trial(predictor.spans, each) for each in found)
    return Score(
        mean_of(place), mean_of(turn), mean_of(both), phases(short, layout, point, which), cost, both
    )


def phases(short: Predictor, layout: Layout, point: Reals, which: Ints) -> tuple[Phase, ...]:
    """Errors at the ends of short spans, by their phase (s,)."""
    spans = short.spans
    errors = short(point[None]).errors[0]
    last = spans.counts.shape[1] - 1 - spans.counts[:, ::-1].argmax(axis=1)
    ends = errors[np.arange(len(errors)), last]
    found = sizes(short.scene, layout.compared, ends)
    return tuple(
        Phase(name, int(rows.sum()), *(float(each[rows].mean()) for each in found))
        for k, name in enumerate(PHASES)
        if (rows := which == k).any()
    )


def phase_of(short: Predictor, layout: Layout, point: Reals) -> Ints:
    """The phase (s,) of each short span, by its measured places, where bodies are as at a point (k,)."""
    spans, scene = short.spans, short.scene
    moved = world_of(scene).at().moved
    places = np.concatenate([spans.q[:, None], spans.aims], axis=1)
    known = np.concatenate([np.ones((len(places), 1), bool), spans.counts], axis=1)
    gaps = short.gaps(point, places).min(axis=2, initial=np.inf)
    near = within(scene, layout)
    closed = (gaps <= near) & known
    weights = np.where(moved.weights > 0.0, moved.weights, 0.0)
    way = np.linalg.norm((places - spans.q[:, None]) * weights, axis=2)
    still = (np.where(known, way, 0.0).max(axis=1)) <= near
    always, ever = (closed | ~known).all(axis=1), closed.any(axis=1)
    return np.where(~ever, 0, np.where(~always, 1, np.where(still, 3, 2)))


def worse(a: Reals, b: Reals) -> tuple[float, float]:
    """By how much errors (t,) of trials are greater than others, in the mean, and the deviation of that."""
    apart = a - b
    kept: NDArray[np.float64] = apart[np.isfinite(apart)]
    return float(kept.mean()), float(kept.std(ddof=min(1, len(kept) - 1)) / np.sqrt(len(kept)))
