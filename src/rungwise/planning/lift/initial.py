"""What a planning begins with: a plan or a schedule in place of a search, or a path to follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.planner import suits
from rungwise.planning.motion.budget import Stage
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import ENDS
from rungwise.planning.search.problem import Work
from rungwise.scene.fields.values import shown
from rungwise.scene.template.task import MOST_MOVES
from rungwise.simulation.inputs import ScheduleError, Segment, read_schedule
from rungwise.world.carriers import TaskError

Initial: TypeAlias = "Plan | Sequence[Segment] | Reals"
"""A plan, segments of a schedule, or poses (n, 3) of the object on its way."""


def begun_with(work: Work, plan: Plan, initial: Initial, stages: Sequence[Stage]) -> Plan:
    """The plan with what it begins with, as of the first stage that moves, if it says none itself; a path of
    poses is kept for searches. Raises TaskError for what is no plan, no schedule of the scene, and no path
    that can be followed."""
    if isinstance(initial, Plan):
        return replace(
            plan, moves=initial.moves, waypoints=initial.waypoints, stage=initial.stage,
            segments=initial.segments, labels=initial.labels,
        )  # fmt: skip
    if isinstance(initial, np.ndarray):
        work.path = _path(work, initial)
        return plan
    if isinstance(initial, str | bytes) or not isinstance(initial, Sequence):
        raise TaskError(
            f"initial: must be a plan, a list of segments, or an array of poses, not {shown(initial)}"
        )
    if not len(initial):
        raise TaskError("initial: has no segments")
    try:
        segments = read_schedule(work.task.scene, initial)
    except ScheduleError as error:
        raise TaskError(f"initial{str(error).removeprefix('inputs')}") from None
    stage = next((each for each in stages if each.model.moves), None)
    return replace(
        plan, segments=segments, labels=(ENDS[1],) * len(segments), moves=_moves(work, segments), stage=stage
    )


def _path(work: Work, poses: Reals) -> Reals:
    """Places (p, n) with the object at these poses. Raises TaskError where it cannot be followed."""
    if poses.ndim != 2 or poses.shape[1] != 3 or not len(poses) or poses.dtype.kind not in "iuf":
        raise TaskError(
            f"initial: a path has poses (n, 3), x, y and angle, not an array of shape {poses.shape}"
        )
    if not np.isfinite(poses).all():
        raise TaskError("initial: poses of a path must be finite")
    if not suits(work):
        raise TaskError(
            "initial: contact modes follow a path; they need a planar scene, robots led through free space,"
            " and a goal of places"
        )
    objects = [name for group in work.groups[0] for name in group.bodies]
    names = list(work.task.scene.template.coordinates)
    columns = [f"{name}.{axis}" for name in objects for axis in ("x", "y", "angle")]
    if len(objects) != 1 or not set(columns) <= set(names):
        raise TaskError(
            f"initial: a path leads one free object; the goal names {', '.join(objects) or 'none'}"
        )
    rows = np.repeat(work.start.q, len(poses), axis=0)
    rows[:, [names.index(column) for column in columns]] = poses
    return rows


def _moves(work: Work, segments: Sequence[Segment]) -> Reals:
    """Moves (k, d) that make these segments; none where robots are led through free space, whose ways say
    more than moves do."""
    if work.task.carriers or len(segments) > MOST_MOVES:
        return np.zeros((0, work.moves.size))
    names = work.task.scene.template.inputs
    level, rows = dict(zip(names, work.task.before.tolist(), strict=True)), list[list[float]]()
    for segment in segments:
        level |= dict(segment.inputs)
        rows.append(list(level.values()))
    return work.moves.held_for(np.array(rows), np.array([segment.duration for segment in segments]))
