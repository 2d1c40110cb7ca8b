"""The end of a run and its record."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import ContactProblem
from rungwise.kernel import Ints, Reals
from rungwise.outcome import Outcome
from rungwise.scene import Scene
from rungwise.scene.template import records as rec
from rungwise.simulation import trajectory
from rungwise.simulation.any_run import AnyRun, by_body
from rungwise.simulation.planar.state.workspace import Workspace, in_memory
from rungwise.simulation.state import Memory, State, digest

if TYPE_CHECKING:
    import xarray

    from rungwise.simulation.reasons.hard_steps import HardSteps


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Run(AnyRun):
    """The end of a run of a planar scene and its record (see `AnyRun`).

    `attempts` counts steps that were tried, refused ones included; `motion` holds the preferred velocities;
    `final` maps body -> coordinate -> value; `problem` is the problem of the last step, where it had no
    solution; `hard` holds the saved hard steps, if asked for; `workspace` holds the arrays as the run left
    them."""

    scene: Scene
    motion: dict[str, float]
    attempts: int
    problem: ContactProblem | None
    workspace: Workspace | None
    hard: HardSteps | None = None

    @property
    def began(self) -> bool:
        return self.workspace is not None

    @property
    def final(self) -> dict[str, dict[str, float]]:
        if self.workspace is None:
            return {}
        return by_body(self.scene.template.coordinates, self.workspace.state.q)

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
        self.check_begun()
        assert self.workspace is not None
        return self._state(self.workspace.state.memory, digest(self.scene))

    @property
    def states(self) -> list[State]:
        """The states of the recorded frames, in the order of its times."""
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
        self.check_begun()
        assert self.workspace is not None
        data = trajectory.dataset(self.scene, self.model, self.workspace, pair_labels(self.scene))
        return data.assign_attrs(outcome=str(self.outcome), reason=self.reason)

    def summary(self) -> dict[str, object]:
        found: dict[str, object] = {}
        for name, value in super().summary().items():
            found[name] = value
            if name == "parameters":
                found["motion"] = self.motion
            elif name == "steps":
                found["attempts"] = self.attempts
        return found if self.hard is None else found | {"hard": self.hard.summary()}


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
