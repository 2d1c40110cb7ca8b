"""Whether bodies may have gone through each other on the way of a step, seen at neither of its ends.

Convex shapes apart have a separating axis. On the way, with coordinates linear in time, this axis may be
carried along with either body or stay as it is: the distance between the shapes along it is then a minimum of
smooth functions of time, each at least its chord less 1/8 of its greatest second derivative. Where that bound
does not exclude a passage the way is taken in parts, each with an axis of its own: conservative advancement
(Mirtich, Impulse-based dynamic simulation, 1996) with axes instead of distances.
"""

from __future__ import annotations

import math

from rungwise.kernel import Record, kernel
from rungwise.scene.template.records import FREE, HALFPLANE, HINGE, Records
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.moving import LOOKS, SLIP
from rungwise.system.planar.contact_manifold import LIFTED, NORMAL_X, NORMAL_Y, Found, manifold
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.place import X, Y, coordinate_count, place_body


@kernel
def thickness(a: Record, b: Record) -> float:
    """Least relative motion from touching on one side to touching on the other; inf if there is none, as at a
    halfplane or between two points."""
    sum_of_widths = a.width + b.width
    return sum_of_widths if sum_of_widths > 0.0 else math.inf


@kernel
def thinnest(records: Records) -> float:
    """Thickness of the thinnest pair."""
    least = math.inf
    for p in range(records.pairs.shape[0]):
        pair = records.pairs[p]
        least = min(least, thickness(records.shapes[pair.shape_a], records.shapes[pair.shape_b]))
    return least


@kernel
def passes(records: Records, workspace: Workspace) -> bool:
    """Whether on the way from `before` to the present state some pair may have been more than `SLIP` of its
    thickness inside each other."""
    manifolds = workspace.state.manifolds
    for i in range(near_pairs(manifolds, records.pairs.shape[0])):
        pair = records.pairs[pair_at(manifolds, i)]
        if manifolds.lifted.shape[0] > 0 and manifolds.lifted[pair.contact] == LIFTED:
            continue
        a, b = records.shapes[pair.shape_a], records.shapes[pair.shape_b]
        if a.kind != HALFPLANE and b.kind != HALFPLANE and not _is_clear(records, a, b, workspace):
            return True
    return False


@kernel
def _is_clear(records: Records, a: Record, b: Record, workspace: Workspace) -> bool:
    """Whether a pair keeps apart, or nearly so, all the way. Both bodies are where they were, afterwards."""
    allowed = SLIP * thickness(a, b)
    moved = _excursion(records, a, b, workspace)
    x, y = _between(a, b, workspace)
    if moved <= allowed or math.sqrt(x * x + y * y) - moved > a.reach + b.reach:
        return True
    begin, span = 0.0, 1.0
    for _ in range(LOOKS):
        end = min(1.0, begin + span)
        if _least_distance(records, a, b, workspace, begin, end) < -allowed:
            span *= 0.5
        elif end == 1.0:
            return True
        else:
            begin, span = end, 2.0 * span
    _place_pair(records, a, b, workspace, 1.0)
    return False


@kernel
def _excursion(records: Records, a: Record, b: Record, workspace: Workspace) -> float:
    """Bound of the relative motion of any two points of the shapes on the whole way."""
    moved = 0.0
    for shape in (a, b):
        body = records.bodies[shape.body]
        moved += abs(_turn(records, shape, workspace)) * (shape.reach + _arm(records, shape, workspace))
        for j in range(coordinate_count(body)):
            if body.motion != HINGE and j < 2:
                i = body.coordinate + j
                moved += abs(workspace.state.q[i] - workspace.before.q[i])
    return moved


@kernel
def _least_distance(
    records: Records, a: Record, b: Record, workspace: Workspace, begin: float, end: float
) -> float:
    """Lower bound of the distance of the shapes from one part of the way to another, negative where they
    overlap: along the axis that separates them at `begin`, at rest or carried with one of the bodies."""
    state, scratch = workspace.state, workspace.scratch
    _place_pair(records, a, b, workspace, begin)
    found = Found(scratch.probe, state.manifolds.fresh)
    manifold(a, b, state.placed.outline, workspace.seams.alone, found)
    nx, ny = scratch.probe[0, NORMAL_X], scratch.probe[0, NORMAL_Y]
    first = _distance(a, b, nx, ny, workspace)
    x, y = _between(a, b, workspace)
    _place_pair(records, a, b, workspace, end)
    far_x, far_y = _between(a, b, workspace)
    part = end - begin
    turn_a, turn_b = part * _turn(records, a, workspace), part * _turn(records, b, workspace)
    bend = _arm(records, a, workspace) * turn_a**2 + _arm(records, b, workspace) * turn_b**2
    speed = math.hypot(far_x - x, far_y - y) + bend
    apart = math.hypot(x, y) + speed
    best = -math.inf
    for k, turn in enumerate((0.0, turn_a, turn_b)):
        if k > 0 and turn == 0.0:
            continue
        c, s = math.cos(turn), math.sin(turn)
        last = _distance(a, b, c * nx - s * ny, s * nx + c * ny, workspace)
        bent = bend + turn**2 * apart + 2.0 * abs(turn) * speed
        bent += (turn_a - turn) ** 2 * a.reach + (turn_b - turn) ** 2 * b.reach
        best = max(best, min(first, last) - bent / 8.0)
    return best


@kernel
def _place_pair(records: Records, a: Record, b: Record, workspace: Workspace, part: float) -> None:
    """Place both bodies at a part of the way from `before` to the present state."""
    state, q, before = workspace.state, workspace.scratch.row, workspace.before.q
    for shape in (a, b):
        body = records.bodies[shape.body]
        moved = False
        for i in range(body.coordinate, body.coordinate + coordinate_count(body)):
            q[i] = state.q[i] if part == 1.0 else (1.0 - part) * before[i] + part * state.q[i]
            moved |= state.q[i] != before[i]
        if moved:
            place_body(shape.body, records, q, state.placed)


@kernel
def _turn(records: Records, shape: Record, workspace: Workspace) -> float:
    """Angle by which a shape turns on the whole way."""
    body, now, before = records.bodies[shape.body], workspace.state.q, workspace.before.q
    turn = 0.0
    if body.motion == HINGE:
        turn = now[body.coordinate] - before[body.coordinate]
    elif body.motion == FREE:
        turn = now[body.coordinate + 2] - before[body.coordinate + 2]
    return turn


@kernel
def _arm(records: Records, shape: Record, workspace: Workspace) -> float:
    """Radius of the arc on which the body's centre turns; 0 for one that goes straight."""
    body, pose = records.bodies[shape.body], workspace.state.placed.pose
    if body.motion != HINGE:
        return 0.0
    return math.hypot(pose[shape.body, X] - body.pivot_x, pose[shape.body, Y] - body.pivot_y)


@kernel
def _between(a: Record, b: Record, workspace: Workspace) -> tuple[float, float]:
    """From the centre of b's body to that of a's."""
    pose = workspace.state.placed.pose
    return pose[a.body, X] - pose[b.body, X], pose[a.body, Y] - pose[b.body, Y]


@kernel
def _distance(a: Record, b: Record, nx: float, ny: float, workspace: Workspace) -> float:
    """Distance of the placed shapes along an axis from b to a; negative when they overlap along it."""
    outline, nearest, farthest = workspace.state.placed.outline, math.inf, -math.inf
    for i in range(a.first, a.end):
        nearest = min(nearest, nx * outline[i, 0] + ny * outline[i, 1])
    for i in range(b.first, b.end):
        farthest = max(farthest, nx * outline[i, 0] + ny * outline[i, 1])
    distance: float = nearest - farthest - a.radius - b.radius
    return distance
