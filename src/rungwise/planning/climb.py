"""Planning: stage by stage, each plan lifted to the next stage, repaired or replaced there."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from rungwise.errors import InputError
from rungwise.keywords import keywords
from rungwise.models.ladder import (
    DYNAMIC_COMPLIANT,
    LADDER,
    QUASISTATIC_RIGID,
    Rung,
    rung,
)
from rungwise.outcome import Code
from rungwise.planning.carriers import TaskError
from rungwise.planning.diagnose import APART, Diagnosis, diagnose
from rungwise.planning.geometric import needs_forces
from rungwise.planning.improve import better, cost_of
from rungwise.planning.lay import Course
from rungwise.planning.lift import HELD, Before, Found, Work, begin, known, laid, on_stage
from rungwise.planning.placed import NOTHING, in_the_way, nowhere, place, put, untouched
from rungwise.planning.plan import Plan, Record, installed
from rungwise.planning.predict import Budget, Stage
from rungwise.planning.robust import made_robust
from rungwise.planning.task import Task, fields_of, instances, task_of
from rungwise.planning.verify import CONFIDENCE, bound_below
from rungwise.scene import Scene
from rungwise.scene.read import load
from rungwise.scene.space import SpaceScene
from rungwise.scene.values import finite, shown
from rungwise.simulation.options import count
from rungwise.wording import choices

COARSE, FINE, TENTH = 1e-2, 1e-3, 0.1
"""Accuracies of stages: the error allowed per step, as a part of the size of what is moved; and how much
finer the replay is that confirms a plan."""
SHARE = 0.1
"""Part of the steps left that may be spent on a stage of another rung than the last."""
INTERRUPTED = "interrupted"
"""How the reason of a plan begins whose search was interrupted."""
SCHEDULES = ("coarse-fine", "climb", "quasistatic", "direct")
"""Schedules by name: coarse steps on the last rung, then fine ones; all rungs from the first to the last;
fine steps on the rigid quasistatic rung, then on the last; fine steps on the last rung alone."""
Schedule: TypeAlias = "str | Sequence[Stage | tuple[str | Rung, float] | str | Rung]"


class ScheduleOfStagesError(InputError):
    """A schedule of stages is wrong; one line that names it."""


@keywords
def plan(
    scene: Scene | SpaceScene | str | Path | Mapping[str, Any],
    *,
    from_: Rung | str | None = None,
    to: Rung | str = DYNAMIC_COMPLIANT,
    schedule: Schedule | None = None,
    parameters: Mapping[str, float] | None = None,
    task_seed: int | None = None,
    budget: int | None = 1_250_000,
    limit: float | None = None,
    improve: int = 0,
    robust: float | None = None,
    samples: int = 200,
    seed: int = 0,
    initial: Plan | None = None,
    threads: int | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Plan:
    """Plan the task of a scene, on one model after the other.

    Args:
        scene: with a task, an inputs field and a goal.
        from_, to: first and last rung of a schedule that is given by name.
        schedule: a name of `SCHEDULES`, or stages: rungs, or rungs with an accuracy, the error allowed per
            step as a part of the size of what is moved. The task's own if not given (see `usual`).
        parameters: of the instance; task_seed: draws the instance by the task's rules instead.
        budget: simulated steps, refused ones included; limit: seconds after which nothing more is
            tried.
        improve: simulated steps that are spent on plans of less cost once there is one.
        robust: rate of success, of which the plan must keep a lower bound (95 %) in so many `samples` of
            what the task calls uncertain: open loop, with guarded moves, or re-planning, whichever suffices
            first; `Plan.mode` says which, `Plan.checks` how each went.
        seed: of the searches; the same seed gives the same plan whatever the threads.
        initial: a plan to begin with in place of a search on the first stage.
        on_progress: called with a line on what is done now. Ctrl-C ends the search and keeps the plan of
            the last stage that was finished, with a reason; it is raised again where there is none.

    Stages on which nothing was found are left out; the first plan of a later stage is replayed on them, and
    the diagnosis says why it fails there.

    Returns a plan; where none was found, `found` is false and `reason` says what is known. Raises SceneError,
    TaskError and ScheduleOfStagesError for wrong input.
    """
    loaded = load(scene)
    given, rate = dict(parameters or {}), _rate(robust)
    if task_seed is not None:
        given = instances(loaded, task_seed)[0] | given
    task = task_of(loaded, given)
    chosen = stages(usual(task, to) if schedule is None else schedule, from_, to)
    if rate is not None:
        _provable(loaded, rate, count("samples", samples, 1))
    if (rate is not None or improve) and not chosen[-1].model.moves:
        field = "improve" if rate is None else "robust"
        raise TaskError(f"{field}: needs a plan with inputs; on {chosen[-1]} there are only places")
    work = begin(task, Budget(budget, limit), seed, threads)
    tell = on_progress or _silent
    found = Plan(loaded, task.parameters, seed=seed, version=installed(), reason="nothing was tried")
    why = nowhere(work)
    if why:
        return replace(found, reason=why)
    if initial is not None:
        found = replace(found, moves=initial.moves, waypoints=initial.waypoints, stage=initial.stage)
    finished, failed = False, list[Stage]()
    try:
        for stage in chosen:
            tell(f"{stage}: {'lifting' if len(found.moves) else 'planning'}")
            told = found.found
            with work.budget.part(1.0 if stage.model == chosen[-1].model else SHARE):
                found = _take_stage(work, found, stage)
            if found.found and found.segments:
                found, failed = _explained(work, found, failed), []
            elif stage.model.moves and not told and found.records[-1].how == NOTHING:
                failed.append(stage)
            if not work.budget.left:
                break
        if not found.found and found.stage is None:
            found = _blocked(work, found)
        if found.found and found.stage != chosen[-1]:
            found = replace(
                found, reason=f"{chosen[-1]}: was not reached; the plan holds on {found.stage}. {known(work)}"
            )
        found = _confirmed(work, found, chosen[-1])
        finished = True
        if improve and found.found:
            work.budget.extend(count("improve", improve, 0))
            for better_one in _improved(work, found):
                found = better_one
                tell(f"{found.stage}: cost {found.cost:.4g}")
        if rate is not None and found.found:
            finished = False
            found = made_robust(found, rate, count("samples", samples, 1), threads, tell)
    except KeyboardInterrupt:
        if found.stage is None:
            raise
        if not finished:
            found = replace(found, reason=f"{INTERRUPTED}; the plan holds on {found.stage}")
    return found


def _rate(robust: float | None) -> float | None:
    if robust is None:
        return None
    rate = finite("robust", robust, TaskError)
    if not 0.0 < rate < 1.0:
        raise TaskError(f"robust: must be between 0 and 1, not {rate:g}")
    return rate


def _provable(scene: Scene | SpaceScene, rate: float, samples: int) -> None:
    """Raise TaskError where nothing varies, or so many samples cannot prove the rate."""
    if not fields_of(scene).uncertain:
        raise TaskError("task.uncertain: is empty; name what varies")
    if bound_below(samples, samples) < rate:
        least = math.ceil(math.log(1.0 - CONFIDENCE) / math.log(rate))
        raise TaskError(f"samples: {samples} cannot prove a rate of {rate:g}; it takes at least {least}")


def _silent(line: str) -> None:
    """Tell nobody."""


def _take_stage(work: Work, before: Plan, stage: Stage) -> Plan:
    """The plan lifted to a stage, with its record and, where it failed or drifted there, the diagnosis."""
    spent, began = work.budget.spent.total(), clock.perf_counter()
    why = _left_out(work, stage)
    if why:
        record = Record(str(stage), why, 0, 0.0)
        reason = "" if before.found else f"{stage}: {why}"
        return replace(before, records=(*before.records, record), reason=reason)
    if not stage.model.moves:
        placed = place(work)
        record = Record(str(stage), placed.how, 0, clock.perf_counter() - began)
        found = replace(before, records=(*before.records, record))
        if not len(placed.way):
            return replace(found, reason=f"{stage}: {placed.how}")
        return put(found, stage, placed)
    lifted, how = on_stage(work, stage, _to_lift(before))
    steps, seconds = work.budget.spent.total() - spent, clock.perf_counter() - began
    moves = 0 if lifted is None else len(lifted.vectors)
    found = replace(before, records=(*before.records, Record(str(stage), how, steps, seconds, moves)))
    if before.found and (how != HELD or lifted is None or _drifts(work, before, lifted.course)):
        found = replace(found, diagnosis=(*found.diagnosis, *_diagnosis(work, before, stage)))
    if lifted is None:
        return replace(found, reason=f"{stage}: {how}. {known(work)}")
    return _put(work, found, stage, lifted)


def _explained(work: Work, found: Plan, failed: Sequence[Stage]) -> Plan:
    """The first plan, with what becomes of it on the stages before on which nothing was found."""
    told = [each for stage in failed for each in _diagnosis(work, found, stage)]
    return replace(found, diagnosis=(*found.diagnosis, *told))


def _blocked(work: Work, found: Plan) -> Plan:
    """No plan, with what is in the way of the bodies."""
    blocked, reason = in_the_way(work), found.reason
    if not blocked:
        return found
    bare = reason.removesuffix(NOTHING)
    return replace(found, reason=f"{bare}{blocked}" if bare != reason else f"{reason}; {blocked}")


def _left_out(work: Work, stage: Stage) -> str:
    """Why nothing need be tried on a stage, in words; empty where something must."""
    if stage.model.moves and not stage.model.loads and needs_forces(work.task, work.start.q[0]):
        return "left out: no forces"
    return ""


def _put(work: Work, plan: Plan, stage: Stage, found: Found) -> Plan:
    """The plan with what was found on a stage."""
    course = found.course
    waypoints = tuple(tuple(place.q[0].tolist()) for place in course.places)
    return replace(
        plan, stage=stage, tol=stage.tol * work.size, segments=course.segments, labels=course.labels,
        moves=found.vectors, waypoints=waypoints, cost=cost_of(work, course), reason="",
    )  # fmt: skip


def _improved(work: Work, plan: Plan) -> Iterator[Plan]:
    """Plans of less cost, each confirmed, the last with a record of them all."""
    stage = plan.stage
    assert stage is not None
    spent, began, times, best = work.budget.spent.total(), clock.perf_counter(), 0, plan
    predictor = work.predictor(stage)
    first = Found(laid(work, predictor, plan.moves), plan.moves)
    for found in better(work, predictor, first):
        trial = _put(work, plan, stage, found)
        if _is_confirmed(trial):
            best, times = trial, times + 1
            yield best
    steps, seconds = work.budget.spent.total() - spent, clock.perf_counter() - began
    how = f"improved {times} times, by {1.0 - best.cost / plan.cost:.0%}"
    yield replace(best, records=(*plan.records, Record(str(stage), how, steps, seconds, len(best.waypoints))))


def _to_lift(plan: Plan) -> Before | None:
    if plan.stage is None or not len(plan.moves):
        return None
    return Before(plan.moves, np.array(plan.waypoints), plan.stage.model)


def _confirmed(work: Work, found: Plan, last: Stage) -> Plan:
    """The plan of the last stage, if its replay at a tenth of the accuracy comes to the goal; otherwise one
    that was repaired at that accuracy."""
    if not found.found or found.stage != last or not last.model.moves or _is_confirmed(found):
        return found
    found = _take_stage(work, found, Stage(last.model, TENTH * last.tol))
    if found.found and not _is_confirmed(found):
        found = replace(found, reason=f"{found.stage}: not confirmed by a replay at a tenth of its accuracy")
    return found


def _is_confirmed(plan: Plan) -> bool:
    return plan.replay(tol=TENTH * plan.tol).outcome.code == Code.GOAL


def _drifts(work: Work, before: Plan, course: Course) -> bool:
    """Whether objects come to other places at the ends of moves than on the stage before."""
    if len(course.places) != len(before.waypoints):
        return True
    pairs = zip(course.places, before.waypoints, strict=True)
    return any(float(work.away(np.array(place))(now)[0]) > APART * work.size for now, place in pairs)


def _diagnosis(work: Work, before: Plan, stage: Stage) -> list[Diagnosis]:
    assert before.stage is not None
    if not before.stage.model.moves:
        told = untouched(work, before, stage)
        return [] if told is None else [told]
    found = diagnose(
        work.task.scene, before.stage.model, stage.model, inputs=before.segments, tol=before.tol,
        other_tol=stage.tol * work.size, parameters=work.task.parameters,
    )  # fmt: skip
    return [replace(found, before=str(before.stage), after=str(stage))]


def usual(task: Task, to: Rung | str) -> str:
    """The schedule that wins `benchmarks/planning.py --schedules` on tasks of this kind: where robots push
    slowly, the quasistatic rung predicts what the last one does, in fewer steps."""
    try:
        above = LADDER.index(rung(to)) > LADDER.index(QUASISTATIC_RIGID)
    except ValueError as error:
        raise ScheduleOfStagesError(str(error)) from None
    return "quasistatic" if task.is_slow and above else "coarse-fine"


def stages(schedule: Schedule, from_: Rung | str | None, to: Rung | str) -> list[Stage]:
    """The stages of a schedule. Raises ScheduleOfStagesError."""
    try:
        last = rung(to)
        first = None if from_ is None else rung(from_)
        if not isinstance(schedule, str):
            if not isinstance(schedule, Iterable):
                raise ValueError(f"schedule: must be a name or stages, not {shown(schedule)}")
            listed = [_stage(each) for each in schedule]
            if not listed:
                raise ValueError("schedule: needs at least one stage")
            return listed
        if schedule not in SCHEDULES:
            raise ValueError(f"schedule: unknown {shown(schedule)}{choices(schedule, SCHEDULES)}")
        if not last.moves:
            return [Stage(last, COARSE)]
        if first is not None or schedule == "climb":
            low = 0 if first is None else LADDER.index(first)
            climbed = LADDER[low : LADDER.index(last) + 1]
            if not climbed:
                raise ValueError(f"from: {from_} is above {last.name}")
            return [*(Stage(each, COARSE) for each in climbed), Stage(last, FINE)]
    except ValueError as error:
        raise ScheduleOfStagesError(str(error)) from None
    chosen = {
        "coarse-fine": [Stage(last, COARSE), Stage(last, FINE)],
        "quasistatic": [Stage(QUASISTATIC_RIGID, FINE), Stage(last, FINE)],
        "direct": [Stage(last, FINE)],
    }
    return chosen[schedule]


def _stage(given: Any) -> Stage:
    match given:
        case Stage():
            found = given
        case (model, float() | int() as tol) if tol > 0.0:
            found = Stage(rung(model), float(tol))
        case str() | Rung():
            found = Stage(rung(given), FINE)
        case _:
            raise ValueError(
                f"schedule: a stage must be a rung, or a rung and an accuracy, not {shown(given)}"
            )
    return found
