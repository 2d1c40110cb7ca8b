"""Steering: models of moves nearby lead objects to their goal."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.moves import Moves
from rungwise.planning.search import search
from rungwise.planning.search.derived import Derived
from rungwise.planning.search.goals import GOAL_PLACES, goals_of
from rungwise.planning.search.problem import begin, known
from rungwise.planning.search.steering import RADII, SPREAD, Steering, fitted, nearest_change
from rungwise.planning.search.tree import Tree, grow
from rungwise.planning.task.task import Task, task_of
from rungwise.world.find import world_of
from tests.planning.members import unnamed_hand
from tests.simulation.test_slopes import pushed, rolled


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


def test_a_tree_ends_where_nothing_is_proposed_for_some_rounds() -> None:
    """Not yet after two of them, and long before ten."""
    work = begin(task_of(unnamed_hand(0.35, 20)), Budget(10_000), 0, 1)
    predictor = work.predictor(Stage(rw.QUASISTATIC_COMPLIANT, 1e-2))
    asked = list[int]()

    def draw(moves: Moves, tree: Tree, *_: Any) -> tuple[Any, Any]:
        asked.append(len(tree.parent))
        still = moves.held_for(work.task.before[None], np.zeros(1))
        one = len(asked) == 3
        return np.zeros(int(one), np.int64), still[: int(one)]

    rng = np.random.default_rng(0)
    grow(work.moves, predictor, work.start, work.task.before, work.whole, 8, 40, rng, None, draw)
    assert asked[3] == 2 and len(asked) <= 3 + 10


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


class FromStart:
    """Draws what the derivative proposes at the start, beside the move that holds the inputs."""

    def __init__(self, steering: Steering) -> None:
        self._steering = steering

    def __call__(
        self, _moves: Moves, tree: Tree, _deepest: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        held = self._steering._held(tree, 0)
        rows = np.vstack([held[None], self._steering._foreseen(tree, 0, rng)])
        return np.zeros(len(rows), np.int64), rows


def asked(scene: Any, goal: str) -> Any:
    """A scene with a goal, and inputs that move by a few centimetres."""
    inputs = {name: {"range": [-0.05, 0.05]} for name in scene.template.inputs}
    task = {"inputs": inputs, "moves": [1, 8], "duration": [0.1, 0.2]}
    data = scene.file.model_dump(mode="json", exclude_unset=True)
    return rw.load(data | {"goal": goal, "task": task})


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", [rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
@pytest.mark.parametrize("name", ["plane", "space"])
def test_the_derivative_of_a_step_leads_an_object_nearer_than_inputs_that_are_held(
    name: str, rung: rw.Rung, tmp_path: Path
) -> None:
    """A finger pushes a disc by a centimetre; two plates turn a ball by half a radian."""
    plane = asked(pushed(), "hypot(disc.x - 0.01, disc.y) <= 1e-4")
    scene = plane if name == "plane" else asked(rolled(tmp_path), "abs(angle_about(ball, y) - 0.5) <= 0.01")
    task = task_of(scene)
    work, rng = begin(task, Budget(40_000), 0, 1), np.random.default_rng(0)
    draw = FromStart(Steering(task, goals_of(work), work.derived))
    predictor = work.predictor(Stage(rung, 1e-3))
    tree, _ = grow(work.moves, predictor, work.start, task.before, work.whole, 8, 1, rng, None, draw)
    assert (work.derived.made, len(tree.parent)) == (1, 2 + len(RADII))
    start, held, *others = tree.lack
    assert min(others) < 0.6 * min(start, held)


def test_why_steering_had_no_derivative_is_counted_and_said() -> None:
    task = task_of(unnamed_hand(3.0, 2))
    work = begin(task, Budget(2_000), 0, 1)
    assert work.derived.model(work.start.q[0], 0.0, task.before) is None
    assert work.derived.made == 0 and work.derived.refused.total() == 1
    assert "steered without derivatives for these reasons: support" in known(work)


@pytest.mark.long
def test_the_derivative_feels_fingers_that_nearly_touch() -> None:
    """Within a twentieth of the disc's reach, 2.5 mm."""
    for gap, felt in ((1e-3, True), (5e-3, False)):
        task = task_of(asked(pushed(gap), "hypot(disc.x - 0.01, disc.y) <= 1e-4"))
        model = begin(task, Budget(), 0, 1).derived.model(world_of(task.scene).at().q, 0.0, task.before)
        assert model is not None and bool(np.abs(model).max() > 0.01) == felt


def test_every_second_tree_steers_without_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    given = list[bool]()

    class Noting(Steering):
        def __init__(self, task: Task, goals: np.ndarray, derived: Derived | None) -> None:
            super().__init__(task, goals, derived)
            given.append(derived is not None)

    monkeypatch.setattr(search, "Steering", Noting)
    monkeypatch.setattr(search, "MANY", 1)
    task = task_of(asked(pushed(), "disc.x >= 9"))
    work = begin(task, Budget(3_000), 0, 1)
    predictor = work.predictor(Stage(rw.DYNAMIC_COMPLIANT, 1e-2))
    work.kept[GOAL_PLACES] = work.start.q
    for _ in range(4):
        search.search_once(work, predictor)
    assert given == [True, False, True, False]
