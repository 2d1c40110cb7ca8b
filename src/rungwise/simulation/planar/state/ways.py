"""How far bodies go in a nominal step, which conditions of rest read."""

from __future__ import annotations

import math

from rungwise.kernel import kernel
from rungwise.scene.template.records import FREE, HINGE, Records
from rungwise.simulation.planar.state.workspace import State
from rungwise.system.planar.place import coordinate_count


@kernel
def set_ways(records: Records, state: State) -> None:
    """How far the farthest point of each body goes in a nominal step at the velocities of the state."""
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        count = coordinate_count(body)
        speed, spin = 0.0, 0.0
        if count > 0:
            speed = abs(state.v[body.coordinate])
        if body.motion == HINGE:
            speed, spin = 0.0, speed
        elif body.motion == FREE:
            speed = math.hypot(speed, state.v[body.coordinate + 1])
            spin = abs(state.v[body.coordinate + 2])
        if spin > 0.0:
            reach = 0.0
            for s in range(body.first_shape, body.end_shape):
                reach = max(reach, records.shapes[s].reach)
            if body.motion == HINGE:
                reach += math.hypot(body.x - body.pivot_x, body.y - body.pivot_y)
            speed += spin * reach
        state.ways[b] = records.world[0].step * speed
