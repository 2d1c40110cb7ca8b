"""Squeezes orient parts as Goldberg's theory says, and the scene does as the squeeze function says."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely

import rungwise as rw

MOVING = [rung.name for rung in rw.LADDER if rung.moves]
PENTAGON = [[0.0, 0.0], [5.0, 0.0], [6.0, 2.0], [3.0, 4.0], [0.0, 3.0]]


def rectangle(width: float, height: float) -> list[list[float]]:
    return [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]


def outline(seed: int) -> np.ndarray:
    """A random convex polygon."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(3, 12)), 2))
    return np.array(shapely.MultiPoint(points).convex_hull.exterior.coords)[:-1]


@pytest.mark.parametrize("ratio", [0.05, 0.5, 2 / 3, 0.99])
def test_two_squeezes_orient_a_rectangle(ratio: float) -> None:
    """Its long sides end at the jaws; half a turn is its symmetry. Diagonals are the greatest diameters."""
    plan = rw.squeeze_plan(rectangle(1.0, ratio))
    assert len(plan.angles) == 2 and plan.period == pytest.approx(math.pi)
    assert math.cos(plan.final - plan.angles[-1]) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.abs(np.tan(plan.function.maxima)), ratio)
    np.testing.assert_allclose(plan.function.diameter(plan.function.maxima), math.hypot(1.0, ratio))
    starts = np.linspace(-4.0, 4.0, 999)
    assert np.max(plan.off(plan.predicted(starts))) < 1e-9


@pytest.mark.parametrize("sides", [3, 4, 5, 8])
def test_one_squeeze_orients_a_regular_polygon(sides: int) -> None:
    """Up to the period 2 pi / (r (1 + r mod 2)) of an r-fold symmetry."""
    turns = 0.3 + 2.0 * math.pi * np.arange(sides) / sides
    plan = rw.squeeze_plan(np.column_stack([np.cos(turns), np.sin(turns)]))
    assert plan.angles == (0.0,)
    assert plan.period == pytest.approx(2.0 * math.pi / (sides * (1 + sides % 2)))


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(40))
def test_least_diameters_are_where_squeezes_end(seed: int) -> None:
    function = rw.squeeze_plan(outline(seed)).function
    dense = np.linspace(0.0, math.pi, 20001)
    width = function.diameter(dense)
    lower = (width[1:-1] < width[:-2]) & (width[1:-1] < width[2:])
    least = dense[1:-1][lower]
    for orientation in least:
        # One at which the width is 1e-9 of it deeper than a neighbour on the grid may be none at all.
        assert np.min(np.abs(np.sin(function.minima - orientation))) < 3e-4
    deeper = np.minimum(function.diameter(function.minima - 1e-5), function.diameter(function.minima + 1e-5))
    assert np.all(function.diameter(function.minima) < deeper)
    np.testing.assert_allclose(function.squeezed(function.minima + 1e-7), function.minima, atol=1e-12)
    ends = function.squeezed(dense)
    assert np.all(function.diameter(ends) <= width + 1e-12)
    assert np.max(np.min(np.abs(np.sin(ends[:, None] - function.minima)), axis=1)) < 1e-9


@pytest.mark.few(8)
@pytest.mark.parametrize("seed", range(40))
def test_a_plan_brings_every_start_to_one_end(seed: int) -> None:
    plan = rw.squeeze_plan(outline(seed))
    assert plan.period == pytest.approx(math.pi)
    starts = np.random.default_rng(seed).uniform(-10.0, 10.0, 200)
    assert np.max(plan.off(plan.predicted(starts))) < 1e-9
    assert plan.steps[0].width == pytest.approx(math.pi) and plan.steps[-1].low == plan.steps[-1].high
    for step, after in pairwise(plan.steps):
        assert step.high - step.low < after.width < step.width


def test_jaws_touch_the_hull() -> None:
    dented = [[0.0, 0.0], [5.0, 0.0], [6.0, 2.0], [3.0, 4.0], [1.0, 1.0], [0.0, 3.0]]
    assert rw.squeeze_plan(dented).angles == pytest.approx(rw.squeeze_plan(PENTAGON).angles)


def test_a_right_triangle_may_rest_where_a_corner_is_above_the_end_of_an_edge() -> None:
    plan = rw.squeeze_plan([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    assert np.max(plan.off(plan.predicted(np.linspace(-3.0, 3.0, 777)))) < 1e-9


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([[0, 0], [1, 0]], "must be at least 3 pairs; their shape is (2, 2)"),
        ([0, 1, 2], "must be at least 3 pairs; their shape is (3,)"),
        ([[0, 0], [1, 0], ["a", 1]], "must be pairs of numbers"),
        ([[0, 0], [1, 0], [math.nan, 1]], "must be finite"),
        ([[0, 0], [1, 1], [2, 2]], "lie on a line"),
        ([[1, 1], [1, 1], [1, 1]], "lie on a line"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "the outline crosses or touches itself"),
    ],
)
def test_wrong_parts_are_refused(vertices: object, message: str) -> None:
    with pytest.raises(rw.InputError) as refused:
        rw.squeeze_plan(vertices)  # type: ignore[arg-type]
    assert str(refused.value) == f"squeeze_plan.vertices: {message}"


def test_wrong_friction_is_refused() -> None:
    plan = rw.squeeze_plan(PENTAGON)
    with pytest.raises(
        rw.InputError, match=r"^squeezed\.friction: -0\.1 is not a finite number of at least 0$"
    ):
        plan.predicted([0.0], friction=-0.1)
    with pytest.raises(rw.InputError, match=r"^squeezed\.orientation: must be finite$"):
        plan.predicted([math.inf])


def test_a_plan_holds_up_to_the_friction_that_fills_its_room() -> None:
    """Stuck at 161.57 degrees, the pentagon is 1.87 degrees within the room of the second squeeze."""
    plan = rw.squeeze_plan(PENTAGON)
    step, after = plan.steps
    room = (after.width - (step.high - step.low)) / 2.0 - (step.low - step.start)
    assert math.degrees(room) == pytest.approx(1.8657, abs=1e-4)
    starts = np.linspace(step.start - 0.1, step.start + 0.1, 20001)
    for part, holds in ((0.98, True), (1.02, False)):
        lost = plan.off(plan.predicted(starts, friction=math.tan(part * room / 2.0))) > 1e-6
        assert bool(np.any(lost)) != holds


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING)
def test_a_squeezed_rectangle_turns_to_the_least_width_on_its_side(model: str) -> None:
    """From beyond the diagonal it ends on its long sides, else on its short ones."""
    function = rw.squeeze_plan(rectangle(0.06, 0.04)).function
    for angle in (-1.2, -0.7, -0.5, 0.1, 0.55, 0.65, 1.4):
        end = float(function.squeezed(angle))
        over = {"angle": angle + 0.4, "turn": 0.4, "goal_angle": end + 0.4}
        run = rw.simulate("squeeze", model, parameters=over)
        assert str(run.outcome) == "goal", (angle, run.reason)
        assert run.final["part"]["angle"] - 0.4 == pytest.approx(end, abs=1.1e-3)


def test_two_squeezes_orient_the_rectangle_of_the_scene() -> None:
    plan, scene = rw.squeeze_plan(rectangle(0.06, 0.04)), rw.load("squeeze")
    angles = np.random.default_rng(3).uniform(-math.pi, math.pi, 100)
    for turn in plan.angles:
        given = {"turn": turn, "angle": angles, "aligned": 0.0}
        angles = rw.rollout(scene, "quasistatic-rigid", parameters=given).final[:, 4]
    assert np.max(plan.off(angles)) < 1e-6


def test_friction_holds_a_part_where_the_theory_says() -> None:
    """The line between its corners at the jaws is within both friction cones, or it turns to an edge."""
    scene, function = rw.load("squeeze"), rw.squeeze_plan(rectangle(0.06, 0.04)).function
    rng = np.random.default_rng(4)
    angles, mu = rng.uniform(-math.pi, math.pi, 100), rng.uniform(0.0, 0.5, 100)
    given = {"angle": angles, "mu": mu, "aligned": 0.0}
    ends = rw.rollout(scene, "quasistatic-rigid", parameters=given).final[:, 4]
    foretold = [function.squeezed(a, friction=m) for a, m in zip(angles, mu.tolist(), strict=True)]
    np.testing.assert_allclose(ends, foretold, atol=1e-4)
    assert 20 < np.sum(np.abs(ends - angles) < 1e-3) < 80


def test_jaws_open_again_and_leave_the_part() -> None:
    closed = rw.Segment({"close": 0.04}, 2.0)
    run = rw.simulate(
        "squeeze",
        "quasistatic-rigid",
        parameters={"goal_angle": 0.0},
        inputs=[closed, rw.Segment({"close": 0.0}, 1.0, ramp=True)],
    )
    assert run.final["left"]["s"] == pytest.approx(0.0, abs=1e-4)
    assert run.final["part"]["angle"] == pytest.approx(math.pi / 2.0, abs=1e-6)


@pytest.mark.long
def test_parts_of_many_corners_are_oriented() -> None:
    """Outlines near a circle have squeezes of narrow intervals, some hundred one after the other."""
    rng = np.random.default_rng(6)
    angle = (np.arange(401) + rng.uniform(-0.2, 0.2, 401)) * 2.0 * math.pi / 401
    plan = rw.squeeze_plan(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert len(plan.angles) > 100
    assert np.max(plan.off(plan.predicted(rng.uniform(-math.pi, math.pi, 1000)))) < 1e-6
