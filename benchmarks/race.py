"""rungwise beside other engines on two tasks with known answers: verdicts, accuracy and speed in one run.

    python benchmarks/race.py [--json]

Two fingers: ten speed ratios r around the capture band, which is [1/2, 2] without restitution and friction
0.5 (compliant, C = 1e4: from 0.5040 to 1.9841). All engines take the same steps and stop by the same rule.
Times are of whole runs, set-up included: medians of repeats that alternate between the engines. The others
are stepped from Python, as their users do; rungwise's loop is compiled. The second table is of the engines'
own loops, in which nobody reads or sets anything: `mj_step` with `nstep`, bare `Step` and `step` of a world,
`simulate`; times are of a step of a long run, and rates of whole runs to their verdicts, which rungwise makes
with `rollout` at its usual `tol` on one thread, and the others one by one as above. A block on a slope: what
it creeps where friction should hold it, its acceleration where it should not, and the most that it rises off
the slope.

An engine that is not installed is left out (`pip install .[race]` has them all).
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import peers  # beside this file
from arguments import wants_json
from clock import processor_times

import rungwise as rw

RATIOS = (0.35, 0.42, 0.47, 0.53, 0.6, 0.8, 1.25, 1.6, 1.85, 2.2)
STEPS = (5e-3, 1e-3, 2e-4)
REPEATS = 3
HOLDS, SLIDES = 0.5, 0.2
ANGLE = math.radians(20.0)
CREEP_S, SLIDE_S = 9.0, 2.0
BARE = (5_000, 70_000, 76_000, 96_000)
"""Steps of `BARE_STEP`: fingers fly between the first two, and one pushes the part between the others."""
BARE_STEP, BARE_RATIO = 2e-5, 0.6
RUNS, TOL = 2000, 1e-3


@dataclass(frozen=True)
class Grasp:
    """Verdicts of one engine at one step (1 caught, 0 lost, in the order of the ratios), and its speed."""

    engine: str
    step: float
    verdicts: str
    wrong: int
    steps_per_s: float
    runs_per_s: float
    relative: float = 1.0


@dataclass(frozen=True)
class Loop:
    """Microseconds of processor time of a bare step, in flight and in touch; whole runs in a second of it."""

    engine: str
    flight: float
    touch: float
    runs_per_s: float


@dataclass(frozen=True)
class Sliding:
    """Creep (m in 9 s), relative error of the sliding acceleration, and lift-off while sliding (m)."""

    engine: str
    step: float
    creep: float
    acceleration_error: float
    lift: float


def catch(scene: rw.Scene, rung: rw.Rung, ratio: float, h: float) -> tuple[bool, int]:
    """One run of rungwise."""
    run = rw.simulate(scene, rung, parameters={"v1": 1.0, "v2": ratio}, step=h, frames=3)
    return run.outcome.name == "goal", run.steps


def grasps(ratios: Sequence[float], steps: Sequence[float], repeats: int) -> list[Grasp]:
    """Every engine on the two-finger task."""
    scene = rw.load("two_finger")
    engines: dict[str, Callable[[float, float], tuple[bool, int]]] = {
        rung.name: partial(catch, scene, rung) for rung in rw.LADDER if rung.moves
    }
    engines |= {peer.name: peer.catch for peer in peers.peers()}
    for engine in engines.values():
        engine(1.0, max(steps))
    rows = []
    for h in steps:
        results: dict[str, list[tuple[float, list[tuple[bool, int]]]]] = {name: [] for name in engines}
        for _ in range(repeats):
            for name, engine in engines.items():
                began = time.perf_counter()
                found = [engine(ratio, h) for ratio in ratios]
                results[name].append((time.perf_counter() - began, found))
        slowest = None
        for name, many in results.items():
            took, found = median(seconds for seconds, _ in many), many[0][1]
            verdicts = "".join(str(int(caught)) for caught, _ in found)
            truth = [0.5 <= ratio <= 2.0 for ratio in ratios]
            wrong = sum(caught != right for (caught, _), right in zip(found, truth, strict=True))
            slowest = slowest or took
            rows.append(
                Grasp(
                    name,
                    h,
                    verdicts,
                    wrong,
                    sum(n for _, n in found) / took,
                    len(ratios) / took,
                    slowest / took,
                )
            )
    return rows


def loops(ratios: Sequence[float], h: float, repeats: int, runs: int) -> list[Loop]:
    """Every engine in its own loop; a step is the difference of two long runs, over their steps."""
    scene, rows = rw.load("two_finger"), []
    draws = {"v1": np.ones(runs), "v2": np.resize(ratios, runs)}

    def ours(rung: rw.Rung, steps: int) -> None:
        values = {"v1": 1.0, "v2": BARE_RATIO}
        rw.simulate(scene, rung, parameters=values, step=BARE_STEP, duration=steps * BARE_STEP, frames=3)

    def row(engine: str, bare: Callable[[int], None], batch: Callable[[], object], count: int) -> Loop:
        took = [min(processor_times(partial(bare, steps), repeats)) for steps in BARE]
        flight, touch = (1e6 * float(x) for x in np.diff(took)[::2] / np.diff(BARE)[::2])
        return Loop(engine, flight, touch, count / min(processor_times(batch, repeats)))

    for rung in (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT):
        batch = partial(rw.rollout, scene, rung, parameters=draws, tol=TOL, keep=False, threads=1)
        batch()
        rows.append(row(rung.name, partial(ours, rung), batch, runs))
    for peer in peers.peers():

        def bare(steps: int, peer: peers.Peer = peer) -> None:
            peer.bare(BARE_RATIO, BARE_STEP, steps)

        def one_by_one(peer: peers.Peer = peer) -> list[tuple[bool, int]]:
            return [peer.catch(ratio, h) for ratio in ratios]

        rows.append(row(peer.name, bare, one_by_one, len(ratios)))
    return rows


def block(rung: rw.Rung, angle: float, mu: float, duration: float, h: float) -> peers.Slope:
    """The lone block of the scene `blocks`."""
    data: dict[str, Any] = rw.load("blocks").file.model_dump(mode="json")
    data |= {"goal": None, "unsafe": None}
    for name in ("lower", "upper"):
        del data["bodies"][name]
    data["contacts"] = data["contacts"][1:]
    run = rw.simulate(data, rung, parameters={"slope": angle, "mu": mu}, duration=duration, step=h)
    place = run.trajectory.position
    along = place[:, 0] * math.cos(angle) + place[:, 1] * math.sin(angle)
    rise = -place[:, 0] * math.sin(angle) + place[:, 1] * math.cos(angle) - 0.5
    return peers.Slope(float(along[0] - along[-1]), max(0.0, float(rise.max())))


def slidings(step: float) -> list[Sliding]:
    """Every engine that has a block, at one step."""
    engines: dict[str, Callable[[float, float, float, float], peers.Slope]] = {
        rung.name: partial(block, rung) for rung in (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
    }
    engines |= {peer.name: peer.block for peer in peers.peers() if peer.block is not None}
    exact = peers.G * (math.sin(ANGLE) - SLIDES * math.cos(ANGLE))
    rows = []
    for name, engine in engines.items():
        held, slid = engine(ANGLE, HOLDS, CREEP_S, step), engine(ANGLE, SLIDES, SLIDE_S, step)
        acceleration = 2.0 * slid.distance / SLIDE_S**2
        rows.append(Sliding(name, step, held.distance, abs(acceleration / exact - 1.0), slid.lift))
    return rows


def main(
    arguments: Sequence[str] | None = None,
    ratios: Sequence[float] = RATIOS,
    steps: Sequence[float] = STEPS,
    repeats: int = REPEATS,
    runs: int = RUNS,
) -> int:
    """Print both tables, or one JSON object."""
    as_json = wants_json(arguments, "rungwise beside other engines.")
    grasped, slid = grasps(ratios, steps, repeats), slidings(max(steps))
    bare = loops(ratios, sorted(steps)[len(steps) // 2], repeats, runs)
    if as_json:
        rows = {"grasps": [asdict(row) for row in grasped], "slidings": [asdict(row) for row in slid]}
        rows["loops"] = [asdict(row) for row in bare]
        print(json.dumps({"ratios": list(ratios)} | rows))
        return 0
    truth = "".join(str(int(0.5 <= ratio <= 2.0)) for ratio in ratios)
    print(f"two fingers, {len(ratios)} ratios, closed form {truth}, median of {repeats}, one thread")
    print(
        f"{'':24s} {'step':>6s} {'verdicts':>12s} {'wrong':>6s} {'steps/s':>9s} {'runs/s':>8s}"
        f" {'relative':>9s}"
    )
    for row in grasped:
        print(
            f"{row.engine:24s} {row.step:6.0e} {row.verdicts:>12s} {row.wrong:6d} {row.steps_per_s:9.3g}"
            f" {row.runs_per_s:8.3g} {row.relative:9.2g}"
        )
    print("the engines' own loops, and whole runs")
    print(f"{'':24s} {'flight':>12s} {'touch':>12s} {'runs/s':>8s}")
    for loop in bare:
        print(f"{loop.engine:24s} {loop.flight:9.2f} us {loop.touch:9.2f} us {loop.runs_per_s:8.3g}")
    print("block on a slope of 20 degrees")
    print(f"{'':24s} {'step':>6s} {'creep in 9 s':>13s} {'error of a':>11s} {'lift-off':>10s}")
    for line in slid:
        print(
            f"{line.engine:24s} {line.step:6.0e} {1e3 * line.creep:10.2e} mm {line.acceleration_error:11.1e}"
            f" {1e3 * line.lift:7.1e} mm"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
