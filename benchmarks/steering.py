"""Searches whose moves are segments of inputs: drawn, steered by fits, and by derivatives of a step.

    python benchmarks/steering.py [--tasks NAMES] [--seeds N] [--limit SECONDS] [--folder FOLDER] [--drawn]
        [--rungs NAMES]

Hands turn and lift objects that roll and slide on their fingers. One tree after another is grown until a way
to the goal is found, or the processor time is spent, in three ways:

  drawn     moves are drawn (the tree that other searches begin with); with --drawn alone
  sampled   at a node moves with inputs nearby are run, and a linear model is fitted to their ends
  derived   the same, and where nothing was fitted yet the derivative of one step proposes moves, too

`film_hand` is `planar_hand` with a viscous film in place of the dry support, whose law has no derivative of a
step; so the last two ways are the same for `planar_hand`. The tasks `pang_...`, with the ball's turn in
degrees, are made of a file of a folder, and left out without it.

  found    seeds from which a way was found
  s        median of the processor seconds, those of searches that found nothing included
  ratio    geometric mean of the seconds over those of `sampled`, seed by seed
  steps    median of the simulated steps, in thousands
  models   derivatives that were made, and places where one was refused, of all seeds
  part     of the processor time, for derivatives
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import yaml
from arguments import of_tasks

import rungwise as rw
from rungwise import deadline
from rungwise.deadline import TimeOver
from rungwise.kernel import Reals
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.derived import Derived
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import begin
from rungwise.planning.search.search import DEPTHS, STEERING
from rungwise.planning.search.steering import Steering
from rungwise.planning.search.tree import grow
from rungwise.planning.task.task import task_of

FOLDER = Path(__file__).parents[2] / "shared" / "tasks"
PUBLISHED = "pang_planar_hand_15"
RUNGS = (rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT)
DRAWN, SAMPLED, DERIVED = "drawn", "sampled", "derived"
ACCURACY, MOST, TURN, AROUND = 1e-2, 30, 0.7, {15: 30, 45: 30, 180: 50}
"""The accuracy of the stage; of tasks that are made here, the most moves, and the turn of the shipped hand in
radians; and the turns of the published one in degrees, with their most moves."""


class Timed(Derived):
    """Models by derivatives, and the processor seconds that they took."""

    seconds = 0.0

    def model(self, q: Reals, time_: float, levels: Reals) -> Reals | None:
        began = time.process_time()
        found = super().model(q, time_, levels)
        self.seconds += time.process_time() - began
        return found


class Without(Timed):
    """None."""

    def model(self, _q: Reals, _time: float, _levels: Reals) -> Reals | None:
        return None


class Grown(NamedTuple):
    """Whether a way was found, processor seconds, steps, and the models that were made on the way."""

    found: bool
    seconds: float
    steps: int
    models: Timed


@dataclass
class Tally:
    """What came of all seeds of one way."""

    grown: list[Grown] = field(default_factory=list)

    @property
    def seconds(self) -> Reals:
        return np.array([one.seconds for one in self.grown])

    def row(self, sampled: Reals) -> str:
        """A row of the table, beside the seconds of the way that it is compared with."""
        found, seconds = sum(one.found for one in self.grown), self.seconds
        ratio = np.exp(np.mean(np.log(seconds / sampled)))
        models = [one.models for one in self.grown]
        made, refused = sum(each.made for each in models), sum(each.refused.total() for each in models)
        part = sum(each.seconds for each in models) / seconds.sum()
        return (
            f"{found:4} of {len(self.grown)}{np.median(seconds):8.1f}{ratio:8.2f}"
            f"{1e-3 * np.median([one.steps for one in self.grown]):8.1f}{made:8}{refused:8}{part:7.1%}"
        )


def grown(scene: rw.Scene, rung: rw.Rung, way: str, seed: int, limit: float) -> Grown:
    """Trees of one seed, in one of the ways."""
    task, budget = task_of(scene), Budget(None, limit)
    work = begin(task, budget, seed, 1)
    models = (Timed if way == DERIVED else Without)(task)
    predictor, least = work.predictor(Stage(rung, ACCURACY)), max(3, task.moves[0])
    goals, plan, number, began = goals_of(work), np.zeros((0, 1)), 0, time.process_time()
    try:
        while budget.left and not len(plan):
            draw = None if way == DRAWN else Steering(task, goals, models)
            deepest = min(least + number % DEPTHS, task.moves[1]) if way == DRAWN else task.moves[1]
            rng = np.random.default_rng([seed, number])
            _, plan = grow(
                work.moves, predictor, work.start, task.before, work.whole, deepest, STEERING, rng, None, draw
            )
            number += 1
    except TimeOver:
        pass
    steps = budget.spent.total()
    return Grown(len(plan) > 0, time.process_time() - began, steps, models)


def hand(data: dict[str, Any]) -> None:
    """Fingers that the task does not name, and short moves."""
    del data["task"]["fingers"]
    data["task"] |= {"moves": [1, MOST], "duration": ["0.05 / rate", "0.3 / rate"]}
    data["parameters"]["turn"]["default"] = TURN


def film(data: dict[str, Any]) -> None:
    """The same, with a film that resists as much as the support where fingers turn at the joints' speed."""
    hand(data)
    disc, slow = data["bodies"]["disc"], "(rate * lower)"
    del disc["support"]
    drag = f"mu_s * mass * gravity / {slow}"
    disc["coordinates"] = {name: {"damping": drag} for name in ("x", "y")}
    disc["coordinates"]["angle"] = {"damping": f"{drag} * radius**2 / 2"}


def tasks(folder: Path) -> Iterator[rw.Scene]:
    """The scenes of the table."""
    for name in ("hand_turn", "ball_turn", "three_finger_lift"):
        yield rw.load(name)
    for name, change in (("planar_hand", hand), ("film_hand", film)):
        data = rw.load("planar_hand").file.model_dump(mode="json", exclude_unset=True)
        change(data)
        yield rw.load(data | {"name": name})
    file = folder / f"{PUBLISHED}.yaml"
    for degrees, most in AROUND.items() if file.is_file() else ():
        text = file.read_text("utf-8").replace("0.2618", f"{np.deg2rad(degrees):.4f}")

        data = yaml.safe_load(text)
        data["task"]["moves"] = [1, most]
        yield rw.load(data | {"name": PUBLISHED.replace("15", str(degrees))})


def main(arguments: Sequence[str] | None = None) -> None:
    parser = of_tasks(__doc__.splitlines()[0], FOLDER, 3, 60.0)
    parser.add_argument("--rungs", nargs="+", choices=[rung.name for rung in RUNGS], help="both if not given")
    parser.add_argument("--drawn", action="store_true", help="also moves that are drawn")
    given = parser.parse_args(arguments)
    ways, named = (*([DRAWN] if given.drawn else []), SAMPLED, DERIVED), tuple(given.tasks.split(","))
    print(
        f"{'task':21}{'rung':23}{'way':8}{'found':>9}{'s':>8}{'ratio':>8}{'steps':>8}{'models':>8}{'refused':>8}"
        f"{'part':>7}"
    )
    with patch.object(deadline, "clock", time.process_time):
        for scene in tasks(given.folder):
            if scene.name.startswith(named):
                for rung in (rung for rung in RUNGS if rung.name in (given.rungs or rung.name)):
                    print_rows(scene, rung, ways, given.seeds, given.limit)


def print_rows(scene: rw.Scene, rung: rw.Rung, ways: Sequence[str], seeds: int, limit: float) -> None:
    """The rows of a task on a rung; first, a short search has kernels compiled."""
    for way in ways:
        grown(scene, rung, way, 0, 0.05 * limit)
    tallies = {way: Tally([grown(scene, rung, way, seed, limit) for seed in range(seeds)]) for way in ways}
    for way, tally in tallies.items():
        print(f"{scene.name:21}{rung.name:23}{way:8}{tally.row(tallies[SAMPLED].seconds)}", flush=True)


if __name__ == "__main__":
    main()
