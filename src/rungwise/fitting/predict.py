"""Runs of many candidate parameters through all spans at once, and their errors.

Every finished batch may be kept on disk. A fit asks for batches that depend only on the request and on the
answers before; a restart asks for the same ones, and takes their answers from the log until it ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline, TimeOver
from rungwise.errors import InputError
from rungwise.fitting.measured.layout import Compared
from rungwise.fitting.measured.spans import Spans
from rungwise.fitting.measured.starts import Parting
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.stored import Batches
from rungwise.world.arguments import asked
from rungwise.world.find import world_of

TOGETHER = 100_000
"""Moments of runs that are made in one call: what is kept of each takes some kilobytes."""
KEPT = 256
"""Points whose errors are kept by each predictor: stages of a fit ask for the same ones again."""
STOPPED = (Code.MISSED, Code.TIMEOUT, Code.JAMMED)
"""Outcomes of runs that came to the end of their span, or rest there."""


class FitError(InputError):
    """A folder of a fit is wrong; one line that names the fault."""


class Log(Batches):
    """The finished batches of one request in a folder. Raises FitError (see `Batches`)."""

    def __init__(self, folder: Path, request: Mapping[str, object], resume: bool) -> None:
        super().__init__(folder, request, resume, "fit", FitError)
        self._number = -1

    def next(self) -> tuple[Reals, NDArray[np.bool_], Reals] | None:
        """Errors, which runs ended, and how far starts were moved, of the next batch, if it is kept."""
        self._number += 1
        kept = self.kept(self._number)
        if kept is None or not {"errors", "ended", "moved"} <= kept.keys():
            return None
        return kept["errors"], kept["ended"], kept["moved"]

    def add(self, errors: Reals, ended: NDArray[np.bool_], moved: Reals) -> None:
        """Keep the batch that `next` did not have."""
        self.keep(self._number, errors=errors, ended=ended, moved=moved)


class Predicted(NamedTuple):
    """Errors (p, s, g, e) of p candidates over s spans, 0 at moments that do not count; and which runs came
    to their ends (p, s): the others stay where they ended."""

    errors: Reals
    ended: NDArray[np.bool_]


class Predictor:
    """Runs of a scene on a rung from the starts of spans. Its conditions are left out: they would end runs.

    ends: the interval of each parameter of a point, in order; parameters: those that are neither among these
    nor known in the spans; tol: error allowed per step; made (1,): runs that were made, on other spans, too.
    """

    def __init__(
        self, scene: Any, model: Rung, spans: Spans, compared: Compared,
        ends: Mapping[str, tuple[float, float]], parameters: Mapping[str, float], *,
        tol: float | None, step: float | None, threads: int | None, deadline: Deadline = NEVER,
        log: Log | None = None,
    ) -> None:  # fmt: skip
        self.scene = scene.changed(goal=None, unsafe=None, doomed=None)
        self.model, self.spans, self.compared, self.over = model, spans, compared, tuple(ends)
        self._given = dict(parameters)
        self.tol, self._step = tol, step
        self._threads, self._deadline, self._log = threads, deadline, log
        self._parting = Parting(self.scene, ends, spans.start[:, : spans.q.shape[1]].max(axis=0))
        self.made, self.moved = np.zeros(1, np.int64), np.zeros(len(spans.trial))
        self._known: dict[bytes, Predicted] = {}

    def on(self, spans: Spans) -> Predictor:
        """The same on other spans."""
        found = object.__new__(type(self))
        own = {"spans": spans, "moved": np.zeros(len(spans.trial)), "_known": {}}
        vars(found).update(vars(self) | own)
        return found

    def at_tol(self, tol: float) -> Predictor:
        """The same with this error allowed per step."""
        found = self.on(self.spans)
        found.tol = tol
        return found

    def over_only(self, names: Sequence[str]) -> Predictor:
        """The same over some of the parameters."""
        found = self.on(self.spans)
        found.over = tuple(names)
        return found

    def __call__(self, points: Reals, shifts: Reals | None = None) -> Predicted:
        """Errors at points (p, k) of the parameters; with starts that are changed by shifts
        (p, s, n_q + n_v). Raises TimeOver."""
        self._deadline.look()
        if shifts is not None:
            return self._many(points, shifts)
        keys = [point.tobytes() for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in self._known}
        answers = self._known.copy()
        if new:
            found = self._many(np.array(list(new.values())), None)
            for key, errors, ended in zip(new, *found, strict=True):
                answers[key] = Predicted(errors, ended)
        for key in reversed(dict.fromkeys(keys[:KEPT])):
            self._known.pop(key, None)
            self._known[key] = Predicted(answers[key].errors.copy(), answers[key].ended.copy())
        for key in list(self._known)[:-KEPT]:
            del self._known[key]
        return Predicted(*(np.array(column) for column in zip(*(answers[key] for key in keys), strict=True)))

    def _many(self, points: Reals, shifts: Reals | None) -> Predicted:
        """The same by runs, as many in one call as memory holds."""
        s, g = self.spans.durations.shape
        each = max(1, TOGETHER // (s * g))
        parts = [
            self._together(points[i : i + each], None if shifts is None else shifts[i : i + each])
            for i in range(0, len(points), each)
        ]
        return Predicted(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def gaps(self, point: Reals, places: Reals) -> Reals:
        """Gaps (s, g, c) at places (s, g, n_q) of spans, at a point (k,) of the parameters."""
        s, g, n = places.shape
        named = self._given | dict(zip(self.over, point.tolist(), strict=True))
        found = np.zeros((s, g, len(self.scene.template.contacts)))
        for row in np.unique(self.spans.values, axis=0):
            same = (self.spans.values == row).all(axis=1)
            known = dict(zip(self.spans.known, row.tolist(), strict=True))
            place = world_of(self.scene).place(named | known)
            found[same] = place.geometry(places[same].reshape(-1, n))[0].reshape(int(same.sum()), g, -1)
        return found

    def _together(self, points: Reals, shifts: Reals | None) -> Predicted:
        """The same of few candidates: from the log, or by runs."""
        kept = None if self._log is None else self._log.next()
        self.made[0] += len(points) * len(self.spans.trial)
        if kept is not None:
            self.moved = kept[2]
            return Predicted(*kept[:2])
        found = self._run(points, shifts)
        if self._log is not None:
            self._log.add(*found, self.moved)
        return found

    def _run(self, points: Reals, shifts: Reals | None) -> Predicted:
        """The same by runs."""
        spans = self.spans
        starts = np.tile(np.concatenate([spans.q, spans.v], axis=1), (len(points), 1, 1))
        if shifts is not None:
            starts += shifts
        starts = self._starts(points, starts)
        q, ended = self.places(points, starts)
        if self._deadline.is_over:
            raise TimeOver("in the runs of a fit")
        errors = self.compared.errors(q, spans.aims)
        errors[:, ~spans.counts] = 0.0
        return Predicted(errors, ended)

    def places(self, points: Reals, starts: Reals) -> tuple[Reals, NDArray[np.bool_]]:
        """Places (p, s, g, n_q) at the moments of runs from starts (p, s, n_q + n_v), and which of them came
        to their ends (p, s). Where another simulator makes them, it is fitted by the same code."""
        spans, (p, s) = self.spans, starts.shape[:2]
        n = spans.q.shape[1]
        given: dict[str, Any] = dict(self._given)
        given |= {name: np.tile(spans.values[:, j], p) for j, name in enumerate(spans.known)}
        given |= {name: np.repeat(points[:, j], s) for j, name in enumerate(self.over)}
        inputs = {name: np.tile(spans.levels[..., j], (p, 1)) for j, name in enumerate(spans.inputs)}
        wanted = asked(
            self.scene, starts.reshape(p * s, -1), inputs or None, np.tile(spans.durations, (p, 1)), None,
            bool(inputs), given,
        )  # fmt: skip
        if world_of(self.scene).follows_time and wanted.begins is not None:
            wanted.begins.bodies[:, -1] = np.tile(spans.first, p)
        options = {"tol": self.tol, "step": self._step, "theta": 1.0, "motion": None}
        found = world_of(self.scene).rollout(
            self.model, wanted, options, keep=True, budget=None, threads=self._threads, chunk=None,
            deadline=self._deadline, on_progress=None,
        )  # fmt: skip
        q = _held(found, starts.reshape(p * s, -1)[:, :n]).reshape(p, s, -1, n)
        return q, np.isin(found.outcome, STOPPED).reshape(p, s)

    def _starts(self, points: Reals, given: Reals) -> Reals:
        """Starts (p, s, n_q + n_v) at points (p, k), with joints that hold, without overlap; those of points
        that have bodies at the same places are moved together."""
        (p, s, _), n = given.shape, self.spans.q.shape[1]
        values = np.concatenate(
            [np.repeat(points, s, axis=0), np.tile(self.spans.values, (p, 1))], axis=1
        )  # fmt: skip
        names = (*self.over, *self.spans.known)
        placing = self._parting.placing(
            self.spans.q, self._given | dict(zip(names, values[0].tolist(), strict=True))
        )
        columns = [j for j, name in enumerate(names) if name in placing or j >= len(self.over)]
        rows, group = np.unique(values[:, columns], axis=0, return_index=True, return_inverse=True)[1:]
        found, moved = given.reshape(p * s, -1), np.zeros(p * s)
        known = np.median(self.spans.start, axis=0)
        for number, row in enumerate(rows.tolist()):
            same = group.reshape(-1) == number
            named = self._given | dict(zip(names, values[row].tolist(), strict=True))
            own = self._parting.closed(found[same], named, known)
            rows = np.flatnonzero(same) % s
            own_rows, at = np.unique(rows, return_inverse=True)
            lasting = self._parting.lasting(self.spans.q[own_rows], self.spans.around[own_rows], named)
            own[:, :n], moved[same] = self._parting(own[:, :n].copy(), named, lasting[at])
            found[same] = own
        self.moved = moved.reshape(p, s)[-1]
        return found.reshape(p, s, -1)


def _held(found: Any, starts: Reals) -> Reals:
    """Places (m, g, n_q) at the moments; where a run had ended before, those of its end, or of its start."""
    q = found.q.copy()
    final = np.where(np.isfinite(found.final), found.final, starts)
    missing = ~np.isfinite(q).all(axis=-1)
    q[missing] = np.broadcast_to(final[:, None], q.shape)[missing]
    return np.asarray(q)
