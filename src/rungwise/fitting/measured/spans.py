"""Spans: parts of trials, each from a measured state through some of the frames that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.fitting.measured.errors import MotionError
from rungwise.fitting.measured.layout import Frames, Layout, rates_at
from rungwise.fitting.measured.touching import touches, touching
from rungwise.kernel import Ints, Reals
from rungwise.scene.fields.values import shown

MOMENTS = 10
"""Frames of a span that are compared at most: neighbours hardly tell more than one of them."""
PARTS = 4
"""Spans of a trial, by default, at least: after several impacts two runs that began alike have nothing in
common."""
PARTS_OF_TOUCH = 2
"""Spans of a trial, by default, for each time that bodies come to touch in it."""


BESIDE = 3
"""Frames on each side of a start by which it is seen whether contacts last there."""


class Spans(NamedTuple):
    """s spans with g moments at most: the trial of each (s,); where it begins, q (s, n_q) and v (s, n_v);
    durations (s, g) from moment to moment, 0 for such as a span lacks; measured places (s, g, n_q), which of
    the moments count (s, g), times since the start (s, g); names of known parameters and inputs, values
    (s, p), and (s, g, u); `first` (s,): the time in the trial at which it begins; `start` (s, n_q + n_v):
    deviations of q and v; around (s, w, n_q): measured places of the frames about the start, nan where there
    are none."""

    trial: Ints
    q: Reals
    v: Reals
    durations: Reals
    aims: Reals
    counts: NDArray[np.bool_]
    since: Reals
    known: tuple[str, ...]
    values: Reals
    inputs: tuple[str, ...]
    levels: Reals
    first: Reals
    start: Reals
    around: Reals

    def take(self, rows: Ints) -> Spans:
        """Some of the spans."""
        whole = {
            name: getattr(self, name)[rows]
            for name in (
                "trial",
                "q",
                "v",
                "durations",
                "aims",
                "counts",
                "since",
                "values",
                "levels",
                "first",
                "start",
                "around",
            )
        }
        return self._replace(**whole)

    @property
    def seconds(self) -> float:
        """How much time they simulate."""
        return float(self.durations.sum())


class _Span(NamedTuple):
    trial: int
    start: int
    moments: Ints


def spans_of(
    scene: Any, layout: Layout, span: float | None, moments: int, given: Mapping[str, float]
) -> Spans:  # fmt: skip
    """Spans of a length in the scene's time, one after another; a part of the median trial in which bodies
    come to touch once at most, if not given, and whole trials where it is infinite. They begin where nothing
    touches, if there is such a frame near: of a state within an impact it is not known how far contacts
    yield. Raises MotionError where no trial has a frame to begin at."""
    closed = touching(scene, layout, given)
    length = _length(layout, span, closed)
    found = list[_Span]()
    for number, frames in enumerate(layout.trials):
        most = len(frames.times) if frames.trial.inputs else moments
        found += _of_trial(number, frames, ~closed[number], length, most)
    if not found:
        raise MotionError("places: no trial has a frame at which all is known, and others after it")
    g = max(len(each.moments) for each in found)
    return _stacked(scene, layout, found, g)


def _length(layout: Layout, span: float | None, closed: Sequence[NDArray[np.bool_]]) -> float:
    if span is None:
        parts = max(PARTS, round(PARTS_OF_TOUCH * touches(closed)))
        return float(np.median([frames.times[-1] - frames.times[0] for frames in layout.trials])) / parts
    if isinstance(span, bool) or not isinstance(span, int | float | np.number) or not span > 0.0:
        raise InputError(f"span: must be a time greater than 0, or infinite, not {shown(span)}")
    return float(span)


def _of_trial(
    number: int, frames: Frames, clear: NDArray[np.bool_], length: float, most: int
) -> list[_Span]:  # fmt: skip
    """The spans of one trial: each begins about where the one before ends, at a frame at which all is
    known."""
    found, at, last = list[_Span](), 0, len(frames.times) - 1
    usable, before = np.flatnonzero(frames.known), -1
    while at < last:
        start = _start(frames.times, usable, clear, before, at, length)
        if start < 0:
            break
        end = int(np.searchsorted(frames.times, frames.times[start] + length * (1.0 + 1e-9), "right")) - 1
        end = _end(frames.times, usable, clear, start, min(max(end, start + 1), last), length)
        if end <= start:
            break
        steps = min(most, end - start)
        rows = np.unique(np.round(np.linspace(start, end, steps + 1)[1:]).astype(int))
        if frames.times[end] - frames.times[start] >= 0.5 * min(length, frames.trial.duration) or not found:
            found.append(_Span(number, start, rows))
        at, before = max(end, at + 1), start
    return found


def _end(
    times: Reals, usable: Ints, clear: NDArray[np.bool_], start: int, end: int, length: float
) -> int:  # fmt: skip
    """The frame at which a span ends, or where the next one could not begin clear of contacts, one less than
    half a length later at which it can: it contains an impact as a whole."""
    free = usable[(usable > start) & clear[usable]]
    free = free[np.abs(times[free] - times[end]) < 0.5 * length]
    return end if (free <= end).any() or not len(free) else int(free[0])


def _start(
    times: Reals, usable: Ints, clear: NDArray[np.bool_], before: int, at: int, length: float
) -> int:  # fmt: skip
    """The last usable frame at which nothing touches, up to a frame and less than half a length before it,
    and after the start before; else the first usable one from there on; -1 where there is none. A later one
    would leave an impact out."""
    near = usable[(usable > before) & (usable <= at) & clear[usable]]
    near = near[times[at] - times[near] < 0.5 * length]
    if len(near):
        return int(near[-1])
    later = usable[usable >= at]
    return int(later[0]) if len(later) else -1


def _stacked(scene: Any, layout: Layout, found: list[_Span], g: int) -> Spans:
    """Spans as arrays, those with fewer moments filled up."""
    s, n = len(found), len(scene.template.coordinates)
    trials = layout.trials
    known = tuple(dict.fromkeys(name for each in trials for name in each.trial.parameters))
    inputs = tuple(name for name in scene.template.inputs if any(name in x.trial.inputs for x in trials))
    defaults = scene.parameters()
    durations, since, first = np.zeros((s, g)), np.zeros((s, g)), np.zeros(s)
    aims, counts = np.zeros((s, g, n)), np.zeros((s, g), bool)
    levels = np.zeros((s, g, len(inputs)))
    q, values = np.zeros((s, n)), np.zeros((s, len(known) + len(inputs)))
    v = np.zeros((s, trials[0].v.shape[1]))
    start = np.tile(layout.start, (s, 1))
    for number in dict.fromkeys(each.trial for each in found):
        rows = [i for i, each in enumerate(found) if each.trial == number]
        v[rows], start[rows, n:] = rates_at(
            layout, scene, trials[number], np.array([found[i].start for i in rows])
        )
    for i, (number, begin, moments) in enumerate(found):
        frames, k = trials[number], len(moments)
        ends = frames.times[np.append(begin, moments)]
        durations[i, :k], since[i, :k], first[i] = np.diff(ends), ends[1:] - ends[0], ends[0]
        aims[i, :k], counts[i, :k], q[i] = frames.q[moments], True, frames.q[begin]
        trial = frames.trial
        values[i] = [trial.parameters.get(name, defaults[name]) for name in known] + [
            trial.inputs[name][begin] if name in trial.inputs else defaults[name] for name in inputs
        ]
        for j, name in enumerate(inputs):
            levels[i, :, j] = values[i, len(known) + j]
            if name in trial.inputs:
                levels[i, :k, j], levels[i, k:, j] = (
                    trial.inputs[name][moments],
                    trial.inputs[name][moments[-1]],
                )
    counts &= np.isfinite(aims[..., layout.compared.plain]).all(axis=-1)
    for four in layout.compared.turns:
        counts &= np.isfinite(aims[..., four]).all(axis=-1)
    finite = np.isfinite(v).all(axis=1)
    aims = np.where(counts[..., None], aims, q[:, None])
    whole = Spans(
        np.array([each.trial for each in found]), q, v, durations, aims, counts, since,
        known + inputs, values, inputs, levels, first, start,
        np.array([_around(trials[each.trial].q, each.start) for each in found]),
    )  # fmt: skip
    return whole.take(np.flatnonzero(finite & counts.any(axis=1)))


def _around(q: Reals, start: int) -> Reals:
    """Measured places (w, n_q) of the frames about one, nan beyond those that there are."""
    rows = np.arange(start - BESIDE, start + BESIDE + 1)
    inside = (rows >= 0) & (rows < len(q))
    return np.where(inside[:, None], q[np.clip(rows, 0, len(q) - 1)], np.nan)
