"""Robots in space on their way to objects, and their pushes: joints that lead a body along straight lines.

A push goes along a line that meets the ball about an object: any direction, and any place in that ball. The
body is brought beside the object on that line, as near to it as the joints allow; what does not come to its
distance from the object is no move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.planning.motion.moves import Moves, Stroke, pushed_length
from rungwise.planning.motion.propagate import Places
from rungwise.planning.motion.transit import NEAR, Transit
from rungwise.planning.task.task import Task
from rungwise.world.contract import Configurations, Tool
from rungwise.world.find import world_of
from rungwise.world.margins import Question

TRIES = 4
"""Places of the joints from which they are sought: where they are, and others."""
AROUND = 64
"""Places of joints that are tried to come away from what a robot touches."""


class SpaceMoves(Moves):
    """Moves of bodies that joints lead: a direction (an angle and a height), where the line of the push meets
    the ball about the object (two numbers), and its length."""

    per = 5
    forgets = False

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.room = world_of(task.scene).configurations(task.parameters, task.size)
        self.tools = [self.room.tool(carrier) for carrier in task.carriers]

    @property
    def pushable(self) -> list[list[str]]:
        names = self.task.scene.template.bodies
        return [[names[target] for target in tool.targets] for tool in self.tools]

    def begin(self, vectors: Reals, places: Places) -> tuple[Places, NDArray[np.bool_]]:
        q, v = places.q.copy(), places.v.copy()
        fits = np.ones(len(vectors), bool)
        for k, tool in enumerate(self.tools):
            for i, vector in enumerate(vectors):
                target, point, away = self._line(k, vector, places.q[i])
                found = self._led(tool, q[i], target, point, away)
                if found is None:
                    fits[i] = False
                else:
                    q[i] = found
            v[:, tool.changes] = 0.0
        return Places(q, v, places.time, places.memory), fits

    @cached_property
    def transit(self) -> SpaceTransit:
        return SpaceTransit(self.task, self.question, self.room, self.tools)

    def _led(self, tool: Tool, q: Reals, target: int, point: Reals, away: Reals) -> Reals | None:
        """The first place beside the object at which nothing of the robot overlaps."""
        for number in range(TRIES):
            found = tool.beside(tool.drawn(q, number), target, point, away)
            if found is not None and self._apart(found, q):
                return found
        return None

    def _apart(self, q: Reals, before: Reals) -> bool:
        gaps, held = (self.room.look(row[None])[0][0] for row in (q, before))
        return bool((gaps >= np.minimum(0.0, held) - self.room.rounding).all())

    def _line(self, k: int, vector: Reals, q: Reals) -> tuple[int, Reals, Reals]:
        """An object, a point (3,) of the line of a push at it, and the direction (3,) that the push comes
        from."""
        tool, part = self.tools[k], vector[5 * k : 5 * k + 5]
        scaled = float(np.mod(part[0], 1.0)) * len(tool.targets)
        target = min(int(scaled), len(tool.targets) - 1)
        turn, height = 2.0 * math.pi * (scaled - target), 2.0 * float(part[1]) - 1.0
        flat = math.sqrt(max(0.0, 1.0 - height**2))
        away = np.array([flat * math.cos(turn), flat * math.sin(turn), height])
        side = np.array([-math.sin(turn), math.cos(turn), 0.0])
        off = tool.reach(target) * (2.0 * part[2:4] - 1.0)
        return target, tool.centre(q, target) + off[0] * side + off[1] * np.cross(away, side), away

    def _strokes(self, vectors: Reals, places: Places) -> list[Stroke]:
        strokes = []
        for k, tool in enumerate(self.tools):
            columns, part = list(tool.carrier.places), vectors[:, 5 * k + 4]
            there, back = np.zeros((2, len(vectors), len(columns)))
            lengths = np.zeros(len(vectors))
            for i, length in enumerate(pushed_length(tool.carrier, part)):
                _, _, away = self._line(k, vectors[i], places.q[i])
                begun = tool.middle(places.q[i])
                ended = tool.led(places.q[i], begun - length * away)
                end = tool.middle(ended)
                lengths[i] = max(float(np.linalg.norm(end - begun)), tool.carrier.clearance)
                returned = tool.led(ended, end + tool.carrier.clearance * away)
                there[i], back[i] = (ended - places.q[i])[columns], (returned - ended)[columns]
            strokes.append(Stroke(there, back, lengths))
        return strokes


class SpaceTransit(Transit):
    """Ways of bodies that joints lead, with all else where it is."""

    def __init__(self, task: Task, question: Question, space: Configurations, tools: Sequence[Tool]) -> None:
        super().__init__(task, question, {})
        self._space = space
        led = np.searchsorted(self._space.numbers, self._columns)
        moves = np.any([tool.moves for tool in tools], axis=0)
        self._pairs = np.flatnonzero(moves[self._space.pairs].any(axis=1))
        self._limits = self._space.low[led], self._space.high[led]
        self._units = self._space.units[led]

    def time(self, a: Reals, b: Reals) -> float:
        names, moved = self._space.names, self._space.moved(np.stack([a, b]))[0]
        ways = [float(moved[names.index(each.body)]) / each.speed for each in self._task.carriers]
        return max(ways, default=0.0)

    def _gaps(self, q: Reals) -> Reals:
        return self._space.look(q)[0][:, self._pairs]

    def _moved(self, a: Reals, b: Reals) -> float:
        moved = self._space.moved(np.stack([a, b]))[0]
        return float(moved[self._space.pairs[self._pairs]].sum(axis=1).max(initial=0.0))

    def _room(self, q: Reals, goal: Reals) -> tuple[Reals, Reals]:
        ends = np.stack([q, goal])[:, self._columns]
        about = math.pi * self._units
        low, high = ends.min(axis=0) - about, ends.max(axis=0) + about
        return np.maximum(low, self._limits[0]), np.minimum(high, self._limits[1])

    def away(self, q: Reals) -> Reals:
        held = float(self._gaps(q[None]).min(initial=math.inf))
        if held >= NEAR * self._clearance:
            return q
        rng, trials = np.random.default_rng(0), np.repeat(q[None], AROUND, axis=0)
        trials[:, self._columns] += rng.standard_normal((AROUND, len(self._columns)))
        for row in trials:
            row[self._columns] = np.clip(row[self._columns], *self._limits)
            far = self._moved(q, row)
            row[:] = q + min(1.0, 2.0 * self._clearance / far if far > 0.0 else 1.0) * (row - q)
        gaps = self._gaps(trials).min(axis=1)
        return trials[gaps.argmax()] if gaps.max() > max(0.0, held) else q
