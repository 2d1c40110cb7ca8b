"""Contact modes: which stratum of the state space a contact is on; and the units of a problem.

A force-limited row uses the same numbers: STICK it holds, FORWARD and BACKWARD it slips at its limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import kernel

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
NAMES = ("open", "stick", "forward", "backward")
"""FORWARD slips along the tangent (friction acts backward), BACKWARD against it."""


@kernel
def clear(d: int, sizes: Sizes, unknowns: Unknowns) -> None:
    """Set forces and velocities to zero, contacts of d directions open."""
    for r in range(d * sizes.contacts):
        unknowns.force[r] = 0.0
    for r in range(sizes.limited):
        unknowns.tau[r], unknowns.mode[sizes.contacts + r] = 0.0, STICK
    for k in range(sizes.contacts):
        unknowns.mode[k] = OPEN
    for i in range(sizes.n):
        unknowns.v[i] = 0.0


def yielding(problem: ContactProblem) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which contacts, and which limited rows, give way to their own force: no motion is impossible there."""
    return (problem.R != 0.0).any(axis=(1, 2)), problem.R_s > 0.0


class Units(NamedTuple):
    """Natural units of a problem: the sizes of each coordinate's speed, of a contact's speed and of a contact
    force that count as one."""

    coordinates: NDArray[np.float64]
    velocity: float
    force: float


def natural_units(problem: ContactProblem) -> Units:
    """Units from the problem's own rates and loads, whatever units its coordinates have.

    A coordinate moves at its unit when it moves some row at most by `velocity`, the greatest demanded rate,
    or, where none is demanded, the rate that the loads give to the heaviest body. A coordinate that no row
    feels has the unit that its inertia gives beside the others' inertia, or 1 where it has none. Rates that
    are rounding are not demanded.
    """
    p = problem
    inertia = np.sqrt(np.diag(p.H))
    lever = np.abs(np.vstack([p.W, p.S])).max(axis=0, initial=0.0)
    resists = inertia > 0.0
    longest = float((lever[resists] / inertia[resists]).max(initial=0.0)) or 1.0
    lever = np.where(lever > 1e-9 * longest * inertia, lever, np.where(resists, longest * inertia, 1.0))
    load = float((np.abs(p.c) / lever).max(initial=0.0))
    heaviest = float((inertia / lever).max(initial=0.0))
    demand = max(float(np.abs(p.w).max(initial=0.0)), float(np.abs(p.w_s).max(initial=0.0)))
    demand = 0.0 if demand <= p.quantum[0] else demand
    yields = max(float(np.abs(p.R).max(initial=0.0)), float(p.R_s.max(initial=0.0)))
    demand = max(demand, yields * load)
    resist = heaviest * heaviest
    velocity = demand or (load / resist if resist > 0.0 else 0.0) or 1.0
    return Units(
        velocity / lever,
        velocity,
        max(load, resist * velocity) or 1.0,
    )
