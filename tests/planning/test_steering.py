"""Steering: models of moves nearby lead objects to their goal."""

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import begin
from rungwise.planning.search.steering import SPREAD, Steering, fitted, nearest_change
from rungwise.planning.search.tree import grow
from rungwise.planning.task.task import task_of
from tests.planning.members import unnamed_hand


def test_a_model_of_linear_ends_has_their_slopes() -> None:
    rng = np.random.default_rng(0)
    slopes, middle = rng.standard_normal((5, 3)), rng.standard_normal(3)
    changes = SPREAD * rng.standard_normal((400, 5))
    at, model = fitted(changes, middle + changes @ slopes)
    assert np.abs(at - middle).max() < 0.02 * np.abs(middle).max()
    assert np.abs(model - slopes).max() < 0.05 * np.abs(slopes).max()


@pytest.mark.parametrize("radius", [0.01, 0.3])
def test_a_change_is_the_nearest_within_its_radius_and_the_bounds(radius: float) -> None:
    rng = np.random.default_rng(1)
    model, wanted, at = (
        rng.standard_normal((4, 2)),
        0.2 * rng.standard_normal(2),
        np.array([0.0, 0.5, 1.0, 0.4]),
    )
    change = nearest_change(model, wanted, at, radius)
    assert np.abs(change).max() <= radius * (1.0 + 1e-12)
    assert (at + change >= 0.0).all() and (at + change <= 1.0).all()
    others = np.clip(at + rng.uniform(-radius, radius, (4000, 4)), 0.0, 1.0) - at
    lacks = np.linalg.norm(others @ model - wanted, axis=1)
    assert np.linalg.norm(change @ model - wanted) <= lacks.min() + 1e-2 * np.linalg.norm(wanted)


def test_a_change_is_none_where_no_input_has_room() -> None:
    assert not nearest_change(np.ones((2, 1)), np.ones(1), np.array([1.0, 1.0]), 0.1).any()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("turn", "seed"), [(0.35, 0), (0.35, 1), (0.35, 2), (-0.35, 0), (-0.35, 1), (0.5, 0)]
)
def test_a_disc_is_turned_by_two_fingers_that_roll_on_it(turn: float, seed: int) -> None:
    task = task_of(unnamed_hand(turn, 20))
    work = begin(task, Budget(40_000), seed, 2)
    predictor = work.predictor(Stage(rw.QUASISTATIC_COMPLIANT, 1e-2))
    steering, rng = Steering(task, goals_of(work), work.derived), np.random.default_rng(seed)
    tree, way = grow(work.moves, predictor, work.start, task.before, work.whole, 20, 40, rng, None, steering)
    assert len(way) >= 1 and tree.lack.min() == 0.0
