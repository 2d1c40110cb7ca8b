"""Diagnoses that are made when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.models.ladder import Rung
from rungwise.planning.diagnosis.diagnose import Diagnosis, Watch, diagnosed
from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import Segment


@dataclass(frozen=True)
class Deferred:
    """Why the motion under inputs, at parameters, differs between two rungs. models, names, tols: the rungs,
    the names of the stages, and the errors allowed per step, of both; limit: seconds in which it is made,
    from when it is asked for."""

    scene: AnyScene
    parameters: dict[str, float]
    inputs: tuple[Segment, ...]
    models: tuple[Rung, Rung]
    names: tuple[str, str]
    tols: tuple[float, float]
    limit: float | None = None

    @cached_property
    def found(self) -> Diagnosis | None:
        """The diagnosis; None where the limit is over before it."""
        try:
            return self.made(Watch(None, Deadline(seconds(self.limit))))
        except TimeOver:
            return None

    def made(self, watch: Watch) -> Diagnosis:
        """The diagnosis, made now. Raises TimeOver."""
        one, other = self.models
        made = diagnosed(
            self.scene, one, other, watch, inputs=self.inputs, tol=self.tols[0], other_tol=self.tols[1],
            parameters=self.parameters,
        )  # fmt: skip
        return made.called(*self.names)
