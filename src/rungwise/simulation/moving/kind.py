"""What runs of worlds with systems of another kind say otherwise: memory, frames, faults and words."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.stated import StatedScene
from rungwise.simulation.core.crawl import why_nowhere
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.simulation.live.observation import Contacts, without_places
from rungwise.simulation.moving.begin import Fault, worst
from rungwise.simulation.moving.frames import Frame, Row
from rungwise.simulation.moving.memory import begin_anew, memory_parts, recall
from rungwise.simulation.moving.result import MovingRun
from rungwise.simulation.moving.snaps import led_on, snaps
from rungwise.simulation.moving.values import slots_of
from rungwise.simulation.stepping.plain import pushed
from rungwise.simulation.stepping.stepper import Stepper


class Kind:
    """Runs of systems that keep features in fixed slots, and whose bodies are the same at all parameters."""

    scene: StatedScene
    system: Any
    stepper: Stepper | None
    notes: tuple[str, ...]

    @abstractmethod
    def memory(self) -> Reals:
        """What the run hands on (w,)."""

    kind: ClassVar[str] = "scenes of this world"
    run_of: ClassVar[Callable[..., Any]] = MovingRun

    @property
    def buffer(self) -> Reals:
        """The scene's numbers (k,), into which its inputs are followed."""
        return np.zeros(0)

    def undefined(self, place: int, time: float) -> str:
        """What is wrong with a number of these that is not finite."""
        raise NotImplementedError

    def begins(self, stepper: Stepper) -> None:
        """The run begins where the stepper is."""
        told: Any = stepper.inside
        told.pairs = self._pairs

    def give_back(self) -> None:
        """The run is over, and what it was made of may serve others."""

    def recall(self, core: Reals) -> None:
        """Go on as the run that handed this on. Raises ValueError where it is of another system."""
        assert self.stepper is not None
        recall(self.stepper, core)

    def hand_on(self, core: Reals) -> None:
        """Begin with the contacts of a run on another rung or at other parameters: features keep their modes,
        forces, and where they are compliant their deformations, and clocks begin anew. Raises ValueError."""
        stepper = self.stepper
        assert stepper is not None
        clock, fall = stepper.state.clock.copy(), stepper.terms.fall.copy()
        self.recall(core)
        stepper.state.clock[:], stepper.terms.fall[:] = clock, fall
        begin_anew(stepper)

    def frame(self, row: Row) -> Any:
        """A frame of how it was recorded."""
        template, slots = self.scene.template, slots_of(self.scene.template)
        values, count = row.memory[memory_parts(self.scene, row.memory).values], len(self._pairs)
        places, speeds = (
            values[slots.time + 1 : slots.speeds],
            values[slots.speeds :][: len(template.velocities)],
        )
        return Frame(
            float(values[slots.time]), places, speeds, row.memory, row.residual, float(row.rest[0]), row.work,
            row.rest[1 : 1 + count], row.rest[1 + count :],
        )  # fmt: skip

    @property
    def forces(self) -> Reals:
        """Normal forces (c,) of the scene's pairs of bodies in the last step."""
        assert self.stepper is not None
        return pushed(self.system, self._pairs, self.stepper.state.force)

    def contacts(self, knows_forces: bool) -> Contacts:
        """Contacts of the last step; forces are nan where the rung `knows_forces` not."""
        assert self.stepper is not None
        bodies, found = self.scene.template.bodies, self.system.pushes(self.stepper.state.force)
        pushes = [push if knows_forces else np.nan for _, _, push in found]
        return without_places([(bodies[a], bodies[b]) for a, b, _ in found], pushes)

    @property
    def _pairs(self) -> list[tuple[int, int]]:
        """Numbers of bodies of the scene's pairs (c,), the lower first."""
        return numbered(self.scene)

    def faults(self, q: Reals) -> list[Fault]:
        """What is amiss at q (n_q,)."""
        gaps = [(self.system.gap(q, a, b), a, b) for a, b in self._pairs]
        return [Fault("overlap", (a, b), -gap) for gap, a, b in gaps if gap < 0.0]

    def faults_before(self, _parameters: dict[str, float], q: Reals) -> list[Fault]:
        """What was amiss at q in a run at these parameters: the same as here, for the bodies are the same."""
        return self.faults(q)

    def misplaced(self, q: Reals, before: list[Fault], field: str) -> str:
        """What is amiss at q, more than before; empty if nothing is. The line begins with `field`, the start
        or the state."""
        found = worst(self.faults(q), before, {"overlap": OVERLAP * self.system.size.length})
        if found is None:
            return ""
        one, other = (self.scene.template.bodies[k] for k in found.numbers)
        return f"{field}: {one} and {other} overlap by {found.by:.3g}"

    def fastest(self, v: Reals) -> str:
        """What moves fastest at v (n_v,)."""
        return self.scene.template.velocities[int(np.argmax(np.abs(v)))].partition(".")[0]

    def crawled(self, stepper: Stepper) -> str:
        """What kept the steps short of a run whose steps led nowhere."""
        clock = stepper.clock
        why = why_nowhere(int(clock["crowd"]), stepper.time - float(clock["mark"]), stepper.step, "")
        return f"{why}. The fastest body is {self.fastest(stepper.v)}. A smaller step, or tol, may help."

    def stuck(self, stepper: Stepper) -> str:
        """What a step lacks that has neither a solution nor a proof, and what may lead on."""
        return led_on(stepper, "")

    def snapped(self, stepper: Stepper) -> str:
        """What left its balance, when and how far."""
        return snaps(stepper, self.fastest(stepper.scratch.v_new), "")

    def remarks(self) -> tuple[str, ...]:
        """Remarks on the scene's numbers and on the geometry of contacts."""
        return self.notes


def numbered(scene: StatedScene) -> list[tuple[int, int]]:
    """Numbers of bodies of a scene's pairs (c,), the lower first."""
    index = scene.template.bodies.index
    return [(min(index(a), index(b)), max(index(a), index(b))) for a, b in scene.template.contacts]
