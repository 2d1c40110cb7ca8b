"""Matched parameters: what one model says by one number, and another by another.

Restitution on the rigid rungs and the damping ratio of compliant contacts; the weight of turning in the
slowest motion, rho^2 = I/m, and what a support resists turning with. The matched scene has parameters for
them, so that any run of a comparison is a run of that one scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.system.terms import Terms, normals_of, whole

STIFFNESS, DAMPING, BOUNCE, TURN = "match_stiffness", "match_damping", "match_bounce_{}", "match_inertia_{}"
"""Parameters of a matched scene: factors of all stiffnesses and dampings, restitution of each contact, and
moment of inertia of each body whose turning is matched."""


@dataclass(frozen=True)
class Matched:
    """A scene whose contacts have restitution and damping that belong together; values of its parameters,
    those that the kinematic rung takes in place, and what was matched, in words.

    bare: the scene without conditions, whose runs go on; ratios: damping ratio of each contact, nan where
    none is matched.
    """

    scene: Any
    bare: Any
    parameters: dict[str, float]
    kinematic: dict[str, float]
    notes: tuple[str, ...]
    ratios: tuple[float, ...]

    def values(self, model: Rung) -> dict[str, float]:
        """Parameters for a run on this rung."""
        return self.parameters | (self.kinematic if model.metric else {})

    def bouncing(self, restitution: float | None) -> dict[str, float]:
        """Restitution of all matched contacts, by the parameters' names; None: as matched."""
        names = {BOUNCE.format(k): r for k, r in enumerate(self.ratios) if not math.isnan(r)}
        return {} if restitution is None else dict.fromkeys(names, restitution)


def restitution(ratio: float) -> float:
    """Newton's restitution of one impact on a spring and a damper that cannot pull (a force that stays
    pressing), at this damping ratio."""
    if ratio < 1.0:
        angle = math.acos(ratio)
        return math.exp(-2.0 * ratio * angle / math.sin(angle))
    angle = math.acosh(ratio)
    return math.exp(-2.0 * ratio * (angle / math.sinh(angle) if angle > 0.0 else 1.0))


def damping_ratio(bounce: float) -> float:
    """The damping ratio whose impact has this restitution, in (0, 1]."""
    if bounce >= 1.0:
        return 0.0
    from scipy.optimize import brentq

    return float(brentq(lambda ratio: restitution(ratio) - bounce, 0.0, 1.0 / math.sqrt(bounce)))


class Alike(NamedTuple):
    """Restitution, damping and damping ratio of a contact that say the same."""

    restitution: float
    damping: float
    ratio: float

    def told(self, stiffness: float, mass: float) -> str:
        return (
            f"restitution {self.restitution:.3g} and damping ratio {self.ratio:.3g} (stiffness"
            f" {stiffness:.3g}, damping {self.damping:.3g}, mass {mass:.3g} at first touch)"
        )


def alike(bounce: float, damping: float, stiffness: float, mass: float) -> Alike:
    """Where a contact has restitution, its damping follows from that, otherwise its restitution follows from
    its damping."""
    critical = 2.0 * math.sqrt(stiffness * mass)
    if bounce > 0.0:
        ratio = damping_ratio(bounce)
        return Alike(bounce, ratio * critical, ratio)
    ratio = damping / critical
    return Alike(restitution(ratio), damping, ratio)


def flexibility(terms: Terms, contact: int, free: Ints) -> float:
    """How far a unit of impulse along the normal of a contact moves the free velocities along it: one over
    the mass that it feels, without friction."""
    normal: Reals = normals_of(terms, contact + 1)[contact, free]
    return float(normal @ np.linalg.solve(whole(terms, terms.inertia)[np.ix_(free, free)], normal))
