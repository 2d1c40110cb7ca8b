"""A planar scene placed at some q, with its contacts, as the tests of this folder use it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.scene import load
from rungwise.system.planar.contact_manifold import Found, allocate_manifolds, manifold
from rungwise.system.planar.corners import allocate_course
from rungwise.system.planar.find_contacts import find_contacts
from rungwise.system.planar.place import allocate_placement, place, start
from rungwise.system.planar.seams import allocate_seams, find_seams

Array = NDArray[np.float64]


class Planar:
    """Bodies by name; `q` begins at the scene's start."""

    def __init__(self, bodies: dict[str, Any], **fields: Any) -> None:
        between = {"contacts": [{"between": ["*", "*"]}]}
        scene = load({"name": "test", "bodies": bodies, **between, **fields})
        self.records = scene.bind().records
        n = len(self.records.coordinates)
        self.q, self.v = np.zeros(n), np.zeros(n)
        start(self.records, self.q, self.v)
        self.placed, self.manifolds = allocate_placement(self.records), allocate_manifolds(self.records)
        self.pose, self.outline = self.placed.pose, self.placed.outline
        self.points, self.features = self.manifolds.points, self.manifolds.features
        self.deformation, self.modes = self.manifolds.deformation, self.manifolds.modes
        self.gaps = self.manifolds.gaps
        self.place(self.q)
        self.seams, self.course = allocate_seams(self.records), allocate_course(self.records)
        find_seams(self.records, self.placed, self.seams)

    def place(self, q: Array) -> None:
        place(self.records, q, self.placed, True)

    def manifold(self, q: Array, pair: int = 0) -> tuple[Array, list[int]]:
        """Points (rows: gap, normal, place) and features of a pair of shapes at q."""
        self.place(q)
        points, features = np.zeros((2, 5)), np.zeros(2, np.int64)
        a, b = (int(self.records.pairs[pair][field]) for field in ("shape_a", "shape_b"))
        count = manifold(
            self.records.shapes[a],
            self.records.shapes[b],
            self.outline,
            self.seams.alone,
            Found(points, features),
        )
        return points[:count], [int(feature) for feature in features[:count]]

    def look(self, q: Array, margin: float) -> float:
        """Update all slots at q; returns the least gap."""
        self.place(q)
        return find_contacts(self.records, self.placed, q, margin, self.manifolds, self.seams, self.course)


@pytest.fixture
def planar() -> type[Planar]:
    """The class itself: its scenes are those of each test."""
    return Planar
