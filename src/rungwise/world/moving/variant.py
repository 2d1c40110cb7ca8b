"""A scene on a rung, taken apart as far as the rung and the accuracy tell (see `Variant`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rungwise.models.ladder import Rung
from rungwise.scene.stated import StatedScene
from rungwise.world.ingredients import (
    ACCURACY,
    BALANCE,
    COMPLIANCE,
    CONDITIONS,
    FRICTION,
    INERTIA,
    OTHER,
    Parting,
    accuracy,
    parameters,
    speeds,
)


@dataclass(frozen=True)
class MovingVariant:
    """See `Variant`: how motions are chosen, whether contacts rub and yield, inertia, the accuracy, and all
    numbers of the scene as one ingredient."""

    scene: StatedScene
    parameters: dict[str, float]
    model: Rung
    tol: float

    def effective(self, ingredient: str) -> Any:
        model = self.model
        known: dict[str, Any] = {
            BALANCE: not model.metric, FRICTION: model.friction, COMPLIANCE: model.compliant,
            INERTIA: model.inertia, ACCURACY: self.tol, OTHER: self.parameters,
        }  # fmt: skip
        return known.get(ingredient, 0.0)

    def mixed(self, other: MovingVariant, taken: frozenset[str]) -> MovingVariant:
        def of(ingredient: str) -> MovingVariant:
            return other if ingredient in taken else self

        base, tol = of(OTHER), of(ACCURACY).tol
        model = of(BALANCE).model
        if not model.metric:
            model = Rung(
                "hybrid", 3, "between two worlds", friction=of(FRICTION).model.friction,
                compliant=of(COMPLIANCE).model.compliant, inertia=of(INERTIA).model.inertia,
            )  # fmt: skip
        scene = base.scene.changed(**dict.fromkeys(CONDITIONS))
        return MovingVariant(scene, base.parameters, model, tol)


def evidence(parting: Parting, causes: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Numbers for each cause, plain values by name."""
    known = {BALANCE: speeds, INERTIA: speeds, ACCURACY: accuracy, OTHER: parameters}
    return {cause: known[cause](parting) for cause in causes if cause in known}
