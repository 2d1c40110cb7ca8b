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
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.watched.inputs import Inputs
from rungwise.system.planar.contact_manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y

FOR_GOOD = Segment(duration=math.inf)
"""What follows the last segment that was told: inputs stay as they are."""
ROOM = 64
"""Segments that a schedule has room for at first."""


class Growing:
    """A schedule to which segments are added one by one, in room that doubles; behind them inputs stay as
    they are.

    whole: the schedule as kernels take it, with all its room; last: its last segment alone, and what follows.
    Both are written where a segment is added or shortened; `whole` is another where it had no room left.
    """

    def __init__(self, scene: Scene) -> None:
        self._names, self.count = scene.template.inputs, 0
        self._made = compile_segments(scene, [FOR_GOOD])
        self.whole, self.last = self._with_room(ROOM), self._with_room(2)

    def add(self, segment: Segment) -> None:
        if self.count + 1 == len(self.whole.durations):
            self._grow()
        levels = [segment.inputs.get(name, math.nan) for name in self._names]
        for inputs, k in ((self.whole, self.count), (self.last, 0)):
            inputs.durations[k], inputs.ramps[k], inputs.levels[k] = segment.duration, segment.ramp, levels
        self.count += 1

    def shorten(self, duration: float) -> None:
        """The last segment has lasted only so long."""
        self.whole.durations[self.count - 1] = self.last.durations[0] = duration

    def _with_room(self, room: int) -> Inputs:
        """An empty schedule with room for so many segments."""
        made = self._made
        return Inputs(
            speeds=made.speeds, numbers=made.numbers, timed=made.timed, rests=made.rests,
            columns=made.columns, durations=np.full(room, math.inf),
            levels=np.full((room, len(self._names)), math.nan), ramps=np.zeros(room, np.int64),
            code=made.code, constants=made.constants, table=np.zeros((room, 2), np.int64),
        )  # fmt: skip

    def _grow(self) -> None:
        before, self.whole = self.whole, self._with_room(2 * len(self.whole.durations))
        for name in ("durations", "levels", "ramps"):
            getattr(self.whole, name)[: self.count] = getattr(before, name)[: self.count]


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
