"""The end of a run and its record."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.judge import Certificate
from rungwise.contact.step import ContactProblem
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.plain import cut
from rungwise.scene import Scene
from rungwise.scene.template import records as rec
from rungwise.simulation import trajectory
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.state.workspace import Workspace, in_memory
from rungwise.simulation.state import Memory, State, digest

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from rungwise.simulation.reasons.hard_steps import HardSteps


@dataclass(frozen=True)
class Run:
    """The end of a run and its record.

    `motion` holds the preferred velocities, `inputs` the schedule, `theta` is the theta in use (see
    `Simulation`); `final` maps body -> coordinate -> value; `worst_residual` is the largest scaled residual
    of a step that counts as solved; `problem` is the problem of the last step, where it had no solution, and
    `certificate` proves a jam or a missing support; `hard` holds the saved hard steps, if asked for; `wall_s`
    is the time that steps took, without compilation; `workspace` holds the arrays as the run left them;
    `notes` are remarks on changes, omissions and oddities, a line each (see `simulation.reasons.remarks`)."""

    scene: Scene
    model: Rung
    parameters: dict[str, float]
    motion: dict[str, float]
    inputs: tuple[Segment, ...]
    theta: float
    outcome: Outcome
    reason: str
    time: float
    steps: int
    attempts: int
    solves: int
    worst_residual: float
    wall_s: float
    certificate: Certificate | None
    problem: ContactProblem | None
    workspace: Workspace | None
    hard: HardSteps | None = None
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the answer is positive: the run came to the goal."""
        return self.outcome.exit_code == 0

    @property
    def began(self) -> bool:
        """Whether the scene is possible at its start."""
        return self.workspace is not None

    def __repr__(self) -> str:
        return (
            f"<Run of {cut(self.scene.name)} on {cut(self.model.name)}: {self.outcome} at t ="
            f" {self.time:.6g}, {self.steps} steps, worst residual {self.worst_residual:.1e}>"
        )

    def _repr_html_(self) -> str:
        import rungwise

        return rungwise.to_html(self)

    @keywords
    def plot(self, frames: int = 6) -> Figure:
        """Picture of so many frames, from the first to the last (see `rungwise.plot`)."""
        import rungwise

        return rungwise.plot(self, frames=frames)

    @property
    def final(self) -> dict[str, dict[str, float]]:
        """Coordinates at the end, by body and name."""
        places: dict[str, dict[str, float]] = {}
        if self.workspace is not None:
            for name, value in zip(self.scene.template.coordinates, self.workspace.state.q, strict=True):
                body, coordinate = name.split(".")
                places.setdefault(body, {})[coordinate] = float(value)
        return places

    @property
    def energy_gained(self) -> float:
        """Energy that contacts added in steps in which something bounced: 0 by all laws of this program but
        one, Newton's restitution together with friction (Kane and Levinson, Dynamics, 1985).

        It is the sum of the work of contacts over the steps in which it was positive beyond rounding.
        """
        return 0.0 if self.workspace is None else float(self.workspace.state.clock[0]["gained"])

    @property
    def state(self) -> State:
        """The state at the end of the run. Raises ValueError for a run that never began."""
        if self.workspace is None:
            raise ValueError(f"the run did not begin: {self.reason}")
        return self._state(self.workspace.state.memory, digest(self.scene))

    @property
    def states(self) -> list[State]:
        """The states of the recorded frames, in the order of `trajectory.time`."""
        if self.workspace is None:
            return []
        count, scene = int(self.workspace.state.clock[0]["frames"]), digest(self.scene)
        return [self._state(memory, scene) for memory in self.workspace.frames.memory[:count]]

    def _state(self, memory: Reals, scene: str) -> State:
        assert self.workspace is not None
        kept = Memory(memory, scene, self.model, self.theta, self.inputs)
        q, v, time = (
            in_memory(self.workspace.state, name, kept.values[None])[0] for name in ("q", "v", "time")
        )
        return State(self.scene.template.coordinates, q, v, float(time), kept)

    @cached_property
    def trajectory(self) -> xarray.Dataset:
        """The recorded frames (see `trajectory.dataset`). Raises ValueError for a run that never began."""
        if self.workspace is None:
            raise ValueError(f"the run did not begin: {self.reason}")
        data = trajectory.dataset(self.scene, self.model, self.workspace, pair_labels(self.scene))
        return data.assign_attrs(outcome=str(self.outcome), reason=self.reason)

    def summary(self) -> dict[str, object]:
        """Plain values, as `rungwise sim --json` prints them."""
        return {
            "scene": self.scene.name,
            "model": self.model.name,
            "parameters": self.parameters,
            "motion": self.motion,
            "inputs": [asdict(segment) for segment in self.inputs],
            "outcome": str(self.outcome),
            "reason": self.reason,
            "time": self.time,
            "steps": self.steps,
            "attempts": self.attempts,
            "solves": self.solves,
            "final": self.final,
            "worst_residual": self.worst_residual,
            "certificate": None if self.certificate is None else self.certificate.kind,
            "energy_gained": self.energy_gained,
            "notes": list(self.notes),
            "wall_s": round(self.wall_s, 6),
            **({} if self.hard is None else {"hard": self.hard.summary()}),
        }

    @keywords
    def save(self, folder: str | Path) -> Path:
        """Write trajectory and summary into `folder` (see `trajectory.save`)."""
        return trajectory.save(folder, self.trajectory, self.summary())


def pair_labels(scene: Scene) -> list[str]:
    """A label for each pair of shapes: the contact's bodies, numbered where a body has several shapes."""
    template = scene.template
    contact_of = rec.views(template.buffer, template.counts).pairs["contact"]
    labels = []
    for index, contact in enumerate(contact_of):
        name = "|".join(template.contacts[int(contact)])
        several = int(np.sum(contact_of == contact)) > 1
        labels.append(f"{name}/{int(np.sum(contact_of[:index] == contact))}" if several else name)
    return labels


def texts(outcomes: Ints) -> NDArray[np.str_]:
    """Outcomes as texts, from their codes, of the same shape."""
    return np.array([str(outcome) for outcome in Outcome])[outcomes]


def counted(outcomes: Ints) -> str:
    """How many runs ended how, from codes."""
    names, counts = np.unique(texts(outcomes), return_counts=True)
    return ", ".join(f"{name} {count}" for name, count in zip(names, counts, strict=True)) or "none"
