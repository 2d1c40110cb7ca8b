"""Measured starts: the most probable states without overlap, with contacts that last closed."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.predict import Predictor
from rungwise.fitting.prepare import Options, prepare

from .drops import CASES, PLACE, SCENE, TURN, drops, pushes

SUPPORT = CASES["support"]
TRUE = {"mu": 0.3, "c": 0.03, "centre": 0.0}
DEVIATIONS = np.array([0.0, PLACE, PLACE, TURN])
LASTS = np.ones((1, 1), bool)


def pushed(trials: int, noise: float = 1.0) -> Predictor:
    """Runs of noisy pushes of a box."""
    motions = pushes(SUPPORT, TRUE, trials, np.random.default_rng(0), noise)
    options = Options(None, 10, None, None, 1, 0)
    one = prepare(SUPPORT.scene, rw.QUASISTATIC_RIGID, motions, tuple(TRUE), None, None, options)
    return one.predictor(one.spans(), NEVER)


def dropped() -> Predictor:
    one = prepare(
        SCENE, rw.DYNAMIC_RIGID, drops(6), ("mu", "e"), None, None, Options(None, 10, None, None, 1, 0)
    )
    return one.predictor(one.spans(), NEVER)


@pytest.mark.parametrize("gap", [-8e-4, 8e-4])
@pytest.mark.parametrize(("height", "turn"), [(0.03, 0.02), (-0.02, -0.05), (0.0, 0.0)])
def test_a_start_is_moved_to_the_most_probable_place_at_which_contact_is_closed(
    gap: float, height: float, turn: float
) -> None:
    """There the way, over squares of the deviations, is along the change of the gap."""
    parting = pushed(2)._parting
    q = np.array([[0.0, gap + 1e-4, 0.0, turn]])
    named = {"y": height}
    found = parting(q, named, LASTS).q
    place = parting._world.place(named)
    assert place.geometry(found)[0] == pytest.approx(0.0, abs=1e-6) and found[0, 0] == 0.0
    slope, way = parting._slopes(place, found)[0, 0, 1:], (found - q)[0, 1:] / DEVIATIONS[1:]
    along = slope * DEVIATIONS[1:]
    size = np.linalg.norm(along) * np.linalg.norm(way)
    assert abs(along @ way) == pytest.approx(size, rel=1e-3) and size > 0.0


def test_gaps_are_closed_only_where_contacts_last() -> None:
    parting, none = pushed(2)._parting, ~LASTS
    apart, sunk = np.array([[0.0, 1e-3, 0.0, 0.0]]), np.array([[0.0, -1e-3, 0.0, 0.0]])
    assert np.array_equal(parting(apart, {}, none).q, apart)
    assert parting(sunk, {}, none).moved[0] > 5e-4 and parting(apart, {}, LASTS).moved[0] > 5e-4


def test_contacts_last_in_pushes_and_not_in_impacts_nor_where_a_trial_begins() -> None:
    push, drop = pushed(20), dropped()
    lasts, slid = np.zeros((2, len(push.spans.trial)), bool)
    for height in np.unique(push.spans.values):
        own = push.spans.values[:, 0] == height
        q, around = push.spans.q[own], push.spans.around[own]
        lasts[own] = push._parting.lasting(q, around, {"y": height})[:, 0]
        slid[own] = push._parting.lasting(q, around + np.array([0.0, 5e-4, 0.0, 0.0]), {"y": height})[:, 0]
    begun = push.spans.first == 0.0
    assert lasts[~begun].mean() > 0.95 and not lasts[begun].any() and slid.mean() < 0.1
    assert not drop._parting.lasting(drop.spans.q, drop.spans.around, {}).any()


def test_pushes_from_noisy_starts_turn_boxes_as_far_as_from_exact_ones() -> None:
    """Noise of both signs: if overlaps alone are removed, or not to the most probable place, boxes turn by
    some percent less, or more."""
    one = pushed(20, noise=0.0)
    point = np.array([list(TRUE.values())])
    noise = np.random.default_rng(0).normal(size=(10, len(one.spans.trial), 8)) * one.spans.start
    errors = (
        one(np.repeat(point, 20, axis=0), np.concatenate([noise, -noise])).errors[:, :, -1, 2].mean(axis=0)
    )
    sides = -np.sign(one.spans.values[:, 0])
    turned = (one.spans.aims[:, -1, 3] - one.spans.q[:, 3]) * sides
    own = (one.spans.first > 0.0) & (turned > 0.0)
    assert (errors * sides)[own].mean() == pytest.approx(0.0, abs=4e-3 * turned[own].mean())
