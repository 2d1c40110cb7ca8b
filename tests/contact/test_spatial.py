"""Steps' problems in space: the contact solver on random scenes, known answers, and scenes without an
answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.residual import residual_of_rows
from rungwise.contact.solver.settings import NEWTON_STEPS
from rungwise.contact.solver.step import residual_of_groups, solve_groups
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.problem import NO_SURFACES, ContactProblem, Sizes, Unknowns, allocate_problem
from rungwise.contact.step.spans import Widths
from rungwise.contact.step.status import GUESS, NO_SOLUTION, PROXIMAL, SOLVED, TOLERANCE
from tests.contact.kept import kept

Array = NDArray[np.float64]
G, H = 9.81, 1e-3
EVERYWHERE = np.empty((0, 4), np.int64)
"""Entries may be in any column."""
CORNERS = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])


Where: TypeAlias = tuple[NDArray[np.int64], NDArray[np.int64]]


def measured(
    p: ContactProblem, sizes: Sizes, found: Unknowns, where: Where = (EVERYWHERE, EVERYWHERE)
) -> float:
    """The residual by groups."""
    return float(residual_of_groups(p, sizes, found, CONE, NO_SURFACES, *where))


class Answer(NamedTuple):
    status: int
    residual: float
    stage: int
    v: Array
    force: Array
    tau: Array
    mode: NDArray[np.int64]


def solve(
    p: ContactProblem,
    force: Array | None = None,
    tau: Array | None = None,
    v: Array | None = None,
    where: Where = (EVERYWHERE, EVERYWHERE),
) -> Answer:
    """The answer, whose residual is the judge's; without a solution it is zero. From these forces and
    velocities."""
    n, contacts, limited = len(p.c), len(p.mu), len(p.F)
    force = np.zeros(len(p.w)) if force is None else force.copy()
    tau = np.zeros(limited) if tau is None else tau.copy()
    mode, v = np.full(contacts + limited, -7, np.int64), np.zeros(n) if v is None else v.copy()
    sizes, unknowns = Sizes(n, contacts, limited), Unknowns(mode, v, force, tau)
    status, found, stage, _ = solve_groups(
        p, sizes, unknowns, CONE, NO_SURFACES, *where, np.zeros(1, np.int64)
    )
    if status == SOLVED:
        assert (
            found == pytest.approx(measured(p, sizes, unknowns, where), rel=1e-6, abs=1e-14)
            and found <= TOLERANCE
        )
    else:
        assert status == NO_SOLUTION and not (v.any() or force.any() or tau.any())
    return Answer(status, found, stage, v, force, tau, mode)


def spd(rng: np.random.Generator, n: int) -> Array:
    a = rng.normal(size=(n, n))
    return np.asarray(a @ a.T + 0.1 * n * np.eye(n))


def draw(
    rng: np.random.Generator, d: int, compliant: bool = False, light: bool = False, bodies: int = 5
) -> ContactProblem:
    """Free bodies and an arm in several islands: redundant contacts, one-sided rows, joints, dry friction and
    servos, that rest or do not touch yet, so that there is an answer."""
    sizes = [6] * bodies + [int(rng.integers(3, 10))]
    first = np.concatenate([[0], np.cumsum(sizes)])
    n, contacts, limited = int(first[-1]), int(rng.integers(1, 5 * bodies)), int(rng.integers(0, 9))
    p = allocate_problem(n, contacts, limited, d)
    for b, size in enumerate(sizes):
        own = slice(first[b], first[b + 1])
        p.H[own, own] = spd(rng, size) * 10.0 ** rng.uniform(-2, 2) * (1e-7 if light else 1.0)
    p.c[:] = rng.normal(size=n)
    p.quantum[0] = 1e-13
    for k in range(contacts):
        rows = slice(d * k, d * k + d)
        for b in rng.choice(bodies + 1, int(rng.integers(1, 3)), replace=False):
            p.W[rows, first[b] : first[b + 1]] = rng.normal(size=(d, sizes[b]))
        p.mu[k] = rng.choice([0.0, 0.2, 0.5, 0.8])
        p.w[d * k] = rng.choice([0.0, 0.0, 0.1]) * rng.random()
        if k and rng.random() < 0.5:  # a patch: rows that are combinations of others
            p.W[rows] = p.W[d * (k - 1) : d * k] + (rng.random() < 0.5) * 1e-3 * p.W[rows]
            p.mu[k] = p.mu[k - 1]
        if p.mu[k] == 0.0:
            p.W[d * k + 1 : d * k + d] = 0.0
        if compliant:
            p.R[k] = spd(rng, d) * 10.0 ** rng.uniform(-4, -1)
    for r in range(limited):
        b = int(rng.integers(0, bodies + 1))
        p.S[r, first[b] : first[b + 1]] = rng.normal(size=sizes[b])
        p.F[r] = rng.choice([0.0, 0.3, 3.0, np.inf])
        if rng.random() < 0.5:
            p.R_s[r], p.w_s[r] = 10.0 ** rng.uniform(-3, 0), rng.normal()
    return p


def boxes(count: int, pull: Array, mu: float, yields: float = 0.0) -> ContactProblem:
    """Unit boxes of mass 1, one on the other on the ground, at rest, with four corners a contact."""
    p = allocate_problem(6 * count, 4 * count, 0, 3)
    p.quantum[0], p.mu[:] = 1e-12, mu
    for b in range(count):
        own = slice(6 * b, 6 * b + 6)
        p.H[own, own] = np.diag([1.0, 1.0, 1.0, *[1.0 / 6.0] * 3]) / H
        p.c[6 * b : 6 * b + 3] = pull
        for corner, arm in enumerate(0.5 * CORNERS):
            k = 4 * b + corner
            touch(p, k, b, 1.0, arm)
            p.R[k] = yields * np.eye(3)
            if b:
                touch(p, k, b - 1, -1.0, np.add(arm, [0.0, 0.0, 1.0]))
    return p


def touch(p: ContactProblem, k: int, b: int, sign: float, arm: Array) -> None:
    """Rows of contact k, along z, x and y, of body b at this arm; a fourth is the spin about z."""
    d = p.R.shape[1]
    axes = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    p.W[d * k : d * k + 3, 6 * b : 6 * b + 6] = sign * np.hstack([axes, np.cross(arm, axes)])
    if d == 4:
        p.W[d * k + 3, 6 * b + 5] = sign


def ball(d: int, mu: float, v: Array) -> ContactProblem:
    """A ball of radius and mass 1 on the ground, that moved at v."""
    p = allocate_problem(6, 1, 0, d)
    p.H[:], p.mu[:] = np.diag([1.0, 1.0, 1.0, 0.4, 0.4, 0.4]) / H, mu
    p.c[:] = p.H @ v + np.array([0.0, 0.0, -G, 0.0, 0.0, 0.0])
    touch(p, 0, 0, 1.0, np.array([0.0, 0.0, -1.0]))
    return p


@pytest.mark.long
@pytest.mark.parametrize("d", [3, 4])
@pytest.mark.parametrize("compliant", [False, True])
def test_random_scenes_are_solved(d: int, compliant: bool) -> None:
    """All where contacts yield; of rigid scenes one in a hundred may be left to a shorter step."""
    rng = np.random.default_rng(11 + d)
    solved = [solve(draw(rng, d, compliant)).status == SOLVED for _ in range(100)]
    assert sum(solved) >= (100 if compliant else 99)


@pytest.mark.long
@pytest.mark.parametrize("d", [3, 4])
def test_nearly_all_random_scenes_of_bodies_next_to_without_inertia_are_solved(d: int) -> None:
    rng = np.random.default_rng(12)
    solved = [solve(draw(rng, d, i % 2 == 0, light=True)).status == SOLVED for i in range(100)]
    assert sum(solved) >= 97


@pytest.mark.parametrize("yields", [0.0, 1e-3])
@pytest.mark.parametrize("slope", [0.3, 0.6])
def test_a_box_sticks_up_to_the_angle_of_friction_or_slides(yields: float, slope: float) -> None:
    mu, heading = 0.5, np.array([np.cos(0.7), np.sin(0.7), 0.0])
    p = boxes(1, G * (np.sin(slope) * heading - np.cos(slope) * np.array([0, 0, 1.0])), mu, yields)
    answer, modes = solve(p), STICK if np.tan(slope) < mu else FORWARD
    normal, rubbing = answer.force[0::3], answer.force.reshape(4, 3)[:, 1:]
    assert answer.status == SOLVED
    if yields == 0.0:
        acceleration = max(0.0, G * (np.sin(slope) - mu * np.cos(slope)))
        np.testing.assert_allclose(answer.v[:3], acceleration * H * heading, atol=1e-10)
        assert normal.sum() == pytest.approx(G * np.cos(slope), rel=1e-8)
        assert (answer.mode[normal > 1e-6] == modes).all()
    np.testing.assert_allclose(rubbing.sum(axis=0) @ [-heading[1], heading[0]], 0.0, atol=1e-7)


def test_a_ball_slides_and_then_rolls() -> None:
    sliding = solve(ball(3, 0.3, np.array([1.0, 0, 0, 0, 0, 0])))
    np.testing.assert_allclose(sliding.force, [G, -0.3 * G, 0.0], rtol=1e-8, atol=1e-8)
    rolling = solve(ball(3, 0.3, np.array([1.0, 0, 0, 0, 1.0, 0])))
    np.testing.assert_allclose(rolling.force, [G, 0.0, 0.0], rtol=1e-8, atol=1e-7)
    np.testing.assert_allclose(rolling.v, [1.0, 0, 0, 0, 1.0, 0], atol=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_what_rolls_however_slowly_rolls_on_by_the_forces_of_the_last_step(seed: int) -> None:
    """Beside a ball that flies, whose motion is known to rounding; the guess is enough."""
    rng = np.random.default_rng(seed)
    speed = 10.0 ** rng.uniform(-11.0, 1.0)
    v = speed * np.array([1.0, 0, 0, 0, 1.0, 0])
    old = np.array([G, 0.0, 0.0]) * (1.0 + rng.uniform(-1e-11, 1e-11))
    rolling = solve(ball(3, 0.3, v), old, v=v)
    assert rolling.status == SOLVED and rolling.stage == GUESS
    near = {"rtol": 0.0, "atol": 1e-9 * speed + 1e-16}
    np.testing.assert_allclose(rolling.v, v, **near)
    one, both = ball(3, 0.3, v), allocate_problem(12, 1, 0, 3)
    flies = rng.normal(size=6)
    both.H[:6, :6] = both.H[6:, 6:] = one.H
    both.c[:] = np.concatenate([one.c, one.H @ (flies * (1.0 + 1e-10))])
    both.W[:, :6], both.w[:], both.mu[:] = one.W, one.w, one.mu
    together = solve(both, old, v=np.concatenate([v, flies]))
    assert together.status == SOLVED
    np.testing.assert_allclose(together.v[6:], flies * (1.0 + 1e-10), rtol=1e-12)
    np.testing.assert_allclose(together.v[:6], v, **near)


def test_friction_and_torsion_share_one_cone() -> None:
    mu, v = 0.3, np.array([0.0, 1.0, 0, 0.0, 0, 2.0])
    answer = solve(ball(4, mu, v))
    assert answer.status == SOLVED and answer.force[0] == pytest.approx(G)
    rate = np.array([0.0, *answer.v[[0, 1, 5]]]) + np.array([0.0, -answer.v[4], answer.v[3], 0.0])
    assert np.linalg.norm(answer.force[1:]) == pytest.approx(mu * G)
    np.testing.assert_allclose(answer.force[1:] / (mu * G), -rate[1:] / np.linalg.norm(rate[1:]), atol=1e-7)
    spinning = solve(ball(4, mu, np.array([0, 0, 0, 0, 0, 2.0])))
    np.testing.assert_allclose(spinning.v[5], 2.0 - mu * G * H / 0.4, rtol=1e-8)
    assert solve(ball(4, mu, np.array([0, 0, 0, 0, 0, mu * G * H]))).v[5] == pytest.approx(0.0, abs=1e-10)


def test_arms_rest_by_dry_friction_follow_servos_and_keep_joints() -> None:
    p = allocate_problem(4, 0, 4, 3)
    p.H[:], p.S[:] = np.diag([2.0, 2.0, 2.0, 2.0]), np.eye(4)
    p.c[:] = [0.5, 3.0, 7.0, -0.2]
    p.F[:] = [1.0, 1.0, np.inf, 1.0]
    p.R_s[3], p.w_s[:] = 0.1, [0.0, 0.0, -0.25, -0.3]
    answer = solve(p)
    np.testing.assert_allclose(answer.tau[:3], [-0.5, -1.0, -6.5], atol=1e-7)
    np.testing.assert_allclose(answer.v[:3], [0.0, 1.0, 0.25], atol=1e-8)
    tau = (0.3 + 0.1) / 0.6  # v + 0.1 tau = 0.3, 2 v = tau - 0.2
    np.testing.assert_allclose([answer.v[3], answer.tau[3]], [tau / 2.0 - 0.1, tau], atol=1e-7)
    assert list(answer.mode) == [STICK, FORWARD, STICK, STICK]


def test_a_limit_is_one_row() -> None:
    p = allocate_problem(2, 2, 0, 4)
    p.H[:], p.c[:] = np.eye(2), [-1.0, 1.0]
    p.W[0, 0] = p.W[4, 1] = 1.0
    p.w[:] = [0.4, 0, 0, 0, 0.4, 0, 0, 0]
    answer = solve(p)
    np.testing.assert_allclose(answer.v, [-0.4, 1.0], atol=1e-9)
    np.testing.assert_allclose(answer.force, [0.6, 0, 0, 0, 0, 0, 0, 0], atol=1e-8)
    assert list(answer.mode) == [FORWARD, OPEN]


@pytest.mark.parametrize("light", [1.0, 1e-9])
def test_a_stack_rests_on_forces_that_balance_it(light: float) -> None:
    p = boxes(10, np.array([0.0, 0.0, -G]), 0.5)
    p.H[:] *= light
    answer = solve(p)
    assert answer.status == SOLVED
    weights = answer.force[0::3].reshape(10, 4).sum(axis=1)
    np.testing.assert_allclose(weights, G * np.arange(10, 0, -1), rtol=1e-8)
    again = solve(p, answer.force)
    assert again.stage == GUESS and not again.v.any()
    np.testing.assert_allclose(again.force, answer.force, rtol=1e-9)


@pytest.mark.parametrize("compliant", [False, True])
def test_an_answer_is_a_start_that_is_left_alone(compliant: bool) -> None:
    rng = np.random.default_rng(13)
    for _ in range(20):
        p = draw(rng, 3, compliant)
        answer = solve(p)
        again = solve(p, answer.force, answer.tau)
        assert again.status == SOLVED
        if answer.residual < 1e-10:
            size = np.abs(answer.force).max(initial=0.0)
            np.testing.assert_allclose(again.force, answer.force, rtol=0.0, atol=1e-7 * size)


def test_bodies_in_another_order_move_the_same() -> None:
    rng = np.random.default_rng(14)
    for _ in range(20):
        p = draw(rng, 3, compliant=True)
        n, contacts, limited = len(p.c), len(p.mu), len(p.F)
        i, k, b = rng.permutation(n), rng.permutation(contacts), rng.permutation(limited)
        rows = (3 * k[:, None] + np.arange(3)).ravel()
        q = allocate_problem(n, contacts, limited, 3)
        q.H[:], q.c[:], q.W[:], q.S[:] = p.H[np.ix_(i, i)], p.c[i], p.W[rows][:, i], p.S[b][:, i]
        q.R[:], q.w[:], q.mu[:] = p.R[k], p.w[rows], p.mu[k]
        q.R_s[:], q.w_s[:], q.F[:], q.quantum[:] = p.R_s[b], p.w_s[b], p.F[b], p.quantum
        first, second = solve(p), solve(q)
        np.testing.assert_allclose(second.v, first.v[i], atol=1e-6 * np.abs(first.v).max())


def test_islands_do_not_know_of_each_other() -> None:
    rng = np.random.default_rng(15)
    p, q = draw(rng, 3, compliant=True), boxes(3, np.array([1.0, 0.0, -G]), 0.5)
    n, contacts, limited = len(p.c) + len(q.c), len(p.mu) + len(q.mu), len(p.F)
    both = allocate_problem(n, contacts, limited, 3)
    m, k = len(p.c), len(p.mu)
    both.H[:m, :m], both.H[m:, m:], both.c[:m], both.c[m:] = p.H, q.H, p.c, q.c
    both.W[: 3 * k, :m], both.W[3 * k :, m:], both.R[:k], both.R[k:] = p.W, q.W, p.R, q.R
    both.w[: 3 * k], both.w[3 * k :], both.mu[:k], both.mu[k:] = p.w, q.w, p.mu, q.mu
    both.S[:, :m], both.R_s[:], both.w_s[:], both.F[:] = p.S, p.R_s, p.w_s, p.F
    together = solve(both)
    np.testing.assert_allclose(together.v[:m], solve(p).v, atol=1e-12)
    np.testing.assert_allclose(together.v[m:], solve(q).v, atol=1e-12)


@pytest.mark.parametrize("balls", [1, 8])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_squeezed_row_of_balls_has_no_solution_until_there_is_room(balls: int, mu: float) -> None:
    for room, status in ((-1e-3, NO_SOLUTION), (1.0, SOLVED)):
        p = allocate_problem(6 * balls, balls + 1, 0, 3)
        p.H[:], p.mu[:], p.quantum[0] = np.eye(6 * balls) / H, mu, 1e-12
        for k in range(balls + 1):
            for b, sign in ((k - 1, -1.0), (k, 1.0)):
                if 0 <= b < balls:
                    touch(p, k, b, sign, np.array([0.0, 0.0, -sign]))
        p.w[0], p.w[-3] = -1.0, room
        answer = solve(p)
        assert answer.status == status
        if status == SOLVED:
            np.testing.assert_allclose(answer.v[2::6], 1.0, rtol=1e-8)


def test_scenes_at_the_edge() -> None:
    free = allocate_problem(3, 0, 0, 3)
    free.H[:], free.c[:] = np.diag([1.0, 2.0, 4.0]), 1.0
    np.testing.assert_allclose(solve(free).v, [1.0, 0.5, 0.25])
    free.H[1, 1] = -1.0
    assert solve(free).status == NO_SOLUTION
    for n in (0, 1):  # a contact whose bodies are all driven
        for gap, give, status in ((0.1, 0.0, SOLVED), (-0.1, 0.0, NO_SOLUTION), (-0.1, 0.5, SOLVED)):
            p = allocate_problem(n, 1, 0, 3)
            p.H[:], p.w[0], p.R[0], p.mu[:] = np.eye(n), gap, give * np.eye(3), 0.5
            answer = solve(p)
            assert answer.status == status
            if give > 0.0:
                np.testing.assert_allclose(answer.force, [0.2, 0.0, 0.0], atol=1e-8)


def test_units_do_not_matter(in_units: Callable[..., ContactProblem]) -> None:
    rng = np.random.default_rng(16)
    for _ in range(10):
        p = draw(rng, 3, compliant=True)
        p.quantum[:] = 0.0
        scale = 10.0 ** rng.uniform(-3, 3, len(p.c))
        q = in_units(p, scale, 1e3, 1e-2)
        first, second = solve(p), solve(q)
        assert second.status == SOLVED
        np.testing.assert_allclose(second.v * scale / 1e-2, first.v, atol=1e-6 * np.abs(first.v).max())


@pytest.mark.parametrize("d", [2, 3, 4])
@pytest.mark.parametrize("lever", [1e-19, 1e-17, 1e-14, 1e-10])
def test_a_contact_whose_normal_meets_the_axis_of_a_hinge_measures_nothing(
    run: Callable[..., tuple[int, Any]], d: int, lever: float
) -> None:
    # A hinge, driven by a servo, with a contact that is open: its normal passes the axis at this distance.
    p = allocate_problem(1, 1, 1, d)
    p.H[:], p.S[:], p.R_s[:], p.w_s[:], p.F[:] = 1e-3, 1.0, 0.06, -0.1, np.inf
    p.W[1], p.w[0], p.mu[:] = 0.03, 0.5, 0.8
    sizes, still = Sizes(1, 1, 1), Unknowns(np.zeros(2, np.int64), np.zeros(1), np.zeros(d), np.zeros(1))
    p.W[0] = lever
    measures = (by_rows, measured)
    assert all(measure(p, sizes, still) > 0.1 for measure in measures)
    v = run("planar", p)[1].v if d == 2 else solve(p).v
    assert v == pytest.approx(0.1 / (1.0 + 0.06e-3), rel=1e-6)


def by_rows(p: ContactProblem, sizes: Sizes, found: Unknowns) -> float:
    """The residual of rows, of the whole."""
    return float(residual_of_rows(p, sizes, found, np.zeros((3, len(p.w) + len(p.F) + 12))))


def by_parts(p: ContactProblem, found: Unknowns) -> float:
    """The greatest residual of rows of the parts of a problem that nothing joins."""
    n, k, d = len(p.c), len(p.mu), p.R.shape[1]
    touched = np.vstack([(p.W.reshape(k, d, n) != 0.0).any(axis=1), p.S != 0.0])
    joined = np.block([[p.H != 0.0, touched.T], [touched, np.zeros((len(touched),) * 2, bool)]])
    label = connected_components(joined, directed=False)[1]
    bare = ~np.isin(label[:n], label[n:])
    label[:n][bare] = label[:n][bare][:1]  # all that no group touches is one part
    worst = 0.0
    for own in np.unique(label):
        i, c, r = (np.flatnonzero(part == own) for part in np.split(label, [n, n + k]))
        rows = (c[:, None] * d + np.arange(d)).ravel()
        q = allocate_problem(len(i), len(c), len(r), d)
        q.H[:], q.c[:], q.mu[:] = p.H[np.ix_(i, i)], p.c[i], p.mu[c]
        q.W[:], q.w[:], q.R[:] = p.W[np.ix_(rows, i)], p.w[rows], p.R[c]
        q.S[:], q.R_s[:], q.w_s[:], q.F[:] = p.S[np.ix_(r, i)], p.R_s[r], p.w_s[r], p.F[r]
        q.quantum[:] = p.quantum
        mine = Unknowns(found.mode[np.concatenate([c, k + r])], found.v[i], found.force[rows], found.tau[r])
        worst = max(worst, by_rows(q, Sizes(len(i), len(c), len(r)), mine))
    return worst


@pytest.mark.parametrize("d", [3, 4])
@pytest.mark.parametrize("size", [0.0, 1e-9, 1.0])
def test_the_residual_of_sparse_rows_is_that_of_dense_ones(d: int, size: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        p = draw(rng, d, bool(rng.integers(2)))
        found = solve(p)
        v, force, tau = (
            each + size * rng.standard_normal(len(each)) for each in (found.v, found.force, found.tau)
        )
        sizes, moved = Sizes(len(p.c), len(p.mu), len(p.F)), Unknowns(found.mode, v, force, tau)
        dense, sparse = by_parts(p, moved), measured(p, sizes, moved)
        assert sparse == pytest.approx(dense, rel=1e-6, abs=1e-14)
        if len(v):
            v[0] = np.nan
            assert measured(p, sizes, moved) == np.inf


def test_answers_are_the_same_to_the_bit_where_entries_alone_are_kept() -> None:
    rng = np.random.default_rng(6)
    for bodies in (2, 5, 14):
        p = draw(rng, 3, bodies=bodies)
        n, contacts = len(p.c), len(p.mu)
        columns, couplings = np.zeros((contacts, 4), np.int64), np.zeros((n, 2), np.int64)
        for k in range(contacts):
            met = np.flatnonzero(p.W[3 * k : 3 * k + 3].any(axis=0))
            split = int(rng.integers(met[0], n + 1))
            columns[k] = met[0], split, split, n
        for i in range(n):
            couplings[i] = np.flatnonzero(p.H[i])[[0, -1]] + [0, 1]
        everywhere, spans = solve(p), solve(kept(p, columns, couplings), where=(columns, couplings))
        assert everywhere.status == spans.status == SOLVED
        for one, other in zip(everywhere[3:6], spans[3:6], strict=True):
            assert one.tobytes() == other.tobytes()


def test_many_things_apart_do_not_use_up_each_others_newton_steps() -> None:
    """Balls of very unequal inertia along each axis, pressed and pushed over a floor."""
    rng, count = np.random.default_rng(3), 1500
    n, ball, axis = 3 * count, np.arange(count), np.tile(np.arange(3), count)
    p = allocate_problem(n, count, 0, 3, Widths(3, 3))
    p.H[np.arange(n), axis], p.W[np.arange(n), axis] = 10.0 ** rng.uniform(-1.0, 1.0, n), 1.0
    p.mu[:], p.c[:] = rng.uniform(0.2, 0.8, count), rng.normal(size=n)
    p.c[::3] = -1.0
    columns = np.stack([3 * ball, 3 * ball + 3, 3 * ball + 3, 3 * ball + 3], axis=1)
    couplings = columns.repeat(3, axis=0)[:, :2].copy()
    found = Unknowns(np.zeros(count, np.int64), np.zeros(n), np.zeros(n), np.zeros(0))
    status, _, _, steps = solve_groups(
        p, Sizes(n, count, 0), found, CONE, NO_SURFACES, columns, couplings, np.zeros(1, np.int64)
    )
    assert status == SOLVED and steps > NEWTON_STEPS


@pytest.mark.parametrize("compliant", [False, True])
def test_many_bodies_that_touch_each_other_are_solved(compliant: bool) -> None:
    """Islands of so many coordinates that their matrices are kept by blocks."""
    rng = np.random.default_rng(8)
    assert all(solve(draw(rng, 3, compliant, bodies=15)).status == SOLVED for _ in range(10))


def wall(rng: np.random.Generator, gap: float) -> ContactProblem:
    """Bricks of unequal mass that move a little, each on two others; faces touch at the corners that they
    share, whose gaps are up to this rate to close: which corners carry is hard to say."""
    width, rows, mu = int(rng.integers(2, 5)), int(rng.integers(2, 6)), rng.uniform(0.2, 0.8)
    pace = 10.0 ** rng.uniform(-3.0, 0.0)
    places = [(column + 0.5 * (row % 2), float(row)) for row in range(rows) for column in range(width)]
    faces = [(i, -1, x - 0.5, x + 0.5) for i, (x, z) in enumerate(places) if z == 0.0]
    for i, (x, z) in enumerate(places):
        for j, (y, below) in enumerate(places):
            if below == z - 1.0 and abs(x - y) < 1.0:
                faces.append((i, j, max(x, y) - 0.5, min(x, y) + 0.5))
    p = allocate_problem(6 * len(places), 4 * len(faces), 0, 3)
    p.quantum[0], p.mu[:] = 1e-12, mu
    for b in range(len(places)):
        own, mass = slice(6 * b, 6 * b + 6), 10.0 ** rng.uniform(-0.7, 0.7)
        p.H[own, own] = mass * np.diag([1.0, 1.0, 1.0, *[1.0 / 6.0] * 3]) / H
        p.c[own] = p.H[own, own] @ (pace * rng.normal(size=6))
        p.c[6 * b + 2] -= mass * G
    corners = [(i, j, x, y) for i, j, *ends in faces for x in ends for y in (-0.5, 0.5)]
    for k, (i, j, x, y) in enumerate(corners):
        touch(p, k, i, 1.0, np.array([x - places[i][0], y, -0.5]))
        if j >= 0:
            touch(p, k, j, -1.0, np.array([x - places[j][0], y, 0.5]))
        p.w[3 * k] = gap * rng.uniform()
    return p


def test_walls_whose_corners_disagree_are_solved_by_newtons_method() -> None:
    found = [solve(wall(np.random.default_rng(seed), 1e-4)) for seed in range(24)]
    assert sum(each.status == SOLVED and each.stage <= PROXIMAL for each in found) >= 14
