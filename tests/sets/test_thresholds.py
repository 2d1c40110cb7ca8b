"""Numbers that sets are drawn by, from both sides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.scene.scene import LIBRARY
from rungwise.sets.cells import crossings
from rungwise.sets.doomed.cell_mapping import Images
from rungwise.sets.motions import motions
from rungwise.sets.request import box_of


def test_extreme_motions_are_a_thousand_paces_fast() -> None:
    fastest = [abs(speed) for motion in motions(rw.load("push"), rw.KINEMATIC) for speed in motion.values()]
    assert fastest and set(fastest) == {1e3}


def test_trials_end_where_a_crossing_is_known_to_a_quarter_of_a_cell() -> None:
    """Labels change at three tenths of an edge, and margins say nothing."""

    class Vertices:
        labels, margins = np.array([0, 1]), np.full(2, np.nan)

        def places(self, keys: Any) -> Reals:
            return np.zeros((len(keys), 1))

    class Tree:
        axes, spent, vertices = 1, False, Vertices()

        def size(self, _level: int) -> int:
            return 1

    tried: list[float] = []

    def oracle(places: Reals) -> tuple[Any, Reals]:
        tried.extend(places[:, 0].tolist())
        return (places[:, 0] > 0.3).astype(np.int64), np.full(len(places), np.nan)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crossings, "crossing_edges", lambda *_: np.zeros(1, np.int64))
        patch.setattr(crossings, "ends_of", lambda *_: (np.array([0]), np.array([1])))
        tree: Any = Tree()
        at = crossings.solve(tree, 0, oracle)[1]
    below, above = max(x for x in [0.0, *tried] if x <= 0.3), min(x for x in [1.0, *tried] if x > 0.3)
    assert len(tried) <= 4 and below <= at[0] <= above and 0.0025 < above - below <= 0.25


@pytest.mark.parametrize(("times", "end"), [(90.0, 2.0), (110.0, 4.0 / 110.0)])
def test_a_range_of_more_than_a_hundred_times_its_default_is_searched_up_to_twice_this(
    times: float, end: float
) -> None:
    fields = yaml.safe_load((LIBRARY / "two_finger.yaml").read_text("utf-8"))
    fields["parameters"]["v1"] |= {"default": 2.0 / times, "range": [0.0, 2.0]}
    assert box_of(rw.load(fields), ("v1",)).tolist() == [[0.0, pytest.approx(end)]]


@pytest.mark.parametrize(("beyond", "cells"), [(3e-10, 1), (3e-9, 2)])
def test_images_enter_the_next_cell_beyond_rounding_of_a_cell(beyond: float, cells: int) -> None:
    """Whatever the size of cells, and on either side."""
    for unit in (0.01, 30.0):
        for sign in (1.0, -1.0):
            about = np.full((8, 1), unit * sign * (2.0 + beyond))
            own: Any = SimpleNamespace(
                _box=np.array([[0.0, 8.0 * unit]]), _shape=(8,), _unit=np.array([unit]),
                _travel=np.array([[-np.inf, np.inf]]), _about=lambda _, about=about, **__: about,
            )  # fmt: skip
            first, last, _ = Images._image(own, np.zeros(0))
            assert (last - first)[3] + 1 == cells


def test_runs_of_sets_are_as_exact_as_their_boundaries() -> None:
    """A body on a spring of frequency one, which goes as far as it is fast: with a sixth of the steps, the
    boundary is off by more than it is located."""
    body = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0}
    moves = {"motion": {"kind": "slide", "axis": [1, 0], "name": "x"}, "coordinates": {"x": {"speed": "v"}}}
    fields = {
        "name": "spring", "parameters": {"v": {"default": 1.0}}, "bodies": {"one": body | moves},
        "potentials": [{"terms": {"one.x": 1.0}, "stiffness": 1.0, "on": ["one.x"]}],
        "goal": "one.x >= 1", "duration": 3.0,
    }  # fmt: skip
    scene = rw.load(fields)
    found = rw.feasible_set(scene, "dynamic-rigid", ["v"], box={"v": (0.5, 1.5)}, tol=0.004, threads=1)
    assert found.volumes()["feasible"] == pytest.approx(0.5, abs=0.002)
    steps = len(rw.simulate(scene, "dynamic-rigid", tol=found.request["accuracy"]).trajectory.time)
    assert steps < 200
