"""The end of a run of any world."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.plain import run_of
from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State
from rungwise.simulation.trajectory import save

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    import rungwise


@dataclass(frozen=True, kw_only=True, eq=False)
class AnyRun:
    """The end of a run of any world, and its record; see `rungwise.Run`.

    `scene` is what ran; `model` is the rung, `parameters` their values by name, `outcome` and `reason` say
    how the run ended and why, `time` is where it ended, `steps` and `solves` count time steps and contact
    problems; `inputs` holds the schedule, `theta` is the theta in use (see `Simulation`); `worst_residual` is
    the largest scaled residual of a step that counts as solved; `certificate` proves a jam or a missing
    support; `wall_s` is the time that steps took, without compilation; `notes` are remarks on changes,
    omissions and oddities, a line each (see `simulation.reasons.remarks`)."""

    scene: AnyScene
    model: Rung
    parameters: dict[str, float]
    inputs: tuple[Segment, ...]
    theta: float
    outcome: Outcome
    reason: str
    time: float
    steps: int
    solves: int
    worst_residual: float
    wall_s: float
    certificate: Certificate | None
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the answer is positive: the run came to the goal."""
        return self.outcome.exit_code == 0

    @property
    @abstractmethod
    def began(self) -> bool:
        """Whether the scene is possible at its start."""

    @property
    @abstractmethod
    def state(self) -> State:
        """The state at the end. Raises ValueError for a run that never began."""

    @property
    @abstractmethod
    def states(self) -> list[State]:
        """The states of the recorded frames, in the order of its times."""

    @property
    @abstractmethod
    def trajectory(self) -> xarray.Dataset:
        """The recorded frames. Raises ValueError for a run that never began."""

    @property
    @abstractmethod
    def energy_gained(self) -> float:
        """Energy that contacts added in steps in which something bounced."""

    @property
    @abstractmethod
    def final(self) -> dict[str, dict[str, float]]:
        """Coordinates at the end, by body and name."""

    def __repr__(self) -> str:
        told = f"{self.outcome} at t = {self.time:.6g}, {self.steps} steps"
        return run_of(self, f"{told}, worst residual {self.worst_residual:.1e}")

    def _repr_html_(self) -> str:
        import rungwise

        return rungwise.to_html(self)

    @keywords
    def plot(self, frames: int = 6) -> Figure:
        """Picture of so many frames, from the first to the last (see `rungwise.plot`)."""
        import rungwise

        return rungwise.plot(self, frames=frames)

    def check_begun(self) -> None:
        """Raise ValueError for a run that never began."""
        if not self.began:
            raise ValueError(f"the run did not begin: {self.reason}")

    def summary(self) -> dict[str, object]:
        """Plain values, as `rungwise sim --json` prints them."""
        return {
            "scene": self.scene.name,
            "model": self.model.name,
            "parameters": self.parameters,
            "inputs": [asdict(segment) for segment in self.inputs],
            "outcome": str(self.outcome),
            "reason": self.reason,
            "time": self.time,
            "steps": self.steps,
            "solves": self.solves,
            "final": self.final,
            "worst_residual": self.worst_residual,
            "certificate": None if self.certificate is None else self.certificate.kind,
            "energy_gained": self.energy_gained,
            "notes": list(self.notes),
            "wall_s": round(self.wall_s, 6),
        }

    @keywords
    def save(self, folder: str | Path) -> Path:
        """Write the run into `folder`, whole or not at all; `rungwise.load_run` reads it. Raises OSError,
        and ValueError for a run that never began."""
        return save(folder, self.trajectory, self.summary(), self._kept())

    @keywords
    def joint_trajectory(
        self, names: Sequence[str] | None = None, *, rate: float | None = None
    ) -> rungwise.JointTrajectory:
        """Places, velocities and forces of joints over time, for what executes them: `.save("arm.csv")`, or
        `.json` as a message of ROS.

        Args:
            names: coordinates, or the model's names of joints; those of robots if not given.
            rate: how often in a unit of time; the recorded frames if not given.

        Raises ExportError for names that are no joints, ValueError for a run that never began.
        """
        from importlib import import_module

        found: rungwise.JointTrajectory = import_module("rungwise.world.export.trajectory").joint_trajectory(
            self, names, rate
        )
        return found

    @keywords
    def mjcf(self, at: float | Sequence[float] | None = None, *, whole: bool = True) -> str:
        """The scene as MJCF with keyframes of recorded states (see `rungwise.mjcf`).

        Args:
            at: one time or several; the recorded states nearest to them become keyframes. By default the end
                of the run, or all recorded states if `whole` is false.
            whole: whether the scene is written as well, or only the keyframes.

        Raises ExportError for times outside the run and for a scene without a model, ValueError for a run
        that never began.
        """
        from importlib import import_module

        export: Any = import_module("rungwise.world.export.mjcf")
        states = export.states_at(self, at, not whole)
        text: str = export.mjcf(self.scene, states, parameters=self.parameters, whole=whole)
        return text

    def _kept(self) -> dict[str, np.ndarray[Any, Any]]:
        """What neither trajectory nor summary hold, as arrays."""
        memories = [state.memory.values for state in self.states if state.memory is not None]
        proof = self.certificate
        told = None
        if proof is not None:
            told = [proof.kind, [vector.tolist() for vector in proof.vectors], proof.modes]
        return {
            "memory": np.concatenate(memories),
            "lengths": np.array([len(memory) for memory in memories]),
            "inertia": np.array(self.model.inertia),
            "theta": np.array(self.theta),
            "certificate": np.array(json.dumps(told)),
        }  # fmt: skip


def by_body(names: Iterable[str], values: Iterable[float]) -> dict[str, dict[str, float]]:
    """Values of coordinates, by body and name."""
    found: dict[str, dict[str, float]] = {}
    for name, value in zip(names, values, strict=True):
        body, _, coordinate = name.partition(".")
        found.setdefault(body, {})[coordinate] = float(value)
    return found
