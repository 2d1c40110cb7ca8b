"""Planar tasks that others published, planned here: which rungs are reached, and in how many seconds.

    python benchmarks/published_tasks.py [--folder ../shared/tasks] [--seeds 5] [--limit 60] [--tasks hidex]

Each scene of the folder is planned on the default schedule from the seeds 0, 1, ..., for as long as the
limit allows. A rung counts for a plan that was found where its replay there, at a tenth of the plan's error
per step, comes to the goal. Where a table of the folder's README has a column on the authors or on what was
published, its cell stands below the task's row. One line says so where the folder is missing.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

import rungwise as rw
from rungwise.planning.lift.lift import TENTH

FOLDER = Path(__file__).parents[2] / "shared" / "tasks"
RUNGS = rw.LADDER[2:]
"""Rungs on which plans are replayed: those that know forces."""
THEIRS = ("author", "publish")
"""What the head of a column of the README says that tells what its authors' planner does."""


def reached(plan: rw.Plan) -> list[str]:
    """Names of the rungs on which a plan comes to its goal."""
    runs = {rung.name: plan.replay(rung, tol=TENTH * plan.tol) for rung in RUNGS} if plan.segments else {}
    return [name for name, run in runs.items() if run.outcome.code == rw.Code.GOAL]


def print_task(scene: rw.Scene, seeds: Sequence[int], limit: float) -> None:
    """One row for a task: how many seeds end with a plan, in how many seconds, and where plans hold."""
    seconds, holds, found = list[float](), Counter[str](), 0
    for seed in seeds:
        began = time.perf_counter()
        plan = rw.plan(scene, seed=seed, budget=None, limit=limit)
        seconds.append(time.perf_counter() - began)
        found += plan.found
        holds.update(reached(plan) if plan.found else [])
    print(
        f"{scene.name:36} {found:3} of {len(seeds):2} {np.median(seconds):9.2f} {max(seconds):8.2f}  "
        + "  ".join(f"{holds[rung.name]:{len(rung.name)}}" for rung in RUNGS),
        flush=True,
    )


def published(readme: Path) -> dict[str, str]:
    """By patterns of tasks' names, what a README's table says of the authors' planner."""
    lines = readme.read_text("utf-8").splitlines() if readme.is_file() else []
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines if "|" in line]
    heads = next((row for row in rows if row[0].lower() in ("file", "task", "scene")), [])
    column = next((k for k, head in enumerate(heads) if any(word in head.lower() for word in THEIRS)), None)
    if column is None:
        return {}
    return {row[0].strip("`"): row[column] for row in rows if len(row) > column and row[0].startswith("`")}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--limit", type=float, default=60.0)
    parser.add_argument("--tasks", default="", help="beginnings of their names, with commas between")
    given = parser.parse_args(arguments)
    files = sorted(given.folder.glob("*.yaml"))
    if not files:
        print(f"no scenes in {given.folder}: nothing is planned")
        return
    theirs = published(given.folder / "README.md")
    print(
        f"{'task':36} {'planned':>9} {'median s':>9} {'max s':>8}  " + "  ".join(rung.name for rung in RUNGS)
    )
    for file in files:
        if file.stem.startswith(tuple(given.tasks.split(","))):
            print_task(rw.load(file), range(given.seeds), given.limit)
            told = next((text for name, text in theirs.items() if fnmatchcase(file.stem, name)), "")
            if told:
                print(f"  its authors: {told}")


if __name__ == "__main__":
    main()
