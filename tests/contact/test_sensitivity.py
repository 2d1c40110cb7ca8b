"""Derivatives of solved steps against differences of steps solved again."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.analysis.sensitivity import DATA, Sensitivity, sensitivity
from rungwise.contact.analysis.sensitivity import _units as units
from rungwise.contact.kinds import cone, free, interval, natural_map
from rungwise.contact.step.problem import ContactProblem, allocate_problem

STEP = 1e-5


def random_step(rng: np.random.Generator, directions: int) -> ContactProblem:
    """Up to three contacts, some compliant, a joint, dry friction and a drive; more coordinates than rigid
    rows, so that forces are determined."""
    k = int(rng.integers(1, 4))
    p = allocate_problem(directions * k + 3, k, 3, directions)
    n = len(p.c)
    a = rng.normal(size=(n, n))
    p.H[:] = a @ a.T + np.eye(n)
    p.c[:] = rng.normal(size=n)
    p.W[:], p.S[:] = rng.normal(size=p.W.shape), rng.normal(size=p.S.shape)
    p.w[:], p.w_s[:] = rng.normal(size=p.w.shape), 0.3 * rng.normal(size=3)
    p.w[::directions] -= 0.5
    for i in range(k):
        b = rng.normal(size=(directions, directions))
        p.R[i] = rng.integers(0, 2) * 0.1 * (b @ b.T)
    p.R_s[:] = [0.0, 0.0, 0.2]
    p.mu[:] = rng.choice([0.0, 0.3, 1.0], k)
    p.F[:] = [np.inf, 0.2, 0.3]
    return p


def moved(p: ContactProblem, direction: dict[str, np.ndarray], by: float) -> ContactProblem:
    fields = {name: getattr(p, name) + by * direction.get(name, 0.0) for name in DATA}
    return ContactProblem(**fields, quantum=p.quantum)


def solved(p: ContactProblem) -> np.ndarray:
    found = rw.solve(p, tol=1e-11)
    assert found.status == "solved", found.residuals
    return np.concatenate([found.v, found.r, found.z])


def random_direction(rng: np.random.Generator, p: ContactProblem) -> dict[str, np.ndarray]:
    direction = {name: rng.normal(size=getattr(p, name).shape) for name in DATA}
    direction["H"] += direction["H"].T
    direction["R"] *= np.abs(p.R).max(axis=(1, 2), keepdims=True) > 0.0
    direction["mu"] *= p.mu > 0.0
    direction["F"][0] = 0.0
    return direction


def modes(p: ContactProblem, x: np.ndarray) -> list[str]:
    d, n = p.R.shape[1], len(p.c)
    force = x[n : n + len(p.w)].reshape(-1, d)
    rate = (p.W @ x[:n] + p.w).reshape(-1, d) + np.einsum("kij,kj->ki", p.R, force)
    slip = np.linalg.norm(rate[:, 1:], axis=1)
    names = np.where(slip > 1e-6, "slide", "stick")
    return list(np.where(force[:, 0] > 1e-6, names, "open"))


@pytest.mark.few(1)
@pytest.mark.parametrize("directions", [2, 3])
def test_against_central_differences(directions: int) -> None:
    rng = np.random.default_rng(directions)
    seen: dict[str, int] = {}
    for _ in range(80):
        p = random_step(rng, directions)
        found = rw.solve(p, tol=1e-11)
        assert found.status == "solved"
        s = sensitivity(p, found)
        assert s.forces_determined and s.velocities_determined
        direction = random_direction(rng, p)
        low, high = solved(moved(p, direction, -STEP)), solved(moved(p, direction, STEP))
        base = np.concatenate([found.v, found.r, found.z])
        if s.weak or s.weak_rows or modes(p, low) != modes(p, high):
            continue
        expected = (high - low) / (2.0 * STEP)
        if np.abs(high - 2.0 * base + low).max() > 1e-3 * STEP * np.abs(expected).max():
            continue  # so near to a change of mode that a difference does not tell
        for mode in modes(p, base):
            seen[mode] = seen.get(mode, 0) + 1
        change = s.forward(**direction)
        got = np.concatenate(change)[:, 0]
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
        goal = [rng.normal(size=len(part)) for part in change]
        gradient = s.gradient(*goal)
        along = sum(np.nansum(gradient[name] * direction[name]) for name in DATA)
        assert along == pytest.approx(float(np.concatenate(goal) @ got), rel=1e-9)
    assert min(seen.get(mode, 0) for mode in ("open", "stick", "slide")) >= 10, seen


def slopes(p: ContactProblem, force: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The slopes of all groups' projections at a solution, as one matrix, as the contact solver has them."""
    d, k = p.R.shape[1], len(p.mu)
    found = np.zeros((len(force), len(force)))
    for i in range(k + len(p.F)):
        own = slice(i * d, i * d + d) if i < k else slice(k * d + i - k, k * d + i - k + 1)
        limit = p.mu[i] if i < k else p.F[i - k]
        kind = cone.KIND if i < k else interval.KIND if np.isfinite(limit) else free.KIND
        law = np.array([limit, 0.0] if i < k else [-limit, limit])
        S, size = np.zeros((d, d)), own.stop - own.start
        natural_map(kind, law, np.zeros(0), size, force[own].copy(), rate[own].copy(), np.zeros(d), S)
        found[own, own] = S[:size, :size]
    return found


@pytest.mark.parametrize("directions", [2, 3])
def test_pieces_agree_with_the_slopes_of_the_solver(directions: int) -> None:
    """One more right-hand side of a Newton step of the contact solver, where no mode is about to change."""
    rng, compared = np.random.default_rng(directions), 0
    for _ in range(40):
        p = random_step(rng, directions)
        found = rw.solve(p, tol=1e-11)
        s = sensitivity(p, found)
        if s.weak or s.weak_rows:
            continue
        c, w, w_s = (rng.normal(size=of.shape) for of in (p.c, p.w, p.w_s))
        change = s.forward(c=c, w=w, w_s=w_s)
        P, Y, one = s._rows, s._yield, np.eye(len(s.force))
        S = slopes(p, s.force, P @ s.v + Y @ s.force + np.concatenate([p.w, p.w_s]))
        newton = np.block([[p.H, -P.T], [S @ P, one - S + S @ Y]])
        z = np.linalg.solve(newton, np.concatenate([c, -S @ np.concatenate([w, w_s])]))
        got = np.concatenate([change.v, change.force, change.tau])[:, 0]
        np.testing.assert_allclose(got, z, rtol=0.0, atol=1e-6 * np.abs(z).max())
        compared += 1
    assert compared > 30


def one_contact(
    directions: int = 2, c: tuple[float, ...] = (0.0, 0.0, 0.0), mu: float = 0.5
) -> ContactProblem:
    """A point of unit mass over a floor that it touches."""
    p = allocate_problem(directions, 1, 0, directions)
    p.H[:], p.W[:] = np.eye(directions), np.eye(directions)
    p.c[:] = c[:directions]
    p.mu[:] = mu
    return p


@pytest.mark.few(4)
@pytest.mark.parametrize("directions", [2, 3])
@pytest.mark.parametrize("c", [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.5, 0.0), (-1.0, 0.3, 0.4)])
def test_one_sided_at_a_change_of_mode(directions: int, c: tuple[float, ...]) -> None:
    if directions == 2 and c[2]:
        c = (-1.0, -0.5, 0.0)
    p = one_contact(directions, c)
    s = sensitivity(p, rw.solve(p, tol=1e-12))
    assert s.weak == (0,)
    with pytest.raises(ValueError, match="weakly active are contacts"):
        s.gradient(v=np.ones(directions))
    rng = np.random.default_rng(4)
    for _ in range(20):
        direction = {"c": rng.normal(size=directions), "w": rng.normal(size=directions)}
        h = 1e-6
        expected = (solved(moved(p, direction, h)) - solved(p)) / h
        got = np.concatenate(s.forward(**direction))[:, 0]
        np.testing.assert_allclose(got, expected, atol=2e-5)


def test_edge_of_the_cone_by_hand() -> None:
    """At the limit of friction, more pull slides, less sticks, and more friction sticks."""
    p = one_contact(2, (-1.0, 0.5))
    s = sensitivity(p, rw.solve(p))
    np.testing.assert_allclose(s.forward(c=[[0.0, 0.0], [1.0, -1.0]]).v[1], [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(s.forward(mu=[[1.0, -1.0]]).v[1], [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(s.gradient(v=[0.0, 1.0], released=True)["w"], [0.5, 0.0], atol=1e-12)


def test_limited_rows() -> None:
    """A slider with dry friction F under a pull c: v = c - F when it slips, 0 when it holds."""
    p = allocate_problem(1, 0, 1)
    p.H[:], p.S[:], p.F[:], p.c[:] = 1.0, 1.0, 1.0, 3.0
    change = sensitivity(p, rw.solve(p)).forward(c=[[1.0, 0.0]], F=[[0.0, 1.0]])
    np.testing.assert_allclose(change.v, [[1.0, -1.0]])
    np.testing.assert_allclose(change.tau, [[0.0, -1.0]])
    p.c[:] = 1.0
    s = sensitivity(p, rw.solve(p))
    assert s.weak_rows == (0,)
    np.testing.assert_allclose(s.forward(c=[[1.0, -1.0]]).v, [[1.0, 0.0]], atol=1e-9)


def test_redundant_contacts_share_in_many_ways() -> None:
    """Two identical contacts carry a weight: the motion has a derivative, their forces do not."""
    p = allocate_problem(2, 2, 0)
    p.H[:] = np.eye(2)
    p.W[:] = np.vstack([np.eye(2), np.eye(2)])
    p.c[:] = [-1.0, 2.0]
    p.mu[:] = 0.5
    s = Sensitivity(p, [0.0, 1.5], [0.6, -0.3, 0.4, -0.2], [])
    assert not s.forces_determined and s.velocities_determined
    change = s.forward(c=np.eye(2), w=np.zeros(4))
    np.testing.assert_allclose(change.v, [[0.0, 0.0], [0.5, 1.0]], atol=1e-12)
    assert np.isnan(change.force).all()
    np.testing.assert_allclose(s.gradient(v=[0.0, 1.0])["c"], [0.5, 1.0], atol=1e-12)
    with pytest.raises(ValueError, match="not determined"):
        s.gradient(force=[1.0, 0.0, 0.0, 0.0])
    # One floor rises and the other does not: they no longer share.
    assert np.isnan(s.forward(w=[1.0, 0.0, 0.0, 0.0]).v).all()


@pytest.mark.parametrize("directions", [2, 3])
def test_units_do_not_matter(directions: int) -> None:
    rng = np.random.default_rng(8)
    for _ in range(20):
        p = random_step(rng, directions)
        s = sensitivity(p, rw.solve(p, tol=1e-11))
        length, f = 1e-6, 1e7
        unit = 10.0 ** rng.integers(-4, 5, size=len(p.c))  # of each coordinate's speed
        scale = {
            "H": f / length * np.outer(unit, unit), "c": f * unit, "W": unit, "R": length / f, "w": length,
            "mu": 1.0, "S": unit, "R_s": length / f, "w_s": length, "F": f,
        }  # fmt: skip
        scale = {name: np.asarray(value, float) for name, value in scale.items()}
        # v' = length v / unit; rows are lengths per coordinate.
        other = ContactProblem(
            **{name: np.ascontiguousarray(getattr(p, name) * scale[name]) for name in DATA}, quantum=p.quantum
        )
        direction = random_direction(rng, p)
        rows = len(p.w)
        again = Sensitivity(other, s.v * length / unit, s.force[:rows] * f, s.force[rows:] * f)
        assert (again.weak, again.weak_rows) == (s.weak, s.weak_rows)
        a, b = s.forward(**direction), again.forward(**{n: direction[n] * scale[n] for n in DATA})
        np.testing.assert_allclose(b.v * unit[:, None] / length, a.v, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(b.force / f, a.force, rtol=1e-6, atol=1e-8)


def test_wrong_arguments_are_named() -> None:
    p = one_contact(2, (-1.0, 0.0), 0.5)
    solved = rw.solve(p)
    for active in (np.nan, -1.0, 1.0, "a", None):
        with pytest.raises(ValueError, match=r"^active: "):
            sensitivity(p, solved, active)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^solution: is that of another"):
        sensitivity(one_contact(2, (-1.0, 0.1), 0.5), solved)
    s = sensitivity(p, solved)
    masked = np.ma.array(p.c, mask=True)
    for wrong in (
        "a",
        masked,
        ["1.0"] * len(p.c),
        np.full(len(p.c), 1j),
        [np.nan] * len(p.c),
        np.zeros((2, 2)),
        [],
    ):
        with pytest.raises(ValueError, match=r"^v: "):
            s.gradient(v=wrong)
    with pytest.raises(ValueError, match=r"^c: must be numbers"):
        s.forward(c="a")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"mass": 1.0}, "mass: is none of H"),
        ({"c": [1.0]}, "c: has shape"),
        ({"c": [np.nan, 0.0]}, "c: must be finite"),
        ({"mu": [1.0]}, "mu: entry 0 is zero where nothing slips"),
    ],
)
def test_wrong_input(data: dict[str, list[float]], message: str) -> None:
    p = one_contact(2, (-1.0, 0.0), 0.0)
    s = sensitivity(p, rw.solve(p))
    with pytest.raises(ValueError, match=message):
        s.forward(**data)


def test_units_are_even_whatever_those_of_the_matrix() -> None:
    """Each round halves the logarithms; thirty take twelve decades to a part in ten millions."""
    rng = np.random.default_rng(0)
    matrix, own = rng.normal(size=(12, 12)), 10.0 ** rng.uniform(-6.0, 6.0, 12)
    matrix = (matrix + matrix.T) * own[:, None] * own
    unit = units(matrix)
    np.testing.assert_allclose((np.abs(matrix) * unit[:, None] * unit).max(axis=1), 1.0, rtol=1e-6)
