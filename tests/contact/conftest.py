"""Problems by hand and at random, and the solvers without their bookkeeping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from rungwise.contact.kinds.cone import KIND as CONE
from rungwise.contact.solver.guess import solve_by_modes, solve_mode
from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.solver.residual import residual_of_rows
from rungwise.contact.solver.step import solve_groups
from rungwise.contact.step import FORWARD, NO_SURFACES, OPEN, STICK, TOLERANCE, matrix_size
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns, allocate_problem

Array = NDArray[np.float64]


class Candidate(NamedTuple):
    """Velocities (n,), contact forces (k d,), forces of limited rows (b,), their residual, and the mode."""

    v: Array
    force: Array
    limited: Array
    residual: float
    mode: NDArray[np.int64]


Solver = Callable[..., tuple[int, Candidate]]


def _body(n: int, contacts: int, limited: int = 0, directions: int = 2) -> ContactProblem:
    problem = allocate_problem(n, contacts, limited, directions)
    problem.H[:] = 10.0 * np.eye(n)
    return problem


@pytest.fixture
def body() -> Callable[..., ContactProblem]:
    """A problem with H = 10 and nothing else: body(n, contacts, limited, directions)."""
    return _body


def _spd(rng: np.random.Generator, n: int, least: float) -> Array:
    a = rng.normal(size=(n, n))
    return a @ a.T + least * np.eye(n)


def _random_problem(rng: np.random.Generator, most: int = 4) -> ContactProblem:
    n, contacts, limited = int(rng.integers(1, 7)), int(rng.integers(1, most + 1)), int(rng.integers(0, 3))
    p = allocate_problem(n, contacts, limited)
    p.H[:] = _spd(rng, n, 0.1)
    p.c[:] = rng.normal(size=n) * rng.integers(0, 2)
    p.W[:] = rng.normal(size=p.W.shape)
    p.w[:] = rng.normal(size=p.w.shape) * rng.integers(0, 2, size=p.w.shape)
    p.mu[:] = rng.choice([0.0, 0.2, 0.7, 1.5], contacts)
    for k in range(contacts):
        if rng.random() < 0.3:
            p.R[k] = _spd(rng, 2, 0.01) * 10.0 ** rng.uniform(-4, 0)
        if k and rng.random() < 0.2:
            p.W[2 * k : 2 * k + 2], p.w[2 * k : 2 * k + 2], p.mu[k] = p.W[:2], p.w[:2], p.mu[0]
    p.S[:], p.w_s[:] = rng.normal(size=p.S.shape), rng.normal(size=limited)
    p.R_s[:], p.F[:] = rng.choice([0.0, 0.1], limited), rng.choice([0.0, 0.5, 5.0, np.inf], limited)
    return p


@pytest.fixture
def random_problem() -> Callable[..., ContactProblem]:
    """random_problem(rng, most contacts): rigid and compliant contacts, equal rows, drives, joints."""
    return _random_problem


def _in_units(p: ContactProblem, coordinates: Array, force: float, speed: float) -> ContactProblem:
    """The same problem when v counts in units of speed / coordinates, and forces in `force`."""
    s, x = coordinates, p.R.shape[1]
    q = allocate_problem(len(p.c), len(p.mu), len(p.F), x)
    q.H[:], q.c[:] = p.H * np.outer(s, s) * (force / speed), p.c * s * force
    q.W[:], q.S[:], q.mu[:] = p.W * s, p.S * s, p.mu
    q.w[:], q.w_s[:], q.F[:] = p.w * speed, p.w_s * speed, p.F * force
    q.R[:], q.R_s[:] = p.R * (speed / force), p.R_s * (speed / force)
    return q


@pytest.fixture
def in_units() -> Callable[..., ContactProblem]:
    return _in_units


def _measure(
    problem: ContactProblem, v: Sequence[float], force: Sequence[float], tau: Sequence[float] = ()
) -> float:
    contacts, limited = len(problem.mu), len(problem.F)
    arrays = [np.array(x, float) for x in (v, force, tau)]
    found = Unknowns(np.ones(contacts + limited, np.int64), *arrays)
    scratch = np.zeros((3, contacts * problem.R.shape[1] + limited + 12))
    return float(residual_of_rows(problem, Sizes(len(problem.c), contacts, limited), found, scratch))


@pytest.fixture
def measure() -> Callable[..., float]:
    """measure(problem, v, force, tau): the residual."""
    return _measure


def _enumerate(p: ContactProblem, sizes: Sizes, out: Unknowns, room: Elimination) -> bool:
    """Whether some mode's linear system solves the problem, into `out`: four modes of a contact, three of a
    limited row."""
    contacts, limited = sizes.contacts, sizes.limited
    held = [range(OPEN, OPEN + 4) if mu > 0.0 else (OPEN, FORWARD) for mu in p.mu]
    held += [range(STICK, STICK + 3) if np.inf > F else (STICK,) for F in p.F]
    for modes in product(*held):
        out.mode[: contacts + limited] = modes
        solve_mode(p, sizes, out, room)
        if residual_of_rows(p, sizes, out, room.matrix) <= TOLERANCE:
            return True
    return False


def _run(
    solver: str,
    p: ContactProblem,
    mode: Sequence[int] | None = None,
    solves: int = 1,
    forces: tuple[Array, Array] | None = None,
) -> tuple[int, Candidate]:
    n, contacts, limited = len(p.c), len(p.mu), len(p.F)
    size, sizes = matrix_size(n, contacts, limited), Sizes(n, contacts, limited)
    modes = np.ones(contacts + limited, np.int64) if mode is None else np.array(mode, np.int64)
    force, tau = forces or (np.zeros(2 * contacts), np.zeros(limited))
    out = Unknowns(modes, np.zeros(n), force.copy(), tau.copy())
    halt = np.zeros(1, np.int64)
    room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
    status, nowhere = 0, np.empty((0, 4), np.int64)
    if solver == "planar":
        status, _, _ = solve_problem(p, sizes, out, NO_SURFACES, nowhere, nowhere, room, halt)
    elif solver == "groups":
        status, _, _, _ = solve_groups(p, sizes, out, CONE, NO_SURFACES, nowhere, nowhere, halt)
    elif solver == "modes":
        solve_by_modes(p, sizes, out, room, solves, halt)
    else:
        status = int(not _enumerate(p, sizes, out, room))
    found = residual_of_rows(p, sizes, out, room.matrix)
    return int(status), Candidate(out.v, out.force, out.tau, float(found), modes)


@pytest.fixture
def run() -> Solver:
    """run("planar" | "groups" | "modes" | "enumeration", problem, mode, solves, (force, tau)):
    (0 if solved, solution)."""
    return _run
