"""What a planning begins with in place of a search: a plan, or a schedule of segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.motion.propagate import Stage
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import ENDS
from rungwise.planning.search.problem import Work
from rungwise.scene.fields.values import shown
from rungwise.scene.template.task import MOST_MOVES
from rungwise.simulation.inputs import ScheduleError, Segment, read_schedule
from rungwise.world.carriers import TaskError

Initial: TypeAlias = "Plan | Sequence[Segment]"
"""A plan, or segments of a schedule."""


def begun_with(work: Work, plan: Plan, initial: Initial, stages: Sequence[Stage]) -> Plan:
    """The plan with what it begins with, as of the first stage that moves, if it says none itself. Raises
    TaskError for what is neither a plan nor a schedule of the scene."""
    if isinstance(initial, Plan):
        return replace(
            plan, moves=initial.moves, waypoints=initial.waypoints, stage=initial.stage,
            segments=initial.segments, labels=initial.labels,
        )  # fmt: skip
    if isinstance(initial, str | bytes) or not isinstance(initial, Sequence) or not len(initial):
        raise TaskError(f"initial: must be a plan or a list of segments, not {shown(initial)}")
    try:
        segments = read_schedule(work.task.scene, initial)
    except ScheduleError as error:
        raise TaskError(f"initial{str(error).removeprefix('inputs')}") from None
    stage = next((each for each in stages if each.model.moves), None)
    return replace(
        plan, segments=segments, labels=(ENDS[1],) * len(segments), moves=_moves(work, segments), stage=stage
    )


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
