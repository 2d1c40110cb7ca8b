"""Planar tasks that others published, planned here: which rungs are reached, and in how many seconds.

    python benchmarks/published_tasks.py [--folder ../shared/tasks] [--seeds 5] [--limit 60] [--tasks hidex]
        [--schedules [--longer]] [--relatives 2] [--quasistatic]

Each scene of the folder is planned on the default schedule from the seeds 0, 1, ..., for as long as the
limit allows. A rung counts for a plan that was found where its replay there, at a tenth of the plan's error
per step, comes to the goal. Where a table of the folder's README has a column on the authors or on what was
published, its cell stands below the task's row. One line says so where the folder is missing.

With --quasistatic a plan that does not hold on quasistatic-rigid is followed by a search for one that ends
there, with the same limit; the column counts that, too, and a line below the row says how often.

With --relatives each task is planned in so many relatives, tasks of the same kind with other numbers
(`relatives.py`), instead; the last line says of how many every seed ends with a plan.

With --schedules each of these tasks that suits contact modes, and each shipped scene with `task.fingers`, is
planned in four ways, all ways of a seed in turn: with and without contact modes, on quasistatic-rigid and
then on dynamic-compliant (the ladder), or on dynamic-compliant alone. A task counts as solved where there is
a plan on dynamic-compliant, and as held where its replay at a tenth of the error comes to the goal there.
Searches that find nothing count with their seconds; a ">" stands before the ratio where at least half do.
With --longer only the tasks of `longer_tasks.py` are planned so.
Steps are medians, searches that found nothing included; so are the seconds of `searching`, those on stages,
without the diagnosis between stages and the replay that confirms a plan.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import yaml
from arguments import of_tasks
from longer_tasks import longer
from relatives import relative

import rungwise as rw
from rungwise.planning.lift.lift import TENTH
from rungwise.planning.modes import planner
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

FOLDER = Path(__file__).parents[2] / "shared" / "tasks"
RUNGS = rw.LADDER[2:]
"""Rungs on which plans are replayed: those that know forces."""
LOWER = rw.QUASISTATIC_RIGID
"""The rung whose plans are to hold without inertia."""
THEIRS = ("author", "publish")
"""What the head of a column of the README says that tells what its authors' planner does."""
LIBRARY = Path(rw.__file__).parent / "scene" / "library"
THIRD = 1 / 3
"""Part of the time of the best other way that a ladder has to stay within to pay clearly."""
WARMING = 0.1
"""Part of the limit for which each way is tried before what counts, so that kernels are there."""


class Way(NamedTuple):
    """How tasks are planned: a schedule, with contact modes or with moves that are drawn and run alone."""

    schedule: str
    by_modes: bool

    def plan(self, scene: rw.Scene, seed: int, limit: float) -> rw.Plan:
        """A plan, or what is known after so many seconds."""
        with nullcontext() if self.by_modes else patch.object(planner, "suits", lambda _work: False):
            return rw.plan(scene, schedule=self.schedule, seed=seed, budget=None, limit=limit)


WAYS = {
    "modes, ladder": Way("quasistatic", True),
    "modes, last rung alone": Way("direct", True),
    "no modes, ladder": Way("quasistatic", False),
    "no modes, last rung": Way("direct", False),
}
"""The first one is what the others are compared with."""


@dataclass
class Found:
    """How many plans were found, how many of them hold at a tenth of their error, and the seconds of all."""

    solved: int = 0
    held: int = 0
    seconds: list[float] = field(default_factory=list)

    def count(self, plan: rw.Plan, seconds: float) -> None:
        """Count a plan, and replay it."""
        self.seconds.append(seconds)
        if plan.found:
            run = plan.replay(rw.DYNAMIC_COMPLIANT, tol=TENTH * plan.tol)
            self.solved, self.held = self.solved + 1, self.held + (run.outcome.code == rw.Code.GOAL)

    @property
    def mostly_fails(self) -> bool:
        """Whether the median of seconds is the limit's, not a plan's."""
        return 2 * self.solved <= len(self.seconds)


@dataclass
class Tally(Found):
    """What came of the seeds of one task, planned in one way."""

    searching: list[float] = field(default_factory=list)
    steps: dict[str, list[int]] = field(default_factory=lambda: {rung.name: [] for rung in RUNGS})

    def add(self, way: Way, scene: rw.Scene, seed: int, limit: float) -> None:
        """Plan a task from a seed, and replay the plan."""
        began = time.perf_counter()
        plan = way.plan(scene, seed, limit)
        self.count(plan, time.perf_counter() - began)
        self.searching.append(sum(record.seconds for record in plan.records))
        for name, counts in self.steps.items():
            counts.append(sum(r.steps for r in plan.records if r.stage.split(" ")[0] == name))


def reached(plan: rw.Plan) -> list[str]:
    """Names of the rungs on which a plan comes to its goal."""
    runs = {rung.name: plan.replay(rung, tol=TENTH * plan.tol) for rung in RUNGS} if plan.segments else {}
    return [name for name, run in runs.items() if run.outcome.code == rw.Code.GOAL]


def print_task(scene: rw.Scene, seeds: Sequence[int], limit: float, quasistatic: bool = False) -> bool:
    """One row for a task: how many seeds end with a plan, in how many seconds, and where plans hold. Returns
    whether all do."""
    seconds, holds, found, others = list[float](), Counter[str](), 0, list[float]()
    for seed in seeds:
        began = time.perf_counter()
        plan = rw.plan(scene, seed=seed, budget=None, limit=limit)
        seconds.append(time.perf_counter() - began)
        found += plan.found
        rungs = reached(plan) if plan.found else []
        holds.update(rungs)
        if quasistatic and LOWER.name not in rungs:
            began = time.perf_counter()
            other = rw.plan(scene, to=LOWER, schedule="direct", seed=seed, budget=None, limit=limit)
            if other.found:
                holds[LOWER.name] += 1
                others.append(time.perf_counter() - began)
    print(
        f"{scene.name:36} {found:3} of {len(seeds):2} {np.median(seconds):9.2f} {max(seconds):8.2f}  "
        + "  ".join(f"{holds[rung.name]:{len(rung.name)}}" for rung in RUNGS),
        flush=True,
    )
    if others:
        print(f"  {LOWER.name}: {len(others)} of its own, in at most {max(others):.2f} s", flush=True)
    return found == len(seeds)


def published(readme: Path) -> dict[str, str]:
    """By patterns of tasks' names, what a README's table says of the authors' planner."""
    lines = readme.read_text("utf-8").splitlines() if readme.is_file() else []
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines if "|" in line]
    heads = next((row for row in rows if row[0].lower() in ("file", "task", "scene")), [])
    column = next((k for k, head in enumerate(heads) if any(word in head.lower() for word in THEIRS)), None)
    if column is None:
        return {}
    return {row[0].strip("`"): row[column] for row in rows if len(row) > column and row[0].startswith("`")}


def print_head() -> None:
    """What stands above rows for tasks."""
    print(
        f"{'task':36} {'planned':>9} {'median s':>9} {'max s':>8}  " + "  ".join(rung.name for rung in RUNGS)
    )


def print_relatives(files: Sequence[Path], count: int, seeds: Sequence[int], limit: float) -> None:
    """A row for each relative of each task, and of how many all seeds end with a plan."""
    print_head()
    whole = list[bool]()
    for file in files:
        data = yaml.safe_load(file.read_text("utf-8"))
        for number in range(count):
            own = relative(data, number)
            if own is None:
                print(f"{file.stem:36} has no relatives")
                break
            whole.append(print_task(rw.load(own), seeds, limit))
    print(f"planned from every seed: {sum(whole)} of {len(whole)} relatives")


def print_all(files: Sequence[Path], seeds: Sequence[int], limit: float, quasistatic: bool) -> None:
    """A row for each task, and what is known of its authors' planner."""
    theirs = published(files[0].parent / "README.md")
    print_head()
    for file in files:
        print_task(rw.load(file), seeds, limit, quasistatic)
        told = next((text for name, text in theirs.items() if fnmatchcase(file.stem, name)), "")
        if told:
            print(f"  its authors: {told}")


def with_fingers() -> list[Path]:
    """The shipped scenes whose task names fingers."""
    loaded = {file: rw.load(file) for file in sorted(LIBRARY.glob("*.yaml"))}
    return [file for file, scene in loaded.items() if scene.file.task is not None and scene.file.task.fingers]


def suits_modes(scene: rw.Scene) -> bool:
    """Whether plans of a task are made by contact modes at all."""
    return planner.suits(begin(task_of(scene), Budget(), 0, None))


def print_schedules(scenes: Sequence[rw.Scene], seeds: Sequence[int], limit: float) -> None:
    """A row for each task and way, and in how many tasks the first way is faster than all others, and the
    ways by contact modes faster than those without."""
    print(
        f"{'task':34} {'way':22} {'solved':>8} {'held':>5} {'median s':>9} {'ratio':>7} {'searching':>9}"
        f" {'quasistatic-rigid':>18} {'dynamic-compliant':>18}"
    )
    gains, by_modes = dict[str, float](), dict[str, float]()
    for scene in scenes:
        if not suits_modes(scene):
            print(f"{scene.name:34} inputs alone lead its robots: no contact modes")
            continue
        tallies = {label: Tally() for label in WAYS}
        for way in WAYS.values():
            Tally().add(way, scene, seeds[0], WARMING * limit)
        for seed in seeds:
            for label, way in WAYS.items():
                tallies[label].add(way, scene, seed, limit)
        gains[scene.name] = print_tallies(scene.name, tallies)
        by_modes[scene.name] = _best(tallies, False) / _best(tallies, True)
    if gains:
        third = [name for name, gain in gains.items() if gain * THIRD >= 1.0]
        print(f"a third of the time of the best other way, or less: {len(third)} of {len(gains)} tasks")
        print(f"faster than the best other way: {sum(gain > 1.0 for gain in gains.values())} of {len(gains)}")
        third = [name for name, gain in by_modes.items() if gain * THIRD >= 1.0]
        print(
            "by contact modes, on whichever rungs, a third of the time of drawn moves, or less:"
            f" {len(third)} of {len(by_modes)} tasks"
        )


def _best(tallies: Mapping[str, Tally], by_modes: bool) -> float:
    """The least median of the ways by contact modes, or of the others; 1e9 where they mostly find nothing."""
    own = [tally for label, tally in tallies.items() if WAYS[label].by_modes == by_modes]
    return min((float(np.median(tally.seconds)) for tally in own if not tally.mostly_fails), default=1e9)


def print_tallies(name: str, tallies: Mapping[str, Tally]) -> float:
    """The rows of a task; how many times the time of the first way the best other one takes, infinitely many
    where none of the others, and 0 where the first one mostly finds nothing."""
    medians = {label: float(np.median(tally.seconds)) for label, tally in tallies.items()}
    first, *others = tallies
    for label, tally in tallies.items():
        ratio = f"{'>' if tally.mostly_fails else ''}{medians[label] / medians[first]:.2f}"
        steps = [np.median(tally.steps[rung.name]) for rung in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT)]
        print(
            f"{name:34} {label:22} {tally.solved:2} of {len(tally.seconds):2} {tally.held:5}"
            f" {medians[label]:9.2f} {ratio:>7} {np.median(tally.searching):9.2f}"
            f" {steps[0]:18.0f} {steps[1]:18.0f}",
            flush=True,
        )
    if tallies[first].mostly_fails:
        return 0.0
    best = min((medians[other] for other in others if not tallies[other].mostly_fails), default=math.inf)
    return best / medians[first]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = of_tasks(__doc__.splitlines()[0], FOLDER, 5, 60.0)
    parser.add_argument(
        "--schedules", action="store_true", help="with and without the ladder and contact modes"
    )
    parser.add_argument(
        "--relatives", type=int, default=0, help="so many tasks of the same kind as each, drawn"
    )
    parser.add_argument(
        "--quasistatic", action="store_true", help="other plans for the rung on which one does not hold"
    )
    parser.add_argument("--longer", action="store_true", help="longer tasks in place of all others")
    given = parser.parse_args(arguments)
    named = tuple(given.tasks.split(","))
    files = [file for file in sorted(given.folder.glob("*.yaml")) if file.stem.startswith(named)]
    if given.schedules:
        files += [file for file in with_fingers() if file.stem.startswith(named) and file not in files]
    if given.schedules and given.longer:
        scenes = [scene for scene in longer(given.folder) if scene.name.startswith(named)]
        print_schedules(scenes, range(given.seeds), given.limit)
    elif not files:
        print(f"no scenes in {given.folder}: nothing is planned")
    elif given.relatives:
        print_relatives(files, given.relatives, range(given.seeds), given.limit)
    elif given.schedules:
        print_schedules([rw.load(file) for file in files], range(given.seeds), given.limit)
    else:
        print_all(files, range(given.seeds), given.limit, given.quasistatic)


if __name__ == "__main__":
    main()
