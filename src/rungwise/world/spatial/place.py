"""A scene in space at given parameters, ready to be asked what holds at states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import STACK, Programs
from rungwise.scene.language.terms import ANGLE, LENGTH, TIME, Dimension, Term
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.bind import normalise
from rungwise.simulation.core.stepper import OVERLAP, Stepper
from rungwise.simulation.planar.questions import read
from rungwise.simulation.rows import States, finite_rows, scale_of
from rungwise.simulation.spatial.memory import memory_parts, recall
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.spatial.values import Values, pushes
from rungwise.simulation.state import Memory, State, StateError, check_state, digest

SLIDE, HINGE = 2, 3
"""Numbers of MuJoCo's joints that move along, and about, an axis."""


class _Row(NamedTuple):
    """A state: time, q, v, and the memory of a run of this scene, if it has one."""

    time: float
    q: Reals
    v: Reals
    memory: Memory | None = None


class SpatialPlace:
    """A scene in space at one set of parameters (see `world.contract.Place`)."""

    def __init__(self, scene: SpaceScene, parameters: Mapping[str, float] | None) -> None:
        self.scene = scene
        self.bound, self.space = Prepared.of(scene, scene.parameters(parameters))
        self._stepper = Stepper(self.space, KINEMATIC, self.bound.step)

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

    def values(self, states: States, terms: list[Term]) -> Reals:
        """Values of terms (m, k)."""
        programs, rows = Programs([term.code for term in terms]), self._rows(states)
        values = Values(self.scene, self.bound, [term.code for term in terms])
        blank = values.all.copy()
        numbers = np.array([self._numbers(row, values, blank) for row in rows])
        found = np.zeros((len(rows), len(terms)))
        code = (programs.code, programs.constants, programs.table)
        read(code, numbers.reshape(len(rows), self.scene.template.value_count), np.zeros(STACK), found)
        return found

    def _numbers(self, row: _Row, values: Values, blank: Reals) -> Reals:
        """What conditions read (see `Values`, `blank` at first) at a state."""
        values.all[:] = blank
        values.place(row.time, row.q, row.v, self.space)
        if row.memory is not None:
            before = row.memory.values[memory_parts(self.scene).values]
            values.hand_on(before)
            if row.memory.inputs:
                columns = [self.scene.template.parameters.index(name) for name in self.scene.template.inputs]
                values.told[columns] = before[columns]
            self._recalled(row.memory)
            values.push(self._stepper, self.space, 0.0)
        return values.all.copy()

    def _recalled(self, memory: Memory) -> float:
        """Recall a run's last step; how far bodies sank into each other in it."""
        try:
            recall(self._stepper, self.space, memory.values[memory_parts(self.scene).core])
        except ValueError:
            raise StateError("state.memory: is of another scene") from None
        return float(self._stepper.state.deformation[:, 0].max(initial=0.0))

    def geometry(self, states: States) -> tuple[Reals, NDArray[np.bool_], Reals]:
        """Gaps (m, c), collisions (m,), poses (m, b, 7)."""
        rows, template, data = self._rows(states), self.scene.template, self.space.data
        pairs = [tuple(template.bodies.index(name) for name in pair) for pair in template.contacts]
        gaps = np.zeros((len(rows), len(pairs)))
        collides, poses = np.zeros(len(rows), bool), np.zeros((len(rows), len(template.bodies), 7))
        for i, row in enumerate(rows):
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

    def _rows(self, states: States) -> list[_Row]:
        """States, their quaternions unit ones. Raises StateError."""
        template = self.scene.template
        n = len(template.coordinates)
        if isinstance(states, np.ndarray):
            moving = finite_rows(states, n, len(template.velocities))
            rows = [_Row(0.0, row[:n].copy(), row[n:]) for row in moving]
        else:
            many = [states] if isinstance(states, State) else states
            if not isinstance(many, Sequence):
                raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
            own, rows = digest(self.scene), []
            for state in many:
                check_state(state, self.scene)
                is_own = state.memory is not None and state.memory.scene == own
                rows.append(_Row(state.time, state.q.copy(), state.v, state.memory if is_own else None))
        for row in rows:
            normalise(row.q, self.scene, "states.q", StateError)
        return rows


def forces_in(memory: Reals, scene: SpaceScene, made: Prepared) -> Reals:
    """Normal forces (c,) of pairs of bodies in the last step of a run of this scene that left this memory."""
    stepper = Stepper(made.space, KINEMATIC, made.bound.step)
    made.space.forget()
    recall(stepper, made.space, memory[memory_parts(scene).core])
    bodies, forces = scene.template.bodies, np.zeros(len(scene.template.contacts))
    number = {(bodies.index(a), bodies.index(b)): k for k, (a, b) in enumerate(scene.template.contacts)}
    for a, b, force in pushes(stepper, made.space):
        forces[number[min(a, b), max(a, b)]] += force
    return forces
