"""Numbers by which the exact law of a support is met, from both sides."""

from __future__ import annotations

import math
from inspect import unwrap
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rungwise.simulation.core import exact_surface as law

measure, by_edges, follow = unwrap(law._measure), unwrap(law._by_edges), unwrap(law._follow)


def support(spots: list[tuple[float, float, float]], edge: tuple[float, ...] = ()) -> Any:
    """Loads at spots (x, y, share), and a line of load along an edge."""
    exact = np.zeros((1, 64))
    exact[0, law.COS] = exact[0, law.RATIO] = exact[0, law.SHARE] = exact[0, law.LINE] = 1.0
    exact[0, law.SPOT], exact[0, law.END] = 0, len(spots)
    exact[0, law.EDGE], exact[0, law.LAST] = 0, 1 if edge else 0
    return SimpleNamespace(
        exact=exact, spots=np.array(spots), edges=np.array([edge or (0.0, 0.0, 0.0, 0.0)], float)
    )


def moving(x: float, y: float, turn: float) -> Any:
    own = np.zeros(64)
    own[law.MOTION : law.MOTION + 3] = x, y, turn
    return own


@pytest.mark.long
def test_an_edge_that_is_next_to_the_centre_of_a_turn_has_its_distance() -> None:
    """The load over the speed is twice asinh(1 / away), however near the edge is; on it, it is finite."""
    for away in (0.3, 1e-6, 5e-12):
        terms = support([], (-1.0, away, 1.0, away))
        found = by_edges(terms.exact[0], terms.edges, 0.0, 0.0, 1.0)
        assert found[1] == pytest.approx(2.0 * math.asinh(1.0 / away), rel=1e-9)
    terms = support([], (-1.0, 0.0, 1.0, 0.0))
    assert np.isfinite(by_edges(terms.exact[0], terms.edges, 0.0, 0.0, 1.0)).all()


def test_a_spot_about_which_a_body_turns_has_its_speed() -> None:
    """However slow it is beside the others; if it stands, the load over the speed is finite."""
    for away in (0.3, 1e-6, 3e-12):
        terms = support([(1.0, 0.0, 0.9), (0.0, away, 0.1)])
        found = measure(0, terms, moving(0.0, 0.0, 1.0))
        assert found[1] == pytest.approx(0.9 + 0.1 / away, rel=1e-9)
    assert np.isfinite(measure(0, support([(1.0, 0.0, 0.9), (0.0, 0.0, 0.1)]), moving(0.0, 0.0, 1.0))).all()


@pytest.mark.parametrize(("far", "edges"), [(15.0, True), (60.0, False)])
def test_spots_stand_for_the_load_where_a_body_hardly_turns(far: float, edges: bool) -> None:
    """About a place at such a distance, over the support's size."""
    for turn in (1.0, 1e-5):
        terms = support([(0.0, 0.0, 1.0)], (-1.0, 0.0, 1.0, 0.0))
        alone = measure(0, support([(0.0, 0.0, 1.0)]), moving(far * turn, 0.0, turn))
        found = measure(0, terms, moving(far * turn, 0.0, turn))
        assert (abs(found[0] - alone[0]) > 0.1 * alone[0]) == edges


@pytest.mark.parametrize(("off", "met"), [(3e-9, True), (3e-8, False)])
def test_the_law_is_met_up_to_a_hundred_millionth_of_the_force(
    off: float, met: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a load at one spot that slides: the force is against the motion."""
    monkeypatch.setattr(law, "_measure", measure)
    for speed in (1.0, 1e-3):
        own = moving(speed, 0.0, 0.0)
        own[law.FORCE : law.FORCE + 2] = -1.0, off
        assert follow(0, 0.0, support([(0.0, 0.0, 1.0)]), own)[1] == met
