"""Places of objects at the goal, towards which trees of contact modes grow, and moves steer."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from rungwise.kernel import Reals
from rungwise.planning.motion.placements import GOALS, NEAREST, Placing, placed_part
from rungwise.planning.search.problem import Work
from rungwise.planning.task.reserve import tightened
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.margins import Question

INNER = (0.7, 0.4)
"""Reserves of the goal with which places well within it are sought, the first with which there are some."""
STARTS, ROOM = 8, 1.0
"""Places from which objects alone are brought to the goal, and how far these are from where it starts, in
parts of the size and in radians."""
STEPS = 400
"""Most places that are asked for, from each."""
GOAL_PLACES = "places at the goal"
"""By which these are kept for all stages."""


def goals_of(work: Work) -> Reals:
    """Places (g, n) at the goal, sought once (see `inner_goals`)."""
    if GOAL_PLACES not in work.kept:
        work.kept[GOAL_PLACES] = inner_goals(work)
    found: Reals = work.kept[GOAL_PLACES]
    return found


def inner_goals(work: Work) -> Reals:
    """Places (g, n) well within the goal; at least those of the task; of objects alone where bodies are
    joined."""
    task, q = work.task, work.start.q[0]
    for reserve in INNER:
        goal = tightened(task.scene.file.goal or "", reserve)
        placing = Placing(task, task.scene.changed(goal=goal), q)
        if placing.room.bound:
            found = _of_objects(work, goal)
        else:
            found = placing.goals(
                np.random.default_rng(work.seed), work.budget.is_in_time, count=GOALS
            ).places
        if len(found):
            return found[:NEAREST]
    return work.goals


def _of_objects(work: Work, goal: str) -> Reals:
    """Places (g, n) at a goal of places, where objects alone are moved, the nearest first."""
    task, q = work.task, work.start.q[0]
    names, roles = task.scene.template.coordinates, world_of(task.scene).roles(task.parameters)
    columns = [k for k, name in enumerate(names) if roles[name.partition(".")[0]] == OBJECT]
    part = placed_part(goal)
    if part is None or not columns:
        return np.zeros((0, len(q)))
    question = Question(task.scene, part, task.parameters)
    units = np.where(task.weights[columns] > 0.0, task.weights[columns], 1.0)

    def placed(moved: Reals) -> Reals:
        found: Reals = q.copy()
        found[columns] += moved * task.size / units
        return found

    def lack(moved: Reals) -> float:
        place = placed(moved)
        return float(question.ask(task.resting(place)).lacks.sum())

    rng, found = np.random.default_rng(work.seed), list[Reals]()
    for k in range(STARTS):
        begun = ROOM * rng.uniform(-1.0, 1.0, len(columns)) * (k > 0)
        best = minimize(lack, begun, method="Nelder-Mead", options={"maxfev": STEPS, "fatol": 0.0})
        if lack(best.x) == 0.0:
            found.append(placed(best.x))
    found.sort(key=lambda place: float(task.away(place[None], q)[0]))
    return np.array(found).reshape(-1, len(q))
