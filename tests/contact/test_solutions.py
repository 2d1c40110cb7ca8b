"""All solutions of small problems: by hand, against exhaustive enumeration, under symmetry and units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

import rungwise as rw
from rungwise.contact.analysis.pieces import check
from rungwise.contact.files.read import read_problem
from rungwise.contact.judge import farkas
from rungwise.contact.prepare.system import scaled
from rungwise.contact.step import modes
from rungwise.contact.step.problem import ContactProblem, allocate_problem
from tests.simulation.linear_system import choices, linear_system

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "problems"
Array = np.ndarray
BOX = 1e4
"""Bound of what is enumerated, in natural units."""


def coulomb(W: object, q: object, mu: object) -> rw.Problem:
    return rw.Problem.local(np.array(W, float), q, mu, directions=2)


# By hand


@pytest.mark.parametrize(
    ("M", "q", "kind", "motions", "forces"),
    [
        (1.0, -1.0, "unique", [0], [0]),
        (1.0, 1.0, "unique", [0], [0]),
        (-1.0, 1.0, "motion-indeterminate", [0, 0], [0, 0]),
        (-1.0, -1.0, "none", [], []),
        (0.0, 0.0, "force-indeterminate", [0], [1]),
        (0.0, -1.0, "none", [], []),
        (-1.0, 0.0, "unique", [0], [0]),
    ],
)
def test_one_complementarity(M: float, q: float, kind: str, motions: list[int], forces: list[int]) -> None:
    found = rw.solutions(rw.Problem.lcp([[M]], [q]))
    assert found.kind == kind and check(found)
    assert [piece.motions for piece in found.pieces] == motions
    assert [piece.forces for piece in found.pieces] == forces
    if kind == "none":
        assert found.certificate is not None and farkas.check(scaled(found.problem), found.certificate)
    else:
        assert found.certificate is None


def test_a_body_on_two_points_has_forces_of_one_freedom_and_on_one_point_none() -> None:
    """A slab pressed down that cannot turn: the two normal forces share the load as they like."""
    for points, kind, forces in (
        (1, "unique", 0),
        (2, "force-indeterminate", 1),
        (3, "force-indeterminate", 2),
    ):
        W = np.tile([[1.0], [0.0]], (points, 1))
        slab = rw.Problem.balance(np.eye(1), [-2.0], W, np.zeros(2 * points), np.zeros(points), directions=2)
        found = rw.solutions(slab)
        assert found.kind == kind and check(found)
        assert [(piece.motions, piece.forces) for piece in found.pieces] == [(0, forces)]
        assert found.names(found.pieces[0]) == ("slide",) * points
        assert found.pieces[0].x[: 2 * points : 2].sum() == pytest.approx(2.0)


def test_a_solution_on_the_border_of_modes_is_one_piece() -> None:
    """Friction at its limit without slip is of three modes, and one point."""
    found = rw.solutions(coulomb(np.eye(2), [-1.0, -0.5], [0.5]))
    assert found.kind == "unique" and check(found)
    assert len(found.pieces) == 1 and len(found.covered) == 1
    np.testing.assert_allclose(found.pieces[0].x, [1.0, 0.5])


def test_forces_wedged_between_walls_are_indeterminate() -> None:
    """A disc of no weight between two walls with friction: any squeeze holds it at rest, and none does."""
    W = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    disc = rw.Problem.balance(np.eye(2), [0.0, 0.0], W, np.zeros(4), [0.5, 0.5], directions=2)
    found = rw.solutions(disc)
    assert found.kind == "force-indeterminate" and check(found)
    assert max(piece.forces for piece in found.pieces) == 2
    np.testing.assert_allclose(rw.extreme_motions(found), 0.0, atol=1e-9)


def test_without_contacts_a_body_has_its_one_motion() -> None:
    found = rw.solutions(rw.Problem.balance([[2.0]], [3.0], np.zeros((0, 1)), [], [], directions=2))
    assert found.kind == "unique" and check(found)
    np.testing.assert_allclose(rw.extreme_motions(found), [[1.5, 1.5]])


@pytest.mark.parametrize(
    ("name", "kind", "known"),
    [
        ("lcp_CPS_1.dat", "force-indeterminate", None),
        ("lcp_CPS_2.dat", "unique", [0.0, 1.0, 3.0]),
        ("lcp_CPS_3.dat", "motion-indeterminate", [1 / 90, 2 / 45, 1 / 90, 2 / 45]),
        ("lcp_CPS_4.dat", "unique", [2.0, 2.0, 2.0, 92.0]),
        ("lcp_Pang_isolated_sol.dat", "unique", [1.0, 0.0, 0.0]),
        ("lcp_ortiz.dat", "unique", [2 / 3, 0.0, 1 / 3, 0.0]),
    ],
)
def test_published_problems(name: str, kind: str, known: list[float] | None) -> None:
    if not (FOLDER / name).exists():
        pytest.skip("the folder of published problems is not there")
    found = rw.solutions(read_problem(FOLDER / name))
    assert found.kind == kind and check(found)
    if known is None:
        assert [(piece.motions, piece.forces) for piece in found.pieces] == [(0, 1)]
        assert found.pieces[0].x.sum() == pytest.approx(1.0)
    else:
        assert any(np.allclose(piece.x, known, atol=1e-9) for piece in found.pieces)


# Against enumeration


def enumerate_all(p: ContactProblem) -> tuple[list[tuple[int, ...]], Array, Array]:
    """Modes that hold solutions, and the least and greatest of each unknown over all of them."""
    held, low, high = [], np.inf, -np.inf
    units = modes.natural_units(p)
    for mode in product(*choices(p)):
        E, e, G, g = linear_system(p, mode)
        ends = []
        for cost in (*np.eye(E.shape[1]), *-np.eye(E.shape[1])):
            found = linprog(cost, -G, -g, E, e, bounds=(-BOX, BOX), method="highs")
            if found.status == 2:
                break
            assert found.success
            ends.append(found.fun)
        else:
            size = E.shape[1]
            held.append(mode)
            low = np.minimum(low, ends[:size])
            high = np.maximum(high, -np.array(ends[size:]))
    unit = np.concatenate([units.coordinates, np.full(2 * len(p.mu) + len(p.F), units.force)])
    return held, low * unit, high * unit


def small_problem(rng: np.random.Generator) -> ContactProblem:
    """Rows of small whole numbers, so that they meet; equal rows, rigid and compliant."""
    n, contacts, limited = int(rng.integers(1, 4)), int(rng.integers(1, 4)), int(rng.integers(0, 2))
    p = allocate_problem(n, contacts, limited)
    p.H[:] = np.diag(rng.choice([1.0, 2.0], n))
    p.c[:] = rng.integers(-2, 3, n)
    p.W[:], p.w[:] = rng.integers(-1, 2, p.W.shape), rng.integers(-1, 2, p.w.shape)
    p.mu[:] = rng.choice([0.0, 0.5, 2.0], contacts)
    if rng.random() < 0.2:
        p.R[:] = 0.5 * np.eye(2)
    p.S[:], p.w_s[:] = rng.integers(-1, 2, p.S.shape), rng.integers(-1, 2, limited)
    p.F[:] = rng.choice([0.5, 5.0, np.inf], limited)
    return p


@pytest.mark.parametrize("count", [10, pytest.param(20, marks=pytest.mark.long)])
def test_kinds_and_extremes_agree_with_exhaustive_enumeration(count: int) -> None:
    rng, seen = np.random.default_rng(11), set()
    for _ in range(count):
        p = small_problem(rng)
        found = rw.solutions(p)
        assert check(found) and not found.undecided
        held, low, high = enumerate_all(p)
        seen.add(found.kind)
        if not held:
            assert found.kind == "none"
            continue
        n = len(p.c)
        loose = high - low > 1e-6 * (1.0 + np.abs(low))
        kind = (
            "motion-indeterminate" if loose[:n].any() else "force-indeterminate" if loose.any() else "unique"
        )
        assert found.kind == kind
        extremes = rw.extreme_motions(found)
        inside = (np.abs(low[:n]) < 0.5 * BOX) & (np.abs(high[:n]) < 0.5 * BOX)
        np.testing.assert_allclose(extremes[inside, 0], low[:n][inside], atol=1e-6)
        np.testing.assert_allclose(extremes[inside, 1], high[:n][inside], atol=1e-6)
        for piece in (*found.pieces, *found.covered):
            x = np.concatenate([piece.x[2 * len(p.mu) :][:n], piece.x[: 2 * len(p.mu)]])
            assert (x >= low[: len(x)] - 1e-6).all() and (x <= high[: len(x)] + 1e-6).all()
    assert seen >= {"unique", "force-indeterminate", "none"}


@pytest.mark.parametrize("count", [5, pytest.param(16, marks=pytest.mark.long)])
def test_every_solution_of_random_problems_satisfies_the_laws(
    count: int,
    random_problem: Callable[..., ContactProblem],
) -> None:
    rng = np.random.default_rng(5)
    for _ in range(count):
        p = random_problem(rng)
        found = rw.solutions(p)
        assert check(found) and not found.undecided
        solved = rw.solve(p)
        assert (solved.status == "solved") == bool(found.pieces)
        for piece in found.pieces:
            again = rw.solve(found.problem, start=piece.x)
            assert again.status == "solved" and again.iterations == 0
        if found.kind == "unique":
            np.testing.assert_allclose(
                found.pieces[0].x, solved.x, atol=1e-5 * (1.0 + np.abs(solved.x).max())
            )


def test_eight_contacts_are_few() -> None:
    rng = np.random.default_rng(2)
    W, w = rng.normal(size=(16, 6)), rng.normal(size=16)
    found = rw.solutions(
        rw.Problem.balance(np.eye(6), rng.normal(size=6), W, w, np.full(8, 0.6), directions=2)
    )
    assert not found.undecided and check(found)
    assert found.nodes < 4**8 / 100


# Stacks: contacts that share loads


def stack(boxes: int, pull: float = 0.0, mu: float = 0.5, shift: float = 0.0) -> rw.Problem:
    """Unit cubes of unit mass on each other at rest, two contacts in each joint, each cube `shift` further
    than the one below; `pull` acts on each centre. One step of 1e-3 under gravity."""
    n, h = 3 * boxes, 1e-3
    W, c = np.zeros((4 * boxes, n)), np.zeros(n)
    for i in range(boxes):
        c[3 * i : 3 * i + 2] = pull * h, -9.81 * h
        for k, x in enumerate((-0.5, 0.5 - (shift if i else 0.0))):
            r = 4 * i + 2 * k
            W[r, 3 * i : 3 * i + 3], W[r + 1, 3 * i : 3 * i + 3] = (0.0, 1.0, x), (1.0, 0.0, 0.5)
            if i:
                W[r, 3 * i - 3 : 3 * i] = 0.0, -1.0, -x - shift
                W[r + 1, 3 * i - 3 : 3 * i] = -1.0, 0.0, 0.5
    inertia = np.diag(np.tile([1.0, 1.0, 1.0 / 6.0], boxes))
    return rw.Problem.balance(inertia, c, W, np.zeros(4 * boxes), np.full(2 * boxes, mu), directions=2)


@pytest.mark.few(2)
@pytest.mark.parametrize("shift", [0.0, 0.1])
@pytest.mark.parametrize("boxes", [1, 4, 8])
def test_a_stack_at_rest_shares_its_weight_in_one_way_per_box(boxes: int, shift: float) -> None:
    """Of 4 forces in each joint 3 balance a box; no node beyond the root is looked at."""
    found = rw.solutions(stack(boxes, shift=shift))
    assert found.kind == "force-indeterminate" and check(found)
    assert [(piece.motions, piece.forces) for piece in found.pieces] == [(0, boxes)]
    assert found.nodes == 1 and len(found.held) == 1
    np.testing.assert_allclose(rw.extreme_motions(found), 0.0, atol=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize(("mu", "kind"), [(0.5, "force-indeterminate"), (0.1, "unique")])
def test_a_stack_that_is_pulled_is_decided(mu: float, kind: str) -> None:
    """It stays, or slides as one with all friction at its limit; either way there is no other motion."""
    found = rw.solutions(stack(2, 2.0, mu))
    assert found.kind == kind and check(found)
    extremes = rw.extreme_motions(found)
    np.testing.assert_allclose(extremes[:, 0], extremes[:, 1], atol=1e-9)
    np.testing.assert_allclose(extremes[[0, 3], 0], max(2.0 - mu * 9.81, 0.0) * 1e-3, atol=1e-9)


def test_a_problem_without_friction_takes_one_node() -> None:
    """Any LCP of a positive matrix has one motion: 40 unknowns are no more than one."""
    rng = np.random.default_rng(8)
    A = rng.normal(size=(40, 25))
    found = rw.solutions(rw.Problem.lcp(A @ A.T, rng.normal(size=40) + A @ rng.normal(size=25)))
    assert found.kind in ("unique", "force-indeterminate") and found.nodes == 1 and check(found)


def test_a_matrix_that_is_not_positive_is_held_by_nothing() -> None:
    found = rw.solutions(rw.Problem.lcp([[1.0, 3.0], [3.0, 1.0]], [-1.0, -1.0]))
    assert not found.held and len(found.pieces) == 3 and check(found)


# Symmetry and units


@pytest.mark.parametrize("count", [4, pytest.param(12, marks=pytest.mark.long)])
def test_mirrored_problems_have_mirrored_solutions(count: int) -> None:
    rng = np.random.default_rng(3)
    other = {"forward": "backward", "backward": "forward"}
    for _ in range(count):
        p = small_problem(rng)
        mirrored = ContactProblem(
            **{name: getattr(p, name).copy() for name in ContactProblem.__annotations__}
        )
        mirrored.W[1::2] *= -1.0
        mirrored.w[1::2] *= -1.0
        one, two = rw.solutions(p), rw.solutions(mirrored)
        assert one.kind == two.kind
        contacts = len(p.mu)
        a, b = (
            {s.names(piece): (piece.motions, piece.forces) for piece in (*s.pieces, *s.covered)}
            for s in (one, two)
        )
        assert {
            (*(other.get(name, name) for name in names[:contacts]), *names[contacts:]): size
            for names, size in a.items()
        } == b


@pytest.mark.few(1)
@pytest.mark.parametrize("force", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("speed", [1e-3, 1e3])
def test_units_do_not_matter(in_units: Callable[..., ContactProblem], force: float, speed: float) -> None:
    rng = np.random.default_rng(7)
    for _ in range(3):
        p = small_problem(rng)
        lengths = 10.0 ** rng.uniform(-2, 2, len(p.c))
        one, two = rw.solutions(p), rw.solutions(in_units(p, lengths, force, speed))
        assert check(one) and check(two) and one.kind == two.kind
        assert {piece.mode: (piece.motions, piece.forces) for piece in one.pieces} == {
            piece.mode: (piece.motions, piece.forces) for piece in two.pieces
        }


# Evidence


def test_the_check_fails_for_whatever_is_changed() -> None:
    found = rw.solutions(stack(1, pull=1.0))
    assert check(found) and found.held
    piece = found.pieces[0]
    bad: list[rw.Solutions] = [replace(found, kind=kind) for kind in rw.Kind if kind != found.kind]
    bad += [replace(found, excluded=found.excluded[1:]), replace(found, pieces=found.pieces[1:])]
    for change in (
        {"motions": piece.motions + 1},
        {"forces": piece.forces + 1},
        {"forces": 0},
        {"x": piece.x + 0.01},
        {"point": piece.point + 0.01},
        {"multipliers": piece.multipliers[1:]},
        {"multipliers": np.ones_like(piece.multipliers)},
    ):
        bad.append(replace(found, pieces=(replace(piece, **change), *found.pieces[1:])))
    mode, vector = found.excluded[0]
    bad.append(replace(found, excluded=((mode, -vector), *found.excluded[1:])))
    mode, point = found.held[0]
    bad += [replace(found, held=found.held[1:])]
    bad += [
        replace(found, held=((mode, x), *found.held[1:]))
        for x in (1.01 * point, point[1:], np.zeros_like(point), found.held[1][1])
    ]
    bad.append(replace(found, held=((farkas.hull(scaled(found.problem)), point), *found.held)))
    assert not any(check(other) for other in bad)


def test_too_few_nodes_decide_nothing_and_bound_nothing() -> None:
    found = rw.solutions(coulomb(np.eye(2), [-1.0, -0.4], [0.5]), nodes=2)
    assert found.kind == "undecided" and check(found)
    with pytest.raises(ValueError, match="undecided"):
        rw.extreme_motions(found)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="directions must be 2"):
        rw.solutions(rw.Problem.local(np.eye(3), [-1.0, 0.0, 0.0], [0.5]))
    with pytest.raises(ValueError, match="nodes"):
        rw.solutions(rw.Problem.lcp([[1.0]], [1.0]), nodes=0)
    found = rw.solutions(rw.Problem.lcp([[1.0]], [1.0]))
    with pytest.raises(ValueError, match="objects: velocity 1"):
        rw.extreme_motions(found, [[1]])


# Extreme motions of quasistatic problems: H = 0


def pushed(friction: Sequence[float], speeds: Sequence[float], rows: Sequence[Sequence[float]]) -> rw.Problem:
    """Objects on a line, without inertia: rows . v >= speeds, and dry friction of each object's support."""
    n = len(friction)
    return rw.Problem.balance(
        np.zeros((n, n)),
        np.zeros(n),
        np.array(rows, float),
        -np.array(speeds, float),
        np.zeros(len(rows)),
        directions=1,
        S=np.eye(n),
        w_s=np.zeros(n),
        F=friction,
    )


def test_a_pushed_object_may_run_ahead_unless_its_support_holds_it() -> None:
    found = rw.solutions(pushed([0.0], [2.0], [[1.0]]))
    assert found.kind == "motion-indeterminate" and check(found)
    np.testing.assert_allclose(rw.extreme_motions(found), [[2.0, np.inf]])
    found = rw.solutions(pushed([0.3], [2.0], [[1.0]]))
    assert found.kind == "unique" and check(found)
    np.testing.assert_allclose(rw.extreme_motions(found), [[2.0, 2.0]])


def test_an_object_squeezed_between_pushers_has_an_interval() -> None:
    found = rw.solutions(pushed([0.0], [1.0, -3.0], [[1.0], [-1.0]]))
    np.testing.assert_allclose(rw.extreme_motions(found), [[1.0, 3.0]])


def test_an_object_that_may_rest_rests_and_one_that_is_pushed_does_not() -> None:
    """The second object lies ahead of the first, at a distance it cannot cross within the step."""
    found = rw.solutions(pushed([0.0, 0.0], [2.0, -1.0], [[1.0, 0.0], [-1.0, 1.0]]))
    np.testing.assert_allclose(rw.extreme_motions(found, [[0], [1]]), [[2.0, np.inf], [1.0, np.inf]])
    found = rw.solutions(pushed([0.0, 0.0], [2.0, -5.0, -4.0], [[1.0, 0.0], [-1.0, 1.0], [-1.0, 0.0]]))
    np.testing.assert_allclose(rw.extreme_motions(found), [[2.0, 4.0], [-3.0, np.inf]])
    np.testing.assert_allclose(rw.extreme_motions(found, [[0], [1]]), [[2.0, 4.0], [0.0, 0.0]])


def test_when_either_of_two_may_rest_both_cases_count() -> None:
    """v1 + v2 >= 1 and each at most 3: when one rests, the other moves at 1 to 3."""
    found = rw.solutions(pushed([0.0, 0.0], [1.0, -3.0, -3.0], [[1.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]))
    np.testing.assert_allclose(rw.extreme_motions(found), [[-2.0, 3.0]] * 2)
    np.testing.assert_allclose(rw.extreme_motions(found, [[0], [1]]), [[0.0, 3.0]] * 2)


# In space


def spatial(rng: np.random.Generator, bodies: int, contacts: int) -> rw.Problem:
    """Bodies of six coordinates that meet at random, without friction, some contacts twice."""
    n = 6 * bodies
    W = np.zeros((3 * contacts, n))
    for k in range(contacts):
        a, b = rng.choice(bodies + 1, 2, replace=False)  # the last one is the ground
        for body in (x for x in (a, b) if x < bodies):
            W[3 * k : 3 * k + 3, 6 * body : 6 * body + 6] = rng.normal(size=(3, 6))
    W[:3] = W[3:6]
    A = rng.normal(size=(n, n))
    return rw.Problem.balance(
        A @ A.T + np.eye(n), rng.normal(size=n), W, np.tile([0.1, 0.0, 0.0], contacts), np.zeros(contacts)
    )


def test_extreme_motions_of_files_in_space_are_those_of_their_solution(tmp_path: Path) -> None:
    """Without friction masses leave one motion, however contacts share the forces; a file holds all of it."""
    pytest.importorskip("h5py", reason="FCLIB files need h5py")
    rng, kinds = np.random.default_rng(12), set()
    for _ in range(6):
        rw.write_fclib(tmp_path / "a.hdf5", spatial(rng, 2, 5))
        problem = read_problem(tmp_path / "a.hdf5")
        found, reference = rw.solutions(problem), rw.solve(problem)
        assert check(found) and reference.status == "solved"
        kinds.add(found.kind)
        extremes = rw.extreme_motions(found)
        np.testing.assert_allclose(extremes, np.tile(reference.v[:, None], 2), atol=1e-8)
    assert "force-indeterminate" in kinds


def test_a_ball_pushed_without_inertia_in_space() -> None:
    """A plate at speed 1 along z, dry friction on the ball's support holding x and y, and its turns free."""
    W = np.zeros((3, 6))
    W[0, 2] = W[1, 0] = W[2, 1] = 1.0
    held = np.eye(6)[:2]
    ball = rw.Problem.balance(
        np.zeros((6, 6)), np.zeros(6), W, [-1.0, 0.0, 0.0], [0.0], S=held, w_s=np.zeros(2), F=[0.1, 0.1]
    )
    found = rw.solutions(ball)
    assert found.kind == "motion-indeterminate" and check(found)
    free = [-np.inf, np.inf]
    np.testing.assert_allclose(
        rw.extreme_motions(found), [[0.0, 0.0], [0.0, 0.0], [1.0, np.inf], free, free, free], atol=1e-9
    )
    with pytest.raises(ValueError, match="directions must be 2"):
        rw.solutions(rw.Problem.balance(np.eye(6), np.zeros(6), W, np.zeros(3), [0.5]))


def massless(seed: int, compliance: float, force: float, speed: float) -> rw.Problem:
    """Two contacts, a joint with a limit and no inertia, in these units of force and speed."""
    rng = np.random.default_rng(seed)
    return rw.Problem.balance(
        np.zeros((4, 4)), force * rng.normal(size=4), rng.normal(size=(4, 4)), speed * rng.normal(size=4),
        rng.uniform(0.1, 1.0, 2), directions=2, S=rng.normal(size=(1, 4)), w_s=speed * rng.normal(size=1),
        R=speed / force * compliance * np.diag([1.0, 1.0, 0.0, 0.0]), F=force * rng.uniform(0.1, 2.0, 1),
    )  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("speed", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("force", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("compliance", [0.0, 1.0])
def test_units_do_not_matter_without_inertia(force: float, speed: float, compliance: float) -> None:
    """Nothing but demands and loads, or one compliant contact, says what is much for rates and forces."""
    for seed in range(3):
        one, other = massless(seed, compliance, 1.0, 1.0), massless(seed, compliance, force, speed)
        known, again = rw.solutions(one), rw.solutions(other)
        assert known.kind == again.kind and known.kind != "undecided" and check(again)
        assert len(known.pieces) == len(again.pieces)
        assert rw.solve(one).status == rw.solve(other).status != "not_converged"


@pytest.mark.parametrize("count", [20, pytest.param(60, marks=pytest.mark.long)])
def test_what_a_joint_holds_is_held_whatever_rounding_says(count: int) -> None:
    """One coordinate that a joint drives at the rate at which one contact just stays closed: the contact may
    carry anything beside the joint, nothing jams, and nothing moves otherwise."""
    rng = np.random.default_rng(0)
    for _ in range(count):
        inertia, W, joint, v = rng.uniform(0.1, 3.0), rng.normal(size=(2, 1)), rng.normal(), rng.normal()
        problem = rw.Problem.balance(
            [[inertia]], [inertia * v - W[0, 0]], W, [-W[0, 0] * v, 0.5 - W[1, 0] * v], [0.0, 0.0],
            directions=1, S=[[joint]], w_s=[-joint * v],
        )  # fmt: skip
        found = rw.solutions(problem)
        assert found.kind == "force-indeterminate" and check(found)
        np.testing.assert_allclose(rw.extreme_motions(found)[0], v, rtol=1e-9)
