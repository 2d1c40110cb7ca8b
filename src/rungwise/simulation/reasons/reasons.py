"""Why a planar run ended, with proofs, and remarks on it so far."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rungwise.contact.judge import Balance, Certificate
from rungwise.contact.step import OPEN, TOLERANCE, ContactProblem, keep_contacts, trim
from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import RecordArray
from rungwise.models.entries import trimmed
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.scene import Scene
from rungwise.scene.scene import Bound
from rungwise.scene.template import records as rec
from rungwise.simulation.core.crawl import lead_nowhere
from rungwise.simulation.core.limit_surface import in_boxes, without_law
from rungwise.simulation.core.tolerances import NEAR, SINKING
from rungwise.simulation.inputs import Segment, ignored
from rungwise.simulation.planar.state.nearby import begin_step, gather
from rungwise.simulation.planar.state.verdicts import crushed
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.planar.step.held import solve_again
from rungwise.simulation.reasons.hindered import Hindrance
from rungwise.simulation.reasons.remarks import advice, remarks, stillness, unmet, untouchable
from rungwise.simulation.reasons.servo_jumps import leap_ahead, leap_taken
from rungwise.system.terms import normals_of, whole
from rungwise.wording import listed

JAM = 0.25
"""A step without solution counts as a jam when nothing would move in it by this part of the goal's
tolerance."""
HEAVIER = 1e3
"""Factor on the inertia that stands for none in the proof of a jam: it then makes up as much of the loads as
in the heaviest step that counts as balanced."""
SEEN = 1e-3
"""Part of the fastest coordinate's speed from which on a coordinate is named."""


class Ended(NamedTuple):
    """How a run ended, why, and where a step had no solution the proof and the problem of that step, or the
    `balance` that the loop may not have found."""

    outcome: Code
    reason: str
    certificate: Certificate | None = None
    problem: ContactProblem | None = None
    balance: Balance | None = None


@dataclass(frozen=True)
class Reasons:
    """A run as far as it has come: its scene at its parameters, rung, schedule, and what kernels read."""

    scene: Scene
    model: Rung
    theta: float
    inputs: tuple[Segment, ...]
    bound: Bound
    control: RecordArray
    workspace: Workspace

    def _stillness(self) -> str:
        """Whether more time would help (see `stillness`); not asked where something depends on time."""
        template, state = self.scene.template, self.workspace.state
        if template.reads_time or template.awaits_time:
            return ""
        own = self.bound.records.coordinates
        bodies: dict[str, tuple[float, bool]] = {}
        for name, speed, drive in zip(template.coordinates, state.v, own["drive"], strict=True):
            body = name.partition(".")[0]
            before, led = bodies.get(body, (0.0, True))
            moves = led and (drive != rec.NO_DRIVE or speed == 0.0)
            bodies[body] = max(before, abs(float(speed))), moves
        return stillness(bodies, float(state.clock[0]["time"]), float(self.control[0]["tolerance"]))

    def explain(self, code: Code, deadline: Deadline = NEVER) -> Ended:
        """The outcome that the loop found, with its reason; a jam or a missing support must be proved, else
        the run is not converged. Raises TimeOver where the deadline has come in the search for a
        proof."""
        outcome = OUTCOMES[code]
        clock = self.workspace.state.clock[0]
        still = self._stillness() if code == Code.TIMEOUT else ""
        reason = f"{outcome.meaning}. {advice(outcome, self.model, self.scene.file.goal is not None, still)}"
        if code == Code.INVALID:
            reason = self._undefined()
        if code == Code.MODEL_INVALID and clock["snapped"]:
            reason = self._snapped()
        if code == Code.TIMEOUT and clock["segment"] < len(self.inputs):
            reason = self._waited(int(clock["segment"])) or reason
        if code not in (Code.JAMMED, Code.UNSUPPORTED, Code.NOT_CONVERGED):
            return Ended(code, reason)
        if code == Code.NOT_CONVERGED and (crushed := self._crushed()):
            return Ended(Code.MODEL_INVALID, crushed)
        n, contacts, limited = int(clock["free"]), int(clock["contacts"]), int(clock["limited"])
        problem = trimmed(self.workspace.problem, self.workspace.terms, n, contacts, limited)
        certificate, balance = None, None
        if code == Code.JAMMED:
            certificate, problem = self._proved_jam(problem, deadline)
        jammed = certificate is not None
        if not jammed and (code == Code.UNSUPPORTED or self._asks_for_balance()):
            from rungwise.contact.certify import certify_or_balance  # it takes long to import

            problem, _ = self._unsupported()
            certificate, balance = certify_or_balance(problem, self.resisting(), deadline)
        if certificate is None:
            return Ended(Code.NOT_CONVERGED, self._given_up(code), None, problem, balance)
        outcome = OUTCOMES[Code.JAMMED if jammed else Code.UNSUPPORTED]
        reason = f"{outcome.meaning} ({certificate.kind} certificate, checked). {outcome.advice}"
        return Ended(outcome.code, reason, certificate, problem)

    def _proved_jam(
        self, problem: ContactProblem, deadline: Deadline
    ) -> tuple[Certificate | None, ContactProblem]:
        """A proof that the last step, of this trimmed problem, has no solution, and the problem proved.

        Without momentum loads alone would move bodies so fast, by the inertia that stands for none, that
        demanded rates are rounding beside that: then the proof is for as much inertia as a balance may have.
        """
        from rungwise.contact.certify import certify_infeasible  # it takes long to import

        free, inertia = self.workspace.state.free, problem.H - self.resisting()
        problem = without_law(problem, self.workspace.terms, free, self.model.inertia)
        certificate = certify_infeasible(problem, deadline)
        if certificate is not None or self.model.inertia > 0.0 or not self.model.loads:
            return certificate, problem
        heavier = trim(problem, len(problem.c), len(problem.mu), len(problem.F))
        heavier.H[...] += (HEAVIER - 1.0) * inertia
        certificate = certify_infeasible(heavier, deadline)
        return certificate, problem if certificate is None else heavier

    def _crushed(self) -> str:
        """Which contact yields too far for its model under forces that balance the loads, where no step is
        short enough for what that moves; empty where none does."""
        k = int(crushed(self.model.record(self.theta), self.workspace))
        if k < 0:
            return ""
        scratch, most = self.workspace.scratch, SINKING * float(self.workspace.state.clock[0]["smallest"])
        yields = scratch.contact_force[2 * k] / self.workspace.terms.contact_stiffness[k, 0, 0]
        pair = self.bound.records.pairs["contact"][int(scratch.slots[k]) // 2]
        a, b = self.scene.template.contacts[int(pair)]
        return (
            f"the contact between {a} and {b} would yield by {yields:.3g}, more than a tenth of the"
            f" smallest shape's reach ({most:.3g}). {OUTCOMES[Code.MODEL_INVALID].advice}"
        )

    def _asks_for_balance(self) -> bool:
        """Whether a step without momentum had no solution, however short. Its problem, which may have been
        linearised where nothing holds the bodies, is then made anew where they are: it may be that nothing
        balances the loads."""
        clock, step = self.workspace.state.clock[0], float(self.control[0]["step"])
        crawls = lead_nowhere(int(clock["crowd"]), float(clock["time"] - clock["mark"]), step)
        if self.model.inertia > 0.0 or not self.model.loads or clock["residual"] <= TOLERANCE or crawls:
            return False
        rung, records, length = self.model.record(self.theta), self.bound.records, float(clock["tried"])
        begin_step(records, rung, self.workspace, length)
        clock["contacts"] = gather(records, self.workspace)
        solve_again(rung, length, self.workspace)
        return True

    def _landed(self) -> str:
        """Which body that was raised came down on which, and when."""
        state = self.workspace.state
        k = int(state.clock[0]["landed"])
        names, bodies = self.scene.template.contacts[k], self.scene.file.bodies
        robot, other = names if bodies[names[0]].role == "robot" else names[::-1]
        return (
            f"{robot} is lowered onto {other}, which it overlaps by {-float(state.manifolds.gaps[k]):.3g}, at"
            f" t = {float(state.clock[0]['time']):g}; lower it where nothing is"
        )

    def _undefined(self) -> str:
        """Which number that depends on time is not finite, and when; or why bodies overlap on the way."""
        slot = int(self.workspace.watched.undefined[0])
        if slot < 0:
            return self._landed()
        checks = self.scene.template.checks
        path = checks.paths[checks.bounds.slots.tolist().index(slot)]
        value = self.bound.buffer[slot]
        now = self.workspace.state.values[len(self.scene.template.parameters)]
        return f"{path}: must be finite, not {value:g}, at t = {now:g}"

    def _waited(self, number: int) -> str:
        """Which condition of the schedule did not come to hold within its segment, if that ended the run."""
        clock, segment = self.workspace.state.clock[0], self.inputs[number]
        if segment.until is None or clock["time"] < clock["switch"]:
            return ""
        return unmet(number, segment, float(clock["switched"]))

    def _snapped(self) -> str:
        """Which body left its balance, when, and which contacts had held it."""
        state, template, records = self.workspace.state, self.scene.template, self.bound.records
        body = int(records.coordinates["body"][self._fastest()])
        slots = 2 * len(records.pairs)
        pairs = np.unique(np.flatnonzero(state.force[:slots, 0] > 0.0) // 2)
        held = {template.contacts[int(k)] for k in np.unique(records.pairs["contact"][pairs])}
        near = sorted("|".join(names) for names in held if template.bodies[body] in names)
        name, at = template.bodies[body], f" at {listed(near)}" if near else ""
        return (
            f"at t = {state.clock[0]['time']:.6g} {name} snaps out of its balance{at}: however"
            " short the step, it moves on, and momentum, which this rung leaves out, decides where it rests."
            " Use a dynamic rung, or damp the motion."
        )

    def _given_up(self, code: Code) -> str:
        """Why a step that has neither a solution nor a proof ends the run."""
        leap = None
        if self.model.metric:
            span = max(float(self.control[0]["step"]), float(self.workspace.state.clock[0]["tried"]))
            leap = leap_ahead(self.scene, self.bound, self.workspace, self._far(), span)
        why = self._hindrance().why_ended(code, self.scene.template.coordinates[self._fastest()])
        return str(leap or f"{why}. {self._hindrance().advice()}")

    def _fastest(self) -> int:
        """The coordinate without a prescribed speed that is fastest in the last step tried."""
        pace = self.bound.records.coordinates["lever"] * np.abs(self.workspace.scratch.v_new)
        return int(np.argmax(np.where(self.workspace.state.prescribed, 0.0, pace)))

    def _hindrance(self) -> Hindrance:
        return Hindrance(self.scene, self.model, self.bound, self.control, self.workspace.state.clock)

    def _far(self) -> float:
        """Least jump of a target that is reported."""
        return float(self.control[0]["tolerance"])

    def notes(self) -> tuple[str, ...]:
        """Remarks on the run so far (see `simulation.reasons.remarks`)."""
        found = remarks(
            self.model, self.theta, self.control, self.workspace.state.clock, self._least_moved,
            self._hindrance().why_short,
        )  # fmt: skip
        found += ignored(self.scene, self.model, self.inputs) + untouchable(self.scene)
        leap = leap_taken(self.scene, self.bound, self.workspace, self._far())
        found += self._held()
        return found if leap is None else (*found, str(leap))

    def _held(self) -> tuple[str, ...]:
        """A remark where bodies were held though another motion solved the step as well, with this motion."""
        *other, time = self.workspace.scratch.other.tolist()
        if time < 0.0:
            return ()
        pace = self.bound.records.coordinates["lever"] * np.array(other)
        fastest = float(np.abs(pace).max(initial=0.0))
        if fastest == 0.0:
            return ()
        names = self.scene.template.coordinates
        motion = [
            f"{names[i]} {pace[i] / fastest:+.2g}" for i in np.flatnonzero(np.abs(pace) > SEEN * fastest)
        ]
        return (
            f"rest: at t = {time:.6g} the run keeps bodies at rest by friction, but another motion solves the"
            f" step as well: {', '.join(motion)} (relative to the fastest). Richer rungs may take it",
        )

    def _least_moved(self) -> float:
        """Reach of the smallest body with a coordinate that forces move, by its largest shape; inf if there
        is none."""
        records, free = self.bound.records, self.workspace.state.prescribed == 0
        least = math.inf
        for b in np.unique(records.coordinates["body"][free]):
            reach = records.shapes["reach"][records.shapes["body"] == b]
            least = min(least, float(reach.max(initial=0.0)) or math.inf)
        return least

    def goes_on(self, balance: Balance) -> None:
        """Prepare the run to go on from a step without support, from the balance that its end names."""
        _, kept = self._unsupported()
        state, scratch, limited = self.workspace.state, self.workspace.scratch, len(balance.tau)
        slots = scratch.slots[: len(kept)][kept]
        lever = self.workspace.terms.lever[: len(kept)][kept]
        state.modes[:] = OPEN
        state.modes[slots] = balance.modes[: len(slots)]
        state.force[slots] = lever[:, None] * balance.force.reshape(-1, 2)
        scratch.limited_mode[:limited] = balance.modes[len(slots) :]
        scratch.limited_force[:limited] = balance.tau
        self._go_on()

    def _unsupported(self) -> tuple[ContactProblem, np.ndarray[Any, np.dtype[np.bool_]]]:
        """The problem of the last step, which nothing supports, with the contacts alone that have to balance
        the loads (see `simulation.planar.step.held`), and which those are (k,)."""
        state, terms = self.workspace.state, self.workspace.terms
        n, contacts, limited = (int(state.clock[0][name]) for name in ("free", "contacts", "limited"))
        problem = trimmed(self.workspace.problem, self.workspace.terms, n, contacts, limited)
        slots, gap = self.workspace.scratch.slots[:contacts], terms.gap[:contacts]
        closing = -float(state.clock[0]["tried"]) * (normals_of(terms, contacts) @ state.speed)
        near = (gap <= np.maximum(NEAR * state.clock[0]["reach"], closing)) | (state.modes[slots] != OPEN)
        problem = in_boxes(problem, terms, self.workspace.scratch.limited_force)
        return keep_contacts(problem, near), near

    def _go_on(self) -> None:
        """Let the run go on: the frame recorded as the last frame is not the last."""
        state, frames = self.workspace.state, self.workspace.frames
        state.clock["frames"] -= 1
        state.impulse[:] += frames.impulse[int(state.clock[0]["frames"])]

    def resisting(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """H of the last problem without its inertia."""
        state, terms = self.workspace.state, self.workspace.terms
        free = state.free[: int(state.clock[0]["free"])]
        grid = np.ix_(free, free)
        step = float(state.clock[0]["theta"]) * float(state.clock[0]["tried"])
        return np.asarray(step * whole(terms, terms.stiffness)[grid] + whole(terms, terms.damping)[grid])
