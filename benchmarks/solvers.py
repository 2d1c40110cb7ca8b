"""Contact problems, the solvers that the default chain calls, the residual reached, and the time.

    OMP_NUM_THREADS=1 python benchmarks/solvers.py [FOLDER] [--repeats N] [--only TEXT]

FOLDER holds problem files (FCLIB, Siconos text, ContactBench); without it, ../shared/problems if it is there.
Stacks and pyramids of boxes are generated in any case. Per problem the least time of N repeats.

  cold      `rw.solve` from nothing: validation, elimination, solvers, judgement
  warm      the same started from the answer, its forces changed by one part in a million
  compiled  Gauss-Seidel alone from compiled code, in microseconds, for up to 12 unknowns: from nothing, and
            from forces changed by one part in a thousand; to 1e-8, - where it does not get there
  residual  the worse of the unit-free natural map and the imbalance; what decides
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import rungwise as rw
from rungwise.contact.read import read_problem
from rungwise.contact.solvers.gauss_seidel import accepts, sweep_until
from rungwise.contact.system import System, scaled
from rungwise.kernel import Reals, kernel

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "problems"
SUFFIXES = (".dat", ".hdf5", ".npz")
STEP, GRAVITY = 1e-2, 9.81
CORNERS = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])

Contact = tuple[int, int, tuple[float, float, float]]
"""Body below (-1 the ground), body above, point; all normals are vertical."""


def resting(contacts: list[Contact], centres: np.ndarray, mu: float, push: float) -> rw.Problem:
    """One step from rest of unit boxes (mass 1) under gravity and random loads of size `push` (newtons)."""
    n, rng = 6 * len(centres), np.random.default_rng(0)
    W = sp.lil_array((3 * len(contacts), n))
    for k, (below, above, point) in enumerate(contacts):
        for row, direction in enumerate(np.eye(3)[[2, 0, 1]]):
            for body, sign in ((above, 1.0), (below, -1.0)):
                if body >= 0:
                    turn = np.cross(np.array(point) - centres[body], direction)
                    W[3 * k + row, 6 * body : 6 * body + 6] = sign * np.concatenate([direction, turn])
    mass = np.tile([1.0, 1.0, 1.0, 1 / 6, 1 / 6, 1 / 6], len(centres))
    load = np.zeros((len(centres), 6))
    load[:, :3] = push * rng.normal(size=(len(centres), 3))
    load[:, 2] -= GRAVITY
    w = np.zeros(3 * len(contacts))
    return rw.Problem.balance(
        sp.diags_array(mass / STEP), load.ravel(), sp.csr_array(W), w, np.full(len(contacts), mu)
    )


def stack(boxes: int, push: float = 0.0, mu: float = 0.5) -> rw.Problem:
    """Boxes one on another, four contacts each."""
    centres = np.array([[0.0, 0.0, 0.5 + i] for i in range(boxes)])
    contacts = [(i - 1, i, (x, y, float(i))) for i in range(boxes) for x, y in CORNERS]
    return resting(contacts, centres, mu, push)


def pyramid(base: int, push: float = 0.0, mu: float = 0.5) -> rw.Problem:
    """Each box on two below: four contacts with the ground, or eight with boxes."""
    place = {
        (level, j): (1.02 * j + 0.51 * level, level) for level in range(base) for j in range(base - level)
    }
    number = {key: i for i, key in enumerate(place)}
    centres = np.array([[x, 0.0, 0.5 + level] for x, level in place.values()])
    contacts: list[Contact] = []
    for (level, j), (x, _) in place.items():
        own = number[level, j]
        if level == 0:
            contacts += [(-1, own, (x + a, b, 0.0)) for a, b in CORNERS]
            continue
        for under in (j, j + 1):
            below = place[level - 1, under][0]
            ends = (max(x, below) - 0.5, min(x, below) + 0.5)
            contacts += [
                (number[level - 1, under], own, (a, b, float(level))) for a in ends for b in (-0.5, 0.5)
            ]
    return resting(contacts, centres, mu, push)


def problems(folder: Path | None) -> Iterator[tuple[str, rw.Problem]]:
    for boxes in (3, 10, 20):
        for push in (0.0, 3.0):
            yield f"stack of {boxes}, push {push:g}", stack(boxes, push)
    for base in (3, 6):
        for push in (0.0, 3.0, 10.0):
            yield f"pyramid on {base}, push {push:g}", pyramid(base, push)
    for path in sorted(folder.iterdir()) if folder else ():
        if path.suffix in SUFFIXES:
            try:
                yield path.name, read_problem(path)
            except ValueError as error:
                print(f"{path.name:44.44s} {error}")


def least_time(
    problem: rw.Problem, start: np.ndarray | None, repeats: int
) -> tuple[float, rw.ContactSolution]:
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        found = rw.solve(problem, start=start)
        times.append(time.perf_counter() - began)
    return min(times), found


@kernel
def repeat(
    row_start: np.ndarray,
    column: np.ndarray,
    value: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    start: Reals,
    x: Reals,
    best: Reals,
    scratch: Reals,
    tol: float,
    times: int,
) -> int:
    """Solve so many times, each from `start`; returns the sweeps of all."""
    total = 0
    for _ in range(times):
        for i in range(len(x)):
            x[i] = start[i]
        total += sweep_until(
            row_start,
            column,
            value,
            blocks,
            diagonal,
            b,
            0.0,
            mu,
            lower,
            upper,
            x,
            best,
            scratch,
            tol,
            200,
            200,
        )
    return total  # fmt: skip


def compiled(system: System, start: np.ndarray) -> float | None:
    """Microseconds of one compiled solve from `start`; None if it does not converge."""
    s, times = system, 5000
    arguments = (
        s.row_start, s.column, s.value, s.blocks, s.diagonal, s.b, s.mu, s.lower, s.upper, start,
        np.empty(s.size), np.empty(s.size), np.empty((3, max(s.size, 3))), 1e-8,
    )  # fmt: skip
    if repeat(*arguments, 1) >= 200:
        return None
    least = np.inf
    for _ in range(5):
        began = time.perf_counter()
        repeat(*arguments, times)
        least = min(least, time.perf_counter() - began)
    return 1e6 * least / times


def both_compiled(problem: rw.Problem, found: rw.ContactSolution) -> str:
    system = scaled(problem)
    if system.size > 12 or not accepts(system):
        return "-"
    answer = found.x[system.kept] / system.force
    told = [compiled(system, start) for start in (np.zeros(system.size), answer * (1.0 + 1e-3))]
    return " ".join("-" if one is None else f"{one:.1f}" for one in told)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER if FOLDER.is_dir() else None)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="problems whose name has this in it")
    given = parser.parse_args()
    print(
        f"{'problem':44s} {'unknowns':>8s} {'status':13s} {'residual':>8s}"
        f" {'cold ms':>9s} {'warm ms':>9s} {'compiled':>10s}  chain"
    )
    for name, problem in problems(given.folder):
        if given.only not in name:
            continue
        rw.solve(problem)  # compiles
        cold, found = least_time(problem, None, given.repeats)
        warm, _ = least_time(problem, found.x * (1.0 + 1e-6), given.repeats)
        chain = " > ".join(f"{a.solver} {a.iterations}" for a in found.attempts) or "-"
        print(
            f"{name:44.44s} {len(problem.b):8d} {found.status:13s} {found.residuals.worst:8.1e}"
            f" {1e3 * cold:9.3f} {1e3 * warm:9.3f} {both_compiled(problem, found):>10s}  {chain}",
            flush=True,
        )


if __name__ == "__main__":
    main()
