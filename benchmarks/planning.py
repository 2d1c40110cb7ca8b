"""How many drawn instances of each task are planned on dynamic-compliant, how fast, and in how many steps.

    python benchmarks/planning.py [--instances 50] [--first 0] [--tasks push,grasp] [--schedules]

Instance k of a task is drawn by its rules from the seed 1000 + k. It counts as solved if a replay of its
plan on dynamic-compliant, at a tenth of the plan's error per step, comes to the goal. Seconds are of one
process whose kernels are compiled, searches that found nothing included. With --schedules the four schedules
are compared, the ladders among them with other accuracies, too, and the RRT of OMPL: steps by rung and
accuracy, refused steps and those of failures included. Tasks may have other values of parameters:
--tasks push:v=0.3,push:stiffness=1e9.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from ompl_rrt import rrt

import rungwise as rw
from rungwise.planning.lift.lift import TENTH
from rungwise.planning.lift.stages import COARSE, FINE, SCHEDULES, Schedule

TASKS = ("push", "two_finger", "four_finger", "grasp")
FIRST_SEED = 1000
LIMIT = 60.0
"""Seconds that the baseline has for an instance."""


@dataclass
class Tally:
    """What came of the instances of one task with one schedule."""

    solved: int = 0
    seconds: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    moves: list[int] = field(default_factory=list)
    by_stage: Counter[str] = field(default_factory=Counter)

    def add(self, scene: rw.Scene, seed: int, schedule: Schedule | None) -> None:
        """Plan an instance, and confirm its plan."""
        began = time.perf_counter()
        plan = rw.plan(scene, task_seed=seed, schedule=schedule)
        self.seconds.append(time.perf_counter() - began)
        self.steps.append(sum(record.steps for record in plan.records))
        for record in plan.records:
            self.by_stage[record.stage] += record.steps
        if plan.found and is_confirmed(plan):
            self.solved += 1
            self.moves.append(len(plan.waypoints))


def is_confirmed(plan: rw.Plan) -> bool:
    """Whether the plan comes to its goal on the richest rung, at a tenth of its error per step."""
    run = plan.replay(rw.DYNAMIC_COMPLIANT, tol=TENTH * plan.tol)
    return bool(run.outcome.code == rw.Code.GOAL)


def print_tasks(names: Sequence[str], seeds: Sequence[int]) -> None:
    """One row for each task, on the default schedule."""
    print(
        f"{'task':20} {'solved':>12} {'median s':>9} {'max s':>8} {'med. steps':>11} {'max steps':>10}  moves"
    )
    for name in names:
        scene, found = warmed(name, seeds[0], None), Tally()
        for seed in seeds:
            found.add(scene, seed, None)
        print(
            f"{name:20} {found.solved:5} of {len(seeds):3} {np.median(found.seconds):9.2f}"
            f" {max(found.seconds):8.2f} {np.median(found.steps):11.0f} {max(found.steps):10}"
            f"  {', '.join(f'{count} of {k}' for k, count in sorted(Counter(found.moves).items()))}",
            flush=True,
        )


def print_schedules(names: Sequence[str], seeds: Sequence[int]) -> None:
    """One row for each task and schedule, with its steps by stage below."""
    print(
        f"{'task':20} {'schedule':19} {'solved':>10} {'total s':>8} {'median s':>9} {'total steps':>12}"
        f" {'on the last rung':>17}  moves"
    )
    for name in names:
        known = schedules()
        tallies = {label: Tally() for label in known}
        for schedule in known.values():
            scene = warmed(name, seeds[0], schedule)
        # All schedules of an instance in turn: what else the machine does meets them alike.
        for seed in seeds:
            for label, schedule in known.items():
                tallies[label].add(scene, seed, schedule)
        for label, found in tallies.items():
            last = sum(n for stage, n in found.by_stage.items() if stage.startswith("dynamic-compliant"))
            print(
                f"{name:20} {label:19} {found.solved:3} of {len(seeds):3} {sum(found.seconds):8.1f}"
                f" {np.median(found.seconds):9.2f} {sum(found.steps):12} {last:17}"
                f" {np.mean(found.moves or [0]):6.1f}",
                flush=True,
            )
            for stage, steps in found.by_stage.items():
                print(f"{'':40}{stage:30} {steps:11}")
        print_baseline(name, seeds)


def print_baseline(name: str, seeds: Sequence[int]) -> None:
    """One row for the baseline, whose plans are of coarse steps, of any number of moves, and unconfirmed."""
    scene = scene_of(name)
    rrt(scene, seeds[0], LIMIT)
    answers = [rrt(scene, seed, LIMIT) for seed in seeds]
    solved = [answer for answer in answers if answer.solved]
    print(
        f"{name:20} {'RRT of OMPL':19} {len(solved):3} of {len(seeds):3}"
        f" {sum(answer.seconds for answer in answers):8.1f}"
        f" {np.median([answer.seconds for answer in answers]):9.2f} {sum(a.steps for a in answers):12}"
        f" {sum(a.steps for a in answers):17} {np.mean([a.moves for a in solved] or [0]):6.1f}",
        flush=True,
    )


def schedules() -> dict[str, Schedule]:
    """The schedules by name, and the ladders among them with other accuracies: coarse steps on the
    quasistatic rung, and fine ones on all rungs."""
    rungs = [rung for rung in rw.LADDER if rung.moves]
    return {name: name for name in SCHEDULES} | {
        "quasistatic, coarse": [
            (rw.QUASISTATIC_RIGID, COARSE),
            (rw.DYNAMIC_COMPLIANT, COARSE),
            (rw.DYNAMIC_COMPLIANT, FINE),
        ],
        "climb, equal": [(rung, FINE) for rung in rungs],
    }


def scene_of(name: str) -> rw.Scene:
    """A scene of the library, with other values of parameters after a colon: push:v=0.3."""
    first, *changes = name.split(":")
    data = rw.load(first).file.model_dump(mode="json", exclude_unset=True)
    for parameter, value in (change.split("=") for change in changes):
        data["parameters"][parameter]["default"] = float(value)
    return rw.load(data)


def warmed(name: str, seed: int, schedule: Schedule | None) -> rw.Scene:
    """The scene, with everything compiled that its plans need."""
    scene = scene_of(name)
    rw.plan(scene, task_seed=seed, schedule=schedule)
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instances", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tasks", default=",".join(TASKS))
    parser.add_argument("--schedules", action="store_true")
    given = parser.parse_args()
    seeds = range(FIRST_SEED + given.first, FIRST_SEED + given.first + given.instances)
    (print_schedules if given.schedules else print_tasks)(given.tasks.split(","), seeds)


if __name__ == "__main__":
    main()
