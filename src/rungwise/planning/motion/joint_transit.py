"""Robots in space on their way to objects, and their pushes: joints that lead a body along straight lines.

A push goes along a line that meets the ball about an object: any direction, and any place in that ball. The
body is brought beside the object on that line by damped least squares on its joints (Nakamura and Hanafusa
1986), as near to the line as the joints allow; what does not come to its distance from the object is no move.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.planning.motion.moves import Moves, Stroke, pushed_length
from rungwise.planning.motion.propagate import Places
from rungwise.planning.motion.transit import NEAR, Transit
from rungwise.planning.task.task import Task
from rungwise.scene.space.laws import touching
from rungwise.system.spatial.drives import joints_of
from rungwise.world.carriers import Carrier, TaskError
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.questions import Question
from rungwise.world.spatial.configurations import SpatialConfigurations
from rungwise.world.spatial.instance import reaches_of

ITERATIONS, LONGEST, DAMPING = 40, 0.3, 1e-3
"""Steps of least squares, how far a joint goes in one, and their damping, over the size squared."""
TRIES = 4
"""Places of the joints from which they are sought: where they are, and others."""
OFF = 0.25
"""Part of the clearance by which a body may miss its distance from an object."""
AROUND = 64
"""Places of joints that are tried to come away from what a robot touches."""


def _room(task: Task) -> SpatialConfigurations:
    """Where the bodies of a scene of solids may be placed."""
    room: Any = world_of(task.scene).configurations(task.parameters, task.size)
    found: SpatialConfigurations = room
    return found


class Tool:
    """A body that joints lead, and the objects that it may push at."""

    def __init__(self, task: Task, room: SpatialConfigurations, carrier: Carrier) -> None:
        import mujoco

        self._mujoco, self.room, self.carrier = mujoco, room, carrier
        m = self.model = room.model
        self.data, names = mujoco.MjData(m), list(task.scene.template.bodies)
        self.body, self.columns = names.index(carrier.body), list(carrier.places)
        joints = joints_of(m, self.body)
        self.dofs = m.jnt_dofadr[joints]
        limited = m.jnt_limited[joints].astype(bool)
        self.low = np.where(limited, m.jnt_range[joints, 0], -np.inf)
        self.high = np.where(limited, m.jnt_range[joints, 1], np.inf)
        roles = world_of(task.scene).roles(task.parameters)
        self.targets = [
            (a + b - self.body, pairs)
            for (a, b), pairs in room.geoms.items()
            if self.body in (a, b) and roles[names[a + b - self.body]] == OBJECT
        ]
        if not self.targets:
            raise TaskError(f"task.transit.{carrier.body}: touches no object; see the geoms of both")
        own = (m.geom_bodyid == self.body) & touching(m)
        self._geoms = np.flatnonzero(own)
        self.reach = reaches_of(m)

    def place(self, q: Reals) -> None:
        """Put the model at q (n_q,)."""
        self.data.qpos[:] = q
        self._mujoco.mj_kinematics(self.model, self.data)
        self._mujoco.mj_comPos(self.model, self.data)

    @property
    def middle(self) -> Reals:
        """The middle (3,) of the geoms that touch."""
        return np.asarray(self.data.geom_xpos[self._geoms].mean(axis=0))

    def slope(self, point: Reals) -> Reals:
        """How joints move a point of the body (3, k)."""
        found = np.zeros((3, self.model.nv))
        self._mujoco.mj_jac(self.model, self.data, found, None, point, self.body)
        return found[:, self.dofs]

    def nearest(self, target: int) -> tuple[float, Reals, Reals]:
        """The gap to an object, the direction (3,) away from it, and the point (3,) of the body there."""
        least, ends = math.inf, np.zeros(6)
        for a, b in self.targets[target][1]:
            own = np.zeros(6)
            gap = self._mujoco.mj_geomDistance(self.model, self.data, a, b, self.room.far, own)
            if gap < least:
                least = gap
                ends = own if self.model.geom_bodyid[b] == self.body else own[[3, 4, 5, 0, 1, 2]]
        away = (ends[3:] - ends[:3]) * (1.0 if least >= 0.0 else -1.0)
        length = float(np.linalg.norm(away))
        return least, away / length if length > 0.0 else away, ends[3:]

    def led(self, q: Reals, aim: Reals) -> Reals:
        """Places (n_q,) with the middle of the body at a point (3,), as near as joints bring it."""
        found = q.copy()
        for _ in range(ITERATIONS):
            self.place(found)
            middle = self.middle
            if not self._step(found, self.slope(middle), aim - middle):
                break
        return found

    def beside(self, q: Reals, target: int, point: Reals, away: Reals) -> Reals | None:
        """Places with the body at its clearance from an object, on the line through a point along `away`
        (3,), as near to that as joints bring it; None where it does not come to that distance."""
        across = np.eye(3) - np.outer(away, away)
        found = self.led(q, point + away * self._far(target))
        for _ in range(ITERATIONS):
            self.place(found)
            gap, normal, tip = self.nearest(target)
            middle = self.middle
            slopes = np.vstack([across @ self.slope(middle), normal @ self.slope(tip)])
            lacks = np.append(across @ (point - middle), self.carrier.clearance - gap)
            if not self._step(found, slopes, lacks):
                break
        self.place(found)
        gap, normal, _ = self.nearest(target)
        leans = math.acos(float(np.clip(normal @ away, -1.0, 1.0)))
        fits = abs(gap - self.carrier.clearance) <= OFF * self.carrier.clearance
        return found if fits and leans <= self.carrier.lean else None

    def _far(self, target: int) -> float:
        """How far from the point of a line the middle of the body is beyond the object."""
        other = self.targets[target][0]
        ball = float(self.reach[other] + self.model.geom_rbound[self._geoms].max())
        return ball + self.carrier.clearance

    def _step(self, q: Reals, slopes: Reals, lacks: Reals) -> bool:
        """Take a step of the joints in q; False where it is none."""
        damped = slopes @ slopes.T + DAMPING * self.room.size**2 * np.eye(len(lacks))
        step = np.clip(slopes.T @ np.linalg.solve(damped, lacks), -LONGEST, LONGEST)
        before = q[self.columns]
        q[self.columns] = np.clip(before + step, self.low, self.high)
        return bool(np.abs(q[self.columns] - before).max() > 1e-9)

    def drawn(self, q: Reals, number: int) -> Reals:
        """Places with the joints as they are, or, for other numbers, drawn in their ranges."""
        if number == 0:
            return q
        found, rng = q.copy(), np.random.default_rng(number)
        low, high = np.maximum(self.low, -math.pi), np.minimum(self.high, math.pi)
        found[self.columns] = rng.uniform(low, high)
        return found


class SpaceMoves(Moves):
    """Moves of bodies that joints lead: a direction (an angle and a height), where the line of the push meets
    the ball about the object (two numbers), and its length."""

    per = 5
    forgets = False

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.room = _room(task)
        self.tools = [Tool(task, self.room, carrier) for carrier in task.carriers]

    @property
    def pushable(self) -> list[list[str]]:
        names = self.task.scene.template.bodies
        return [[names[target] for target, _ in tool.targets] for tool in self.tools]

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
            v[:, tool.dofs] = 0.0
        return Places(q, v, places.time, places.memory), fits

    @cached_property
    def transit(self) -> SpaceTransit:
        return SpaceTransit(self.task, self.question)

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
        off = tool.reach[tool.targets[target][0]] * (2.0 * part[2:4] - 1.0)
        tool.place(q)
        middle = tool.data.xipos[tool.targets[target][0]]
        return target, middle + off[0] * side + off[1] * np.cross(away, side), away

    def _strokes(self, vectors: Reals, places: Places) -> list[Stroke]:
        strokes = []
        for k, tool in enumerate(self.tools):
            columns, part = list(tool.carrier.places), vectors[:, 5 * k + 4]
            there, back = np.zeros((2, len(vectors), len(columns)))
            lengths = np.zeros(len(vectors))
            for i, length in enumerate(pushed_length(tool.carrier, part)):
                _, _, away = self._line(k, vectors[i], places.q[i])
                tool.place(places.q[i])
                begun = tool.middle
                ended = tool.led(places.q[i], begun - length * away)
                tool.place(ended)
                end = tool.middle
                lengths[i] = max(float(np.linalg.norm(end - begun)), tool.carrier.clearance)
                returned = tool.led(ended, end + tool.carrier.clearance * away)
                there[i], back[i] = (ended - places.q[i])[columns], (returned - ended)[columns]
            strokes.append(Stroke(there, back, lengths))
        return strokes


class SpaceTransit(Transit):
    """Ways of bodies that joints lead, with all else where it is."""

    def __init__(self, task: Task, question: Question) -> None:
        super().__init__(task, question)
        self._space = _room(task)
        led = np.searchsorted(self._space.numbers, self._columns)
        reach = self._space.reach_of(self._space.of_numbers[led])
        self._pairs = np.flatnonzero((reach[self._space.pairs] > 0.0).any(axis=(1, 2)))
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
