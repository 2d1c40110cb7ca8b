"""Problems with a planted solution: how often `rw.solve` finds one, and whether it ever says a wrong word.

    OMP_NUM_THREADS=1 python benchmarks/planted.py [FOLDER] [--each N] [--only TEXT] [--seed S] [--worst]

A matrix is kept, a solution x and rates y that obey all laws are drawn, and b = y - A x. So there is a
solution: `jammed` and `unsupported` are wrong. The matrices are those of the problem files in FOLDER
(../shared/problems, if it is there) and random ones: mixed problems whose free block has a condition of up to
1e12, contacts whose masses differ by up to 1e10 and stiffnesses by up to 1e12, circuits with relays and with
ideal diodes. Three kinds of loads: `full`, every unknown and every rate is drawn; `few`, up to three laws
are, and all else is zero, so that many laws hold at their corners; and for circuits of diodes and resistors,
which always have a solution, `loaded`, up to two sources and nothing else. `--units` draws units, that many
decades from their own, for the rows and for the unknowns of problems without contacts; answers are then
measured in their own.

  wrong     answers that are `jammed` or `unsupported`
  loose     answers that are `solved`, and violate a law by more than 1e-7 of the row's own |A| |x| + |b|
  open      answers that are `not_converged`
  worst     the largest violation of an answer that is `solved`, in the row's own terms
  ms        mean time of a call
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.files.read import read_problem

Rng = np.random.Generator
LOOSE, FAINT = 1e-7, 1e-6
"""What a row's violation must not exceed, beside its terms; which count as no less than this share of what
the largest unknown would make of them: below 1e-13 of that lies rounding, in rows where all is zero."""
_LARGEST = 700
"""Unknowns up to which a published matrix is taken: others take seconds a call."""


class Planted(NamedTuple):
    """A problem and a solution x (N,) of it."""

    problem: rw.Problem
    x: np.ndarray


def plant(rng: Rng, problem: rw.Problem) -> Planted:
    """The problem with another offset, of which a random x is a solution."""
    x, y = _contacts(rng, problem)
    for lower, upper in zip(problem.lower, problem.upper, strict=True):
        own = _limited(rng, float(lower), float(upper))
        x, y = np.append(x, own[0]), np.append(y, own[1])
    if rng.random() < 0.5:  # rates of the size of the rows' terms
        size = abs(problem.A) @ np.abs(x)
        for k in range(len(problem.mu)):
            own = slice(k * problem.directions, (k + 1) * problem.directions)
            size[own] = size[own].max()
        y = y * np.where(size > 0.0, size, 1.0)
    p = problem
    b = y - p.A @ x
    return Planted(rw.Problem(p.A, b, p.mu, p.directions, p.lower, p.upper, p.velocities), x)


def plant_few(rng: Rng, problem: rw.Problem) -> Planted:
    """The problem with an offset, of which an x is a solution in which few laws are not at their corners."""
    p, d, (full, x) = problem, problem.directions, plant(rng, problem)
    y, contacts, laws = p.A @ x + full.b, len(p.mu), len(p.mu) + len(p.lower)
    drawn = set(rng.choice(laws, min(laws, int(rng.integers(1, 4))), replace=False).tolist())
    for law in range(laws):
        rows = slice(law * d, law * d + d) if law < contacts else slice(p.rows + law - contacts, None)
        own = range(len(x))[rows][: d if law < contacts else 1]
        if law not in drawn or rng.random() < 0.5:
            y[own] = 0.0
        if law not in drawn:
            least, most = (0.0, 0.0) if law < contacts else (p.lower[law - contacts], p.upper[law - contacts])
            x[own] = min(max(0.0, least), most)
    return Planted(rw.Problem(p.A, y - p.A @ x, p.mu, d, p.lower, p.upper, p.velocities), x)


def loaded(rng: Rng, problem: rw.Problem) -> rw.Problem:
    """The circuit with up to two sources."""
    p, b = problem, np.zeros(len(problem.b))
    free = np.flatnonzero(p.free)
    for i in rng.choice(free, min(len(free), int(rng.integers(1, 3))), replace=False):
        b[i] = rng.choice([1.0 / 3.0, 0.1, -0.7, 1.0, rng.normal()])
    return rw.Problem.boxes(p.A, b, p.lower, p.upper)


class Posed(NamedTuple):
    """A problem that has a solution, and the problem to solve: the same with unknowns in these units (N,)."""

    problem: rw.Problem
    asked: rw.Problem
    unit: np.ndarray


def posed(rng: Rng, problem: rw.Problem, decades: float = 0.0) -> Posed:
    """The problem, without contacts in units up to so many decades from its own."""
    p, size = problem, len(problem.b)
    if not decades or p.rows or p.velocities:
        return Posed(p, p, np.ones(size))
    row, unit = (10.0 ** rng.uniform(-decades, decades, size) for _ in range(2))
    A = sp.diags_array(row) @ sp.csr_array(p.A) @ sp.diags_array(unit)
    return Posed(p, rw.Problem.boxes(A.toarray(), row * p.b, p.lower / unit, p.upper / unit), unit)


def _contacts(rng: Rng, problem: rw.Problem) -> tuple[np.ndarray, np.ndarray]:
    d, size = problem.directions, problem.rows
    x, y = np.zeros(size), np.zeros(size)
    for k, mu in enumerate(problem.mu):
        n, tangents = k * d, slice(k * d + 1, (k + 1) * d)
        along = rng.normal(size=d - 1)
        along /= np.linalg.norm(along) if d > 1 else 1.0
        mode = rng.choice(["open", "stick", "slip"])
        if mode == "open":
            y[n], y[tangents] = rng.exponential() + 0.01, rng.normal(size=d - 1)
            continue
        x[n] = rng.exponential() + 0.01
        x[tangents] = -mu * x[n] * along * (1.0 if mode == "slip" else rng.uniform(0.0, 0.95))
        y[tangents] = along * (rng.exponential() + 0.01) * (mode == "slip" or mu == 0.0)
    return x, y


def _limited(rng: Rng, lower: float, upper: float) -> tuple[float, float]:
    if np.isneginf(lower) and np.isposinf(upper):
        return float(rng.normal()), 0.0
    ends = [name for name, end in (("lower", lower), ("upper", upper)) if np.isfinite(end)]
    mode, rate = rng.choice(["inside", *ends]), rng.exponential() + 0.01
    if mode == "lower" or lower == upper:
        return lower, float(rate)
    if mode == "upper":
        return upper, -float(rate)
    if np.isfinite(lower) and np.isfinite(upper):
        return float(rng.uniform(0.05, 0.95) * (upper - lower) + lower), 0.0
    return (lower + float(rate), 0.0) if np.isfinite(lower) else (upper - float(rate), 0.0)


PLANTS: dict[str, Callable[[Rng, rw.Problem], Planted]] = {"full": plant, "few": plant_few}


def violation(problem: rw.Problem, x: np.ndarray) -> float:
    """The largest violation of a law by x, rates beside their row's terms |A| |x| + |b|, and forces by what
    they do to the rows, beside theirs; a contact's rows count alike. Written once more, without the judge."""
    p, d, A = problem, problem.directions, sp.csr_array(problem.A)
    y, terms = A @ x + p.b, abs(A) @ np.abs(x) + np.abs(p.b)
    terms = np.maximum(terms, FAINT * (abs(A) @ np.full(len(x), np.abs(x).max(initial=0.0))))
    for k in range(len(p.mu)):
        terms[k * d : k * d + d] = terms[k * d : k * d + d].max()
    rate = np.where(terms > 0.0, y / np.where(terms > 0.0, terms, 1.0), 0.0)
    share = abs(sp.diags_array(1.0 / np.where(terms > 0.0, terms, np.inf)) @ A).max(axis=0).toarray().ravel()
    worst = 0.0
    for k, mu in enumerate(p.mu):
        own, tangents = slice(k * d, k * d + d), slice(k * d + 1, k * d + d)
        force, slip = x[own] * share[own].max(), rate[tangents]
        normal, pull, speed = force[0], np.linalg.norm(force[1:]), np.linalg.norm(slip)
        along = (force[1:] / pull if pull > 0.0 else force[1:]) + (slip / speed if speed > 0.0 else slip)
        worst = max(
            worst, -rate[own][0], -normal, pull - mu * normal, min(normal, rate[own][0]),
            min(speed, mu * normal - pull), min(pull, speed) * float(np.linalg.norm(along)),
        )  # fmt: skip
    for j, (lower, upper) in enumerate(zip(p.lower, p.upper, strict=True)):
        i = p.rows + j
        above = (x[i] - lower) * share[i] if np.isfinite(lower) else np.inf
        below = (upper - x[i]) * share[i] if np.isfinite(upper) else np.inf
        worst = max(worst, -above, -below, min(rate[i], above), min(-rate[i], below))
    return float(worst)


def mixed(rng: Rng) -> rw.Problem:
    """A mixed complementarity problem whose free block has a condition of 1 to 1e12, entries of order 1."""
    g, k = int(rng.integers(2, 14)), int(rng.integers(1, 9))
    left, right = (np.linalg.qr(rng.normal(size=(g, g)))[0] for _ in range(2))
    values = np.logspace(0.0, -rng.uniform(0.0, 12.0), g)
    own, half, cross = (left * values) @ right, rng.normal(size=(k, k)), rng.normal(size=(g, k))
    kind, back = rng.choice(["monotone", "gauss", "any"]), -cross.T
    if kind == "monotone":
        own = (left * values) @ left.T
    elif kind == "any":
        back = rng.normal(size=(k, g))
    A = np.block([[half @ half.T + 0.1 * np.eye(k), back], [cross, own]])
    return rw.Problem.mlcp(A, np.zeros(g + k), np.arange(g + k) < k)


def bodies(rng: Rng) -> rw.Problem:
    """Contacts between bodies whose masses differ by up to 1e10, some compliant, stiffnesses up to 1e12
    apart; with the bodies' velocities, or without."""
    d = int(rng.integers(1, 4))
    n, k = int(rng.integers(2, 7)), int(rng.integers(1, 6))
    width = {1: 1, 2: 3, 3: 6}[d]
    H = 10.0 ** rng.uniform(-5.0, 5.0, n).repeat(width)
    W = np.zeros((k * d, n * width))
    for i in range(k):
        first, second = rng.choice(n, 2, replace=False)
        for body in (first, second)[: int(rng.integers(1, 3))]:
            W[i * d : i * d + d, body * width : (body + 1) * width] = rng.normal(size=(d, width))
    soft = (10.0 ** rng.uniform(-12.0, 0.0, k) * (rng.random(k) < 0.5)).repeat(d)
    mu = rng.choice([0.0, 0.3, 0.8], k)
    if rng.random() < 0.5:
        return rw.Problem.local((W / H) @ W.T + np.diag(soft), np.zeros(k * d), mu, d)
    return rw.Problem.balance(
        np.diag(H), np.zeros(n * width), W, np.zeros(k * d), mu, directions=d, R=np.diag(soft)
    )


def circuit(rng: Rng) -> rw.Problem:
    """A sampled circuit: its nodes are free, in chains of integrators as of delta-sigma modulators, and its
    comparators are relays, or pairs of complementarities; rates and units differ by many orders."""
    stages, order = int(rng.integers(1, 9)), int(rng.integers(1, 5))
    g, as_pairs = stages * order, bool(rng.random() < 0.5)
    step, gain = 10.0 ** rng.uniform(-7.0, -2.0), 10.0 ** rng.uniform(-1.0, 4.0)
    own, drive, sense = np.eye(g), np.zeros((g, stages)), np.zeros((stages, g))
    for stage in range(stages):
        for i in range(order):
            at = stage * order + i
            own[at, at] += step * 10.0 ** rng.uniform(-3.0, 3.0)
            if i:
                own[at, at - 1] = -step * 10.0 ** rng.uniform(0.0, 4.0)
            drive[at, stage] = step * 10.0 ** rng.uniform(0.0, 4.0)
        sense[stage, stage * order + order - 1] = 1.0
        if stage:
            own[stage * order, stage * order - 1] = -step * gain
    unit = 10.0 ** rng.uniform(-6.0, 6.0, g)
    own, drive = unit[:, None] * own, unit[:, None] * drive
    if not as_pairs:
        A = np.block([[own, drive], [-sense, np.zeros((stages, stages))]])
        A[g:, g:] += np.eye(stages) / gain
        free, limit = np.full(g, np.inf), np.ones(stages)
        return rw.Problem.boxes(A, np.zeros(len(A)), np.append(-free, -limit), np.append(free, limit))
    # The output 2 a - 1, 0 <= a _|_ c - s >= 0, 0 <= c _|_ 1 - a >= 0, s what is sensed.
    E, none = np.eye(stages), np.zeros((stages, stages))
    A = np.block([
        [own, 2.0 * drive, np.zeros((g, stages))], [-sense, E / gain, E], [0.0 * sense, -E, none],
    ])  # fmt: skip
    return rw.Problem.mlcp(A, np.zeros(len(A)), np.arange(len(A)) >= g)


def network(rng: Rng) -> rw.Problem:
    """Resistors between nodes, of which a tree leads to the ground, and ideal diodes between any two, some
    with a resistance; some resistors and sources are branches, whose currents are free unknowns."""
    g, k, m = (int(rng.integers(*ends)) for ends in ((2, 14), (1, 10), (0, 4)))
    nodes, spread, size = slice(0, g), rng.uniform(0.0, 4.0), g + m + k
    A = np.zeros((size, size))
    pairs = [(i, int(rng.integers(-1, i)) if i else -1) for i in range(g)]
    pairs += [tuple(rng.choice(g, 2, replace=False)) for _ in range(int(rng.integers(0, g)))]
    for ends in pairs:
        between = _between(ends, g)
        A[nodes, nodes] += 10.0 ** rng.uniform(-spread, 0.0) * np.outer(between, between)
    for i in range(g, size):
        first = int(rng.integers(0, g))
        other = int(rng.integers(-1, g))
        between = rng.choice([-1.0, 1.0]) * _between((first, other if other != first else -1), g)
        A[i, nodes], A[nodes, i] = between, -between
        A[i, i] = 10.0 ** rng.uniform(-5.0, 5.0) if i < g + m else 0.0
        if i >= g + m and rng.random() < 0.3:
            A[i, i] = 10.0 ** rng.uniform(-6.0, 0.0)
    return rw.Problem.mlcp(A, np.zeros(size), np.arange(size) >= g + m)


def _between(ends: tuple[int, ...], nodes: int) -> np.ndarray:
    """How the potentials of all nodes make the voltage between two, of which -1 is the ground."""
    row = np.zeros(nodes)
    for end, sign in zip(ends, (1.0, -1.0), strict=True):
        if end >= 0:
            row[end] = sign
    return row


def bridges(rng: Rng) -> rw.Problem:
    """One step of a chain of diode bridges: each rectifies an oscillator of a capacitor and a coil, and the
    next is driven by what it gives, through a resistor. A stage's unknowns: the oscillator's potential and
    current, the two potentials of its load, and after all of these its four diodes."""
    stages, step = int(rng.integers(1, 12)), 10.0 ** rng.uniform(-7.0, -2.0)
    g = 4 * stages
    A = np.zeros((2 * g, 2 * g))
    for stage in range(stages):
        a, coil, plus, minus = range(4 * stage, 4 * stage + 4)
        A[a, a] = 10.0 ** rng.uniform(-8.0, -4.0) / step
        A[a, coil], A[coil, a], A[coil, coil] = 1.0, -1.0, 10.0 ** rng.uniform(-4.0, -1.0) / step
        across = _between((plus, minus), g)
        filtered = 10.0 ** rng.uniform(-8.0, -4.0) / step * (rng.random() < 0.5)
        A[:g, :g] += (10.0 ** rng.uniform(-4.0, -1.0) + filtered) * np.outer(across, across)
        if stage:
            joined = _between((a, plus - 4), g)
            A[:g, :g] += 10.0 ** rng.uniform(-4.0, 0.0) * np.outer(joined, joined)
        for i, ends in enumerate(((plus, a), (a, minus), (plus, -1), (-1, minus))):
            diode = g + 4 * stage + i
            A[diode, :g], A[:g, diode] = _between(ends, g), -_between(ends, g)
    return rw.Problem.mlcp(A, np.zeros(2 * g), np.arange(2 * g) >= g)


DIODES: dict[str, Callable[[Rng], rw.Problem]] = {"network": network, "bridges": bridges}
"""Their matrix is positive semidefinite, and what the sources do is in its range: there is a solution
(Cottle, Pang, Stone: The Linear Complementarity Problem (1992), theorem 3.1.2)."""
FAMILIES: dict[str, Callable[[Rng], rw.Problem]] = {
    "mixed": mixed, "bodies": bodies, "circuit": circuit, **DIODES,
}  # fmt: skip


def published(folder: Path) -> Iterator[tuple[str, rw.Problem]]:
    """The problems of a folder's files, but for the largest."""
    for path in sorted([*folder.glob("*.dat"), *folder.glob("*.hdf5"), *folder.glob("*.npz")]):
        try:
            problem = rw.Problem.of(read_problem(path))
        except ValueError:  # rolling friction, for which there is no law here
            continue
        if len(problem.b) <= _LARGEST:
            yield path.name, problem


class Count(NamedTuple):
    """What became of so many calls."""

    calls: int
    wrong: int
    loose: int
    open: int
    worst: float
    seconds: float


def tried(rng: Rng, pose: Callable[[Rng], Posed], calls: int, show: bool = False) -> Count:
    """Solve that many problems that have a solution."""
    wrong = loose = still_open = 0
    largest = seconds = 0.0
    for call in range(calls):
        problem, asked, unit = pose(rng)
        began = time.perf_counter()
        found = rw.solve(asked)
        seconds += time.perf_counter() - began
        far = violation(problem, unit * found.x) if found.status == "solved" else 0.0
        wrong += found.status in ("jammed", "unsupported")
        still_open += found.status == "not_converged"
        loose += not far <= LOOSE
        largest = max(largest, far)
        if show and (found.status != "solved" or not far <= LOOSE):
            print(f"    call {call}: {found.status} {found.residuals.worst:.1e} {far:.1e} {found.chain}")
    return Count(calls, wrong, loose, still_open, largest, seconds)


Pose = Callable[[Rng], Posed]


def poses(draw: Callable[[Rng], rw.Problem], load: str = "full", decades: float = 0.0) -> Pose:
    """A function that draws a problem with such a load, in units so many decades apart."""

    def pose(rng: Rng) -> Posed:
        made = draw(rng)
        made = loaded(rng, made) if load == "loaded" else PLANTS[load](rng, made).problem
        return posed(rng, made, decades)

    return pose


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(__file__).resolve().parents[2] / "shared" / "problems"
    parser.add_argument("folder", nargs="?", type=Path, default=default)
    parser.add_argument("--each", type=int, default=100, help="right-hand sides for each matrix")
    parser.add_argument("--only", default="", help="matrices whose name has this text")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worst", action="store_true", help="print each call that is not solved")
    parser.add_argument("--units", type=float, default=0.0, help="decades by which units are drawn apart")
    given = parser.parse_args()
    matrices: list[tuple[str, Callable[[Rng], rw.Problem], int]] = [
        (name, draw, 10 * given.each) for name, draw in FAMILIES.items()
    ]
    if given.folder.is_dir():
        matrices += [(name, lambda _, p=p: p, given.each) for name, p in published(given.folder)]
    cases = [
        (name if load == "full" else f"{name}, {load}", poses(draw, load, given.units), calls)
        for name, draw, calls in matrices
        for load in ("full", "few", *(("loaded",) if name in DIODES else ()))
    ]
    total = Count(0, 0, 0, 0, 0.0, 0.0)
    print(f"{'':48}{'calls':>7}{'wrong':>7}{'loose':>7}{'open':>7}{'worst':>10}{'ms':>10}")
    for name, pose, calls in cases:
        if given.only not in name:
            continue
        rng = np.random.default_rng(given.seed)
        found = tried(rng, pose, calls, given.worst)
        _print(name, found)
        total = Count(*(max(a, b) if isinstance(a, float) and i == 4 else a + b
                        for i, (a, b) in enumerate(zip(total, found, strict=True))))  # fmt: skip
    _print("all", total)


def _print(name: str, c: Count) -> None:
    mean = 1e3 * c.seconds / max(c.calls, 1)
    print(f"{name:48}{c.calls:7}{c.wrong:7}{c.loose:7}{c.open:7}{c.worst:10.1e}{mean:10.2f}", flush=True)


if __name__ == "__main__":
    main()
