"""Siconos beside `rw.solve`: the same problem in its file format, each solver in a process of its own.

Siconos comes with its own Python (Debian's python3-siconos), so it is reached by way of files.
"""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import siconos_peer

import rungwise as rw
from rungwise.contact.judge import judge
from rungwise.contact.system import System, scaled

PYTHONS = ("python3", "/usr/bin/python3")
LIMIT, START, SOLVES = 5.0, 1.5, 100
"""Seconds that a solver gets for a problem, unless it could have been best in less: its start and solves."""
DENSE = 300


@dataclass(frozen=True)
class Best:
    """Solver (and storage) that was fastest to `natural` <= the tolerance, and its time in seconds."""

    solver: str
    seconds: float
    natural: float


def interpreter(given: str | None = None) -> str | None:
    """A Python that can import siconos; None when there is none."""
    for python in (given,) if given else PYTHONS:
        try:
            found = subprocess.run([python, "-c", "import siconos.numerics"], capture_output=True, timeout=30)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if found.returncode == 0:
            return python
    return None


def best(python: str, problem: rw.Problem, tol: float) -> Best | None:
    """The fastest of Siconos' solvers, judged as our own answers are; None without contacts or answer."""
    system, found = scaled(problem), None
    with tempfile.TemporaryDirectory() as folder:
        for kind, storage, text in _forms(problem, system):
            file = Path(folder) / f"{kind}_{storage}.dat"
            file.write_text(text)
            for solver in siconos_peer.SOLVERS[kind]:
                out = file.with_suffix(f".{solver}.npz")
                limit = LIMIT if found is None else min(LIMIT, START + SOLVES * found.seconds)
                _run(python, file, kind, solver, problem.velocities, out, limit)
                if not out.exists():
                    continue
                with np.load(out) as told:
                    for seconds, r in zip(told["times"], told["r"], strict=True):
                        natural = judge(problem, system, _whole(system, r)).natural
                        if natural <= tol and (found is None or seconds < found.seconds):
                            found = Best(f"{kind} {solver} ({storage})", float(seconds), natural)
    return found


def _run(python: str, file: Path, kind: str, solver: str, velocities: int, out: Path, limit: float) -> None:
    """Whatever happens to the process, what it wrote counts."""
    command = [python, siconos_peer.__file__, str(file), kind, solver, str(velocities), str(out)]
    try:
        subprocess.run(command, capture_output=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return


def _whole(system: System, r: np.ndarray) -> np.ndarray:
    """All unknowns, from contact forces."""
    return system.recover(r) if len(r) == system.size else np.full(len(system.kept), np.inf)


def _forms(problem: rw.Problem, system: System) -> list[tuple[str, str, str]]:
    """Kind, storage and text of the files: condensed, and global where there are velocities."""
    d, contacts = problem.directions, len(problem.mu)
    if contacts == 0 or d == 1 or system.size != problem.rows:
        return []
    W = sp.csr_array(sp.diags_array(system.rate) @ system.matrix() @ sp.diags_array(1.0 / system.force))
    q, head = system.b * system.rate, f"{d}\n{contacts}\n"
    kind = f"fc{d}d"
    forms = [(kind, "blocks", head + _blocks(W, d) + _vectors(q, problem.mu))]
    if len(q) <= DENSE:
        forms.append((kind, "dense", head + _dense(W) + _vectors(q, problem.mu)))
    rows, n = problem.rows, problem.velocities
    if d == 3 and n and rows + n == len(problem.b):
        A = sp.csr_array(problem.A)
        matrices = _listing(A[rows:, rows:]) + _listing(sp.csr_array(A[:rows, rows:].T))
        vectors = _vectors(-problem.b[rows:], problem.b[:rows], problem.mu)
        forms.append(("gfc3d", "sparse", head + matrices + vectors))
    return forms


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
