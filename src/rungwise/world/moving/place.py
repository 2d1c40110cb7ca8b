"""A scene of whatever moves at given parameters, ready to be asked what holds at states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import SLOTS, STACK, Programs
from rungwise.scene.language.terms import LENGTH, TIME, Dimension, Term
from rungwise.scene.stated import StatedScene
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.simulation.moving.kind import numbered
from rungwise.simulation.moving.memory import memory_parts, recall, values_in
from rungwise.simulation.moving.prepared import Numbers
from rungwise.simulation.moving.values import (
    asked_of,
    blank_values,
    place_values,
    push_values,
    slots_of,
)
from rungwise.simulation.planar.questions import read
from rungwise.simulation.rows import States, finite_rows, scale_of
from rungwise.simulation.state import Memory, State, StateError, check_state, digest
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system.moving import Asked


class Standing(NamedTuple):
    """A state: time, q, v, and the memory of a run of this scene, if it has one."""

    time: float
    q: Reals
    v: Reals
    memory: Memory | None = None


class MovingPlace:
    """A scene at one set of parameters (see `world.contract.Place`), all of whose coordinates are lengths."""

    def __init__(self, scene: StatedScene, bound: Numbers, system: Any) -> None:
        self.scene: Any = scene
        self.bound: Any = bound
        self.system = system
        self.system.forget()
        self._stepper = Stepper(self.system, KINEMATIC, self.bound.step)

    def dimensions(self) -> tuple[tuple[Dimension, ...], tuple[Dimension, ...]]:
        """Dimensions of the coordinates and of the velocities."""
        template = self.scene.template
        return (LENGTH,) * len(template.coordinates), (LENGTH.times(TIME, -1),) * len(template.velocities)

    def scale(self, dimension: Dimension | None) -> float:
        """The size of the scene in this dimension: of the smallest thing that may be hit and of the duration;
        1 where there is none."""
        return scale_of(dimension, self.system.size.length, self.bound.duration, 1.0, 0.0)

    def closed(self, q: Reals, v: Reals, _freedom: Reals) -> tuple[Reals, Reals]:
        """See `world.contract.Place`; where a world says no more, it has no joints to be opened."""
        return q, v

    def poses(self, _q: Reals) -> Reals:
        """Poses (b, k) of the bodies at q (n_q,); nan where the world says none."""
        return np.full((len(self.scene.template.bodies), 3), np.nan)

    def recall(self, core: Reals) -> None:
        """Recall a run's last step. Raises ValueError where it is of another system."""
        recall(self._stepper, core)

    def values(self, states: States, terms: list[Term], deadline: Deadline = NEVER) -> Reals:
        """Values of terms (m, k)."""
        programs, rows = Programs([term.code for term in terms]), self._rows(states)
        asked = asked_of(self.scene.template, [programs.code], self.bound.step)
        blank = blank_values(self.scene.template, self.bound)
        numbers = np.array([self._numbers(row, asked, blank) for row in deadline.before(rows)])
        found = np.zeros((len(rows), len(terms)))
        code = (programs.code, programs.constants, programs.table)
        read(code, numbers.reshape(len(rows), len(blank)), np.zeros(STACK), found)
        return found

    def _numbers(self, row: Standing, asked: Asked, blank: Reals) -> Reals:
        """What conditions read (w,) at a state, `blank` before it is seen."""
        stepper, slots, template = self._stepper, slots_of(self.scene.template), self.scene.template
        values = blank.copy()
        place_values(stepper.inside, asked, slots, row.time, row.q, row.v, values)
        if row.memory is not None:
            before = values_in(self.scene, row.memory.values)
            held = slice(slots.forces + len(template.contacts), slots.dates + SLOTS)
            values[held] = before[held]
            if row.memory.inputs:
                columns = [template.parameters.index(name) for name in template.inputs]
                values[columns] = before[columns]
            self._recalled(row.memory)
            push_values(stepper.inside, asked, stepper.state.force, values)
        return values

    def _recalled(self, memory: Memory) -> float:
        """Recall a run's last step; how far bodies sank into each other in it."""
        try:
            self.recall(memory.values[memory_parts(self.scene, memory.values).core])
        except ValueError:
            raise StateError("state.memory: is of another scene") from None
        return float(self._stepper.state.deformation[:, 0].max(initial=0.0))

    def geometry(self, states: States, deadline: Deadline = NEVER) -> tuple[Reals, NDArray[np.bool_], Reals]:
        """Gaps (m, c), collisions (m,), poses (m, b, k)."""
        rows, pairs = self._rows(states), numbered(self.scene)
        gaps = np.array([[self.system.gap(row.q, a, b) for a, b in pairs] for row in deadline.before(rows)])
        sunk = np.array([0.0 if row.memory is None else self._recalled(row.memory) for row in rows])
        gaps = gaps.reshape(len(rows), len(pairs))
        allowed = OVERLAP * self.system.size.length + 2.0 * sunk
        collides = (gaps < -allowed[:, None]).any(axis=1)
        return gaps, collides, np.array([self.poses(row.q) for row in rows])

    def overlap(self, state: State) -> str:
        """Which bodies overlap most at a state; empty where none do."""
        gaps, collides, _ = self.geometry(state)
        if not collides[0]:
            return ""
        k = int(gaps[0].argmin())
        return f"{' and '.join(self.scene.template.contacts[k])} overlap by {-gaps[0, k]:.3g}"

    def _rows(self, states: States) -> list[Standing]:
        """States, their quaternions unit ones. Raises StateError."""
        template = self.scene.template
        n = len(template.coordinates)
        if isinstance(states, np.ndarray):
            moving = finite_rows(states, n, len(template.velocities))
            rows = [Standing(0.0, row[:n].copy(), row[n:]) for row in moving]
        else:
            many = [states] if isinstance(states, State) else states
            if not isinstance(many, Sequence):
                raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
            own, rows = digest(self.scene), []
            for state in many:
                check_state(state, self.scene)
                is_own = state.memory is not None and state.memory.scene == own
                rows.append(Standing(state.time, state.q.copy(), state.v, state.memory if is_own else None))
        for row in rows:
            self.scene.normalise(row.q, "states.q", StateError)
        return rows
