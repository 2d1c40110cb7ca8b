"""One task, three kinds of resistance: what a box on a table opposes to a push, chosen as data.

    python examples/push_supports.py [--instances 5] [--first 1000] [--out DIR]

The scene `push` has a limit surface. Here the box's `support` gives way to dry friction about the centre of
mass, or to drag in proportion to its speed, as two fields of its coordinates. Each is planned; with --out
its scenes go to PUSH_KIND.yaml, for the command line.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import yaml

import rungwise as rw

LEVER = "hypot(width, height) / 4"
RESISTANCE: dict[str, dict[str, Any]] = {
    "surface": {},
    "dry": {
        "x": {"dry_friction": "mu_s * mass * gravity"},
        "y": {"dry_friction": "mu_s * mass * gravity"},
        "angle": {"dry_friction": f"mu_s * mass * gravity * {LEVER}"},
    },
    "drag": {
        "x": {"damping": "mu_s * mass * gravity / v"},
        "y": {"damping": "mu_s * mass * gravity / v"},
        "angle": {"damping": f"mu_s * mass * gravity / v * ({LEVER})**2"},
    },
}
"""Fields of the box's coordinates in place of its support; drag is as strong as friction at the speed v."""


def scene(kind: str) -> dict[str, Any]:
    """The scene `push` with this kind of resistance, as a mapping that `rw.load` takes."""
    file: dict[str, Any] = json.loads(rw.load("push").file.model_dump_json(exclude_unset=True))
    if RESISTANCE[kind]:
        file["name"] = f"push_{kind}"
        del file["bodies"]["box"]["support"]
        file["bodies"]["box"]["coordinates"] = RESISTANCE[kind]
    return file


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instances", type=int, default=5, help="planned with each kind")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first instance")
    parser.add_argument("--out", type=Path, help="folder for the scenes")
    given = parser.parse_args(arguments)
    solved = []
    for kind in RESISTANCE:
        file = scene(kind)
        if given.out is not None:
            given.out.mkdir(parents=True, exist_ok=True)
            (given.out / f"push_{kind}.yaml").write_text(yaml.safe_dump(file, sort_keys=False), "utf-8")
        loaded = rw.load(file)
        seeds = range(given.first, given.first + given.instances)
        plans = [rw.plan(loaded, task_seed=seed) for seed in seeds]
        solved.append(sum(plan.found for plan in plans))
        moves = ", ".join(str(len(plan.waypoints)) if plan.found else "none" for plan in plans)
        print(f"{kind:8} {solved[-1]} of {given.instances} solved, moves: {moves}", flush=True)
    return 0 if all(solved) else 1


if __name__ == "__main__":
    raise SystemExit(main())
