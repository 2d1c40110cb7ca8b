"""A scene of any world at given parameters, ready to run: what runs ask of its numbers and of its system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.stated import StatedScene
from rungwise.system.moving import System


class Bodies(System, Protocol):
    """A system whose bodies a scene speaks of by their numbers; it may be run again and again.

    Where bodies turn, `paces(q, v)` gives the speed (b,) of the farthest point of each, which conditions of
    rest read; otherwise it is that of the body's coordinates. Where the scene says that poses can be read,
    `frames(q)` gives them (b, 12) (see `scene.language.poses`).
    """

    def forget(self) -> None:
        """Know no contact, as before the first step."""

    def gap(self, q: Reals, a: int, b: int) -> float:
        """The distance of two bodies at q (n_q,), negative where they overlap."""

    def pushes(self, force: Reals) -> list[tuple[int, int, float]]:
        """Two bodies and the normal force of each contact, from forces by slot (s, d), normal first."""


class Led(Bodies, Protocol):
    """Bodies that follow a scene's inputs. kept: what the system itself keeps from step to step beside what
    the core keeps by slot, as arrays of eight bytes per entry, which runs that go on overwrite."""

    kept: Sequence[NDArray[Any]]

    def follow(self, middle: Reals, end: Reals) -> None:
        """Take over parameters and t (p + 1,) in the middle of a step, for prescribed speeds, whose ways are
        exact so, and at its end, for loads and targets."""


class Numbers(Protocol):
    """A scene's numbers: parameters and t (p + 1,), tolerance, duration, step, and remarks on them."""

    @property
    def values(self) -> Reals: ...
    @property
    def tolerance(self) -> float: ...
    @property
    def duration(self) -> float: ...
    @property
    def step(self) -> float: ...
    @property
    def notes(self) -> tuple[str, ...]: ...


@dataclass(frozen=True, eq=False)
class Bound:
    """See `Numbers`."""

    values: Reals
    tolerance: float
    duration: float
    step: float
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, scene: StatedScene, parameters: Mapping[str, float]) -> Bound:
        """The numbers of a scene at these parameters. Raises InvalidScene."""
        number, file = scene.numbers(parameters), scene.file
        tolerance, duration, step = (
            number.positive(getattr(file, name), name) for name in ("tolerance", "duration", "step")
        )
        return cls(number.values, tolerance, duration, step)


class Prepared(NamedTuple):
    """A scene's numbers, and its system, which one run at a time may use."""

    bound: Numbers
    system: Any
