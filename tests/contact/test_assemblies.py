"""Large problems of bodies in contact that nobody solved before: piles, towers, walls, arches, balls."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

import rungwise as rw
from rungwise.contact.judge.farkas import check
from rungwise.contact.judge.residuals import judge
from rungwise.contact.measure import natural
from rungwise.contact.prepare.islands import islands
from rungwise.contact.prepare.system import scaled

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import assemblies

HARD: dict[str, Callable[[], rw.Problem]] = {
    "pyramid of 8 levels, pushed": lambda: assemblies.pile(36, 10.0, 0.9),
    "pyramid of 10 levels, pushed hard": lambda: assemblies.pile(55, 50.0, 1.2),
    "tower of planks, pushed": lambda: assemblies.tower(12, 3, 20.0, 0.6),
    "tower of planks, falling": lambda: assemblies.tower(8, 3, mu=0.4, speed=5.0),
    "stack, a thousand times as heavy above": lambda: assemblies.stack(10, 3.0, ratio=1e3),
    "stack, much heavier above": lambda: assemblies.stack(10, 3.0, ratio=1e5),
    "stack of 30, much heavier above": lambda: assemblies.stack(30, 3.0, ratio=1e5),
    "three boxes, the uppermost beyond all measure": lambda: assemblies.stack(3, 3.0, ratio=1e8),
    "cubes that touch on all sides": lambda: assemblies.wall(12, 12, 2.0, 0.7),
    "balls, many": lambda: assemblies.balls(200, 5, 0.1, 1.0, 0.02),
    "pyramid of 19 levels, pushed": lambda: assemblies.pile(190, 3.0),
    "wall of 174 bricks, pushed": lambda: assemblies.wall(15, 12, 3.0),
    "arch, pushed": lambda: assemblies.arch(45, 10.0, 1.0),
    "rough balls, many, falling": lambda: assemblies.balls(200, 5, 0.9, 1.0, 0.05),
    "balls, falling": lambda: assemblies.balls(30, 3, 1.0, 3.0, 0.05),
    "pyramid of bodies that spin": lambda: assemblies.turning(assemblies.pile(15, 10.0)),
    "tower of planks that spin": lambda: assemblies.turning(assemblies.tower(5, 3, 2.0)),
}
LARGE = (
    "cubes that touch on all sides", "balls, many", "pyramid of 19 levels, pushed",
    "wall of 174 bricks, pushed", "rough balls, many, falling",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name in LARGE else name for name in HARD]
)
def test_hard_assemblies_are_solved(name: str) -> None:
    problem = HARD[name]()
    found = rw.solve(problem)
    assert found.status == "solved", [(a.solver, a.iterations, a.residual) for a in found.attempts]
    size = np.abs(problem.b).max() + np.abs(problem.A).max() * np.abs(found.x).max()
    assert found.residuals.penetration <= 1e-8 * size and found.residuals.cone <= 1e-8 * size


def leaning(boxes: int, push: float, ratio: float) -> tuple[rw.Problem, float]:
    """A stack, and how far from the middle of a box the resultant of the loads above it comes at most."""
    problem = assemblies.stack(boxes, push, 0.5, ratio)
    load, far = -problem.b[problem.rows :].reshape(boxes, 6)[:, :3], 0.0
    for i in range(boxes):
        lever = np.arange(boxes - i)[:, None] + 0.5
        far = max(far, float(np.abs((load[i:, :2] * lever).sum(0) / load[i:, 2].sum()).max()))
    return problem, far


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_stacks_that_stand_below_far_heavier_boxes_are_at_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes, ratio = int(rng.integers(20, 41)), 10.0 ** rng.uniform(4, 6)
    push = rng.uniform(0.1, 0.4) / leaning(boxes, 1.0, ratio)[1]
    found = rw.solve(leaning(boxes, push, ratio)[0])
    assert found.status == "solved" and np.abs(found.v).max() < 1e-9


def test_islands_are_found_and_solved_as_one_problem() -> None:
    """Two piles side by side, of forces a thousandfold apart, their contacts shuffled."""
    one, two = assemblies.turning(assemblies.pile(3, 3.0)), assemblies.turning(assemblies.pile(6, 10.0))
    sizes = len(one.mu), len(two.mu)
    order = np.random.default_rng(0).permutation(sum(sizes))
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    W = np.zeros((3 * sum(sizes), 3 * sum(sizes)))
    W[: one.rows, : one.rows], W[one.rows :, one.rows :] = one.A.toarray(), two.A.toarray()
    q, mu = np.concatenate([one.b, 1e-3 * two.b]), np.concatenate([one.mu, two.mu])
    both = rw.Problem.local(W[np.ix_(rows, rows)], q[rows], mu[order])
    apart = islands(scaled(both))
    assert apart is not None and sorted(np.diff(apart.first)) == sorted([one.rows, two.rows])
    for i in range(2):
        assert np.linalg.norm(apart.part(i).b) == pytest.approx(1.0)
    x = np.random.default_rng(1).normal(size=both.rows)
    together = np.hypot(
        *[
            apart.size[i] * natural(apart.part(i), apart.inwards(x)[apart.first[i] : apart.first[i + 1]])
            for i in range(2)
        ]
    )
    assert natural(scaled(both), x) == pytest.approx(together)
    np.testing.assert_allclose(apart.outwards(apart.inwards(x)), x)
    found = rw.solve(both)
    assert found.status == "solved"
    r = np.empty(both.rows)
    r[rows] = found.r
    for problem, own in ((one, r[: one.rows]), (two, 1e3 * r[one.rows :])):
        assert judge(problem, scaled(problem), own).worst <= 1e-6


@pytest.mark.long
def test_gaps_of_rounding_size_demand_nothing() -> None:
    """Balls that touch but for the last digit, falling: their velocities are eliminated all the same."""
    exact = assemblies.balls(12, 2, 0.5, 3.0)
    b = exact.b.copy()
    b[: exact.rows : 3] = 2e-14 * (np.arange(len(exact.mu)) % 3)
    near = rw.Problem(exact.A, b, exact.mu, 3, exact.lower, exact.upper, exact.velocities)
    assert scaled(near).size == exact.rows
    found = rw.solve(near)
    assert found.status == "solved"
    np.testing.assert_allclose(found.v, rw.solve(exact).v, atol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("without", [1, 30])
def test_an_island_without_solution_leaves_none_to_the_whole(without: int) -> None:
    """Mode by mode the first three have none; all of them are too many to divide together."""
    M, q = np.array([[-1.0, 0.0, 1.0], [1.0, -2.0, 2.0], [2.0, 3.0, 2.0]]), np.array([-2.0, -1.0, 1.0])
    others = 31 - without
    whole = block_diag(*[M] * without, *[np.eye(3) + 1.0] * others)
    b = np.concatenate([np.tile(q, without), np.full(3 * others, -1e-3)])
    order = np.random.default_rng(2).permutation(len(b))
    problem = rw.Problem.lcp(whole[np.ix_(order, order)], b[order])
    found = rw.solve(problem)
    assert found.status == "jammed" and found.certificate is not None
    assert check(scaled(problem), found.certificate)
    assert rw.solve(rw.Problem.lcp(whole[3 * without :, 3 * without :], b[3 * without :])).status == "solved"
