"""The ladder: six contact models of one equation, as data.

A rung says which terms of the equation are kept. ``inertia`` is the paper's epsilon: 1 keeps M and the
momentum, 0 is the limit 0+ (quasistatic), and values between give the models in between.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import record_type
from rungwise.wording import choices

RUNG = record_type("metric loads friction compliant", "inertia theta")


@dataclass(frozen=True)
class Rung:
    """One contact model.

    Attributes:
        name: as typed on the command line.
        equation: number in the paper.
        about: the model in one line.
        moves: whether the model predicts motion (the geometric one only forbids overlap).
        metric: unit-mass metric instead of M, motions instead of forces (kinematic).
        loads: non-contact forces act.
        friction: Coulomb's law holds at contacts.
        compliant: contacts deform with K and C; otherwise they are rigid.
        inertia: epsilon in [0, 1].
    """

    name: str
    equation: int
    about: str
    moves: bool = True
    metric: bool = False
    loads: bool = True
    friction: bool = True
    compliant: bool = False
    inertia: float = 0.0

    def with_inertia(self, inertia: float) -> Rung:
        """The model at another epsilon in [0, 1]; 0 is the quasistatic limit. Raises ValueError."""
        if self.metric or not self.moves:
            raise ValueError(f"inertia: the {self.name} rung has none; take a quasistatic or dynamic rung")
        if isinstance(inertia, bool) or not isinstance(inertia, Real) or not 0.0 <= inertia <= 1.0:
            raise ValueError(f"inertia: must be a number in 0..1, not {str(inertia)[:60]!r}")
        return replace(self, inertia=float(inertia))

    def record(self, theta: float = 1.0) -> NDArray[np.void]:
        """The rung as kernels read it, with this `theta` of the step: a record array of length 1."""
        record = np.zeros(1, RUNG)
        for field in RUNG.names or ():
            record[field] = theta if field == "theta" else getattr(self, field)
        if not self.compliant or self.inertia == 0.0:
            record["theta"] = 1.0
        return record


GEOMETRIC = Rung(
    "geometric", 9, "no overlap; every body may be placed anywhere",
    moves=False, loads=False, friction=False,
)  # fmt: skip
KINEMATIC = Rung(
    "kinematic", 8, "driven coordinates move; the rest take the slowest motion that avoids overlap",
    metric=True, loads=False, friction=False,
)  # fmt: skip
QUASISTATIC_RIGID = Rung("quasistatic-rigid", 7, "forces balance at rigid contacts with friction")
QUASISTATIC_COMPLIANT = Rung(
    "quasistatic-compliant", 6, "forces balance at contacts that deform", compliant=True
)
DYNAMIC_RIGID = Rung("dynamic-rigid", 5, "momentum, impacts and friction at rigid contacts", inertia=1.0)
DYNAMIC_COMPLIANT = Rung(
    "dynamic-compliant", 3, "momentum and friction at contacts that deform", compliant=True, inertia=1.0
)
LADDER = (
    GEOMETRIC, KINEMATIC, QUASISTATIC_RIGID, QUASISTATIC_COMPLIANT, DYNAMIC_RIGID, DYNAMIC_COMPLIANT,
)  # fmt: skip


def rung(model: str | Rung) -> Rung:
    """The rung of that name. Raises ValueError that lists the names."""
    if isinstance(model, Rung):
        return model
    for candidate in LADDER:
        if isinstance(model, str) and candidate.name == model:
            return candidate
    raise ValueError(f"model: unknown {str(model)[:60]!r}{choices(model, (r.name for r in LADDER))}")
