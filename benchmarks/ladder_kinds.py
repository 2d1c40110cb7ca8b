"""Kinds of task in which runs on dynamic-compliant should take most of a search: does the ladder pay there?

    python benchmarks/ladder_kinds.py [--kinds clutter,soft] [--seeds 2] [--limit 10] [--runs]

Five kinds of planar tasks, each with three members. *clutter*: a finger leads a box through pieces that lie
loose, and that it pushes aside. *soft*: shipped scenes whose fingers are on springs that are hardly damped,
so that they swing after each start and each touch. *stiff*: the same scenes with contacts a thousand times as
stiff. *slow*: the same, led a hundred times as slowly. *tight*: the shipped corridor, narrower, where many
proposals fail. Each is planned in the ways of `published_tasks.py`:
with contact modes on quasistatic-rigid and then on dynamic-compliant (the ladder), with contact modes on
dynamic-compliant alone, and without contact modes in both ways; all ways of a seed in turn. Limits and times
are those of the processor, all threads together, so that other work on the machine counts little. Medians are
over all members and seeds; a search that finds nothing counts with its time, and a ">" stands where at least
half of them do.

With --runs nothing is planned: a finger pushes the box straight on through more and more pieces, on both
rungs, and the processor's time for one run is printed.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import yaml
from published_tasks import LIBRARY, WAYS, Found

import rungwise as rw

RUNGS = (rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT)
SHIPPED = ("card", "corner_pivot", "corridor")
"""Scenes that soft, stiff and slow ones are made of."""
CROWDS = (2, 4, 6)
"""Pieces in the way of the box."""
SIDE, PIECE, APART = 0.06, 0.01, 0.028
"""Sizes of the box and of pieces, and the least distance between these, in metres."""
UNDAMPED, STIFFER, SLOWER = 0.05, 1e3, 0.01
"""Part of critical damping of soft drives; factors on the stiffness of contacts and the speed of fingers."""
PASSAGES = (0.13, 0.145, 0.16)
"""Widths of tight corridors, in metres; the box is 0.08 wide, and 0.16 from corner to corner."""
WARMING = 1.0
"""Processor seconds for which each way is tried before what counts, so that kernels are there."""
Data = dict[str, Any]
"""A scene as it is read from its file."""


def clutter(count: int, number: int) -> Data:
    """A box that is to go straight on through so many discs or boxes."""
    drives, parameters = Data(), Data()
    for axis, at in (("x", -0.06), ("y", 0.0)):
        parameters[axis] = {"default": at, "range": [-2, 2]}
        servo = {"kind": "servo", "target": axis, "stiffness": 1000, "damping": 20, "limit": 30}
        drives[axis] = {"drive": servo}
    drives["angle"] = {"drive": {"kind": "speed", "speed": 0}}
    finger = {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.006}, "mass": 0.1,
        "pose": {"x": "x", "y": "y"}, "motion": {"kind": "free"}, "coordinates": drives,
    }  # fmt: skip
    bodies = {
        "finger": finger,
        "box": _lying({"kind": "box", "width": SIDE, "height": SIDE}, (0.0, 0.0), 0.4),
    }
    round_one = {"kind": "disc", "radius": PIECE}
    shape = round_one if number % 2 == 0 else {"kind": "box", "width": 2 * PIECE, "height": 1.5 * PIECE}
    for k, place in enumerate(_scattered(count, number)):
        bodies[f"piece{k}"] = _lying(shape, place, 0.04)
    pairs = [("finger", "box"), ("finger", "piece*"), ("box", "piece*"), ("piece*", "piece*")]
    pairs = pairs[: 1 + 2 * (count > 0) + (count > 1)]
    contact = {"friction": 0.4, "stiffness": 1e5, "damping": 100.0}
    return {
        "name": f"clutter_{count}", "parameters": parameters, "inputs": ["x", "y"], "bodies": bodies,
        "contacts": [{"between": pair, **contact} for pair in pairs],
        "goal": "hypot(box.x - 0.15, box.y) <= 0.02 and abs(box.angle) <= 0.3",
        "duration": 100, "step": 1e-3, "tolerance": 1e-7,
        "task": {
            "fingers": {"finger": {"speed": 0.05, "clearance": 0.004, "objects": "box"}}, "moves": [1, 8],
        },
    }  # fmt: skip


def _lying(shape: Data, place: tuple[float, float], mass: float) -> Data:
    """An object on a table."""
    return {
        "role": "object", "shape": shape, "pose": dict(zip("xy", place, strict=True)), "mass": mass,
        "motion": {"kind": "free"}, "support": {"friction": 0.3, "gravity": 9.81},
    }  # fmt: skip


def _scattered(count: int, number: int) -> list[tuple[float, float]]:
    """Places in the way of the box."""
    rng, found = np.random.default_rng(number), list[tuple[float, float]]()
    while len(found) < count:
        place = (float(rng.uniform(0.05, 0.19)), float(rng.uniform(-0.035, 0.035)))
        if all(math.dist(place, other) > APART for other in found):
            found.append(place)
    return found


def shipped(kind: str, name: str) -> Data:
    """A shipped scene of fingers on servos, changed so."""
    text = (LIBRARY / f"{name}.yaml").read_text("utf-8")
    if kind == "soft":
        text = text.replace("damping: 2 * sqrt(", f"damping: 2 * {UNDAMPED} * sqrt(")
    data: Data = yaml.safe_load(text)
    data["name"], parameters = f"{name}_{kind}", deepcopy(data["parameters"])
    for parameter, factor in {"stiff": {"stiffness": STIFFER}, "slow": {"v": SLOWER}}.get(kind, {}).items():
        parameters[parameter]["default"] *= factor
    return data | {"parameters": parameters}


def tight(passage: float) -> Data:
    """The shipped corridor of another width."""
    data = shipped("tight", "corridor")
    data["name"], data["parameters"]["passage"]["default"] = f"corridor_{1e3 * passage:.0f}_mm", passage
    return data


def members(kind: str) -> list[rw.Scene]:
    """The scenes of a kind."""
    if kind == "clutter":
        return [rw.load(clutter(count, number)) for number, count in enumerate(CROWDS)]
    if kind == "tight":
        return [rw.load(tight(passage)) for passage in PASSAGES]
    return [rw.load(shipped(kind, name)) for name in SHIPPED]


KINDS = ("clutter", "soft", "stiff", "slow", "tight")
RUNS, AHEAD, ERROR = (0, 2, 4, 8), 0.15, 1e-3
"""Pieces in the way of one push, how far the finger is led, and the error allowed per step over the box's
size."""


def print_runs() -> None:
    """A row for each number of pieces: milliseconds of one push on both rungs, and its steps."""
    print(f"{'pieces':>6}" + "".join(f" {rung.name + ' ms':>22} {'steps':>6}" for rung in RUNGS))
    for count in RUNS:
        cells = list[str]()
        for rung in RUNGS:
            best, run = math.inf, None
            for _ in range(2):
                began = time.process_time()
                run = rw.simulate(
                    rw.load(clutter(count, 0)), rung, inputs=[rw.Segment({"x": AHEAD}, 4.0, ramp=True)],
                    tol=ERROR * SIDE,
                )  # fmt: skip
                best = min(best, time.process_time() - began)
            assert run is not None
            cells.append(f" {1e3 * best:22.0f} {run.steps:6}")
        print(f"{count:6}" + "".join(cells), flush=True)


@contextmanager
def by_processor() -> Iterator[None]:
    """Limits of calls count processor seconds."""
    clock = SimpleNamespace(monotonic=time.process_time)
    with patch("rungwise.deadline.time", clock):
        yield


@dataclass
class Tally(Found):
    """What came of the members and seeds of a kind, planned in one way."""

    steps: dict[str, int] = field(default_factory=dict)

    def add(self, scene: rw.Scene, way: str, seed: int, limit: float) -> None:
        """Plan a task from a seed, and replay the plan."""
        began = time.process_time()
        with by_processor():
            plan = WAYS[way].plan(scene, seed, limit)
        self.count(plan, time.process_time() - began)
        for record in plan.records:
            rung = record.stage.split(" ")[0]
            self.steps[rung] = self.steps.get(rung, 0) + record.steps


def print_kind(kind: str, seeds: Sequence[int], limit: float) -> None:
    """A row for each way."""
    tallies = {way: Tally() for way in WAYS}
    for scene in members(kind):
        for way in WAYS:
            with by_processor():
                WAYS[way].plan(scene, seeds[0], WARMING)
        for seed in seeds:
            for way, tally in tallies.items():
                tally.add(scene, way, seed, limit)
    first = float(np.median(next(iter(tallies.values())).seconds))
    for way, tally in tallies.items():
        median = float(np.median(tally.seconds))
        ratio = f"{'>' if tally.mostly_fails else ''}{median / first:.2f}"
        steps = [tally.steps.get(rung.name, 0) for rung in RUNGS]
        print(
            f"{kind:8} {way:22} {tally.solved:2} of {len(tally.seconds):2} {tally.held:5} {median:9.2f}"
            f" {ratio:>7} {steps[0]:18} {steps[1]:18}",
            flush=True,
        )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--limit", type=float, default=10.0)
    parser.add_argument("--runs", action="store_true", help="one push through pieces on both rungs alone")
    given = parser.parse_args(arguments)
    if given.runs:
        print_runs()
        return
    print(
        f"{'kind':8} {'way':22} {'solved':>8} {'held':>5} {'median s':>9} {'ratio':>7}"
        f" {'quasistatic-rigid':>18} {'dynamic-compliant':>18}"
    )
    for kind in given.kinds.split(","):
        print_kind(kind, range(given.seeds), given.limit)


if __name__ == "__main__":
    main()
