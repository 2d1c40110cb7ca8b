"""A planar scene at given parameters, ready to be asked what holds at states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene import Scene
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import SLOTS, Programs
from rungwise.scene.language.terms import ANGLE, LENGTH, TIME, Dimension, Term
from rungwise.simulation.planar.loop import begin, slack
from rungwise.simulation.planar.questions import answer
from rungwise.simulation.planar.state.allocation import allocate
from rungwise.simulation.planar.state.workspace import Workspace, in_memory
from rungwise.simulation.rows import States, finite_rows, scale_of
from rungwise.simulation.state import State, StateError, check_state, digest, memory_of
from rungwise.simulation.watched.values import CONTROL
from rungwise.system.planar.closing import close_joints
from rungwise.system.planar.place import start, turns


class Rows(NamedTuple):
    """States as kernels take them: q, v (m, n); `rest` (m, 1 + 2 c + u + slots), times, forces, impulses,
    inputs, and since when parts of conditions have held; `overlaps` (m, c) of contacts in the states' own
    runs."""

    q: Reals
    v: Reals
    rest: Reals
    overlaps: Reals


class PlanarPlace:
    """A planar scene at one set of parameters (see `world.contract.Place`)."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float] | None) -> None:
        self.scene, self.bound = scene, scene.bind(parameters)
        records, template = self.bound.records, scene.template
        self.columns = np.array([template.parameters.index(name) for name in template.inputs], np.int64)
        self.workspace: Workspace = allocate(scene.template, self.bound.values, 3)
        control = np.zeros(1, CONTROL)
        control["step"], control["tolerance"] = records.world[0]["step"], records.world[0]["tolerance"]
        start(records, self.workspace.state.q, self.workspace.state.v)
        begin(records, KINEMATIC.record(), control, self.workspace)

    def dimensions(self) -> tuple[tuple[Dimension, ...], tuple[Dimension, ...]]:
        """Dimensions of the coordinates and of their velocities."""
        records = self.bound.records
        bodies = [records.bodies[c["body"]] for c in records.coordinates]
        own = tuple(ANGLE if turns(body, i) else LENGTH for i, body in enumerate(bodies))
        return own, tuple(each.times(TIME, -1) for each in own)

    def scale(self, dimension: Dimension | None) -> float:
        """The size of the scene in this dimension; 1 where there is none."""
        clock, world = self.workspace.state.clock[0], self.bound.records.world[0]
        length, time = max(float(clock["extent"]), float(clock["reach"])), float(world["duration"])
        masses = [float(body["mass"]) for body in self.bound.records.bodies]
        gravity = math.hypot(world["gravity_x"], world["gravity_y"])
        return scale_of(dimension, length, time, max(masses, default=0.0), gravity)

    def values(self, states: States, terms: list[Term], deadline: Deadline = NEVER) -> Reals:
        """Values of terms (m, k)."""
        deadline.look()
        return self.answers(self.rows(states), terms)[0]

    def geometry(self, states: States, deadline: Deadline = NEVER) -> tuple[Reals, NDArray[np.bool_], Reals]:
        """Gaps (m, c), collisions (m,), poses (m, b, 3)."""
        deadline.look()
        rows = self.rows(states)
        _, gaps, poses = self.answers(rows, [])
        collides = np.any(gaps < -(slack(self.workspace) + rows.overlaps), axis=1)
        angles = np.arctan2(poses[..., 3:], poses[..., 2:3])
        return gaps, collides, np.concatenate([poses[..., :2], angles], axis=-1)

    def closed(self, q: Reals, v: Reals, freedom: Reals) -> tuple[Reals, Reals]:
        """See `world.contract.Place`."""
        records, state = self.bound.records, self.workspace.state
        if not len(records.measures):
            return q, v
        return close_joints(records, state.placed, q, v, freedom, float(state.clock[0]["reach"]))

    def overlap(self, state: State) -> str:
        """Which bodies overlap most at a state; empty where none do."""
        gaps, collides, _ = self.geometry(state)
        k = int(gaps[0].argmin()) if collides[0] else 0
        return (
            f"{' and '.join(self.scene.template.contacts[k])} overlap by {-gaps[0, k]:.3g}"
            if collides[0]
            else ""
        )

    def answers(self, rows: Rows, terms: list[Term]) -> tuple[Reals, Reals, Reals]:
        """Values of terms (m, k), gaps (m, c), poses (m, b, 4)."""
        m, records = len(rows.q), self.bound.records
        found = np.zeros((m, len(terms))), np.zeros((m, len(records.contacts)))
        poses = np.zeros((m, len(records.bodies), 4))
        programs = Programs([term.code for term in terms])
        conditions = (programs.code, programs.constants, programs.table)
        answer(
            records, self.scene.template.timed_numbers(), self.bound.buffer, conditions, self.workspace,
            rows.q, rows.v, rows.rest, self.columns, *found, poses,
        )  # fmt: skip
        return *found, poses

    def rows(self, states: States) -> Rows:
        """States as kernels take them. Raises StateError."""
        n = len(self.scene.template.coordinates)
        if isinstance(states, np.ndarray):
            moving = finite_rows(states, n, n)
            rows = self._at_rest(len(moving))
            rows.q[:], rows.v[:] = moving[:, :n], moving[:, n:]
            return rows
        many = [states] if isinstance(states, State) else states
        if not isinstance(many, Sequence):
            raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
        rows, own, like = self._at_rest(len(many)), digest(self.scene), self.workspace.state
        for i, state in enumerate(many):
            check_state(state, self.scene)
            rows.q[i], rows.v[i], rows.rest[i, 0] = state.q, state.v, state.time
            memory = memory_of(state, own, like)
            if memory is not None:
                gaps, pushes, impulses, values, dates = (
                    in_memory(like, name, memory.values[None])[0]
                    for name in ("gaps", "pushes", "impulses", "values", "dates")
                )
                inputs = slice(1 + 2 * len(pushes), 1 + 2 * len(pushes) + len(self.columns))
                rows.rest[i, 1 : inputs.start] = np.concatenate([pushes, impulses])
                rows.rest[i, inputs.stop :] = dates
                if memory.inputs:
                    rows.rest[i, inputs] = values[self.columns]
                rows.overlaps[i] = np.maximum(-gaps, 0.0)
        return rows

    def _at_rest(self, m: int) -> Rows:
        """m states without forces, with the inputs of the scene's start."""
        n, contacts = len(self.scene.template.coordinates), len(self.bound.records.contacts)
        inputs = slice(1 + 2 * contacts, 1 + 2 * contacts + len(self.columns))
        rest = np.full((m, inputs.stop + SLOTS), np.inf)
        rest[:, : inputs.start] = 0.0
        rest[:, inputs] = self.bound.values[self.columns]
        return Rows(np.zeros((m, n)), np.zeros((m, n)), rest, np.zeros((m, contacts)))
