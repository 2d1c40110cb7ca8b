"""Names that a scene's expressions may use, and the programs that expressions compile to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from rungwise.scene.errors import SceneError
from rungwise.scene.language.compiler import compile_expression
from rungwise.scene.language.expression import CONDITIONS, CONSTANTS, FUNCTIONS, SLOTS, TIMES, Code
from rungwise.scene.language.lasting import REST, ExpressionError
from rungwise.scene.language.poses import AT, AXES, NUMBERS, slot_of
from rungwise.scene.language.units import Conversion
from rungwise.wording import choices

OF_CONTACTS = ("gap", "force", "impulse")
"""Functions of two bodies that a condition may call, in the order of their values."""


class Names:
    """Names of a scene and their slots among the values that programs read (see `Template`).

    `velocities` are what `speed` takes, the coordinates if not given; `bodies` what `rest` takes, `posed`
    those whose poses can be read; `units` says which parameters are converted. `read`
    collects, for each function of `OF_CONTACTS`, the contacts for which some condition calls it.
    """

    def __init__(
        self,
        parameters: tuple[str, ...],
        coordinates: tuple[str, ...],
        contacts: tuple[tuple[str, str], ...],
        velocities: tuple[str, ...] | None = None,
        bodies: tuple[str, ...] = (),
        units: Mapping[str, Conversion] = MappingProxyType({}),
        posed: tuple[str, ...] = (),
    ) -> None:
        for name in parameters:
            if name in FUNCTIONS or name in CONSTANTS or name in ("t", "tolerance", "speed", *OF_CONTACTS):
                raise SceneError(f"parameters.{name}: the name is taken by the expression language")
        self.parameters, self.coordinates, self.contacts = parameters, coordinates, contacts
        self.velocities = coordinates if velocities is None else velocities
        self.bodies, self.units, self.posed = bodies, units, posed
        self.read: dict[str, set[int]] = {function: set() for function in OF_CONTACTS}

    def number(self, text: str, path: str, timed: bool = False) -> Code:
        """Program of a number of the parameters, and of t if it is timed. Raises SceneError at `path`."""
        names = (*self.parameters, "t") if timed else self.parameters

        def lookup(function: str, dotted: tuple[str, ...]) -> int | None:
            return names.index(dotted[0]) if not function and dotted[0] in names else None

        try:
            return compile_expression(text, lookup, lambda name: choices(name, names), units=self.units)
        except ExpressionError as error:
            raise SceneError(f"{path}: {error}") from None

    def condition(self, text: str | None, path: str, lasts: str = "") -> Code:
        """Program of a condition on the state; an empty one where none is stated. Where it is one of
        `CONDITIONS`, `lasts`, its parts may be asked to hold for a time. Raises SceneError."""
        if text is None:
            return Code()
        try:
            return compile_expression(
                text,
                self.of_state,
                self._state_choices,
                condition=True,
                slots=self.slots(lasts),
                units=self.units,
            )
        except ExpressionError as error:
            raise SceneError(f"{path}: {error}") from None

    def slots(self, lasts: str) -> range:
        """Slots of the times since when parts of one of `CONDITIONS` have held; none for other conditions."""
        if lasts not in CONDITIONS:
            return range(0)
        first = self._first_of_contacts + len(OF_CONTACTS) * len(self.contacts)
        first += TIMES * CONDITIONS.index(lasts)
        return range(first, first + TIMES)

    @property
    def ways(self) -> range:
        """Slots of how far bodies go in a nominal step, which `rest` reads."""
        first = self._first_of_contacts + len(OF_CONTACTS) * len(self.contacts) + SLOTS
        return range(first, first + len(self.bodies))

    @property
    def _first_of_contacts(self) -> int:
        return self._first_of_poses + NUMBERS * len(self.posed)

    @property
    def _first_of_poses(self) -> int:
        return len(self.parameters) + 1 + len(self.coordinates) + len(self.velocities)

    def _state_choices(self, given: str) -> str:
        names = [*self.parameters, "t", "tolerance", *self.coordinates, "speed(coordinate)"]
        names += [f"{f}({a}, {b})" for a, b in self.contacts for f in OF_CONTACTS]
        names += [f"{REST}({body})" for body in self.bodies]
        names += [f"{AT}({body}, {axis})" for body in self.posed for axis in AXES]
        return choices(given, names)

    def of_state(self, function: str, dotted: tuple[str, ...]) -> int | None:
        """The slot of a name, or of a function of names, that conditions read; None if there is none."""
        time = len(self.parameters)
        n, contacts = len(self.coordinates), len(self.contacts)
        moving = self._first_of_contacts - time - 1
        if function == "speed" and len(dotted) == 1 and dotted[0] in self.velocities:
            return time + 1 + n + self.velocities.index(dotted[0])
        if not function and len(dotted) == 1:
            if dotted[0] in self.coordinates:
                return time + 1 + self.coordinates.index(dotted[0])
            if dotted[0] in (*self.parameters, "t"):
                return (*self.parameters, "t").index(dotted[0])
            if dotted[0] == "tolerance":
                return self.ways.stop
        if function == REST and len(dotted) == 1 and dotted[0] in self.bodies:
            return self.ways[self.bodies.index(dotted[0])]
        if len(dotted) == 2 and dotted[0] in self.posed:
            which = slot_of(function, dotted[1])
            if which is not None:
                return self._first_of_poses + NUMBERS * self.posed.index(dotted[0]) + which
        if function in OF_CONTACTS and len(dotted) == 2:
            for pair in (dotted, dotted[::-1]):
                if pair in self.contacts:
                    index = self.contacts.index(pair)
                    self.read[function].add(index)
                    return time + 1 + moving + index + OF_CONTACTS.index(function) * contacts
        return None


def with_times(conditions: Sequence[Code]) -> list[Code]:
    """For each slot of these conditions, the part that must hold for a time, and the time; empty where a slot
    is free; nothing where no part of them must."""
    if not any(code.lasting for code in conditions):
        return []
    found = list[Code]()
    for code in conditions:
        own = [each for part in code.lasting for each in (part.held, part.span)]
        found += own + [Code()] * (2 * TIMES - len(own))
    return found
