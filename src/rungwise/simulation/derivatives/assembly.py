"""Steps of a planar scene, and the problems that they assemble with discrete choices held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import ContactProblem
from rungwise.deadline import go_on
from rungwise.models.assemble import Step
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.fields.laws.contact import LAWS, ROUGH
from rungwise.scene.template.records import FREE, HINGE, SPEED
from rungwise.simulation.core.tolerances import LINEARISATIONS, ROUNDING
from rungwise.simulation.derivatives.steps import (
    CHANGING,
    SEEN,
    Array,
    Data,
    Held,
    Ints,
    Linearised,
    Start,
    Steps,
    Taken,
    refuse_rough,
    terms_of,
)
from rungwise.simulation.options import ModelError
from rungwise.simulation.planar.state import prescribed_speeds
from rungwise.simulation.planar.state.nearby import fastest_pair, gather, look, widen
from rungwise.simulation.planar.state.workspace import Scratch, State
from rungwise.simulation.planar.step.attempt import TAKEN, attempt
from rungwise.simulation.run import Simulation
from rungwise.simulation.watched.inputs import set_all
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.place import place
from rungwise.system.planar.seams import is_continued
from rungwise.system.terms import normals_of


@dataclass(frozen=True, kw_only=True)
class PlanarHeld(Held):
    """Choices, contacts by their (pair, feature), and coordinates that do not move though driven."""

    keys: tuple[tuple[int, int], ...]
    stopped: NDArray[np.bool_]


class Assembly(Steps):
    """Steps of a planar scene."""

    state: State
    scratch: Scratch

    def __init__(
        self, scene: Scene, model: Rung | str, values: dict[str, float], h: float | None, theta: float
    ) -> None:
        simulation = Simulation(scene, model, parameters=values, step=h, theta=theta, frames=3)
        if simulation.workspace is None:
            raise ModelError(simulation.reason)
        work = self.workspace = simulation.workspace
        clock = work.state.clock[0]
        if clock["surfaces"]:
            raise ModelError(
                "support, or dry_friction along several coordinates of a body: these laws cannot be"
                " differentiated yet; leave them out, or give dry_friction along one"
            )
        refuse_rough([law.title for law in LAWS if not law.is_smooth] if clock["laws"] & ROUGH else [])
        self._simulation, self.theta = simulation, theta
        self.state, self.scratch, self.terms, self.problem = (
            work.state,
            work.scratch,
            work.terms,
            work.problem,
        )
        self.records, self.rung = simulation._bound.records, simulation._rung
        self.h, self.velocities = float(simulation._control[0]["step"]), scene.template.coordinates
        strain = np.zeros(self.state.deformation.shape)
        self.begun = Start(self.state.q.copy(), self.state.v.copy(), strain)
        extent = float(self.terms.rounding[0]) / ROUNDING
        self.reach = float(clock["reach"]) or extent or 1.0
        bodies = self.records.bodies
        first = bodies["coordinate"]
        angles = [*first[bodies["motion"] == HINGE], *(first[bodies["motion"] == FREE] + 2)]
        self.lever = np.where(np.isin(np.arange(len(self.state.q)), angles), self.reach, 1.0)

    def tell(self, levels: Array) -> None:
        run = self._simulation
        inputs = run._run.setting.inputs
        self.state.values[inputs.columns] = levels
        set_all(inputs, run._bound.buffer, self.workspace.watched)

    def _seen_near(self, start: Start, near: float) -> int:
        self.place(start, None)
        widen(self.records, self.workspace, max(float(self.state.clock[0]["near"]), SEEN * near))
        return self.gather(None)

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
        return Taken(self.scratch.v_new.copy(), before, end)

    def linearised(self, start: Start, taken: Taken, /) -> Iterator[Linearised]:
        quantum = float(self.terms.rounding[0]) / self.h
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
        self.place(start, trial)
        for _ in range(LINEARISATIONS):
            count = self.gather(trial)
            contact = self.solution(count)
            if not self.widened(self.scratch.v_new):
                break
        return Linearised(self._hold(count, contact.problem), contact, self.scratch.v_new.copy())

    def look_for_bends(self, held: PlanarHeld, low: Data, high: Data, base: Data, way: float) -> None:
        """Features of outlines are smooth."""

    def followed(self, taken: Taken, found: Array, /) -> Array:
        """See `Steps`; also over seams.

        Raises ModelError where a contact that is deformed goes over to another feature.
        """
        before, after = taken.features, taken.end.features
        slots = found.reshape(*taken.end.deformation.shape, found.shape[1])
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
        if old // 2 == new // 2 or not seams.outlines.joined[0] or after[new] == ABSENT:
            return False
        fresh = after[new] not in before[new - new % 2 : new - new % 2 + 2]
        return bool(
            fresh and is_continued(before[old], after[new], self.state.placed.outline, seams.outlines)
        )

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
            self.records, run._run.setting.inputs, run._bound.buffer, self.rung, self.workspace, self.h
        )
        return float(h)

    def place(self, start: Start, trial: Array | None) -> None:
        """Fill in loads at (q, v); place bodies, rows and joints there, or where the trial speeds lead."""
        self.put(start)
        self.set_speeds()
        state, r, terms, h = self.state, self.records, self.terms, self.h
        theta = float(self.rung[0]["theta"])
        if self.rung[0]["loads"]:
            planar.loads(
                r, state.placed.pose, state.q, state.v, state.start, start.time, h, theta, state.passive,
                terms,
            )  # fmt: skip
        row, begun = self.scratch.row, self.scratch.measures
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
        count, terms = int(gather(self.records, self.workspace)), self.terms
        if trial is not None:
            terms.gap[:count] -= self.h * normals_of(terms, count) @ trial
        self.state.clock["contacts"] = count
        return count

    def widened(self, speed: Array) -> bool:
        """Whether contacts farther away matter at this speed; if so, they are looked for."""
        reach = 2.0 * self.h * fastest_pair(
            self.records, self.rung, self.terms, self.state, speed, 0.0
        )  # fmt: skip
        if reach <= self.state.clock[0]["near"]:
            return False
        widen(self.records, self.workspace, 2.0 * reach)
        return True

    def _hold(self, count: int, problem: ContactProblem) -> PlanarHeld:
        """The discrete choices of the step just solved."""
        state, clock = self.state, self.state.clock[0]
        bounced, ease = np.zeros(count, bool), float(self.terms.pause[0])
        step = Step(self.h, float(clock["theta"]), float(clock["eps"]), ease)
        if clock["bounces"] and np.array_equal(self.assembled(step, count, True).w, problem.w):
            bounced = self.assembled(step, count, False).w[::2] != problem.w[::2]
        driven = self.records.coordinates["drive"] == SPEED
        return PlanarHeld(
            keys=self._keys(count), slots=self.scratch.slots[:count].copy(),
            terms=terms_of(self.terms, count), bounced=bounced, stopped=driven & (state.speed == 0.0),
            eps=step.eps, theta=step.theta, ease=ease,
        )  # fmt: skip

    def _seen(self, held: PlanarHeld, start: Start, trial: Array | None, faster: Array | None) -> int:
        state, clock = self.state, self.state.clock
        self.place(start, trial)
        state.speed[held.stopped] = 0.0
        if faster is not None:
            state.speed[:] += faster
        farthest = float(held.terms["gap"].max(initial=0.0))
        clock["near"] = 2.0 * max(float(clock[0]["near"]), farthest)
        widen(self.records, self.workspace, float(clock[0]["near"]))
        return self.gather(trial)

    def _order(self, held: PlanarHeld, count: int) -> Ints:
        found = {key: k for k, key in enumerate(self._keys(count))}
        if any(key not in found for key in held.keys):
            raise ModelError(CHANGING)
        return np.array([found[key] for key in held.keys], np.int64)

    def _keys(self, count: int) -> tuple[tuple[int, int], ...]:
        """(pair, feature) of each contact; a stop is its slot."""
        pairs, features = 2 * len(self.records.pairs), self.state.manifolds.features
        slots = [int(slot) for slot in self.scratch.slots[:count]]
        return tuple((slot // 2, int(features[slot])) if slot < pairs else (slot, -1) for slot in slots)
