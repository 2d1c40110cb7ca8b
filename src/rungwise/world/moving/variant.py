"""A scene on a rung, taken apart as far as the rung and the accuracy tell (see `Variant`)."""

from __future__ import annotations

from typing import Any

from rungwise.scene.stated import StatedScene
from rungwise.world import ingredients as of
from rungwise.world.ingredients import Variant


class MovingVariant(Variant):
    """See `Variant`: how motions are chosen, whether contacts rub and yield, inertia, the accuracy, and all
    numbers of the scene as one ingredient."""

    scene: StatedScene

    def effective(self, ingredient: str) -> Any:
        model = self.model
        known: dict[str, Any] = {
            of.BALANCE: not model.metric, of.FRICTION: model.friction, of.COMPLIANCE: model.compliant,
            of.INERTIA: model.inertia, of.ACCURACY: self.tol, of.OTHER: self.parameters,
        }  # fmt: skip
        return known.get(ingredient, 0.0)

    def resolved(self, *_others: Variant) -> StatedScene:
        return self.scene.changed(**dict.fromkeys(of.CONDITIONS))
