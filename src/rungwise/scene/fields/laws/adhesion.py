"""Adhesion: each point of contact pulls its bodies together with a constant force while its gap is at most
its range, so that the load that parts them is that force.

A contact that pushed in the last step is within the range, whatever gap the bodies' curves have left.
Source: Derjaguin, Muller and Toporov, J. Colloid Interface Sci. 53 (1975) 314-326 (the pull beside the
elastic force); Maugis, ibid. 150 (1992) 243-269 (Dugdale's constant force within a range).
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from rungwise.kernel import Record, inner_kernel
from rungwise.scene.fields.laws.law import Carried, Law, Lawful
from rungwise.scene.fields.values import Number


@inner_kernel
def pull(contact: Record, gap: float, pushed: bool) -> float:
    return float(contact.adhesion) if pushed or gap <= contact.adhesion_range else 0.0


@inner_kernel
def reach(contact: Record) -> float:
    return float(contact.adhesion_range)


class Adhesion(Lawful):
    """See the module."""

    adhesion: Number | None = None
    adhesion_range: Number | None = None

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> Adhesion:
        if self.adhesion_range is not None and self.adhesion is None:
            raise PydanticCustomError("contact", "adhesion_range needs adhesion, a force")
        return self

    law: ClassVar[Law] = Law(
        title="adhesion",
        about="adhesion, adhesion_range: pull of each contact point, and the greatest gap at which it pulls.",
        numbers=(
            Carried("adhesion", lambda _contact, _tolerance: 0.0),
            Carried("adhesion_range", lambda _contact, tolerance: tolerance, above=0.0),
        ),
        pull=pull,
        reach=reach,
    )
