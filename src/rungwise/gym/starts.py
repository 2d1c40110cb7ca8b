"""Starts of episodes: instances of the scene's task drawn, with what is uncertain about them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rungwise.gym.copies import Copies, Standing
from rungwise.gym.settings import TABLES, GymError, Settings
from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.task.task import DRAWS, drawn
from rungwise.world.carriers import TaskError


class Starts:
    """Draws starts of episodes from a generator."""

    def __init__(self, settings: Settings, copies: Copies) -> None:
        self._settings, self._copies = settings, copies
        task = settings.scene.file.task
        tables = {name: getattr(task, name) if task and name in settings.vary else {} for name in TABLES}
        self._instances, self._uncertain = bool(tables["instances"]), bool(tables["uncertain"])
        self.seen = tuple(tables["instances"])
        """Parameters of the instance, which a policy may see."""
        self._where = None if task is None or not self._instances else task.where

    def draw(self, rng: np.random.Generator, fixed: Mapping[str, float]) -> tuple[dict[str, float], Standing]:
        """The instance's parameters, and the start with what is uncertain about it; parameters in `fixed`
        keep their values. Raises TaskError where too few draws can start."""
        scene, given = self._settings.scene, self._settings.parameters | dict(fixed)
        for _ in range(DRAWS):
            instance = drawn(scene, "instances", given, rng) if self._instances else given
            if instance is None:
                continue
            instance = instance | dict(fixed)
            if self._instances and not self._fits(instance):
                continue
            values = drawn(scene, "uncertain", instance, rng) if self._uncertain else instance
            if values is None:
                continue
            values = values | dict(fixed)
            start = self._copies.begin(np.array([list(values.values())]))
            if start.outcome[0] == Code.RUNNING:
                return instance, start
            if not (self._instances or self._uncertain):
                raise GymError(f"parameters: the scene's start is {Code(start.outcome[0]).name.lower()}")
        raise TaskError(f"task: {DRAWS} draws gave no instance that can start")

    def _fits(self, values: dict[str, float]) -> bool:
        """Whether an instance can start, and the task's condition holds there."""
        start = self._copies.begin(np.array([list(values.values())]))
        if start.outcome[0] != Code.RUNNING:
            return False
        return self._where is None or bool(self._copies.holds(self._where, start)[0])

    def instance_of(self, values: Mapping[str, float]) -> Reals:
        """The values (i,) of the instance's parameters."""
        return np.array([values[name] for name in self.seen])
