"""The list of the laws of contact, and what all of them do together, as kernels of a step call it.

Where a law is off nothing of it is called: kernels look at `laws` first, the sum of the bits of the laws that
a scene names, and at the `laws` of a contact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, TypeVar, cast

from rungwise.kernel import Record, inner_kernel, record_type
from rungwise.scene.fields.laws.adhesion import Adhesion
from rungwise.scene.fields.laws.law import (
    Law,
    Lawful,
    Pull,
    Reach,
    Rebound,
    Refuses,
    Touching,
    until_across,
)
from rungwise.scene.fields.laws.poisson import Poisson
from rungwise.scene.fields.laws.static_friction import StaticFriction
from rungwise.scene.fields.laws.yielding import Yielding

F = TypeVar("F", bound=Callable[..., Any])
Until: TypeAlias = Callable[[Record, float, float, float, float, float], float]
Refused: TypeAlias = Callable[[Record], int]


class Named(
    Poisson,
    Adhesion,
    Yielding,
    StaticFriction,
):
    """Laws of contact that are off unless they are named, in the plane and in space: `static_friction` holds
    what does not slide, `friction` acts on what does; restitution falls above `yield_speed`, as its power
    -1/4 (Johnson 1985); each point of contact pulls with `adhesion` while its gap is at most `adhesion_range`
    (Derjaguin, Muller and Toporov 1975); `impact` says whether restitution is Newton's, of speeds, or
    Poisson's, of impulses."""


class Contact(Named, Touching):
    """Which bodies may touch, and how. Names may use ``*``; the first entry that names a pair holds. See
    `Named` for laws that are off unless they are named."""


FIELDS: tuple[type[Lawful], ...] = tuple(cast("type[Lawful]", each) for each in Named.__bases__[::-1])
LAWS: tuple[Law, ...] = tuple(each.law for each in FIELDS)
OWN = tuple(Named.model_fields)
"""The fields of the laws."""
RECORD = record_type(
    "laws", " ".join(["friction", *(number.field for law in LAWS for number in law.numbers)])
)
"""What an entry names: the sum of the bits of its laws, friction, nan where it gives none, and the numbers of
the laws. Records of contacts in the plane have the same fields among others."""
CHOICES = frozenset(name for law in LAWS for name in law.choice)
"""Fields that are no numbers."""


def bits(*of: type[Lawful]) -> int:
    """The sum of the bits of these laws, as records of contacts have it in `laws`."""
    return sum(1 << FIELDS.index(each) for each in of)


PULLS = sum(1 << k for k, law in enumerate(LAWS) if law.pull is not None)
REBOUNDS = sum(1 << k for k, law in enumerate(LAWS) if law.rebound is not None)
STICKS, POISSON = bits(StaticFriction), bits(Poisson)
ROUGH = sum(1 << k for k, law in enumerate(LAWS) if not law.is_smooth)
"""Laws with which steps are not differentiated."""


def named_by(contact: Named) -> int:
    """The sum of the bits of the laws that an entry names."""
    own = [next(iter(each.model_fields)) for each in FIELDS]
    given = [getattr(contact, name) != Named.model_fields[name].default for name in own]
    return sum(1 << k for k, is_given in enumerate(given) if is_given)


def written(record: Any, *ingredients: str) -> dict[str, Any]:
    """The fields of the laws that a contact's record names, of these ingredients if some are given."""
    found: dict[str, Any] = {}
    for k, law in enumerate(LAWS):
        if record["laws"] & 1 << k and (not ingredients or law.ingredient in ingredients):
            found |= {number.field: float(record[number.field]) for number in law.numbers} | dict(law.choice)
    return found


def told(records: Any, ingredient: str) -> list[list[Any]]:
    """What the laws of an ingredient amount to, contact by contact: numbers, or whether they are chosen."""
    own = [(k, law) for k, law in enumerate(LAWS) if law.ingredient == ingredient]
    chosen = [(records["laws"] & 1 << k).tolist() for k, law in own if law.choice]
    return chosen + [records[number.field].tolist() for _, law in own for number in law.numbers]


def titles(records: Any) -> list[str]:
    """The names of the laws that any of these contacts names."""
    return [law.title for k, law in enumerate(LAWS) if (records["laws"] & 1 << k).any()]


def in_words(fields: Mapping[str, Any]) -> str:
    """The laws of a contact's description, each after a comma."""
    numbers = [number.field for law in LAWS for number in law.numbers if number.field in fields]
    parts = [f"{name.replace('_', ' ')} {fields[name]:.6g}" for name in numbers]
    parts += [law.words for law in LAWS if law.choice and all(name in fields for name in law.choice)]
    return "".join(f", {part}" for part in parts)


def _part(function: F, law: Law) -> F:
    """A kernel of one law, under a name of its own: compiled parts are told apart by it."""
    function.__qualname__ = f"{function.__name__}_{law.title.split(':')[0]}"
    return inner_kernel(function)


def _joined(does: str, join: Any, without: F) -> F:
    """What all laws do that do this, from what contacts do without laws."""
    found = without
    for number, law in enumerate(LAWS):
        if getattr(law, does) is not None:
            found = join(getattr(law, does), number, law, found)
    return found


def _pulling(own: Pull, number: int, law: Law, others: Pull) -> Pull:
    bit = 1 << number

    def pull(contact: Record, gap: float, pushed: bool) -> float:
        total = others(contact, gap, pushed)
        if contact.laws & bit:
            total += own(contact, gap, pushed)
        return total

    return _part(pull, law)


def _reaching(own: Reach, number: int, law: Law, others: Reach) -> Reach:
    bit = 1 << number

    def pulls_within(contact: Record) -> float:
        found = others(contact)
        if contact.laws & bit:
            found = max(found, own(contact))
        return found

    return _part(pulls_within, law)


def _ending(own: Reach, number: int, law: Law, others: Until) -> Until:
    bit = 1 << number

    def until_edge(
        contact: Record, gap: float, rate: float, across: float, rounding: float, h: float
    ) -> float:
        h = others(contact, gap, rate, across, rounding, h)
        if contact.laws & bit:
            h = until_across(own(contact), gap, rate, across, rounding, h)
        return h

    return _part(until_edge, law)


def _rebounding(own: Rebound, number: int, law: Law, others: Rebound) -> Rebound:
    bit = 1 << number

    def rebound(contact: Record, restitution: float, speed: float) -> float:
        left = others(contact, restitution, speed)
        if contact.laws & bit:
            left = own(contact, left, speed)
        return left

    return _part(rebound, law)


def _refusing(own: Refuses, number: int, law: Law, others: Refused) -> Refused:
    def refused(contact: Record) -> int:
        return number if own(contact) else others(contact)

    return _part(refused, law)


@inner_kernel
def _no_pull(_contact: Record, _gap: float, _pushed: bool) -> float:
    return 0.0


@inner_kernel
def _nowhere(_contact: Record) -> float:
    return 0.0


@inner_kernel
def _whole(_contact: Record, _gap: float, _rate: float, _across: float, _rounding: float, h: float) -> float:
    return h


@inner_kernel
def _unchanged(_contact: Record, restitution: float, _speed: float) -> float:
    return restitution


@inner_kernel
def _none(_contact: Record) -> int:
    return -1


pull: Pull = _joined("pull", _pulling, _no_pull)
"""The force with which a point of contact pulls, by all laws together."""
pulls_within: Reach = _joined("reach", _reaching, _nowhere)
"""The greatest gap at which a contact pulls."""
until_edge: Until = _joined("reach", _ending, _whole)
"""A step of length h, but no longer than a point of contact takes, with a gap that changes at this rate, to a
place just across the edge of a pull: (contact, gap, rate, how far across, over the reach, rounding of gaps,
h)."""
rebound: Rebound = _joined("rebound", _rebounding, _unchanged)
"""The restitution of a contact at its speed of approach."""
refused: Refused = _joined("refuses", _refusing, _none)
"""The number of a law whose numbers are impossible, -1 where all are possible."""
