"""Static friction: what does not slide is held by up to a coefficient above that of what slides. What a step
does with it is in `simulation.core.laws.static_friction`."""

from __future__ import annotations

from typing import ClassVar

from rungwise.kernel import Record, inner_kernel
from rungwise.scene.fields.laws.law import FRICTION, Carried, Law, Lawful
from rungwise.scene.fields.values import Number


@inner_kernel
def refuses(contact: Record) -> bool:
    return bool(contact.static_friction < contact.friction)


class StaticFriction(Lawful):
    """See the module."""

    static_friction: Number | None = None

    law: ClassVar[Law] = Law(
        title="static_friction",
        about="static_friction: coefficient up to which a contact that sticks holds.",
        numbers=(Carried("static_friction", lambda contact, _tolerance: contact.friction),),
        ingredient=FRICTION,
        refuses=refuses,
        refusal="static_friction must be at least friction",
    )
