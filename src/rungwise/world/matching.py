"""Matched parameters: what one model says by one number, and another by another.

Restitution on the rigid rungs and the damping ratio of compliant contacts; the weight of turning in the
slowest motion, rho^2 = I/m, and what a support resists turning with. The matched scene has parameters for
them, so that any run of a comparison is a run of that one scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from scipy.optimize import brentq

from rungwise.models.ladder import Rung

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
    return float(brentq(lambda ratio: restitution(ratio) - bounce, 0.0, 1.0 / math.sqrt(bounce)))
