"""What each solver of the default chain decides: the problems of the tests, by the whole chain and by less.

    python benchmarks/chain.py [FOLDER] [--without NAME ...]

FOLDER holds published problems (as `benchmarks/solvers.py` takes it). The table counts which solver gave the
answer; with `--without`, how many problems end differently where those solvers are left out.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import planted  # beside this file

import rungwise as rw
from rungwise.contact.files.read import read_problem

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "contact"))
SEEDS, TRIALS = 2, 300


def problems(folder: Path | None) -> Iterator[tuple[str, rw.Problem]]:
    """Published, random and planted problems, each with the name of its set."""
    draw_random = importlib.import_module("test_random").random_problem
    for path in sorted(folder.glob("*.*")) if folder else ():
        try:
            yield "published", rw.Problem.of(read_problem(path))
        except ValueError:
            continue
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        for _ in range(TRIALS):
            yield "random", draw_random(rng)
    rng = np.random.default_rng(7)
    for draw in planted.FAMILIES.values():
        for _ in range(TRIALS // 3):
            yield "planted", planted.plant(rng, draw(rng))[0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="What each solver of the default chain decides.")
    parser.add_argument("folder", nargs="?", type=Path, help="folder of published problems")
    parser.add_argument("--without", nargs="*", default=[], help="solvers to leave out of the chain")
    options = parser.parse_args(arguments)
    chain = importlib.import_module("rungwise.contact.solve")
    whole = chain.SOLVERS
    fewer = tuple(solver for solver in whole if solver.NAME not in options.without)
    decided, different = Counter[tuple[str, str]](), []
    for name, problem in problems(options.folder):
        chain.SOLVERS = whole
        found = rw.solve(problem)
        by = found.attempts[-1].solver if found.attempts and found.status == rw.Status.SOLVED else "none"
        decided[name, by] += 1
        if options.without:
            chain.SOLVERS = fewer
            other = rw.solve(problem)
            if other.status != found.status:
                different.append((name, found.status.name, other.status.name))
    for (name, by), count in sorted(decided.items()):
        print(f"{name:10s} {by:16s} {count}")
    if options.without:
        print(f"without {', '.join(options.without)}: {len(different)} end differently", *different)
    return 0


if __name__ == "__main__":
    sys.exit(main())
