"""Siconos and Pinocchio beside `rw.solve`: the same problem in their formats, the answers judged as our own.

Each is given the Delassus form in the problem's units and in those of `rungwise.contact.system`, and what
else it has a format for, and is run with ever tighter tolerances of its own until our judge accepts.
"""

from __future__ import annotations

import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
import pinocchio_peer
import scipy.sparse as sp
import siconos_peer
from peer_process import Answer, Peer, Task

import rungwise as rw
from rungwise.contact.judge import judge
from rungwise.contact.system import System, scaled

TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
BUDGET, LIMITS = 25.0, (0.4, 1.5, 5.0)
"""Processor seconds that a peer gets for a problem; those that one solver gets at one tolerance at first, and
again where it was stopped, while the budget lasts."""
START, SOLVES, SLOWER = 0.2, 20.0, 3.0
"""Beside one that is best so far a solver gets no more than this to begin and so many solves of the best, and
is not timed again once a single solve takes so much longer."""
PART = 0.5
"""Of its limit: one that used more and did not converge was stopped."""
DENSE = 300


Whole = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Form:
    """A problem as a peer reads it: `task` without tolerance; `whole`: its forces to all our unknowns."""

    name: str
    solvers: tuple[str, ...]
    task: Task
    whole: Whole


@dataclass
class Best:
    """What a peer did with a problem.

    solver, seconds: the fastest to a natural map of at most the tolerance, or without one the most accurate;
    natural: what it reached; unfinished: solvers that used up their time, and might do better with more.
    """

    solver: str = "-"
    seconds: float = np.inf
    natural: float = np.inf
    unfinished: list[str] = field(default_factory=list)


def interpreter(needed: str, given: str, others: tuple[str, ...]) -> str | None:
    """A Python that can do what is `needed`: the given one, or without one the first of the others."""
    for python in (given,) if given else others:
        try:
            found = subprocess.run([python, "-c", needed], capture_output=True, timeout=60)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if found.returncode == 0:
            return python
    return None


def best(peer: Peer, forms: list[Form], problem: rw.Problem, tol: float) -> Best | None:
    """The fastest of the peer's solvers on all its forms of `problem`; None where it has no form for it."""
    if not forms:
        return None
    found, left = Best(), BUDGET
    waiting = [(form, solver, 0) for form in forms for solver in form.solvers]
    had = 0.0
    for limit in LIMITS:
        stopped = []
        for form, solver, first in waiting:
            if found.natural <= tol and START + SOLVES * found.seconds <= had:
                continue
            last, spent = _climb(peer, form, solver, first, problem, tol, found, min(limit, left))
            left = max(0.0, left - spent)
            if last is not None:
                stopped.append((form, solver, last))
        waiting, had = stopped, limit
    found.unfinished = [f"{solver} ({form.name})" for form, solver, _ in waiting]
    return found


def _climb(
    peer: Peer, form: Form, solver: str, first: int, problem: rw.Problem, tol: float, found: Best, most: float
) -> tuple[int | None, float]:
    """Ask for tighter tolerances, from the first-th, until one is good enough or none could be best.

    Returns which one took more than its limit, `most` or less, if one did, and the seconds used.
    """
    used = 0.0
    for number, own in enumerate(TOLERANCES[first:], first):
        reached = found.natural <= tol
        limit = min(most, START + SOLVES * found.seconds) if reached else most
        if limit <= 0.0:
            return number, used
        slow = SLOWER * found.seconds if reached else np.inf
        answer, spent = peer.ask(form.task | {"solver": solver, "tol": own, "slow": slow}, limit)
        used += spent
        stopped = limit == most and spent > PART * limit
        if answer is None:
            return (number if stopped else None), used
        natural = judge(problem, scaled(problem), form.whole(answer.forces)).natural
        _keep(found, f"{solver} ({form.name})", answer, natural, tol)
        if natural <= tol or (reached and answer.seconds > found.seconds):
            break
        if stopped and not answer.converged:
            return number, used
    return None, used


def _keep(found: Best, name: str, answer: Answer, natural: float, tol: float) -> None:
    quicker = natural <= tol and (found.natural > tol or answer.seconds < found.seconds)
    if quicker or (found.natural > tol and natural < found.natural):
        found.solver, found.seconds, found.natural = name, answer.seconds, natural


class Project(ABC):
    """Another project: what a Python must do to run it, where one may be found, and its formats."""

    needed: ClassVar[str]
    pythons: ClassVar[tuple[str, ...]]

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @abstractmethod
    def start(self, python: str) -> Peer:
        """The running peer."""

    @abstractmethod
    def forms(self, problem: rw.Problem) -> list[Form]:
        """What it reads for `problem`, written to the folder; none where it has no format for it."""


class Siconos(Project):
    """Siconos' solvers of friction and of linear complementarity; its drivers are called from a C loop."""

    needed, pythons = "import siconos.numerics", (sys.executable, "python3", "/usr/bin/python3")

    def start(self, python: str) -> Peer:
        loop, source = self.folder / "loop.so", Path(__file__).with_name("siconos_loop.c")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(loop), str(source)], check=True)
        return Peer(python, siconos_peer.__file__, str(loop))

    def forms(self, problem: rw.Problem) -> list[Form]:
        return list(self._forms(problem, scaled(problem)))

    def _forms(self, problem: rw.Problem, system: System) -> Iterator[Form]:
        d, k = problem.directions, len(problem.mu)
        if k == 0 and system.size and not system.lower.any() and np.isposinf(system.upper).all():
            for units, M, q, whole in _units(system):
                yield self._form("lcp", units, {"M": M.toarray(), "q": q}, len(q), 0, whole)
        if not _is_local(problem, system):
            return
        head, kind = f"{d}\n{k}\n", f"fc{d}d"
        for units, W, q, whole in _units(system):
            text = head + _blocks(W, d) + _vectors(q, problem.mu)
            yield self._form(kind, f"blocks, {units}", text, len(q), 0, whole)
            if len(q) <= DENSE:
                yield self._form(
                    kind, f"dense, {units}", head + _dense(W) + _vectors(q, problem.mu), len(q), 0, whole
                )
        rows, n = problem.rows, problem.velocities
        if d == 3 and n and rows + n == len(problem.b):
            A = sp.csr_array(problem.A)
            matrices = _listing(A[rows:, rows:]) + _listing(sp.csr_array(A[:rows, rows:].T))
            vectors = _vectors(-problem.b[rows:], problem.b[:rows], problem.mu)
            yield self._form("gfc3d", "mixed, own", head + matrices + vectors, rows, n, system.recover)

    def _form(
        self,
        kind: str,
        name: str,
        data: str | dict[str, np.ndarray],
        rows: int,
        velocities: int,
        whole: Whole,
    ) -> Form:
        ending = "dat" if isinstance(data, str) else "npz"
        file = self.folder / f"{kind}_{name.replace(', ', '_')}.{ending}"
        if isinstance(data, str):
            file.write_text(data)
        else:
            np.savez(file, **data)
        task = {"file": str(file), "kind": kind, "rows": rows, "velocities": velocities}
        return Form(name, siconos_peer.SOLVERS[kind], task, whole)


class Pinocchio(Project):
    """Pinocchio's ADMM and projected Gauss-Seidel, for contacts in space; planar ones are lifted."""

    needed, pythons = "from pinocchio import ADMMConstraintSolver", (sys.executable,)

    def start(self, python: str) -> Peer:
        return Peer(python, pinocchio_peer.__file__)

    def forms(self, problem: rw.Problem) -> list[Form]:
        system, forms = scaled(problem), []
        if not _is_local(problem, system):
            return []
        for units, W, q, whole in _units(system):
            G, g, normal_first = in_space(W.toarray(), q, problem.directions)
            file = self.folder / f"{units}.npz"
            np.savez(file, G=G, g=g, mu=problem.mu)
            forms.append(
                Form(units, pinocchio_peer.SOLVERS, {"file": str(file)}, _after(whole, normal_first))
            )
        return forms


def _after(whole: Whole, places: np.ndarray) -> Whole:
    return lambda forces: whole(forces[places])


def in_space(W: np.ndarray, q: np.ndarray, d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Delassus matrix and offset with tangents first, and the places in them of the unknowns of W r + q.

    A planar contact gets a second tangent that nothing else moves and whose velocity is zero without force:
    by maximum dissipation its force is zero, and the others are what they were.
    """
    k = len(q) // d
    places = (3 * np.arange(k)[:, None] + np.array([2, 0, 1])[:d]).ravel()
    G, g = np.zeros((3 * k, 3 * k)), np.zeros(3 * k)
    G[np.ix_(places, places)], g[places] = W, q
    if d == 2:
        idle = 3 * np.arange(k) + 1
        G[idle, idle] = W.diagonal().reshape(k, d).mean(axis=1)
    return G, g, places


def _is_local(problem: rw.Problem, system: System) -> bool:
    """Whether contacts are all that is left once the free unknowns are eliminated."""
    return len(problem.mu) > 0 and problem.directions > 1 and system.size == problem.rows


def _units(
    system: System,
) -> Iterator[tuple[str, sp.csr_array, np.ndarray, Whole]]:
    """Name, matrix, offset, and forces to all unknowns: in the problem's own units, and without."""
    force, rate, A = system.force, system.rate, system.matrix()
    own = sp.csr_array(sp.diags_array(rate) @ A @ sp.diags_array(1.0 / force))
    yield "own", own, system.b * rate, system.recover
    yield "scaled", A, system.b, lambda x: system.recover(force * x)


def _vectors(*vectors: np.ndarray) -> str:
    return "".join(" ".join(f"{x:.17g}" for x in vector) + "\n" for vector in vectors)


def _dense(W: sp.csr_array) -> str:
    m, n = W.shape
    return f"0\n{m}\n{n}\n{m} {n}\n" + _vectors(*W.toarray().T)


def _blocks(W: sp.csr_array, d: int) -> str:
    size, blocks = W.shape[0], sp.bsr_array(W, blocksize=(d, d))
    k, ends = size // d, " ".join(str(i) for i in range(d, size + 1, d))
    start, column = (" ".join(map(str, index)) for index in (blocks.indptr, blocks.indices))
    head = f"1\n{size}\n{size}\n{blocks.nnz // d**2}\n{k}\n{k}\n{ends}\n{ends}\n"
    head += f"{k + 1}\n{blocks.nnz // d**2}\n{start}\n{column}\n"
    return head + "".join(f"{i}\n" + _vectors(block.T.ravel()) for i, block in enumerate(blocks.data))


def _listing(matrix: sp.csr_array) -> str:
    (m, n), entries = matrix.shape, sp.coo_array(matrix)
    head = f"2\n{m}\n{n}\n1\nCSparse\ntriplet: {m}-by-{n}, nzmax: {entries.nnz} nnz: {entries.nnz}\n"
    lines = zip(*entries.coords, entries.data, strict=True)
    return head + "".join(f"    {i} {j} : {x:.17g}\n" for i, j, x in lines)
