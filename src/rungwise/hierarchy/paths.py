"""Paths of parameters along which a model comes near another, or does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rungwise.models.ladder import Rung
from rungwise.world.matching import DAMPING, STIFFNESS, Matched

CONTACT = tuple(10.0 ** np.linspace(0.0, 4.0, 5))
"""Factors on stiffness along the paths to rigid contact."""
INERTIA = tuple(10.0 ** np.linspace(-1.0, -5.0, 5))
"""Factors on inertia along the path to none."""


@dataclass(frozen=True)
class Path:
    """A way through parameters: in words, the small number's name and values, and what runs take at each: the
    factor of inertia, factors of stiffness and damping, and the restitution of the limit (None: matched)."""

    words: str
    name: str
    values: tuple[float, ...]
    inertia: Callable[[float], float]
    stiffness: Callable[[float], float]
    damping: Callable[[float], float]
    bounce: float | None = None

    def rung(self, model: Rung, at: float) -> Rung:
        return model.with_inertia(self.inertia(at)) if model.inertia > 0.0 else model

    def factors(self, at: float) -> dict[str, float]:
        """Factors of stiffness and damping, by the names of the matched scene's parameters."""
        return {STIFFNESS: self.stiffness(at), DAMPING: self.damping(at)}

    def is_within(self, matched: Matched) -> bool:
        """Whether the matched scene has the parameters that the path changes."""
        return all(name in matched.parameters for name in self.factors(self.values[0]))


def _one(_: float) -> float:
    return 1.0


def _zero(_: float) -> float:
    return 0.0


def _same(at: float) -> float:
    return at


def _inverse(at: float) -> float:
    return 1.0 / at


def _inverse_root(at: float) -> float:
    return float(at**-0.5)


_SMALL = tuple(1.0 / factor for factor in CONTACT)
"""What the distance to rigid contact is expected to fall with."""
RATIO = Path(
    "stiffness times 1 to 1e4 at a fixed damping ratio", "1/K", _SMALL, _one, _inverse,
    _inverse_root,
)  # fmt: skip
PROPORTIONAL = Path(
    "stiffness times 1 to 1e4 with damping in proportion", "1/K", _SMALL, _one, _inverse, _inverse, 0.0
)
UNDAMPED = Path("stiffness times 1 to 1e4 without damping", "1/K", _SMALL, _one, _inverse, _zero, 1.0)
LIGHT = Path("inertia times 1e-1 to 1e-5", "epsilon", INERTIA, _same, _one, _one)
BOTH = Path(
    "inertia times 1e-1 to 1e-5 and stiffness times 10 to 1e5, at a fixed damping ratio", "epsilon", INERTIA,
    _same, _inverse, _one,
)  # fmt: skip
