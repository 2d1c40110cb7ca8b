"""Speeds of prescribed coordinates, up to the limits of their travel."""

from __future__ import annotations

import math

from rungwise.kernel import Reals, RecordArray, kernel
from rungwise.scene.template.records import SERVO, Records
from rungwise.simulation.planar.state.nearby import swing
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.watched.inputs import Inputs, set_numbers
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar


@kernel
def set_speeds(
    records: Records, inputs: Inputs, buffer: Reals, rung: RecordArray, workspace: Workspace, h: float
) -> tuple[float, float]:
    """Set numbers that vary in time, and speeds of prescribed coordinates, for a step of at most h; returns
    the step that ends at the first travel limit, and the greatest prescribed speed of anything, joints
    included.

    Where one of the numbers is not finite, its place in `buffer` goes to `watched.undefined`, and nothing
    else is done.
    """
    state = workspace.state
    clock = state.clock[0]
    n = state.q.shape[0]
    set_numbers(inputs, buffer, h, rung[0].theta, workspace.watched)
    if workspace.watched.undefined[0] >= 0:
        return h, 0.0
    moving = joints.fastest(records)
    shortest = h
    for i in range(n):
        state.speed[i] = 0.0
        if not state.prescribed[i]:
            continue
        c = records.coordinates[i]
        speed = c.drive_speed
        if c.drive == SERVO:
            speed = (planar.target(c, state.start[i], clock.time + h) - state.q[i]) / h
        stop = c.upper if speed > 0.0 else c.lower
        room = abs(stop - state.q[i])
        if math.isfinite(stop) and room <= 1e-12 * (abs(stop) + abs(speed) * h):
            continue
        state.speed[i] = speed
        moving = max(moving, abs(speed) * swing(records, state, i))
        if abs(speed) * shortest > room:
            shortest = room / abs(speed)
    return shortest, moving
