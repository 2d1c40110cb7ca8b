"""The contact solver: the proximal point method outside, Newton's method on the natural map inside.

Algorithm: of a start, Newton's method first takes the active set that its forces tell; then come proximal
problems, each about the answer of the one before, until the residual, which is the judge's, is within the
goal. Rest by the forces given is judged before. Near an answer, where the residual falls no more, forces
alone are held: beside large forces and rates it does not tell what the term keeps of the velocities of light
bodies, or of small rates. The map looks ahead with force over rate of the iterate, as the judge measures
both, so that neither is lost beside the other; where a start leads nowhere, with those of the problem, loads
over demanded rates. Then it starts from the end of a path: projections are smoothed, less and less, about
the last point of the path.
Sources: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375; Rockafellar, SIAM J. Control
Optim. 14 (1976) 877-898; Chen and Harker, SIAM J. Matrix Anal. Appl. 14 (1993) 1168-1190 (the path).
Accepts: H positive definite. Promises: the least residual met, computed from the problem.
"""

from __future__ import annotations

import math

from rungwise.contact.kinds import cone, interval, restricts_rates
from rungwise.contact.solver.groups import Groups
from rungwise.contact.solver.newton import Room, descend, evaluate
from rungwise.contact.solver.residual import called, residual
from rungwise.contact.solver.settings import (
    CHANGE,
    CORRECTIONS,
    ENOUGH,
    FASTER,
    FINEST,
    GIVEN,
    GOAL,
    GUESS,
    GUESSES,
    HELD,
    LEAST,
    LENGTHS,
    MOST,
    NOTHING,
    PATH,
    PROBLEMS,
    ROUNDING,
    SHORT,
    SLOW,
    SLOWER,
    SMOOTH,
    STARTS,
    STEPS,
    WEDGED,
    WEIGHT,
)
from rungwise.contact.step.status import TOLERANCE
from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel

BY_ITERATE, BY_PROBLEM = 0, 1
"""Whose force over rate the map looks ahead with."""


@kernel
def rests(g: Groups, x: Reals, v: Reals, room: Room) -> bool:
    """Whether all things rest by the forces x (rows,), with the residual in least (1,): velocities v (n,) are
    zero then, and as they were elsewhere. Where all contacts yield, a rate that is rounding of the problem
    counts as `NOTHING`: what they yield by is known to the rounding of places alone; and so does momentum,
    where things would go on with velocities that are such rates."""
    noise = g.noise[0]
    copy(v, room.first_v)
    _clear(v)
    found = room.least[0] = measure(g, x, v, room)
    if NOTHING < found <= ENOUGH and _all_yield(g):
        g.noise[0] = noise / NOTHING
        found = measure(g, x, v, room)
        g.noise[0] = noise
    if found <= NOTHING:
        return True
    copy(room.first_v, v)
    if found <= ENOUGH and _all_yield(g) and _drifts(g, v) and measure(g, x, v, room) <= NOTHING:
        _clear(v)
        return True
    return False


@kernel
def _drifts(g: Groups, v: Reals) -> bool:
    """Whether no contact moves at these velocities by more than rounding."""
    for k in range(len(g.kind)):
        at = g.entry[k]
        for r in range(g.row[k], g.row[k + 1]):
            rate = 0.0
            for e in range(g.first[k], g.first[k + 1]):
                rate += g.W[at] * v[g.column[e]]
                at += 1
            if abs(rate) * g.rate[r] > g.noise[0]:
                return False
    return True


@inner_kernel
def _all_yield(g: Groups) -> bool:
    """Whether there are contacts, and all yield."""
    contacts, yields = 0, True
    for k in range(len(g.kind)):
        if g.kind[k] == cone.KIND:
            contacts, yields = contacts + 1, yields and g.R[k, 0, 0] > 0.0
    return yields and contacts > 0


@kernel
def solve(g: Groups, x: Reals, v: Reals, room: Room, halt: Ints, count: Ints) -> float:
    """Solve, where not all things rest, from forces x (rows,) and velocities v (n,), into these; returns the
    least residual met, earlier when halt (1,) is set. An answer within the tolerance is the last that is
    measured. count (4,): Newton steps, proximal problems, starts before the last; and Newton steps at
    most."""
    copy(x, room.first_x)
    copy(v, room.first_v)
    room.least[0] = math.inf
    for start in range(STARTS):
        if room.least[0] <= TOLERANCE or _ends(halt, count):
            break
        count[2] = start
        by = BY_ITERATE if start % 3 == 0 else BY_PROBLEM
        if start < GIVEN:
            copy(room.first_x, x)
            copy(room.first_v, v)
        else:
            _clear(x)
            _clear(v)
            _follow(g, by, x, v, room, halt, count)
        _approach(g, by, start == 0, x, v, room, halt, count)
    copy(room.best_x, x)
    copy(room.best_v, v)
    if room.least[0] <= TOLERANCE:
        found = _rest(g, x, v, room, halt, count)
        if found <= NOTHING:
            return float(found)
        copy(room.best_x, x)
        copy(room.best_v, v)
    if room.least[0] <= TOLERANCE and _calm(g, x, v, room):
        found = measure(g, x, v, room)
        if found <= max(room.least[0], ENOUGH):
            return float(found)
        copy(room.best_v, v)
        measure(g, x, v, room)
    return float(room.least[0])


@kernel
def _rest(g: Groups, x: Reals, v: Reals, room: Room, halt: Ints, count: Ints) -> float:
    """Let all things rest, if the best answer is near to rest, under the forces nearest to its own that
    balance; where the start had no forces, without friction, or with little. Returns the residual."""
    _clear(v)
    found = measure(g, x, v, room)
    if found > SLOW:
        return float(found)
    if _greatest(room.first_x) == 0.0:
        friction = room.first_x
        _press_alone(g, x)
        _take_friction(g, friction)
        _balance(g, x, v, room, halt, count)
        _give_friction(g, friction)
        found = measure(g, x, v, room)
        if found <= NOTHING:
            return float(found)
        copy(room.best_x, x)
        _press_alone(g, x)
        _balance(g, x, v, room, halt, count)
        found = measure(g, x, v, room)
        if found <= NOTHING:
            return float(found)
        copy(room.best_x, x)
        found = measure(g, x, v, room)
    if found > NOTHING:
        _balance(g, x, v, room, halt, count)
        found = measure(g, x, v, room)
    return float(found)


@kernel
def _balance(g: Groups, x: Reals, v: Reals, room: Room, halt: Ints, count: Ints) -> None:
    """Let the nearest forces balance with all things at rest, where groups keep their pieces."""
    for k in range(len(g.kind)):
        room.pace[k] = 1.0
    _clear(room.hold)
    _clear(room.centre_v)
    least = math.inf
    for _ in range(CORRECTIONS):
        copy(x, room.centre_x)
        size = evaluate(g, GUESS, 0.0, x, v, room.centre_x, room.centre_v, room)
        descend(g, GUESS, 0.0, 1, 1, 0.0, size, x, v, room.centre_x, room.centre_v, room, halt, count)
        _clear(v)
        found = measure(g, x, v, room)
        if found <= NOTHING or not found < 0.5 * least:
            break
        least = found


@kernel
def _press_alone(g: Groups, x: Reals) -> None:
    """Let contacts have no force but the normal one."""
    for k in range(len(g.kind)):
        if g.kind[k] == cone.KIND:
            for r in range(g.row[k] + 1, g.row[k + 1]):
                x[r] = 0.0


@kernel
def _take_friction(g: Groups, kept: Reals) -> None:
    """Keep the friction of contacts in `kept` (rows,), and let there be none."""
    for k in range(len(g.kind)):
        if g.kind[k] == cone.KIND:
            kept[g.row[k]], g.law[k, 0] = g.law[k, 0], 0.0


@kernel
def _give_friction(g: Groups, kept: Reals) -> None:
    """Undo `_take_friction`."""
    for k in range(len(g.kind)):
        if g.kind[k] == cone.KIND:
            g.law[k, 0], kept[g.row[k]] = kept[g.row[k]], 0.0


@inner_kernel
def _resisted(g: Groups, i: int, v: Reals) -> float:
    """The most that velocity i does in a row of balance."""
    most = 0.0
    for e in range(g.H_first[i], g.H_first[i + 1]):
        most = max(most, abs(g.H[e]))
    return most * abs(v[i])


@kernel
def _calm(g: Groups, x: Reals, v: Reals, room: Room) -> bool:
    """Let velocities be zero that are nothing in any rate and any balance: where next to nothing resists a
    motion that changes no contact, it is rounding. Returns whether some are."""
    measure(g, x, v, room)
    forces, rates = room.scale[0], room.scale[1]
    seen, calmed = room.vt, False
    for i in range(len(v)):
        seen[i] = 0.0
    for k in range(len(g.kind)):
        at = g.entry[k]
        for r in range(g.row[k], g.row[k + 1]):
            for e in range(g.first[k], g.first[k + 1]):
                seen[g.column[e]] = max(seen[g.column[e]], abs(g.W[at]) * g.rate[r])
                at += 1
    for i in range(len(v)):
        nothing = _resisted(g, i, v) <= NOTHING * room.lever[i] * forces
        if v[i] != 0.0 and nothing and seen[i] * abs(v[i]) <= NOTHING * rates:
            v[i], calmed = 0.0, True
    return calmed


@kernel
def measure(g: Groups, x: Reals, v: Reals, room: Room) -> float:
    """The residual; inf where forces exceed by far what the problem calls for."""
    if not _excess(g, x, room.lever) <= WEDGED:
        return math.inf
    return residual(g, v, x, room.y, room.G, room.lever, room.a, room.b, room.scale)


@kernel
def _excess(g: Groups, x: Reals, lever: Reals) -> float:
    """Greatest force over the greatest that the problem calls for; where hardly anything resists a body that
    others press, over loads and limits, as forces, if that is less."""
    greatest, most = _greatest(x), called(g)
    excess = greatest / most if greatest > 0.0 else 0.0
    if excess <= WEDGED:
        return excess
    greatest, load = 0.0, _load(g, lever)
    for r in range(len(x)):
        greatest = max(greatest, abs(x[r]) * g.force[r])
    return min(excess, greatest / load) if load > 0.0 else excess


@kernel
def _load(g: Groups, lever: Reals) -> float:
    """Greatest force that a load or a limit calls for."""
    load = 0.0
    _clear(lever)
    for k in range(len(g.kind)):
        at = g.entry[k]
        if g.kind[k] == interval.KIND and g.law[k, 1] < math.inf:
            load = max(load, g.law[k, 1] * g.force[g.row[k]])
        for r in range(g.row[k], g.row[k + 1]):
            for e in range(g.first[k], g.first[k + 1]):
                lever[g.column[e]] = max(lever[g.column[e]], abs(g.C[at]) / g.force[r])
                at += 1
    for i in range(len(g.c)):
        if lever[i] > 0.0:
            load = max(load, abs(g.c[i]) / lever[i])
    return load


@kernel
def _note(g: Groups, x: Reals, v: Reals, room: Room) -> float:
    """Measure an answer, and keep it if none was better; returns the residual."""
    found = measure(g, x, v, room)
    if found < max(room.least[0], GOAL) or room.least[0] == math.inf:
        room.least[0] = found
        copy(x, room.best_x)
        copy(v, room.best_v)
    return found


@kernel
def set_pace(g: Groups, by: int, room: Room) -> None:
    """Let the map look ahead with force over rate: those that the last answer was measured against, or those
    of the problem; where one is missing, with one over the yield of each group. Velocities are held as
    forces are."""
    ratio = _demanded(g, room.lever) if by == BY_PROBLEM else 0.0
    if by == BY_ITERATE and room.scale[0] > 0.0 and room.scale[1] > 0.0:
        ratio = room.scale[0] / room.scale[1]
    _clear(room.hold)
    for k in range(len(g.kind)):
        first, at = g.row[k], g.entry[k]
        room.pace[k] = ratio * g.rate[first] / g.force[first] if ratio > 0.0 else 1.0
        for _ in range(first, g.row[k + 1]):
            for e in range(g.first[k], g.first[k + 1]):
                i = g.column[e]
                room.hold[i] = max(room.hold[i], room.pace[k] * abs(g.C[at] * g.W[at]))
                at += 1


@kernel
def _demanded(g: Groups, lever: Reals) -> float:
    """Force that loads and limits call for over the rates that are demanded; 0 where there is none."""
    load, rate = _load(g, lever), g.noise[0]
    for k in range(len(g.kind)):
        for r in range(g.row[k], g.row[k + 1] if restricts_rates(g.kind[k], g.law[k]) else g.row[k]):
            rate = max(rate, abs(g.w[r]) * g.rate[r])
    return load / rate if load > 0.0 and rate > 0.0 else 0.0


@kernel
def _approach(
    g: Groups, by: int, warm: bool, x: Reals, v: Reals, room: Room, halt: Ints, count: Ints
) -> None:
    """The proximal point method from (x, v); `bare`: forces alone are held."""
    least, found = _note(g, x, v, room), 0.0
    weight, held, falls, bare, tried = WEIGHT, 0, True, False, False
    set_pace(g, by, room)
    for problem in range(PROBLEMS):
        stalls = problem > 0 and (room.least[0] <= GOAL or not falls)
        if stalls and not tried and room.least[0] <= TOLERANCE:
            # The last weight may have been too little for redundant forces; the one before was not.
            bare, tried, weight = True, True, min(weight / CHANGE**2, WEIGHT)
            copy(room.best_x, x)
            copy(room.best_v, v)
        elif stalls and room.least[0] <= ENOUGH:
            break
        elif stalls and bare:
            bare = False
            set_pace(g, by, room)
        if _ends(halt, count):
            break
        guess = problem == 0 and warm
        if guess:  # forces alone are those of a step before
            bare, weight = True, GUESS
        if bare:
            _clear(room.hold)
        diverged = found == math.inf
        found, solved = _solve_about(g, weight, guess, x, v, room, halt, count)
        if diverged and found == math.inf:
            break
        if guess:
            bare, tried = False, room.least[0] <= ENOUGH
        if not solved:
            if weight >= MOST:
                break
            if guess:
                set_pace(g, by, room)
            weight, held, falls = WEIGHT if guess else min(weight / CHANGE, MOST), HELD, False
            continue
        falls = found < 0.5 * least
        least = found if falls else least
        if room.least[0] <= GOAL and tried:
            break
        if guess and room.least[0] > ENOUGH:
            weight = CHANGE * WEIGHT
        elif held == 0:
            weight = max(CHANGE * weight, LEAST)
        held = max(held - 1, 0)
        if by == BY_ITERATE:
            set_pace(g, by, room)


@kernel
def _solve_about(
    g: Groups,
    weight: float,
    guess: bool,
    x: Reals,
    v: Reals,
    room: Room,
    halt: Ints,
    count: Ints,
) -> tuple[float, bool]:
    """Solve the proximal problem about (x, v), into these: by whole steps, and where these cycle with a line
    search. Returns the residual, and whether the map is solved; else (x, v) are as they were. What is solved
    is what was measured last."""
    xc, vc = room.centre_x, room.centre_v
    count[1] += 1
    copy(x, xc)
    copy(v, vc)
    before = evaluate(g, weight, 0.0, x, v, xc, vc, room)
    size = math.sqrt(before)
    goal = max(0.01 * min(weight, 1.0) * size, ROUNDING * max(1.0, _greatest(x)))
    enough = max(goal, 0.1 * size)
    steps = GUESSES if guess else STEPS
    reached = descend(g, weight, 0.0, 1, steps, goal, before, x, v, xc, vc, room, halt, count)
    if not guess and not reached <= enough:
        copy(xc, x)
        copy(vc, v)
        before = evaluate(g, weight, 0.0, x, v, xc, vc, room)
        reached = descend(g, weight, 0.0, LENGTHS, steps, goal, before, x, v, xc, vc, room, halt, count)
    found = _note(g, x, v, room)
    solved = found <= ENOUGH or reached <= enough
    if not solved:
        copy(xc, x)
        copy(vc, v)
    return found, solved


@kernel
def _follow(g: Groups, by: int, x: Reals, v: Reals, room: Room, halt: Ints, count: Ints) -> None:
    """Follow the smoothed map from (x, v), from much to hardly any smoothing, into these."""
    xc, vc = room.centre_x, room.centre_v
    measure(g, x, v, room)
    set_pace(g, by, room)
    copy(x, xc)
    copy(v, vc)
    smooth = last = SMOOTH
    factor = FASTER
    for problem in range(PATH):
        if _ends(halt, count):
            break
        goal = 0.1 * smooth
        size = evaluate(g, LEAST, smooth, x, v, xc, vc, room)
        if descend(g, LEAST, smooth, LENGTHS, SHORT, goal, size, x, v, xc, vc, room, halt, count) <= smooth:
            copy(x, xc)
            copy(v, vc)
            if smooth <= FINEST:
                break
            last, smooth, factor = smooth, smooth * factor, max(0.8 * factor, CHANGE)
            continue
        copy(xc, x)
        copy(vc, v)
        if problem == 0:
            last = smooth = SMOOTH / CHANGE
        elif factor > SLOWER:
            break
        else:
            factor = math.sqrt(factor)
            smooth = last * factor


@inner_kernel
def _ends(halt: Ints, count: Ints) -> bool:
    return bool(halt[0] != 0 or count[0] >= count[3])


@inner_kernel
def _greatest(a: Reals) -> float:
    greatest = 0.0
    for i in range(len(a)):
        greatest = max(greatest, abs(a[i]))
    return greatest


@inner_kernel
def _clear(a: Reals) -> None:
    for i in range(len(a)):
        a[i] = 0.0
