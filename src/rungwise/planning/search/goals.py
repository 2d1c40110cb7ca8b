"""Places of objects at the goal, towards which trees of contact modes grow, and moves steer."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.motion.placements import GOALS, NEAREST, Placing, jumps, placed_part
from rungwise.planning.search.problem import Work, begin
from rungwise.planning.task.reserve import tightened
from rungwise.planning.task.task import Task
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.margins import Question

INNER = (0.7, 0.4)
"""Reserves of the goal with which places well within it are sought, the first with which there are some."""
LESS = (0.5, 0.25, 0.1)
"""Parts of the task's reserve that are tried in turn where the goal has no place with the whole."""
GOAL_PLACES = "places at the goal"
"""By which these are kept for all stages."""


def with_places(work: Work) -> Work:
    """The same, with as much of the reserve as leaves the goal a place, if it has one without: bounds
    on places have no width of which the reserve could be a part, and a fifth nearer to the origin may be
    within a floor. Bodies overlap there only if they do at all places of the goal."""
    task, q = work.task, work.start.q[0]
    placing = Placing(task, task.scene, q)
    if not placing.asks or placing.room.bound or jumps(task.scene.file.goal or ""):
        return work

    def has_place(part: float, yields: bool) -> bool:
        scene = task.with_reserve(part * task.numbers["task.reserve"]).search
        placing, rng = Placing(task, scene, q, yields=yields), np.random.default_rng(work.seed)
        return bool(len(placing.goals(rng, work.budget.is_in_time).places))

    for yields in (False, True):
        if has_place(1.0, yields):
            return work
        if has_place(0.0, yields):
            part = next((part for part in LESS if has_place(part, yields)), 0.0)
            narrower = task.with_reserve(part * task.numbers["task.reserve"])
            return begin(narrower, work.budget, work.seed, work.threads)
    return work


def goals_of(work: Work) -> Reals:
    """Places (g, n) at the goal, sought once (see `inner_goals`)."""
    if GOAL_PLACES not in work.kept:
        work.kept[GOAL_PLACES] = inner_goals(work)
    found: Reals = work.kept[GOAL_PLACES]
    return found


def inner_goals(work: Work) -> Reals:
    """Places (g, n) well within the goal; at least those of the task; of objects alone where bodies are
    joined, which projection does not know."""
    task, q = work.task, work.start.q[0]
    for reserve in INNER:
        goal = tightened(task.scene.file.goal or "", reserve)
        placing = Placing(task, task.scene.changed(goal=goal), q)
        if not placing.asks:
            return work.goals
        found = placing.goals(np.random.default_rng(work.seed), work.budget.is_in_time, count=GOALS).places
        if placing.room.bound:
            found = _of_objects(task, goal, found, q)
        if len(found):
            return found[:NEAREST]
    return work.goals


def _of_objects(task: Task, goal: str, places: Reals, q: Reals) -> Reals:
    """Those of places (g, n) that are at a goal also with all but the objects at q (n,), so, the nearest
    first."""
    names, roles = task.scene.template.coordinates, world_of(task.scene).roles(task.parameters)
    others = [k for k, name in enumerate(names) if roles[name.partition(".")[0]] != OBJECT]
    found = places.copy()
    found[:, others] = q[others]
    part = placed_part(goal)
    assert part is not None
    found = found[Question(task.scene, part, task.parameters).ask(found).holds]
    return found[np.argsort(task.away(found, q), kind="stable")]
