"""What a scene of any world says of itself, before anything runs."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import finite, shown
from rungwise.scene.language.expression import Programs
from rungwise.scene.template.template import Followed
from rungwise.wording import choices

if TYPE_CHECKING:
    import rungwise
    from rungwise.scene.fields.fields import Parameter


@dataclass(frozen=True, eq=False)
class AnyScene:
    """A manipulation task as it was read.

    file: its fields, among them parameters, goal, unsafe, doomed and task; template: names of its parameters,
    inputs, bodies, coordinates, velocities, and pairs of bodies that may touch (contacts), and `names()`, for
    expressions; farthest: where a coordinate may be at most;
    world: the module of its world (see `rungwise.world`); self_contained: whether it is all in `stored`.
    """

    file: Any
    template: Any
    world: ClassVar[str]
    self_contained: ClassVar[bool] = True
    farthest: ClassVar[float]

    def __eq__(self, other: object) -> bool:
        """Scenes of one class are equal where their content is."""
        return self.content == other.content if type(self) is type(other) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.content)

    def __init_subclass__(cls) -> None:
        # dataclass keeps what a class has, and gives it no equality by fields
        cls.__eq__, cls.__hash__ = AnyScene.__eq__, AnyScene.__hash__  # type: ignore[method-assign]

    @property
    @abstractmethod
    def programs(self) -> Programs:
        """Programs of goal, unsafe and doomed, empty for those that are not stated, and of their parts that
        must hold for a time (see `language.names.with_times`). Raises SceneError."""

    @property
    @abstractmethod
    def followed(self) -> Followed:
        """Programs that write into the buffer of the scene's numbers."""

    @property
    def name(self) -> str:
        """Name of the scene, as its file says."""
        return str(self.file.name)

    @cached_property
    def content(self) -> str:
        """What tells scenes apart: the file's content."""
        return self.stored

    @property
    def whole(self) -> str:
        """All that the scene says."""
        return self.content

    @property
    def stored(self) -> str:
        """The scene as JSON, as `load` takes it once decoded."""
        return str(self.file.model_dump_json(exclude_unset=True))

    @abstractmethod
    def yaml(self) -> str:
        """The scene as a file."""

    @abstractmethod
    def changed(self, **fields: Any) -> Self:
        """The scene with other fields of its file, such as its goal."""

    @keywords
    def parameters(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters, defaults replaced by those `given`.

        Raises SceneError for an unknown name, a value that is no finite number, or one out of range.
        """
        return parameter_values(self.file.parameters, given)

    @abstractmethod
    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at these parameters. Raises InvalidScene."""

    @abstractmethod
    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Reals, Reals]:
        """q (n_q,) and v (n_v,) where the scene starts. Raises InvalidScene where it is impossible."""

    def normalise(self, q: Reals, field: str, error: type[InputError]) -> None:
        """Make the quaternions in q (n_q,), of which most worlds have none, unit ones. Raises the error, at
        the field, where they are far from it."""

    def goal(
        self, states: rungwise.States, parameters: Mapping[str, float] | None = None
    ) -> rungwise.Answers:
        """Whether the goal is reached at states, with signed margins (see `rungwise.ask`)."""
        import rungwise

        return rungwise.ask(self, "goal", states, parameters)


def parameter_values(known: Mapping[str, Parameter], given: Mapping[str, float] | None) -> dict[str, float]:
    """All parameters, defaults replaced by those `given`. Raises SceneError."""
    values = {name: parameter.default for name, parameter in known.items()}
    if not isinstance(given, Mapping | None):
        raise SceneError(f"parameters: must be a mapping of names to numbers, not {shown(given)}")
    for name, value in (given or {}).items():
        if name not in known:
            raise SceneError(f"parameters: unknown {shown(name)}{choices(name, known)}")
        values[name] = _parameter(f"parameters.{name}", value, known[name])
    return values


def _parameter(path: str, value: object, declared: Parameter) -> float:
    """A parameter's value as float, in its range. Raises SceneError."""
    number = finite(path, value, SceneError)
    if declared.range is not None and not declared.range[0] <= number <= declared.range[1]:
        raise SceneError(f"{path}: {number:g} is outside {declared.range[0]:g} to {declared.range[1]:g}")
    return number
