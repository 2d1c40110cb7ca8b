"""How often plans of tasks succeed as they are and with their policy, where places, turns and friction are
not quite as planned; and whether MuJoCo reaches the goal with the plan.

    python benchmarks/feedback.py [--tasks NAMES] [--samples M] [--seed SEED] [--plans FOLDER]
        [--counted PART] [--open-loop]

Errors are uniform: of the object's start up to 2 mm and 2 degrees, as far as it may lie so, of the start of
each finger or joint of a robot up to 2 mm or 2 degrees, of all coefficients of friction up to 20 %. Where no
object lies loose, all else that the task calls uncertain varies, too, such as the place of a hole. The same
samples are run in both modes. A task is a shipped scene or a file, with `:name=value` for parameters, as in
`examples/data/allegro_cube.yaml:turn=90`. The columns: length of the plan in seconds; successes open loop and
with feedback; outcome in MuJoCo and, where it misses, by how much a condition of the goal fails there; with
feedback the proposals of a sample, parts of these that kept what was left, their steps, and milliseconds.
With `--plans` plans are kept in a folder, and those that lie there as TASK.json are used again. With
`--counted PART` plans and policies count on this part of all friction, and errors are those of the whole.
"""

from __future__ import annotations

import argparse
import math
import statistics
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import yaml

import rungwise as rw
from rungwise.outcome import Code
from rungwise.planning.execution.fed_back import FedBack
from rungwise.planning.execution.trials import Trials
from rungwise.scene.scene import LIBRARY
from rungwise.scene.space import SpaceScene
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of

FAR, TURNED, PART = 0.002, math.radians(2.0), 0.2
"""Errors of places, turns and friction, at most."""
IN_PLANE = {
    "card": ("card", "x"), "book": ("book", "away"), "corner_pivot": ("block", "away"),
    "corridor": ("box", "x y angle"), "planar_hand": ("disc", "x y angle"), "push": ("box", "x y angle"),
}  # fmt: skip
"""The object of each planar scene, and along what it may lie elsewhere; `away`: along x, from a wall or a
back."""
IN_SPACE = [
    "three_finger_lift", "floor_push", "arm_turn", "block_turn", "door", "palm_lift", "hand_turn",
    "ball_turn", "peg_arm",
]  # fmt: skip
FRICTION = "mu"
"""How names of coefficients of friction begin."""
SLIDE, HINGE = 2, 3
"""Kinds of MuJoCo's joints."""


def varied(name: str) -> rw.Scene | rw.SpaceScene:
    """A scene with these errors as what its task calls uncertain."""
    files = (Path(name), LIBRARY / f"{name}.yaml", LIBRARY / "space" / f"{name}.yaml")
    file = next(f for f in files if f.is_file())
    fields: dict[str, Any] = yaml.safe_load(file.read_text("utf-8"))
    mus = [key for key in fields["parameters"] if key.startswith(FRICTION)]
    uncertain = {key: {"uniform": [f"{1.0 - PART} * {key}", f"{1.0 + PART} * {key}"]} for key in mus}

    def error(of: str, most: float, low: float | None = None) -> str:
        key = f"error_{of}"
        fields["parameters"][key] = {"default": 0.0, "range": [-1.0, 1.0], "about": "error of the start"}
        uncertain[key] = {"uniform": [-most if low is None else low, most]}
        return key

    if "bodies" in fields:
        lies_elsewhere(fields, *IN_PLANE[name], error)
    else:
        for each in (fields["model"], *fields["model"].get("parts", {}).values()):
            if (file.parent / each["file"]).is_file():
                each["file"] = str((file.parent / each["file"]).resolve())
        scene = rw.load(file)
        begins_elsewhere(scene, fields, error)
        if OBJECT not in world_of(scene).roles().values():
            uncertain = fields["task"].get("uncertain", {}) | uncertain
    fields["task"]["uncertain"] = uncertain
    return rw.load(fields)


def lies_elsewhere(fields: dict[str, Any], body: str, along: str, error: Any) -> None:
    """Errors of an object in the plane, and of the fingers that nothing holds to each other."""
    places = fields["bodies"][body]["pose"]
    for each in along.split():
        way, most = ("x", 0.0) if each == "away" else (each, TURNED if each == "angle" else FAR)
        places[way] = f"{places.get(way, 0)} + {error(each, most, -FAR if each == 'away' else None)}"
    joined = {name for joint in fields.get("joints", {}).values() for name in joint["between"]}
    for name, other in fields["bodies"].items():
        if other["role"] == "robot" and name not in joined:
            for way, of in other["coordinates"].items():
                if way != "angle":
                    of["start"] = error(f"{name}_{way}", FAR)


def begins_elsewhere(scene: SpaceScene, fields: dict[str, Any], error: Any) -> None:
    """Errors of objects on a floor, along it and about the vertical, and of all joints, within
    their ranges."""
    bound, names = scene.bind(), scene.template.coordinates
    places = fields.setdefault("start", {}).setdefault("places", {})
    roles, model = world_of(scene).roles(), bound.model
    begun = model.qpos0 if scene.file.start.settle else bound.place

    def moved(k: int, of: str, most: float, low: float = -math.inf, high: float = math.inf) -> None:
        place = f"{places.get(names[k], begun[k])} + {error(of, most)}"
        place = place if low == -math.inf else f"max({place}, {low})"
        places[names[k]] = place if high == math.inf else f"min({place}, {high})"

    for j in range(model.njnt):
        at, kind = int(model.jnt_qposadr[j]), int(model.jnt_type[j])
        body = scene.template.bodies[int(model.jnt_bodyid[j])]
        if kind in (SLIDE, HINGE):
            ends = model.jnt_range[j] if model.jnt_limited[j] else (-math.inf, math.inf)
            moved(at, names[at].replace(".", "_"), FAR if kind == SLIDE else TURNED, *map(float, ends))
        elif roles[body] == OBJECT:
            moved(at, f"{body}_x", FAR)
            moved(at + 1, f"{body}_y", FAR)
            angle = 2.0 * math.atan2(*begun[[at + 6, at + 3]])
            half = f"({angle} + {error(f'{body}_turn', TURNED)}) / 2"
            places |= {names[at + 3]: f"cos({half})", names[at + 6]: f"sin({half})"}


def main() -> None:
    asked = arguments()
    print(
        f"{'task':16} {'s':>5} {'open loop':>9} {'feedback':>9}  {'MuJoCo':9} each  kept   steps      ms",
        flush=True,
    )
    for name in asked.tasks.split(","):
        print(row(name, asked), flush=True)


def planned(name: str, asked: argparse.Namespace) -> rw.Plan:
    """A plan of a task as it ships, or the one that was kept, in the scene with errors."""
    file, _, given = name.partition(":")
    known = Path(asked.plans or "") / f"{Path(file).stem}.json"
    if asked.plans and known.is_file():
        plan = rw.load_plan(known)
    else:
        parameters = {
            key: float(value) for key, _, value in (each.partition("=") for each in given.split(":")) if key
        }
        parameters |= times(rw.load(file).parameters() | parameters, asked.counted)
        seed = {"task_seed": 1001} if name == "push" else {}
        plan = rw.plan(file, seed=asked.seed, limit=asked.limit, parameters=parameters, **seed)
        if asked.plans and plan.found:
            plan.save(known)
    scene = varied(file)
    errors = {key: each.default for key, each in scene.file.parameters.items()}
    return replace(plan, scene=scene, parameters=errors | plan.parameters)


def times(parameters: dict[str, float], part: float) -> dict[str, float]:
    """Coefficients of friction, times a number that is not 1."""
    return {
        key: part * value for key, value in parameters.items() if part != 1.0 and key.startswith(FRICTION)
    }


def row(name: str, asked: argparse.Namespace) -> str:
    """The results of one task."""
    plan, short = planned(name, asked), Path(name.partition(":")[0]).stem
    if not plan.found or plan.stage is None:
        return f"{short:16} no plan: {plan.reason}"
    model, tol = plan.stage.model, plan.tol
    actual = replace(plan, parameters=plan.parameters | times(plan.parameters, 1.0 / asked.counted))
    trials = Trials(actual, model, tol, "open loop", asked.seed, threads=1)
    points = trials.draw(asked.samples)
    ends, of = [Code(int(code)) for code in trials.run(points)[0]], partial(told, samples=asked.samples)
    if asked.open_loop:
        return f"{short:16} {plan.duration:5.1f} {of(ends):>9} {'-':>9}  {in_mujoco(actual)}"
    fed, seen, made = FedBack(plan, model, tol, asked.noise), list[Code](), list[Any]()
    failed = list[str]()
    for k, point in enumerate(points):
        outcome = fed.execute(*trials.world(point), asked.seed + k)[0]
        seen.append(outcome)
        made += fed.policy.proposals
        if outcome != Code.GOAL:
            said = f"{fed.policy.status} {fed.policy.reason}".rstrip()
            failed.append(f"{k}: {outcome.name.lower()}, {said}")
    median = [
        statistics.median(getattr(each, key) for each in made) if made else 0 for key in ("steps", "seconds")
    ]
    kept, each = sum(one.kept for one in made) / max(len(made), 1), len(made) / asked.samples
    line = (
        f"{short:16} {plan.duration:5.1f} {of(ends):>9} {of(seen):>9}  {in_mujoco(actual):9} {each:4.1f}"
        f" {kept:5.2f} {median[0]:7.0f} {1e3 * median[1]:7.0f}"
    )
    return "\n  ".join([line, *failed])


def in_mujoco(plan: rw.Plan) -> str:
    """How the plan ends in MuJoCo, which runs scenes in space only."""
    if not isinstance(plan.scene, SpaceScene):
        return "-"
    found = rw.replay(plan.replay())
    if found.ok or found.end is None:
        return str(found.outcome)
    return f"{-plan.scene.goal(found.end, plan.parameters).margin[0]:.2g} off"


def told(ends: list[Code], samples: int) -> str:
    return f"{sum(end == Code.GOAL for end in ends)} of {samples}"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--tasks", default=",".join([*IN_PLANE, *IN_SPACE]), help="with commas between")
    parser.add_argument("--samples", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds of each planning")
    parser.add_argument("--open-loop", action="store_true", help="without feedback, which may take long")
    parser.add_argument("--counted", type=float, default=1.0, help="part of friction that plans count on")
    parser.add_argument("--plans", help="a folder of plans that are used again")
    return parser.parse_args()


if __name__ == "__main__":
    main()
