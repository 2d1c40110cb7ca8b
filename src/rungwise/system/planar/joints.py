"""Joints between bodies: three measures of the pose of b in the frame of a, each held or free.

A held measure is a row of the equation without force limit, rigid or with stiffness and damping. A free one
is the joint's coordinate: its drive, damping and dry friction are rows, too, and its travel ends at rigid
stops. Angles are multiplied by the joint's lever, so that all rows are lengths and forces.
"""

from __future__ import annotations

import math

from rungwise.contact.step import span
from rungwise.kernel import Ints, Reals, Record, inner_kernel, kernel
from rungwise.scene.template.records import (
    ALONG,
    ANGLE,
    FIXED,
    FORCE,
    FREE,
    HINGE,
    NO_DRIVE,
    SERVO,
    SPEED,
    Records,
)
from rungwise.system.entries import clear_rows
from rungwise.system.planar.jacobian import set_bodies
from rungwise.system.planar.place import COS, SIN, X, Y, coordinate_count, lever
from rungwise.system.planar.terms import stop
from rungwise.system.terms import APART, DRIVE, JOINT, SUPPORT, Terms


@kernel
def measure(kind: Record, records: Records, pose: Reals, q: Reals, row: Reals) -> float:
    """Value of a measure (0 in the poses of the scene); its rate per unit of each speed into `row` (n,)."""
    row[:] = 0.0
    joint = records.joints[kind.joint]
    a, b = records.bodies[joint.body_a], records.bodies[joint.body_b]
    pose_a, pose_b = pose[joint.body_a], pose[joint.body_b]
    if kind.which == ANGLE:
        _turn(a, -joint.lever, row)
        _turn(b, joint.lever, row)
        return joint.lever * (_angle(b, q) - _angle(a, q) - joint.angle)
    along = kind.which == ALONG
    ex, ey = _turned(
        pose_a, joint.axis_x if along else -joint.axis_y, joint.axis_y if along else joint.axis_x
    )
    ax, ay = _turned(pose_a, joint.a_x, joint.a_y)
    bx, by = _turned(pose_b, joint.b_x, joint.b_y)
    x, y = pose_b[X] + bx, pose_b[Y] + by
    _move(a, pose_a, x, y, -ex, -ey, row)
    _move(b, pose_b, x, y, ex, ey, row)
    return ex * (x - pose_a[X] - ax) + ey * (y - pose_a[Y] - ay)


@kernel
def _turned(pose: Reals, x: float, y: float) -> tuple[float, float]:
    return pose[COS] * x - pose[SIN] * y, pose[SIN] * x + pose[COS] * y


@kernel
def _angle(body: Record, q: Reals) -> float:
    """Angle of the body, counted on over full turns."""
    if body.motion == FREE:
        return q[body.coordinate + 2]
    return body.angle + (q[body.coordinate] if body.motion == HINGE else 0.0)


@kernel
def _turn(body: Record, factor: float, row: Reals) -> None:
    if body.motion == HINGE:
        row[body.coordinate] += factor
    elif body.motion == FREE:
        row[body.coordinate + 2] += factor


@kernel
def _move(body: Record, pose: Reals, x: float, y: float, ex: float, ey: float, row: Reals) -> None:
    """Add the speed along e of the point (x, y) that moves with the body."""
    if body.motion != FIXED:
        for i in range(coordinate_count(body)):
            vx, vy = lever(body, pose, i, x, y)
            row[body.coordinate + i] += ex * vx + ey * vy


@kernel
def constants(records: Records, metric: bool, first: int, terms: Terms) -> int:
    """Limits, gains and accounts of the rows from `first` on; returns the number after the last.

    With `metric` (no forces) held and driven measures are rigid, and nothing resists.
    """
    count = first
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        unit = _unit(kind, records)
        if kind.held:
            rigid = metric or math.isinf(kind.stiffness)
            stiff = math.inf if rigid else kind.stiffness / (unit * unit)
            damp = 0.0 if rigid else kind.damping / (unit * unit)
            count = _row(count, math.inf, stiff, damp, JOINT, terms)
            continue
        if kind.drive == SPEED or (metric and kind.drive == SERVO):
            count = _row(count, math.inf, math.inf, 0.0, DRIVE, terms)
        elif kind.drive == SERVO:
            stiff, damp = kind.stiffness / (unit * unit), kind.drive_damping / (unit * unit)
            count = _row(count, kind.limit / unit, stiff, damp, DRIVE, terms)
        if kind.damping > 0.0 and not metric:
            count = _row(count, math.inf, 0.0, kind.damping / (unit * unit), SUPPORT, terms)
        if kind.dry_friction > 0.0 and not metric:
            count = _row(count, kind.dry_friction / unit, 0.0, 0.0, SUPPORT, terms)
    return count


@kernel
def _unit(kind: Record, records: Records) -> float:
    """What a measure is in lengths per unit of its own."""
    return records.joints[kind.joint].lever if kind.which == ANGLE else 1.0


@kernel
def _row(count: int, limit: float, stiff: float, damp: float, account: int, terms: Terms) -> int:
    terms.limit[count] = limit
    terms.gains[count, 0], terms.gains[count, 1] = stiff, damp
    terms.account[count] = account
    terms.surface[count] = APART
    return count + 1


@kernel
def rows(
    records: Records,
    pose: Reals,
    q: Reals,
    begun: Reals,
    start: Reals,
    time: float,
    h: float,
    metric: bool,
    first: int,
    terms: Terms,
    row: Reals,
) -> None:
    """Fill in rows and errors at q for a step of length h with the loads at `time`; adds given forces.

    `begun` (measures,) are the values at the start of the step, from where given speeds count: q differs when
    a step is linearised again; `start` (n + measures,) is where servos without target are led from.
    """
    count = first
    n = q.shape[0]
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        unit = _unit(kind, records)
        value = measure(kind, records, pose, q, row)
        if kind.held:
            count = _fill(count, row, -value, 0.0, terms)
            continue
        if kind.drive == SPEED or kind.drive == SERVO:
            target = begun[m] + h * kind.drive_speed
            if kind.drive == SERVO:
                target = kind.target if kind.has_target else start[n + m] + kind.target_speed * time
            if kind.drive == SPEED or metric:
                target = min(max(target, kind.lower), kind.upper)
            count = _fill(count, row, unit * target - value, unit * kind.target_speed, terms)
        elif kind.drive == FORCE and not metric:
            for i in range(n):
                terms.load[i] += kind.force / unit * row[i]
        if kind.damping > 0.0 and not metric:
            count = _fill(count, row, 0.0, 0.0, terms)
        if kind.dry_friction > 0.0 and not metric:
            count = _fill(count, row, 0.0, 0.0, terms)


@kernel
def _fill(count: int, row: Reals, place: float, speed: float, terms: Terms) -> int:
    for i in range(row.shape[0]):
        terms.limited[count, i] = row[i]
    terms.error[count, 0], terms.error[count, 1] = place, speed
    return count + 1


@kernel
def values(
    records: Records,
    pose: Reals,
    q: Reals,
    row: Reals,
    out: Reals,
) -> None:
    """Every measure at q in its own unit (length or angle) into `out` (measures,)."""
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        out[m] = measure(kind, records, pose, q, row) / _unit(kind, records)


@kernel
def opening(records: Records, pose: Reals, q: Reals, row: Reals) -> float:
    """How far the rigid joints are from closed at q, the most of any held measure over its joint's lever."""
    widest = 0.0
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        if kind.held and math.isinf(kind.stiffness):
            opened = abs(measure(kind, records, pose, q, row)) / records.joints[kind.joint].lever
            widest = max(widest, opened)
    return widest


@kernel
def forces(records: Records, metric: bool, first: int, limited: Reals, out: Reals) -> None:
    """Force (or torque) on b in each measure, of all rows of it, into `out` (measures,)."""
    count = first
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        many = 1
        if not kind.held:
            driven = kind.drive == SPEED or kind.drive == SERVO
            resists = (kind.damping > 0.0) + (kind.dry_friction > 0.0)
            many = driven + (0 if metric else resists)
        out[m] = kind.force if kind.drive == FORCE and not metric else 0.0
        for r in range(count, count + many):
            out[m] += limited[r] * _unit(kind, records)
        count += many


@inner_kernel
def fastest(records: Records) -> float:
    """Greatest speed that a joint is made to have."""
    speed = 0.0
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        if kind.drive == SPEED:
            speed = max(speed, abs(kind.drive_speed) * _unit(kind, records))
    return speed


@inner_kernel
def any_driven(records: Records) -> bool:
    """Whether a joint has a drive of any kind."""
    driven = False
    for m in range(records.measures.shape[0]):
        driven |= records.measures[m].drive != NO_DRIVE
    return driven


@kernel
def stops(
    records: Records,
    pose: Reals,
    q: Reals,
    first: int,
    slot: int,
    terms: Terms,
    slots: Ints,
    row: Reals,
) -> int:
    """Add contacts from number `first` on for the travel limits of joints, in slots from `slot` on; returns
    how many contacts there are now."""
    count = first
    for m in range(records.measures.shape[0]):
        kind = records.measures[m]
        if kind.held or (math.isinf(kind.lower) and math.isinf(kind.upper)):
            continue
        unit = _unit(kind, records)
        value = measure(kind, records, pose, q, row)
        for side in range(2):
            limit = unit * (kind.lower if side == 0 else kind.upper)
            if math.isfinite(limit):
                sign = 1.0 - 2.0 * side
                stop(sign * (value - limit), unit, count, terms)
                joint = records.joints[kind.joint]
                set_bodies(joint.body_a, joint.body_b, records.bodies, count, terms.entries)
                clear_rows(terms.entries, count, 2, terms.rows)
                for part in range(2):
                    low, high, shift = span(terms.entries.rows, count, part, row.shape[0])
                    for i in range(low, high):
                        terms.rows[2 * count, i - shift] = sign * row[i]
                slots[count] = slot + 2 * m + side
                count += 1
    return count
