"""Steps of a scene in space, and the problems that they assemble with discrete choices held.

MuJoCo gives no derivatives of gaps and frames of contacts, but a step can be assembled at another state with
its contacts matched by their features (`system.spatial.features`). The problems of the step itself are noted
while the core takes it, one for each place where it was linearised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rungwise.contact.analysis import DATA, Sensitivity
from rungwise.contact.step import ContactProblem, trim
from rungwise.deadline import go_on
from rungwise.kernel import Ints, steady
from rungwise.models.assemble import Step, assemble
from rungwise.models.entries import Velocities
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import InvalidScene
from rungwise.scene.fields.laws.contact import LAWS, titles
from rungwise.scene.space import SpaceScene
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.derivatives.noted import (
    OF_CONTACTS,
    OF_FEATURES,
    Noting,
    Solved,
    SpaceHeld,
    of_contacts,
    restore,
)
from rungwise.simulation.derivatives.steps import SEEN, Array, Data, Linearised, Start, Taken, at_solution
from rungwise.simulation.options import ModelError, moving_rung, positive
from rungwise.simulation.spatial.memory import recall, remembered
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.system.spatial.features import FREE
from rungwise.wording import listed

_TURN = 1e-4
"""Angle by which turns are differenced. Chosen by trial, to a decade."""
_BENT = 0.05
"""Difference of slopes to both sides that counts as two, over the slope of what moves along."""
_CHANGING = "step: a contact's feature is about to change; there is no derivative here"


class SpaceAssembly:
    """A scene in space at one set of parameters, as `Steps`."""

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
        rough = [law.title for law in LAWS if not law.is_smooth and law.title in titles(bound.named)]
        if rough:
            raise ModelError(f"contacts: steps with {listed(rough)} cannot be differentiated; leave them out")
        self._scene, self._bound, self._system, self._theta = scene, bound, system, theta
        self.h = bound.step if h is None else positive("step", h)
        self._told, self._told_at = bound.values.copy(), (np.nan, np.nan)
        self._stepper = Noting(system, rung, self.h, theta, self._tell)
        self.rung = rung.record(theta)
        self.reach, self.lever = system.size.length, system.lever
        strain = np.zeros((system.size.slots, system.size.directions))
        begun = self._stepper.q.copy(), self._stepper.v.copy()
        self.begun = Start(
            *begun, strain, activation=system.begun.copy(), tangent=np.zeros(system.kept.along.size)
        )
        self._assemble = steady(assemble)
        # Slots without contact after the step that was taken last: the next that takes one is not deformed.
        self._gone = np.zeros(len(system.kept.geoms), bool)

    @property
    def halt(self) -> Ints:
        return self._stepper.scratch.halt

    @property
    def free(self) -> Ints:
        free: Ints = self._stepper.state.free[: int(self._stepper.clock["free"])]
        return free

    def tell(self, levels: Array) -> None:
        template = self._scene.template
        self._told[[template.parameters.index(name) for name in template.inputs]] = levels
        self._told_at = np.nan, np.nan

    def solved_near(self, start: Start, near: float) -> tuple[Sensitivity, Array]:
        stepper = self._stepper
        self._begin_anew()
        self._fill_near(start, near)
        stepper._trial = start.q
        if stepper._again(self.h) != SUPPORTED:
            raise ModelError("step: it has no solution")
        solved = stepper.noted[-1]
        return at_solution(solved.problem, solved.found, self.halt), solved.held.speed

    def data_near(self, start: Start, near: float) -> Data:
        self._fill_near(start, near)
        stepper = self._stepper
        step = Step(self.h, self._theta, float(stepper.clock["eps"]), float(stepper.terms.pause[0]))
        problem = self._assembled(step, stepper.contacts, False)
        return {name: getattr(problem, name) for name in DATA} | {"speed": stepper.state.speed.copy()}

    def _fill_near(self, start: Start, near: float) -> None:
        """Fill in the terms of a step whose bodies reach farther."""
        stepper = self._stepper
        self._system.forget()
        self._put(start)
        if not stepper._fill(start.q, start.v, self.h, SEEN * near):
            raise ModelError("step: more contacts are near than there is room for")
        stepper.terms.gap[: stepper.contacts] -= near
        stepper.terms.restitution[: stepper.contacts] = 0.0

    def like(self, scene: SpaceScene, model: Rung | str, values: dict[str, float]) -> SpaceAssembly:
        return SpaceAssembly(scene, model, values, self.h, self._theta)

    def named(self, kind: str, i: int) -> str:
        return f"{self._scene.template.velocities[i]} of {kind}"

    def moved(self, start: Start, kind: str, by: Array) -> Start:
        if kind == "q":
            return replace(start, q=self._system.integrate(start.q, by, 1.0))
        old = getattr(start, kind)
        return replace(start, **{kind: old + by.reshape(old.shape)})

    def apart(self, q: Array, other: Array) -> Array:
        import mujoco

        found = np.zeros(self._system.model.nv)
        mujoco.mj_differentiatePos(self._system.model, found, 1.0, q, other)
        return found

    def _tell(self, time: float, h: float) -> None:
        """Set speeds as of the middle of a step, and controls as of its end, as runs do."""
        if self._told_at != (time, h):
            self._told_at = time, h
            self._told[-1] = time + 0.5 * h
            self._bound.tell_speeds(self._told)
            self._told[-1] = time + h
            self._bound.tell_controls(self._told)
        self._system.expect(h)

    def _put(self, start: Start) -> None:
        """Let the stepper begin at the start."""
        stepper, state = self._stepper, self._stepper.state
        stepper.q, stepper.time, stepper._told = start.q, start.time, np.nan
        state.v[:], state.deformation[:] = start.v, start.deformation
        self._system.activation[:] = start.activation
        stepper._speeds = b""
        stepper._begin(self.h)

    def taken(self, start: Start) -> Taken:
        """See `Steps`. Features are those at the start, or those that are known there."""
        stepper, system = self._stepper, self._system
        state = stepper.state
        self._begin_anew()
        if start.features is None:
            self._put(start)
            stepper._fill(start.q, start.v, self.h, system.margin)
            system.accept()
        else:
            recall(stepper, system, start.features)
        self._put(start)
        status, _ = stepper._attempt(self.h)
        if status != SUPPORTED:
            go_on(self.halt)
            raise ModelError("step: no step of this length can be taken from here; take a shorter one")
        stepper._accept(self.h)
        system.took(self.h)
        self._gone = system.kept.geoms[:, 0] == FREE
        state.deformation[: len(self._gone)][self._gone] = 0.0
        end = Start(
            stepper.q, state.v.copy(), state.deformation.copy(), stepper.time, remembered(stepper, system),
            system.activation.copy(), np.where(self._gone[:, None], 0.0, system.kept.along).ravel(),
        )  # fmt: skip
        return Taken(stepper.scratch.v_new.copy(), None, end)

    def _begin_anew(self) -> None:
        """Forget what steps have left to begin from."""
        stepper = self._stepper
        state, scratch = stepper.state, stepper.scratch
        self._system.forget()
        state.modes[:], state.force[:], scratch.limited_mode[:] = 0, 0.0, 1
        scratch.limited_force[:], stepper.terms.fall[:], scratch.x[:] = 0.0, 0.0, 0.0
        stepper.outcome, stepper.noted = Code.RUNNING, []

    def linearised(self, start: Start, _taken: Taken, /) -> Iterator[Linearised]:
        trial = None
        for solved in tuple(self._stepper.noted):
            contact = at_solution(solved.problem, solved.found, self.halt)
            held = self._hold(solved, contact, start, trial)
            yield Linearised(held, contact, held.speed)
            trial = held.speed

    def _hold(self, solved: Solved, contact: Sensitivity, start: Start, trial: Array | None) -> SpaceHeld:
        """The discrete choices of a step that was solved. Raises ModelError where it is not found again."""
        d, problem, k = self._system.size.directions, solved.problem, len(solved.held.gap)
        pushing = contact.force[: k * d : d] > 0.0
        pushing[list(contact.weak)] = True
        held = replace(solved.held, pushing=pushing)
        for ease in (held.ease, np.inf):
            held = replace(held, ease=ease, bounced=np.zeros(k, bool))
            rigid = self._gathered(held, start, trial, None)[0]
            hit = replace(held, bounced=held.terms["restitution"] > 0.0)
            bouncing = self._gathered(hit, start, trial, None)[0] if hit.bounced.any() else rigid
            for one, other in ((rigid, rigid), (bouncing, rigid)):
                if np.allclose(one.w, problem.w, rtol=1e-9, atol=1e-9 * self.reach / self.h):
                    return replace(held, bounced=(one.w != other.w)[::d])
        raise ModelError("step: it could not be repeated")

    def data(self, held: SpaceHeld, start: Start, trial: Array | None, faster: Array | None = None) -> Data:
        problem, gap, k = self._gathered(held, start, trial, faster)
        made: dict[str, Array] = {name: getattr(problem, name) for name in DATA}
        terms = self._stepper.terms
        return {
            **made,
            "gap": gap,
            "speed": self._stepper.state.speed.copy(),
            "stiffness": terms.contact_stiffness[:k].copy(),
            "damping": terms.contact_damping[:k].copy(),
            "activation": self._system.drives.activated(start.activation, self._system.control, self.h),
            "tangent": self._tangents(held),
        }

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

    def _gathered(
        self, held: SpaceHeld, start: Start, trial: Array | None, faster: Array | None
    ) -> tuple[ContactProblem, Array, int]:
        """The problem of the held contacts, their gaps, and how many there are."""
        stepper, system, terms = self._stepper, self._system, self._stepper.terms
        restore(system.kept, held.features)
        system.kept.along[:] = start.tangent.reshape(-1, 6)
        self._put(start)
        stepper._deep = held.deep
        if system.margin != held.margin:
            system.look_within(held.margin)
        if faster is not None:
            stepper.state.speed[:] += faster
        place = start.q if trial is None else system.integrate(start.q, trial, self.h)
        stepper._fill(place, start.v if trial is None else trial, self.h, system.margin)
        order = self._order(held)
        known, k, d = order >= 0, len(order), system.size.directions
        now = of_contacts(stepper, stepper.contacts)
        for name, kept in held.terms.items():
            own = kept.copy()
            own[known] = now[name][order[known]]
            now[name] = own
            target = getattr(terms, name)
            if name in OF_CONTACTS:
                target[:k] = own
            else:
                target[: k * d] = own.reshape(k * d, *target.shape[1:])
        n = terms.rows.shape[1]
        terms.entries.rows[:k] = (0, n, n, n)
        gap = now["gap"]
        if trial is not None and not (stepper.rung.compliant or stepper.rung.metric):
            gap = self._closed_added(gap, held)
        terms.gap[:k] = held.gap
        terms.restitution[:k][~held.bounced] = 0.0
        step = Step(self.h, held.theta, held.eps, held.ease)
        return self._assembled(step, k, bool(held.bounced.any())), gap, k

    def _assembled(self, step: Step, count: int, bounce: bool) -> ContactProblem:
        """The problem of the terms that there are, with so many contacts."""
        stepper, clock, state = self._stepper, self._stepper.clock, self._stepper.state
        n, limited = int(clock["free"]), int(clock["limited"])
        self._assemble(
            self.rung, step, stepper.terms, count, limited,
            Velocities(state.free, n, state.v, state.speed), bounce, stepper.problem,
        )  # fmt: skip
        return trim(stepper.problem, n, count, limited)

    def _closed_added(self, gap: Array, held: SpaceHeld) -> Array:
        """Gaps without what `overlap.open_added` did to them."""
        pause = float(self._stepper.terms.pause[0])
        added = gap < -max(held.deep, float(self._stepper.terms.rounding[0]))
        slower = max(1.0, pause / self.h)
        return np.where(added, (gap + held.deep) / slower - held.deep, gap)

    def _order(self, held: SpaceHeld) -> Ints:
        """Where each held contact (c,) is among those just found; -1 for one without force that is not.

        Raises ModelError where one that pushes is not found, or another would push.
        """
        stepper, d = self._stepper, self._system.size.directions
        found = {int(slot): k for k, slot in enumerate(stepper.scratch.slots[: stepper.contacts])}
        order = np.array([found.pop(int(slot), -1) for slot in held.slots], np.int64)
        terms, others = stepper.terms, np.array(list(found.values()), np.int64)
        closing = terms.gap[others] + self.h * (terms.rows[others * d] @ held.speed)
        if (order[held.pushing] < 0).any() or (closing < -terms.rounding[0]).any():
            raise ModelError(_CHANGING)
        return order

    def look_for_bends(self, held: SpaceHeld, low: Data, high: Data, base: Data, way: float) -> None:
        d, most = self._system.size.directions, _BENT * way
        bend = low["gap"] + high["gap"] - 2.0 * base["gap"]
        turn = low["W"] + high["W"] - 2.0 * base["W"]
        turned = np.abs(turn / self.lever[self.free]).reshape(len(bend), d, len(self.free))
        bent = (np.abs(bend) > most) | (turned.max(axis=(1, 2), initial=0.0) > most / self.reach)
        if bent[held.pushing].any():
            raise ModelError(_CHANGING)

    def ended(self, start: Start, speed: Array, dq: Array, dspeed: Array, /) -> Array:
        """See `Steps`: turns are those of the axes at the end."""
        m, h = self._system.model, self.h
        if m.nq == m.nv:
            return dq + h * dspeed
        end = self._system.integrate(start.q, speed, h)
        by_q, by_speed = np.zeros((2, m.nv, m.nv))
        for i, one in enumerate(_TURN * np.eye(m.nv)):
            for side in (-1.0, 1.0):
                other = self._system.integrate(start.q, side * one, 1.0)
                by_q[:, i] += side * self.apart(end, self._system.integrate(other, speed, h))
                other = self._system.integrate(start.q, h * speed + side * one, 1.0)
                by_speed[:, i] += side * self.apart(end, other)
        change: Array = (by_q @ dq + h * (by_speed @ dspeed)) / (2.0 * _TURN)
        return change

    def followed(self, _taken: Taken, found: Array, /) -> Array:
        """See `Steps`: features keep their slots."""
        slots = found.reshape(*self.begun.deformation.shape, found.shape[1])
        slots[: len(self._gone)][self._gone] = 0.0
        return slots.reshape(found.shape)
