"""Certificates: found where there is no solution, and worth nothing once tampered with."""

from __future__ import annotations

import ast
import inspect
from dataclasses import replace

import numpy as np
import pytest

from rungwise.contact.certify import certify_infeasible, certify_unsupported
from rungwise.contact.judge import certificate as module
from rungwise.contact.judge.certificate import Certificate, check
from rungwise.contact.judge.farkas import HULL


def walls(body, speed=-1.0):
    """A body between two walls that close in on it."""
    p = body(2, 2)
    p.W[0], p.W[2], p.W[1], p.W[3] = (1, 0), (-1, 0), (0, 1), (0, 1)
    p.w[:], p.mu[:] = (speed, 0, speed, 0), 0.3
    return p


def wedge(body, mu):
    """A finger pushes down on a 45 degree slope of a block on a palm; a second finger is still far."""
    p = body(1, 2)
    root = np.sqrt(0.5)
    p.W[:, 0] = -root, root, root, root
    p.w[:], p.mu[:] = (-root, -root, 5.0, 0.0), mu
    return p


def falling(body):
    """A body pulled down a frictional wall that a joint ties to it, and nothing below."""
    p = body(2, 1, 1)
    p.c[:], p.mu[:] = (0.0, -10.0), 0.0
    p.W[:] = [[1, 0], [0, 1]]
    p.S[:], p.F[:] = [[1, 0]], np.inf
    return p


def case(body, kind):
    if kind == "unsupported":
        p = falling(body)
        return p, certify_unsupported(p, np.zeros((2, 2)))
    p = walls(body) if kind == "kinematic" else wedge(body, 1.3)
    return p, certify_infeasible(p)


KINDS = ("kinematic", "frictional", "unsupported")


@pytest.mark.parametrize("kind", KINDS)
def test_found_and_accepted(body, kind):
    p, found = case(body, kind)
    assert found is not None
    assert found.kind == kind
    assert check(p, found)


def changed(found, row, vector):
    vectors = list(found.vectors)
    vectors[row] = vector
    return replace(found, vectors=tuple(vectors))


@pytest.mark.parametrize("kind", ["kinematic", "frictional"])
def test_any_entry_matters(body, kind):
    """Forces that balance do so no more; multipliers of rates that contradict each other are all needed."""
    p, found = case(body, kind)
    for row in range(0, len(found.vectors), 7):
        for i, own in enumerate(found.vectors[row]):
            wrong = [np.nan, np.inf, *((own + 1e-2,) if kind == "kinematic" else (0.0, -own) if own else ())]
            for value in wrong:
                vector = found.vectors[row].copy()
                vector[i] = value
                assert not check(p, changed(found, row, vector)), (row, i, value)


@pytest.mark.parametrize("lean", [1e-5, 1e-6, 1e-7])
def test_near_a_singular_position_the_bound_counts_not_momentum(body, lean):
    """Two walls that are not quite parallel: the body would have to leave 1 / lean times faster than they
    close."""
    p = walls(body)
    p.mu[:] = 0.0
    p.W[2] = (-1.0, lean)
    p.c[:] = p.H @ np.array([0.0, 0.5 / lean])
    found = certify_infeasible(p)
    assert found is not None
    assert found.kind == "kinematic"
    assert check(p, found)
    assert not check(p, changed(found, 0, found.vectors[0] * [1.0, 1.01]))
    p.W[2] = (-1.0, 0.1)
    assert certify_infeasible(p) is None


def test_far_contacts_are_no_part_of_a_proof(body):
    """A gap that could close at a great rate, in a short step, does not hide the jam of the others."""
    p = body(2, 3)
    near = walls(body)
    p.W[:4], p.w[:4], p.mu[:] = near.W, near.w, 0.0
    p.W[2] = (-1.0, 1e-6)
    p.W[4], p.w[4] = (0.0, -1.0), 1e8
    found = certify_infeasible(p)
    assert found is not None
    assert found.vectors[0][2] == 0.0
    p.w[4] = -0.5
    assert certify_infeasible(p) is not None


def test_an_unsupported_motion_must_not_move_joints_or_close_contacts(body):
    p, found = case(body, "unsupported")
    for x in (1e-2, -1e-2, np.nan):
        assert not check(p, changed(found, 0, found.vectors[0] + [x, 0.0]))


def test_a_frictional_certificate_covers_every_mode(body):
    p, found = case(body, "frictional")
    assert len(found.modes) < 16
    rows = range(len(found.modes))
    for i in rows:
        rest = [j for j in rows if j != i]
        fewer = replace(
            found, modes=tuple(found.modes[j] for j in rest), vectors=tuple(found.vectors[j] for j in rest)
        )
        assert not check(p, fewer)
        assert not check(p, replace(found, modes=fewer.modes))
        wider = tuple(HULL for _ in found.modes[i])
        assert not check(p, replace(found, modes=(*found.modes[:i], wider, *found.modes[i + 1 :])))


@pytest.mark.parametrize("kind", KINDS)
def test_sign_length_and_kind_matter(body, kind):
    p, found = case(body, kind)
    first = found.vectors[0]
    assert not check(p, changed(found, 0, -first))
    assert not check(p, changed(found, 0, first[:-1]))
    assert not check(p, changed(found, 0, np.append(first, 0.0)))
    assert not check(p, changed(found, 0, 0.0 * first))
    assert not check(p, Certificate(found.kind, ()))
    assert not check(p, Certificate("rumour", found.vectors))


def test_worthless_for_a_problem_that_has_a_solution(body):
    _, kinematic = case(body, "kinematic")
    assert not check(walls(body, speed=1.0), kinematic)
    assert not check(walls(body, speed=0.0), kinematic)
    pulls = changed(kinematic, 0, -kinematic.vectors[0])  # walls that part are no jam: contacts do not pull
    assert not check(walls(body, speed=1.0), pulls)
    _, frictional = case(body, "frictional")
    assert not check(wedge(body, 0.5), frictional)
    _, unsupported = case(body, "unsupported")
    held = falling(body)
    held.W[0] = 0.0, 1.0
    assert not check(held, unsupported)
    assert not check(falling(body), unsupported, np.eye(2))


def test_none_for_solvable_problems(random_problem, run, body):
    rng = np.random.default_rng(11)
    for _ in range(40):
        p = random_problem(rng, 1)
        if run("planar", p)[0] == 0:
            assert certify_infeasible(p) is None
    assert certify_infeasible(wedge(body, 0.5)) is None
    assert certify_unsupported(falling(body), np.eye(2)) is None


@pytest.mark.parametrize("yields", [1e-30, 1e-24, 1e-18, 1e-12, 1e-6])
@pytest.mark.parametrize("kind", ["kinematic", "frictional"])
def test_no_certificate_rests_on_what_yields(body, kind, yields):
    """However little a contact yields, by enough force it gives way."""
    p, found = case(body, kind)
    p.R[:] = yields * np.eye(2)
    assert certify_infeasible(p) is None
    assert not check(p, found)


def test_no_certificate_for_compliant_problems(random_problem):
    """Bodies squeezed from all sides, by contacts that yield over decades, and held by rows that yield."""
    rng = np.random.default_rng(12)
    for _ in range(60):
        p = random_problem(rng)
        p.w[::2] = -np.abs(p.w[::2]) - 1.0
        for k in range(len(p.mu)):
            p.R[k] = 10.0 ** rng.uniform(-25, 0) * np.diag(rng.uniform(0.1, 1.0, 2))
        p.R_s[:] = 10.0 ** rng.uniform(-25, 0, len(p.F))
        assert certify_infeasible(p) is None


@pytest.mark.parametrize("kind", ["kinematic", "frictional"])
def test_what_yields_has_no_part_in_the_proof_of_a_jam(body, kind):
    """A compliant contact beside a jam: the proof holds whatever its rates and stiffness are."""
    jam, _ = case(body, kind)
    n = jam.W.shape[1]
    p = body(n, 3)
    p.W[:4], p.w[:4], p.mu[:2] = jam.W, jam.w, jam.mu
    p.W[4:], p.mu[2] = (np.array([[0.0, 1.0], [1.0, 0.0]]) if n == 2 else [[1.0], [0.0]]), 0.4
    p.w[4:], p.R[2] = (-1.0, 0.3), 1e-9 * np.eye(2)
    found = certify_infeasible(p)
    assert found is not None and found.kind == kind
    for w, yields in ((-1e6, 1e-25), (1e6, 1e25), (0.0, 1.0)):
        p.w[4:], p.R[2] = w, yields * np.eye(2)
        again = certify_infeasible(p)
        assert again is not None and again.kind == kind


def test_a_rate_of_rounding_size_does_not_prove_a_jam(body):
    """A block that a load pushes off the floor, with a gap of rounding size."""
    p = body(2, 1)
    p.c[:], p.mu[:], p.w[:] = (0.0, 10.0), 0.5, (1e-17, 0.0)
    p.W[:] = [[0, 1], [1, 0]]
    assert certify_infeasible(p) is None


def weak_grip(body, mu, stiffness):
    """A part held against a wall by a damped finger that a force of 5 drives, and pulled down by 10."""
    p = body(2, 1)
    p.c[:], p.mu[:] = (-10.0, 5.0), mu
    p.W[:] = [[0, -1], [1, 0]]
    p.R[0] = np.eye(2) / stiffness
    return p, np.diag([0.0, 10.0])


@pytest.mark.parametrize("stiffness", [np.inf, 1e4])
def test_a_part_slips_out_of_a_grip_whose_force_is_limited(body, stiffness):
    p, resisting = weak_grip(body, 1.9, stiffness)
    found = certify_unsupported(p, resisting)
    assert found is not None
    assert found.kind == "unbalanced"
    assert check(p, found, resisting)
    assert not check(p, changed(found, 0, -found.vectors[0]), resisting)
    held, _ = weak_grip(body, 2.1, stiffness)
    assert certify_unsupported(held, resisting) is None
    assert not check(held, found, resisting)


def test_unsupported_needs_more_than_the_drives_give(body):
    p = body(1, 0, 1)
    p.c[:], p.S[:], p.F[:] = 10.0, 1.0, 9.0
    found = certify_unsupported(p, np.zeros((1, 1)))
    assert found is not None
    p.F[:] = 11.0
    assert certify_unsupported(p, np.zeros((1, 1))) is None
    assert not check(p, found)


@pytest.mark.few(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [1e308, 5e-324, np.inf, np.nan])
@pytest.mark.parametrize("name", ["H", "c", "W", "w"])
def test_no_certificate_and_no_error_beyond_floating_point(body, kind, value, name):
    p, _ = case(body, kind)
    getattr(p, name)[...] = value
    certify_infeasible(p)
    certify_unsupported(p, np.zeros_like(p.H))
    certify_unsupported(p, p.H)
    if not np.isfinite(value):
        assert certify_infeasible(p) is None or name in "Hc"
        assert certify_unsupported(p, np.zeros_like(p.H)) is None or name == "H"


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("directions", [2, 3, 6])
def test_what_slides_against_friction_in_coordinates_of_its_contact_is_unsupported(body, directions, seed):
    """No row joins the coordinates, but the contact does: to slide is only a proof with a lift that friction
    cannot resist; as much friction as the load asks holds it."""
    rng = np.random.default_rng(seed)
    p = body(directions, 1, 0, directions)
    scale = 10.0 ** rng.uniform(-2.0, 2.0, directions)
    p.W[:] = np.diag(scale)
    p.c[0], p.mu[0] = -scale[0] * 10.0 ** rng.uniform(-2.0, 2.0), rng.uniform(0.1, 1.5)
    heading = rng.normal(size=directions - 1)
    p.c[1:] = scale[1:] * heading / np.linalg.norm(heading) * p.mu[0] * -p.c[0] / scale[0]
    still = np.zeros((directions, directions))
    for part, proved in ((1.5, True), (0.9, False)):
        p.c[1:] *= part
        found = certify_unsupported(p, still)
        assert (found is not None and found.kind == "unsupported" and check(p, found, still)) == proved
        p.c[1:] /= part


def test_the_checker_imports_no_solver():
    tree = ast.parse(inspect.getsource(module))
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {
        node.module if isinstance(node, ast.ImportFrom) else a.name for node in nodes for a in node.names
    }
    ours = {
        "rungwise.contact.judge.farkas", "rungwise.contact.prepare.system", "rungwise.contact.problem",
        "rungwise.contact.step.modes", "rungwise.contact.step.problem",
    }  # fmt: skip
    assert names == {"__future__", "dataclasses", "typing", "numpy", "numpy.typing", "scipy.sparse"} | ours
