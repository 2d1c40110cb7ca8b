"""The stage on the geometric rung: a plan of places, and what it leaves out."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.diagnosis.diagnose import APART, Diagnosis
from rungwise.planning.diagnosis.sentences import UNTOUCHED
from rungwise.planning.motion.budget import Stage
from rungwise.planning.motion.free_paths import PlannerMissing
from rungwise.planning.motion.placements import GOALS, Placing, jumps
from rungwise.planning.plan import NOTHING, Plan
from rungwise.planning.search.problem import Work
from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import Segment
from rungwise.world.contract import OBJECT, OBSTACLE, ROBOT
from rungwise.world.find import world_of
from rungwise.world.run import simulate

SURE = 1e-3
"""What is lacking of a goal of which no place was found, if it is to be said that there is none."""
LOOKS = 100
"""Places on each leg of a way at which is looked whether a robot touches what moves."""


class Placed(NamedTuple):
    """Places (k, n) from the start to the goal, none where there is no way; and how they came about."""

    way: Reals
    how: str


def nowhere(work: Work, apart: bool = True) -> str:
    """Why the goal holds at no place that was found, in a line; empty where one was found, where places do
    not decide, or where very little is lacking. Bodies may overlap as far as contacts yield on compliant
    rungs. Without `apart` overlaps do not count."""
    q, seed, scene = work.start.q[0], work.seed, work.task.scene
    placing = Placing(work.task, scene, q, yields=True)
    if not placing.asks or placing.room.bound or jumps(scene.file.goal or ""):
        return ""
    in_time = work.budget.is_in_time
    found = placing.goals(np.random.default_rng(seed), in_time, apart=apart)
    if len(found.places) or found.lack < SURE:
        return ""
    if not in_time():
        return ""
    alone = placing.goals(np.random.default_rng(seed), in_time, apart=False)
    if len(alone.places):
        overlapping = placing.overlapping(alone.nearest)
        return f"goal: as far as the search could find, it holds only where {overlapping} overlap"
    failing = placing.lacking(alone.nearest)
    return (
        "goal: no placement of the bodies was found at which it holds; at the nearest one these terms fail:"
        f" {failing}"
    )


def place(work: Work, without: str = "") -> Placed:
    """Places of all bodies on a way to the goal, as if the body `without` were not there."""
    none, q = np.zeros((0, len(work.start.q[0]))), work.start.q[0]
    placing = Placing(work.task, work.task.search, q, without)
    if placing.room.bound:
        return Placed(none, f"left out: {placing.room.bound}")
    if not placing.asks:
        return Placed(none, "left out: places do not decide the goal")
    in_time = work.budget.is_in_time
    goals = placing.goals(np.random.default_rng(work.seed), in_time, count=GOALS)
    if not len(goals.places):
        return Placed(none, NOTHING if in_time() else f"{NOTHING}; {work.budget.ended}")
    try:
        way = placing.way(goals.places, work.seed, in_time)
    except PlannerMissing:
        return Placed(none, "left out: needs OMPL (pip install 'rungwise[plan]')")
    if way is None:
        return Placed(none, NOTHING if in_time() else f"{NOTHING}; {work.budget.ended}")
    return Placed(way, "planned")


def in_the_way(work: Work) -> str:
    """Which obstacle leaves no way on the geometric rung, in a line; empty where there is a way, the rung is
    left out, or the time is over."""
    if place(work).how != NOTHING:
        return ""
    obstacles = _with_role(work, OBSTACLE)
    alone = [name for name in obstacles if len(place(work, name).way)]
    return (
        f"no path for the bodies was found{', ' + ' or '.join(alone) + ' being in the way' if alone else ''}"
    )


def untouched(work: Work, before: Plan, stage: Stage) -> Diagnosis | None:
    """What the geometric rung leaves out on the way to the next stage: objects moved without being touched.

    There the inputs stay as they were at the start, for as long as one move may take: that a plan of places
    has no inputs is what breaks. None where the goal is reached so, or no object had to move that no robot
    touches on its way."""
    names, scene = work.task.scene.template.inputs, work.task.scene
    hold = Segment(dict(zip(names, work.task.before.tolist(), strict=True)), work.task.duration[1])
    run = simulate(
        scene, stage.model, parameters=work.task.parameters, tol=stage.tol * work.size, inputs=[hold],
        limit=work.budget.seconds, on_progress=work.budget.look,
    )  # fmt: skip
    if run.outcome.code == Code.RUNNING:
        work.budget.look()
    if run.outcome.code in (Code.GOAL, Code.INVALID):
        return None
    way = np.array([work.start.q[0], *before.waypoints])
    off = work.task.off(run.state.q[None], way[-1])[0]
    least = APART * work.size
    found = {
        name: _moved(work, way, name)
        for name in _with_role(work, OBJECT)
        if np.linalg.norm(off[_own(scene, name)]) > least
    }
    alone = {
        name: numbers for name, numbers in found.items() if numbers["moved"] - numbers["touched"] > least
    }
    if not alone:
        return None
    body = max(alone, key=lambda name: float(np.linalg.norm(off[_own(scene, name)])))
    others = {name: numbers for name, numbers in alone.items() if name != body}
    return Diagnosis(
        before=str(before.stage), after=str(stage), causes=(UNTOUCHED,), left={}, time=0.0, body=body,
        distance=float(np.linalg.norm(off)), details={UNTOUCHED: {**alone[body], "others": others}},
        ends=({"outcome": "goal", "time": 0.0}, world_of(work.task.scene).end(run)),
        outcome=str(run.outcome), inputs=(hold,),
        tols=(stage.tol * work.size, stage.tol * work.size),
    )  # fmt: skip


def _with_role(work: Work, role: str) -> list[str]:
    """The bodies of a role."""
    roles = world_of(work.task.scene).roles(work.task.parameters)
    return [name for name, own in roles.items() if own == role]


def _own(scene: AnyScene, body: str) -> list[int]:
    """The coordinates of a body."""
    return [k for k, name in enumerate(scene.template.coordinates) if name.split(".")[0] == body]


def _moved(work: Work, way: Reals, body: str) -> dict[str, float]:
    """How far a body moves along a way, in the metric of the task, and how far of it a robot touches it."""
    scene = work.task.scene
    room, robots = (
        world_of(scene).configurations(work.task.parameters, work.task.size),
        set(_with_role(work, ROBOT)),
    )
    contacts = [k for k, pair in enumerate(scene.template.contacts) if body in pair and robots & set(pair)]
    moved = touched = 0.0
    for a, b in pairwise(way):
        length = float(np.linalg.norm(work.task.off(b[None], a)[0, _own(scene, body)]))
        rows = room.between(a, b, np.linspace(0.0, 1.0, LOOKS))
        gaps = work.moves.question.geometry(rows).gaps[:, contacts]
        moved += length
        touched += length * float((gaps <= work.task.tolerance).any(axis=1).mean())
    return {"moved": moved, "touched": touched}


def put(plan: Plan, stage: Stage, placed: Placed) -> Plan:
    """The plan with places in place of inputs."""
    waypoints = tuple(tuple(place.tolist()) for place in placed.way[1:])
    return replace(
        plan, stage=stage, waypoints=waypoints, segments=(), labels=(), moves=np.zeros((0, 0)), tol=0.0,
        cost=math.nan, reason="",
    )  # fmt: skip
