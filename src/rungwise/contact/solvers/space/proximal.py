"""The proximal point method on an island: forces yield a little about their last values.

Algorithm: a sequence of subproblems, each by whole steps of Newton's method in velocities (`space.newton`),
in which forces yield in proportion to the residual that is left: redundant contacts, whose rates disagree by
next to nothing, move their forces by amounts of their own size then. The proportion falls while subproblems
are solved and rises when one is not; where that does not help, sweeps go on from there. Sources: Rockafellar,
SIAM J. Control Optim. 14 (1976) 877-898; Yamashita and Fukushima, Computing Suppl. 15 (2001) 239-249, for
weights in proportion to the residual.
Accepts: what `space.newton` accepts. Promises: nothing; the residual is returned.
"""

from __future__ import annotations

import math

from rungwise.contact.solvers.space.measure import Island, Point, measure
from rungwise.contact.solvers.space.newton import Steps, evaluate, find_step, move, prepare
from rungwise.contact.solvers.space.sweeps import Answers, accelerate, sweep
from rungwise.kernel import inner_kernel, kernel

_STEPS = 8
"""Most Newton steps of a subproblem; chosen by trial."""
_SETTLED = 0.1
"""Map of a solved subproblem, over the map at its centre. Chosen by trial."""
_FIRST, _LIGHTER, _HEAVIER = 30.0, 0.7, 10.0
"""The first proportion, and factors on it after success and failure; chosen by trial."""
_LEAST, _MOST = 1e-11, 0.1
"""Least and most yield of forces, over the yield of bodies and contact; chosen by trial, to a decade."""
_SWEEPS = 8
"""Sweeps where the heaviest subproblem ends on a kink; chosen by trial."""
_WINDOW, _STALLED = 12, 0.5
"""The method ends where the least residual is above this share of its value so many subproblems earlier.
Chosen by trial."""


@kernel
def approach(
    island: Island, answers: Answers, tol: float, most: int, point: Point, trial: Point, steps: Steps
) -> float:
    """Move the point in up to so many subproblems until its residual is within `tol`; returns the
    residual."""
    found = residual_at(island, point, steps)
    least, earlier, proportion = found, math.inf, _FIRST
    for done in range(most):
        if found <= tol or not found < math.inf or island.halt[0] != 0:
            break
        if done % _WINDOW == 0:
            if least > _STALLED * earlier:
                break
            earlier = least
        hold = min(max(proportion * found, _LEAST), _MOST)
        groups, span = island.groups, island.span
        for r in range(groups.row[span.first], groups.row[span.last]):
            steps.centre[r] = point.x[r]
        goal = _SETTLED * evaluate(island, 0.0, point, steps)
        solved = _settle(island, hold, goal, point, trial, steps)
        found = residual_at(island, point, steps)
        least = min(least, found)
        proportion *= _LIGHTER if solved else _HEAVIER
        if not solved and hold >= _MOST:
            sweep(island, answers, _SWEEPS, point, steps.dx)
            accelerate(island, point)
            found = residual_at(island, point, steps)
            least, proportion = min(least, found), _FIRST
    return found


@kernel
def _settle(island: Island, hold: float, goal: float, point: Point, start: Point, steps: Steps) -> bool:
    """Solve the subproblem by whole Newton steps until its map is within `goal`, and return whether it is:
    the map may grow on the way, since contacts that change between sticking, slipping and open have far to
    go. Where it has not fallen in the end the point is where it was."""
    put(island, point, start)
    first = size = evaluate(island, hold, point, steps)
    for _ in range(_STEPS):
        if not prepare(island, 0.0, hold, steps):
            break
        find_step(island, point, steps)
        move(island, point, 1.0, steps, point)
        size = evaluate(island, hold, point, steps)
        if size <= goal:
            return True
        if not size < math.inf:
            break
    if not size <= first:
        put(island, start, point)
    return False


@inner_kernel
def put(island: Island, source: Point, target: Point) -> None:
    """Copy velocities and forces."""
    groups, span = island.groups, island.span
    for i in range(span.low, span.high):
        target.v[i] = source.v[i]
    for r in range(groups.row[span.first], groups.row[span.last]):
        target.x[r] = source.x[r]


@inner_kernel
def residual_at(island: Island, point: Point, steps: Steps) -> float:
    """The island's residual at the point, whose rates are computed anew."""
    evaluate(island, 0.0, point, steps)
    return float(measure(island, point, steps.dv))
