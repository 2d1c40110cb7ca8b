"""A scene in space that has been read: its file, names, conditions, and programs of controls and speeds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.plain import cut
from rungwise.scene.errors import STRICT, out_of_range
from rungwise.scene.fields.task import numbers_of
from rungwise.scene.language.expression import Code
from rungwise.scene.language.names import OF_CONTACTS, Names
from rungwise.scene.scene import InvalidScene, as_yaml, parameter_values
from rungwise.scene.space.bind import Numbers, SpaceBound, Told, bind, normalise
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import Labels
from rungwise.scene.space.laws import smallest
from rungwise.scene.space.model import LIBRARY, model_path
from rungwise.scene.space.numbers import FARTHEST

if TYPE_CHECKING:
    import rungwise


@dataclass(frozen=True)
class SpaceTemplate:
    """What expressions, schedules and states speak of: names of parameters, inputs, bodies, coordinates
    (n_q,), velocities (n_v,), pairs of bodies that may touch, and the first coordinate of each quaternion."""

    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    contacts: tuple[tuple[str, str], ...]
    turns: tuple[int, ...]

    def names(self) -> Names:
        """The names that expressions may use."""
        return Names(self.parameters, self.coordinates, self.contacts, self.velocities)

    @property
    def value_count(self) -> int:
        """Numbers that programs read: parameters, t, q, v, gaps, forces and impulses, tolerance."""
        moving = len(self.coordinates) + len(self.velocities)
        return len(self.parameters) + 2 + moving + len(OF_CONTACTS) * len(self.contacts)


@dataclass(frozen=True)
class SpaceScene:
    """A task in space: the file as read, where it lies, the names of its model, and the model's text."""

    file: SpaceFile
    folder: Path
    template: SpaceTemplate
    labels: Labels
    model_text: str = field(repr=False)
    world: ClassVar[str] = "rungwise.world.spatial"
    self_contained: ClassVar[bool] = False
    farthest: ClassVar[float] = FARTHEST

    @property
    def name(self) -> str:
        return self.file.name

    def __repr__(self) -> str:
        moving = cut(", ".join(self.template.bodies[1:]), 120)
        parameters = cut(", ".join(self.file.parameters), 120)
        return f"<SpaceScene {cut(self.name)}: bodies {moving}; parameters {parameters or 'none'}>"

    @cached_property
    def content(self) -> str:
        """What tells scenes apart: the file's content and the model's, wherever its file lies."""
        model = self.file.model.model_copy(update={"file": Path(self.file.model.file).name})
        return (
            self.file.model_copy(update={"model": model}).model_dump_json(exclude_unset=True)
            + self.model_text
        )

    @property
    def whole(self) -> str:
        """All that the scene says."""
        return self.content

    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) where the scene starts."""
        bound = self.bind(parameters)
        return bound.place, bound.motion

    def normalise(self, q: Reals, field: str, error: type[InputError]) -> None:
        """Make the quaternions in q (n_q,) unit ones (see `bind.normalise`)."""
        normalise(q, self, field, error)

    @property
    def size(self) -> float:
        """Radius of the smallest geom that moves and may touch."""
        return smallest(self.bind().model)

    @property
    def stored(self) -> str:
        """The scene as JSON, as `load` takes it once decoded, with the place of the model file, or its name
        alone if it ships."""
        path = model_path(self.file.model.file, self.folder).resolve()
        given = self.file.model_dump(mode="json", exclude_unset=True)
        shipped = path.parent == Path(str(LIBRARY)).resolve()
        return json.dumps(given | {"model": given["model"] | {"file": path.name if shipped else str(path)}})

    def yaml(self) -> str:
        """The scene as a file, with the place of the model file."""
        return as_yaml(json.loads(self.stored))

    def changed(self, **fields: Any) -> SpaceScene:
        """The scene with other fields of its file, such as its goal."""
        return replace(self, file=self.file.model_copy(update=fields))

    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at these parameters. Raises InvalidScene for one that is
        out of its bounds."""
        number = Numbers(self.template.names(), np.array([*self.parameters(given).values(), 0.0]))
        found = {}
        for place in () if self.file.task is None else numbers_of(self.file.task):
            value = found[place.path] = number.one(place.number, place.path)
            low = place.at_least if place.above is None else place.above
            wrong = out_of_range(value, low, place.at_most, 0 if place.above is None else STRICT)
            if wrong is not None:
                raise InvalidScene(f"{place.path}: {wrong}")
        return found

    @keywords
    def parameters(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters, defaults replaced by those `given`. Raises SceneError as `Scene.parameters`."""
        return parameter_values(self.file.parameters, given)

    @cached_property
    def conditions(self) -> dict[str, Code]:
        """Programs of the conditions that the scene states."""
        names = self.template.names()
        stated = {name: getattr(self.file, name) for name in ("goal", "unsafe", "doomed")}
        return {name: names.condition(text, name) for name, text in stated.items() if text is not None}

    @cached_property
    def told(self) -> Told:
        """Programs of controls and speeds."""
        return Told.of(self)

    def goal(
        self, states: rungwise.States, parameters: Mapping[str, float] | None = None
    ) -> rungwise.Answers:
        """Whether the goal is reached at states, with signed margins (see `rungwise.ask`)."""
        import rungwise

        return rungwise.ask(self, "goal", states, parameters)

    def bind(self, given: Mapping[str, float] | None = None) -> SpaceBound:
        """The model at these parameters. Raises InvalidScene, naming the field, where it is impossible."""
        return bind(self, np.array([*self.parameters(given).values(), 0.0]))
