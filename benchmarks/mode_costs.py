"""Where plans by contact modes spend their time on each rung: growing trees, finding ways, or running legs.

    python benchmarks/mode_costs.py [--folder ../shared/tasks] [--seeds 3] [--limit 30] [--tasks corridor]

Each published task, each shipped scene with `task.fingers` and each longer task (`longer_tasks.py`) that
suits contact modes is planned on quasistatic-rigid alone and on dynamic-compliant alone, from the same seeds.
Times are those of the processor, so that other work on the machine counts little. A row says how many trees
were grown, legs laid out (with the ways of fingers to their places) and legs run, milliseconds for each, and
what part of the whole they take; the rest are ways of objects alone, places at the goal, drawn pushes, and
the replay that confirms a plan.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

from arguments import of_tasks
from longer_tasks import longer
from published_tasks import FOLDER, suits_modes, with_fingers

import rungwise as rw
from rungwise.planning.modes import planner
from rungwise.planning.modes.legs import Writer
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.propagate import Predictor

RUNGS = (rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT)
TREES, LEGS, RUNS = "trees", "legs laid out", "runs"


class Clock:
    """Processor seconds and calls of some functions, without those of others that they call."""

    def __init__(self) -> None:
        self.seconds, self.calls = Counter[str](), Counter[str]()

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, timed under a name."""

        def called(*given: Any, **named: Any) -> Any:
            began = time.process_time()
            try:
                return function(*given, **named)
            finally:
                self.seconds[name] += time.process_time() - began
                self.calls[name] += 1

        return called

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Time trees, layouts and runs of legs."""
        run = Scene.run

        def only_here(scene: Scene, predictor: Predictor, *given: Any) -> Any:
            with patch.object(predictor, "run", self.timed(RUNS, predictor.run)):
                return run(scene, predictor, *given)

        with ExitStack() as stack:
            stack.enter_context(patch.object(planner, "propose", self.timed(TREES, planner.propose)))
            stack.enter_context(patch.object(Writer, "leg", self.timed(LEGS, Writer.leg)))
            stack.enter_context(patch.object(Scene, "run", only_here))
            yield


def print_costs(scene: rw.Scene, seeds: Sequence[int], limit: float) -> None:
    """A row for each rung."""
    for rung in RUNGS:
        clock, found, began = Clock(), 0, time.process_time()
        with clock.watching():
            for seed in seeds:
                plan = rw.plan(scene, to=rung, schedule="direct", seed=seed, budget=None, limit=limit)
                found += plan.found
        whole = time.process_time() - began
        each = [
            f"{clock.calls[name]:6} {1e3 * clock.seconds[name] / max(clock.calls[name], 1):7.1f}"
            f" {clock.seconds[name] / whole:5.0%}"
            for name in (TREES, LEGS, RUNS)
        ]
        print(
            f"{scene.name:34} {rung.name:17} {found:2} of {len(seeds):2} {whole:7.2f}  " + "  ".join(each),
            flush=True,
        )


def main(arguments: Sequence[str] | None = None) -> None:
    given = of_tasks(__doc__.splitlines()[0], FOLDER, 3, 30.0).parse_args(arguments)
    scenes = [rw.load(file) for file in (*sorted(given.folder.glob("*.yaml")), *with_fingers())]
    print(
        f"{'task':34} {'rung':17} {'planned':>8} {'cpu s':>7}  "
        + "  ".join(f"{name:>14} ms  part" for name in (TREES, LEGS, RUNS))
    )
    for scene in (*scenes, *longer(given.folder)):
        if scene.name.startswith(tuple(given.tasks.split(","))) and suits_modes(scene):
            for rung in RUNGS:
                rw.plan(
                    scene, to=rung, schedule="direct", budget=None, limit=1.0
                )  # so that kernels are there
            print_costs(scene, range(given.seeds), given.limit)


if __name__ == "__main__":
    main()
