"""Published problems, where the folder with them lies beside the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.files.read import read_problem
from rungwise.contact.prepare.system import scaled

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "problems"
REFERENCES = sorted(FOLDER.glob("refs/*.ref.npz"))
pytestmark = pytest.mark.skipif(not REFERENCES, reason="the folder of published problems is not there")
INDETERMINATE = "OneObject"
"""Even its rates are not unique."""

KNOWN = {
    "lcp_CPS_2.dat": [0, 1, 3],
    "lcp_CPS_4.dat": [2, 2, 2, 92],
    "lcp_deudeu.dat": [4 / 3, 7 / 3],
    "lcp_ortiz.dat": [2 / 3, 0, 1 / 3, 0],
    "lcp_trivial.dat": [1 / i for i in range(1, 10)],
    "lcp_exp_murty.dat": [0, 0, 0, 0, 0, 1],
    "lcp_Pang_isolated_sol.dat": [1, 0, 0],
}


def natural_scaled(problem: rw.Problem, r: np.ndarray) -> float:
    """The residual of r in the Delassus form, written out once more: unit-free, exact cone."""
    d, A = problem.directions, problem.A
    A = A.toarray() if hasattr(A, "toarray") else A
    n = problem.rows
    W, q = A[:n, :n], problem.b[:n]
    if len(problem.lower):
        back = np.linalg.solve(A[n:, n:], np.column_stack([A[n:, :n], problem.b[n:]]))
        W, q = W - A[:n, n:] @ back[:, :-1], q - A[:n, n:] @ back[:, -1]
    u = (W @ r + q).reshape(-1, d)
    s = 1.0 / np.sqrt(np.abs(np.diag(W)).reshape(-1, d).mean(axis=1))[:, None]
    force, rate = r.reshape(-1, d) / s, u * s
    rate[:, 0] += problem.mu * np.linalg.norm(rate[:, 1:], axis=1)
    ahead = force - rate
    t, mu = np.linalg.norm(ahead[:, 1:], axis=1), problem.mu
    normal = np.where(
        t <= mu * ahead[:, 0], ahead[:, 0], np.maximum(ahead[:, 0] + mu * t, 0.0) / (1.0 + mu**2)
    )
    shrink = np.where(t > mu * normal, mu * normal / np.where(t > 0.0, t, 1.0), 1.0)
    onto = np.column_stack([normal, shrink[:, None] * ahead[:, 1:]])
    return float(np.linalg.norm(force - onto) / np.linalg.norm(s * q.reshape(-1, d)))


@pytest.mark.long
@pytest.mark.parametrize("reference", REFERENCES, ids=lambda path: path.name)
def test_every_contact_problem_with_a_reference(reference: Path) -> None:
    problem = read_problem(FOLDER / reference.name.removesuffix(".ref.npz"))
    found = rw.solve(problem)
    assert found.status == "solved"
    assert natural_scaled(problem, found.r) <= 1e-8
    if not reference.name.startswith(INDETERMINATE):
        with np.load(reference) as known:
            size = np.abs(known["u"]).max() + np.abs(scaled(problem).rate).max()
            np.testing.assert_allclose(found.u / size, known["u"] / size, atol=1e-6)


@pytest.mark.parametrize("name", KNOWN)
def test_every_lcp_with_a_known_answer(name: str) -> None:
    found = rw.solve(read_problem(FOLDER / name))
    assert found.status == "solved"
    np.testing.assert_allclose(found.z, KNOWN[name], atol=1e-8)


@pytest.mark.parametrize("name", sorted(p.name for p in FOLDER.glob("*lcp*.dat")))
def test_every_lcp_and_mlcp(name: str) -> None:
    problem = read_problem(FOLDER / name)
    found = rw.solve(problem)
    assert found.status == "solved"
    w, law = problem.A @ found.z + problem.b, np.isfinite(problem.lower)
    size = 1e-9 * max(
        1.0, np.abs(found.z).max(), np.abs(w).max(), np.abs(problem.A).max() * np.abs(found.z).max()
    )
    assert np.abs(np.minimum(found.z, w)[law]).max() <= size
    assert np.abs(w[~law]).max(initial=0.0) <= size


def test_the_traps() -> None:
    assert rw.solve(read_problem(FOLDER / "lcp_CPS_1.dat")).z.sum() == pytest.approx(1.0, abs=1e-9)
    game = rw.solve(read_problem(FOLDER / "lcp_CPS_3.dat"))
    assert np.abs(game.z).max() > 1e-3  # z = 0 is what some solvers call a solution
    w = game.problem.A @ game.z + game.problem.b
    np.testing.assert_allclose(np.minimum(game.z, w), 0.0, atol=1e-10)


@pytest.mark.few(7)
@pytest.mark.parametrize("name", ["lcp_CPS_1.dat", "lcp_CPS_3.dat", "lcp_Pang_isolated_sol.dat"])
@pytest.mark.parametrize("small", [1.0, 1e-6, 1e-12])
def test_a_trap_with_a_row_that_nothing_satisfies_is_never_solved(name: str, small: float) -> None:
    """One more unknown that does nothing, and a rate of -small that no unknown raises."""
    trap = read_problem(FOLDER / name)
    assert isinstance(trap, rw.Problem)
    size = len(trap.b)
    M = np.zeros((size + 1, size + 1))
    M[:size, :size] = trap.A.toarray() if hasattr(trap.A, "toarray") else trap.A
    found = rw.solve(rw.Problem.lcp(M, np.append(trap.b, -small)))
    assert found.status in ("jammed", "not_converged") and found.residuals.worst > found.tol
    if small > 1e-8:  # what `solutions` counts as rounding
        assert rw.solutions(found.problem).kind == "none"
