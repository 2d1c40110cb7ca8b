"""The residual at solutions made by hand."""

from __future__ import annotations

import numpy as np
import pytest

INF = float("inf")


def block(body, load=(0.0, -10.0), mu=0.5, yields=0.0):
    """A block that moves in the plane and does not turn, on the floor."""
    p = body(2, 1)
    p.c[:], p.mu[:] = load, mu
    p.W[:] = [[0.0, 1.0], [1.0, 0.0]]
    p.R[0] = yields * np.eye(2)
    return p


def drive(body, load, limit, yields=0.0, target=0.0):
    p = body(1, 0, 1)
    p.c[:], p.S[:], p.F[:], p.R_s[:], p.w_s[:] = load, 1.0, limit, yields, -target
    return p


CASES = {
    "stick": ((3.0, -10.0), 0.0, 0.0, (0.0, 0.0), (10.0, -3.0)),
    "slides along": ((15.0, -10.0), 0.0, 0.0, (1.0, 0.0), (10.0, -5.0)),
    "slides against": ((-15.0, -10.0), 0.0, 0.0, (-1.0, 0.0), (10.0, 5.0)),
    "open": ((5.0, 10.0), 0.0, 0.0, (0.5, 1.0), (0.0, 0.0)),
    "falls short of a gap": ((0.0, -10.0), (2.0, 0.0), 0.0, (0.0, -1.0), (0.0, 0.0)),
    "rides on a belt": ((13.0, -10.0), (0.0, -1.0), 0.0, (1.0, 0.0), (10.0, -3.0)),
    "compliant": ((0.0, -10.0), 0.0, 0.1, (0.0, -0.5), (5.0, 0.0)),
    "compliant, sticks": ((1.0, -10.0), 0.0, 0.1, (0.05, -0.5), (5.0, -0.5)),
}


@pytest.mark.parametrize("case", CASES)
def test_hand_made_solutions_have_none(body, measure, case):
    load, gap, yields, v, force = CASES[case]
    p = block(body, load, yields=yields)
    p.w[:] = gap
    assert measure(p, v, force) <= 1e-15


@pytest.mark.parametrize("case", ["slides along", "slides against", "rides on a belt", "compliant, sticks"])
def test_it_grows_linearly_with_each_entry(body, measure, case):
    load, gap, yields, v, force = CASES[case]
    p = block(body, load, yields=yields)
    p.w[:] = gap
    solution = np.array([*v, *force])
    for i in range(4):
        small, large = (solution + step * np.eye(4)[i] for step in (1e-6, 1e-4))
        ratio = measure(p, large[:2], large[2:]) / measure(p, small[:2], small[2:])
        assert ratio == pytest.approx(100.0, rel=1e-2)


@pytest.mark.parametrize(
    ("load", "limit", "yields", "target", "v", "tau"),
    [
        (3.0, 5.0, 0.0, 0.0, 0.0, -3.0),
        (15.0, 5.0, 0.0, 0.0, 1.0, -5.0),
        (-15.0, 5.0, 0.0, 0.0, -1.0, 5.0),
        (0.0, 5.0, 0.0, 2.0, 0.5, 5.0),
        (0.0, INF, 0.0, 2.0, 2.0, 20.0),
        (0.0, INF, 0.1, 2.0, 1.0, 10.0),
        (1.0, 0.0, 0.0, 0.0, 0.1, 0.0),
    ],
)
def test_limited_rows_hold_or_slip(body, measure, load, limit, yields, target, v, tau):
    p = drive(body, load, limit, yields, target)
    assert measure(p, [v], [], [tau]) <= 1e-15
    assert measure(p, [v], [], [tau + 1e-3]) > 1e-6
    assert measure(p, [v + 1e-3], [], [tau]) > 1e-6


def test_a_limit_that_grows_ends_as_a_joint(body, measure):
    for limit in (1e3, 1e6, INF):
        assert measure(drive(body, 0.0, limit, 0.0, 2.0), [2.0], [], [20.0]) <= 1e-15


def test_exact_cone_of_a_sliding_sphere(body, measure):
    p = body(3, 1, 0, 3)
    p.c[:], p.mu[:] = (3.0 + 30.0, 4.0 + 40.0, -10.0), 0.5
    p.W[:] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert measure(p, [3.0, 4.0, 0.0], [10.0, -3.0, -4.0]) <= 1e-15
    on_the_cone_but_askew = np.array([10.0, -4.0, -3.0])
    p.c[:2] = 34.0, 43.0
    assert measure(p, [3.0, 4.0, 0.0], on_the_cone_but_askew) > 1e-2


def test_units_do_not_matter(random_problem, in_units, measure):
    rng = np.random.default_rng(3)
    for _ in range(100):
        p = random_problem(rng)
        v, force, tau = rng.normal(size=len(p.c)), rng.normal(size=len(p.w)), rng.normal(size=len(p.F))
        s, newton, speed = (
            10.0 ** rng.uniform(-3, 3, len(p.c)),
            10.0 ** rng.uniform(-6, 6),
            10.0 ** rng.uniform(-6, 6),
        )
        other = measure(in_units(p, s, newton, speed), v / s * speed, force * newton, tau * newton)
        assert other == pytest.approx(measure(p, v, force, tau), rel=1e-9)


@pytest.mark.parametrize("wrong", [INF, -INF, float("nan")])
def test_what_is_not_finite_is_infinitely_wrong(body, measure, wrong):
    p = body(2, 1, 1)
    p.W[:], p.S[:], p.mu[:], p.F[:] = [[0.0, 1.0], [1.0, 0.0]], [[1.0, 0.0]], 0.5, 1.0
    for i in range(5):
        x = np.zeros(5)
        x[i] = wrong
        assert measure(p, x[:2], x[2:4], x[4:]) == INF


@pytest.mark.parametrize("name", ["H", "c", "W", "R", "w", "mu", "S", "R_s", "w_s"])
def test_a_problem_that_is_not_a_number_has_no_solution(body, measure, name):
    p = body(2, 1, 1)
    p.W[:], p.S[:], p.mu[:], p.F[:] = [[0.0, 1.0], [1.0, 0.0]], [[1.0, 0.0]], 0.5, 1.0
    getattr(p, name).flat[0] = np.nan
    assert measure(p, [1.0, 0.0], [1.0, 0.0], [0.5]) == INF
