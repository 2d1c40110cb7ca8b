"""Why plans fail or drift on a stage, for the plan that is returned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.planning.diagnosis.deferred import Deferred
from rungwise.planning.diagnosis.diagnose import APART, Diagnosis, Watch
from rungwise.planning.lift.geometric_stage import untouched
from rungwise.planning.motion.budget import Stage
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import Course
from rungwise.planning.search.problem import Work

AT_LEAST = 1.0
"""Seconds in which a diagnosis that is asked for later is made, where the limit leaves less."""


def explained(work: Work, found: Plan, failed: Sequence[Stage]) -> Plan:
    """The first plan, with what becomes of it on the stages before on which nothing was found."""
    told = [each for stage in failed for each in diagnoses(work, found, stage, defers=True)]
    return replace(found, told=(*found.told, *told))


def drifts(work: Work, before: Plan, course: Course) -> bool:
    """Whether objects come to other places at the ends of moves than on the stage before."""
    if len(course.places) != len(before.waypoints):
        return True
    pairs = zip(course.places, before.waypoints, strict=True)
    return any(float(work.away(np.array(place))(now)[0]) > APART * work.size for now, place in pairs)


def diagnoses(work: Work, before: Plan, stage: Stage, defers: bool) -> list[Diagnosis | Deferred]:
    """Why a plan fails or drifts on a stage; with `defers` made when it is asked for, but for a plan of
    places."""
    assert before.stage is not None
    try:
        if not before.stage.model.moves:
            told = untouched(work, before, stage)
            return [] if told is None else [told]
        asked = Deferred(
            work.task.scene, work.task.parameters, before.segments, (before.stage.model, stage.model),
            (str(before.stage), str(stage)), (before.tol, stage.tol * work.size),
        )  # fmt: skip
        return [asked if defers else asked.made(Watch(work.budget.look, work.budget.deadline))]
    except TimeOver:
        return []  # the plan counts without its diagnosis


def in_what_is_left(work: Work, found: Plan) -> Plan:
    """The plan whose diagnoses take no more than the seconds that are left, or `AT_LEAST`."""
    left = work.budget.seconds
    limit = None if left is None else max(left, AT_LEAST)
    told = (replace(each, limit=limit) if isinstance(each, Deferred) else each for each in found.told)
    return replace(found, told=tuple(told))
