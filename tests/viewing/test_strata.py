"""Free configuration space of the two-finger grasp against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.viewing.plane.strata import Space, Strata, strata

LOW, HIGH = (0.0, 0.0, -2.0), (2.0, 2.0, 2.0)


@pytest.fixture(scope="module")
def space() -> Space:
    return Space(rw.load("two_finger"))


@pytest.fixture(scope="module")
def found(space: Space) -> Strata:
    return strata(space, LOW, HIGH)


def deepest(x3: float, side: float) -> float:
    """How far a finger at `side` comes down on a triangle of half-base and height 1."""
    return 2.0 - max(0.0, 1.0 - abs(side - x3))


def test_facets_are_where_a_finger_touches_the_triangle(found: Strata) -> None:
    assert {*found.contact} == {0, 1}
    for facet, contact in zip(found.facets, found.contact, strict=True):
        for q in facet:
            assert q[contact] == pytest.approx(deepest(q[2], (-0.5, 0.5)[contact]), abs=1e-6)
            other = 1 - contact
            assert q[other] <= deepest(q[2], (-0.5, 0.5)[other]) + 1e-6


def test_facets_cover_both_faces_of_each_finger(found: Strata) -> None:
    """Each finger touches the part for x3 within 1 of it, in all of the free stretch of the other finger."""
    for contact, side in ((0, -0.5), (1, 0.5)):
        mine = [f for f, c in zip(found.facets, found.contact, strict=True) if c == contact]
        corners = np.concatenate(mine)
        assert corners[:, 2].min() == pytest.approx(side - 1.0, abs=1e-6)
        assert corners[:, 2].max() == pytest.approx(side + 1.0, abs=1e-6)
        seen = sum(
            0.25 * abs(f[3, 2] - f[0, 2]) * abs(f[1, 1 - contact] + f[2, 1 - contact]) * 2.0 for f in mine
        )
        x3 = np.linspace(side - 1.0, side + 1.0, 20001)
        exact = np.mean([deepest(x, -side) for x in x3]) * 2.0
        assert seen == pytest.approx(exact, rel=1e-4)


def test_goal_edge_is_that_of_the_paper(found: Strata) -> None:
    """From (1, 2, -1/2) to (2, 1, 1/2)."""
    ends = np.concatenate(found.goal)
    assert ends[:, 0] == pytest.approx(1.5 + ends[:, 2], abs=1e-6)
    assert ends[:, 1] == pytest.approx(1.5 - ends[:, 2], abs=1e-6)
    assert (ends[:, 2].min(), ends[:, 2].max()) == pytest.approx((-0.5, 0.5), abs=1e-6)


def test_runs_stay_in_free_space(space: Space) -> None:
    for ratio in (0.4, 0.7, 1.0):
        run = rw.simulate("two_finger", "quasistatic-rigid", parameters={"v2": ratio}, frames=100)
        for q in run.trajectory["position"].to_numpy():
            assert space.gaps(q).min() >= -1e-9


def test_scene_without_three_coordinates_is_refused() -> None:
    with pytest.raises(ValueError, match="9 coordinates, not three"):
        strata(Space(rw.load("blocks")), LOW, HIGH)
