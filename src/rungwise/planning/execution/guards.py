"""Guarded moves: a segment in which a robot comes to touch an object ends at the touch, not at a time."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate

from rungwise.planning.plan import Plan
from rungwise.simulation.inputs import Segment
from rungwise.world.find import world_of
from rungwise.world.rollout import rollout


def guarded(plan: Plan) -> Plan | None:
    """The plan with guarded moves; None where no robot comes to touch an object while inputs are held.

    A segment in which a first touch falls is parted there: it goes on until the touch, and then for as long
    as planned after it. Its time-out is later than the planned touch by as long as the whole segment takes.
    """
    begins = [0.0, *accumulate(segment.duration for segment in plan.segments)]
    segments, labels = list[Segment](), list[str]()
    for k, (segment, label) in enumerate(zip(plan.segments, plan.labels, strict=True)):
        touches = [] if segment.ramp or segment.until else _touches(plan, k, begins[k])
        if touches:
            took, condition = min(touches)
            segments.append(replace(segment, duration=took + segment.duration, until=condition))
            labels.append(label)
            segment = replace(segment, duration=segment.duration - took)
        segments.append(segment)
        labels.append(label)
    if len(segments) == len(plan.segments):
        return None
    return replace(plan, segments=tuple(segments), labels=tuple(labels))


def _touches(plan: Plan, k: int, begins: float) -> list[tuple[float, str]]:
    """Robots that come to touch an object in segment k: after which time, and the condition of the touch."""
    assert plan.stage is not None
    levels, durations = plan.levels()
    ramps, before = [segment.ramp for segment in plan.segments[: k + 1]], plan.segments[:k]
    found = []
    for a, b in _pairs(plan):
        condition = f"gap({a}, {b}) <= tolerance"
        run = rollout(
            plan.scene, plan.stage.model, inputs=levels[None, : k + 1], durations=durations[: k + 1],
            until=[*(segment.until for segment in before), condition], ramp=ramps,
            parameters=dict(plan.parameters), tol=plan.tol, keep=False, threads=1,
        )  # fmt: skip
        took = float(run.time[0]) - begins
        if run.switches[0] == k + 1 and 0.0 < took < plan.segments[k].duration:
            found.append((took, condition))
    return found


def _pairs(plan: Plan) -> list[tuple[str, str]]:
    """Robots and objects that may touch."""
    roles = world_of(plan.scene).roles(plan.parameters)
    return [pair for pair in plan.scene.template.contacts if {roles[n] for n in pair} == {"robot", "object"}]
