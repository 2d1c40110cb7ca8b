"""What conditions and schedules read at a state of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.scene.language.expression import SLOTS, STACK, Programs, evaluate, holds
from rungwise.scene.language.expression import Code as Program
from rungwise.scene.language.names import OF_CONTACTS
from rungwise.scene.language.poses import NUMBERS
from rungwise.scene.stated import StatedScene
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.moving.prepared import Bodies, Numbers


@dataclass
class Values:
    """Values that programs read: parameters, t, q, v, poses, gaps, normal forces and impulses of pairs of
    bodies, times since when parts of conditions have held, ways of bodies in a nominal step, tolerance
    (see `Template`); poses, gaps, forces and impulses of what conditions ask for, ways where they ask for
    rest."""

    scene: StatedScene
    bound: Numbers
    until: list[Program] = field(default_factory=list)

    def __post_init__(self) -> None:
        template = self.scene.template
        order = ("unsafe", "goal", "doomed")
        self.verdicts = [Code[name.upper()] for name in order if name in self.scene.conditions]
        stated = [self.scene.conditions[name] for name in order if name in self.scene.conditions]
        self._programs = Programs([*stated, *self.until])
        self._stack = np.zeros(STACK)
        self.all = np.zeros(template.value_count)
        self.all[: len(template.parameters)] = self.bound.values[:-1]
        self.all[-1] = self.bound.tolerance
        first, count = self._first_of_contacts, len(template.contacts)
        read = {slot - first for program in (*stated, *self.until) for slot in program.reads if first <= slot}
        self.pairs = sorted(
            {index % count for index in read if index < len(OF_CONTACTS) * count} if count else ()
        )
        poses = range(self._first_of_poses, first)
        self._poses = any(slot in poses for program in (*stated, *self.until) for slot in program.reads)
        self.all[self.first_time : self.first_time + SLOTS] = np.inf
        ways = range(len(self.all) - 1 - len(template.bodies), len(self.all) - 1)
        self._rests = any(slot in ways for program in (*stated, *self.until) for slot in program.reads)
        # Whether a condition of the scene or of its schedule reads values.
        self.is_asked = bool(self.verdicts or any(program.rows for program in self.until))
        # Parameters and t (p + 1,), to write into.
        self.told: Reals = self.all[: len(template.parameters) + 1]
        bodies = template.bodies
        self._of_pair = {
            tuple(sorted((bodies.index(a), bodies.index(b)))): index
            for index, (a, b) in enumerate(template.contacts)
            if index in self.pairs
        }

    @property
    def time(self) -> int:
        """Where t is."""
        return len(self.scene.template.parameters)

    @property
    def now(self) -> float:
        """The time."""
        return float(self.all[self.time])

    @property
    def first_time(self) -> int:
        """Where the times since when parts of conditions have held begin."""
        return self._first_of_contacts + len(OF_CONTACTS) * len(self.scene.template.contacts)

    @property
    def _first_of_contacts(self) -> int:
        return self._first_of_poses + NUMBERS * len(self.scene.template.posed)

    @property
    def _first_of_poses(self) -> int:
        template = self.scene.template
        return len(template.parameters) + 1 + len(template.coordinates) + len(template.velocities)

    def place(self, now: float, q: Reals, v: Reals, system: Bodies) -> None:
        """Take over a state without forces: time, q, v, and gaps."""
        template, first = self.scene.template, self._first_of_contacts
        time, n_q, count = len(template.parameters), len(template.coordinates), len(template.contacts)
        self.all[time] = now
        self.all[time + 1 : time + 1 + n_q] = q
        self.all[time + 1 + n_q : self._first_of_poses] = v
        if self._poses:
            self.all[self._first_of_poses : first] = cast(Any, system).frames(q).ravel()
        self.all[first + count : first + 2 * count] = 0.0
        for (a, b), index in self._of_pair.items():
            self.all[first + index] = system.gap(q, a, b)
        if self._rests:
            paces = system.paces(q, v) if hasattr(system, "paces") else self._paces(v)
            self.all[-1 - len(paces) : -1] = self.bound.step * paces

    def _paces(self, v: Reals) -> Reals:
        """Speeds (b,) of bodies that do not turn, whose velocities are called `body.name`."""
        template = self.scene.template
        owners = np.array([name.split(".")[0] for name in template.velocities])
        return np.array([np.linalg.norm(v[owners == body]) for body in template.bodies])

    def read(self, stepper: Stepper, system: Bodies) -> None:
        """Take over the state of a run, with the forces of its last step, and add their impulses."""
        self.place(stepper.time, stepper.q, stepper.v, system)
        self.push(stepper, system, float(stepper.state.clock[0]["tried"]))

    def push(self, stepper: Stepper, system: Bodies, h: float) -> None:
        """Add the forces of a run's last step, and their impulses as in a step of length h."""
        first, count = self._first_of_contacts, len(self.scene.template.contacts)
        for a, b, force in system.pushes(stepper.state.force) if self.pairs else ():
            index = self._of_pair.get((min(a, b), max(a, b)), -1)
            if index >= 0:
                self.all[first + count + index] += force
                self.all[first + 2 * count + index] += h * force

    def hand_on(self, before: Reals) -> None:
        """Go on from the impulses of a run's values (see above), and since when parts have held."""
        first, count = self._first_of_contacts, len(self.scene.template.contacts)
        kept = slice(first + 2 * count, self.first_time + SLOTS)
        self.all[kept] = before[kept]

    def judge(self) -> tuple[Code, float, float]:
        """The first condition of the scene that holds, RUNNING if none does; signed margins of the goal, and
        of the unsafe or doomed condition that is nearer, -inf where none is stated."""
        verdict, goal, danger = Code.RUNNING, -np.inf, -np.inf
        for k, code in enumerate(self.verdicts):
            first, last = self._programs.table[k]
            found = evaluate(
                self._programs.code, self._programs.constants, first, last, self.all, self._stack
            )
            if verdict == Code.RUNNING and (found >= 0.0 or (found != found and self._holds(k))):
                verdict = code
            if code == Code.GOAL:
                goal = found
            else:
                danger = max(danger, found)
        return verdict, goal, danger

    def is_guarded(self, number: int) -> bool:
        """Whether a condition ends segment k."""
        return number < len(self.until) and bool(self.until[number].rows)

    def until_margin(self, number: int) -> float:
        """Signed margin of the condition of `until` number k; -inf where there is none."""
        if not self.is_guarded(number):
            return -np.inf
        programs = self._programs
        first, last = programs.table[len(self.verdicts) + number]
        return float(evaluate(programs.code, programs.constants, first, last, self.all, self._stack))

    def between(self, part: float, begun: Reals, ended: Reals) -> None:
        """Set time, places and gaps to a part of the way of a step; speeds and forces are those of its
        end."""
        template, first = self.scene.template, self._first_of_contacts
        time, contacts = len(template.parameters), len(template.contacts)
        self.all[:] = ended
        places = slice(time, time + 1 + len(template.coordinates))
        for own in (places, slice(self._first_of_poses, first + contacts)):
            finite = np.isfinite(begun[own]) & np.isfinite(ended[own])
            ways = np.where(finite, part * ended[own] + (1.0 - part) * begun[own], ended[own])
            self.all[own] = ways

    def is_over(self, number: int) -> bool:
        """Whether the condition of `until` number k holds."""
        return self._holds(len(self.verdicts) + number)

    def _holds(self, k: int) -> bool:
        first, last = self._programs.table[k]
        return last > first and holds(
            self._programs.code, self._programs.constants, first, last, self.all, self._stack
        )
