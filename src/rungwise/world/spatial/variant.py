"""A scene in space on a rung, taken apart into ingredients, and put together from two (see `Variant`)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, Self

import numpy as np

from rungwise.scene.fields.laws.contact import told, written
from rungwise.scene.fields.laws.law import ALWAYS, FRICTION, RESTITUTION
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.scene.space.fields import Contact
from rungwise.scene.space.laws import FROM
from rungwise.world import ingredients as of
from rungwise.world.ingredients import Variant

GIVE, BOUNCE, SLIP = slice(0, 4), 4, slice(5, 8)
"""Columns of the laws of contact: stiffness and damping, restitution, sliding, torsional and rolling
friction."""
FRICTIONS = ("friction", *FROM)


class SpatialVariant(Variant):
    """See `Variant`."""

    scene: SpaceScene

    @cached_property
    def bound(self) -> SpaceBound:
        return self.scene.bind(self.parameters)

    @property
    def weight(self) -> bool:
        """Whether bodies have weight that this world counts."""
        return self.model.loads and bool(self.bound.model.opt.gravity.any())

    def effective(self, ingredient: str) -> Any:
        """What the ingredient amounts to in this world: plain values that are equal where it is the same."""
        model, laws, named = self.model, self.bound.laws, self.bound.named
        bounces = model.inertia > 0.0 and not model.compliant and laws[:, BOUNCE].any()
        found: dict[str, Any] = {
            of.BALANCE: not model.metric,
            of.FRICTION: [laws[:, SLIP].tobytes(), *told(named, FRICTION)] if model.friction else 0.0,
            of.SUPPORT: 0.0,
            of.COMPLIANCE: laws[:, GIVE].tobytes() if model.compliant else 0.0,
            of.INERTIA: model.inertia,
            of.RESTITUTION: [laws[:, BOUNCE].tobytes(), *told(named, RESTITUTION)] if bounces else 0.0,
            of.ACCURACY: self.tol,
        }
        return self._others if ingredient == of.OTHER else found[ingredient]

    @cached_property
    def _others(self) -> list[Any]:
        """All numbers of the model, the start and the drives, and of laws that are no other ingredient's."""
        import mujoco

        model, bound = self.bound.model, self.bound
        content = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
        mujoco.mj_saveModel(model, None, content)
        numbers = (content, bound.place, bound.motion, bound.control, bound.pace)
        return [told(bound.named, ALWAYS), *(each.tobytes() for each in numbers)]

    def resolved(self, friction: Self, _support: Self, give: Self, bounce: Self) -> SpaceScene:
        """The scene without conditions, with numbers of its entries of contacts from these worlds."""
        bounces = (
            bounce.bound.laws[:, BOUNCE]
            if bounce.effective(of.RESTITUTION)
            else np.zeros(len(self.bound.laws))
        )
        slips, gives = friction.bound.laws[:, SLIP], give.bound.laws[:, GIVE]
        contacts = tuple(
            Contact(
                between=entry.between, stiffness=float(gives[k][0]), tangential_stiffness=float(gives[k][1]),
                damping=float(gives[k][2]), tangential_damping=float(gives[k][3]),
                restitution=float(bounces[k]),
                **{name: float(x) for name, x in zip(FRICTIONS, slips[k], strict=True) if not math.isnan(x)},
                **written(friction.bound.named[k], FRICTION),
                **written(bounce.bound.named[k], RESTITUTION), **written(self.bound.named[k], ALWAYS),
            )
            for k, entry in enumerate(self.scene.file.contacts, start=1)
        )  # fmt: skip
        return self.scene.changed(contacts=contacts, **dict.fromkeys(of.CONDITIONS))

    def loads_of(self, body: str) -> float:
        """The weight of a body, and of what hangs on it, that this world counts."""
        model = self.bound.model
        mass = float(model.body_subtreemass[self.scene.labels.bodies.index(body)])
        return mass * float(np.linalg.norm(model.opt.gravity)) if self.weight else 0.0
