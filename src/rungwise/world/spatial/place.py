"""A scene in space at given parameters, ready to be asked what holds at states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene.language.terms import ANGLE, LENGTH, TIME, Dimension
from rungwise.scene.space import SpaceScene
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.simulation.moving.kind import numbered
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.rows import States, scale_of
from rungwise.simulation.spatial.memory import recall
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.state import State
from rungwise.simulation.stepping.plain import pushed
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.spatial.drives import HINGE, SLIDE
from rungwise.system.spatial.space import Space
from rungwise.world.moving.place import MovingPlace


class SpatialPlace(MovingPlace):
    """A scene in space at one set of parameters (see `world.contract.Place`)."""

    def __init__(self, scene: SpaceScene, parameters: Mapping[str, float] | None) -> None:
        super().__init__(scene, *Prepared.of(scene, scene.parameters(parameters)))

    @property
    def space(self) -> Space:
        """The bodies."""
        space: Space = self.system
        return space

    def dimensions(self) -> tuple[tuple[Dimension, ...], tuple[Dimension, ...]]:
        """Dimensions of the coordinates and of the velocities."""
        places, rates = list[Dimension](), list[Dimension]()
        for kind in self.bound.model.jnt_type.tolist():
            own = ANGLE if kind == HINGE else LENGTH
            free = [LENGTH] * 3 if kind == 0 else []
            if kind in (SLIDE, HINGE):
                places.append(own)
                rates.append(own)
            else:
                places += free + [ANGLE] * 4
                rates += free + [ANGLE] * 3
        return tuple(places), tuple(each.times(TIME, -1) for each in rates)

    def scale(self, dimension: Dimension | None) -> float:
        """The size of the scene in this dimension: of the model's extent, the duration and the heaviest body;
        1 where there is none."""
        model = self.bound.model
        gravity, mass = float(np.linalg.norm(model.opt.gravity)), float(model.body_mass.max(initial=0.0))
        return scale_of(dimension, float(model.stat.extent), self.bound.duration, mass, gravity)

    def closed(self, q: Reals, v: Reals, _freedom: Reals) -> tuple[Reals, Reals]:
        """See `world.contract.Place`; velocities stay as they are."""
        model = self.space.model
        if not model.neq and not model.ntendon:
            return q, v
        return np.array([self.space.closed(row) for row in q]), v

    def recall(self, core: Reals) -> None:
        recall(self._stepper, self.space, core)

    def geometry(self, states: States, deadline: Deadline = NEVER) -> tuple[Reals, NDArray[np.bool_], Reals]:
        """Gaps (m, c), collisions (m,), poses (m, b, 7)."""
        rows, template, data = self._rows(states), self.scene.template, self.space.data
        pairs = [tuple(template.bodies.index(name) for name in pair) for pair in template.contacts]
        gaps = np.zeros((len(rows), len(pairs)))
        collides, poses = np.zeros(len(rows), bool), np.zeros((len(rows), len(template.bodies), 7))
        for i, row in enumerate(rows):
            deadline.look()
            gaps[i] = [self.space.gap(row.q, a, b) for a, b in pairs]
            sunk = 0.0 if row.memory is None else self._recalled(row.memory)
            deepest = min((gap for gap, _, _ in self.space.overlaps(row.q)), default=0.0)
            collides[i] = deepest < -(OVERLAP * self.space.size.length + 2.0 * sunk)
            poses[i] = np.hstack([data.xpos, data.xquat])
        return gaps, collides, poses

    def overlap(self, state: State) -> str:
        """Which bodies overlap most at a state; empty where none do."""
        row = self._rows(state)[0]
        allowed = OVERLAP * self.space.size.length + 2.0 * (
            0.0 if row.memory is None else self._recalled(row.memory)
        )
        gap, a, b = min(self.space.overlaps(row.q), default=(0.0, 0, 0))
        names = [self.scene.labels.bodies[int(self.space.solids.body[geom])] for geom in (a, b)]
        return f"{names[0]} and {names[1]} overlap by {-gap:.3g}" if gap < -allowed else ""


def forces_in(memory: Reals, scene: SpaceScene, made: Prepared) -> Reals:
    """Normal forces (c,) of pairs of bodies in the last step of a run of this scene that left this memory."""
    stepper = Stepper(made.system, KINEMATIC, made.bound.step)
    made.system.forget()
    recall(stepper, made.system, memory[memory_parts(scene, memory).core])
    return pushed(made.system, numbered(scene), stepper.state.force)
