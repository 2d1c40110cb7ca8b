"""What every contact in the plane says, and what a law of contact besides states of itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, TypeAlias

from rungwise.kernel import Record, inner_kernel
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.values import Number, Pattern

FRICTION, RESTITUTION, ALWAYS = "friction", "restitution", ""
"""What a diagnosis takes a law for: a part of these ingredients, or a number of the scene like all others."""

Pull: TypeAlias = Callable[[Record, float, bool], float]
"""(contact, gap, whether it pushed in the last step): the force with which a point of contact pulls."""
Reach: TypeAlias = Callable[[Record], float]
"""(contact): the greatest gap at which it pulls."""
Rebound: TypeAlias = Callable[[Record, float, float], float]
"""(contact, restitution, speed of approach): the restitution at this speed."""
Refuses: TypeAlias = Callable[[Record], bool]
"""(contact): whether its numbers are impossible."""


@inner_kernel
def until_across(reach: float, gap: float, rate: float, across: float, rounding: float, h: float) -> float:
    """A step of length h, but no longer than the gap takes to a place just across the edge, by a part of the
    reach."""
    beyond = gap - reach
    leaves, enters = rate > 0.0 and beyond <= 0.0, rate < 0.0 and beyond > 0.0
    room = abs(beyond) + max(across * reach, rounding)
    if (leaves or enters) and abs(rate) * h > room:
        h = room / abs(rate)
    return h


class Touching(Strict):
    """What every entry of contacts in the plane says: which bodies, and the numbers of the common laws."""

    between: tuple[Pattern, Pattern]
    friction: Number = 0.0
    restitution: Number = 0.0
    stiffness: Number = 1e6
    damping: Number = 0.0
    tangential_stiffness: Number | None = None
    tangential_damping: Number | None = None
    coupling_stiffness: Number = 0.0
    coupling_damping: Number = 0.0


class Carried(NamedTuple):
    """A number of a law that the record of each contact carries, at least 0: the field that gives it; its
    value where none is given, from the contact and the scene's tolerance; and its other bounds."""

    field: str
    otherwise: Callable[[Any, Number], Number]
    above: float | None = None
    infinite: bool = False


@dataclass(frozen=True)
class Law:
    """A law of contact that is off unless a scene names it, by giving the first of its fields a value other
    than its default.

    title: how a scene names it; about: its fields, for those who build scenes in Python; numbers: what it
    adds to the record of a contact; choice: what it is written as where it has no number; words: what `check`
    says of it then; ingredient: what a diagnosis takes it for; is_smooth: whether steps are differentiated
    with it. pull, with its reach, rebound, refuses: kernels, compiled into those of the steps (see the types
    of this module); refusal: what `refuses` finds wrong.
    """

    title: str
    about: str
    numbers: tuple[Carried, ...] = ()
    choice: Mapping[str, str] = field(default_factory=dict)
    words: str = ""
    ingredient: str = ALWAYS
    is_smooth: bool = False
    pull: Pull | None = None
    reach: Reach | None = None
    rebound: Rebound | None = None
    refuses: Refuses | None = None
    refusal: str = ""


class Lawful(Strict):
    """Base of the fields of laws."""

    law: ClassVar[Law]
