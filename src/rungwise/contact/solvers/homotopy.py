"""A path to the exact law from a problem with one answer, followed through its turning points.

Algorithm: forces z and rates w in cones (see `cones`), products z w = t times a multiple of the unit, slips
counted (1 - t) times, and a fault that is t times the fault of the start. At t = 1 friction does not couple,
the problem is monotone and the start is its one answer; at t = 0 are solutions. Where friction couples
strongly the path turns back on its way, and methods that only ever lower t end there. It is followed by arc
length, in the cones' own metric: each step corrects and predicts with one factorisation, forwards being where
t falls while the determinant is positive, and rises while it is negative, so that no path leads back to its
start. A step that does not stay near the path is taken again, shorter. When the residual has fallen tenfold,
`newton` tries to finish. Sources: Allgower and Georg, Introduction to Numerical Continuation Methods (2003),
chapters 2 to 6; Nesterov and Todd, Math. Oper. Res. 22 (1997) 1-42. Accepts: contacts. Promises: where A is
monotone and the path bounded, an end that only rounding keeps from being a solution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array
from rungwise.contact.solvers.cones import Cones, Layout, centre, cones_of, linearise, longest
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.newton import newton
from rungwise.contact.solvers.settings import FINISH
from rungwise.contact.solvers.work import Work
from rungwise.kernel import Reals, kernel

NAME = "homotopy"
_STEPS = 600
"""Most steps along the path, chosen by trial."""
_FAR, _NEAR = 0.7, 0.3
"""Corrections, in the metric of the cone that needs most: beyond the first a step is taken again; within the
second the next step may be twice as long. Chosen by trial, below 1: longer corrections may leave the
cones."""
_AGAIN, _SHORTER = 4, 0.3
"""Most times that a step is taken again, and the factor on its length each time; chosen by trial."""
_TRIES, _LESS = 12, 0.6
"""Most lengths that are tried until the products of all cones are alike, and the ratio of each length to the
length before; chosen by trial. The last length is 0.004 of the first."""
_WIDTH = 0.05
"""The least product of a cone over the product of the path, and one over the largest. Chosen by trial."""
_LONGEST = 2.0
"""Longest step in the metric of the cones, over the root of their number; chosen by trial."""
_STUCK = 1e-3
"""A correction that must be shortened by this factor leads nowhere; chosen by trial, to a decade."""
_END, _LOST = math.log(1e-14), 1.0
"""Values of log t: below the first, tens of roundings of double precision, there is only rounding;
above the second, chosen by trial, the path is lost."""


class Point(NamedTuple):
    """Forces, rates (N,) and log t, or a step of these."""

    z: Array
    w: Array
    t: float

    def __add__(self, step: Point) -> Point:  # type: ignore[override]
        return Point(self.z + step.z, self.w + step.w, self.t + step.t)

    def times(self, factor: float) -> Point:
        return Point(factor * self.z, factor * self.w, factor * self.t)


class Path(NamedTuple):
    """A (z + offset) + b - w + (1 - t) slip(w) = t fault,  z w = t product."""

    cones: Cones
    fault: Array
    product: float


class Local(NamedTuple):
    """The path near a point: the way back to the path, straight across; the unit tangent forwards; the
    metric."""

    correction: Point
    tangent: Point
    scaling: Array
    size: float
    """Size of the correction, in the metric of the cone that needs most."""


def accepts(system: System) -> bool:
    return len(system.mu) > 0


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def solve(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The best x (N,) met, or `start`; and the steps. The path has its own beginning, not `start`."""
    whole, cones = newton.form(system), cones_of(system)
    best, least, finish = start, natural(system, start), FINISH
    unit = centre(cones)
    here = Point(unit, unit, 0.0)
    path = Path(
        cones,
        cones.rates(here.z) - here.w,
        float(here.z @ here.w) / len(cones.layout.first),
    )
    length, again = math.sqrt(len(cones.layout.first)), 0
    before: tuple[Point, Local] | None = None
    for done in range(_STEPS):
        x = cones.unknowns(here.z)
        found = natural(system, x)
        if found < least:
            best, least = x, found
        if found < finish:
            finish = 0.1 * found
            trial, reached = newton.finish(system, whole, x, tol, work)
            if reached < least:
                best, least = trial, reached
        if least <= tol or work.is_spent or not _END < here.t < _LOST:
            return best, done
        local = _local(path, here, work)
        if local is None:
            return best, done
        if before is not None and again < _AGAIN and not _kept(path, before[1], here, local):
            again, length = again + 1, _SHORTER * length
            here = before[0] + before[1].correction + before[1].tangent.times(length)
            continue
        if again < _AGAIN:
            length *= 2.0 if local.size < _NEAR else 1.0 if again == 0 else 0.7
        length, again = min(length, _LONGEST * math.sqrt(len(cones.layout.first))), 0
        onwards = _onwards(path, here, local, length)
        if onwards is None:
            before, length = None, 1.0
            fraction = min(1.0, 0.9 * _room(cones, here, local.correction))
            if fraction < _STUCK:
                return best, done
            here += local.correction.times(fraction)
        else:
            before = here, local
            here, length = onwards
    return best, _STEPS


def _local(path: Path, here: Point, work: Work) -> Local | None:
    """Correction and tangent from one factorisation; None where the matrix is singular or overflows."""
    cones, t = path.cones, math.exp(here.t)
    linear = linearise(cones, here.z, here.w, 1.0 - t, work)
    if linear is None:
        return None
    layout, (S, inverse, _, slip) = cones.layout, linear.scaling

    def step(aim: Array, fault: Array) -> tuple[Array, Array]:
        """dz, dw with S dz + dw = aim (which becomes dw) that take the fault away."""
        dz = linear.step(aim, fault)
        # Where products are small digits are lost: a second solve brings them back.
        return dz + linear.step(aim, fault + cones.change(dz)), aim

    aim = linear.toward(here.w, t * path.product)
    fault = cones.rates(here.z) - here.w + (1.0 - t) * slip - t * path.fault
    z, w = step(aim, fault)
    tangent = Point(*step(t * path.product * inverse, -t * (path.fault + slip)), 1.0)
    unit = t * path.product
    length = math.sqrt(max(inner(S, tangent.z, tangent.z, layout), 0.0) / unit + 1.0)
    tangent = tangent.times(-linear.factors.sign / length)
    along = inner(S, z, tangent.z, layout) / unit
    correction = Point(z - along * tangent.z, w - along * tangent.w, -along * tangent.t)
    if not math.isfinite(float(correction.z @ correction.w)):
        return None
    return Local(correction, tangent, S, math.sqrt(greatest(S, correction.z, layout) / unit))


def _kept(path: Path, before: Local, here: Point, local: Local) -> bool:
    """Whether the step since `before` stayed near the path and did not turn round on it."""
    if not local.size <= _FAR:
        return False
    unit, layout = math.exp(here.t) * path.product, path.cones.layout
    along = inner(local.scaling, before.tangent.z, local.tangent.z, layout) / unit
    return along + before.tangent.t * local.tangent.t > 0.0


def _onwards(path: Path, here: Point, local: Local, length: float) -> tuple[Point, float] | None:
    """The point, corrected and moved by at most `length` along the tangent to where the cones' products are
    alike; and the length moved."""
    layout = path.cones.layout
    for _ in range(_TRIES):
        there = here + local.correction + local.tangent.times(length)
        unit = math.exp(min(there.t, 1.0)) * path.product
        if alike(there.z, there.w, layout, _WIDTH * unit, unit / _WIDTH):
            return there, length
        length *= _LESS
    return None


def _room(cones: Cones, here: Point, step: Point) -> float:
    """How much of a step stays inside the cones."""
    return float(longest(here.z, step.z, here.w, step.w, cones.layout))


@kernel
def inner(S: Reals, a: Reals, b: Reals, layout: Layout) -> float:
    """a . S b."""
    first, dim, _ = layout
    total = 0.0
    for c in range(len(first)):
        for i in range(first[c], first[c] + dim[c]):
            for l in range(dim[c]):
                total += a[i] * S[i, l] * b[first[c] + l]
    return total


@kernel
def greatest(S: Reals, a: Reals, layout: Layout) -> float:
    """The greatest a . S a of a cone."""
    first, dim, _ = layout
    most = 0.0
    for c in range(len(first)):
        total = 0.0
        for i in range(first[c], first[c] + dim[c]):
            for l in range(dim[c]):
                total += a[i] * S[i, l] * a[first[c] + l]
        most = max(most, total)
    return most


@kernel
def alike(z: Reals, w: Reals, layout: Layout, least: float, most: float) -> bool:
    """Whether z and w are inside their cones, with all eigenvalues of their products from `least` to
    `most`."""
    first, dim, _ = layout
    for c in range(len(first)):
        i = first[c]
        inside_z, inside_w, dot = z[i] * z[i], w[i] * w[i], z[i] * w[i]
        for j in range(i + 1, i + dim[c]):
            inside_z -= z[j] * z[j]
            inside_w -= w[j] * w[j]
            dot += z[j] * w[j]
        if not (z[i] > 0.0 and w[i] > 0.0 and inside_z > 0.0 and inside_w > 0.0):
            return False
        apart = math.sqrt(max(dot * dot - inside_z * inside_w, 0.0)) if dim[c] > 1 else 0.0
        if not (dot - apart > least and dot + apart < most):
            return False
    return True
