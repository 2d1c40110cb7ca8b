"""Planar runs that are told their inputs step by step: schedules that grow, and contacts as they are seen."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.step import NAMES, OPEN, STICK
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.template.records import Records
from rungwise.simulation.inputs import Segment, compile_segments
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.planar.state.inputs import Inputs
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.planar.manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y

FOR_GOOD = Segment(duration=math.inf)
"""What follows the last segment that was told: inputs stay as they are."""
ROOM = 64
"""Segments that a schedule has room for at first."""


class Growing:
    """A schedule to which segments are added one by one, in room that doubles; behind them inputs stay as
    they are."""

    def __init__(self, scene: Scene) -> None:
        self._names, self.count = scene.template.inputs, 0
        self._made = compile_segments(scene, [FOR_GOOD])
        u = len(self._names)
        self._durations, self._levels = np.full(ROOM, math.inf), np.full((ROOM, u), math.nan)
        self._ramps, self._table = np.zeros(ROOM, np.int64), np.zeros((ROOM, 2), np.int64)

    def add(self, segment: Segment) -> None:
        if self.count + 1 == len(self._durations):
            self._grow()
        k = self.count
        self._durations[k], self._ramps[k] = segment.duration, segment.ramp
        self._levels[k] = [segment.inputs.get(name, math.nan) for name in self._names]
        self.count += 1

    def shorten(self, duration: float) -> None:
        """The last segment has lasted only so long."""
        self._durations[self.count - 1] = duration

    def since(self, first: int) -> Inputs:
        """Segments from `first` on, as kernels take them."""
        part, made = slice(first, self.count + 1), self._made
        return Inputs(
            speeds=made.speeds, numbers=made.numbers, timed=made.timed, rests=made.rests,
            columns=made.columns, durations=self._durations[part], levels=self._levels[part],
            ramps=self._ramps[part], code=made.code, constants=made.constants, table=self._table[part],
        )  # fmt: skip

    def _grow(self) -> None:
        more = len(self._durations)
        self._durations = np.concatenate([self._durations, np.full(more, math.inf)])
        self._levels = np.concatenate([self._levels, np.full((more, len(self._names)), math.nan)])
        self._ramps = np.concatenate([self._ramps, np.zeros(more, np.int64)])
        self._table = np.concatenate([self._table, np.zeros((more, 2), np.int64)])


def contacts_of(
    scene: Scene, model: Rung, records: Records, tolerance: float, workspace: Workspace
) -> Contacts:
    """Contacts of a planar run that are closed, within the scene's tolerance, or push."""
    state, template = workspace.state, scene.template
    points, count = state.manifolds.points, len(state.manifolds.features)
    force = state.force[:count]
    closed = (points[:, GAP] <= tolerance) | (force[:, 0] > 0.0)
    slots = np.flatnonzero((state.manifolds.features != ABSENT) & closed)
    # The normal of a slot points into the first body, and its force acts on that.
    normals = -points[slots][:, [NORMAL_X, NORMAL_Y]]
    along, across = force[slots].T if model.loads else np.full((2, len(slots)), np.nan)
    tangents = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    pairs = records.pairs["contact"][slots // 2]
    modes = state.modes[slots]
    return Contacts(
        bodies=tuple(template.contacts[int(pair)] for pair in pairs),
        points=points[slots][:, [POINT_X, POINT_Y]],
        normals=normals,
        forces=along[:, None] * normals + across[:, None] * tangents,
        pushes=np.array(along),
        gaps=points[slots, GAP],
        modes=tuple(NAMES[mode] if mode in (OPEN, STICK) else "slip" for mode in modes),
    )
