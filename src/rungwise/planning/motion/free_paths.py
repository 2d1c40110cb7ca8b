"""Ways among bodies: trees of OMPL over some coordinates, and ways pulled tight.

Trees are bidirectional (RRT-Connect, Kuffner and LaValle 2000); whole straight ways are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.world.carriers import ROUNDED

if TYPE_CHECKING:
    from rungwise.world.contract import Configurations

Free: TypeAlias = "Callable[[Reals, Reals], bool]"
"""Whether the straight way between two places (n,) is free."""
PARTS, HALVED = ("w", "x", "y", "z"), 2.0
"""Parts of a quaternion, and the angle of a turn over OMPL's distance of quaternions."""
CUTS = (4, 3)
"""Parts into which legs are cut to pull a way tight."""
SHORTCUTS = 200
"""Parts of a way for which straight ones are tried."""
CHECKS = 5_000
"""Most straight ways that a tree asks for before a way counts as not found, if not said otherwise."""


def always() -> bool:
    """There is time."""
    return True


class PlannerMissing(InputError):
    """A plan needs ways through free space, and OMPL, which finds them (the extra `plan`), is missing."""


def is_clear(gaps: Callable[[Reals], Reals], a: Reals, b: Reals, length: float, least: float) -> bool:
    """Whether least gaps (m,), asked for at places (m, n), stay above `least` on the straight way from a to b
    (n,), on which no gap shrinks by more than `length`. A part of the way is clear if its length is less than
    what the gaps at its ends exceed the least one by; other parts are halved, until they are as short as the
    least gap."""
    at, found = np.array([0.0, 1.0]), gaps(np.stack([a, b]))
    while (found >= least * (1.0 - ROUNDED)).all():
        parts = length * np.diff(at)
        unsure = np.flatnonzero((found[:-1] + found[1:] - parts < 2.0 * least) & (parts > least))
        if not len(unsure):
            return True
        middle = 0.5 * (at[unsure] + at[unsure + 1])
        asked = gaps(a + middle[:, None] * (b - a))
        at, found = np.insert(at, unsure + 1, middle), np.insert(found, unsure + 1, asked)
    return False


def grown(
    q: Reals, goals: Reals, columns: Sequence[int], low: Reals, high: Reals, is_free: Free, seed: int,
    goes_on: Callable[[int], bool] = lambda asked: asked <= CHECKS, units: Reals | float = 1.0,
    turns: Ints | None = None,
) -> Reals | None:  # fmt: skip
    """Places (k, n) from q (n,) to one of the goals (r, n), which differ in these columns (c,), within bounds
    (c,), and in quaternions, whose columns are `turns` (t, 4); None where no way was found. It is sought
    while `goes_on` at the number of straight ways that were asked for; distances are those of places over
    `units` (c,), and angles of turns. Raises PlannerMissing."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise PlannerMissing("paths: need OMPL; pip install 'rungwise[plan]'") from None
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(1 + seed)
    plain, bounds = base.RealVectorStateSpace(len(columns)), base.RealVectorBounds(len(columns))
    unit = np.broadcast_to(units, len(columns)).tolist()
    for k, (least, most) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(k, least / unit[k])
        bounds.setHigh(k, most / unit[k])
    plain.setBounds(bounds)
    quaternions = [] if turns is None else turns.tolist()
    space = base.CompoundStateSpace() if quaternions else plain
    if quaternions:
        space.addSubspace(plain, 1.0)
    for _ in quaternions:
        space.addSubspace(base.SO3StateSpace(), HALVED)
    setup, asked = geometric.SimpleSetup(space), 0

    def numbers(state: Any) -> Any:
        return state[0] if quaternions else state

    def placed(state: Any) -> Reals:
        place, own = q.copy(), numbers(state)
        place[columns] = [own[k] * unit[k] for k in range(len(columns))]
        for t, turn in enumerate(quaternions):
            place[turn] = [getattr(state[1 + t], part) for part in PARTS]
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
        own = numbers(state)
        for k, column in enumerate(columns):
            own[k] = float(place[column]) / unit[k]
        for t, turn in enumerate(quaternions):
            for part, column in zip(PARTS, turn, strict=True):
                setattr(state[1 + t], part, float(place[column]))
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


def cut_short(way: Reals, is_free: Free, room: Configurations, rng: np.random.Generator) -> Reals:
    """The way (k, n) with parts between places drawn on it replaced by straight ways that are free, and with
    each body led straight from end to end where that is free."""
    for _ in range(SHORTCUTS):
        along = _along(way, room)
        first, last = np.sort(rng.uniform(0.0, along[-1], 2))
        a, b = (_at(way, along, at, room) for at in (first, last))
        if is_free(a, b):
            way = np.vstack([way[along < first], a, b, way[along > last]])
    for own in room.bodies:
        along = _along(way, room)
        trial = way.copy()
        trial[:, own] = room.between(way[0], way[-1], along / along[-1])[:, own]
        trial[-1] = way[-1]
        if all(is_free(a, b) for a, b in pairwise(trial)):
            way = trial
    return _straightened(way, is_free)


def _along(way: Reals, room: Configurations) -> Reals:
    """How long the way is up to each of its places (k,)."""
    return np.concatenate([[0.0], room.lengths(way).cumsum()])


def _at(way: Reals, along: Reals, length: float, room: Configurations) -> Reals:
    """The place (n,) on a way after this length of it."""
    k = int(np.clip(np.searchsorted(along, length, side="right") - 1, 0, len(way) - 2))
    leg = along[k + 1] - along[k]
    part = (length - along[k]) / leg if leg > 0.0 else 0.0
    return np.asarray(room.between(way[k], way[k + 1], np.array([part]))[0])


def _straightened(way: Reals, is_free: Free) -> Reals:
    kept, at = [0], 0
    while at < len(way) - 1:
        later = range(len(way) - 1, at, -1)
        at = next(k for k in later if k == at + 1 or is_free(way[at], way[k]))
        kept.append(at)
    return way[kept]
