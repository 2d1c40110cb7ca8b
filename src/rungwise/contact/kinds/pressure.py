"""A force in the limit surface of a pressure: friction of a support, by Coulomb's law at each of its points.

Where the load w, of sum 1, moves at J u, it dissipates r P(u), P(u) = sum w |J u|, and friction is in r K,
K = {f : f . u <= P(u) for all u}. By Moreau, the projection on r K is what the proximal map of r P leaves of
a force z: z = h d + r grad P(d), |d| = 1, where the greatest value h of z . d - r P(d) is positive; else z
is in r K, which the greatest value of z . d / P(d) tells. Newton's method on the sphere finds either. A load
on a few points needs no such group: each point is a ball.

law = (r, cosine and sine of the angle of the body, first of its numbers): from there on `HEAD` numbers, then
edges that bound the loaded area, or are loaded themselves, as x and y of their beginning, their direction
and length, then spots that stand for the load, as x, y and part, all from the centre of pressure in the
body's axes, over the mean distance of the load from there. Rows are x, y and the angle times this distance.
P has a closed form along straight edges: in a turn about p, it, its gradient and its Hessian are integrals of
the distance from p, of the unit vector e from there, and of e e^T over the distance. Where p is far, these
cancel, and spots stand for the load.

Sources: Goyal, Ruina, Papadopoulos, Wear 143 (1991) 307-330 (limit surface); Moreau, Bull. Soc. Math. France
93 (1965) 273-299; Dinkelbach, Management Science 13 (1967) 492-498 (the ratio).
"""

from __future__ import annotations

import math

from rungwise.contact.step.modes import FORWARD, STICK
from rungwise.kernel import Reals, inner_kernel, kernel

KIND = 5
RADIUS, COS, SIN, BEGIN = 0, 1, 2, 3
"""Numbers of the law."""
LINE, SHARE, REACH, EDGES, SPOTS = 0, 1, 2, 3, 4
"""Numbers of a pressure: 1 where edges are loaded, 0 where they bound the area that is; 1 over their length
or area; the greatest distance of an edge's end; how many edges and spots there are."""
HEAD, EDGE, SPOT = 5, 5, 3
"""How many numbers these are, and those of an edge, and of a spot."""
FAR = 20.0
"""Distance of the place about which a body turns, over the reach of the load, from which on spots stand for
it."""
THIN = 1e-12
"""Distance of that place from a loaded edge, over the edge's length, below which it counts as that."""
INNER = 0.4
"""Radius of a ball in K. P(u) is at least the speed v of the centre of pressure, and at least the speed t of
turning less v: so K has the ball of radius 1 / sqrt(5), less what polygons cut off arcs."""
TURNS = 40
"""Steps of Newton's method, at most."""
HALVES = 30
"""Halves of a step, at most."""
ROUNDED, NEAR = 1e-15, 1e-8
"""Size of the equation, over the force, that is rounding, and from which on one more step leaves no more."""
CLOSE = 0.03
"""Size of the equation, over the force, up to which the search begins along a motion without a look at
others. Any number leads to the same forces."""

Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float]
"""Symmetric, row by row from the diagonal on."""
Found = tuple[float, Vector, Matrix]
"""P, its gradient and its Hessian."""


@kernel
def natural_map(law: Reals, numbers: Reals, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`; of three rows."""
    z = _turned(law[COS], -law[SIN], (x[0] - u[0], x[1] - u[1], x[2] - u[2]))
    way = _turned(law[COS], -law[SIN], (-u[0], -u[1], -u[2]))
    beyond, d, hessian = _nearest(law, numbers, law[RADIUS], z, way)
    away = _turned(law[COS], law[SIN], d)
    for i in range(3):
        F[i] = u[i] + beyond * away[i]
        for j in range(3):
            S[i, j] = 1.0 if i == j else 0.0
    if beyond == 0.0:
        return STICK
    _slope(law, beyond, d, hessian, S)
    return FORWARD


@kernel
def violation(law: Reals, numbers: Reals, unit: float, x: Reals, y: Reals) -> float:
    """See `kinds.violation`; of three rows."""
    z = _turned(law[COS], -law[SIN], (x[0] - y[0], x[1] - y[1], x[2] - y[2]))
    way = _turned(law[COS], -law[SIN], (-y[0], -y[1], -y[2]))
    beyond, d, _ = _nearest(law, numbers, unit * law[RADIUS], z, way)
    out = _turned(law[COS], law[SIN], d)
    return math.sqrt(
        (y[0] + beyond * out[0]) ** 2 + (y[1] + beyond * out[1]) ** 2 + (y[2] + beyond * out[2]) ** 2
    )


@inner_kernel
def _turned(c: float, s: float, a: Vector) -> Vector:
    """A vector whose first two numbers are turned by the angle of this cosine and sine."""
    return c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]


@kernel
def _nearest(
    law: Reals, numbers: Reals, radius: float, z: Vector, way: Vector
) -> tuple[float, Vector, Matrix]:
    """The distance h of z (3,) from r K, the direction d from there, and the Hessian of P at d; h is zero
    where z is in r K. The search begins against the rates, along `way` (3,), which is the direction where
    the law is met, or else along z, as for a ball."""
    table, size, pace = numbers[int(law[BEGIN]) :], math.sqrt(_dot(z, z)), math.sqrt(_dot(way, way))
    if not 0.0 < size < math.inf:
        return 0.0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    along = pace > 0.0
    d = (way[0] / pace, way[1] / pace, way[2] / pace) if along else (z[0] / size, z[1] / size, z[2] / size)
    found = dissipation(table, d)
    gained, beyond, force, lack = _stand(radius, z, d, found)
    if along and not (force > 0.0 and _dot(lack, lack) <= (CLOSE * size) ** 2):
        there = (z[0] / size, z[1] / size, z[2] / size)
        at = dissipation(table, there)
        gain, far, own, rest = _stand(radius, z, there, at)
        if gain > gained:
            d, found, gained, beyond, force, lack = there, at, gain, far, own, rest
    for _ in range(TURNS):
        off = math.sqrt(_dot(lack, lack))
        if off <= ROUNDED * size or (beyond == 0.0 and force + off / INNER <= radius):
            break
        step, length = _newton(beyond, force, d, lack, found[2]), 1.0
        if off <= NEAR * size:
            d = _unit(d, 1.0, step)
            break
        for _ in range(HALVES):
            there = _unit(d, length, step)
            at = dissipation(table, there)
            gain, far, own, rest = _stand(radius, z, there, at)
            if gain >= gained - ROUNDED * size:
                break
            length *= 0.5
        d, found, gained, beyond, force, lack = there, at, gain, far, own, rest
    return beyond, d, found[2]


@inner_kernel
def _stand(radius: float, z: Vector, d: Vector, found: Found) -> tuple[float, float, float, Vector]:
    """What is to be greatest in direction d: z . d - r P(d) or, where that is not positive, as much of the
    ratio; the distance h from f K, f, and z - h d - f grad P."""
    power, slope, _ = found
    done = _dot(z, d)
    beyond = max(done - radius * power, 0.0)
    force = radius if beyond > 0.0 else done / power
    gained = beyond if beyond > 0.0 else force - radius
    lack = (
        z[0] - beyond * d[0] - force * slope[0],
        z[1] - beyond * d[1] - force * slope[1],
        z[2] - beyond * d[2] - force * slope[2],
    )
    return gained, beyond, force, lack


@inner_kernel
def _newton(beyond: float, force: float, d: Vector, lack: Vector, hessian: Matrix) -> Vector:
    """The step along the sphere, (h + f Hessian)^-1 lack; d, along which the Hessian is zero, is apart."""
    return _times(_inverse(_raised(beyond, force, d, hessian)), lack)


@inner_kernel
def _raised(beyond: float, force: float, d: Vector, hessian: Matrix) -> Matrix:
    """h + f Hessian + f d d^T."""
    xx, xy, xt, yy, yt, tt = hessian
    return (
        beyond + force * (xx + d[0] * d[0]),
        force * (xy + d[0] * d[1]),
        force * (xt + d[0] * d[2]),
        beyond + force * (yy + d[1] * d[1]),
        force * (yt + d[1] * d[2]),
        beyond + force * (tt + d[2] * d[2]),
    )


@inner_kernel
def _inverse(a: Matrix) -> Matrix:
    """Of a positive definite matrix."""
    xx, xy, xt, yy, yt, tt = a
    cofactors = (
        yy * tt - yt * yt,
        xt * yt - xy * tt,
        xy * yt - xt * yy,
        xx * tt - xt * xt,
        xy * xt - xx * yt,
        xx * yy - xy * xy,
    )
    per = 1.0 / (xx * cofactors[0] + xy * cofactors[1] + xt * cofactors[2])
    one, two, three, four, five, six = cofactors
    return per * one, per * two, per * three, per * four, per * five, per * six


@inner_kernel
def _times(a: Matrix, b: Vector) -> Vector:
    return (
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
        a[1] * b[0] + a[3] * b[1] + a[4] * b[2],
        a[2] * b[0] + a[4] * b[1] + a[5] * b[2],
    )


@inner_kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_kernel
def _unit(d: Vector, length: float, step: Vector) -> Vector:
    """The unit vector along d + length step."""
    x, y, t = d[0] + length * step[0], d[1] + length * step[1], d[2] + length * step[2]
    per = 1.0 / math.sqrt(x * x + y * y + t * t)
    return per * x, per * y, per * t


@inner_kernel
def _slope(law: Reals, beyond: float, d: Vector, hessian: Matrix, S: Reals) -> None:
    """Fill the slope of the projection, 1 - h (h + r Hessian)^-1, in the axes of the world."""
    radius = law[RADIUS]
    xx, xy, xt, yy, yt, tt = _inverse(_raised(beyond, radius, d, hessian))
    back = 1.0 - beyond / (beyond + radius)
    xx, xy, xt = (
        beyond * xx + back * d[0] * d[0],
        beyond * xy + back * d[0] * d[1],
        beyond * xt + back * d[0] * d[2],
    )
    yy, yt, tt = (
        beyond * yy + back * d[1] * d[1],
        beyond * yt + back * d[1] * d[2],
        beyond * tt + back * d[2] * d[2],
    )
    c, s = law[COS], law[SIN]
    S[0, 0] = 1.0 - (c * c * xx - 2.0 * c * s * xy + s * s * yy)
    S[1, 1] = 1.0 - (s * s * xx + 2.0 * c * s * xy + c * c * yy)
    S[0, 1] = S[1, 0] = -(c * s * (xx - yy) + (c * c - s * s) * xy)
    S[0, 2] = S[2, 0] = -(c * xt - s * yt)
    S[1, 2] = S[2, 1] = -(s * xt + c * yt)
    S[2, 2] = 1.0 - tt


@kernel
def dissipation(table: Reals, u: Vector) -> Found:
    """P, its gradient and its Hessian at a motion u (3,) that is not zero, of the numbers of a pressure."""
    x, y, turn = u
    far = FAR * table[REACH] * turn
    if x * x + y * y < far * far:
        return _by_edges(table, u)
    return _by_spots(table, u)


@kernel
def _by_spots(table: Reals, u: Vector) -> Found:
    x, y, turn = u
    power, gx, gy, gt = 0.0, 0.0, 0.0, 0.0
    xx, xy, xt, yy, yt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    at = HEAD + EDGE * int(table[EDGES])
    for k in range(at, at + SPOT * int(table[SPOTS]), SPOT):
        a, b, part = table[k], table[k + 1], table[k + 2]
        along, across = x - turn * b, y + turn * a
        speed = math.sqrt(along * along + across * across)
        along, across, arm = along / speed, across / speed, 0.0
        arm = along * a + across * b
        power += part * speed
        gx, gy, gt = gx + part * along, gy + part * across, gt + part * (across * a - along * b)
        part /= speed
        xx, xy, xt = xx + part * across * across, xy - part * across * along, xt - part * across * arm
        yy, yt, tt = yy + part * along * along, yt + part * along * arm, tt + part * arm * arm
    return power, (gx, gy, gt), (xx, xy, xt, yy, yt, tt)


@kernel
def _by_edges(table: Reals, u: Vector) -> Found:
    """In a turn about p = (at, on)."""
    at, on, pace = -u[1] / u[2], u[0] / u[2], abs(u[2])
    far, one, two, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(HEAD, HEAD + EDGE * int(table[EDGES]), EDGE):
        x, y, across, along, length = table[k], table[k + 1], table[k + 2], table[k + 3], table[k + 4]
        away, begin = (x - at) * along - (y - on) * across, (x - at) * across + (y - on) * along
        end, off = begin + length, max(abs(away), THIN * length)
        first, last = math.sqrt(begin * begin + off * off), math.sqrt(end * end + off * off)
        grown = _grown(begin, end, first, last, off)
        swept = end * last - begin * first + off * off * grown
        part = 1.0
        if table[LINE] > 0.0:
            far += 0.5 * swept
            one += along * away * grown + across * (last - first)
            two += along * (last - first) - across * away * grown
        else:
            part = away
            far += away * swept / 6.0
            one, two = one + 0.5 * along * swept, two - 0.5 * across * swept
        first, last = 1.0 / first, 1.0 / last
        over = end * last - begin * first
        mixed, rest = away * (first - last), grown - over
        xx += part * (over * along * along + 2.0 * mixed * along * across + rest * across * across)
        xy += part * ((rest - over) * along * across + mixed * (along * along - across * across))
        yy += part * (over * across * across - 2.0 * mixed * along * across + rest * along * along)
    share = table[SHARE]
    far, one, two, per = share * far, share * one, share * two, share / pace
    xx, xy, yy, side = per * xx, per * xy, per * yy, math.copysign(1.0, u[2])
    gradient = (-side * two, side * one, side * (at * one + on * two + far))
    xt, yt = at * xy - on * xx, at * yy - on * xy
    return pace * far, gradient, (xx, xy, xt, yy, yt, at * yt - on * xt)


@inner_kernel
def _grown(begin: float, end: float, first: float, last: float, off: float) -> float:
    """Integral of 1 / r along an edge, from `begin` to `end` at the distance `off`, without cancellation."""
    if begin >= 0.0:
        return math.log((end + last) / (begin + first))
    if end <= 0.0:
        return math.log((first - begin) / (last - end))
    return math.log((end + last) * (first - begin) / (off * off))
