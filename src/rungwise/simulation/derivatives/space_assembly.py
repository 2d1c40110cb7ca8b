"""Steps of a scene in space, and the problems that they assemble with discrete choices held.

Gaps and frames of contacts come without derivatives, but a step can be assembled at another state with
its contacts matched by their features (`system.spatial.features`). The problems of the step itself are noted
while the core takes it, one for each place where it was linearised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rungwise.contact.analysis import Sensitivity
from rungwise.deadline import go_on
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import InvalidScene
from rungwise.scene.fields.laws.contact import LAWS, titles
from rungwise.scene.space import SpaceScene
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.derivatives.noted import OF_FEATURES, Noting, Solved, SpaceHeld, restore
from rungwise.simulation.derivatives.steps import (
    CHANGING,
    SEEN,
    Array,
    Data,
    Ints,
    Linearised,
    Start,
    Steps,
    Taken,
    at_solution,
    refuse_rough,
)
from rungwise.simulation.inputs import compile_segments
from rungwise.simulation.moving.values import blank_values, slots_of
from rungwise.simulation.options import ModelError, moving_rung, positive
from rungwise.simulation.spatial.memory import recall, remembered
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.stepping.stepper import UndefinedNumber
from rungwise.system.spatial.features import FREE
from rungwise.system.spatial.loads import let_act
from rungwise.system.terms import normals_of

_BENT = 1e-2
"""Difference of slopes to both sides that counts as two, over the slope of what moves along."""


class SpaceAssembly(Steps):
    """Steps of a scene in space."""

    def __init__(
        self, scene: SpaceScene, model: Rung | str, values: dict[str, float], h: float | None, theta: float
    ) -> None:
        rung = moving_rung(model)
        if rung.metric:
            theta = 1.0
        try:
            bound, system = Prepared.of(scene, values)
        except InvalidScene as error:
            raise ModelError(str(error)) from None
        named = titles(bound.named)
        if system.size.skewed:
            raise ModelError(
                "contacts: steps with friction that differs by direction cannot be differentiated; give these"
                " contacts one friction"
            )
        refuse_rough([law.title for law in LAWS if not law.is_smooth and law.title in named])
        self._scene, self._bound, self._system, self.theta = scene, bound, system, theta
        self.h = bound.step if h is None else positive("step", h)
        template = scene.template
        blank, inputs = blank_values(template, bound), compile_segments(scene, ())
        stepper = self._stepper = Noting(
            system, rung, self.h, theta, blank, slots_of(template), inputs, bound.numbers
        )
        self.state, self.scratch = stepper.state, stepper.scratch
        self.terms, self.problem, self.rung = stepper.terms, stepper.problem, rung.record(theta)
        self.reach, self.lever = system.size.length, system.lever
        self.velocities = scene.template.velocities
        strain = np.zeros((system.size.slots, system.size.directions))
        self.begun = Start(
            stepper.q.copy(), stepper.v.copy(), strain, activation=system.begun.copy(),
            tangent=np.zeros(system.kept.along.size),
        )  # fmt: skip
        # Slots without contact after the step that was taken last: the next that takes one is not deformed.
        self._gone = np.zeros(len(system.kept.geoms), bool)

    def tell(self, levels: Array) -> None:
        self._stepper.watched.values[self._stepper.inputs.columns] = levels

    def _seen_near(self, start: Start, near: float) -> int:
        stepper = self._stepper
        self._begin_anew()
        self._put(start)
        if not stepper.fill(self.h, SEEN * near):
            raise ModelError("step: more contacts are near than there is room for")
        return stepper.contacts

    def integrate(self, q: Array, v: Array, h: float) -> Array:
        return self._system.integrate(q, v, h)

    def apart(self, q: Array, other: Array) -> Array:
        import mujoco

        found = np.zeros(self._system.model.nv)
        mujoco.mj_differentiatePos(self._system.model, found, 1.0, q, other)
        return found

    def _put(self, start: Start) -> None:
        """Let the stepper begin at the start."""
        stepper, state = self._stepper, self._stepper.state
        stepper.q, stepper.time = start.q, start.time
        state.v[:], state.deformation[:] = start.v, start.deformation
        self._system.activation[:] = start.activation
        try:
            stepper.lead(self.h)
        except UndefinedNumber as error:
            raise InvalidScene(self._bound.wrong(error.args[0], start.time)) from None

    def taken(self, start: Start) -> Taken:
        """See `Steps`. Features are those at the start, or those that are known there."""
        stepper, system, state = self._stepper, self._system, self.state
        self._begin_anew()
        if start.features is None:
            self._put(start)
            stepper.fill(self.h, system.margin)
            system.accept()
        else:
            recall(stepper, system, start.features)
        self._put(start)
        status = stepper.attempt(self.h)
        if status != SUPPORTED:
            go_on(self.halt)
            raise ModelError("step: no step of this length can be taken from here; take a shorter one")
        stepper.accept(self.h)
        self._gone = system.kept.geoms[:, 0] == FREE
        state.deformation[: len(self._gone)][self._gone] = 0.0
        end = Start(
            stepper.q.copy(), state.v.copy(), state.deformation.copy(), stepper.time,
            remembered(stepper, system), system.activation.copy(),
            np.where(self._gone[:, None], 0.0, system.kept.along).ravel(),
        )  # fmt: skip
        return Taken(stepper.scratch.v_new.copy(), None, end)

    def _begin_anew(self) -> None:
        """Forget what steps have left to begin from."""
        state, scratch = self.state, self.scratch
        self._system.forget()
        state.modes[:], state.force[:], scratch.limited_mode[:] = 0, 0.0, 1
        scratch.limited_force[:], self.terms.fall[:], scratch.x[:] = 0.0, 0.0, 0.0
        self._stepper.outcome, self._stepper.noted = Code.RUNNING, []

    def linearised(self, start: Start, _taken: Taken, /) -> Iterator[Linearised]:
        trial = None
        for solved in tuple(self._stepper.noted):
            contact = at_solution(solved.problem, solved.found, self.halt)
            held = self._hold(solved, contact, start, trial)
            yield Linearised(held, contact, held.speed)
            trial = held.speed

    def _hold(self, solved: Solved, contact: Sensitivity, start: Start, trial: Array | None) -> SpaceHeld:
        """The discrete choices of a step that was solved. Raises ModelError where it is not found again."""
        d, w, k = self._system.size.directions, solved.problem.w, len(solved.held.slots)
        pushing = contact.force[: k * d : d] > 0.0
        pushing[list(contact.weak)] = True
        held = replace(solved.held, pushing=pushing)
        hits = held.terms["restitution"] > 0.0
        for ease in (held.ease, np.inf):
            held = replace(held, ease=ease)
            rigid = self.data(held, start, trial)["w"]
            bouncing = self.data(replace(held, bounced=hits), start, trial)["w"] if hits.any() else rigid
            for one in (rigid, bouncing):
                if np.allclose(one, w, rtol=1e-9, atol=1e-9 * self.reach / self.h):
                    return replace(held, bounced=(one != rigid)[::d])
        raise ModelError("step: it could not be repeated")

    def _memory(self, held: SpaceHeld, start: Start) -> Data:
        system, activation = self._system, start.activation.copy()
        let_act(system.loads.actuators, system.control, start.activation, self.h, activation)
        return {"activation": activation, "tangent": self._tangents(held)}

    def _tangents(self, held: SpaceHeld) -> Array:
        """First tangents (6 c,) of the held contacts of geoms, as they were where one is not found now."""
        found, own = self._system.found, self._of_geoms(held)
        as_held = held.features[OF_FEATURES.index("along")][own]
        return np.where(found.geoms[own, :1] != FREE, found.along[own], as_held).ravel()

    def _of_geoms(self, held: SpaceHeld) -> Ints:
        """Slots of the held contacts that are not limits of travel."""
        own: Ints = held.slots[held.slots < len(self._gone)]
        return own

    def handed_on(self, held: SpaceHeld, data: Data, /) -> dict[str, Array]:
        count = data["speed"].shape[1]
        tangents, own = np.zeros((len(self._gone), 6, count)), self._of_geoms(held)
        tangents[own] = data["tangent"].reshape(len(own), 6, count)
        tangents[self._gone] = 0.0
        return {"activation": data["activation"], "tangent": tangents.reshape(6 * len(tangents), count)}

    def _seen(self, held: SpaceHeld, start: Start, trial: Array | None, faster: Array | None) -> int:
        stepper, system = self._stepper, self._system
        restore(system.kept, held.features)
        system.kept.along[:] = start.tangent.reshape(-1, 6)
        self._put(start)
        stepper.note["deep"] = held.deep
        if system.margin != held.margin:
            system.look_within(held.margin)
        if faster is not None:
            self.state.speed[:] += faster
        if trial is None:
            stepper.fill(self.h, system.margin)
        else:
            stepper.fill_at(system.integrate(start.q, trial, self.h), trial, self.h, system.margin)
        return stepper.contacts

    def _gaps(self, held: SpaceHeld, trial: Array | None, gap: Array) -> Array:
        """Gaps without what `overlap.open_added` did to them."""
        if trial is None or self._stepper.rung.compliant or self._stepper.rung.metric:
            return gap
        added = gap < -max(held.deep, float(self.terms.rounding[0]))
        slower = max(1.0, float(self.terms.pause[0]) / self.h)
        return np.where(added, (gap + held.deep) / slower - held.deep, gap)

    def _order(self, held: SpaceHeld, count: int) -> Ints:
        """See `Steps`. Raises ModelError where one that pushes is not found, or another would push."""
        terms = self.terms
        found = {int(slot): k for k, slot in enumerate(self.scratch.slots[:count])}
        order = np.array([found.pop(int(slot), -1) for slot in held.slots], np.int64)
        others = np.array(list(found.values()), np.int64)
        closing = terms.gap[others] + self.h * (normals_of(terms, count)[others] @ held.speed)
        if (order[held.pushing] < 0).any() or (closing < -terms.rounding[0]).any():
            raise ModelError(CHANGING)
        return order

    def look_for_bends(self, held: SpaceHeld, low: Data, high: Data, base: Data, way: float) -> None:
        d, most = self._system.size.directions, _BENT * way
        bend = low["gap"] + high["gap"] - 2.0 * base["gap"]
        turn = low["W"] + high["W"] - 2.0 * base["W"]
        turned = np.abs(turn / self.lever[self.free]).reshape(len(bend), d, len(self.free))
        bent = (np.abs(bend) > most) | (turned.max(axis=(1, 2), initial=0.0) > most / self.reach)
        if bent[held.pushing].any():
            raise ModelError(CHANGING)

    def followed(self, _taken: Taken, found: Array, /) -> Array:
        """See `Steps`: features keep their slots."""
        slots = found.reshape(*self.begun.deformation.shape, found.shape[1])
        slots[: len(self._gone)][self._gone] = 0.0
        return slots.reshape(found.shape)
