"""Ways among bodies: trees of OMPL over some coordinates, and ways pulled tight.

Trees are bidirectional (RRT-Connect, Kuffner and LaValle 2000); whole straight ways are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals

Free: TypeAlias = "Callable[[Reals, Reals], bool]"
"""Whether the straight way between two places (n,) is free."""
CUTS = (4, 3)
"""Parts into which legs are cut to pull a way tight."""
SHORTCUTS = 200
"""Parts of a way for which straight ones are tried."""
CHECKS = 5_000
"""Most straight ways that a tree asks for before a way counts as not found, if not said otherwise."""


class PlannerMissing(InputError):
    """OMPL is not installed."""


def grown(
    q: Reals, goals: Reals, columns: Sequence[int], low: Reals, high: Reals, is_free: Free, seed: int,
    goes_on: Callable[[int], bool] = lambda asked: asked <= CHECKS, units: Reals | float = 1.0,
) -> Reals | None:  # fmt: skip
    """Places (k, n) from q (n,) to one of the goals (r, n), which differ in these columns (c,), within bounds
    (c,); None where no way was found. It is sought while `goes_on` at the number of straight ways that were
    asked for; distances are those of places over `units` (c,). Raises PlannerMissing."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise PlannerMissing("ways: need OMPL; pip install 'rungwise[plan]'") from None
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(1 + seed)
    space, bounds = base.RealVectorStateSpace(len(columns)), base.RealVectorBounds(len(columns))
    unit = np.broadcast_to(units, len(columns)).tolist()
    for k, (least, most) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(k, least / unit[k])
        bounds.setHigh(k, most / unit[k])
    space.setBounds(bounds)
    setup, asked = geometric.SimpleSetup(space), 0

    def placed(state: Any) -> Reals:
        place = q.copy()
        place[columns] = [state[k] * unit[k] for k in range(len(columns))]
        return place

    class Straight(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, *motion: Any) -> bool:
            nonlocal asked
            asked += 1
            return is_free(placed(motion[0]), placed(motion[1]))

    def is_valid(state: Any) -> bool:
        place = placed(state)
        return is_free(place, place)

    setup.setStateValidityChecker(is_valid)
    information = setup.getSpaceInformation()
    validator = Straight(information)
    information.setMotionValidator(validator)

    def state_at(place: Reals) -> Any:
        state = space.allocState()
        for k, column in enumerate(columns):
            state[k] = float(place[column]) / unit[k]
        return state

    setup.setStartState(state_at(q))
    if len(goals) == 1:
        setup.setGoalState(state_at(goals[0]))
    else:
        aims = base.GoalStates(information)
        for goal in goals:
            aims.addState(state_at(goal))
        setup.setGoal(aims)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.solve(base.PlannerTerminationCondition(lambda: not goes_on(asked)))
    if not setup.haveExactSolutionPath():
        return None
    way = np.stack([placed(state) for state in setup.getSolutionPath().getStates()])
    way[0], way[-1] = q, goals[np.linalg.norm(goals - way[-1], axis=1).argmin()]
    return way


def shortened(way: Reals, is_free: Free) -> Reals:
    """The way (k, n) pulled tight: without places that a straight way can leave out, its legs cut into parts
    and the same again."""
    for parts in (1, *CUTS):
        steps = np.linspace(0.0, 1.0, parts, endpoint=False)[:, None]
        legs = [a + steps * (b - a) for a, b in pairwise(way)]
        way = _straightened(np.concatenate([*legs, way[-1:]]), is_free)
    return way


def cut_short(
    way: Reals, is_free: Free, units: Reals, bodies: Sequence[Sequence[int]], rng: np.random.Generator
) -> Reals:
    """The way (k, n) with parts between places drawn on it replaced by straight ways that are free, and with
    the columns of each body led straight from end to end where that is free; `units` (n,) as of `grown`."""
    for _ in range(SHORTCUTS):
        along = np.r_[0.0, np.linalg.norm(np.diff(way / units, axis=0), axis=1).cumsum()]
        first, last = np.sort(rng.uniform(0.0, along[-1], 2))
        a, b = (np.array([np.interp(at, along, column) for column in way.T]) for at in (first, last))
        if is_free(a, b):
            way = np.vstack([way[along < first], a, b, way[along > last]])
    for columns in bodies:
        along = np.r_[0.0, np.linalg.norm(np.diff(way / units, axis=0), axis=1).cumsum()]
        trial, own = way.copy(), list(columns)
        trial[:, own] += (along / along[-1])[:, None] * (way[-1] - way[0])[own] + way[0, own] - way[:, own]
        trial[-1] = way[-1]
        if all(is_free(a, b) for a, b in pairwise(trial)):
            way = trial
    return _straightened(way, is_free)


def _straightened(way: Reals, is_free: Free) -> Reals:
    kept, at = [0], 0
    while at < len(way) - 1:
        later = range(len(way) - 1, at, -1)
        at = next(k for k in later if k == at + 1 or is_free(way[at], way[k]))
        kept.append(at)
    return way[kept]
