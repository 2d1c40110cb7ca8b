"""The limit surface of a given pressure, in place of the ellipsoid that approximates it.

A load that rests on spots with the parts w_i (their sum is 1) and the velocities J_i u dissipates
F P(u), P(u) = sum w_i |J_i u|, and friction is the force of the greatest dissipation, -F times the gradient.
About a motion u_k the ellipsoid u^T Q u, Q = P(u_k) sum w_i / |J_i u_k| J_i^T J_i, gives the same force and
nowhere less dissipation (Cauchy and Schwarz). So a step is solved with such ellipsoids (`limit_surface`) in
turn, each about the motion before it, until the force of the ellipsoid is that of the pressure. Where a body
sticks, its force is looked for a motion d that it would drive, f . d > P(d), by the same majorants. Source:
Goyal, Ruina, Papadopoulos, Wear 143 (1991) 307-330 (limit surface); Weiszfeld, Tohoku Math. J. 43 (1937)
355-386 (the iteration).
"""

from __future__ import annotations

import math

from rungwise.contact.step import NO_SOLUTION, SOLVED, STICK, ContactProblem, Sizes
from rungwise.kernel import Reals, inner_kernel, kernel, rare_kernel
from rungwise.simulation.core.chains import solve_scratch
from rungwise.simulation.core.state import Scratch, State
from rungwise.system.terms import Terms

ROW, COS, SIN, RATIO, EDGE, LAST, SPOT, END, LINE, SHARE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
"""Columns of `terms.exact`."""
FACTOR, FORCE, MOTION, OFFSET = 0, 9, 12, 15
"""Places in a row of `scratch.ellipsoid`: the factor L of Q = L L^T, force over F, motion, and rates at rest
of its three rows."""
ROUNDED = 1e-13
"""Rounding of a speed, over the speed of the fastest surface: a surface far slower knows its direction less
well, and its law is met as far as that. Chosen by trial, to a decade."""
VAGUE = 1e-6
"""Greatest distance that rounding excuses."""
TURNS = 500
"""Ellipsoids after which a law counts as not met."""
MET = 1e-8
"""Distance of the force from that of the pressure, over the greatest, up to which the law is met."""
FAR = 30.0
"""Distance of the place about which a body turns, over `RATIO`, from which on spots stand for the load."""
THIN = 1e-12
"""Distance of that place from a loaded edge, over the edge's length, below which it counts as that."""
SLOWEST = 1e-12
"""Speed of a spot over the mean of all, below which it counts as that: a spot about which a body turns."""


@rare_kernel
def solve_exact(
    sizes: Sizes, terms: Terms, state: State, scratch: Scratch, problem: ContactProblem
) -> tuple[int, float, int]:
    """Solve the assembled problem as `solve_scratch`, with the limit surfaces of `terms.exact`."""
    _begin(terms, state, scratch, problem)
    status, found, stage = NO_SOLUTION, math.inf, 0
    for _ in range(TURNS):
        _take_ellipsoids(sizes, terms, state, scratch, problem)
        status, found, stage = solve_scratch(problem, sizes, terms, scratch, True)
        if status != SOLVED:
            break
        apart, met = _compare(sizes, terms, state, scratch)
        if met:
            found = max(found, apart)
            break
        status = NO_SOLUTION
    if status == SOLVED:
        _give_back(terms, scratch)
    return status, found, stage


@kernel
def _begin(terms: Terms, state: State, scratch: Scratch, problem: ContactProblem) -> None:
    """Keep the rows, and begin with the ellipsoids about the motion before the step; about none where there
    was none."""
    for m in range(terms.exact.shape[0]):
        row, own = int(terms.exact[m, ROW]), scratch.ellipsoid[m]
        for i in range(3 if row >= 0 else 0):
            own[OFFSET + i] = own[MOTION + i] = problem.w_s[row + i]
            for j in range(state.v.shape[0]):
                if not state.prescribed[j]:
                    own[MOTION + i] += terms.limited[row + i, j] * state.v[j]
        if row >= 0 and not _shape(m, terms, own):
            own[FACTOR:FORCE] = 0.0
            own[FACTOR] = own[FACTOR + 4] = own[FACTOR + 8] = 1.0


@kernel
def _take_ellipsoids(
    sizes: Sizes, terms: Terms, state: State, scratch: Scratch, problem: ContactProblem
) -> None:
    """Let the rows of each surface be those in which its ellipsoid is a ball."""
    for m in range(terms.exact.shape[0]):
        row, own = int(terms.exact[m, ROW]), scratch.ellipsoid[m]
        for j in range(3 if row >= 0 else 0):
            problem.w_s[row + j] = 0.0
            for c in range(sizes.n):
                problem.S[row + j, c] = 0.0
            for i in range(j, 3):
                part = own[FACTOR + 3 * i + j]
                problem.w_s[row + j] += part * own[OFFSET + i]
                for c in range(sizes.n):
                    problem.S[row + j, c] += part * terms.limited[row + i, state.free[c]]


@kernel
def _give_back(terms: Terms, scratch: Scratch) -> None:
    """Give forces back in the directions that rows had."""
    for m in range(terms.exact.shape[0]):
        row = int(terms.exact[m, ROW])
        for i in range(3 if row >= 0 else 0):
            scratch.limited_force[row + i] = terms.limit[row + i] * scratch.ellipsoid[m, FORCE + i]


@kernel
def _compare(sizes: Sizes, terms: Terms, state: State, scratch: Scratch) -> tuple[float, bool]:
    """How far forces are from those of the pressures, and whether all laws are met; where one is not, the
    ellipsoid about its motion takes the place of the one before."""
    worst, met = 0.0, True
    for m in range(terms.exact.shape[0]):
        row, own = int(terms.exact[m, ROW]), scratch.ellipsoid[m]
        if row < 0:
            continue
        size = 0.0
        for i in range(3):
            own[FORCE + i], own[MOTION + i] = 0.0, own[OFFSET + i]
            for j in range(i + 1):
                tau = scratch.limited_force[row + j] / terms.limit[row + j]
                own[FORCE + i] += own[FACTOR + 3 * i + j] * tau
            for j in range(sizes.n):
                own[MOTION + i] += terms.limited[row + i, state.free[j]] * scratch.x[j]
            size += own[MOTION + i] ** 2
        if scratch.mode[sizes.contacts + row] != STICK:
            noise = ROUNDED * _fastest(sizes, scratch) / math.sqrt(size) if size > 0.0 else math.inf
            apart, holds = _follow(m, noise, terms, own)
            worst, met = max(worst, apart), met and holds
        elif not _holds(m, terms, own):
            met = False
            _shape(m, terms, own)
    return worst, met


@kernel
def _fastest(sizes: Sizes, scratch: Scratch) -> float:
    fastest = 0.0
    for j in range(sizes.n):
        fastest = max(fastest, abs(scratch.x[j]))
    return fastest


@kernel
def _measure(m: int, terms: Terms, own: Reals) -> tuple[float, float, float, float, float]:
    """P at the motion, and its matrix sum w_i / |J_i u| J_i^T J_i: of the sliding part (the same along both
    axes), of both with turning, and of turning. Lengths are over `RATIO`."""
    x, y, turn = own[MOTION], own[MOTION + 1], own[MOTION + 2]
    if terms.exact[m, LAST] > terms.exact[m, EDGE] and x * x + y * y < FAR * FAR * turn * turn:
        return _by_edges(terms.exact[m], terms.edges, -y / turn, x / turn, abs(turn))
    power, slide, along, across, spin = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(int(terms.exact[m, SPOT]), int(terms.exact[m, END])):
        a, b = _turned(terms.spots[k, 0], terms.spots[k, 1], terms.exact[m])
        power += terms.spots[k, 2] * math.hypot(x - turn * b, y + turn * a)
    for k in range(int(terms.exact[m, SPOT]), int(terms.exact[m, END])):
        a, b = _turned(terms.spots[k, 0], terms.spots[k, 1], terms.exact[m])
        part = terms.spots[k, 2] / max(math.hypot(x - turn * b, y + turn * a), SLOWEST * power)
        slide, along, across = slide + part, along - part * b, across + part * a
        spin += part * (a * a + b * b)
    return power, slide, along, across, spin


@inner_kernel
def _turned(x: float, y: float, exact: Reals) -> tuple[float, float]:
    """A place from the centre of pressure, in the axes of the world, over `RATIO`."""
    return (exact[COS] * x - exact[SIN] * y) / exact[RATIO], (exact[SIN] * x + exact[COS] * y) / exact[RATIO]


@kernel
def _by_edges(
    exact: Reals, edges: Reals, at: float, on: float, turn: float
) -> tuple[float, float, float, float, float]:
    """As `_measure`, in a turn about (at, on): integrals of 1 / r, the unit vector and r from there."""
    near, one, two, far = 0.0, 0.0, 0.0, 0.0
    for k in range(int(exact[EDGE]), int(exact[LAST])):
        a, b = _turned(edges[k, 0], edges[k, 1], exact)
        c, d = _turned(edges[k, 2], edges[k, 3], exact)
        length = math.hypot(c - a, d - b)
        if not length > 0.0:
            continue
        along_a, along_b = (c - a) / length, (d - b) / length
        away = (a - at) * along_b - (b - on) * along_a
        begin = (a - at) * along_a + (b - on) * along_b
        end, off = begin + length, max(abs(away), THIN * length)
        slope = math.asinh(end / off) - math.asinh(begin / off)
        first, last = math.hypot(begin, away), math.hypot(end, away)
        swept = end * last - begin * first + away * away * slope
        if exact[LINE] > 0.0:
            near, far = near + slope, far + 0.5 * swept
            one += along_b * away * slope + along_a * (last - first)
            two += along_b * (last - first) - along_a * away * slope
        else:
            near, far = near + away * slope, far + away * swept / 6.0
            one, two = one + 0.5 * along_b * swept, two - 0.5 * along_a * swept
    near, one, two, far = (exact[SHARE] * near, exact[SHARE] * one, exact[SHARE] * two, exact[SHARE] * far)
    spin = far + 2.0 * (at * one + on * two) + (at * at + on * on) * near
    return turn * far, near / turn, -(two + on * near) / turn, (one + at * near) / turn, spin / turn


@kernel
def _shape(m: int, terms: Terms, own: Reals) -> bool:
    """Set the factor of the ellipsoid about the motion; False without motion."""
    if own[MOTION] == 0.0 and own[MOTION + 1] == 0.0 and own[MOTION + 2] == 0.0:
        return False
    power, slide, along, across, spin = _measure(m, terms, own)
    return _set(power, slide, along, across, spin, own)


@kernel
def _set(power: float, slide: float, along: float, across: float, spin: float, own: Reals) -> bool:
    root = math.sqrt(power * slide)
    own[FACTOR:FORCE] = 0.0
    own[FACTOR] = own[FACTOR + 4] = root
    own[FACTOR + 6], own[FACTOR + 7] = power * along / root, power * across / root
    own[FACTOR + 8] = math.sqrt(max(power * (spin - (along * along + across * across) / slide), 0.0))
    return math.isfinite(root) and math.isfinite(own[FACTOR + 8])


@kernel
def _follow(m: int, noise: float, terms: Terms, own: Reals) -> tuple[float, bool]:
    """Distance of the force from that of the pressure at the motion, and whether it is met, to rounding of
    the motion; if not, the ellipsoid is the one about that motion."""
    power, slide, along, across, spin = _measure(m, terms, own)
    x, y, turn = own[MOTION], own[MOTION + 1], own[MOTION + 2]
    apart = math.sqrt(
        (own[FORCE] + slide * x + along * turn) ** 2
        + (own[FORCE + 1] + slide * y + across * turn) ** 2
        + (own[FORCE + 2] + along * x + across * y + spin * turn) ** 2
    )
    met = apart <= MET + min(noise, VAGUE)
    if not met:
        _set(power, slide, along, across, spin, own)
    return apart, met


@kernel
def _holds(m: int, terms: Terms, own: Reals) -> bool:
    """Whether the pressure can give the force: whether no motion is found against which it dissipates more.
    One that is found is left as the motion."""
    f, g, t = -own[FORCE], -own[FORCE + 1], -own[FORCE + 2]
    if f == 0.0 and g == 0.0 and t == 0.0:
        return True
    own[MOTION], own[MOTION + 1], own[MOTION + 2] = f, g, t
    least = math.inf
    for _ in range(TURNS):
        power, slide, along, across, spin = _measure(m, terms, own)
        done = f * own[MOTION] + g * own[MOTION + 1] + t * own[MOTION + 2]
        if done > power * (1.0 + MET):
            return False
        if done > 0.0 and power / done >= least * (1.0 - 0.1 * MET):
            return True
        least = power / done if done > 0.0 else math.inf
        rest = spin - (along * along + across * across) / slide
        turn = (t - (along * f + across * g) / slide) / rest if rest > 0.0 else 0.0
        x, y = (f - along * turn) / slide, (g - across * turn) / slide
        done = f * x + g * y + t * turn
        own[MOTION], own[MOTION + 1], own[MOTION + 2] = x / done, y / done, turn / done
    return True
