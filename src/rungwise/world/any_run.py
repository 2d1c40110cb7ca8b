"""The end of a run of any world, as everything above worlds sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State

if TYPE_CHECKING:
    from pathlib import Path

    import xarray

    from rungwise.contact.judge import Certificate
    from rungwise.scene.contract import AnyScene


class AnyRun(Protocol):
    """The end of a run of any world, and its record; see `rungwise.Run`."""

    @property
    def scene(self) -> AnyScene: ...
    @property
    def model(self) -> Rung: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def inputs(self) -> tuple[Segment, ...]: ...
    @property
    def outcome(self) -> Outcome: ...
    @property
    def reason(self) -> str: ...
    @property
    def time(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def solves(self) -> int: ...
    @property
    def worst_residual(self) -> float: ...
    @property
    def wall_s(self) -> float: ...
    @property
    def certificate(self) -> Certificate | None: ...
    @property
    def notes(self) -> tuple[str, ...]: ...

    @property
    def energy_gained(self) -> float:
        """Energy that contacts added in steps in which something bounced."""

    @property
    def ok(self) -> bool:
        """Whether the run came to the goal."""

    @property
    def began(self) -> bool:
        """Whether the scene is possible at its start."""

    @property
    def final(self) -> dict[str, dict[str, float]]:
        """Coordinates at the end, by body and name."""

    @property
    def state(self) -> State:
        """The state at the end. Raises ValueError for a run that never began."""

    @property
    def states(self) -> list[State]:
        """The states of the recorded frames."""

    @property
    def trajectory(self) -> xarray.Dataset:
        """The recorded frames. Raises ValueError for a run that never began."""

    def summary(self) -> dict[str, object]:
        """Plain values."""

    def save(self, folder: str | Path) -> Path:
        """Write trajectory and summary into a folder."""
