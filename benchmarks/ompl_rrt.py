"""A baseline from outside: OMPL's kinodynamic RRT, whose propagation runs one move of ours.

Its state is the weighted coordinates of objects, its control the vector of a move. It draws states about
start and goals, with OMPL's bias towards goals, which are found by projection. Robots are put where moves
begin: their ways between moves are not planned, and the number of moves is not limited.
"""

from __future__ import annotations

import math
import time
from typing import Any, NamedTuple

import numpy as np
from ompl import base, control, util
from scipy.optimize import minimize

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.lift.stages import COARSE
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.propagate import GOES_ON, Places
from rungwise.planning.search.problem import Work, begin
from rungwise.planning.task.task import instances, task_of

ROOM = 0.5
"""How far drawn states lie beyond start and goals, as a part of their greatest distance."""
TRIALS = 20
"""Starts from which goals are projected."""
NUMBERED = 1e-12
"""What the number of a node adds to a state, by which its velocities and robots are found again."""


class Nodes:
    """States that RRT has come to, in full, by their numbers."""

    def __init__(self, work: Work) -> None:
        self.work, self.predictor = work, work.predictor(Stage(rw.DYNAMIC_COMPLIANT, COARSE))
        self.columns = np.flatnonzero(work.task.weights)
        self.places, self.lacks = [work.start], [float(work.lack(work.start)[0])]
        self.depths = [0]

    def scaled(self, places: Places) -> Reals:
        return np.asarray(places.q[0, self.columns] * self.work.task.weights[self.columns])

    def write(self, state: Any, number: int) -> None:
        values = np.append(self.scaled(self.places[number]), NUMBERED * number)
        for k, value in enumerate(values):
            state[k] = float(value)

    def number(self, state: Any) -> int:
        return round(state[len(self.columns)] / NUMBERED)

    def after(self, number: int, vector: Reals) -> int | None:
        """The number of the state after a move, None where the move cannot be made."""
        moves, task, now = self.work.moves, self.work.task, self.places[number]
        begun, fits = moves.begin(vector[None], now)
        segments = moves.segments_of(vector[None], begun, task.before[None])
        if not (fits[0] and task.allows(segments.levels).all()):
            return None
        ends = self.predictor.run(begun, segments.levels, segments.durations, ramps=segments.ramps)
        if ends.outcome[0] not in (*GOES_ON, Code.GOAL):
            return None
        self.places.append(ends.places)
        self.depths.append(self.depths[number] + 1)
        at_goal = ends.outcome[0] == Code.GOAL
        self.lacks.append(0.0 if at_goal else max(float(self.work.lack(ends.places)[0]), 1e-12))
        return len(self.places) - 1

    def goals(self, seed: int) -> list[Reals]:
        """Scaled places of objects at which nothing of the goal is lacking."""
        rng, start, weights = np.random.default_rng(seed), self.work.start, self.work.task.weights
        found = []

        def lacking(values: Reals) -> float:
            q = start.q.copy()
            q[0, self.columns] = values / weights[self.columns]
            return float(self.work.lack(start._replace(q=q))[0])

        for _ in range(TRIALS):
            begun = self.scaled(start) + self.work.size * rng.standard_normal(len(self.columns))
            best = minimize(lacking, begun, method="Nelder-Mead")
            if best.fun <= 0.0:
                found.append(best.x)
        return found


class Answer(NamedTuple):
    """Whether a goal was reached within the time, seconds, simulated steps, and moves of the plan."""

    solved: bool
    seconds: float
    steps: int
    moves: int


def rrt(scene: rw.Scene, task_seed: int, limit: float) -> Answer:
    """OMPL's RRT on an instance, on dynamic-compliant at coarse steps, with plans of any number of moves."""
    began = time.perf_counter()
    work = begin(task_of(scene, instances(scene, task_seed)[0]), Budget(limit=limit), 0, None)
    nodes = Nodes(work)
    rng = np.random.default_rng(task_seed)
    goals, n, d = nodes.goals(task_seed), len(nodes.columns), work.moves.size
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(1 + task_seed)
    ends = np.array([nodes.scaled(work.start), *goals])
    room = ROOM * float((ends.max(axis=0) - ends.min(axis=0)).max()) + work.size
    space = base.RealVectorStateSpace(n + 1)
    space.setBounds(_bounds([*(ends.min(axis=0) - room), 0.0], [*(ends.max(axis=0) + room), 1e-6]))
    controls = control.RealVectorControlSpace(space, d)
    controls.setBounds(_bounds([0.0] * d, [1.0] * d))
    setup = control.SimpleSetup(controls)
    info = setup.getSpaceInformation()
    info.setPropagationStepSize(1.0)
    info.setMinMaxControlDuration(1, 1)

    def propagate(state: Any, chosen: Any, _: float, result: Any) -> None:
        number = nodes.after(nodes.number(state), np.array([chosen[k] for k in range(d)]))
        if number is None:
            result[0] = math.inf
        else:
            nodes.write(result, number)

    class Goal(base.GoalSampleableRegion):
        def distanceGoal(self, state: Any) -> float:
            return nodes.lacks[nodes.number(state)]

        def sampleGoal(self, state: Any) -> None:
            for k, value in enumerate(goals[int(rng.integers(len(goals)))]):
                state[k] = float(value)
            state[n] = 0.0

        def maxSampleCount(self) -> int:
            return len(goals)

    setup.setStatePropagator(propagate)
    setup.setStateValidityChecker(lambda state: math.isfinite(state[0]))
    start = space.allocState()
    nodes.write(start, 0)
    setup.setStartState(start)
    goal = Goal(info)
    goal.setThreshold(0.0)
    setup.setGoal(goal)
    planner = control.RRT(info)
    setup.setPlanner(planner)
    setup.solve(base.PlannerTerminationCondition(lambda: min(nodes.lacks) <= 0.0 or not work.budget.left))
    best = int(np.argmin(nodes.lacks))
    return Answer(
        nodes.lacks[best] <= 0.0, time.perf_counter() - began, work.budget.spent.total(), nodes.depths[best]
    )


def _bounds(low: list[float], high: list[float]) -> Any:
    bounds = base.RealVectorBounds(len(low))
    for k, (least, most) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(k, float(least))
        bounds.setHigh(k, float(most))
    return bounds
