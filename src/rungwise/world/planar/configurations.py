"""Where the bodies of a planar scene may be placed, how places change, and what is between the bodies there.

The geometric rung asks nothing else of a scene.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import Scene
from rungwise.simulation.core.tolerances import EXACT
from rungwise.system.planar.place import turns
from rungwise.world.contract import OBJECT
from rungwise.world.moving.configurations import StraightWays, pairs_without
from rungwise.world.planar.instance import roles_in_plane
from rungwise.world.planar.place import PlanarPlace


class PlanarConfigurations(StraightWays):
    """See `Configurations`."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float], size: float, without: str = "") -> None:
        records = scene.bind(parameters).records
        self._place = PlanarPlace(scene, parameters)
        coordinates, reach = records.coordinates, records.shapes["reach"]
        self.names, self.size, self.rounding = scene.template.bodies, size, EXACT * size
        self.bound = "bodies are joined" if scene.template.joints else ""
        self.turning = np.array(
            [turns(records.bodies[c["body"]], i) for i, c in enumerate(coordinates)], bool
        )
        self.unit = self.units = np.where(self.turning, 1.0, size)
        self.low, self.high = coordinates["lower"].copy(), coordinates["upper"].copy()
        self.numbers = self.of_numbers = np.arange(len(coordinates), dtype=np.int64)
        self.turns = np.zeros((0, 4), np.int64)
        widths = records.shapes["width"]
        self.thin = float(widths[np.isfinite(widths) & (widths > 0.0)].min(initial=size))
        self._reach = np.zeros(len(records.bodies))
        for shape, far in zip(records.shapes, np.where(np.isfinite(reach), reach, 0.0), strict=True):
            self._reach[shape["body"]] = max(self._reach[shape["body"]], far)
        self._kept, self.pairs = pairs_without(scene.template, without)
        owners, roles = coordinates["body"].tolist(), roles_in_plane(scene)
        self.objects = np.array([roles[self.names[body]] == OBJECT for body in owners], bool)
        self.bodies = [[i for i, owner in enumerate(owners) if owner == body] for body in set(owners)]

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        gaps, _, poses = self._place.geometry(rows)
        return gaps[:, self._kept], poses

    def moved(self, marks: Reals) -> Reals:
        moved = np.linalg.norm(np.diff(marks[..., :2], axis=0), axis=-1)
        return np.asarray(moved + self._reach * np.abs(_wrapped(np.diff(marks[..., 2], axis=0))))


def _wrapped(angles: Reals) -> Reals:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi
