"""Images of cells of states: runs of one macro-step from the vertices of a grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import Deadline, TimeOver
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.contract import AnyScene
from rungwise.sets.doomed.backward import CLOSE, Flags, around, backward
from rungwise.sets.doomed.macro_steps import SPEED_OF, Macro, Stated
from rungwise.sets.doomed.states import columns_of
from rungwise.sets.store import SetError

PILOT = 1e-4
"""Length of the runs that tell how fast things move, over the scene's duration."""
MOST_INPUTS = 9
"""Values of each input, evenly apart, at most."""
LOST = (Code.NOT_CONVERGED, Code.UNSUPPORTED, Code.MODEL_INVALID)
"""Outcomes that decide nothing: a state with one of these outcomes counts as reaching the goal."""
Report = Callable[[str, int, int], None]


class Images:
    """A grid over states, and the results of runs from its vertices.

    `states` (n1, ..., nd): cells about which some vertex is a state; `escapes`: cells from which the box may
    be left; `steps`: lengths of the macro-steps so far; `runs`: their number. Raises TimeOver where the
    deadline has come.
    """

    def __init__(
        self,
        scene: AnyScene,
        model: Rung,
        names: Sequence[str],
        bounds: Mapping[str, tuple[float, float]],
        box: Reals,
        travel: Reals,
        shape: tuple[int, ...],
        request: Mapping[str, Any],
        threads: int | None,
        report: Report | None,
        deadline: Deadline,
    ) -> None:
        self._side, self._names, self._bounds = Stated(scene.changed(doomed=None)), tuple(names), bounds
        self._macro = Macro(model, tuple(bounds), request["parameters"], request["accuracy"], threads)
        self._box, self._travel, self._shape = box, travel, shape
        self._request, self._report, self._deadline = request, report, deadline
        self._unit = (box[:, 1] - box[:, 0]) / shape
        self._columns = columns_of(self._side, names)
        sides = [
            np.linspace(low, high, count + 1) for (low, high), count in zip(box.tolist(), shape, strict=True)
        ]
        self._vertices = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, len(shape))
        self._valid = np.ones(len(self._vertices), bool)
        self.runs, self.steps = 0, list[float]()
        self.escapes = np.zeros(shape, bool)
        self._pace, self._spread = self._pilot()
        self.states = self._about(np.ones((int(self._valid.sum()), 1)), greatest=True)[..., 0] == 1.0

    def doomed(self, stride: float, wanders: bool) -> Flags:
        """Cells from which no chain of macro-steps leads to the goal, in each of which the fastest coordinate
        moves by `stride` cells; `wanders`: bodies that nothing drives may move by themselves. Raises
        TimeOver."""
        step = stride / self._pace
        levels = [
            np.linspace(low, high, int(np.clip(np.ceil(step * spread - CLOSE) + 1, 2, MOST_INPUTS)))
            for (low, high), spread in zip(self._bounds.values(), self._spread, strict=True)
        ]
        samples = np.array(list(product(*levels)))
        needed = self.runs + len(samples) * int(self._valid.sum())
        reaches, escapes = np.zeros(self._shape, bool), np.zeros(self._shape, bool)
        images = self._wanderings() if wanders else []
        for sample in samples:
            outcome, moved = self._run(sample, step, needed)
            lost = np.isin(outcome, (Code.UNSAFE, *LOST))
            reaches |= self._any_about(np.isin(outcome, (Code.GOAL, *LOST)))
            first, last, leaves = self._image(np.where(lost[:, None], np.nan, moved))
            reaches |= leaves
            escapes |= leaves & self.states
            images.append((first, last))
        firsts, lasts = (np.stack(ends, axis=1) for ends in zip(*images, strict=True))
        doomed = np.asarray(self.states & ~backward(reaches, self.states, firsts, lasts, self._deadline))
        self.steps.append(step)
        self.escapes |= escapes
        return doomed

    def _run(self, sample: Reals, step: float, needed: int) -> tuple[Ints, Reals]:
        """Outcomes and displacements of runs from all vertices that are states."""
        vertices = self._vertices[self._valid]
        points = np.tile(sample, (len(vertices), 1))
        before = self.runs
        report = self._report
        outcome, ends = self._side.run(
            self._macro, points, self._columns, vertices, step, self._deadline,
            None if report is None else lambda done: report("macro-steps", before + done, needed),
        )  # fmt: skip
        if (outcome == Code.RUNNING).any():
            raise TimeOver("in a macro-step")
        self.runs += len(vertices)
        return outcome, ends - vertices

    def _pilot(self) -> tuple[float, list[float]]:
        """Cells per time that the fastest coordinate moves, and the difference in cells that each input
        makes; also finds which vertices are states."""
        places = np.array([not name.startswith(SPEED_OF) for name in self._names])
        step = PILOT * self._side.world.at(self._request["parameters"]).duration
        middle = np.array([0.5 * (low + high) for low, high in self._bounds.values()])
        pace, spread = 0.0, []
        needed = 2 * len(self._bounds) * len(self._vertices)
        for axis, ends in enumerate(self._bounds.values()):
            rates: list[Reals] = []
            for end in ends:
                sample = middle.copy()
                sample[axis] = end
                outcome, moved = self._run(sample, step, needed)
                state = outcome != Code.INVALID
                rates = [rate[state] for rate in rates]
                rates.append(moved[np.ix_(state, places)] / self._unit[places] / step)
                self._valid[self._valid] = state
            pace = max(pace, *(float(np.abs(rate).max(initial=0.0)) for rate in rates))
            spread.append(float(np.abs(rates[1] - rates[0]).max(initial=0.0)))
        if not pace > 0.0:
            raise SetError("inputs: nothing moves under any of them, or no point of the box is a state")
        return pace, spread

    def _any_about(self, flags: NDArray[np.bool_]) -> Flags:
        return np.asarray(self._about(np.where(flags, 1.0, np.nan)[:, None], greatest=True)[..., 0] == 1.0)

    def _about(self, values: Reals, greatest: bool) -> Reals:
        """Least or greatest (n1, ..., nd, k) of values (m, k) at states' vertices about each cell."""
        all_ = np.full((len(self._vertices), values.shape[1]), np.nan)
        all_[self._valid] = values
        grid = all_.reshape(*(count + 1 for count in self._shape), values.shape[1])
        return around(grid, int(self._request["padding"]), greatest)

    def _image(self, moved: Reals) -> tuple[Ints, Ints, Flags]:
        """First and last cell (cells, d) of each cell's image, and from which the box may be left."""
        corner = self._box[:, 0] + np.moveaxis(np.indices(self._shape), 0, -1) * self._unit
        low = np.clip(corner + self._about(moved, greatest=False), *self._travel.T)
        high = np.clip(corner + self._unit + self._about(moved, greatest=True), *self._travel.T)
        nowhere = np.isnan(low).any(axis=-1)
        low, high = ((np.nan_to_num(end) - self._box[:, 0]) / self._unit for end in (low, high))
        top = np.array(self._shape) - 1
        first = np.where(np.abs(low - self._shape) <= CLOSE, top, np.floor(low + CLOSE)).astype(np.int64)
        last = np.maximum(np.ceil(high - CLOSE).astype(np.int64) - 1, first)
        leaves = ((first < 0) | (last > top)).any(axis=-1) & ~nowhere
        first, last = np.clip(first, 0, top), np.clip(last, 0, top)
        last[nowhere] = -1
        return first.reshape(-1, len(top)), last.reshape(-1, len(top)), np.asarray(leaves)

    def _wanderings(self) -> list[tuple[Ints, Ints]]:
        """Boxes of neighbouring cells along each coordinate that nothing drives."""
        here = np.moveaxis(np.indices(self._shape), 0, -1).reshape(-1, len(self._shape))
        top = np.array(self._shape) - 1
        aside = np.eye(len(self._shape), dtype=np.int64)
        return [
            (np.clip(here - aside[axis], 0, top), np.clip(here + aside[axis], 0, top))
            for axis in self._side.undriven(self._names)
        ]
