"""`solve` on problems whose answer is known by hand, and on thousands that nobody chose."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.analysis.pieces import check as check_solutions
from rungwise.contact.judge.farkas import Infeasible, check
from rungwise.contact.judge.residuals import judge
from rungwise.contact.prepare.system import scaled
from rungwise.contact.step.problem import ContactProblem, allocate_problem

ONE = np.diag([2.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("mu", "force", "rate"),
    [
        (1.0, [0.5, 0.4, 0.0], [0.0, 0.0, 0.0]),  # sticks: 0.4 < 1.0 * 0.5
        (0.5, [0.5, 0.25, 0.0], [0.0, -0.15, 0.0]),  # slides at mu r_n, against the force
        (0.0, [0.5, 0.0, 0.0], [0.0, -0.4, 0.0]),
    ],
)
def test_one_contact_in_space(mu: float, force: list[float], rate: list[float]) -> None:
    problem = rw.Problem.local(ONE, [-1.0, -0.4, 0.0], [mu])
    found = rw.solve(problem)
    assert found.status == "solved"
    np.testing.assert_allclose(found.r, force, atol=1e-8)
    np.testing.assert_allclose(found.u, rate, atol=1e-8)


def test_one_contact_of_any_matrix() -> None:
    rng = np.random.default_rng(5)
    for case in range(300):
        rows, turn = rng.normal(size=(3, 3)), 0.1 * rng.normal(size=(3, 3))
        block = rows @ rows.T + 0.1 * np.eye(3) + (case % 2) * (turn - turn.T)
        rate = rng.normal(size=3) - [3.0, 0.0, 0.0]
        problem = rw.Problem.local(block, rate, [10.0 ** rng.uniform(-6.0, 0.5)])
        assert rw.solve(problem).status == "solved", case


def test_unknowns_that_do_not_depend_on_each_other() -> None:
    found = rw.solve(rw.Problem.lcp(np.diag([2.0, 1.0, 4.0]), [-1.0, 3.0, -2.0]))
    np.testing.assert_allclose(found.x, [0.5, 0.0, 0.5])


def test_a_contact_that_opens_carries_nothing() -> None:
    found = rw.solve(rw.Problem.local(ONE, [1.0, -0.4, 0.3], [0.7]))
    assert found.status == "solved"
    np.testing.assert_array_equal(found.r, 0.0)
    np.testing.assert_array_equal(found.u, [1.0, -0.4, 0.3])


@pytest.mark.parametrize(
    ("M", "q", "z"),
    [
        ([[2.0, 1.0], [1.0, 2.0]], [-5.0, -6.0], [4 / 3, 7 / 3]),
        ([[0.0, 1.0], [-1.0, 0.0]], [-1.0, 1.0], [1.0, 1.0]),
        (np.eye(3), [1.0, -2.0, 0.0], [0.0, 2.0, 0.0]),
    ],
)
def test_lcp(M: np.ndarray, q: list[float], z: list[float]) -> None:
    found = rw.solve(rw.Problem.lcp(M, q))
    assert found.status == "solved"
    np.testing.assert_allclose(found.z, z, atol=1e-9)


def test_limits_hold_and_rates_push_against_them() -> None:
    found = rw.solve(rw.Problem.boxes(np.eye(3), [-5.0, 0.2, 5.0], [-1.0] * 3, [1.0] * 3))
    np.testing.assert_allclose(found.z, [1.0, -0.2, -1.0])
    np.testing.assert_allclose(found.y, [-4.0, 0.0, 4.0], atol=1e-12)


def test_mixed_form_equals_its_local_form() -> None:
    rng = np.random.default_rng(3)
    H, W, c, w = (
        np.diag([1.0, 2.0, 3.0, 4.0]),
        rng.normal(size=(6, 4)),
        rng.normal(size=4),
        rng.normal(size=6),
    )
    mu = np.array([0.3, 0.8])
    local = rw.solve(rw.Problem.local(W @ np.linalg.inv(H) @ W.T, W @ np.linalg.inv(H) @ c + w, mu))
    for wrap in (np.asarray, sp.csr_array):
        mixed = rw.solve(rw.Problem.balance(wrap(H), c, wrap(W), w, mu))
        assert mixed.status == local.status == "solved"
        np.testing.assert_allclose(mixed.u, local.u, atol=1e-8)
        np.testing.assert_allclose(H @ mixed.v, c + W.T @ mixed.r, atol=1e-10)


@pytest.mark.parametrize("form", [np.asarray, sp.csr_array])
def test_forms_of_the_matrices_do_not_matter(form: Callable[[np.ndarray], object]) -> None:
    """A box of 2 kg on a compliant contact: rate -1 + r / 2 + 0.5 r = 0."""
    H, W, R = form(np.diag([2.0, 2.0])), form(np.eye(2)), form(0.5 * np.eye(2))
    found = rw.solve(rw.Problem.balance(H, [-2.0, 0.0], W, [0.0, 0.0], [0.5], directions=2, R=R))
    np.testing.assert_allclose(found.r, [1.0, 0.0], atol=1e-8)


def test_a_joint_holds_and_a_drive_slips_at_its_limit() -> None:
    problem = rw.Problem.balance(
        np.eye(2), [3.0, -4.0], np.zeros((0, 2)), [], [], S=np.eye(2), w_s=[0.0, 0.0], F=[np.inf, 1.5]
    )
    found = rw.solve(problem)
    np.testing.assert_allclose(found.v, [0.0, -2.5], atol=1e-9)
    np.testing.assert_allclose(found.z, [-3.0, 1.5], atol=1e-9)


def test_singular_inertia_is_solved_in_the_mixed_form() -> None:
    """A massless tray between a servo and a floor: the servo's push of 2 is the floor's force."""
    problem = rw.Problem.balance(np.zeros((1, 1)), [-2.0], [[1.0]], [0.0], [0.0], directions=1)
    found = rw.solve(problem)
    assert found.status == "solved"
    np.testing.assert_allclose([found.r[0], found.v[0]], [2.0, 0.0], atol=1e-9)


def pushed(directions: int, inertia: float) -> rw.Problem:
    """A unit box on a floor, pushed from the left at 0.1, with so much inertia."""
    E = np.eye(directions)
    floor = [np.array([*corner, -0.5]) for corner in product((-0.5, 0.5), repeat=directions - 1)]
    side = np.array([-0.5, *[0.0] * (directions - 1)])
    rows = []
    for point, normal in [*((corner, directions - 1) for corner in floor), (side, 0)]:
        for axis in [normal, *(axis for axis in range(directions) if axis != normal)]:
            turn = np.cross(np.append(point, 0.0)[:3], np.append(E[axis], 0.0)[:3])
            rows.append([*E[axis], *turn[-1 if directions == 2 else 0 :]])
    w = np.zeros(len(rows))
    w[-directions] = -0.1
    load = np.zeros(len(rows[0]))
    load[directions - 1] = -9.81
    friction = [0.3] * len(floor) + [0.2]
    return rw.Problem.balance(
        inertia * np.eye(len(load)), load, np.array(rows), w, friction, directions=directions
    )


@pytest.mark.parametrize("inertia", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("directions", [2, 3])
def test_velocities_are_exact_however_small_inertia_is(directions: int, inertia: float) -> None:
    problem = pushed(directions, inertia)
    found = rw.solve(problem)
    assert found.status == "solved"
    scale = 0.0 if inertia < 1e-5 else 1e-9 * 9.81 / inertia  # beside these rates the residual is measured
    np.testing.assert_allclose(found.v, [0.1, *[0.0] * (len(found.v) - 1)], rtol=0, atol=1e-10 + scale)


@pytest.mark.few(10)
@pytest.mark.parametrize("wrap", [np.asarray, sp.csr_array])
@pytest.mark.parametrize("load", [0.0, 2.0, 6.0])
@pytest.mark.parametrize("inertia", [1e3, 1e-3, 1e-9])
@pytest.mark.parametrize("noise", [0.0, 1e-18, 1e-15, 1e-13, 1e-11, 1e-9])
def test_demands_of_rounding_size_change_no_verdict(
    noise: float, inertia: float, load: float, wrap: Callable[[np.ndarray], object]
) -> None:
    """A box of weight 9.81 on two points, mu 0.5: rests at 2, slides at (6 - 4.905) / H."""
    noise *= 1e3 / inertia
    W = np.array([[0.0, 1.0, -0.5], [1.0, 0.0, 0.1], [0.0, 1.0, 0.5], [1.0, 0.0, 0.1]])
    w = noise * np.array([1.0, -0.3, 0.7, 0.2])
    problem = rw.Problem.balance(
        wrap(inertia * np.diag([1.0, 1.0, 0.1])), [load, -9.81, 0.0], wrap(W), w, [0.5, 0.5], directions=2
    )
    found = rw.solve(problem)
    speed = max(0.0, load - 0.5 * 9.81) / inertia
    assert found.status == "solved"
    np.testing.assert_allclose(found.v[0], speed, atol=2.0 * noise + 1e-9 * 9.81 / inertia)
    np.testing.assert_allclose(found.r[::2].sum(), 9.81, rtol=1e-5)
    if noise > 0.0:
        assert (found.u[::2] >= -1e-6 * max(speed, noise)).all()
    if load == 6.0:
        known = rw.solutions(problem)
        assert known.kind == "unique" and check_solutions(known)


def test_walls_that_close_slowly_on_next_to_no_inertia_jam_with_proof() -> None:
    problem = rw.Problem.balance(
        1e-12 * np.eye(2), [0.0, -9.81], [[1.0, 0.0], [-1.0, 0.0]], [-0.1, -0.1], [0.0, 0.0], directions=1
    )
    found = rw.solve(problem)
    assert found.status == "jammed" and found.certificate is not None
    assert check(scaled(problem, found.massless), found.certificate)
    known = rw.solutions(problem)
    assert known.kind == "none" and check_solutions(known)


def test_units_do_not_matter() -> None:
    rng = np.random.default_rng(5)
    G = rng.normal(size=(9, 4))
    W, q, mu = G @ G.T, G @ rng.normal(size=4), np.array([0.2, 0.5, 0.9])
    s = np.repeat([1e-5, 1.0, 1e4], 3)
    plain = rw.solve(rw.Problem.local(W, q, mu))
    other = rw.solve(rw.Problem.local(1e-3 * W * s[:, None] * s, q * s, mu))
    assert plain.status == other.status == "solved"
    np.testing.assert_allclose(other.u / s, plain.u, atol=1e-7)


def test_a_start_at_the_answer_is_the_answer() -> None:
    problem = rw.Problem.local(ONE, [-1.0, -0.4, 0.0], [0.5])
    cold = rw.solve(problem)
    warm = rw.solve(problem, start=cold.x)
    assert warm.attempts == ()
    np.testing.assert_allclose(warm.x, cold.x, rtol=0, atol=1e-15)


def test_squeezed_between_two_walls_is_jammed_with_proof() -> None:
    """One coordinate, two rigid walls that both come nearer: no speed is admissible."""
    problem = rw.Problem.balance(np.eye(1), [0.0], [[1.0], [-1.0]], [-1.0, -1.0], [0.0, 0.0], directions=1)
    found = rw.solve(problem)
    assert found.status == "jammed" and found.certificate is not None
    system, proof = scaled(problem), found.certificate
    assert check(system, proof)
    for i in range(system.size):
        wrong = proof.vectors[0].copy()
        wrong[i] += 1e-3
        assert not check(system, Infeasible(proof.kind, proof.modes, (wrong,)))
    assert not check(system, Infeasible(proof.kind, (), ()))


def test_walls_that_part_are_no_jam_though_forces_that_pull_would_prove_it() -> None:
    def between(speed: float) -> rw.Problem:
        walls = [[1.0], [-1.0]]
        return rw.Problem.balance(np.eye(1), [0.0], walls, [speed, speed], [0.0, 0.0], directions=1)

    proof = rw.solve(between(-1.0)).certificate
    assert proof is not None and rw.solve(between(1.0)).status == "solved"
    pulls = Infeasible(proof.kind, proof.modes, tuple(-p for p in proof.vectors))
    assert not check(scaled(between(1.0)), pulls)


@pytest.mark.parametrize("speed", [-0.3, 0.3])
def test_penetration_is_how_fast_a_gap_closes_beyond_contact(speed: float) -> None:
    problem = rw.Problem.balance(np.eye(1), [speed], [[1.0]], [0.0], [0.0], directions=1)
    found = judge(problem, scaled(problem), np.array([0.0, speed]))
    assert found.penetration == pytest.approx(max(0.0, -speed)) and (found.worst > 0.1) == (speed < 0.0)


def test_a_load_that_nothing_carries_is_unsupported() -> None:
    problem = rw.Problem.balance(np.zeros((2, 2)), [0.0, -1.0], [[1.0, 0.0]], [0.0], [0.0], directions=1)
    assert rw.solve(problem).status == "unsupported"


@pytest.mark.parametrize("limit", [0.0, 1e-8])
@pytest.mark.parametrize("load", [1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("speed", [0.0, 1.0, 1e4, 1e8])
def test_what_a_drive_cannot_give_supports_no_load(limit: float, load: float, speed: float) -> None:
    inertia, none = np.diag([0.0, 1.0]), np.zeros((0, 2))
    found = rw.solve(
        rw.Problem.balance(inertia, [load, 0.0], none, [], [], S=[[1.0, 1.0]], w_s=[speed], F=[limit])
    )
    assert found.status != "solved"


def test_feasible_but_unsolvable_is_proved_mode_by_mode() -> None:
    """w1 = z2 - 1, w2 = 1 - z1: feasible, yet z1 = 1 forces z2 = 1 while w2 > 0 forbids it below."""
    problem = rw.Problem.lcp([[0.0, 1.0], [0.0, 0.0]], [-1.0, 1.0])
    found = rw.solve(problem)
    assert found.status == "jammed" and found.certificate is not None and len(found.certificate.modes) > 1
    assert check(scaled(problem), found.certificate)
    fewer = Infeasible("jammed", found.certificate.modes[1:], found.certificate.vectors[1:])
    assert not check(scaled(problem), fewer)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("W", {"W": np.full((3, 3), np.nan)}),
        ("W", {"W": np.eye(4)}),
        ("W", {"W": np.zeros(3)}),
        ("W", {"W": [["a"] * 3] * 3}),
        ("q", {"q": [np.inf, 0.0, 0.0]}),
        ("q", {"q": [0.0, 0.0]}),
        ("mu", {"mu": [-0.1]}),
        ("mu", {"mu": [np.nan]}),
        ("directions", {"directions": 4}),
    ],
)
def test_wrong_fields_are_named(field: str, change: dict[str, object]) -> None:
    fields: dict[str, object] = {"W": ONE, "q": [-1.0, 0.0, 0.0], "mu": [0.5]}
    with pytest.raises(ValueError, match=f"^{field}:"):
        rw.Problem.local(**{**fields, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [[[1.0]], np.eye(4)[::2, ::2]])
def test_a_step_holds_contiguous_arrays(given: object) -> None:
    arrays = {name: np.zeros(1) for name in ContactProblem.__annotations__}
    with pytest.raises(TypeError, match=r"^ContactProblem\.H: must be a C-contiguous array"):
        ContactProblem(**{**arrays, "H": given})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("c", np.array([0, -1])),
        ("H", np.eye(2, dtype=np.float32)),
        ("c", np.ma.array([0.3, -1.0], mask=[False, True])),
        ("mu", np.array(0.5)),
        ("R", np.zeros((2, 2))),
        ("quantum", np.array([np.nan])),
        ("quantum", np.array([-1.0])),
        ("quantum", np.zeros(0)),
    ],
)
def test_wrong_fields_of_a_step_are_named(field: str, value: np.ndarray) -> None:
    p = allocate_problem(2, 1, 0)
    fields = {name: getattr(p, name) for name in ContactProblem.__annotations__}
    with pytest.raises(ValueError, match=f"^{field}:"):
        rw.solve(ContactProblem(**{**fields, "H": np.eye(2), field: value}))


def held(**rows: object) -> rw.Problem:
    """One velocity, no contact, and these limited rows."""
    return rw.Problem.balance(np.eye(1), [0.0], np.zeros((0, 1)), [], [], **rows)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("lower", lambda: rw.Problem.boxes(np.eye(1), [0.0], [1.0], [0.0])),
        ("upper", lambda: rw.Problem.boxes(np.eye(1), [0.0], [np.inf], [np.inf, 1.0])),
        ("F", lambda: held(S=[[1.0]], w_s=[0.0], F=[-1.0])),
        ("q", lambda: rw.Problem.lcp(np.eye(1), np.array(["2020-01-01"], "M8[s]"))),
        ("q", lambda: rw.Problem.lcp(np.eye(1), ["1.0"])),
        ("S", lambda: held(S=[[1.0, 2.0]], w_s=[0.0])),
        ("complementary", lambda: rw.Problem.mlcp(np.eye(2), [0.0, 0.0], [True])),
        ("tol", lambda: rw.solve(rw.Problem.lcp(np.eye(1), [1.0]), tol=np.nan)),
        ("start", lambda: rw.solve(rw.Problem.lcp(np.eye(1), [1.0]), start=np.zeros(2))),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(field: str, make: object) -> None:
    with pytest.raises(ValueError, match=f"^{field}:"):
        make()  # type: ignore[operator]


def test_many_limits_on_a_rank_deficient_matrix() -> None:
    rng = np.random.default_rng(0)
    G = rng.normal(size=(120, 60))
    problem = rw.Problem.boxes(G @ G.T, rng.normal(size=120), -rng.random(120), rng.random(120))
    found = rw.solve(problem)
    assert found.status == "solved"
    np.testing.assert_allclose(
        found.z, np.clip(found.z - found.y / 60.0, problem.lower, problem.upper), atol=1e-9
    )


def test_sizes_beyond_double_precision_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^A:"):
        rw.solve(rw.Problem.local(1e-300 * ONE, [-1e300, 0.0, 0.0], [0.5]))


@pytest.mark.parametrize("speed", [0.0, 1e6, 1e12, 1e80])
def test_a_drive_without_force_changes_nothing_however_fast(speed: float) -> None:
    rng = np.random.default_rng(0)
    step = rng.normal(size=(12, 6)), rng.normal(size=6)
    fields = {"H": np.eye(6), "c": step[1], "W": step[0], "w": np.zeros(12), "mu": [0.5] * 4}
    without = rw.solve(rw.Problem.balance(**fields))
    idle = {"S": rng.normal(size=(1, 6)), "w_s": [speed], "F": [0.0]}
    found = rw.solve(rw.Problem.balance(**fields, **idle))
    assert found.status == "solved"
    np.testing.assert_allclose(found.v, without.v, atol=1e-8)


@pytest.mark.parametrize("compliance", 10.0 ** np.array([-22, -12, 0, 12, 18]))
@pytest.mark.parametrize("most", [-1.0, -2.0])
def test_forces_that_are_prescribed_make_the_units_where_nothing_moves(
    compliance: float, most: float
) -> None:
    rows = np.random.default_rng(1).normal(size=(7, 6))
    A = compliance * (rows @ rows.T + 0.1 * np.eye(7))
    found = rw.solve(rw.Problem(A, np.zeros(7), [0.5, 0.5], 3, [-2.0], [most]))
    assert found.status == "solved"
    np.testing.assert_allclose(found.z, [most], atol=1e-9)


@pytest.mark.parametrize(("rate", "force"), [(1.0, 1.0), (2e-7, 4e8), (1e6, 1e-6)])
def test_what_jams_without_loads_or_inertia_does_so_in_all_units(rate: float, force: float) -> None:
    problem = rw.Problem.balance(
        np.zeros((2, 2)), [0.0, 0.0], [[-0.3, -0.7], [0.0, 0.0], [0.2, 0.0], [0.0, 0.0]], [0.0] * 4,
        [1.0, 1.0], directions=2, S=[[0.0, 0.0], [0.0, -1.5]], w_s=[2.0 * rate, 0.5 * rate],
        R_s=[0.1 * rate / force, 0.0], F=[0.0, np.inf],
    )  # fmt: skip
    assert rw.solve(problem).status == "jammed"


@pytest.mark.parametrize("size", [1.0, 1e6, 1e9, 1e11])
@pytest.mark.parametrize("directions", [1, 2, 3])
def test_fast_contacts_hide_nothing_of_slow_ones_that_they_do_not_touch(directions: int, size: float) -> None:
    rng = np.random.default_rng(3)
    rows, rates = rng.normal(size=(2, 2 * directions, 4)), rng.normal(size=(2, 2 * directions))
    slow, fast = (own @ own.T + 0.05 * np.eye(len(own)) for own in rows)
    mu = [0.5, 0.5]
    alone = rw.solve(rw.Problem.local(slow, rates[0], mu, directions))
    whole = np.block([[slow, np.zeros(fast.shape)], [np.zeros(fast.shape), fast]])
    found = rw.solve(rw.Problem.local(whole, np.concatenate([rates[0], size * rates[1]]), mu * 2, directions))
    assert found.status == "solved"
    np.testing.assert_allclose(found.u[: 2 * directions], alone.u, atol=1e-5)


@pytest.mark.few(5)
@pytest.mark.parametrize("size", 10.0 ** np.arange(0, 13, 3))
@pytest.mark.parametrize("form", ["lcp", "contacts"])
def test_nor_solutions_that_are_none_nor_that_there_are_several(size: float, form: str) -> None:
    def made(q: float) -> rw.Problem:
        M, rates = np.diag([-1.0, 1.0]), [q, -size]
        return rw.Problem.lcp(M, rates) if form == "lcp" else rw.Problem.local(M, rates, [0.0, 0.0], 1)

    none, two = made(-1.0), made(1.0)
    assert rw.solve(none).status in ("jammed", "not_converged")
    assert rw.solutions(none).kind in ("none", "undecided")
    found = rw.solutions(two)
    assert found.kind in ("motion-indeterminate", "undecided") and check_solutions(found)
    assert size > 1e5 or (rw.solutions(none).kind, found.kind) == ("none", "motion-indeterminate")


@pytest.mark.parametrize("friction", [1e2, 1e4, 1e6, 1e10, 1e14, 1e300])
@pytest.mark.parametrize("tol", [1e-3, 1e-9])
def test_penetration_is_not_solved_however_great_friction_is(friction: float, tol: float) -> None:
    found = rw.solve(rw.Problem.local(np.diag([2.0, 1.0, 1.0]), [-1.0, -0.4, 0.0], [friction]), tol=tol)
    if friction < 1e6 or found.status == "solved":
        assert found.status == "solved"
        assert found.residuals.penetration <= 2.0 * tol
        assert np.allclose(found.r, [0.5, 0.4, 0.0], rtol=0.0, atol=2.0 * tol)


@pytest.mark.parametrize("size", [1e-120, 1e-160, 1e-200, 1e-280])
def test_numbers_whose_squares_vanish_are_solved(size: float) -> None:
    found = rw.solve(rw.Problem.local(np.diag([2.0, 1.0, 1.0]), size * np.array([-1.0, -0.4, 0.0]), [0.5]))
    assert found.status == "solved"
    assert np.allclose(found.r / size, [0.5, 0.25, 0.0])


def test_forces_below_what_can_be_told_from_zero_are_refused() -> None:
    with pytest.raises(ValueError, match="A: its sizes"):
        rw.solve(rw.Problem.local(1e200 * np.diag([2.0, 1.0, 1.0]), [-1e-200, -4e-201, 0.0], [0.5]))


@pytest.mark.few(40)
@pytest.mark.parametrize("seed", range(200))
def test_what_joints_hold_still_demands_nothing_in_any_units(seed: int) -> None:
    rng = np.random.default_rng(seed)
    H, W, S = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    H = 1e3 * (H @ H.T + 0.1 * np.eye(2))
    unit, joint = 2.0 ** rng.integers(-12, 13, 2), 2.0 ** rng.integers(-12, 13, 2)
    found = rw.solve(
        rw.Problem.balance(
            unit[:, None] * H * unit, unit * rng.normal(size=2), W * unit, [0.0, 0.0], [0.5],
            directions=2, S=joint[:, None] * S * unit, w_s=[0.0, 0.0],
        )
    )  # fmt: skip
    assert found.status == "solved"


def test_steps_as_models_assemble_them(
    random_problem: Callable[..., ContactProblem], measure: Callable[..., float]
) -> None:
    """The step's own residual, written for the compiled loop, agrees that the laws hold."""
    rng, solved = np.random.default_rng(2), 0
    for _ in range(60):
        step = random_problem(rng)
        found = rw.solve(step)
        assert found.status != "not_converged"
        if found.status == "solved":
            solved += 1
            assert measure(step, found.v, found.r, found.z) <= 1e-6
        else:
            assert found.certificate is not None and check(scaled(found.problem), found.certificate)
    assert solved > 40


def test_lcps_of_few_unknowns_are_solved_whatever_their_matrix() -> None:
    """Any matrix, and an offset for which there is a solution."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        n = int(rng.integers(2, 11))
        M, carries = rng.normal(size=(n, n)), rng.random(n) < 0.5
        z, w = np.where(carries, rng.random(n), 0.0), np.where(carries, 0.0, rng.random(n))
        found = rw.solve(rw.Problem.lcp(M, w - M @ z))
        assert found.status == "solved" and found.residuals.worst <= 1e-9


def has_solution(M: np.ndarray, q: np.ndarray) -> bool:
    """By all 2^n sets of unknowns that may be positive."""
    for chosen in product((False, True), repeat=len(q)):
        own, z = np.array(chosen), np.zeros(len(q))
        z[own] = np.linalg.solve(M[np.ix_(own, own)], -q[own])
        w = M @ z + q
        if (z >= 0.0).all() and (w[~own] >= 0.0).all():
            return True
    return False


@pytest.mark.parametrize("seed", [1248, 1554, 3037, 5184, 8946])
def test_unknowns_that_only_rounding_keeps_from_zero_do_not_count(seed: int) -> None:
    """In a row whose terms are all zero but for rounding, rates are as large as terms."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 15))
    rows = np.round(rng.normal(size=(n, n // 2 if seed == 3037 else n)))
    M = rows @ rows.T if seed == 3037 else rows
    found = rw.solve(rw.Problem.lcp(M, np.round(rng.normal(size=n))))
    assert found.status == "solved"


@pytest.mark.parametrize("count", [50, pytest.param(150, marks=pytest.mark.long)])
def test_what_has_no_solution_is_not_solved_in_any_units_of_rows_and_unknowns(count: int) -> None:
    rng, seen = np.random.default_rng(4), {True: 0, False: 0}
    for _ in range(count):
        n = int(rng.integers(2, 5))
        M, q = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2, 2, (n, n)), rng.normal(size=n)
        rows, unknowns = 10.0 ** rng.uniform(-5, 5, (2, n))
        found = rw.solve(rw.Problem.lcp(rows[:, None] * M * unknowns, rows * q))
        solvable = has_solution(M, q)
        seen[solvable] += 1
        assert (found.status == "solved") == solvable
        if solvable:
            z = found.z * unknowns
            w, terms = M @ z + q, np.abs(M) @ np.abs(z) + np.abs(q)
            assert (w >= -1e-5 * terms).all()
            assert (
                np.minimum(np.abs(w) / terms, np.abs(z) * (np.abs(M) / terms[:, None]).max(axis=0)) < 1e-5
            ).all()
    assert min(seen.values()) > count / 5


@pytest.mark.few(3)
@pytest.mark.parametrize("ratio", [1e4, 1e8, 1e10, 1e12, 1e14, 1e16])
@pytest.mark.parametrize("bodies", [2, 3, 5])
@pytest.mark.parametrize("directions", [1, 2, 3])
def test_the_heaviest_body_on_the_lightest_is_never_said_to_jam(
    directions: int, bodies: int, ratio: float
) -> None:
    """Each stands on the one before, and the lowest carries all: there is that solution."""
    mass, axis = np.logspace(0.0, np.log10(ratio), bodies), np.eye(directions)
    problem = rw.Problem.balance(
        np.kron(np.diag(1e3 * mass), axis), np.kron(-9.81 * mass, axis[0]),
        np.kron(np.eye(bodies) - np.eye(bodies, k=-1), axis), np.zeros(bodies * directions),
        np.full(bodies, 0.5), directions=directions,
    )  # fmt: skip
    found = rw.solve(problem)
    assert found.status in ("solved", "not_converged")
    if directions == 1 or (directions == 2 and bodies < 5):  # more have modes by the hundred
        assert rw.solutions(problem).kind != "none"
    if found.status == "solved":
        np.testing.assert_allclose(found.r[0], 9.81 * mass.sum(), rtol=1e-2)


@pytest.mark.long
def test_many_velocities_without_inertia_are_unsupported_without_a_word(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """More velocities than contact rows: nothing balances the loads, and matrices are singular by pattern."""
    rng = np.random.default_rng(0)
    W, load = rng.normal(size=(90, 120)), rng.normal(size=120)
    found = rw.solve(rw.Problem.balance(np.zeros((120, 120)), load, W, rng.normal(size=90), np.full(30, 0.5)))
    assert found.status == "unsupported" and found.certificate is not None
    assert check(scaled(found.problem), found.certificate)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("small", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_contact_that_hardly_asks_for_anything_is_heard_beside_one_that_asks_for_much(small: float) -> None:
    """Without a force for it the laws do not hold, however little its rate is beside that of the other."""
    problem = rw.Problem.local(np.eye(6), [-1.0, 0.0, 0.0, -small, 0.0, 0.0], [0.5, 0.5])
    unheard, heard = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, small, 0.0, 0.0])
    assert judge(problem, scaled(problem), unheard).worst > 1e-3
    assert judge(problem, scaled(problem), heard).worst < 1e-12
    found = rw.solve(problem, start=unheard)
    assert found.status == "solved"
    np.testing.assert_allclose(found.x, heard, rtol=1e-8, atol=1e-20)
