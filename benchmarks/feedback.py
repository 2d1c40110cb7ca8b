"""How often plans of shipped scenes succeed as they are and with their policy, where places, turns and
friction are not quite as planned.

    python benchmarks/feedback.py [--scenes NAMES] [--samples M] [--seed SEED] [--noise LENGTH]

Each scene gets errors of its object's start of up to 2 mm and 2 degrees, as far as it may lie so, and of all
coefficients of friction of up to 20 %. The same samples are run in both modes. The last columns: proposals in
each sample with feedback, parts of these that kept what was left, their steps, and milliseconds.
"""

from __future__ import annotations

import argparse
import statistics
from functools import partial
from typing import Any

import yaml

import rungwise as rw
from rungwise.planning.execution.fed_back import FedBack
from rungwise.planning.execution.trials import Trials
from rungwise.planning.execution.verify import bound_below
from rungwise.scene.scene import LIBRARY

FAR, TURNED, PART = 0.002, 0.035, 0.2
"""Errors of places, turns and friction, at most."""
OBJECTS = {
    "card": ("card", "x"), "book": ("book", "away"), "corner_pivot": ("block", "away"),
    "corridor": ("box", "x y angle"), "planar_hand": ("disc", "x y angle"), "push": ("", ""),
    "floor_push": ("box", "x y turn"), "arm_turn": ("box", "x y turn"), "block_turn": ("block", "x y turn"),
}  # fmt: skip
"""The object of each scene, and along what it may lie elsewhere; `away`: along x, from a wall or a back."""


def varied(name: str) -> rw.Scene | rw.SpaceScene:
    """A shipped scene with these errors as what its task calls uncertain."""
    body, along = OBJECTS[name]
    if not body:
        return rw.load(name)
    file = next(f for f in (LIBRARY / f"{name}.yaml", LIBRARY / "space" / f"{name}.yaml") if f.is_file())
    fields: dict[str, Any] = yaml.safe_load(file.read_text("utf-8"))
    is_planar = "bodies" in fields
    uncertain = {
        key: {"uniform": [f"{1.0 - PART} * {key}", f"{1.0 + PART} * {key}"]}
        for key in fields["parameters"] if key.startswith("mu")
    }  # fmt: skip
    places = (
        fields["bodies"][body]["pose"]
        if is_planar
        else fields.setdefault("start", {}).setdefault("places", {})
    )
    for each in along.split():
        most = TURNED if each in ("angle", "turn") else FAR
        low, high = (-most, 0.0 if each == "away" else most)
        error, way = f"error_{each}", "x" if each == "away" else each
        fields["parameters"][error] = {"default": 0.0, "range": [-1.0, 1.0], "about": "error of the start"}
        uncertain[error] = {"uniform": [low, high]}
        if is_planar:
            places[way] = f"{places.get(way, 0)} + {error}"
        elif each == "turn":
            places |= {f"{body}.qw": f"cos({error} / 2)", f"{body}.qz": f"sin({error} / 2)"}
        else:
            places[f"{body}.{way}"] = f"{places.get(f'{body}.{way}', 0)} + {error}"
    if not is_planar:
        fields["model"]["file"] = str(file.parent / fields["model"]["file"])
    fields["task"]["uncertain"] = uncertain
    return rw.load(fields)


def main() -> None:
    asked = arguments()
    print(f"{'scene':13} {'open loop':>21} {'feedback':>21}  each   kept   steps      ms", flush=True)
    for name in asked.scenes.split(","):
        print(row(name, asked), flush=True)


def row(name: str, asked: argparse.Namespace) -> str:
    """The results of one scene."""
    given = {"task_seed": 1001} if name == "push" else {}
    plan = rw.plan(varied(name), seed=asked.seed, limit=asked.limit, **given)
    if not plan.found or plan.stage is None:
        return f"{name:13} no plan: {plan.reason}"
    model, tol = plan.stage.model, plan.tol
    trials = Trials(plan, model, tol, "open loop", asked.seed)
    points = trials.draw(asked.samples)
    blind = int((trials.run(points)[0] == rw.Code.GOAL).sum())
    fed, seeing, made = FedBack(plan, model, tol, asked.noise), 0, list[Any]()
    failed = list[str]()
    for k, point in enumerate(points):
        outcome = fed.execute(*trials.world(point), asked.seed + k)[0]
        seeing += outcome == rw.Code.GOAL
        made += fed.policy.proposals
        if outcome != rw.Code.GOAL:
            failed.append(f"{k}: {outcome.name.lower()}, {fed.policy.status} {fed.policy.reason}".rstrip())
    of = partial(told, samples=asked.samples)
    median = [
        statistics.median(getattr(each, key) for each in made) if made else 0 for key in ("steps", "seconds")
    ]
    kept, each = sum(one.kept for one in made) / max(len(made), 1), len(made) / asked.samples
    line = f"{name:13} {of(blind):>21} {of(seeing):>21} {each:5.1f}  {kept:5.2f} {median[0]:7.0f}"
    return "\n  ".join([f"{line} {1e3 * median[1]:7.0f}", *failed])


def told(successes: int, samples: int) -> str:
    return f"{successes} of {samples} (>= {bound_below(successes, samples):.2f})"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", default=",".join(OBJECTS), help="names, with commas between")
    parser.add_argument("--samples", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds of each planning")
    return parser.parse_args()


if __name__ == "__main__":
    main()
