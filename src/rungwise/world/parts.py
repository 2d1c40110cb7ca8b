"""What worlds are made of, whichever they are: parts that begin with a scene, and instances of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene
from rungwise.simulation.state import State

if TYPE_CHECKING:
    from rungwise.simulation.derivatives.slopes import Slopes

Made = TypeVar("Made")
Numbers = TypeVar("Numbers")


class of_scene(Generic[Made]):
    """A member of a world that calls a class or a function with the world's scene, and what is given after
    it: with ``at = of_scene(PlanarInstance)``, ``world.at(parameters)`` is ``PlanarInstance(world.scene,
    parameters)``."""

    def __init__(self, made: Callable[..., Made]) -> None:
        self._made = made

    def __get__(self, world: Any, _kind: type) -> Callable[..., Made]:
        return partial(self._made, world.scene)


def _of_bound(name: str) -> Any:
    """A property of an instance that is a number of what is bound."""
    return property(lambda instance: float(getattr(instance.bound, name)))


class BoundInstance(ABC):
    """A scene at one set of parameters (see `world.contract.Instance`), where nothing lies on
    supports unless its world knows of some."""

    @property
    @abstractmethod
    def bound(self) -> Any:
        """The scene's numbers, among them duration, step and tolerance."""

    @property
    @abstractmethod
    def _start(self) -> tuple[Reals, Reals]:
        """Where the scene starts, q and v."""

    @property
    def q(self) -> Reals:
        return self._start[0]

    @property
    def v(self) -> Reals:
        return self._start[1]

    duration, step, tolerance = (_of_bound(name) for name in ("duration", "step", "tolerance"))

    @property
    def stops(self) -> Reals | None:
        return None


@dataclass(frozen=True)
class SceneInstance(BoundInstance, Generic[Numbers]):
    """An instance whose numbers are what the scene binds, once they are asked for."""

    scene: Any
    parameters: Mapping[str, float] | None = None

    @cached_property
    def bound(self) -> Numbers:
        numbers: Numbers = self.scene.bind(self.parameters)
        return numbers


class ExportError(InputError):
    """Something cannot be written for another program; one line that says what, and what can."""


class Exported(Protocol):
    """What a world says of its scene to other programs."""

    def joints(self) -> dict[str, str]:
        """Coordinates that are single numbers, and what other programs call their joints."""

    def mjcf(self, parameters: Mapping[str, float], states: Sequence[State], *, whole: bool = True) -> str:
        """The scene as MJCF with a keyframe for each state, or the keyframes alone. Raises ExportError."""


class Sloped(Protocol):
    """Where the inputs of a world's scene lead."""

    def slopes(self, parameters: Mapping[str, float], h: float, near: float) -> Slopes:
        """Derivatives by inputs of where steps of length h of the quasistatic-compliant rung lead, with
        bodies that reach farther by `near`. Raises ModelError where the scene's steps have none."""


def coordinates_as_joints(scene: AnyScene) -> dict[str, str]:
    """Every coordinate by its own name."""
    return {name: name for name in scene.template.coordinates}


def no_model(
    scene: AnyScene, _parameters: Mapping[str, float], _states: Sequence[State], **_whole: bool
) -> str:
    """Raise ExportError: the scene has no model in MJCF."""
    raise ExportError(
        f"scene: {scene.name} has no MuJoCo model, and MJCF is written only for scenes that have one;"
        " trajectories of joints are written for every scene"
    )
