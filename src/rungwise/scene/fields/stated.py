"""Fields that scenes of worlds outside this package have in common, and say nothing of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from rungwise.scene.fields.fields import Parameter, Units
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.task import Task
from rungwise.scene.fields.values import Name, Number, Text


class Stated(Strict):
    """Fields of a scene that say nothing of its bodies; `world` is the name under which its world is known
    (see `scene.worlds`), `inputs` are parameters that a schedule may change during a run."""

    world: Name
    name: Name
    about: Text = ""
    parameters: dict[Name, Parameter] = {}
    units: Units | None = None
    inputs: tuple[Name, ...] = ()
    goal: Text | None = None
    unsafe: Text | None = None
    doomed: Text | None = None
    tolerance: Number = 1e-6
    duration: Number = 1.0
    step: Number = 1e-3
    task: Task | None = None

    @model_validator(mode="after")
    def _inputs_are_parameters(self) -> Self:
        check_inputs(self.inputs, self.parameters)
        return self


def check_inputs(inputs: tuple[str, ...], parameters: Mapping[str, Parameter]) -> None:
    """Raise an error of pydantic for an input that is no parameter."""
    for name in inputs:
        if name not in parameters:
            raise PydanticCustomError("unknown_field", "inputs: {name} is not a parameter", {"name": name})
