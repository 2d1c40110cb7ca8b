"""Running a scene in space on a rung."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.scene.read import load_in_space
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.begin import Fault
from rungwise.simulation.moving.frames import Row
from rungwise.simulation.moving.run import MovingSimulation
from rungwise.simulation.spatial.begin import faults_before, misplaced
from rungwise.simulation.spatial.frames import Frame, contacts_of, frame_of
from rungwise.simulation.spatial.memory import recall
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.spatial.reasons import crawled, fastest, snapped, stuck
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.spatial.space import Space
from rungwise.system.spatial.turning import remarks


class SpaceSimulation(MovingSimulation):
    """A run in space that is taken in turns; arguments and errors as of `simulation.run.Simulation`, but that
    no frames are kept where `frames` is None, and that a scene may be `prepared` at these parameters."""

    scene: SpaceScene
    _bound: SpaceBound
    kind: ClassVar[str] = "scenes in space"
    run_of: ClassVar[Callable[..., Any]] = SpaceRun

    def __init__(
        self,
        scene: SpaceScene | str | Path | Mapping[str, Any],
        model: Rung | str,
        *,
        prepared: Prepared | None = None,
        **options: Any,
    ) -> None:
        loaded = load_in_space(scene)

        def prepare(parameters: dict[str, float]) -> Any:
            return Prepared.of(loaded, parameters) if prepared is None else prepared

        super().__init__(loaded, model, prepare, **options)

    @property
    def space(self) -> Space:
        """The bodies."""
        space: Space = self.system
        return space

    def result(self) -> SpaceRun:
        """The run as far as it has come."""
        run: SpaceRun = super().result()
        return run if self.stepper is None else replace(run, space=self.space)

    @property
    def buffer(self) -> Reals:
        return self._bound.numbers

    def undefined(self, place: int, time: float) -> str:
        return self._bound.wrong(place, time)

    def begins(self, stepper: Stepper) -> None:
        self.space.begin(stepper.q, stepper.v)

    def recall(self, core: Reals) -> None:
        assert self.stepper is not None
        recall(self.stepper, self.space, core)

    def hand_on(self, core: Reals) -> None:
        margin = self.space.margin
        super().hand_on(core)
        self.space.look_within(margin)

    def frame(self, row: Row) -> Frame:
        return frame_of(row, self.scene, self.space)

    def contacts(self, knows_forces: bool) -> Contacts:
        assert self.stepper is not None
        return contacts_of(self.stepper, self.space, self.scene.labels, self._bound.tolerance, knows_forces)

    def faults_before(self, parameters: dict[str, float], q: Reals) -> list[Fault]:
        return faults_before(self.scene, parameters, q)

    def misplaced(self, q: Reals, before: list[Fault], field: str) -> str:
        return misplaced(self.scene, self.space, q, before, field)

    def fastest(self, v: Reals) -> str:
        return fastest(self.space, self.scene.labels.bodies, v)

    def crawled(self, stepper: Stepper) -> str:
        return crawled(stepper, self.space, self.scene.labels)

    def stuck(self, stepper: Stepper) -> str:
        return stuck(stepper, self.space, self.scene.labels.bodies)

    def snapped(self, stepper: Stepper) -> str:
        return snapped(stepper, self.space, self.scene.labels.bodies)

    def remarks(self) -> tuple[str, ...]:
        return self.notes + (() if self.stepper is None else remarks(self.space.turning))
