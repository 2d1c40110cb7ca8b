"""A scene in space that has been read: its model, and programs of controls and speeds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.plain import cut
from rungwise.scene.space.bind import SpaceBound, Told, bind, normalise
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import Labels
from rungwise.scene.space.laws import smallest
from rungwise.scene.space.mujoco_model import LIBRARY, model_path
from rungwise.scene.space.numbers import FARTHEST
from rungwise.scene.stated import StatedScene
from rungwise.scene.template.template import Followed, block_of


@dataclass(frozen=True)
class SpaceScene(StatedScene):
    """A task in space: the `file` as read, the `folder` in which it lies, the names of its model as `labels`,
    and the model's text, `model_text`."""

    file: SpaceFile
    folder: Path
    labels: Labels
    model_text: str = field(repr=False)
    world: ClassVar[str] = "rungwise.world.spatial"
    self_contained: ClassVar[bool] = False
    farthest: ClassVar[float] = FARTHEST

    def __repr__(self) -> str:
        moving = cut(", ".join(self.template.bodies[1:]), 120)
        parameters = cut(", ".join(self.file.parameters), 120)
        return f"<SpaceScene {cut(self.name)}: bodies {moving}; parameters {parameters or 'none'}>"

    @cached_property
    def content(self) -> str:
        """What tells scenes apart: the file's content and the model's, wherever its file lies."""
        own = self.file.model
        parts = {
            name: part.model_copy(update={"file": Path(part.file).name}) for name, part in own.parts.items()
        }
        changes: dict[str, object] = {"file": Path(own.file).name} | ({"parts": parts} if parts else {})
        model = own.model_copy(update=changes)
        return (
            self.file.model_copy(update={"model": model}).model_dump_json(exclude_unset=True)
            + self.model_text
        )

    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) where the scene starts, at values of `parameters` by name."""
        bound = self.bind(parameters)
        return bound.place, bound.motion

    def normalise(self, q: Reals, field: str, error: type[InputError]) -> None:
        """Make the quaternions in q (n_q,) unit ones. Raises `error`, which names the `field`, where one is
        zero (see `bind.normalise`)."""
        normalise(q, self, field, error)

    @property
    def size(self) -> float:
        """Radius of the smallest geom that moves and may touch."""
        return smallest(self.bind().model)

    @property
    def stored(self) -> str:
        """The scene as JSON, as `load` takes it once decoded, with the places of model files, or the name
        alone of one that ships."""
        given = self.file.model_dump(mode="json", exclude_unset=True)
        for each in (given["model"], *given["model"].get("parts", {}).values()):
            path = model_path(each["file"], self.folder).resolve()
            shipped = path.parent == Path(str(LIBRARY)).resolve()
            each["file"] = path.name if shipped else str(path)
        return json.dumps(given)

    @cached_property
    def told(self) -> Told:
        """Programs of controls and speeds."""
        return Told.of(self)

    @cached_property
    def followed(self) -> Followed:
        """Programs of controls and speeds (see `AnyScene`)."""
        controls, speeds = self.told
        first, time = len(self.labels.actuators), len(self.template.parameters)
        reads_time = any(each.programs.reads(range(time, time + 1)) for each in self.told)
        numbers = block_of(controls.programs, controls.numbers)
        return Followed(block_of(speeds.programs, first + speeds.numbers), numbers, reads_time, False)

    def bind(self, given: Mapping[str, float] | None = None) -> SpaceBound:
        """The model at the `given` parameters. Raises InvalidScene, naming the field, where it is
        impossible."""
        return bind(self, np.array([*self.parameters(given).values(), 0.0]))
