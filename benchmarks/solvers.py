"""Contact problems: the solvers that the default chain calls, the residual reached, the time, and Siconos'.

    OMP_NUM_THREADS=1 python benchmarks/solvers.py [FOLDER] [--repeats N] [--only TEXT] [--siconos [PYTHON]]
                                                   [--save FOLDER]

FOLDER holds problem files (FCLIB, Siconos text, ContactBench); without it, ../shared/problems if it is there.
Stacks, piles, a tower, a wall, an arch and balls are generated in any case; `--save` writes them (FCLIB).
Everything is solved to a residual of 1e-8, and times are the least of N repeats, in microseconds of the
processor.

  cold      `rw.solve` of a problem never seen: elimination, scaling, solvers, judgement
  again     the same of a problem solved before, from nothing: what is prepared from a problem is kept
  warm      the same started from the answer, its forces changed by one part in a million
  compiled  the prepared problem from nothing, and from forces changed by one part in a thousand, called from
            compiled code: up to 200 unknowns, - where Gauss-Seidel and Newton steps alone do not get there
  residual  the worse of the unit-free natural map and the imbalance; what decides
  Siconos   the least time of its solvers, driver alone on a prepared problem, that got to the same residual;
            ratio: `compiled`, or where there is none `again`, over it. With `--siconos` only, for contacts
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
import numpy as np
import siconos_best
from assemblies import generated

import rungwise as rw
from rungwise.contact.fclib import write_fclib
from rungwise.contact.read import read_problem
from rungwise.contact.solvers.gauss_seidel import SMALL, accepts, alternate, workspace
from rungwise.contact.solvers.measure import natural
from rungwise.contact.system import System, scaled
from rungwise.kernel import Ints, Reals

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "problems"
SUFFIXES = (".dat", ".hdf5", ".npz")
TOL = 1e-8


def problems(folder: Path | None) -> Iterator[tuple[str, rw.Problem]]:
    yield from generated()
    for path in sorted(folder.iterdir()) if folder else ():
        if path.suffix in SUFFIXES:
            try:
                yield path.name, read_problem(path)
            except ValueError as error:
                print(f"{path.name:44.44s} {error}")


def least_time(work: Callable[[], object], repeats: int) -> float:
    """Microseconds of the quickest of so many."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return 1e6 * min(times)


def copied(p: rw.Problem) -> rw.Problem:
    return rw.Problem(p.A, p.b, p.mu, p.directions, p.lower, p.upper, p.velocities)


@numba.njit
def repeat(
    row_start: Ints,
    column: Ints,
    value: Reals,
    A: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    start: Reals,
    x: Reals,
    best: Reals,
    tol: float,
    dampings: Reals,
    square: Reals,
    vectors: Reals,
    order: Ints,
    times: int,
) -> None:
    """Solve so many times, each from `start`."""
    for _ in range(times):
        for i in range(len(x)):
            x[i] = best[i] = start[i]
        alternate(
            row_start, column, value, A, blocks, diagonal, b, mu, lower, upper, x, best, tol, dampings,
            square, vectors, order,
        )  # fmt: skip


def compiled(system: System, start: np.ndarray, repeats: int) -> float | None:
    """Microseconds of one compiled solve from `start`; None if it does not converge."""
    s, best = system, np.empty(system.size)
    times = max(1, 40_000 // s.size**2)
    arguments = (
        s.row_start, s.column, s.value, s.dense(), s.blocks, s.diagonal, s.b, s.mu, s.lower, s.upper, start,
        np.empty(s.size), best, TOL, *workspace(s.size),
    )  # fmt: skip
    repeat(*arguments, 1)
    if natural(s, best) > TOL:
        return None
    return least_time(lambda: repeat(*arguments, times), repeats) / times


def both_compiled(problem: rw.Problem, found: rw.ContactSolution, repeats: int) -> list[float | None]:
    system = scaled(problem)
    if not 0 < system.size <= SMALL or not accepts(system):
        return [None, None]
    answer = found.x[system.kept] / system.force
    starts = np.zeros(system.size), answer * (1.0 + 1e-3)
    return [compiled(system, start, repeats) for start in starts]


def row(name: str, problem: rw.Problem, repeats: int, python: str | None) -> float | None:
    """Print one row; the ratio to Siconos, if there is one."""
    found = rw.solve(problem, tol=TOL)  # compiles
    rw.solve(problem, tol=TOL, start=found.x * (1.0 + 1e-6))
    fresh = iter([copied(problem) for _ in range(repeats)])
    cold = least_time(lambda: rw.solve(next(fresh), tol=TOL), repeats)
    again = least_time(lambda: rw.solve(problem, tol=TOL), repeats)
    near = found.x * (1.0 + 1e-6)
    warm = least_time(lambda: rw.solve(problem, tol=TOL, start=near), repeats)
    alone = both_compiled(problem, found, repeats)
    best = siconos_best.best(python, problem, TOL) if python else None
    ratio = None if best is None else (again if alone[0] is None else alone[0]) / (1e6 * best.seconds)
    told = "" if best is None else f"{1e6 * best.seconds:9.1f} {ratio:6.2f} {best.solver:26s}"
    chain = " > ".join(f"{a.solver} {a.iterations}" for a in found.attempts) or "-"
    print(
        f"{name:41.41s} {len(problem.b):5d} {found.status:13s} {found.residuals.worst:8.1e} {cold:9.1f}"
        f" {again:9.1f} {warm:9.1f} {' '.join('      -' if one is None else f'{one:7.1f}' for one in alone)} "
        f"{told or ('' if python is None else ' ' * 16 + ' ' * 27)} {chain}",
        flush=True,
    )
    return ratio


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER if FOLDER.is_dir() else None)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--only", default="", help="problems whose name has this in it")
    parser.add_argument(
        "--siconos", nargs="?", const="", help="a Python that has it; looked for if not given"
    )
    parser.add_argument("--save", type=Path, help="write the generated problems here and end")
    given = parser.parse_args()
    if given.save is not None:
        given.save.mkdir(parents=True, exist_ok=True)
        for name, problem in generated():
            write_fclib(given.save / f"{name.replace(', ', '_').replace(' ', '_')}.hdf5", problem, title=name)
        return
    python = None if given.siconos is None else siconos_best.interpreter(given.siconos or None)
    if given.siconos is not None and python is None:
        print("no Python here can import siconos (Debian: apt-get install python3-siconos)")
    columns = f"{'cold':>9s} {'again':>9s} {'warm':>9s} {'compiled':>15s}"
    peer = "" if python is None else f"  {'Siconos':>8s}  {'ratio':6s}{'its solver':26s}"
    print(f"{'problem':41s} {'size':>5s} {'status':13s} {'residual':>8s} {columns} {peer}  chain")
    ratios = [
        row(name, problem, given.repeats, python)
        for name, problem in problems(given.folder)
        if given.only in name
    ]
    known = np.array([ratio for ratio in ratios if ratio is not None])
    if len(known):
        mean = np.exp(np.log(known).mean())
        print(f"{len(known)} ratios: geometric mean {mean:.2f}, worst {known.max():.2f}")


if __name__ == "__main__":
    main()
