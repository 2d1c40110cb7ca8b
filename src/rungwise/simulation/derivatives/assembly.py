"""Assembling a step's contact problem from Python, with its discrete choices held."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.analysis import DATA
from rungwise.contact.step import ContactProblem, trim
from rungwise.models.assemble import Step, assemble
from rungwise.models.entries import Velocities
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.fields.laws.contact import LAWS, ROUGH
from rungwise.scene.template.records import SPEED
from rungwise.simulation.options import ModelError
from rungwise.simulation.planar.state import prescribed_speeds
from rungwise.simulation.planar.state.nearby import fastest_pair, gather, look, widen
from rungwise.simulation.run import Simulation
from rungwise.system.planar import joints
from rungwise.system.planar import terms as planar
from rungwise.system.planar.place import place
from rungwise.wording import listed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Held:
    """Discrete choices of a step: contacts by their features, slots and gaps, whether they bounce;
    coordinates that do not move though driven; eps and theta."""

    keys: tuple[tuple[int, int], ...]
    slots: Ints
    gap: Array
    bounced: NDArray[np.bool_]
    stopped: NDArray[np.bool_]
    eps: float
    theta: float


@dataclass(frozen=True)
class Start:
    """The state before a step: q, v (n,), deformation (slots, d), and the features of the slots, if known."""

    q: Array
    v: Array
    deformation: Array
    time: float = 0.0
    features: Ints | None = None

    def moved(self, kind: str, by: Array) -> Start:
        """The start with "q", "v" or "deformation" changed."""
        old = getattr(self, kind)
        return replace(self, **{kind: old + by.reshape(old.shape)})


class Assembly:
    """A scene at one set of parameters, ready to assemble steps of length h from any state.

    `begun` holds q, v (n,) at the beginning of the scene.
    """

    def __init__(
        self, scene: Scene, model: Rung | str, values: dict[str, float], h: float, theta: float
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
        self.records, self.rung, self.h = simulation._bound.records, simulation._rung, float(h)
        self.theta = theta
        self.begun = self.state.q.copy(), self.state.v.copy()

    def like(self, scene: Scene, model: Rung | str, values: dict[str, float]) -> Assembly:
        """An assembly with the same options at other parameters."""
        return Assembly(scene, model, values, self.h, self.theta)

    def rest(self, q: Array, v: Array, time: float = 0.0) -> Start:
        """A start without deformations."""
        return Start(q, v, np.zeros_like(self.state.deformation), time)

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
            self.put(start.moved("q", h * trial))
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

    def hold(self, count: int, problem: ContactProblem) -> Held:
        """The discrete choices of the step just solved."""
        state, terms, clock = self.state, self.workspace.terms, self.state.clock[0]
        bounced = np.zeros(count, bool)
        n, eps, theta = int(clock["free"]), float(clock["eps"]), float(clock["theta"])
        if clock["bounces"] and np.array_equal(self._assembled(count, n, eps, theta, True).w, problem.w):
            bounced = self._assembled(count, n, eps, theta, False).w[::2] != problem.w[::2]
        driven = self.records.coordinates["drive"] == SPEED
        return Held(
            self._keys(count), self.workspace.scratch.slots[:count].copy(), terms.gap[:count].copy(), bounced,
            driven & (state.speed == 0.0), eps, theta,
        )  # fmt: skip

    def data(
        self,
        held: Held,
        start: Start,
        trial: Array | None,
        faster: Array | None = None,
    ) -> dict[str, Array]:
        """Data of the problem from `start`, contacts in the order held, with their `gap`, `stiffness` and
        `damping`, and `speed` (n,) of the prescribed coordinates. The gaps in the data are the held gaps.

        Raises ModelError when other points touch than the held contacts.
        """
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
