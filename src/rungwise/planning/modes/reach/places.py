"""Where an arm's bodies are at a goal, and how they leave it straight: as parts are taken apart, so they
are put together (Homem de Mello and Sanderson 1990)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from rungwise.kernel import Reals
from rungwise.planning.modes.reach.arm import Arm, turned_by
from rungwise.planning.motion.free_paths import CHECKS, grown, shortened
from rungwise.planning.motion.placements import Placing, placed_part
from rungwise.scene.language.lasting import names_in
from rungwise.world.carriers import turn_of
from rungwise.world.margins import Question

FEW, DRAWN = 4, 16
"""Places at the goal from which ways out are sought, or that are moved apart; and places that are drawn."""
CENTRED, WIDEST, NARROWEST = 60, 0.1, 1e-6
"""Linear programs by which a place at the goal is moved away from what is beside it, and by how much
joints change in the first at most, and in the last at least."""
SECTORS = 24
"""Parts of a turn by which bodies are turned where they overlap something at the goal."""
CLEAR = 0.1
"""Gap, in parts of the size, that counts as free of all else."""
STEP, FARTHEST = 0.05, 4.0
"""Steps, and length of straight ways out of a goal at most, in parts of the size."""
STRAIGHT = 0.02
"""By how much bodies may miss a straight way, in parts of a step."""
SAME = 0.99
"""Cosine of two directions from which on they count as one."""
FINEST = 0.25
"""Parts of a way that are not proved free are cut until bodies move by less than this part of the gap that
they are to keep."""


class Entry(NamedTuple):
    """A way into the goal: places (k, n_q), the first of them free of all else and the last one at the goal,
    and the direction (3,) in which the bodies go; zero where the goal itself is free."""

    places: Reals
    direction: Reals


class Room:
    """An arm among all else: gaps, and ways in which they stay open."""

    def __init__(self, arm: Arm, start: Reals) -> None:
        task = arm.task
        self.arm, self.start, self.size = arm, start, task.size
        loose = np.concatenate([arm.columns, arm.objects]).astype(np.int64)
        scenes = [task.search, task.scene]
        self._placings = [Placing(task, scene, start, loose=loose) for scene in scenes]
        parts = [placed_part(scene.file.goal or "") for scene in scenes]
        self._questions = [
            Question(scene, part, task.parameters) for scene, part in zip(scenes, parts, strict=True)
        ]
        self.room = self._placings[0].room
        self._own = np.flatnonzero(np.isin(self.room.pairs, arm.moved).any(axis=1))
        names = list(task.scene.template.bodies)
        numbers = [[names.index(name) for name in pair] for pair in task.scene.template.contacts]
        self._pairs = np.flatnonzero(np.isin(numbers, arm.moved).any(axis=1))
        self._bounds = self.room.pairs[self._own]
        self.clear = CLEAR * task.size
        begun = self.gaps(start)
        self.allowed = np.maximum(self.room.rounding, -begun)
        self._wanted = np.minimum(self.clear, 0.5 * np.maximum(begun, 0.0))

    def gaps(self, q: Reals) -> Reals:
        """Gaps (p,) between bodies of the arm and all that they may touch, at a place (n_q,)."""
        return np.asarray(self.room.look(q[None])[0][0, self._own])

    def goals(self, rng: np.random.Generator, in_time: Callable[[], bool]) -> list[Reals]:
        """Places (n_q,) at the goal where nothing overlaps, those first to which joints turn least."""
        for placing, question in zip(self._placings, self._questions, strict=True):
            drawn = placing.goals(rng, in_time, apart=False, count=DRAWN).places
            joints = drawn[:, self.arm.places] - self.start[self.arm.places]
            far = np.abs(joints / self.arm.rates).max(axis=1)
            found = list[Reals]()
            for k in np.argsort(far, kind="stable"):
                place = self._parted(drawn[k], question)
                if place is not None:
                    found.append(place)
                if len(found) == FEW or not in_time():
                    break
            if found:
                return found
        return []

    def _parted(self, q: Reals, question: Question) -> Reals | None:
        """A place (n_q,) at the goal near one at which bodies may overlap: moved apart as it is, or after
        turns of the bodies about their own axes; None where none was found."""
        place = self.centred(q, question)
        if (self.gaps(place) >= -self.allowed).all():
            return place
        turned = sorted(self._turned(q, question), key=self._least, reverse=True)
        for trial in turned[:FEW]:
            place = self.centred(trial, question)
            if (self.gaps(place) >= -self.allowed).all():
                return place
        return None

    def _turned(self, q: Reals, question: Question) -> Iterator[Reals]:
        """Places (n_q,) at the goal after turns of bodies about one of the first one's own axes."""
        begun = self.arm.poses(q)
        for axis in turn_of(begun[0, 3:]).T:
            place = q
            for _ in range(1, SECTORS):
                aims = self.arm.poses(place)
                aims[:, :3] = begun[:, :3]
                aims[:, 3:] = [turned_by(pose, 2.0 * np.pi / SECTORS * axis) for pose in aims[:, 3:]]
                place, missed = self.arm.brought(place, aims)
                if missed > STRAIGHT * self.size or self._fails(place, question) > 0.0:
                    break
                yield place

    def centred(self, q: Reals, question: Question) -> Reals:
        """The place (n_q,) at a goal, moved to where the least gap is greatest, as far as it counts:
        linear programs about places that come nearer, in which joints change by ever less where that does
        not help."""
        best, reach, least = q, WIDEST, self._least(q)
        for _ in range(CENTRED):
            if least >= self.clear or reach < NARROWEST:
                break
            step = self._wider(best, reach)
            trial = best if step is None else self.arm.posed(best, best[self.arm.places] + step)
            own = self._least(trial)
            if own > least and self._fails(trial, question) == 0.0:
                best, least = trial, own
            else:
                reach *= 0.5
        return best

    def _wider(self, q: Reals, reach: float) -> Reals | None:
        """Changes (k,) of joints, at most so great, after which the least gap would be greatest; None
        where nothing is near."""
        near = self.arm.around.touches(q, 2.0 * self.clear)
        own = np.isin(near.pairs, self._pairs)
        rows, gaps = near.rows[own, 0][:, self.arm.columns], near.gaps[own]
        if not len(gaps):
            return None
        for pair in np.unique(near.pairs[own]).tolist():  # edges that contacts of faces leave out
            nearest = self.arm.around.near(q, pair)
            rows = np.vstack([rows, nearest.rows[0, self.arm.columns]])
            gaps = np.append(gaps, nearest.gap)
        count = rows.shape[1]
        cost = np.append(np.zeros(count), -1.0)
        bounds = [(-reach, reach)] * count + [(None, self.clear)]
        found = linprog(cost, np.hstack([-rows, np.ones((len(gaps), 1))]), gaps, bounds=bounds)
        return found.x[:count] if found.status == 0 else None

    def _fails(self, q: Reals, question: Question) -> float:
        """How much a place (n_q,) lacks of a goal."""
        return float(question.ask(self.arm.task.resting(q)).lack[0])

    def _least(self, q: Reals) -> float:
        return float(self.gaps(q).min(initial=np.inf))

    def entries(self, q: Reals) -> list[Entry]:
        """Straight ways into a place (n_q,) at the goal, the shortest first."""
        if self._is_clear(q):
            return [Entry(q[None], np.zeros(3))]
        found = [entry for way in self._directions(q) if (entry := self._out(q, way)) is not None]
        return sorted(found, key=lambda entry: len(entry.places))

    def _directions(self, q: Reals) -> list[Reals]:
        """Directions (3,) that a way out may have: away from what is near, along the axes of bodies of
        which the goal speaks, and of the world."""
        arm, names = self.arm, names_in(self.arm.task.scene.file.goal or "")
        bodies = [k for k, name in enumerate(arm.task.scene.template.bodies) if name in names]
        poses = arm.around.poses(q)
        axes = [turn_of(poses[body, 3:]).T for body in [*bodies, *arm.asked.tolist()]]
        every = np.vstack([*axes, np.eye(3)])
        near = arm.around.touches(q, self.clear)
        firsts = np.array([arm.task.scene.template.contacts[pair][0] for pair in near.pairs.tolist()])
        index = list(arm.task.scene.template.bodies)
        signs = np.array([1.0 if index.index(name) in arm.moved else -1.0 for name in firsts])
        away = (signs[:, None] * near.normals).sum(axis=0) if len(firsts) else np.zeros(3)
        length = float(np.linalg.norm(away))
        found = [away / length] if length > 0.1 else []
        for way in np.vstack([every, -every]):
            if all(float(way @ other) < SAME for other in found):
                found.append(way)
        return found

    def _out(self, q: Reals, direction: Reals) -> Entry | None:
        """The way out of a place (n_q,) at the goal along a direction (3,), turned around; None where
        bodies would overlap, or the joints cannot go so."""
        begun, places, way = self.arm.poses(q), [q], 0.0
        least = np.minimum(self.gaps(q), -self.allowed)
        while way < FARTHEST * self.size:
            way += STEP * self.size
            aims = begun.copy()
            aims[:, :3] += way * direction
            place, missed = self.arm.brought(places[-1], aims)
            gaps = self.gaps(place)
            if missed > STRAIGHT * STEP * self.size or (gaps < least).any():
                return None
            places.append(place)
            if (gaps >= self._wanted).all() and self._is_clear(place):
                return Entry(np.array(places[::-1]), -direction)
        return None

    def _is_clear(self, q: Reals) -> bool:
        """Whether the joints of a place (n_q,) are clear of all else where that is at the start."""
        return bool((self.gaps(self._with_objects(q)) >= self._wanted).all())

    def _with_objects(self, q: Reals) -> Reals:
        """The joints of a place (n_q,), with all else as at the start."""
        return self.arm.posed(self.start, q[self.arm.places])

    def way(self, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool]) -> Reals | None:
        """Places (k, n_q) on a free way of the joints from one place (n_q,) to another, with all else as
        at the first; None where no way was found."""
        arm = self.arm
        end = arm.posed(q, goal[arm.places])
        ends = np.stack([self.gaps(q), self.gaps(end)]).min(axis=0)
        least = np.minimum(self._wanted, np.where(ends > 0.0, 0.5 * ends, ends))

        def is_free(a: Reals, b: Reals) -> bool:
            return self._is_free(a, b, least)

        if is_free(q, end):
            return np.stack([q, end])
        columns = arm.places
        low = np.minimum(
            np.maximum(arm.low, np.minimum(q, end)[columns] - np.pi), np.minimum(q, end)[columns]
        )
        high = np.maximum(
            np.minimum(arm.high, np.maximum(q, end)[columns] + np.pi), np.maximum(q, end)[columns]
        )
        way = grown(
            q,
            end[None],
            columns.tolist(),
            low,
            high,
            is_free,
            seed,
            lambda asked: asked <= CHECKS and in_time(),
        )
        return None if way is None else shortened(way, is_free)

    def _is_free(self, a: Reals, b: Reals, least: Reals) -> bool:
        """Whether gaps stay above the least (p,) on the straight way between places (n_q,): proved by how
        far bodies move at most, on ever shorter parts."""
        at = np.array([0.0, 1.0])
        rows = self.room.between(a, b, at)
        gaps = self.room.look(rows)[0][:, self._own] - least
        while not (gaps < -1e-9 * self.size).any():
            moved = self.room.moved(self.room.look(rows)[1])
            together = moved[:, self._bounds].sum(axis=-1)
            unsure = (gaps[1:] + gaps[:-1] < together) & (
                together > FINEST * np.maximum(least, FINEST * self.clear)
            )
            cut = np.flatnonzero(unsure.any(axis=1))
            if not len(cut):
                return True
            middle = 0.5 * (at[cut] + at[cut + 1])
            more = self.room.between(a, b, middle)
            own = self.room.look(more)[0][:, self._own] - least
            at, rows = np.insert(at, cut + 1, middle), np.insert(rows, cut + 1, more, axis=0)
            gaps = np.insert(gaps, cut + 1, own, axis=0)
        return False
