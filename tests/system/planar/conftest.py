"""A planar scene placed at some q, with its contacts, as the tests of this folder use it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.scene import load
from rungwise.system.planar.corners import allocate_course
from rungwise.system.planar.gap import find_contacts
from rungwise.system.planar.manifold import ABSENT, manifold
from rungwise.system.planar.place import place, start
from rungwise.system.planar.seams import allocate_seams, find_seams

Array = NDArray[np.float64]


class Planar:
    """Bodies by name; `q` begins at the scene's start."""

    def __init__(self, bodies: dict[str, Any], **fields: Any) -> None:
        between = {"contacts": [{"between": ["*", "*"]}]}
        scene = load({"name": "test", "bodies": bodies, **between, **fields})
        self.records = scene.bind().records
        n, pairs = len(self.records.coordinates), len(self.records.pairs)
        self.q, self.v = np.zeros(n), np.zeros(n)
        start(self.records.bodies, self.records.coordinates, self.q, self.v)
        self.pose = np.zeros((len(self.records.bodies), 4))
        self.outline = np.zeros((len(self.records.vertices), 4))
        self.points = np.zeros((2 * pairs, 5))
        self.features = np.full(2 * pairs, ABSENT, np.int64)
        self.deformation = np.zeros((2 * pairs, 2))
        self.modes = np.zeros(2 * pairs, np.int64)
        self.gaps = np.zeros(len(self.records.contacts))
        self.place(self.q)
        self.seams, self.course = allocate_seams(self.records), allocate_course(self.records)
        find_seams(self.records.shapes, self.pose, self.outline, self.seams)

    def place(self, q: Array) -> None:
        records = self.records
        place(records.bodies, records.shapes, records.vertices, q, self.pose, self.outline, True)

    def manifold(self, q: Array, pair: int = 0) -> tuple[Array, list[int]]:
        """Points (rows: gap, normal, place) and features of a pair of shapes at q."""
        self.place(q)
        points, features = np.zeros((2, 5)), np.zeros(2, np.int64)
        a, b = (int(self.records.pairs[pair][field]) for field in ("shape_a", "shape_b"))
        count = manifold(self.records.shapes[a], self.records.shapes[b], self.outline, points, features)
        return points[:count], [int(feature) for feature in features[:count]]

    def look(self, q: Array, margin: float) -> float:
        """Update all slots at q; returns the least gap."""
        self.place(q)
        records = self.records
        return find_contacts(
            records.bodies, records.shapes, records.contacts, records.pairs, self.pose, self.outline, q,
            margin, self.points, self.features, self.deformation, self.modes, self.gaps,
            np.zeros(2, np.int64), self.seams, self.course,
        )  # fmt: skip


@pytest.fixture
def planar() -> type[Planar]:
    """The class itself: its scenes are those of each test."""
    return Planar
