"""The Panda of examples/data pushes other objects than its T, from and to other poses, past other posts.

    python benchmarks/panda_objects.py [--seeds 2] [--limit 300] [--tasks ell,cross]

Each row is a task that is planned by `--schedule direct` from the seeds 0, 1, ...: how many of them end with
a plan, which a replay at a tenth of its error has confirmed, and the median and greatest of their seconds.
These and the limit are those of the processor, all threads together. The model of the arm needs
example-robot-data.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from arguments import of_tasks
from ladder_kinds import by_processor

import rungwise as rw

FOLDER = Path(__file__).parents[1] / "examples" / "data"
NAME = "panda_tee"
HIGH = 0.02
"""Half the height of objects (m)."""
TEE = ((0.08, 0.02, 0.0, 0.0343, 0.229), (0.02, 0.06, 0.0, -0.0457, 0.171))
ELL = ((0.05, 0.02, 0.03, -0.02, 0.2), (0.02, 0.06, 0.0, 0.0, 0.171))
CROSS = ((0.06, 0.02, 0.0, 0.0, 0.2), (0.02, 0.06, 0.0, 0.0, 0.171))
BOX = ((0.05, 0.035, 0.0, 0.0, 0.3),)
HOOK = ((0.02, 0.06, -0.04, 0.0, 0.15), (0.02, 0.04, 0.04, -0.02, 0.1), (0.06, 0.02, 0.0, -0.04, 0.15))


@dataclass(frozen=True)
class Case:
    """A task: boxes (half width, half depth, x, y, mass) of the object; where it begins, x, y (m) and turn
    (degrees); where posts stand; and parameters of its goal."""

    boxes: tuple[tuple[float, ...], ...] = TEE
    start: tuple[float, float, float] = (0.48, -0.18, 0.0)
    posts: tuple[tuple[float, float], ...] = ((0.5, 0.0),)
    goal: dict[str, float] = field(default_factory=dict)

    @property
    def model(self) -> str:
        """The model file."""
        geoms = "".join(
            f'<geom name="box{k}" type="box" size="{a} {b} {HIGH}" pos="{x} {y} 0" mass="{mass}"/>'
            for k, (a, b, x, y, mass) in enumerate(self.boxes)
        )
        posts = "".join(
            f'<body name="post{k}" pos="{x} {y} 0.06"><geom type="cylinder" size="0.025 0.06"/></body>'
            for k, (x, y) in enumerate(self.posts)
        )
        x, y, turn = self.start
        return (
            f'<mujoco><compiler angle="degree"/><option integrator="implicitfast"/><worldbody>'
            f'<geom name="table" type="plane" pos="0.4 0 0" size="0.8 0.8 0.1"/>{posts}'
            f'<body name="tee" pos="{x} {y} {HIGH}" euler="0 0 {turn}"><freejoint/>{geoms}</body>'
            "</worldbody></mujoco>"
        )


CASES = {
    "tee": Case(),
    "tee_turned_back": Case(goal={"turn": -40.0}),
    "tee_other_way": Case(start=(0.55, 0.2, 90.0), goal={"goal_x": 0.45, "goal_y": -0.2, "turn": 0.0}),
    "tee_two_posts": Case(posts=((0.5, 0.0), (0.6, 0.06))),
    "ell": Case(ELL),
    "ell_turned_back": Case(ELL, goal={"turn": -90.0}),
    "cross": Case(CROSS),
    "cross_two_posts": Case(CROSS, posts=((0.45, 0.0), (0.56, 0.05))),
    "box": Case(BOX),
    "box_other_way": Case(BOX, (0.4, 0.2, 30.0), goal={"goal_x": 0.55, "goal_y": -0.2, "turn": 120.0}),
    "hook": Case(HOOK),
}


def scene_of(case: Case, folder: Path) -> rw.Scene:
    """The scene of a task, written into a folder."""
    for name in ("panda_stick.xml", f"{NAME}.yaml"):
        shutil.copy(FOLDER / name, folder)
    (folder / f"{NAME}.xml").write_text(case.model, "utf-8")
    return rw.load(folder / f"{NAME}.yaml")


def print_case(name: str, case: Case, seeds: Sequence[int], limit: float) -> int:
    """The row of a task; how many seeds end with a plan."""
    found, seconds = 0, list[float]()
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder, by_processor():
            scene, began = scene_of(case, Path(folder)), time.process_time()
            plan = rw.plan(
                scene, schedule="direct", parameters=case.goal, budget=None, limit=limit, seed=seed
            )
            seconds.append(time.process_time() - began)
            found += plan.found
    print(f"{name:20} {found:3} of {len(seeds):2} {np.median(seconds):9.1f} {max(seconds):8.1f}", flush=True)
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    parser = of_tasks(__doc__.splitlines()[0], FOLDER, 2, 300.0)
    given = parser.parse_args(arguments)
    named = {name: case for name, case in CASES.items() if name.startswith(tuple(given.tasks.split(",")))}
    print(f"{'task':20} {'planned':>9} {'median s':>9} {'max s':>8}")
    found = [print_case(name, case, range(given.seeds), given.limit) for name, case in named.items()]
    print(f"planned: {sum(found)} of {given.seeds * len(found)}")


if __name__ == "__main__":
    main()
