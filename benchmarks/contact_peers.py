"""Siconos and Pinocchio beside `rw.solve`: the same problem in their formats, the answers judged as our own.

Each is given the problem as it is where it has a format for it, and what is left after elimination, in the
problem's units and in those of `rungwise.contact.prepare.system`; it is run with ever tighter tolerances of
its own until our judge accepts. What a form takes to prepare is counted as time of the peer.
"""

from __future__ import annotations

import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
import pinocchio_peer
import scipy.sparse as sp
import siconos_peer
from peer_process import Answer, Peer, Task

import rungwise as rw
from rungwise.contact.judge.residuals import judge
from rungwise.contact.prepare.system import System, scaled

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


class Cost(NamedTuple):
    """Seconds that it takes us to eliminate what is free, and to do so and scale what is left."""

    own: float = 0.0
    scaled: float = 0.0


FREE = Cost()


@dataclass(frozen=True)
class Form:
    """A problem as a peer reads it: `task` without tolerance; `whole`: its forces to all our unknowns;
    `preparation`: seconds from the problem as it was given to the numbers of this form."""

    name: str
    solvers: tuple[str, ...]
    task: Task
    whole: Whole
    preparation: float = 0.0


@dataclass
class Best:
    """What a peer did with a problem.

    solver, seconds: the fastest to a residual of at most the tolerance, preparation and all, or without
    one the most accurate; residual: what it reached; alone: the least time of a solve to the tolerance,
    whatever was prepared for it; unfinished: solvers that used up their time, and might do better with more.
    """

    solver: str = "-"
    seconds: float = np.inf
    residual: float = np.inf
    alone: float = np.inf
    unfinished: list[str] = field(default_factory=list)

    def room(self, preparation: float) -> float:
        """Seconds of a solve that would still be the best in one way or the other."""
        return max(self.alone, self.seconds - preparation)


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
            if found.residual <= tol and START + SOLVES * found.room(form.preparation) <= had:
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
        reached, room = found.residual <= tol, found.room(form.preparation)
        limit = min(most, START + SOLVES * room) if reached else most
        if limit <= 0.0:
            return number, used
        slow = SLOWER * room if reached else np.inf
        answer, spent = peer.ask(form.task | {"solver": solver, "tol": own, "slow": slow}, limit)
        used += spent
        stopped = limit == most and spent > PART * limit
        if answer is None:
            return (number if stopped else None), used
        residual = judge(problem, scaled(problem), form.whole(answer.forces)).worst
        _keep(found, f"{solver} ({form.name})", answer, form.preparation, residual, tol)
        if residual <= tol or (reached and answer.seconds > room):
            break
        if stopped and not answer.converged:
            return number, used
    return None, used


def _keep(found: Best, name: str, answer: Answer, preparation: float, residual: float, tol: float) -> None:
    total = preparation + answer.preparation + answer.seconds
    if residual <= tol:
        found.alone = min(found.alone, answer.seconds)
    quicker = residual <= tol and (found.residual > tol or total < found.seconds)
    if quicker or (found.residual > tol and residual < found.residual):
        found.solver, found.seconds, found.residual = name, total, residual


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
    def forms(self, problem: rw.Problem, cost: Cost = FREE) -> list[Form]:
        """What it reads for `problem`, written to the folder; none where it has no format for it."""


class Siconos(Project):
    """Siconos' solvers of friction, of (mixed) linear complementarity and of relays, called from a C loop."""

    needed, pythons = "import siconos.numerics", (sys.executable, "python3", "/usr/bin/python3")

    def start(self, python: str) -> Peer:
        loop, source = self.folder / "loop.so", Path(__file__).with_name("siconos_loop.c")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(loop), str(source)], check=True)
        return Peer(python, siconos_peer.__file__, str(loop))

    def forms(self, problem: rw.Problem, cost: Cost = FREE) -> list[Form]:
        own = self._of_contacts if len(problem.mu) else self._of_limits
        return list(own(problem, scaled(problem), cost))

    def _of_limits(self, problem: rw.Problem, system: System, cost: Cost) -> Iterator[Form]:
        """MLCPs as they are and without what is free; LCPs; relays."""
        others = ~problem.free
        if 0 < others.sum() < len(others) and _is_complementary(problem.lower[others], problem.upper[others]):
            places = np.concatenate([np.flatnonzero(problem.free), np.flatnonzero(others)])
            text = _mixed(problem.A, problem.b, places, len(places) - int(others.sum()))
            yield self._form("mlcp", "mixed, own", text, len(places), 0, lambda z: z[np.argsort(places)])
        for left in _reductions(problem, system, cost):
            M, q, size = left.matrix, left.offset, system.size
            if size and _is_complementary(left.lower, left.upper):
                data = {"M": M.toarray(), "q": q}
                yield self._form("lcp", left.units, data, size, 0, left.whole, left.preparation)
            elif size and np.isfinite([left.lower, left.upper]).all():
                text = f"{size}\n" + _dense(M) + _vectors(q, left.lower, left.upper)
                yield self._form("relay", left.units, text, size, 0, left.whole, left.preparation)

    def _of_contacts(self, problem: rw.Problem, system: System, cost: Cost) -> Iterator[Form]:
        if not _is_local(problem, system):
            return
        d, k = problem.directions, len(problem.mu)
        head, kind = f"{d}\n{k}\n", f"fc{d}d"
        for left in _reductions(problem, system, cost):
            W, size, vectors = left.matrix, system.size, _vectors(left.offset, problem.mu)
            for storage, written in (
                ("blocks", _blocks(W, d)),
                ("dense", _dense(W) if size <= DENSE else ""),
            ):
                if written:
                    yield self._form(
                        kind, f"{storage}, {left.units}", head + written + vectors, size, 0, left.whole,
                        left.preparation,
                    )  # fmt: skip
        if problem.velocities and problem.rows + problem.velocities == len(problem.b):
            H, c, W, w, places = _balance_in_space(problem)
            written = _listing(H) + _listing(sp.csr_array(W.T)) + _vectors(-c, w, problem.mu)
            name = "mixed, own" if d == 3 else "mixed, lifted"
            whole = _after(system.recover, places)
            yield self._form("gfc3d", name, f"3\n{k}\n" + written, len(w), len(c), whole)

    def _form(
        self,
        kind: str,
        name: str,
        data: str | dict[str, np.ndarray],
        rows: int,
        velocities: int,
        whole: Whole,
        preparation: float = 0.0,
    ) -> Form:
        ending = "dat" if isinstance(data, str) else "npz"
        file = self.folder / f"{kind}_{name.replace(', ', '_')}.{ending}"
        if isinstance(data, str):
            file.write_text(data)
        else:
            np.savez(file, **data)
        task = {"file": str(file), "kind": kind, "rows": rows, "velocities": velocities}
        return Form(name, siconos_peer.SOLVERS[kind], task, whole, preparation)


class Pinocchio(Project):
    """Pinocchio's ADMM and projected Gauss-Seidel, for contacts in space; planar ones are lifted."""

    needed, pythons = "from pinocchio import ADMMConstraintSolver", (sys.executable,)

    def start(self, python: str) -> Peer:
        return Peer(python, pinocchio_peer.__file__)

    def forms(self, problem: rw.Problem, cost: Cost = FREE) -> list[Form]:
        system, forms = scaled(problem), []
        if not _is_local(problem, system):
            return []
        for left in _reductions(problem, system, cost):
            G, g, normal_first = in_space(left.matrix.toarray(), left.offset, problem.directions)
            file = self.folder / f"{left.units}.npz"
            np.savez(file, G=G, g=g, mu=problem.mu)
            task, whole = {"file": str(file)}, _after(left.whole, normal_first)
            forms.append(Form(left.units, pinocchio_peer.SOLVERS, task, whole, left.preparation))
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


def _balance_in_space(
    problem: rw.Problem,
) -> tuple[sp.csr_array, np.ndarray, sp.csr_array, np.ndarray, np.ndarray]:
    """H, c, W and w of H v + c = W^T r, u = W v + w with the normal first of three, and the places of our
    forces in r. The second tangent of a planar contact is the velocity of a body of its own, which rests."""
    d, k, rows = problem.directions, len(problem.mu), problem.rows
    A = sp.csr_array(problem.A)
    H, W, c, w = A[rows:, rows:], A[:rows, rows:], problem.b[rows:], problem.b[:rows]
    if d == 3:
        return H, c, W, w, np.arange(rows)
    places = (3 * np.arange(k)[:, None] + np.arange(d)).ravel()
    down = sp.csr_array((np.ones(rows), (places, np.arange(rows))), shape=(3 * k, rows))
    idle = sp.csr_array((np.ones(k), (3 * np.arange(k) + 2, np.arange(k))), shape=(3 * k, k))
    H = sp.block_diag([H, H.diagonal().mean() * sp.eye_array(k)], format="csr")
    return H, np.append(c, np.zeros(k)), sp.hstack([down @ W, idle], format="csr"), down @ w, places


def _is_local(problem: rw.Problem, system: System) -> bool:
    """Whether contacts are all that is left once the free unknowns are eliminated."""
    return len(problem.mu) > 0 and problem.directions > 1 and system.size == problem.rows


class Reduction(NamedTuple):
    """What is left of a problem in some units: matrix (n, n), offset (n,), limits of what is no contact
    (m,); the way back to all unknowns; and the seconds that it took to make."""

    units: str
    matrix: sp.csr_array
    offset: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    whole: Whole
    preparation: float


def _reductions(problem: rw.Problem, system: System, cost: Cost) -> Iterator[Reduction]:
    """In the problem's own units, which is the problem itself where nothing is eliminated, and without."""
    force, rate, A = system.force, system.rate, system.matrix()
    limited = system.kept[system.rows :] - system.rows
    if system.size == len(problem.b):
        own, offset = sp.csr_array(problem.A), problem.b
    else:
        own = sp.csr_array(sp.diags_array(rate) @ A @ sp.diags_array(1.0 / force))
        offset = system.b * rate
    lower, upper = problem.lower[limited], problem.upper[limited]
    yield Reduction("own", own, offset, lower, upper, system.recover, cost.own)
    yield Reduction(
        "scaled", A, system.b, system.lower, system.upper, lambda x: system.recover(force * x), cost.scaled
    )


def _is_complementary(lower: np.ndarray, upper: np.ndarray) -> bool:
    return not lower.any() and bool(np.isposinf(upper).all())


def _mixed(A: sp.csr_array | np.ndarray, b: np.ndarray, places: np.ndarray, free: int) -> str:
    """An MLCP whose unknowns are those in these places, the first so many free: whole, and in its blocks."""
    M, q, n = sp.csr_array(A).toarray()[np.ix_(places, places)], b[places], len(places)
    e, c = slice(free), slice(free, n)
    head = f"1\n1\n{free}\n{n - free}\n0 {free} {n}\n0 1\n"
    blocks = (M[e, e], M[c, c], M[e, c], M[c, e], q[None, e], q[None, c])
    return head + _dense(sp.csr_array(M)) + _vectors(q) + "".join(_vectors(*block) for block in blocks)


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
