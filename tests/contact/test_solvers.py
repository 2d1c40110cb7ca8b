"""The planar chain and its parts, against each other and against the residual."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.contact.certify import certify_infeasible
from rungwise.contact.judge.certificate import check
from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.step import solve_groups
from rungwise.contact.step import NO_SURFACES, SOLVED, TOLERANCE, Sizes, Unknowns
from rungwise.contact.step.modes import natural_units, yielding
from tests.simulation.linear_system import linear_system


def problems(random_problem, count, seed=1, most=4):
    rng = np.random.default_rng(seed)
    return [random_problem(rng, most) for _ in range(count)]


@pytest.mark.parametrize("count", [700, pytest.param(3000, marks=pytest.mark.long)])
def test_solved_means_a_small_residual_and_enumeration_knows_no_more(random_problem, run, count):
    solved = 0
    for p in problems(random_problem, count):
        status, solution = run("planar", p)
        if status == 0:
            solved += 1
            assert solution.residual <= TOLERANCE
        else:
            assert run("enumeration", p)[0] != 0
    assert solved > 0.9 * count


@pytest.mark.parametrize("count", [600, pytest.param(1500, marks=pytest.mark.long)])
def test_no_solution_has_a_certificate(random_problem, run, count):
    refused = [p for p in problems(random_problem, count, seed=7) if run("planar", p)[0] != 0]
    refused += [
        p for p in problems(random_problem, 4 * count // 15, seed=21, most=6) if run("planar", p)[0] != 0
    ]
    assert len(refused) > count / 15
    certificates = [certify_infeasible(p) for p in refused]
    assert {c.kind for c in certificates if c} == {"kinematic", "frictional"}
    assert all(check(p, c) for p, c in zip(refused, certificates, strict=True) if c)
    # No certificate rests on the rate of what yields: without one is only what it would have to rest on.
    rigid = [(p, c) for p, c in zip(refused, certificates, strict=True) if not any(map(np.any, yielding(p)))]
    assert len(rigid) > count / 30 and all(c for _, c in rigid)


def test_units_do_not_change_the_verdict(random_problem, in_units, run):
    rng = np.random.default_rng(5)
    for p in problems(random_problem, 500, seed=4):
        s, newton, speed = (
            10.0 ** rng.uniform(-3, 3, len(p.c)),
            10.0 ** rng.uniform(-6, 6),
            10.0 ** rng.uniform(-6, 6),
        )
        status, solution = run("planar", p)
        other_status, other = run("planar", in_units(p, s, newton, speed))
        assert other_status == status
        if status == 0 and list(other.mode) == list(solution.mode):
            assert np.allclose(other.v * s / speed, solution.v, rtol=1e-6, atol=1e-6)


def is_determined(p, mode):
    """Whether the mode's equations determine velocities and forces, and not only by a hair."""
    equal = linear_system(p, tuple(int(m) for m in mode))[0]
    return np.linalg.matrix_rank(equal, tol=1e-6) == equal.shape[1]


@pytest.mark.parametrize("count", [400, pytest.param(1000, marks=pytest.mark.long)])
def test_warm_start_needs_one_linear_solve(random_problem, run, count):
    for p in problems(random_problem, count, seed=2):
        status, solution = run("planar", p)
        if status == 0:
            _, again = run("modes", p, solution.mode)
            # Where forces are indeterminate, one choice of them out of many obeys the inequalities.
            if is_determined(p, solution.mode):
                assert again.residual <= TOLERANCE
            assert list(again.mode) == list(solution.mode)
            assert np.allclose(again.v, solution.v, rtol=1e-7, atol=1e-7)


def test_solutions_satisfy_the_system_of_their_mode(random_problem, run):
    for p in problems(random_problem, 1000, seed=6):
        status, solution = run("planar", p)
        # A singular mode may drop a row that it contradicts: then only the name of the mode is wrong.
        if status != 0 or not is_determined(p, solution.mode):
            continue
        units = natural_units(p)
        forces = np.concatenate([solution.force, solution.limited]) / units.force
        x = np.concatenate([solution.v / units.coordinates, forces])
        equal, value, least, bound = linear_system(p, tuple(int(m) for m in solution.mode))
        size = 1e-8 * max(1.0, float(np.abs(x).max()))
        assert np.abs(equal @ x - value).max() <= size * max(1.0, float(np.abs(equal).max()))
        assert (least @ x - bound).min(initial=0.0) >= -size * max(1.0, float(np.abs(least).max(initial=0.0)))


def test_a_joint_feels_the_drive_beside_it(body, run):
    p = body(1, 0, 2)
    p.S[:], p.w_s[:], p.F[:] = 1.0, (0.0, -1.0), (np.inf, 5.0)
    status, solution = run("planar", p)
    assert (status, solution.limited.tolist()) == (0, pytest.approx([-5.0, 5.0]))


@pytest.mark.parametrize("copies", [2, 5, 12])
@pytest.mark.parametrize("push", [0.0, 3.0, 5.0, 15.0])
def test_copies_of_one_contact_do_not_cycle(body, run, copies, push):
    p = body(2, copies)
    p.c[:], p.mu[:] = (push, -10.0), 0.5
    p.W[:] = np.tile([[0.0, 1.0], [1.0, 0.0]], (copies, 1))
    status, solution = run("planar", p)
    assert status == 0
    assert solution.residual <= TOLERANCE
    assert solution.force[::2].sum() == pytest.approx(10.0)


def stack(body, boxes):
    """Unit boxes on top of each other, two contacts each; coordinates x, y, angle from the floor up."""
    p = body(3 * boxes, 2 * boxes)
    p.c[1::3], p.mu[:] = -10.0, 0.5
    for k in range(2 * boxes):
        box, x = k // 2, k % 2 - 0.5
        p.W[2 * k, 3 * box : 3 * box + 3] = 0.0, 1.0, x
        p.W[2 * k + 1, 3 * box : 3 * box + 3] = 1.0, 0.0, 0.5
        if box:
            p.W[2 * k, 3 * box - 3 : 3 * box] = 0.0, -1.0, -x
            p.W[2 * k + 1, 3 * box - 3 : 3 * box] = -1.0, 0.0, 0.5
    return p


@pytest.mark.parametrize("push", [0.0, 2.0])
def test_a_stack_of_eight_boxes_carries_its_weight(body, run, push):
    p = stack(body, 8)
    p.c[-3] = push
    status, solution = run("planar", p)
    assert status == 0
    assert solution.residual <= TOLERANCE
    assert (solution.force[::2] >= 0.0).all()
    if push == 0.0:
        assert np.abs(solution.v).max() <= 1e-12
        assert solution.force[::4] + solution.force[2::4] == pytest.approx(10.0 * np.arange(8, 0, -1))
        again = run("planar", p, solution.mode, forces=(solution.force, solution.limited))[1]
        assert again.force == pytest.approx(solution.force, rel=1e-9)


def pyramid(body, rows):
    """Unit boxes, `rows` of them side by side on the floor, one fewer in each row above, half a box on."""
    boxes = [(row, column) for row in range(rows) for column in range(rows - row)]
    above = [(row, column, side) for row, column in boxes for side in (0, 1)]
    p = body(3 * len(boxes), 2 * len(above))
    p.c[1::3], p.mu[:] = -10.0, 0.5
    for k, (row, column, side) in enumerate(above):
        upper, lower = boxes.index((row, column)), boxes.index((row - 1, column + side)) if row else None
        for point in (0, 1):
            # The lower box's middle is half a box to the side of the upper one's, at which the stretch ends.
            x = (side - 1 + point) * 0.5
            n, t = 4 * k + 2 * point, 4 * k + 2 * point + 1
            p.W[n, 3 * upper : 3 * upper + 3], p.W[t, 3 * upper : 3 * upper + 3] = (0, 1, x), (1, 0, 0.5)
            if lower is not None:
                y = x - (side - 0.5)
                p.W[n, 3 * lower : 3 * lower + 3], p.W[t, 3 * lower : 3 * lower + 3] = (
                    (0, -1, -y),
                    (-1, 0, 0.5),
                )
    return p


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "pile", [(stack, 10), (stack, 20), (pyramid, 6)], ids=lambda x: f"{x[0].__name__}{x[1]}"
)
def test_piles_rest_on_forces_that_may_be_shared_in_many_ways(body, run, pile):
    """Rest is the answer whatever modes the search starts from, and the forces it is given are kept."""
    build, size = pile
    p = build(body, size)
    p.quantum[:] = 1e-9
    for mode in (np.zeros(len(p.mu)), np.ones(len(p.mu)), np.full(len(p.mu), 2)):
        status, solution = run("groups", p, mode)
        assert (status, np.abs(solution.v).max() <= 1e-11) == (0, True)
        assert solution.residual <= 1e-11
        assert solution.force[::2].min() >= 0.0
        assert p.W.T @ solution.force == pytest.approx(-p.c, abs=1e-8)
    other = run("groups", p, solution.mode, forces=(solution.force, solution.limited))[1]
    assert other.force == pytest.approx(solution.force, abs=1e-9)


def test_gaps_that_disagree_about_redundant_contacts_decide_which_of_them_carry(body, run):
    """Three points under a block: the middle one is lower, so the ends carry; then the other way round."""
    p = body(3, 3)
    p.c[1], p.mu[:] = -10.0, 0.5
    for k, x in enumerate((-1.0, 0.0, 1.0)):
        p.W[2 * k], p.W[2 * k + 1] = (0, 1, x), (1, 0, 0.5)
    for gap, carry in ((1e-3, (5.0, 0.0, 5.0)), (-1e-3, (0.0, 10.0, 0.0))):
        p.w[2] = gap
        status, solution = run("groups", p)
        assert (status, solution.residual <= 1e-9) == (0, True)
        up = 0.0 if gap > 0.0 else -gap
        assert solution.v[1] == pytest.approx(up, abs=1e-11)
        assert solution.force[::2] == pytest.approx(np.array(carry) * (1.0 + up), abs=1e-6)


def test_the_solver_alone_against_the_step(random_problem, run):
    """It may miss a solution; it must not make one up, not even where forces grow without bound."""
    missed = 0
    for p in problems(random_problem, 1500, seed=8):
        solved = run("planar", p)[0] == 0
        status, solution = run("groups", p)
        assert status != 0 or (solved and solution.residual <= TOLERANCE)
        missed += solved and status != 0
    assert missed <= 40


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_opposite_contacts_squeeze_or_leave_room(body, run, scale):
    """2 v >= 1 and v / 2 <= room: one speed is left from room = 1/4 on, and below that none."""
    p = body(1, 2)
    p.W[:, 0], p.mu[:] = np.array([2.0, 0.0, -0.5, 0.0]) / scale, 0.5
    for room, answer in ((0.2499, None), (0.25, 0.5), (0.3, 0.5)):
        p.w[:] = (-1.0, 0.0, room, 0.0)
        status, solution = run("planar", p)
        assert (status == 0) == (answer is not None)
        if answer is None:
            assert check(p, certify_infeasible(p))
        else:
            assert solution.v[0] == pytest.approx(answer * scale)


@pytest.mark.parametrize("load", [1e-250, 3.8e-309, 5e-324])
def test_loads_so_small_that_they_lose_their_digits_are_none(body, run, load):
    """What is not a number is no small number, and has no solution."""
    p = body(3, 0, 1)
    p.H[:] = [[2.5e-2, 0.0, 1.4e-13], [0.0, 1.5e-14, 0.0], [1.4e-13, 0.0, 0.2]]
    p.S[0], p.R_s[:], p.F[:] = [0.0, 0.6, 0.0], 0.8, 0.2
    p.c[0] = load
    status, found = run("groups", p)
    assert status == SOLVED
    np.testing.assert_allclose(found.v, np.linalg.solve(p.H, p.c), rtol=1e-9, atol=1e-260)
    p.c[0] = np.nan
    assert run("groups", p)[0] != SOLVED


@pytest.mark.parametrize("pace", [0.01, 1.0, 100.0])
def test_light_bodies_keep_nothing_of_where_the_solver_began(body, pace):
    """A ball of next to no inertia that rests on a floor which yields, last seen at some speed: friction of
    1e-12 of its weight would move it."""
    p = body(6, 1, directions=3)
    p.H[:], p.c[2] = np.diag([1e-5, 1e-5, 1e-5, 5e-8, 5e-8, 5e-8]), -9.81
    p.W[:, [2, 1, 0]] = np.diag([1.0, 1.0, -1.0])
    p.W[1, 3], p.W[2, 4] = 0.1, 0.1
    p.R[0], p.w[0], p.mu[:], p.quantum[:] = 5e-4 * np.eye(3), -9.81e-3, 0.2, 1e-10
    v, nowhere = pace * np.eye(6)[0], np.empty((0, 4), np.int64)
    found = Unknowns(np.zeros(1, np.int64), v, np.zeros(3), np.zeros(0))
    status, _, _, _ = solve_groups(
        p, Sizes(6, 1, 0), found, CONE, NO_SURFACES, nowhere, nowhere, np.zeros(1, np.int64)
    )
    assert status == SOLVED and found.force[0] == pytest.approx(9.81)
    np.testing.assert_allclose(found.v[[0, 1, 3, 4, 5]], 0.0, atol=1e-8)
