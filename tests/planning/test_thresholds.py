"""Numbers that plans are judged by, from both sides."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rungwise.planning.modes.forces.cones import SLIDE, balances, memory_for, nonnegative
from rungwise.planning.modes.forces.mode_motions import projected, turn
from rungwise.planning.search.problem import Work
from rungwise.planning.squeeze import squeeze_plan
from rungwise.planning.task.task import Task, _is_slow
from rungwise.world.planar.evidence import _giving


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


def test_angles_are_the_same_up_to_a_billionth() -> None:
    for off, period in ((1e-10, math.pi / 2.0), (2e-8, math.pi)):
        square = [[0.0, 0.0], [1.0, 0.0], [1.0 + off, 1.0], [0.0, 1.0]]
        assert squeeze_plan(square).function.period == pytest.approx(period)


def test_a_plan_that_lacks_a_billionth_lacks_nothing() -> None:
    for lack, was_there in ((1e-10, True), (1e-8, False)):
        work = stub(was_there=False, nearest=math.inf, nearest_at=None)
        Work.came_near(work, lack, np.zeros(1))
        assert work.was_there == was_there and (work.nearest == lack) == (not was_there)


def test_inputs_keep_their_bounds_up_to_a_billionth_of_them() -> None:
    task = stub(low=np.array([-1.0]), high=np.array([1.0]))
    assert Task.allows(task, np.array([[1.0 + 2e-10], [1.0 + 2e-8]])).tolist() == [True, False]


def test_pushes_are_slow_where_objects_coast_by_less_than_a_hundredth_of_their_size() -> None:
    for speed, is_slow in ((0.06, True), (0.3, False)):
        carriers: Any = (stub(by_place=False, speed=speed),)
        assert _is_slow(np.ones(1), carriers, 1.0) == is_slow


def test_coordinates_that_hardly_move_have_no_part_in_a_certificate() -> None:
    for share, names in ((1e-7, ["a"]), (1e-5, ["a", "b"])):
        run = stub(
            certificate=stub(vectors=[np.array([1.0, share])]), problem=stub(c=np.zeros(2)),
            workspace=stub(state=stub(free=np.arange(2))),
            scene=stub(template=stub(coordinates=("a", "b"))),
        )  # fmt: skip
        assert _giving(run) == names


def test_objects_rest_below_a_hundredth_of_the_robots_speed_and_are_waited_for_ten_pushes() -> None:
    carrier: Any = stub(speed=0.5, push=(0.1, 2.0))
    task = stub(_speeds=[0.5], carriers=(carrier,), size=1.0)
    still: Any = Task.still
    patience: Any = Task.patience
    assert still.fget(task) == pytest.approx(0.005) and patience.fget(task) == pytest.approx(40.0)


MEMORY = memory_for(2, 1, 2, 3, 3)


def balanced(off: float) -> bool:
    """Whether an edge that pushes upwards balances a weight that is off by so much."""
    MEMORY.edges[0] = (0.0, 1.0, 0.0)
    return bool(balances(1, 0, np.array([off, -1.0, 0.0]), 1.0, np.zeros(2), MEMORY))


def left_by(columns: list[list[float]], wanted: list[float]) -> tuple[float, float]:
    """How far two columns, or one, stay from what is wanted, and the share of the first."""
    m = len(columns)
    MEMORY.columns[:m, :2], MEMORY.wanted[:2] = columns, wanted
    return float(nonnegative(m, 2, MEMORY)), float(MEMORY.share[0])


def slides_on(tilt: float) -> bool:
    """Whether two contacts, of which one is tilted by so much, keep an object from sliding."""
    MEMORY.normals[0], MEMORY.normals[1], motion = (1.0, 0.0, 0.0), (1.0, tilt, 0.0), np.empty(3)
    projected(np.array([SLIDE, SLIDE]), np.array([0.0, 1.0, 0.0]), motion, MEMORY)
    return bool(abs(motion[1]) > 0.5)


def moves_aside(tilt: float) -> bool:
    """Whether a support with two rows, one tilted by so much, takes the tilt for a way to move."""
    turn(np.array([[1.0, 0.0, 0.0], [1.0, tilt, 0.0]]), MEMORY)
    return bool(MEMORY.turned[1, 1] > 1.0)


@pytest.mark.parametrize(
    ("holds", "within", "beyond"),
    [
        (balanced, 2e-7, 2e-5),
        (lambda e: left_by([[-1.0, 0.0], [1.0, e]], [0.0, 1.0])[0] > 0.5, 1e-8, 1e-6),
        (lambda e: left_by([[1.0, 0.0]], [e, 1.0])[1] == 0.0, 1e-12, 1e-10),
        (slides_on, 1e-8, 1e-6),
        (lambda e: not moves_aside(e), 1e-7, 1e-5),
    ],
    ids=["balance", "edges that are one", "edges that do not help", "contacts that are one", "supports"],
)
def test_modes_turn_between(holds: Callable[[float], bool], within: float, beyond: float) -> None:
    assert holds(within) and not holds(beyond)
