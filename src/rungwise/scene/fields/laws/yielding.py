"""Restitution that falls with speed: e at approaches up to the speed at which the material yields, and e
times the ratio of the two speeds to the power -1/4 above. Source: Johnson, Contact Mechanics (1985), section
11.5.
"""

from __future__ import annotations

import math
from typing import ClassVar

from rungwise.kernel import Record, inner_kernel
from rungwise.scene.fields.laws.law import RESTITUTION, Carried, Law, Lawful
from rungwise.scene.fields.values import Number

FALL = -0.25
"""Power of the approach speed with which restitution falls where the contact yields."""


@inner_kernel
def rebound(contact: Record, restitution: float, speed: float) -> float:
    if speed > contact.yield_speed:
        restitution *= (speed / contact.yield_speed) ** FALL
    return restitution


class Yielding(Lawful):
    """See the module."""

    yield_speed: Number | None = None

    law: ClassVar[Law] = Law(
        title="yield_speed",
        about="yield_speed: speed of approach above which restitution falls.",
        numbers=(Carried("yield_speed", lambda _contact, _tolerance: math.inf, above=0.0, infinite=True),),
        ingredient=RESTITUTION,
        is_smooth=True,
        rebound=rebound,
    )
