"""What sets of states ask of a scene: names of its state, travel, and runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.deadline import Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.sets.request import THETA
from rungwise.sets.store import SetError
from rungwise.world.contract import Places
from rungwise.world.find import world_of

SPEED_OF = "speed("


@dataclass(frozen=True)
class Macro:
    """What runs of macro-steps share: rung, inputs by name, all parameters, the error allowed, threads."""

    model: Rung
    inputs: tuple[str, ...]
    parameters: dict[str, float]
    accuracy: float
    threads: int | None


class Stated:
    """A scene as sets of states see it; `known`: its coordinates by name, and then speeds."""

    def __init__(self, scene: Any) -> None:
        self.scene, self.world = scene, world_of(scene)
        own, rates = scene.template.coordinates, self.world.velocities
        self.known: tuple[str, ...] = (*own, *(f"{SPEED_OF}{name})" for name in rates))

    def allowed(self, model: Rung) -> tuple[str, ...]:
        """Names of which a state may consist."""
        free = [name for name in self.world.velocities if name not in self.world.prescribed]
        moving = free if model.inertia > 0.0 else []
        return (*self.scene.template.coordinates, *(f"{SPEED_OF}{name})" for name in moving))

    def needed(self, model: Rung) -> tuple[str, ...]:
        """Names without which a state is not known."""
        return self.allowed(model) if self.world.whole_states else ()

    def undriven(self, names: Sequence[str]) -> list[int]:
        """Places in `names` of coordinates that nothing drives."""
        return [k for k, name in enumerate(names) if name in self.world.undriven]

    def travel(self, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Ends of the travel of coordinates."""
        low, high = self.world.at(values).travel.tolist()
        return dict(zip(self.scene.template.coordinates, zip(low, high, strict=True), strict=True))

    def run(
        self, macro: Macro, points: Reals, columns: Ints, states: Reals, duration: float,
        deadline: Deadline, on_progress: Callable[[int], None] | None,
    ) -> tuple[Ints, Reals]:  # fmt: skip
        """Outcomes (m,) and ends (m, d) of runs from states (m, d), columns of all that is known, under
        inputs (m, k); those that the deadline ends are `running`. Raises SetError where something else moves
        as well."""
        runs = self.world.runs(
            macro.model, macro.inputs, macro.parameters, tol=macro.accuracy, theta=THETA, duration=duration,
            threads=macro.threads,
        )  # fmt: skip
        start, n = self.world.at(macro.parameters), len(self.scene.template.coordinates)
        full = np.repeat(np.concatenate([start.q, start.v])[None], len(states), axis=0)
        full[:, columns] = states
        found = runs.run(
            points, Places.by_hand(full[:, :n], full[:, n:]), deadline=deadline, on_progress=on_progress
        )
        ends = np.hstack([found.places.q, found.places.v])
        if not self.world.whole_states:
            self._check_others(macro, columns, np.abs(ends - full)[found.outcome == Code.TIMEOUT])
        return found.outcome, ends[:, columns]

    def _check_others(self, macro: Macro, columns: Ints, moved: Reals) -> None:
        """Raise SetError where coordinates, or speeds that are a state, change beside the named columns;
        moved (m, n_q + n_v): by how much."""
        named, allowed = {self.known[k] for k in columns}, self.allowed(macro.model)
        others = [k for k, name in enumerate(self.known) if name in allowed and name not in named]
        strays = [k for row in moved for k in others if row[k] > macro.accuracy]
        if strays:
            raise SetError(f"over: {self.known[strays[0]]} moves as well, and is no state of the set")
