"""Measures of joints: their rates against central differences, and what they read in the poses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.scene import Scene, load
from rungwise.system.planar.joints import measure
from rungwise.system.planar.place import allocate_placement, place, start

from .test_jacobian import random_body


def jointed(seed: int, kind: str) -> Scene:
    rng = np.random.default_rng(seed)
    disc = {"kind": "disc", "radius": 0.3, "at": [0.2, -0.1]}
    joint = {
        "kind": kind,
        "between": ["a", "b"],
        "at": [float(x) for x in rng.uniform(-1, 1, 2)],
        "axis": [float(x) for x in rng.uniform(-1, 1, 2)],
    }
    bodies: dict[str, Any] = {name: random_body(rng, disc) for name in "ab"}
    return load({"name": "jointed", "bodies": bodies, "joints": {"j": joint}})


class Placed:
    def __init__(self, scene: Scene) -> None:
        self.records = scene.bind().records
        n = len(self.records.coordinates)
        self.q, self.row = np.zeros(n), np.zeros(n)
        start(self.records, self.q, np.zeros(n))

    def values(self, q: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The three measures at q, and their rows."""
        r = self.records
        placed = allocate_placement(r)
        place(r, q, placed, True)
        found, rows = [], []
        for kind in r.measures:
            found.append(measure(kind, r, placed.pose, q, self.row))
            rows.append(self.row.copy())
        return np.array(found), np.array(rows)


@pytest.mark.parametrize("seed", range(20))
def test_rows_are_rates_of_measures(seed: int) -> None:
    placed = Placed(jointed(seed, "hinge"))
    q = placed.q + np.random.default_rng(seed + 100).uniform(-2.0, 2.0, len(placed.q))
    _, rows = placed.values(q)
    for i, step in enumerate(1e-6 * np.eye(len(q))):
        rate = (placed.values(q + step)[0] - placed.values(q - step)[0]) / 2e-6
        assert rows[:, i] == pytest.approx(rate, abs=1e-8)


@pytest.mark.parametrize("kind", ["weld", "hinge", "slide"])
@pytest.mark.parametrize("seed", range(5))
def test_measures_vanish_in_the_poses(seed: int, kind: str) -> None:
    placed = Placed(jointed(seed, kind))
    assert placed.values(placed.q)[0] == pytest.approx(np.zeros(3), abs=1e-14)
    assert (
        list(placed.records.measures["held"])
        == {
            "weld": [1, 1, 1],
            "hinge": [1, 1, 0],
            "slide": [0, 1, 1],
        }[kind]
    )
