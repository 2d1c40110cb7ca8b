"""Numbers that verdicts and acceptance turn at, from both sides: a case within and one beyond, a decade from
each number or little more."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import rungwise as rw
from rungwise.contact.analysis.all_solutions import _inside as inside
from rungwise.contact.analysis.closure import Closure
from rungwise.contact.analysis.closure import check as closes
from rungwise.contact.analysis.monotone import Demands, is_monotone
from rungwise.contact.analysis.pieces import Polyhedron, dimensions, holds_in_own_terms, motion_map, same
from rungwise.contact.analysis.sensitivity import Sensitivity, _clear_inverse
from rungwise.contact.exact import _inverse as inverse
from rungwise.contact.exact import calmed
from rungwise.contact.judge.certificate import Certificate
from rungwise.contact.judge.certificate import check as certified
from rungwise.contact.judge.farkas import HULL, _lifting, excludes, excludes_given
from rungwise.contact.judge.residuals import imbalance, judge, own_terms
from rungwise.contact.linear import solve_in_place
from rungwise.contact.measure import natural
from rungwise.contact.prepare.elimination import eliminated as without_free
from rungwise.contact.prepare.equivalent import in_contacts
from rungwise.contact.prepare.system import scaled
from rungwise.contact.prepare.units import measured
from rungwise.contact.problem import Problem
from rungwise.contact.step.problem import ContactProblem, allocate_problem
from rungwise.deadline import NEVER

Number = Callable[[float], Any]
NONE = np.zeros(0)


def planes(*rows: tuple[float, ...]) -> Problem:
    """An LCP of this matrix without loads."""
    return Problem.lcp(np.array(rows), np.zeros(len(rows)))


def in_a_polyhedron(e: float) -> bool:
    return Polyhedron(np.eye(1), np.zeros(1), np.zeros((0, 1)), NONE).contains(np.array([e]))


def cancels(e: float) -> bool:
    wrenches = np.column_stack([np.eye(3), -np.ones(3)])
    return closes(Closure(True, wrenches, np.array([1.0, 1.0, 1.0, 1.0 + e]), 1.0, np.zeros(2), 1.0))


def holds_in_its_own_terms(e: float) -> bool:
    return holds_in_own_terms(Problem.lcp(np.eye(1), np.array([-1.0])), np.array([1.0 + e]))


def does_not_move(e: float) -> bool:
    """Whether a coordinate that a force moves by so little beside the one that it reads does not move."""
    A = np.array([[0.0, 1.0, 1.0], [-1.0, 1.0, 0.0], [-e, 0.0, 1.0]])
    free = np.full(2, np.inf)
    problem = Problem(A, np.array([-1.0, 0.0, 0.0]), np.zeros(1), 1, -free, free, 2)
    return not motion_map(problem, scaled(problem))[0][1].any()


def resting(*gaps: float, slope: float = 0.0) -> ContactProblem:
    """Contacts without friction of two coordinates, of which the last is turned by `slope`."""
    p = allocate_problem(2, len(gaps), 0)
    p.H[:] = np.eye(2)
    p.w[::2] = gaps
    p.W[::2, 0] = 1.0
    p.W[-2, 1] = slope
    return p


def is_weak(e: float) -> bool:
    p = resting(0.0, 0.0, slope=1.0)
    return 1 in Sensitivity(p, np.zeros(2), np.array([1.0, 0.0, e, 0.0]), NONE).weak


def shares_load(e: float) -> bool:
    p = resting(0.0, 0.0, slope=np.sqrt(e))
    return not Sensitivity(p, np.zeros(2), np.array([1.0, 0.0, 1.0, 0.0]), NONE).forces_determined


def gets_no_share(e: float) -> bool:
    """Whether the force of a third contact, of which the others share e of the load, counts as determined."""
    p = resting(0.0, 0.0, 0.0)
    p.W[2], p.W[4] = (1.0, e), (0.0, 1.0)
    found = Sensitivity(p, np.zeros(2), np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0]), NONE)
    return bool(np.isfinite(found.forward(c=np.array([0.0, 1.0])).force[4]))


def has_a_gradient(e: float) -> bool:
    found = Sensitivity(resting(0.0, 0.0), np.zeros(2), np.array([1.0, 0.0, 1.0, 0.0]), NONE)
    try:
        found.gradient(force=np.array([1.0, 0.0, 1.0 + e, 0.0]))
    except ValueError:
        return False
    return True


def agrees(e: float) -> bool:
    found = Sensitivity(resting(0.0, 0.0), np.zeros(2), np.array([1.0, 0.0, 1.0, 0.0]), NONE)
    w = np.array([1e-4, 0.0, 1e-4 + e, 0.0])
    return bool(np.isfinite(found.forward({"w": np.ones(4)}, w=w).v).all())


def does_not_close(e: float) -> bool:
    """Whether a contact is not closed by two speeds of one whose sum is -e."""
    p = allocate_problem(2, 1, 0)
    p.H[:], p.W[0] = np.eye(2), 1.0
    found = Sensitivity(p, np.zeros(2), np.zeros(2), NONE).forward(c=np.array([1.0, -1.0 - e]))
    return not found.force.any()


def is_left_out(e: float) -> bool:
    """Whether a proof without rounding leaves out a multiplier that adds e / 2 to the pull of another one."""
    A = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [1.0, e, 1.0]])
    problem, system = SimpleNamespace(A=A, b=np.zeros(3)), SimpleNamespace(kept=np.zeros(1, np.int64))
    lift: Any = _lifting
    return bool(lift(problem, system)(np.ones(1))[1][2] == 0.0)


def yields_in_one_way(e: float) -> bool:
    R = np.diag([1.0, e])
    problem = Problem.balance(
        np.eye(1), np.ones(1), np.ones((2, 1)), np.zeros(2), np.ones(1), directions=2, R=R
    )
    return in_contacts(problem).velocities == 2


def is_symmetric(e: float) -> bool:
    R = np.array([[1.0, 0.5 + e], [0.5, 1.0]])
    problem = Problem.balance(
        np.eye(1), np.ones(1), np.ones((2, 1)), np.zeros(2), np.ones(1), directions=2, R=R
    )
    try:
        in_contacts(problem)
    except ValueError:
        return False
    return True


def eliminated(A: ArrayLike) -> tuple[bool, float]:
    """Whether the last unknowns of A can be eliminated, and what is left for the first."""
    n = len(np.array(A))
    left = without_free(Problem.mlcp(np.array(A), np.zeros(n), np.arange(n) == 0))
    return len(left.kept) == 1, float(left.matrix[0, 0])


def is_in_range(s: float, b: float) -> bool:
    one = np.empty(1)
    return bool(measured(np.array([s]), np.array([b]), NONE, NONE, 1, one, one.copy(), one.copy()))


def rank(e: float) -> int:
    a = np.array([[1.0, 0.0, 1.0], [0.0, e, 1.0]])
    return solve_in_place(a, 2, 1, np.empty(2, np.int64))


def shifted(large: float, e: float) -> float:
    """The residual of two unknowns so large, of which only the difference counts, and is wrong by e."""
    problem = Problem.lcp(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([1.0, -1.0]))
    return judge(problem, scaled(problem), np.array([large, large + 1.0 + e])).natural


def opposed(e: float) -> tuple[Problem, Any]:
    """Two rates that may not be negative; their sum is -e whatever the forces are. And the system."""
    problem = Problem.lcp(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, 1.0 - e]))
    return problem, scaled(problem)


def has_a_proof(e: float) -> bool:
    return excludes(opposed(e)[1], (HULL, HULL), np.ones(2))


def has_a_proof_as_given(e: float) -> bool:
    return excludes_given(*opposed(e), (HULL, HULL), np.ones(2))


def is_jammed(e: float) -> bool:
    """Whether forces of one prove that walls that approach each other at a rate e squeeze a body."""
    p = allocate_problem(1, 2, 0)
    p.H[:], p.W[::2, 0], p.w[::2] = 1.0, (1.0, -1.0), (-1.0, 1.0 - e)
    return certified(p, Certificate("kinematic", (np.ones(2),)))


def is_known(e: float) -> bool:
    """Whether an unknown can be eliminated whose response is known the worse, the smaller e is."""
    A = np.eye(21)
    A[1:, 1:], A[1:, 0] = nearly_singular(e), 1.0
    return eliminated(A)[0]


def nearly_singular(e: float) -> np.ndarray:
    """A symmetric matrix (20, 20) with eigenvalues 1 and one of e."""
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(20, 20)))[0]
    return np.asarray(turned @ np.diag([*np.ones(19), e]) @ turned.T)


def inverted(e: float) -> float:
    return float(np.abs(inverse(nearly_singular(e))).max())


def strict_sides(e: float) -> int:
    """How many of the sides of an interval of this length have points beyond them."""
    shape = Polyhedron(np.zeros((0, 1)), NONE, np.array([[1.0], [-1.0]]), np.array([0.0, -e]))
    found = inside(shape, NEVER)
    assert found is not None
    return int((found[1] == 0.0).sum())


def small_row(e: float) -> float:
    """The residual where a row beside one that is a million times larger misses e of its own terms."""
    b = np.array([-1.0, -1e-6])
    problem = Problem.local(np.eye(2), b, np.zeros(2), directions=1)
    return judge(problem, scaled(problem), np.array([1.0, 1e-6 * (1.0 + e)])).natural


def at_rest(terms: float) -> float:
    """What the terms of a row count as beside faint terms of one."""
    own = np.empty(1)
    own_terms(np.array([terms]), np.zeros(1), np.ones(1), 0, 1, own)
    return float(own[0])


SIDES: dict[str, tuple[Number, float, float]] = {
    "a point of a piece": (in_a_polyhedron, 1e-9, 1e-7),
    "a demand that is met": (lambda e: Demands((0,), (), ()).met(np.array([e])), 1e-9, 1e-7),
    "directions that move nothing": (
        lambda e: dimensions(np.array([[1.0, 0.0], [1.0, e]]), np.eye(2))[0] == 1, 1e-10, 1e-8
    ),
    "points that are one": (lambda e: same(np.zeros(1), np.array([e])), 1e-7, 1e-5),
    "a system that is monotone": (
        lambda e: is_monotone(scaled(planes((1.0, 1.0 + e), (1.0 + e, 1.0))), np.zeros((1, 2))), 1e-10, 1e-8
    ),
    "changes that move nothing": (
        lambda e: is_monotone(scaled(planes((1.0, 1.0), (1.0, 1.0))), np.array([[1.0, 1.0 + e]])), 1e-7, 1e-5
    ),
    "a row in its own terms": (holds_in_its_own_terms, 1e-7, 1e-5),
    "motion by rounding": (does_not_move, 1e-15, 1e-13),
    "forces that cancel": (cancels, 1e-10, 1e-8),
    "a weak contact": (is_weak, 1e-8, 1e-6),
    "contacts that share a load": (shares_load, 1e-12, 1e-10),
    "a share of nothing": (gets_no_share, 1e-8, 1e-6),
    "what is determined": (has_a_gradient, 1e-7, 1e-5),
    "changes that agree": (agrees, 1e-9, 1e-7),
    "a rate that is rounding": (does_not_close, 2e-13, 2e-11),
    "a multiplier that is rounding": (is_left_out, 2e-14, 2e-12),
    "a compliance of rank one": (yields_in_one_way, 1e-13, 1e-11),
    "a compliance that is symmetric": (is_symmetric, 1e-10, 1e-8),
    "a singular block": (
        lambda e: not eliminated(((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 1.0 + e)))[0], 1e-14, 1e-12
    ),
    "a difference of rounding": (
        lambda e: eliminated(((1.0 + e, 1.0), (1.0, 1.0)))[1] == 0.0, 8.9e-16, 1e-13
    ),
    "units within range": (lambda s: is_in_range(s, 1.0 / s), 1e139, 1e141),
    "forces below all numbers": (lambda f: not is_in_range(1e-139, f * 1e278), 1e-291, 1e-289),
    "an error that rounding hides": (lambda e: shifted(1e4, e) == 0.0, 5e-12, 1e-10),
    "unknowns that rounding may hide": (lambda large: shifted(large, 0.0) < 1e-8, 1e11, 1e13),
    "a response that is not known": (lambda e: not is_known(e), 2e-13, 1e-10),
    "a matrix without inverse": (lambda e: inverted(e) < 10.0, 5e-15, 1e-12),
    "an interval without inside": (lambda e: strict_sides(e) == 0, 1e-7, 1e-5),
    "a proof": (lambda e: not has_a_proof(e), 2e-10, 5e-8),
    "a proof from the given numbers": (lambda e: not has_a_proof_as_given(e), 2e-10, 2e-8),
    "a proof of a jam": (lambda e: not is_jammed(e), 2e-13, 2e-11),
    "a matrix of rank one": (lambda e: rank(e) == 1, 1e-14, 1e-12),
    "a violation that does not count": (lambda e: small_row(e) < 1e-13, 3e-10, 1e-8),
    "terms at rest": (lambda terms: at_rest(terms) > 1e-7, 1e-14, 1e-12),
    "an unknown that is rounding": (
        lambda e: calmed(Problem.lcp(np.eye(2), -np.ones(2)), np.array([1.0, e]))[1] == 0.0, 5e-16, 2e-14
    ),
}  # fmt: skip


@pytest.mark.few(10)
@pytest.mark.parametrize("what", SIDES)
def test_it_turns_between(what: str) -> None:
    holds, within, beyond = SIDES[what]
    assert holds(within) and not holds(beyond)


def exact_contact() -> float:
    problem = Problem.local(np.eye(1), np.array([-1.0]), np.zeros(1), directions=1)
    return judge(problem, scaled(problem), np.ones(1)).natural


SIZES: dict[str, tuple[Callable[[], float], float]] = {
    "no residual is better than rounding": (exact_contact, 2.0**-54),
    "no distance is": (lambda: natural(scaled(Problem.lcp(np.eye(1), -np.ones(1))), np.ones(1)), 2.0**-53),
    "terms at rest": (lambda: at_rest(1e-14), 1e-5),
    "a free row of faint terms": (
        lambda: 1.0 / imbalance(np.ones(1), np.zeros(1), np.zeros(1), np.ones(1), np.zeros(1, np.int64)), 1e-6
    ),
    "violations in own terms": (lambda: small_row(1e-5) / 1e-5, 0.03),
}  # fmt: skip


@pytest.mark.parametrize("what", SIZES)
def test_it_counts_as(what: str) -> None:
    found, about = SIZES[what]
    assert found() == pytest.approx(about, rel=0.8, abs=0.0)


def test_two_walls_squeeze_beyond_the_tolerance(
    body: Callable[..., ContactProblem], run: Callable[..., Any]
) -> None:
    for overlap, solved in ((1e-13, True), (1e-7, False)):
        p = body(1, 2)
        p.W[::2, 0], p.w[::2] = (1.0, -1.0), (-1.0, 1.0 - overlap)
        assert (run("planar", p)[0] == 0) == solved


def test_forces_count_beside_speeds_and_speeds_beside_forces(
    body: Callable[..., ContactProblem], measure: Callable[..., float]
) -> None:
    p = body(1, 1)
    p.H[:], p.W[0, 0] = 1.0, 1.0
    p.w[0] = 1.0  # open: a force counts beside the force that would change the speed by a millionth
    assert measure(p, [0.0], [1e-8, 0.0]) == pytest.approx(1e-2, rel=1e-6, abs=0.0)
    p.c[0] = -1.0
    for closing, counts_as in (
        (-1e-15, 1e-12),
        (-1e-13, 1.0),
    ):  # speeds that are rounding, and such as are not
        p.w[0] = closing
        assert measure(p, [0.0], [1.0, 0.0]) == pytest.approx(counts_as, rel=1e-6, abs=0.0)


@pytest.mark.parametrize(("error", "kept"), [(5e-10, True), (2e-9, False)])
def test_a_start_is_an_answer_up_to_an_error_of_a_billionth(error: float, kept: bool) -> None:
    found = rw.solve(rw.Problem.lcp(np.array([[2.0]]), np.array([-2.0])), start=np.array([1.0 + error]))
    assert found.status == "solved" and (found.attempts == ()) == kept


@pytest.mark.parametrize(("least", "is_clear"), [(1e-8, True), (5e-10, False)])
def test_a_matrix_is_inverted_by_elimination_where_its_condition_leaves_no_doubt(
    least: float, is_clear: bool
) -> None:
    """A hundred times what singular values of such a size may be, for two unknowns."""
    for scale in (1.0, 1e-6):
        found = _clear_inverse(scale * np.diag([1.0, least]))
        assert (found is not None) == is_clear
