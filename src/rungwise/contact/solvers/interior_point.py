"""A primal-dual interior point method on the exact law, finished by Newton steps.

Algorithm: in coordinates in which the friction cone is Lorentz's, forces z and rates w stay inside it and its
dual (the same), w_n being the normal rate plus mu times the slip, and follow the path on which their product
is a multiple of the unit, down to zero; the slip is linearised with the rest. Nesterov and Todd's scaling; a
predictor chooses the next multiple and tells how products bend on the way there, one factorisation serves
both. At the start, and whenever the residual has fallen tenfold, `newton` tries to finish; the first try is
early, since one step is enough where everything sticks. Sources: Nesterov and Todd, Math. Oper. Res. 22
(1997) 1-42; Mehrotra, SIAM J. Optim. 2 (1992) 575-601, for the predictor; Vandenberghe, The CVXOPT linear and
quadratic cone program solvers (2010); Acary, Armand, Nguyen, Optim. Methods Softw. (2023), for friction. An
upper limit is one more unknown, the force that holds it. Accepts: everything. Promises: tens of iterations
whatever the rank of A, where A is monotone and friction does not couple too strongly; among many solutions
one in the midst of them.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array
from rungwise.contact.solvers.cones import Cones, beyond, centre, cones_of, linearise, longest
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.newton import newton
from rungwise.contact.solvers.settings import (
    FINISH,
    FORCE,
    NEARER,
    RATE,
    RETAINED,
    SHORT,
    STALLED,
    TO_THE_BOUNDARY,
)
from rungwise.contact.solvers.work import Work

NAME = "interior-point"
_STEPS, _DEAR = 100, 60
"""Most iterations; and most where their work exceeds the allowed work."""
_EARLY = 1.0
"""Residual, in scaled units, below which one Newton step is tried. Chosen by trial, to a decade."""
_BENT = 0.3
"""A prediction that goes no further than this does not tell how products bend, and a step that goes no
further is compared with the straight step. As a share of the whole step, chosen by trial."""
_WINDOW, _SHORT_WINDOW = 8, 3
"""The method ends where product and residual are both above `STALLED` of their values a window of iterations
earlier; the windows while work is left and once it is spent. Chosen by trial."""


def accepts(_system: System) -> bool:
    return True


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def solve(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The best x (N,) met, or `start`; and the iterations. The path has its own beginning, not `start`."""
    whole = newton.form(system)
    best, least, finish = start, natural(system, start), _EARLY
    if least < FINISH:
        best, least = newton.finish(system, whole, start, tol, work)
    if least <= tol:
        return best, 0
    cones = cones_of(system)
    unit = centre(cones)
    z, w = FORCE * unit, RATE * unit
    _start_between(system, z, w)
    history: list[tuple[float, float]] = []
    for done in range(_STEPS):
        x = cones.unknowns(z)
        found = natural(system, x)
        if found < least:
            best, least = x, found
        if found < finish:
            trial, reached = newton.finish(system, whole, x, tol, work, early=found >= FINISH)
            finish = min(NEARER * found, FINISH)
            if reached < least:
                best, least = trial, reached
        history.append((float(z @ w), found))
        if least <= tol or _stalled(history, work) or (work.is_spent and done >= _DEAR) or work.is_halted:
            return best, done
        moved = _advance(cones, z, w, work)
        if moved is None:
            return best, done
        z, w = moved
    return best, _STEPS


def _stalled(history: list[tuple[float, float]], work: Work) -> bool:
    """Whether neither product nor residual fell enough, or either is no number."""
    window = _SHORT_WINDOW if work.is_spent else _WINDOW
    if not np.isfinite(history[-1]).all():
        return True
    if len(history) < 2 * window:
        return False
    (product, found), (later, now) = history[-window], history[-1]
    return later > STALLED * product and now > STALLED * found


def _start_between(system: System, z: Array, w: Array) -> None:
    """Begin midway between two limits."""
    capped = np.flatnonzero(np.isfinite(system.upper))
    half = 0.5 * (system.upper - system.lower)[capped]
    inside = np.isfinite(half) & (half > 0.0)
    z[system.rows + capped[inside]] = w[system.size :][inside] = half[inside]


def _advance(
    cones: Cones, z: Array, w: Array, work: Work, turning: float = 1.0
) -> tuple[Array, Array] | None:
    """One predicted and centred step; None when the linear system is singular.

    `turning` is the weight of the derivative of the slips' directions.
    """
    layout, count = cones.layout, max(len(cones.layout.first), 1)
    linear = linearise(cones, z, w, turning, work)
    if linear is None:
        return None
    fault = cones.rates(z) - w + linear.scaling.slip
    product = float(z @ w) / count

    def step(target: float, repaired: float, bend: Array | float = 0.0) -> tuple[Array, Array, float]:
        """dz, dw and the longest step towards the product `target`, where products bend by `bend`, repairing
        the part `repaired` of the fault."""
        dw = linear.toward(w, target) - bend
        dz = linear.step(dw, fault, repaired)
        return dz, dw, longest(z, dz, w, dw, layout)

    dz, dw, length = step(0.0, 1.0)
    length = min(1.0, length)
    predicted = float((z + length * dz) @ (w + length * dw)) / count
    centring = min(1.0, max(predicted / product, 0.0)) ** 3 if product > 0.0 else 0.0
    aim = centring * product, 1.0 - RETAINED * centring
    bend, known = np.zeros(len(z)), length > _BENT
    if known:
        beyond(z, w, dz, dw, layout, np.empty((4, 3)), bend)
        bend *= 1.0 - centring
    dz, dw, length = step(*aim, bend)
    if known and length < _BENT:
        straight = step(*aim)
        dz, dw, length = straight if straight[2] > length else (dz, dw, length)
    if length < SHORT and turning > 0.0:
        return _advance(cones, z, w, work, 0.0)
    length = min(1.0, TO_THE_BOUNDARY * length)
    return z + length * dz, w + length * dw
