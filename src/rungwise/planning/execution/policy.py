"""Controllers that follow a plan from what is measured, and propose its next part anew where that differs.

Between proposals a policy gives the inputs of the part that runs. Where objects are not where they are
expected, what is left is run ahead from the allowed place nearest to the measured one, on the cheapest rung
on which the plan is known to hold. If it does not lead on, or if a part ended without the goal, the next leg
or move is proposed anew from there (a receding horizon of one leg).
"""

from __future__ import annotations

import math
import time as clock
from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rungwise.deadline import TimeOver, seconds
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung, rung
from rungwise.outcome import Code
from rungwise.planning.execution.feedback import begun
from rungwise.planning.execution.receding import rest_of, whole
from rungwise.planning.execution.remaining_legs import ASTRAY, PIECE, in_pieces
from rungwise.planning.execution.timed import Timed, still, timed
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.propagate import GOES_ON, Places
from rungwise.planning.plan import HELD, NOTHING, PLACES_ONLY, Plan
from rungwise.simulation.live.observation import Observation
from rungwise.simulation.options import count, moving_rung
from rungwise.simulation.state import State, StateError
from rungwise.world.carriers import TaskError
from rungwise.world.find import world_of
from rungwise.world.nearest import Closing, Nearest
from rungwise.world.stepped import Simulation

FOLLOWING, RE_PROPOSING, LOST = "following", "re-proposing", "lost"
"""What a policy does: it gives the inputs of its plan; it has proposed the next part anew; or it knows
nothing that leads on, and goes on with what is left or stands still."""
LOOKS = 5
"""How often a policy is asked at least in the time in which the fastest robot goes a tenth of the size."""
LEAST, MOST = 100, 2000
"""How often it is asked in the time of a plan, at least and at most."""
PROPOSALS = 4
"""Proposals that are made at most, for each move that a plan of the task may have."""
PIECES = 100
"""Pieces of a plan of inputs over time at whose ends bodies are expected."""
LATER = 5.0
"""How many times as long as the plan an execution with a policy may take."""
WAITED = 0.1
"""Part of the plan's duration after which a policy that is lost tries again, twice as long each time that it
finds nothing: what stands still seldom has a way on that was not found before."""
FARTHEST = 0.25
"""How far what is measured may be, in parts of the size, from the nearest place at which a run begins, or
nothing is proposed from there."""
FIRM = 10.0
"""What a change of a robot's place weighs over one of an object's: joints are known better than objects."""
CLOSED = 2e-3
"""Gap, in parts of the size, within which contacts are expected to be closed."""


class Proposal(NamedTuple):
    """What the policy did when the measured state differed from the plan.

    time: when; why: what differed; found: whether a way on was found; kept: whether this is the rest of the
    plan as it was; steps: simulated steps that the proposal took; seconds: the time that it took.
    """

    time: float
    why: str
    found: bool
    kept: bool
    steps: int
    seconds: float


class Policy:
    """A controller that follows a plan from the measured state. Call it with an observation, a state or a
    simulation. It returns the next inputs by name: values to hold, or to ramp to if `ramp` is true. It goes
    on from call to call; `restart` begins the plan anew.

    status: "following", "re-proposing" or "lost". A lost policy knows no way on: it returns the remaining
    inputs of the plan, or stands still. reason: why it re-proposes or is lost. proposals: all proposals so
    far, with the steps and seconds that they took.
    """

    @keywords
    def __init__(
        self,
        plan: Plan,
        *,
        model: Rung | str | None = None,
        budget: int | None = None,
        limit: float | None = None,
        average: int = 1,
    ) -> None:
        """
        Args:
            plan: the plan to follow.
            model: rung on which proposals are run; by default the cheapest on which the plan was found and
                from which it held on all later stages.
            budget: greatest number of steps of a proposal, after which no further run begins; by default as
                for a move of re-planning.
            limit: greatest number of seconds of a proposal; with a limit proposals depend on the machine.
            average: number of measurements over which errors of places are averaged, against noise.

        Raises TaskError if there is no plan, or one of places only.
        """
        if plan.stage is None or not plan.found:
            raise TaskError(f"plan: there is none. {plan.reason}")
        if not plan.stage.model.moves:
            raise TaskError(f"plan: {PLACES_ONLY}")
        self.plan, world = plan, world_of(plan.scene)
        self._stage = adequate(plan) if model is None else Stage(moving_rung(model), plan.stage.tol)
        self._steps = world.replanning_steps if budget is None else count("budget", budget, 1)
        self._limit = seconds(limit)
        self._average = count("average", average, 1)
        self._nearest = Nearest(plan.scene, plan.parameters, FARTHEST, FIRM)
        self._work = begun(plan, Budget(), plan.seed, 1)
        self._task = self._work.task
        self._nominal = self._work.predictor(self._stage)
        self._rest = rest_of(plan, self._nominal, self._work)
        self._whole = whole(plan, self._work)
        self._longest = self._whole.duration / PIECES
        if self._task.fastest:
            self._longest = PIECE * self._task.size / self._task.fastest
        self.restart()

    def restart(self) -> None:
        """Begin with the plan anew, at the time of the next call."""
        self._rest = rest_of(self.plan, self._nominal, self._work)
        self._now, self._begun, self._last = self._whole, math.nan, math.nan
        self._is_own, self._is_lost, self._again = True, False, math.inf
        self._gone = self._losses = 0
        self._levels = np.array(self._rest.before)
        self._errors: deque[Reals] = deque(maxlen=self._average)
        self.status, self.reason = FOLLOWING, ""
        self.proposals: list[Proposal] = []

    @property
    def model(self) -> Rung:
        """The rung on which proposals are run."""
        return self._stage.model

    @property
    def ramp(self) -> bool:
        """Whether inputs are to be ramped to what it returns: targets of servos; speeds are held."""
        return any(self._whole.ramps)

    @property
    def rate(self) -> float:
        """How often it wants to be asked in a unit of the scene's time."""
        asked = LOOKS * self._task.fastest / (0.1 * self._task.size)
        return float(np.clip(asked, LEAST / self._whole.duration, MOST / self._whole.duration))

    @property
    def duration(self) -> float:
        """For how long to let it run at most."""
        return LATER * self._whole.duration

    def __call__(self, seen: Observation | State | Simulation[Any]) -> dict[str, float]:
        """The inputs to hold next, after what is seen: an observation, a state, or a `Simulation`. Whatever
        state it is, it raises nothing: see `status`. Raises TaskError for what is no state."""
        if isinstance(seen, Simulation):
            seen = seen.observe()
        if not isinstance(seen, Observation | State):
            raise TaskError(
                f"policy: takes an observation, a state or a simulation, not {type(seen).__name__}"
            )
        if tuple(seen.names) != tuple(self.plan.scene.template.coordinates):
            raise TaskError(f"policy: what is seen is not of {self.plan.scene.name}")
        now = float(seen.time)
        if not (math.isfinite(now) and np.isfinite(seen.q).all() and np.isfinite(seen.v).all()):
            self.status, self.reason = LOST, "what is measured is not finite"
            return self._told()
        if not self._last <= now:
            self._begun = now if math.isnan(self._last) else self._begun + (now - self._last)
        period = now - self._last if now > self._last else 1.0 / self.rate
        self._last = now
        self._look(now, period, np.array(seen.q, float), np.array(seen.v, float))
        at = now - self._begun
        wanted = self._now.at(at + period) if self.ramp else self._now.mean(at, at + period)
        self._levels = np.clip(wanted, self._task.low, self._task.high)
        return self._told()

    def _told(self) -> dict[str, float]:
        return dict(zip(self.plan.scene.template.inputs, self._levels.tolist(), strict=True))

    def _look(self, now: float, period: float, q: Reals, v: Reals) -> None:
        """Propose the next part anew where what is measured, or the end of the last one, asks for it."""
        at, part = now - self._begun, self._now
        expected = part.expected(at)
        self._errors.append(q - expected)
        q = expected + np.mean(self._errors, axis=0)
        running = int(part.legs[part.segment(at)])
        if at >= part.duration - 0.5 * period or (self._is_lost and now >= self._again):
            ended = "the plan has ended" if self._is_own else "the part that was proposed has ended"
            first = running + 1 if math.isfinite(part.duration) else 0
            self._propose(now, q, v, first, part.labels, ended, expected)
            return
        off = 0.0
        if part.is_known(at) and not self._is_lost:
            off = self._rest.away(max(running - self._gone, 0), q, expected) / self._task.size
        begins = at == 0.0 or int(part.legs[part.segment(max(at - period, 0.0))]) != running
        if begins and (self._is_own or not self._rest.midway) and off > self._rest.astray:
            self._propose(now, q, v, running, (), self._told_off(off, "as a part begins"), expected)
        elif off > ASTRAY and self._rest.midway:
            made = part.labels[: part.segment(at)]
            own = [label for label, leg in zip(made, part.legs, strict=False) if leg == running]
            self._propose(now, q, v, running, tuple(own), self._told_off(off, "on the way"), expected)
        elif not self._is_lost:
            self.status, self.reason = FOLLOWING, ""
            if begins:
                self._now = self._rest.fitted(part, running, q, expected)

    def _told_off(self, off: float, when: str) -> str:
        return f"objects are {off * self._task.size:.3g} from where they were expected {when}"

    def _propose(
        self, now: float, q: Reals, v: Reals, leg: int, made: tuple[str, ...], why: str, expected: Reals
    ) -> None:
        """Propose what is left from this leg on anew, from a measured place (n,) and velocities (n_v,)."""
        if len(self.proposals) >= PROPOSALS * self._task.moves[1]:
            self._lose(now, f"{why}; {len(self.proposals)} proposals were made, and no more will be")
            return
        began, budget = clock.perf_counter(), Budget(self._steps, self._limit)
        self._nominal.budget = budget
        found, keeps, fault = None, False, "no leg or move was found that leads to the goal"
        number = len(self.proposals)
        try:
            start = self._measured(q, v, expected)
            found = self._kept(now, start)
            keeps = found is not None
            if found is None:
                self._gone += self._rest.leave(max(leg - self._gone, 0), made)
                work = replace(
                    self._work, start=start, budget=budget, seed=self.plan.seed + number,
                    rng=np.random.default_rng([self.plan.seed, number]),
                )  # fmt: skip
                found = self._rest.anew(work, self._levels)
        except TimeOver:
            fault = f"the budget of a proposal, or its limit, was spent: {budget.spent.total()} steps"
        except (InputError, np.linalg.LinAlgError) as error:
            fault = str(error)
        took = clock.perf_counter() - began
        self.proposals.append(Proposal(now, why, found is not None, keeps, budget.spent.total(), took))
        if found is None:
            self._lose(now, f"{why}; {fault}")
            return
        self._now, self._begun, self._is_lost, self._losses = found, now, False, 0
        self._errors.clear()
        if keeps:
            self.status, self.reason = FOLLOWING, f"{why}; the rest of the plan still leads to the goal"
            return
        self._is_own, self._gone = False, 0
        self.status, self.reason = RE_PROPOSING, why

    def _kept(self, now: float, start: Places) -> Timed | None:
        """What is left of the part that runs, as it is expected from a measured place, where it still leads
        to the goal, or to where the part was to end."""
        at, part = now - self._begun, self._now
        if at >= part.duration - 0.5 / self.rate or not math.isfinite(part.duration):
            return None
        names = self.plan.scene.template.inputs
        segments, labels, legs = part.left(at, names)
        pieces = in_pieces(names, self._levels, segments, labels, legs, self._longest)
        found = timed(self._nominal, self._task, start, self._levels, *pieces)
        if found.outcome == Code.GOAL:
            return found
        last = max(int(legs[-1]) - self._gone, 0)
        off = self._rest.away(last, found.path[-1], part.path[-1])
        ends = found.outcome in GOES_ON and off <= ASTRAY * self._task.size
        return found if ends and not self._is_own else None

    def _lose(self, now: float, why: str) -> None:
        """Go on with what is left, or stand still and try again when the plan would have gone on a while."""
        self.status, self.reason, self._is_lost = LOST, why, True
        part = self._now
        if now - self._begun >= part.duration - 1e-9 or not math.isfinite(part.duration):
            self._now, self._begun, self._gone = still(self._task, self._levels, part.path[-1]), now, 0
            self._again = now + WAITED * 2.0**self._losses * self._whole.duration
            self._losses += 1

    def _measured(self, q: Reals, v: Reals, expected: Reals) -> Places:
        """The allowed place nearest to a measured one, as the planner goes on from it. Raises StateError."""
        q = q.copy()
        self.plan.scene.normalise(q, "state.q", StateError)
        around, closing = self._nearest.around, None
        if around is not None:
            touching = around.touches(expected, CLOSED * self._task.size)
            near = (touching.gaps <= CLOSED * self._task.size) & self._rest.closes
            closing = Closing(touching.pairs[near], touching.gaps[near], ASTRAY * self._task.size)
        return self._nearest(q, lambda at: self._nominal.measured(at, v, self._levels), closing)[0]


def adequate(plan: Plan) -> Stage:
    """The cheapest stage on which the plan was found and from which it held on all later ones: no diagnosis
    says that it fails there."""
    assert plan.stage is not None
    found = plan.stage
    names = [record.stage for record in plan.records]
    if str(plan.stage) not in names:
        return found
    records = plan.records[: names.index(str(plan.stage)) + 1]
    for later, before in zip(records[::-1], records[-2::-1], strict=False):
        if later.how != HELD or before.how == NOTHING:
            break
        name, _, tol = before.stage.partition(" @ ")
        model = rung(name)
        if not model.moves or not model.loads:
            break
        found = Stage(model, float(tol))
    return found
