"""The planar chain and its parts, against each other and against the residual."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.contact.certificate import check
from rungwise.contact.infeasible import certify_infeasible
from rungwise.contact.modes import linear_system, natural_units
from rungwise.contact.solvers.planar import TOLERANCE


def problems(random_problem, count, seed=1, most=4):
    rng = np.random.default_rng(seed)
    return [random_problem(rng, most) for _ in range(count)]


def test_solved_means_a_small_residual_and_enumeration_knows_no_more(random_problem, run):
    solved = 0
    for p in problems(random_problem, 3000):
        status, solution = run("planar", p)
        if status == 0:
            solved += 1
            assert solution.residual <= TOLERANCE
        else:
            assert run("enumeration", p)[0] != 0
    assert solved > 2700


def test_no_solution_has_a_certificate(random_problem, run):
    refused = [p for p in problems(random_problem, 1200, most=2) if run("planar", p)[0] != 0]
    assert len(refused) > 20
    certificates = [certify_infeasible(p) for p in refused]
    assert {c.kind for c in certificates if c} == {"kinematic", "frictional"}
    assert all(c and check(p, c) for p, c in zip(refused, certificates, strict=True))


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


def test_warm_start_needs_one_linear_solve(random_problem, run):
    for p in problems(random_problem, 1000, seed=2):
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


def test_lemke_alone_against_enumeration(random_problem, run):
    """Lemke may end on a ray although there is a solution; what it finds, it must have found."""
    missed = 0
    for p in problems(random_problem, 2000, seed=3):
        status, solution = run("lemke", p)
        if run("enumeration", p)[0] == 0:
            missed += status != 0
            assert status != 0 or solution.residual <= TOLERANCE
    assert missed <= 10


def test_a_joint_feels_the_drive_beside_it(body, run):
    p = body(1, 0, 2)
    p.S[:], p.w_s[:], p.F[:] = 1.0, (0.0, -1.0), (np.inf, 5.0)
    for solver in ("planar", "lemke"):
        status, solution = run(solver, p)
        assert (status, solution.limited.tolist()) == (0, pytest.approx([-5.0, 5.0]))


@pytest.mark.parametrize("copies", [2, 5, 12])
@pytest.mark.parametrize("push", [0.0, 3.0, 5.0, 15.0])
def test_copies_of_one_contact_do_not_cycle(body, run, copies, push):
    p = body(2, copies)
    p.c[:], p.mu[:] = (push, -10.0), 0.5
    p.W[:] = np.tile([[0.0, 1.0], [1.0, 0.0]], (copies, 1))
    for solver in ("planar", "lemke"):
        status, solution = run(solver, p)
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
        assert run("modes", p, solution.mode)[1].residual <= TOLERANCE
    assert run("lemke", p)[0] == 0
