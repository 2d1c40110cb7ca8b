"""Steps of whole runs in space, beside MuJoCo's own in the same process, and what is asked of every step.

    python benchmarks/space.py [--scenes stack pile stack80 heap64] [--steps 8000] [--rounds 8] [--first N]

Each round takes steps on the rung and then as many in MuJoCo from the same start, so that both see the same
machine. stackN and heapN are N boxes, one on the other or in square layers that fall a little. MuJoCo steps
the same model with its own settings: Newton, elliptic cones, its step the scene's.

  steps/s   of the rung, collision, assembly, solution, judgement and integration included
  ratio     over MuJoCo's steps/s, median of the rounds
  within    share of the steps taken whose residual is within 1e-8; halved: steps that were shortened
  overlap   greatest overlap that a rigid step added, over the size of the smallest geom

--whole N says instead what a run of N steps takes by `rw.simulate`, with its set-up and a frame of each step,
over N steps of MuJoCo; and what a rollout of eight such runs takes in one thread over two, in wall time.

--first says instead how long each of the first N steps takes, in which bodies fall: the mean, the 99th
percentile and the greatest, in milliseconds of processor time.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

import mujoco
import numpy as np

import rungwise as rw
from rungwise.outcome import Code
from rungwise.simulation.spatial.run import SpaceSimulation

TOLERANCE = 1e-8
NEVER = 1e9
BOX = """<body name="box{0}" pos="{1} {2} {3}"><freejoint/>
<geom name="box{0}" type="box" size="0.1 0.1 0.1" mass="1"/></body>"""
ENDS = ("goal", "unsafe", "doomed")
"""Conditions that would end a run before all steps are taken."""


def scene_of(name: str, folder: Path) -> rw.SpaceScene:
    """A scene that ships, without the conditions that would end its run, or a stack or heap of so many boxes
    under the laws of the shipped stack, whose model is written into the folder."""
    made = re.fullmatch(r"(stack|heap)(\d+)", name)
    told = json.loads(rw.load("stack" if made else name).stored)
    told = {key: value for key, value in told.items() if key not in ENDS}
    if not made:
        return rw.load(told)
    path = folder / f"{name}.xml"
    path.write_text(boxes(made[1] == "heap", int(made[2])))
    return rw.load(told | {"name": name, "model": {"file": str(path)}})


def boxes(heaped: bool, count: int) -> str:
    """The model of a stack or a heap."""
    rng, side = np.random.default_rng(0), math.ceil(count ** (1 / 3)) if heaped else 1
    bodies = ""
    for i in range(count):
        layer, row, column = i // side**2, i // side % side, i % side
        x, y = (0.28 * np.array([row, column]) + 0.03 * rng.uniform(-1.0, 1.0, 2)) * heaped
        z = 0.15 + 0.25 * layer if heaped else 0.1 + 0.2 * i
        bodies += BOX.format(i, x, y, z)
    return f'<mujoco><worldbody><geom name="floor" type="plane" size="5 5 0.1"/>{bodies}</worldbody></mujoco>'


def measure(scene: rw.SpaceScene, model: str, steps: int, rounds: int) -> dict[str, Any]:
    """One scene on one rung; `steps` in all, over the rounds. A second run of the same steps is looked at."""
    timed, looked = (
        SpaceSimulation(scene, model, duration=NEVER, frames=3, stride=10**9) for _ in range(2)
    )  # fmt: skip
    stepper, space = timed.stepper, timed.space
    own = scene.bind().model
    own.opt.cone, own.opt.timestep = mujoco.mjtCone.mjCONE_ELLIPTIC, timed.step
    data = mujoco.MjData(own)
    data.qpos[:], data.qvel[:], data.ctrl[:] = stepper.q, stepper.v, space.control
    timed.steps_taken(5)
    each, ours, theirs = steps // rounds, [], []
    for _ in range(rounds):
        began = time.process_time()
        taken = timed.steps_taken(each)
        ours.append((time.process_time() - began) / max(taken, 1))
        began = time.process_time()
        for _ in range(each):
            mujoco.mj_step(own, data)
        theirs.append((time.process_time() - began) / each)
    total = int(stepper.clock["steps"]) - 5
    seen = look(looked, total)
    return {
        "scene": scene.name, "model": model, "steps": total, "steps_per_s": 1.0 / median(ours),
        "mujoco_steps_per_s": 1.0 / median(theirs),
        "ratio": median(b / a for a, b in zip(ours, theirs, strict=True)), **seen,
        "outcome": timed.outcome.name.lower(), "contacts": int((space.kept.geoms[:, 0] >= 0).sum()),
    }  # fmt: skip


def look(run: SpaceSimulation, steps: int) -> dict[str, Any]:
    """What is asked of each of so many steps after the first five."""
    stepper, space = run.stepper, run.space
    run.steps_taken(5)
    within = halved = taken = 0
    overlap = 0.0
    while taken < steps and run.outcome == Code.RUNNING:
        before, deep = stepper.time, space.least_gap(stepper.q)
        run.steps_taken(1)
        taken += 1
        within += float(stepper.clock["residual"]) <= TOLERANCE
        halved += stepper.time - before < 0.99 * run.step
        overlap = max(overlap, min(deep, 0.0) - min(space.least_gap(stepper.q), 0.0))
    return {"within": within / max(taken, 1), "halved": halved, "overlap": overlap / space.size.length}


def tell_first(scenes: Sequence[rw.SpaceScene], models: Sequence[str], steps: int) -> None:
    """Print what each of the first steps takes."""
    print(f"{'scene':8} {'model':18} {'steps':>6} {'mean ms':>8} {'99 %':>6} {'most':>6}")
    for scene in scenes:
        for model in models:
            run, took = SpaceSimulation(scene, model, duration=NEVER, frames=3, stride=10**9), []
            for _ in range(steps):
                began = time.process_time()
                run.steps_taken(1)
                took.append(1e3 * (time.process_time() - began))
            most = np.quantile(took[1:], 0.99)
            numbers = f"{np.mean(took[1:]):8.2f} {most:6.1f} {max(took[1:]):6.1f}"
            print(f"{scene.name:8} {model:18} {steps:6} {numbers}", flush=True)


def tell_whole(scenes: Sequence[rw.SpaceScene], models: Sequence[str], steps: int) -> None:
    """Print what whole runs take, beside MuJoCo's steps, and rollouts in one thread, over two."""
    print(f"{'scene':8} {'model':18} {'steps':>6} {'us a step':>9} {'over MuJoCo':>11} {'threads':>8}")
    for scene in scenes:
        own = scene.bind().model
        own.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        data, span = mujoco.MjData(own), steps * scene.bind().step
        for model in models:
            ours, theirs, threads, state = [], [], [], rw.State.of(scene)
            for _round in range(4):
                began = time.process_time()
                run = rw.simulate(scene, model, duration=span, frames=steps + 1, stride=1)
                ours.append((time.process_time() - began) / max(run.steps, 1))
                began = time.process_time()
                for _ in range(steps):
                    mujoco.mj_step(own, data)
                theirs.append((time.process_time() - began) / steps)
                walls = []
                for count in (1, 2):
                    began = time.perf_counter()
                    rw.rollout(scene, model, states=[state] * 8, durations=span, threads=count, chunk=1)
                    walls.append(time.perf_counter() - began)
                threads.append(walls[0] / walls[1])
            ratio = median(a / b for a, b in zip(ours[1:], theirs[1:], strict=True))
            took = f"{1e6 * median(ours[1:]):9.0f} {ratio:11.2f} {median(threads[1:]):8.2f}"
            print(f"{scene.name:8} {model:18} {run.steps:6} {took}", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["stack", "pile", "stack80", "heap64"])
    parser.add_argument("--models", nargs="+", default=["dynamic-rigid", "dynamic-compliant"])
    parser.add_argument("--steps", type=int, default=8000)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--whole", type=int, metavar="N", help="say what whole runs of N steps take")
    parser.add_argument("--first", type=int, metavar="N", help="say what each of the first steps takes")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        scenes = [scene_of(name, Path(folder)) for name in chosen.scenes]
        if chosen.whole:
            tell_whole(scenes, chosen.models, chosen.whole)
            return 0
        if chosen.first:
            tell_first(scenes, chosen.models, chosen.first)
            return 0
        found = [measure(s, m, chosen.steps, chosen.rounds) for s in scenes for m in chosen.models]
    if chosen.json:
        print(json.dumps(found))
        return 0
    print(f"{'scene':8} {'model':18} {'steps':>6} {'steps/s':>8} {'MuJoCo':>8} {'ratio':>6} {'within':>8} "
          f"{'halved':>6} {'overlap':>8} {'contacts':>8}")  # fmt: skip
    for f in found:
        both = f"{f['steps_per_s']:8.0f} {f['mujoco_steps_per_s']:8.0f} {f['ratio']:6.2f}"
        rest = f"{f['within']:8.2%} {f['halved']:6} {f['overlap']:8.0e} {f['contacts']:8}"
        print(f"{f['scene']:8} {f['model']:18} {f['steps']:6} {both} {rest}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
