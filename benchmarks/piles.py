"""Steps of piles in the plane: how long one takes, and how that grows with the number of bodies.

    python benchmarks/piles.py [--bodies N …] [--steps N] [--fall N …]

A pile is a pyramid of boxes at rest on level ground, with the friction of wood. Each row is a pile on one
of three rungs:

  bodies    boxes, and contacts of the last step
  ms        milliseconds of processor time per step, of all steps but the first few
  residual  the worst of the run

Lines of exponents follow: of the time between the smallest and the largest pile of at most 400 bodies. Then
heaps of --fall bodies, boxes and triangles turned at random between two walls, fall for 2.5 s: the mean,
the 99th percentile and the greatest time of a step.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.simulation.run import Simulation

BODIES, FALLING = (45, 91, 190, 351), (40, 91)
FIRST, STEPS = 5, 20
FALL, FALLEN = 2e-3, 1250
"""Step of a heap that falls, and how many steps it falls for."""
MOST_FITTED = 400
MODELS = rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT, rw.QUASISTATIC_RIGID


def pyramid(bodies: int) -> tuple[rw.Scene, int]:
    """The scene of a pyramid of so many boxes, or of the next greater number that makes whole rows; and how
    many there are."""
    rows = math.ceil(0.5 * (math.sqrt(8 * bodies + 1) - 1))
    places = [(c + 0.5 * r, 0.5 + r) for r in range(rows) for c in range(rows - r)]
    named: dict[str, Any] = {
        f"b{i}": {
            "role": "object", "mass": 1.0, "shape": {"kind": "box", "width": 0.9, "height": 1.0},
            "pose": {"x": x, "y": y}, "motion": {"kind": "free"},
        }
        for i, (x, y) in enumerate(places)
    }  # fmt: skip
    named["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    law = {"friction": 0.5, "stiffness": 1e6, "damping": 1e4}
    scene = rw.load(
        {
            "name": "pile", "gravity": [0.0, -9.81], "bodies": named, "duration": 10.0, "step": 1e-3,
            "contacts": [{"between": ["b*", "b*"], **law}, {"between": ["b*", "ground"], **law}],
        }
    )  # fmt: skip
    return scene, len(places)


def heap(bodies: int) -> rw.Scene:
    """Boxes and triangles above the ground, between two walls."""
    rng, columns = np.random.default_rng(0), round(bodies**0.5)
    triangle = {"kind": "polygon", "vertices": [[-0.45, -0.3], [0.45, -0.3], [0.0, 0.5]]}
    box, named = {"kind": "box", "width": 0.9, "height": 0.7}, {}
    for i in range(bodies):
        row, column = divmod(i, columns)
        x, y, angle = 1.3 * column + rng.uniform(-0.1, 0.1), 1.0 + 1.4 * row, rng.uniform(-3.0, 3.0)
        named[f"b{i}"] = {
            "role": "object", "mass": 1.0, "shape": triangle if rng.integers(2) else box,
            "pose": {"x": x, "y": y, "angle": angle}, "motion": {"kind": "free"},
        }  # fmt: skip
    for name, x, angle in (("ground", 0.0, 0.0), ("left", -1.0, -90.0), ("right", 1.3 * columns, 90.0)):
        pose = {"x": x, "y": 0.0, "angle": math.radians(angle)}
        named[name] = {"role": "obstacle", "shape": {"kind": "halfplane"}, "pose": pose}
    law = {"friction": 0.5, "stiffness": 1e5, "damping": 1e3}
    pairs = [{"between": ["b*", other], **law} for other in ("b*", "ground", "left", "right")]
    told = {"name": "heap", "gravity": [0.0, -9.81], "bodies": named, "contacts": pairs}
    return rw.load(told | {"duration": 10.0, "step": FALL})


def fall(bodies: int, model: rw.Rung) -> str:
    """The line of a heap."""
    run, took = Simulation(heap(bodies), model, frames=3), []
    for _ in range(FALLEN):
        began = time.process_time()
        run.advance(1)
        took.append(1e3 * (time.process_time() - began))
    assert run.workspace is not None
    worst, counted = float(run.workspace.state.clock[0]["worst_residual"]), took[FIRST:]
    most = float(np.quantile(counted, 0.99))
    return f"{bodies:6} {model.name:<17} {np.mean(counted):7.2f} {most:7.1f} {max(counted):7.1f} {worst:8.0e}"


def measure(scene: rw.Scene, model: rw.Rung, steps: int) -> tuple[int, float, float, Simulation]:
    """Contacts, milliseconds per step and worst residual of a run, and the run."""
    run = Simulation(scene, model, frames=3)
    run.advance(FIRST)
    began = time.process_time()
    run.advance(steps)
    took = 1e3 * (time.process_time() - began) / steps
    assert run.workspace is not None
    clock = run.workspace.state.clock[0]
    return int(clock["contacts"]), took, float(clock["worst_residual"]), run


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bodies", type=int, nargs="+", default=BODIES)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--fall", type=int, nargs="*", default=FALLING)
    given = parser.parse_args(arguments)
    print(f"{'bodies':>6} {'contacts':>8}  {'rung':<17} {'ms':>7} {'residual':>8}")
    found: dict[str, list[tuple[int, float]]] = {}
    for bodies in given.bodies:
        scene, count = pyramid(bodies)
        for model in MODELS:
            contacts, ms, residual, _ = measure(scene, model, given.steps)
            print(f"{count:6} {contacts:8}  {model.name:<17} {ms:7.2f} {residual:8.0e}", flush=True)
            if count <= MOST_FITTED:
                found.setdefault(model.name, []).append((count, ms))
    for name, times in found.items():
        if len(times) > 1:
            (few, fast), (many, slow) = times[0], times[-1]
            grows = math.log(slow / fast) / math.log(many / few)
            print(f"{name}: time grows as bodies to the {grows:.2f} from {few} to {many}")
    if given.fall:
        print(f"{'fall':>6} {'rung':<17} {'mean ms':>7} {'99 %':>7} {'most':>7} {'residual':>8}")
    for bodies in given.fall:
        for model in (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT):
            print(fall(bodies, model), flush=True)


if __name__ == "__main__":
    main()
