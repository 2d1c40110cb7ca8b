"""What a scene of any world says of itself, before anything runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

from rungwise.errors import InputError
from rungwise.kernel import Reals


class AnyScene(Protocol):
    """A manipulation task as it was read.

    file: its fields, among them parameters, goal, unsafe, doomed and task; template: names of its parameters,
    inputs, bodies, coordinates, velocities, and pairs of bodies that may touch (contacts), and `names()`, for
    expressions; farthest: where a coordinate may be at most;
    world: the module of its world (see `rungwise.world`); self_contained: whether it is all in `stored`.
    """

    @property
    def name(self) -> str: ...
    @property
    def file(self) -> Any: ...
    @property
    def template(self) -> Any: ...
    @property
    def world(self) -> str: ...
    @property
    def self_contained(self) -> bool: ...

    @property
    def farthest(self) -> float: ...

    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) where the scene starts."""

    def normalise(self, q: Reals, field: str, error: type[InputError]) -> None:
        """Make the quaternions in q (n_q,) unit ones. Raises the error, at the field, where they are far from
        it."""

    def yaml(self) -> str:
        """The scene as a file."""

    @property
    def content(self) -> str:
        """What tells scenes apart."""

    @property
    def whole(self) -> str:
        """All that the scene says, defaults as well."""

    @property
    def stored(self) -> str:
        """The scene as JSON, as `load` takes it once decoded."""

    def parameters(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters, defaults replaced by those `given`. Raises SceneError."""

    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at these parameters. Raises InvalidScene."""

    def changed(self, **fields: Any) -> Self:
        """The scene with other fields of its file, and without those that are None."""
