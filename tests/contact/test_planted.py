"""No wrong word: problems with a planted solution are never said to have none, and `solved` means so in the
rows of the problem as it was given."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.files.read import read_problem
from rungwise.contact.judge.farkas import Infeasible, excludes_given, proves
from rungwise.contact.prepare.system import scaled

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import planted

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "problems"
CIRCUITS = sorted([*FOLDER.glob("*lcp*.dat"), *FOLDER.glob("relay*.dat")])


@pytest.mark.long
@pytest.mark.parametrize("family", planted.FAMILIES)
def test_a_planted_solution_is_found_and_holds_in_its_own_rows(family: str) -> None:
    rng, pose = np.random.default_rng(7), planted.poses(planted.FAMILIES[family])
    found = planted.tried(rng, pose, 300)
    assert found.wrong == 0 and found.loose == 0
    assert found.open <= 0.02 * found.calls


LOADED = [(family, "few") for family in planted.FAMILIES] + [(family, "loaded") for family in planted.DIODES]
"""Only circuits of diodes and resistors have a solution for any sources."""


@pytest.mark.few(1)
@pytest.mark.parametrize("decades", [0.0, 3.0])
@pytest.mark.parametrize(("family", "load"), LOADED)
def test_few_loads_in_any_units_are_answered(family: str, load: str, decades: float) -> None:
    """Most unknowns are zero, and their rows have no terms but rounding."""
    pose = planted.poses(planted.FAMILIES[family], load, decades)
    found = planted.tried(np.random.default_rng(14), pose, 100)
    assert found.wrong == 0 and found.loose == 0
    assert found.open <= 0.02 * found.calls


def test_a_free_unknown_that_should_be_zero() -> None:
    """A source feeds a diode to the ground; nothing flows through the rest of the circuit."""
    M = [
        [1.001, -0.501, -1, 0, 1],
        [-0.501, 0.501, 0, -1, -1],
        [1, 0, 1, 0, 0],
        [0, 1, 0, 0, 0],
        [-1, 1, 0, 0, 1e-3],
    ]
    found = rw.solve(rw.Problem.mlcp(M, [0.0, 1.0 / 3.0, 0.0, 0.0, 0.0], np.arange(5) > 1))
    assert found.status == "solved"
    np.testing.assert_allclose(found.x, [0.0, 0.0, 0.0, 1.0 / 3.0, 0.0], rtol=1e-15, atol=0)


@pytest.mark.few(1)
@pytest.mark.parametrize("family", ["mixed", "circuit", "network", "bridges"])
def test_free_rows_hold_beside_the_terms_that_they_have(family: str) -> None:
    """Summed in rational numbers; what is below 1e-13 of the largest terms of all rows is rounding."""
    rng, pose = np.random.default_rng(15), planted.poses(planted.FAMILIES[family], "few")
    for _ in range(60):
        problem = pose(rng).asked
        found = rw.solve(problem)
        if found.status != "solved":
            continue
        terms = [_terms(problem, found.x, i) for i in np.flatnonzero(problem.free)]
        largest = max(max(map(abs, each), default=Fraction(0)) for each in terms)
        for each in terms:
            size = max(sum(map(abs, each)), largest / 10**7)
            assert abs(sum(each)) <= size / 10**6


def _terms(problem: rw.Problem, x: np.ndarray, row: int) -> list[Fraction]:
    """The terms of a row, exactly."""
    used = np.flatnonzero(problem.A[row])
    products = [Fraction(float(problem.A[row, j])) * Fraction(float(x[j])) for j in used]
    return [*products, Fraction(float(problem.b[row]))]


def test_no_unknown_is_beyond_its_limits() -> None:
    """LCPs in units twelve decades apart: what no row feels is within its limits all the same."""
    rng = np.random.default_rng(16)
    for _ in range(150):
        n = int(rng.integers(2, 20))
        half = rng.normal(size=(n, n if rng.random() < 0.5 else max(n // 2, 1)))
        matrix = rw.Problem.lcp(half @ half.T, np.zeros(n))
        found = rw.solve(planted.posed(rng, planted.plant(rng, matrix).problem, 6.0).asked)
        assert found.status in ("solved", "not_converged")
        if found.status == "solved":
            assert found.x.min() >= 0.0


@pytest.mark.parametrize("path", CIRCUITS, ids=lambda path: path.name)
def test_published_matrices_with_planted_solutions(path: Path) -> None:
    rng, problem = np.random.default_rng(8), rw.Problem.of(read_problem(path))
    found = planted.tried(rng, planted.poses(lambda _: problem), 20)
    assert (found.wrong, found.loose, found.open) == (0, 0, 0)


@pytest.mark.few(1)
@pytest.mark.parametrize("path", CIRCUITS, ids=lambda path: path.name)
def test_published_matrices_in_any_units(path: Path) -> None:
    """In units three decades apart from their own, with many loads and with few."""
    rng, problem = np.random.default_rng(17), rw.Problem.of(read_problem(path))
    for load in planted.PLANTS:
        found = planted.tried(rng, planted.poses(lambda _: problem, load, 3.0), 60)
        assert found.wrong == 0 and found.loose == 0
        assert found.open <= 0.02 * found.calls


def test_the_judge_of_these_tests_sees_what_is_wrong() -> None:
    rng = np.random.default_rng(9)
    for draw in planted.FAMILIES.values():
        for _ in range(20):
            problem, x = planted.plant(rng, draw(rng))
            assert planted.violation(problem, x) < 1e-13
            active = np.argmax(np.abs(x) * np.abs(np.diag(problem.A)))
            if np.abs(x[active] * problem.A[active, active]) < 1e-3:
                continue
            x[active] *= 1.0 + 1e-2
            assert planted.violation(problem, x) > 1e-7


def test_elimination_keeps_entries_that_are_small_beside_others() -> None:
    """A circuit whose eliminated form has diagonals of 1 beside 1e7."""
    rng = np.random.default_rng(10)
    for _ in range(50):
        k, g = int(rng.integers(2, 6)), int(rng.integers(2, 9))
        conductance = 10.0 ** rng.uniform(-7.0, 0.0, g)
        own = np.diag(conductance) + np.triu(rng.normal(size=(g, g)), 1) * conductance.min()
        cross, back, front = rng.normal(size=(g, k)), rng.normal(size=(k, g)), rng.normal(size=(k, k))
        back[0], cross[:, 0] = 0.0, 0.0
        A = np.block([[front, back], [cross, own]])
        problem = rw.Problem.mlcp(A, rng.normal(size=k + g), np.arange(k + g) < k)
        system = scaled(problem)
        left = system.dense() * system.rate[:, None] / system.force
        np.testing.assert_allclose(left, front - back @ np.linalg.solve(own, cross), rtol=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("directions", [1, 2, 3])
def test_nothing_adheres_however_stiff(directions: int) -> None:
    """A massless body on compliant contacts: pressed on it is carried, pulled away from them it is not."""
    rng, d = np.random.default_rng(11), directions
    for _ in range(12):
        contacts, load = int(rng.integers(1, 4)), 10.0 ** rng.uniform(-3.0, 3.0)
        stiff = (10.0 ** rng.uniform(-14.0, -6.0, contacts)).repeat(d)
        gap = rng.choice([0.0, 1.0]) * rng.normal(size=contacts * d)
        W, c = np.tile(np.eye(d), (contacts, 1)), np.zeros(d)
        for sign in (-1.0, 1.0):
            c[0] = sign * load
            problem = rw.Problem.balance(
                np.zeros((d, d)), c, W, gap, [0.5] * contacts, directions=d, R=np.diag(stiff)
            )
            found = rw.solve(problem)
            if sign > 0.0:
                assert found.status == "unsupported"
                continue
            assert found.status in ("solved", "not_converged")
            if found.status == "solved":
                assert found.r[::d].min() >= -1e-7 * load
                np.testing.assert_allclose(W.T @ found.r, -c, rtol=0, atol=1e-7 * load)


@pytest.mark.parametrize("family", planted.FAMILIES)
def test_a_start_that_is_a_solution_is_the_answer(family: str) -> None:
    rng = np.random.default_rng(12)
    for _ in range(60):
        problem, x = planted.plant(rng, planted.FAMILIES[family](rng))
        found = rw.solve(problem, start=x)
        assert found.status == "solved" and found.attempts == ()
        np.testing.assert_array_equal(found.x, x)


def test_certificates_are_those_of_the_problem_as_it_was_given() -> None:
    """Walls that close on a body, behind joints: the multipliers of the eliminated rows follow."""
    rng = np.random.default_rng(13)
    for _ in range(20):
        turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
        W = np.vstack([turn[0], -turn[0]])
        problem = rw.Problem.balance(
            np.diag(10.0 ** rng.uniform(-3.0, 3.0, 4)), rng.normal(size=4), W, [-1.0, -0.5], [0.0, 0.0],
            directions=1, S=turn[1:2], w_s=[0.3],
        )  # fmt: skip
        found = rw.solve(problem)
        assert found.status == "jammed" and found.certificate is not None
        system, proof = scaled(problem, found.massless), found.certificate
        assert proves(problem, system, proof)
        wrong = proof.vectors[0].copy()
        wrong[0] *= 1.0 + 1e-3
        assert not proves(problem, system, Infeasible(proof.kind, proof.modes, (wrong,)))
        apart = problem.b + 3.0 * np.eye(7)[1]
        other = rw.Problem(problem.A, apart, problem.mu, 1, problem.lower, problem.upper, 4)
        assert not excludes_given(other, scaled(other), proof.modes[0], proof.vectors[0])
