"""Planning: stage by stage, each plan lifted to the next stage, repaired or replaced there."""

from __future__ import annotations

import itertools
import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.planning.execution.robust import made_robust
from rungwise.planning.execution.verify import CONFIDENCE, bound_below
from rungwise.planning.lift.explain import diagnoses, drifts, explained, in_what_is_left
from rungwise.planning.lift.geometric_stage import in_the_way, nowhere, place, put
from rungwise.planning.lift.initial import Initial, begun_with
from rungwise.planning.lift.records import with_record, without_vain_repairs
from rungwise.planning.lift.repair import Before, Lifted, on_stage
from rungwise.planning.lift.stages import Schedule, stages, usual
from rungwise.planning.modes.planner import suits
from rungwise.planning.modes.reach.planner import has_room, reach_in
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.placements import needs_forces
from rungwise.planning.plan import HELD, NOTHING, Plan, Record
from rungwise.planning.search.goals import with_places
from rungwise.planning.search.improve import better, cost_of
from rungwise.planning.search.layout import is_by_modes
from rungwise.planning.search.problem import Found, Work, begin, known, laid
from rungwise.planning.task.fingers import demand_known
from rungwise.planning.task.task import fields_of, instances, task_of
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import finite
from rungwise.scene.read import load
from rungwise.simulation.options import count
from rungwise.stored import installed
from rungwise.world.carriers import TaskError

TENTH = 0.1
"""How much finer the replay is that confirms a plan."""
SHARE, SLOWLY, COARSELY, TURNS = 0.1, 0.4, 0.5, 3
"""Parts of the steps left that may be spent in one turn: on a stage of another rung than the
last; on all of these where robots push slowly, for then they predict what the last one does; on a coarse
stage of the last rung; and in how many turns all is spent where nothing comes to the last stage."""
MENDING = 0.2
"""Part of the steps left that the repair of a plan may take which its replay does not confirm."""
UNCONFIRMED = "not confirmed by a replay at a tenth of its accuracy"
INTERRUPTED = "interrupted"
"""How the reason of a plan begins whose search was interrupted."""


@keywords
def plan(
    scene: AnyScene | str | Path | Mapping[str, Any],
    *,
    from_: Rung | str | None = None,
    to: Rung | str = "dynamic-compliant",
    schedule: Schedule | None = None,
    parameters: Mapping[str, float] | None = None,
    task_seed: int | None = None,
    budget: int | None = 1_250_000,
    limit: float | None = None,
    improve: int = 0,
    robust: float | None = None,
    samples: int = 200,
    seed: int = 0,
    initial: Initial | None = None,
    threads: int | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Plan:
    """Plan the task of a scene, from a cheap model to a rich one.

    Args:
        scene: with a task, an inputs field and a goal.
        from_, to: first and last rung of a schedule that is given by name.
        schedule: a name of `SCHEDULES`, or stages: rungs, or rungs with an accuracy, the error allowed per
            step as a part of the size of what is moved. The task's own if not given (see `usual`).
        parameters: of the instance; task_seed: draws the instance by the task's rules instead.
        budget: simulated steps, refused ones included, that searches may spend (a step of a tree of contact
            modes counts as three), without bound if None; limit: seconds after which the call returns
            with what it has found.
        improve: simulated steps that are spent on reducing the cost of a plan that was found.
        robust: rate of success that the plan must reach: the lower bound (95 %) from this number of
            `samples` under the uncertainty of the task. Modes of execution are tried in the order open loop,
            guarded moves, re-planning, until one suffices; `Plan.mode` names it, and `Plan.checks` has the
            results of each.
        seed: of the searches; the same seed gives the same plan for any number of threads.
        initial: a plan, or segments of a schedule, with which to begin instead of a search on the first
            stage. It is replayed, and repaired if it misses. If robots go through free space, segments that
            miss are continued from their end, or from a half of them on. Or an array of poses (n, 3) (x, y,
            angle) of the object, which searches by contact modes follow.
        on_progress: called with a line on the present work, about ten times a second. Ctrl-C ends the search
            and keeps the plan of the last finished stage, with a reason; without such a plan it raises
            KeyboardInterrupt.

    Stages on which nothing was found are left out. The first plan of a later stage is replayed on them, and
    the diagnosis says why it fails there.

    Returns a plan; if none was found, `found` is false and `reason` explains it. Raises SceneError
    for a wrong scene, TaskError for a task that cannot be planned or a wrong `initial`, StageError for a
    wrong schedule, PlannerMissing where ways through free space need OMPL, which is not installed.
    """
    loaded = load(scene)
    given, rate = dict(parameters or {}), _rate(robust)
    if task_seed is not None:
        given = instances(loaded, task_seed)[0] | given
    task = task_of(loaded, given)
    demand_known(task)
    chosen = stages(usual(task, to) if schedule is None else schedule, from_, to)
    if rate is not None:
        _provable(loaded, rate, count("samples", samples, 1))
    if (rate is not None or improve) and not chosen[-1].model.moves:
        field = "improve" if rate is None else "robust"
        raise TaskError(f"{field}: needs a plan with inputs; on {chosen[-1]} there are only places")
    tell = on_progress or _silent
    work = begin(task, Budget(budget, limit), seed, threads)
    arm = reach_in(work)
    work = with_places(work) if arm is None else work
    if (reserve := work.task.numbers["task.reserve"]) < task.numbers["task.reserve"]:
        tell(f"goal: a reserve of {reserve:g}, because it holds nowhere with more")
    found = Plan(loaded, task.parameters, seed=seed, version=installed(), reason="nothing was tried")
    why = nowhere(work, apart=arm is None)
    if arm is not None and not why and not has_room(work, arm):
        why = nowhere(work)
    if why:
        return replace(found, reason=why)
    if initial is not None:
        found = begun_with(work, found, initial, chosen)
    finished = False
    try:
        for each in _climbed(work, found, chosen, tell):
            found = each
        finished = True
        if improve and found.found:
            work.budget.extend(count("improve", improve, 0))
            for better_one in _improved(work, found):
                found = better_one
                tell(f"{found.stage}: cost {found.cost:.4g}")
        if rate is not None and found.found:
            finished = False
            found = _robust(work, found, rate, count("samples", samples, 1), tell)
    except KeyboardInterrupt:
        if found.stage is None:
            raise
        if not finished:
            found = replace(found, reason=f"{INTERRUPTED}; the plan holds on {found.stage}")
    return in_what_is_left(work, found)


def _climbed(work: Work, begun: Plan, chosen: Sequence[Stage], tell: Callable[[str], None]) -> Iterator[Plan]:
    """The best plan so far, again and again: stage by stage, and from the first stage on once more where
    nothing came to the last one and was confirmed there, as long as steps and time are left; not where a turn
    ended by itself without a step."""
    best, last = begun, chosen[-1]
    for turn in itertools.count():
        spent = work.budget.spent.total()
        own = (
            begun
            if turn == 0
            else Plan(begun.scene, begun.parameters, seed=begun.seed, version=begun.version)
        )
        own = replace(own, records=best.records, reason="nothing was tried")
        for each in _one_turn(work, own, chosen, turn, tell):
            best = _better(each, best, chosen)
            yield best
        if (
            (best.found and _has_come(best, last))
            or not work.budget.left
            or work.budget.spent.total() == spent
        ):
            break
    if best.stage is None and work.budget.is_in_time():
        best = _blocked(work, best)
    if best.found and not _has_come(best, last):
        reason = f"{last}: was not reached; the plan holds on {best.stage}. {known(work)}"
        best = replace(best, reason=reason)
    yield without_vain_repairs(best) if best.found else best


def _better(own: Plan, best: Plan, chosen: Sequence[Stage]) -> Plan:
    """The plan that came further, with the records of all."""

    def far(plan: Plan) -> tuple[int, bool]:
        if _has_come(plan, chosen[-1]):
            return len(chosen), plan.found
        return (-1 if plan.stage not in chosen else chosen.index(plan.stage)), True

    return own if far(own) >= far(best) else replace(best, records=own.records)


def _has_come(plan: Plan, last: Stage) -> bool:
    """Whether a plan is one of the last stage, or as exact."""
    stage = plan.stage
    return stage is not None and stage.model == last.model and stage.tol <= last.tol


def _one_turn(
    work: Work, found: Plan, chosen: Sequence[Stage], turn: int, tell: Callable[[str], None]
) -> Iterator[Plan]:
    """The plan after each stage; the last one is confirmed."""
    last, moving, failed = chosen[-1], [stage for stage in chosen if stage.model.moves], list[Stage]()
    for stage in chosen if turn == 0 else moving:
        _announce(work, stage, found, tell)
        told = found.found
        may_do = stage == last or not (work.named.task.is_led and suits(work))
        with work.budget.part(_share(work, stage, moving, turn), None if may_do else stage):
            found = _take_stage(work, found, stage)
        if found.found and found.segments:
            found, failed = explained(work, found, failed), []
        elif stage.model.moves and not told and found.how(stage) == NOTHING:
            failed.append(stage)
        found = _confirmed(work, found, last)
        yield found
        if not work.budget.left:
            break


def _share(work: Work, stage: Stage, moving: Sequence[Stage], turn: int) -> float:
    """The part of the steps left that a stage may take in a turn."""
    if not stage.model.moves:
        return 1.0
    last = moving[-1]
    if stage.model != last.model:
        others = sum(each.model != last.model for each in moving)
        return max(SHARE, SLOWLY / others) if work.task.is_slow or work.named.task.is_led else SHARE
    return COARSELY if stage != last or (turn < TURNS - 1 and len(moving) > 1) else 1.0


def _announce(work: Work, stage: Stage, found: Plan, tell: Callable[[str], None]) -> None:
    """Say what is done now, and have the budget say how far it has come."""
    line = f"{stage}: {'lifting' if len(found.moves) or found.segments else 'planning'}"

    def how_far() -> None:
        nearest = (
            f", the nearest plan misses the goal by {work.nearest:.3g}" if math.isfinite(work.nearest) else ""
        )
        tell(f"{line}, {work.budget.spent.total()} steps{nearest}")

    tell(line)
    work.budget.tell = how_far


def _rate(robust: float | None) -> float | None:
    if robust is None:
        return None
    rate = finite("robust", robust, TaskError)
    if not 0.0 < rate < 1.0:
        raise TaskError(f"robust: must be between 0 and 1, not {rate:g}")
    return rate


def _provable(scene: AnyScene, rate: float, samples: int) -> None:
    """Raise TaskError where nothing varies, or so many samples cannot prove the rate."""
    if not fields_of(scene).uncertain:
        raise TaskError("task.uncertain: is empty; name what varies")
    if bound_below(samples, samples) < rate:
        least = math.ceil(math.log(1.0 - CONFIDENCE) / math.log(rate))
        raise TaskError(f"samples: {samples} cannot prove a rate of {rate:g}; it takes at least {least}")


def _silent(line: str) -> None:
    """Tell nobody."""


def _take_stage(work: Work, before: Plan, stage: Stage, anew: bool = True) -> Plan:
    """The plan lifted to a stage, with its record and, where it failed or drifted there, the diagnosis; with
    `anew` another one where it cannot be repaired there."""
    spent, began = work.budget.spent.total(), clock.perf_counter()
    why = _left_out(work, stage)
    if why:
        reason = "" if before.found else f"{stage}: {why}"
        return replace(with_record(before, Record(str(stage), why, 0, 0.0)), reason=reason)
    if not stage.model.moves:
        placed = place(work)
        found = with_record(before, Record(str(stage), placed.how, 0, clock.perf_counter() - began))
        if not len(placed.way):
            return replace(found, reason=f"{stage}: {placed.how}")
        return put(found, stage, placed)
    try:
        lifted, how = on_stage(work, stage, _to_lift(before), anew)
    except TimeOver:
        lifted, how = Lifted(None, NOTHING)
    steps, seconds = work.budget.spent.total() - spent, clock.perf_counter() - began
    moves = 0 if lifted is None else len(lifted.vectors)
    found = with_record(before, Record(str(stage), how, steps, seconds, moves))
    told = before.found and (anew or lifted is not None)
    if told and (how != HELD or lifted is None or drifts(work, before, lifted.course)):
        found = replace(found, told=(*found.told, *diagnoses(work, before, stage, lifted is not None)))
    if lifted is None:
        return replace(found, reason=f"{stage}: {how}. {known(work)}")
    return _put(work, found, stage, lifted)


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
    if is_by_modes(plan.labels):
        return
    spent, began, times, best = work.budget.spent.total(), clock.perf_counter(), 0, plan
    predictor = work.predictor(stage)
    try:
        first = Found(laid(work, predictor, plan.moves), plan.moves)
        for found in better(work, predictor, first) if len(plan.moves) else ():
            trial = _put(work, plan, stage, found)
            if _is_confirmed(work, trial):
                best, times = trial, times + 1
                yield best
    except TimeOver:
        pass  # what was found before is kept
    steps, seconds = work.budget.spent.total() - spent, clock.perf_counter() - began
    how = f"improved {times} times, by {1.0 - best.cost / plan.cost:.0%}"
    yield replace(best, records=(*plan.records, Record(str(stage), how, steps, seconds, len(best.waypoints))))


def _to_lift(plan: Plan) -> Before | None:
    if plan.stage is None or not (len(plan.moves) or plan.segments):
        return None
    return Before(plan.moves, np.array(plan.waypoints), plan.stage.model, plan.segments, plan.labels)


def _confirmed(work: Work, found: Plan, last: Stage) -> Plan:
    """The plan of the last stage, if its replay at a tenth of the accuracy comes to the goal; otherwise one
    that was repaired at that accuracy."""
    if not found.found or found.stage != last or not last.model.moves:
        return found
    try:
        if _is_confirmed(work, found):
            return found
        with work.budget.part(MENDING):
            found = _take_stage(work, found, Stage(last.model, TENTH * last.tol), anew=False)
        if not found.found:
            return replace(found, reason=f"{last}: {UNCONFIRMED}; {found.reason}")
        if _is_confirmed(work, found):
            return found
    except TimeOver:
        return replace(found, reason=f"{found.stage}: {UNCONFIRMED}; {work.budget.ended}")
    return replace(found, reason=f"{found.stage}: {UNCONFIRMED}")


def _is_confirmed(work: Work, plan: Plan) -> bool:
    """Whether the replay at a tenth of the accuracy comes to the goal. Raises TimeOver."""
    budget = work.budget
    run = plan.replay(tol=TENTH * plan.tol, limit=budget.seconds, on_progress=budget.look)
    if run.outcome.code == Code.RUNNING:
        budget.look()
    return bool(run.outcome.code == Code.GOAL)


def _robust(work: Work, plan: Plan, rate: float, samples: int, tell: Callable[[str], None]) -> Plan:
    """The plan in the mode in which it succeeds at a rate."""
    return made_robust(plan, rate, samples, work.threads, tell, work.budget)
