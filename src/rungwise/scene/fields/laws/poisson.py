"""Poisson's restitution: of impulses, in two phases, in place of Newton's, of speeds. What an impact does
with it is in `simulation.core.laws.poisson_impact`."""

from __future__ import annotations

from typing import ClassVar, Literal

from rungwise.scene.fields.laws.law import RESTITUTION, Law, Lawful


class Poisson(Lawful):
    """See the module."""

    impact: Literal["newton", "poisson"] = "newton"

    law: ClassVar[Law] = Law(
        title="impact: poisson",
        about='impact: whether restitution is "newton" (of speeds) or "poisson" (of impulses).',
        choice={"impact": "poisson"},
        words="impacts by Poisson's law",
        ingredient=RESTITUTION,
    )
