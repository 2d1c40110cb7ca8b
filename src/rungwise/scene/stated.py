"""What scenes of all worlds but the plane have in common: fields that they state, names, numbers, conditions.

A world of one's own derives its fields from `Stated` and its scenes from `StatedScene`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from pydantic import ValidationError

from rungwise.kernel import Reals
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.errors import STRICT, SceneError, out_of_range
from rungwise.scene.fields.fields import conversions_of
from rungwise.scene.fields.stated import Stated
from rungwise.scene.fields.task import numbers_of
from rungwise.scene.language.expression import CONDITIONS, SLOTS, STACK, Code, Programs, evaluate
from rungwise.scene.language.names import OF_CONTACTS, Names, with_times
from rungwise.scene.language.poses import NUMBERS
from rungwise.scene.language.units import Conversion
from rungwise.scene.scene import FARTHEST, InvalidScene, as_yaml, explain
from rungwise.scene.template.task import check_fingers, check_task
from rungwise.scene.template.template import Followed, block_of

if TYPE_CHECKING:
    pass

Fields = TypeVar("Fields", bound=Stated)


def read_fields(fields: type[Fields], data: object) -> Fields:
    """Fields from plain values. Raises SceneError: one line that names the field and its valid values."""
    try:
        return fields.model_validate(data)
    except ValidationError as error:
        raise SceneError(explain(error, data)) from None


@dataclass(frozen=True)
class NameTemplate:
    """What expressions, schedules and states speak of: names of parameters, inputs, bodies, coordinates
    (n_q,), velocities (n_v,), pairs of bodies that may touch, the first coordinate of each quaternion,
    which parameters are converted where they are read, and the bodies whose poses can be read."""

    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    contacts: tuple[tuple[str, str], ...]
    turns: tuple[int, ...] = ()
    units: Mapping[str, Conversion] = field(default_factory=dict)
    posed: tuple[str, ...] = ()

    def names(self) -> Names:
        """The names that expressions may use."""
        return Names(
            self.parameters, self.coordinates, self.contacts, self.velocities, self.bodies, self.units,
            self.posed,
        )  # fmt: skip

    @property
    def value_count(self) -> int:
        """Numbers that programs read: parameters, t, q, v, poses, gaps, forces and impulses, times since
        when parts of conditions have held, ways of bodies in a nominal step, tolerance (see `Template`)."""
        moving = len(self.coordinates) + len(self.velocities) + NUMBERS * len(self.posed)
        moving += len(OF_CONTACTS) * len(self.contacts)
        return len(self.parameters) + 2 + moving + SLOTS + len(self.bodies)


@dataclass
class Numbers:
    """Values of a scene's numbers at its parameters."""

    names: Names
    values: Reals
    stack: Reals = field(default_factory=lambda: np.zeros(STACK))

    def one(self, text: float | str, path: str, infinite: bool = False) -> float:
        """The value of a number, which may be `infinite`. Raises InvalidScene where it is none."""
        programs = Programs([self.names.number(str(text), path)])
        start, stop = programs.table[0]
        value = float(evaluate(programs.code, programs.constants, start, stop, self.values, self.stack))
        if np.isnan(value) or (np.isinf(value) and not infinite):
            raise InvalidScene(f"{path}: must be finite, not {value:g}")
        return value

    def positive(self, text: float | str, path: str) -> float:
        """The value of a number that must be more than 0."""
        value = self.one(text, path)
        if not 0.0 < value < np.inf:
            raise InvalidScene(f"{path}: {value:g} must be > 0")
        return value


@dataclass(frozen=True, eq=False)
class StatedScene(AnyScene):
    """A scene that has been read: its file, and the names that expressions may use. See `AnyScene`; what
    derives from it says its `world`, and where it starts."""

    file: Any
    template: NameTemplate
    farthest: ClassVar[float] = FARTHEST

    def __post_init__(self) -> None:
        file = self.file
        units, parameters = conversions_of(file.parameters, file.units), tuple(file.parameters)
        template = replace(self.template, parameters=parameters, inputs=tuple(file.inputs), units=units)
        object.__setattr__(self, "template", template)

    def __repr__(self) -> str:
        bodies, parameters = (
            cut(", ".join(self.template.bodies), 120),
            cut(", ".join(self.file.parameters), 120),
        )
        return f"<{type(self).__name__} {cut(self.name)}: bodies {bodies}; parameters {parameters or 'none'}>"

    def yaml(self) -> str:
        """The scene as a file."""
        return as_yaml(json.loads(self.stored))

    def changed(self, **fields: Any) -> Self:
        """The scene with other fields of its file, such as its goal."""
        return replace(self, file=self.file.model_copy(update=fields))

    def numbers(self, given: Mapping[str, float] | None = None) -> Numbers:
        """What gives the scene's numbers at these parameters, at t = 0."""
        return Numbers(self.template.names(), np.array([*self.parameters(given).values(), 0.0]))

    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at these parameters. Raises InvalidScene for one that is
        out of its bounds."""
        number, found = self.numbers(given), {}
        for place in () if self.file.task is None else numbers_of(self.file.task):
            value = found[place.path] = number.one(place.number, place.path)
            low = place.at_least if place.above is None else place.above
            wrong = out_of_range(value, low, place.at_most, 0 if place.above is None else STRICT)
            if wrong is not None:
                raise InvalidScene(f"{place.path}: {wrong}")
        return found

    @cached_property
    def conditions(self) -> dict[str, Code]:
        """Programs of the conditions that the scene states. Raises SceneError."""
        names = self.template.names()
        stated = {name: getattr(self.file, name) for name in ("goal", "unsafe", "doomed")}
        return {name: names.condition(text, name, name) for name, text in stated.items() if text is not None}

    @cached_property
    def programs(self) -> Programs:
        """Programs of the scene's conditions (see `AnyScene`)."""
        stated = [self.conditions.get(name, Code()) for name in CONDITIONS[:-1]]
        return Programs([*stated, *with_times(stated)])

    @cached_property
    def followed(self) -> Followed:
        """Nothing: the world tells its system itself."""
        nothing = block_of(Programs([]), np.zeros(0, np.int64))
        return Followed(nothing, nothing, False, False)

    def checked(self, robots: tuple[str, ...] = ()) -> Self:
        """The scene, once its conditions and its task speak of nothing unknown; `robots` may be led through
        free space. Raises SceneError."""
        _ = self.conditions
        if self.file.task is not None:
            check_task(self.file.task, self.template.names(), self.file.inputs, robots)
            check_fingers(self.file.task, robots, self.template.bodies, "xyz")
        return self
