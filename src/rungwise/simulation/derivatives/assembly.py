"""Steps of a planar scene, and the problems that they assemble with discrete choices held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.analysis import DATA, Sensitivity
from rungwise.contact.step import ContactProblem, Unknowns, trim
from rungwise.deadline import go_on
from rungwise.models.assemble import Step, assemble
from rungwise.models.entries import Velocities
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.fields.laws.contact import LAWS, ROUGH
from rungwise.scene.template.records import FREE, HINGE, SPEED
from rungwise.simulation.core.state import Trial
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.core.tolerances import LINEARISATIONS, ROUNDING
from rungwise.simulation.derivatives.steps import (
    MEMORY,
    SEEN,
    Data,
    Held,
    Linearised,
    Start,
    Taken,
    at_solution,
)
from rungwise.simulation.options import ModelError
from rungwise.simulation.planar.state import prescribed_speeds
from rungwise.simulation.planar.state.inputs import set_all
from rungwise.simulation.planar.state.nearby import fastest_pair, gather, look, widen
from rungwise.simulation.planar.step.attempt import TAKEN, attempt
from rungwise.simulation.run import Simulation
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.place import place
from rungwise.system.planar.seams import is_continued
from rungwise.wording import listed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class PlanarHeld(Held):
    """Choices, contacts by their (pair, feature), and coordinates that do not move though driven."""

    keys: tuple[tuple[int, int], ...]
    stopped: NDArray[np.bool_]


class Assembly:
    """A planar scene at one set of parameters, as `Steps`."""

    def __init__(
        self, scene: Scene, model: Rung | str, values: dict[str, float], h: float | None, theta: float
    ) -> None:
        simulation = Simulation(scene, model, parameters=values, step=h, theta=theta, frames=3)
        if simulation.workspace is None:
            raise ModelError(simulation.reason)
        if simulation.workspace.state.clock[0]["surfaces"]:
            raise ModelError(
                "support, or dry_friction along several coordinates of a body: these laws cannot be"
                " differentiated yet; leave them out, or give dry_friction along one"
            )
        if simulation.workspace.state.clock[0]["laws"] & ROUGH:
            rough = listed(law.title for law in LAWS if not law.is_smooth)
            raise ModelError(f"contacts: steps with {rough} cannot be differentiated; leave them out")
        self._simulation = simulation
        self.workspace, self.state = simulation.workspace, simulation.workspace.state
        self.records, self.rung, self.h = (
            simulation._bound.records,
            simulation._rung,
            float(simulation._control[0]["step"]),
        )
        self.theta = theta
        strain = np.zeros(self.state.deformation.shape)
        self.begun = Start(self.state.q.copy(), self.state.v.copy(), strain)
        extent = float(self.workspace.terms.rounding[0]) / ROUNDING
        self.reach = float(self.state.clock[0]["reach"]) or extent or 1.0
        bodies = self.records.bodies
        first = bodies["coordinate"]
        angles = [*first[bodies["motion"] == HINGE], *(first[bodies["motion"] == FREE] + 2)]
        self.lever = np.where(np.isin(np.arange(len(self.state.q)), angles), self.reach, 1.0)

    @property
    def halt(self) -> Ints:
        return self.workspace.scratch.halt

    @property
    def free(self) -> Ints:
        free: Ints = self.state.free[: int(self.state.clock[0]["free"])]
        return free

    def named(self, kind: str, i: int) -> str:
        coordinates = self._simulation.scene.template.coordinates
        return f"{coordinates[i]} of {kind}"

    def moved(self, start: Start, kind: str, by: Array) -> Start:
        old = getattr(start, kind)
        return replace(start, **{kind: old + by.reshape(old.shape)})

    def apart(self, q: Array, other: Array) -> Array:
        return other - q

    def tell(self, levels: Array) -> None:
        run = self._simulation
        inputs = run._setting.inputs
        self.state.values[inputs.columns] = levels
        set_all(inputs, run._bound.buffer, self.workspace)

    def solved_near(self, start: Start, near: float) -> tuple[Sensitivity, Array]:
        work, count = self.workspace, self._gather_near(start, near)
        trial = Trial(self.rung, self.h, work.terms, count, work.state, work.scratch, work.problem)
        if solve_step(trial) != SUPPORTED:
            go_on(self.halt)
            raise ModelError("step: it has no solution")
        return self._sensitivity(count), work.scratch.v_new.copy()

    def data_near(self, start: Start, near: float) -> Data:
        count, clock = self._gather_near(start, near), self.state.clock[0]
        problem = self._assembled(count, int(clock["free"]), float(clock["eps"]), 1.0, False)
        return {name: getattr(problem, name) for name in DATA} | {"speed": self.state.speed.copy()}

    def _gather_near(self, start: Start, near: float) -> int:
        """Fill in the terms of a step whose bodies reach farther; returns how many contacts there are."""
        self.place(start, None)
        widen(self.records, self.workspace, max(float(self.state.clock[0]["near"]), SEEN * near))
        count, terms = self.gather(None), self.workspace.terms
        terms.gap[:count] -= near
        terms.restitution[:count] = 0.0
        return count

    def like(self, scene: Scene, model: Rung | str, values: dict[str, float]) -> Assembly:
        """An assembly with the same options at other parameters."""
        return Assembly(scene, model, values, self.h, self.theta)

    def taken(self, start: Start) -> Taken:
        self.put(start)
        before = self.state.manifolds.features.copy()
        if self.set_speeds() < self.h:
            raise ModelError(
                "step: a coordinate reaches the end of its travel within it; take a shorter step"
            )
        if attempt(self.records, self.rung, self.workspace, self.h, self.h) != TAKEN:
            go_on(self.halt)
            raise ModelError("step: no step of this length can be taken from here; take a shorter one")
        state = self.state
        features = state.manifolds.features.copy()
        end = replace(
            start, q=state.q.copy(), v=state.v.copy(), deformation=state.deformation.copy(),
            time=start.time + self.h, features=features,
        )  # fmt: skip
        return Taken(self.workspace.scratch.v_new.copy(), before, end)

    def linearised(self, start: Start, taken: Taken, /) -> Iterator[Linearised]:
        quantum = float(self.workspace.terms.rounding[0]) / self.h
        trial = None
        for _ in range(LINEARISATIONS):
            found = self._solved(start, trial)
            yield found
            trial = found.speed
            off, size = (np.abs(self.lever * x).max(initial=0.0) for x in (trial - taken.speed, taken.speed))
            if off <= ROUNDING * size + quantum:
                return
            if not self.rung[0]["metric"]:
                break
        raise ModelError("step: it could not be repeated")

    def _solved(self, start: Start, trial: Array | None) -> Linearised:
        """The problem of a step linearised at its start, or where the trial speeds lead."""
        work, h = self.workspace, self.h
        self.place(start, trial)
        state, scratch = work.state, work.scratch
        for _ in range(LINEARISATIONS):
            count = self.gather(trial)
            if solve_step(Trial(self.rung, h, work.terms, count, state, scratch, work.problem)) != SUPPORTED:
                go_on(scratch.halt)
                raise ModelError("step: it has no solution")
            if not self.widened(scratch.v_new):
                break
        contact = self._sensitivity(count)
        return Linearised(self.hold(count, contact.problem), contact, scratch.v_new.copy())

    def _sensitivity(self, count: int) -> Sensitivity:
        """Of the problem of these contacts that was just solved."""
        scratch, clock = self.workspace.scratch, self.state.clock[0]
        n, limited = int(clock["free"]), int(clock["limited"])
        found = Unknowns(
            scratch.mode[: count + limited].copy(), scratch.x[:n].copy(),
            scratch.contact_force[: 2 * count].copy(), scratch.limited_force[:limited].copy(),
        )  # fmt: skip
        return at_solution(trim(self.workspace.problem, n, count, limited), found, scratch.halt)

    def look_for_bends(self, held: PlanarHeld, low: Data, high: Data, base: Data, way: float) -> None:
        """Features of outlines are smooth."""

    def ended(self, _start: Start, _speed: Array, dq: Array, dspeed: Array, /) -> Array:
        return dq + self.h * dspeed

    def followed(self, taken: Taken, found: Array, /) -> Array:
        """See `Steps`; also over seams.

        Raises ModelError where a contact that is deformed goes over to another feature.
        """
        before, after = taken.features, taken.end.features
        slots = found.reshape(len(taken.end.deformation), -1, found.shape[1])
        moved = np.zeros_like(slots)
        moved[len(before) :] = slots[len(before) :]
        for slot, feature in enumerate(before):
            pair = slot - slot % 2
            to = pair + np.flatnonzero(after[pair : pair + 2] == feature)
            if not len(to) and slots[slot].any():
                to = np.array([k for k in range(len(before)) if self._is_carried(before, after, slot, k)])
            if len(to):
                moved[to[0]] = slots[slot]
            elif after[slot] != ABSENT and slots[slot].any():
                raise ModelError("step: a contact moves to another feature; there is no derivative here")
        return moved.reshape(found.shape)

    def _is_carried(self, before: Ints, after: Ints, old: int, new: int) -> bool:
        """Whether the feature of slot `old` has come to slot `new` of another pair over a seam."""
        seams = self.workspace.seams
        if old // 2 == new // 2 or not seams.joined[0] or after[new] == ABSENT:
            return False
        fresh = after[new] not in before[new - new % 2 : new - new % 2 + 2]
        return bool(fresh and is_continued(before[old], after[new], self.state.placed.outline, seams))

    def handed_on(self, _held: PlanarHeld, data: Data, /) -> dict[str, Array]:
        return {kind: np.zeros((0, data["speed"].shape[1])) for kind in MEMORY}

    def put(self, start: Start) -> None:
        """Place the bodies and look for contacts."""
        state, records = self.state, self.records
        state.q[:], state.v[:], state.clock["time"] = start.q, start.v, start.time
        state.manifolds.turn[0] += 1
        if start.features is not None:
            state.manifolds.features[:], state.deformation[:] = start.features, start.deformation
        place(records, state.q, state.placed, False)
        look(records, self.workspace, state.v)
        state.modes[:], state.force[:] = 0, 0.0
        if start.features is None:
            state.deformation[:] = start.deformation

    def set_speeds(self) -> float:
        """Set speeds of prescribed coordinates; returns the length of the step that their travel allows."""
        run = self._simulation
        h, _ = prescribed_speeds.set_speeds(
            self.records, run._setting.inputs, run._bound.buffer, self.rung, self.workspace, self.h
        )
        return float(h)

    def place(self, start: Start, trial: Array | None) -> None:
        """Fill in loads at (q, v); place bodies, rows and joints there, or where the trial speeds lead."""
        self.put(start)
        self.set_speeds()
        state, r, terms, h = self.state, self.records, self.workspace.terms, self.h
        theta = float(self.rung[0]["theta"])
        if self.rung[0]["loads"]:
            planar.loads(
                r, state.placed.pose, state.q, state.v, state.start, start.time, h, theta, state.passive,
                terms,
            )  # fmt: skip
        row, begun = self.workspace.scratch.row, self.workspace.scratch.measures
        joints.values(r, state.placed.pose, state.q, row, begun)
        if trial is not None:
            self.put(self.moved(start, "q", h * trial))
        if len(r.joints):
            joints.rows(
                r, state.placed.pose, state.q, begun, state.start, start.time + theta * h, h,
                bool(self.rung[0]["metric"]), int(state.clock[0]["drives"]), terms, row,
            )  # fmt: skip
            if trial is not None:
                of = slice(int(state.clock[0]["drives"]), int(state.clock[0]["limited"]))
                terms.error[of, 0] += h * terms.limited[of] @ trial
        widen(r, self.workspace, 4.0 * h * fastest_pair(r, self.rung, terms, state, state.v, h))

    def gather(self, trial: Array | None) -> int:
        """Fill in terms of the contacts; returns how many there are."""
        count, terms = int(gather(self.records, self.workspace)), self.workspace.terms
        if trial is not None:
            terms.gap[:count] -= self.h * terms.rows[: 2 * count : 2] @ trial
        self.state.clock["contacts"] = count
        return count

    def widened(self, speed: Array) -> bool:
        """Whether contacts farther away matter at this speed; if so, they are looked for."""
        reach = 2.0 * self.h * fastest_pair(
            self.records, self.rung, self.workspace.terms, self.state, speed, 0.0
        )  # fmt: skip
        if reach <= self.state.clock[0]["near"]:
            return False
        widen(self.records, self.workspace, 2.0 * reach)
        return True

    def hold(self, count: int, problem: ContactProblem) -> PlanarHeld:
        """The discrete choices of the step just solved."""
        state, terms, clock = self.state, self.workspace.terms, self.state.clock[0]
        bounced = np.zeros(count, bool)
        n, eps, theta = int(clock["free"]), float(clock["eps"]), float(clock["theta"])
        if clock["bounces"] and np.array_equal(self._assembled(count, n, eps, theta, True).w, problem.w):
            bounced = self._assembled(count, n, eps, theta, False).w[::2] != problem.w[::2]
        driven = self.records.coordinates["drive"] == SPEED
        return PlanarHeld(
            keys=self._keys(count), slots=self.workspace.scratch.slots[:count].copy(),
            gap=terms.gap[:count].copy(), stiffness=terms.contact_stiffness[:count].copy(),
            damping=terms.contact_damping[:count].copy(), bounced=bounced,
            stopped=driven & (state.speed == 0.0), eps=eps, theta=theta,
        )  # fmt: skip

    def data(self, held: PlanarHeld, start: Start, trial: Array | None, faster: Array | None = None) -> Data:
        state, terms, clock = self.state, self.workspace.terms, self.state.clock
        self.place(start, trial)
        state.speed[held.stopped] = 0.0
        if faster is not None:
            state.speed[:] += faster
        clock["near"] = max(2.0 * float(clock[0]["near"]), 2.0 * float(held.gap.max(initial=0.0)))
        widen(self.records, self.workspace, float(clock[0]["near"]))
        count = self.gather(trial)
        found = {key: k for k, key in enumerate(self._keys(count))}
        if any(key not in found for key in held.keys):
            raise ModelError("step: a contact's feature is about to change; there is no derivative here")
        order = np.array([found[key] for key in held.keys], np.int64)
        at = (2 * order[:, None] + np.arange(2)).ravel()
        k = len(order)
        gap = terms.gap[order].copy()
        terms.rows[: 2 * k] = terms.rows[at]
        n = terms.rows.shape[1]
        terms.entries.rows[:k] = (0, n, n, n)
        terms.deformation[: 2 * k] = terms.deformation[at]
        for field in (terms.friction, terms.restitution, terms.contact_stiffness, terms.contact_damping):
            field[:k] = field[order]
        terms.gap[:k] = held.gap
        terms.restitution[:k][~held.bounced] = 0.0
        problem = self._assembled(k, int(clock[0]["free"]), held.eps, held.theta, bool(held.bounced.any()))
        made: dict[str, Array] = {name: getattr(problem, name) for name in DATA}
        return {
            **made,
            "gap": gap,
            "speed": state.speed.copy(),
            "stiffness": terms.contact_stiffness[:k].copy(),
            "damping": terms.contact_damping[:k].copy(),
        }

    def _assembled(self, count: int, n: int, eps: float, theta: float, bounce: bool) -> ContactProblem:
        state, work = self.state, self.workspace
        limited = int(state.clock[0]["limited"])
        step = Step(self.h, theta, eps, float(work.terms.pause[0]))
        velocities = Velocities(state.free, n, state.v, state.speed)
        assemble(self.rung, step, work.terms, count, limited, velocities, bounce, work.problem)
        return trim(work.problem, n, count, limited)

    def _keys(self, count: int) -> tuple[tuple[int, int], ...]:
        """(pair, feature) of each contact; a stop is its slot."""
        pairs, features = 2 * len(self.records.pairs), self.state.manifolds.features
        slots = [int(slot) for slot in self.workspace.scratch.slots[:count]]
        return tuple((slot // 2, int(features[slot])) if slot < pairs else (slot, -1) for slot in slots)
