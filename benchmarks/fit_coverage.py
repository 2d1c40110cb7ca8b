"""Whether intervals of fits hold what they promise: true values lie within, and what is open is named.

    python benchmarks/fit_coverage.py [--draws N] [--trials N] [--only CASE ...] [--out FILE] [--jobs N]

A rung makes noisy trials at parameters that are drawn; `rw.fit` finds them again. A case is right where the
true values lie within their 95 % intervals in 90 to 99 % of the draws, and where what cannot be determined is
named each time. Each finished draw is a line of FILE, and a run that was stopped goes on from these; draws of
all cases come by turns, so that a part of them is a smaller table. Processes share the draws.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw

PLACE, TURN, SPEED, RATE = 3e-4, 3e-3, 2e-2, 2e-1
"""Deviations of the measurement: m, rad, m/s, rad/s."""
TOL = 1e-7
"""Error per step (m) of the runs that make the motions; those that are fitted choose their own."""
FRAMES, PUSHED, FLOWN = 0.004, 0.02, 0.01
"""Seconds between frames of drops and strokes, of pushes, and of balls."""
FALL, PUSH_FRAMES, BALL_FRAMES = 24, 20, 12
"""Frames of them: an impact or two, and a way of 2 cm."""


def ranged(**given: tuple[float, float, float]) -> dict[str, Any]:
    """Parameters by their defaults and ranges."""
    return {name: {"default": value, "range": [low, high]} for name, (value, low, high) in given.items()}


DROP: dict[str, Any] = {
    "name": "drop",
    "parameters": ranged(
        mu=(0.5, 0.0, 1.0),
        e=(0.5, 0.0, 1.0),
        K=(1e5, 1e4, 1e6),
        C=(100.0, 10.0, 1000.0),
        mass=(1.0, 0.1, 10.0),
    ),
    "gravity": [0, -9.81],
    "bodies": {
        "part": {
            "role": "object",
            "shape": {"kind": "box", "width": 0.06, "height": 0.06},
            "motion": {"kind": "free"},
            "mass": "mass",
        },
        "table": {"role": "obstacle", "shape": {"kind": "halfplane"}},
    },
    "contacts": [
        {"between": ["part", "table"], "friction": "mu", "restitution": "e", "stiffness": "K", "damping": "C"}
    ],
    "tolerance": 1e-5,
    "duration": 1.0,
    "step": 1e-3,
}
PUSH: dict[str, Any] = {
    "name": "slow_push",
    "parameters": ranged(
        mu=(0.3, 0.0, 1.0), c=(0.03, 0.005, 0.06), centre=(0.0, -0.02, 0.02), K=(1e6, 1e5, 1e8),
        y=(0.0, -0.04, 0.04),
    ),
    "bodies": {
        "rod": {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.005},
            "pose": {"x": -0.0551, "y": "y"},
            "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "speed", "speed": 0.05}}},
        },
        "box": {
            "role": "object",
            "shape": {"kind": "box", "width": 0.1, "height": 0.1},
            "motion": {"kind": "free"},
            "mass": 1,
            "support": {
                "friction": 0.3, "gravity": 9.81, "pressure": {"kind": "ratio", "ratio": "c"},
                "centre": [0, "centre"],
            },
        },
    },
    "contacts": [{"between": ["rod", "box"], "friction": "mu", "stiffness": "K", "damping": 10}],
    "tolerance": 1e-5,
    "duration": 2.0,
    "step": 1e-2,
}  # fmt: skip
STROKE: dict[str, Any] = {
    "name": "stroke",
    "parameters": ranged(
        ratio=(1.0, 0.1, 10.0), e=(0.5, 0.0, 1.0), mu=(0.2, 0.0, 1.0), scale=(1.0, 0.1, 10.0)
    ),
    "bodies": {
        "cue": {
            "role": "object",
            "shape": {"kind": "disc", "radius": 0.02},
            "motion": {"kind": "free"},
            "mass": "scale",
        },
        "block": {
            "role": "object",
            "shape": {"kind": "box", "width": 0.06, "height": 0.06},
            "motion": {"kind": "free"},
            "mass": "scale * ratio",
        },
    },
    "contacts": [{"between": ["cue", "block"], "friction": "mu", "restitution": "e"}],
    "tolerance": 1e-5,
    "duration": 1.0,
    "step": 1e-3,
}


@dataclass(frozen=True)
class Case:
    """What is drawn and sought on a rung, and what must be named as open."""

    model: str
    scene: Any
    drawn: dict[str, tuple[float, float]]
    open: tuple[str, ...]
    make: Callable[[Case, dict[str, float], int, np.random.Generator], rw.Motions]
    box: dict[str, tuple[float, float]] | None = None
    span: float | None = None

    @property
    def over(self) -> tuple[str, ...]:
        return (*self.drawn, *self.open)


def falling(trials: int, rng: np.random.Generator) -> Any:
    """States (m, 6) of a part over the table, on its way down with a spin."""
    q = [np.zeros(trials), rng.uniform(0.06, 0.09, trials), rng.uniform(-3.0, 3.0, trials)]
    v = [rng.uniform(-1.0, 1.0, trials), rng.uniform(-1.5, -0.5, trials), rng.uniform(-10.0, 10.0, trials)]
    return np.column_stack([*q, *v])


def drops(case: Case, true: dict[str, float], trials: int, rng: np.random.Generator) -> rw.Motions:
    """Drops of a box with a spin onto a table."""
    return _measured(case, true, falling(trials, rng), ("part",), rng)


def strokes(case: Case, true: dict[str, float], trials: int, rng: np.random.Generator) -> rw.Motions:
    """A disc hits a block that lies or turns slowly, from the left, each time elsewhere."""
    q, v = np.zeros((trials, 6)), np.zeros((trials, 6))
    q[:, 0], q[:, 1] = rng.uniform(-0.09, -0.07, trials), rng.uniform(-0.03, 0.03, trials)
    v[:, 0], v[:, 1] = rng.uniform(0.5, 1.0, trials), rng.uniform(-0.3, 0.3, trials)
    q[:, 5], v[:, 5] = rng.uniform(-0.5, 0.5, trials), rng.uniform(-1.0, 1.0, trials)
    return _measured(case, true, np.hstack([q, v]), ("cue", "block"), rng)


def _measured(
    case: Case, true: dict[str, float], starts: Any, bodies: tuple[str, ...], rng: np.random.Generator
) -> rw.Motions:
    """Runs of bodies in the plane, measured with their velocities."""
    places, speeds = _run(case, true, starts, FALL, FRAMES)
    places += rng.normal(size=places.shape) * np.tile([PLACE, PLACE, TURN], len(bodies))
    speeds += rng.normal(size=speeds.shape) * np.tile([SPEED, SPEED, RATE], len(bodies))
    names = [f"{body}.{axis}" for body in bodies for axis in ("x", "y", "angle")]
    deviations = dict(zip(names, (PLACE, PLACE, TURN) * len(bodies), strict=True))
    deviations |= {
        f"speed({name})": x for name, x in zip(names, (SPEED, SPEED, RATE) * len(bodies), strict=True)
    }
    return rw.Motions(names, FRAMES * np.arange(FALL + 1), places, speeds, deviations=deviations)


def balls(case: Case, true: dict[str, float], trials: int, rng: np.random.Generator) -> rw.Motions:
    """Balls in space that fall onto a floor, sliding and spinning."""
    start = np.zeros((trials, 13))
    start[:, 2], start[:, 3] = rng.uniform(0.12, 0.14, trials), 1.0
    way, speed = rng.uniform(-np.pi, np.pi, trials), rng.uniform(1.0, 2.0, trials)
    start[:, 7], start[:, 8], start[:, 9] = speed * np.cos(way), speed * np.sin(way), -0.7
    start[:, 10:] = rng.uniform(-5.0, 5.0, (trials, 3))
    places, speeds = _run(case, true, start, BALL_FRAMES, FLOWN)
    places += rng.normal(size=places.shape) * ([PLACE] * 3 + [TURN / 2.0] * 4)
    places[..., 3:] /= np.linalg.norm(places[..., 3:], axis=-1, keepdims=True)
    speeds += rng.normal(size=speeds.shape) * ([SPEED] * 3 + [RATE] * 3)
    axes, turns = ("x", "y", "z"), ("rx", "ry", "rz")
    deviations = {f"ball.{axis}": PLACE for axis in axes} | {"ball.qw": TURN}
    deviations |= {f"speed(ball.{axis})": SPEED for axis in axes}
    deviations |= {f"speed(ball.{axis})": RATE for axis in turns}
    return rw.Motions(
        [f"ball.{axis}" for axis in (*axes, "qw", "qx", "qy", "qz")], FLOWN * np.arange(BALL_FRAMES + 1),
        places, speeds, rates=[f"ball.{axis}" for axis in (*axes, *turns)], deviations=deviations,
    )  # fmt: skip


def pushes(
    case: Case, true: dict[str, float], trials: int, rng: np.random.Generator, noise: float = 1.0
) -> rw.Motions:
    """Slow pushes of a box on a support, each at a height that is known; noise: in deviations."""
    start = np.zeros((trials, 8))
    start[:, 4] = 0.05
    heights = rng.uniform(-0.035, 0.035, trials)
    places, _ = _run(case, true | {"y": heights}, start, PUSH_FRAMES, PUSHED)
    places += noise * rng.normal(size=places.shape) * [1e-9, PLACE, PLACE, TURN]
    names = ("rod.x", "box.x", "box.y", "box.angle")
    deviations = {"box.x": PLACE, "box.y": PLACE, "box.angle": TURN}
    times = PUSHED * np.arange(PUSH_FRAMES + 1)
    return rw.Motions(names, times, places, parameters={"y": heights}, deviations=deviations)


def _run(
    case: Case, true: dict[str, Any], starts: Any, frames: int, step: float
) -> tuple[Any, Any]:  # fmt: skip
    """Places and speeds (m, frames + 1, n) of runs from starts."""
    durations = np.full((len(starts), frames), step)
    found = rw.rollout(
        case.scene, case.model, starts, durations=durations, parameters=true, tol=TOL, threads=1
    )
    n = found.q.shape[2]
    return (
        np.concatenate([starts[:, None, :n], found.q], axis=1),
        np.concatenate([starts[:, None, n:], found.v], axis=1),
    )


CASES = {
    "impacts": Case("dynamic-rigid", DROP, {"mu": (0.1, 0.4), "e": (0.1, 0.7)}, (), drops),
    "mass under gravity": Case("dynamic-rigid", DROP, {"mu": (0.1, 0.4), "e": (0.1, 0.7)}, ("mass",), drops),
    "compliant impacts": Case(
        "dynamic-compliant", DROP, {"mu": (0.1, 0.4), "K": (5e4, 2e5), "C": (50.0, 200.0)}, (), drops
    ),
    "masses": Case("dynamic-rigid", STROKE, {"ratio": (0.5, 2.0), "e": (0.1, 0.7)}, ("scale",), strokes),
    "support": Case(
        "quasistatic-rigid", PUSH, {"mu": (0.1, 0.5), "c": (0.02, 0.05), "centre": (-0.01, 0.01)}, (), pushes
    ),
    "stiffness from slow pushes": Case("quasistatic-compliant", PUSH, {"c": (0.02, 0.05)}, ("K",), pushes),
    "ball in space": Case(
        "dynamic-rigid", "ball", {"mu": (0.05, 0.2), "restitution": (0.2, 0.7)}, (), balls,
        {"mu": (0.0, 0.5)}, np.inf,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Draw:
    """One fit: case, seed, whether each true value lay in its interval, widths of intervals over their
    ranges, whether what is open was named, and whether something else was; misfit, whether motions are
    outside, and processor seconds."""

    case: str
    seed: int
    within: dict[str, bool]
    widths: dict[str, float]
    named: bool
    wrongly: bool
    misfit: float
    outside: bool
    cpu_s: float = field(compare=False)


def drawn(name: str, seed: int, trials: int) -> Draw:
    """A case at one draw."""
    case, rng, began = CASES[name], np.random.default_rng(seed), time.process_time()
    true = {each: float(rng.uniform(*ends)) for each, ends in case.drawn.items()}
    found = rw.fit(
        case.scene, case.model, case.make(case, true, trials, rng), case.over, seed=seed, threads=1,
        box=case.box, span=case.span,
    )  # fmt: skip
    ends = {each: found.intervals[each] for each in case.drawn}
    ranges = {
        each: (case.box or {}).get(each) or found.scene.file.parameters[each].range for each in case.drawn
    }
    return Draw(
        name, seed, {each: bool(low <= true[each] <= high) for each, (low, high) in ends.items()},
        {each: float((high - low) / np.ptp(ranges[each])) for each, (low, high) in ends.items()},
        set(case.open) <= set(found.open), bool(set(found.open) - set(case.open)), found.misfit,
        found.outside, time.process_time() - began,
    )  # fmt: skip


def table(draws: list[Draw]) -> str:
    """Lines of a page."""
    lines = ["| case | draws | within the 95 % interval | width / range | open named | wrongly | outside |"]
    lines.append("|" + "---|" * 7)
    for name in dict.fromkeys(each.case for each in draws):
        own = [each for each in draws if each.case == name]
        over = own[0].within
        within = ", ".join(f"{n} {np.mean([each.within[n] for each in own]):.1%}" for n in over)
        widths = ", ".join(f"{n} {np.median([each.widths[n] for each in own]):.2g}" for n in over)
        named = f"{np.mean([each.named for each in own]):.0%}" if CASES[name].open else ""
        shares = [np.mean(x) for x in ([e.wrongly for e in own], [e.outside for e in own])]
        cells = (name, len(own), within, widths, named, *(f"{each:.0%}" for each in shares))
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def kept(file: Path | None) -> list[Draw]:
    """The draws of a file."""
    if file is None or not file.is_file():
        return []
    text = file.read_text("utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        file.write_text(whole, "utf-8")  # the run was stopped within a line
    return [Draw(**json.loads(line)) for line in whole.splitlines()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--out", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    done = {(each.case, each.seed): each for each in kept(given.out)}
    wanted = [(name, seed) for seed in range(given.draws) for name in given.only]
    with ProcessPoolExecutor(given.jobs) as pool:
        left = [pool.submit(drawn, *each, given.trials) for each in wanted if each not in done]
        for future in as_completed(left):
            one = future.result()
            done[one.case, one.seed] = one
            if given.out is not None:
                with given.out.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(vars(one)) + "\n")
    found = [done[each] for each in wanted]
    print(table(sorted(found, key=lambda each: given.only.index(each.case))))
    print(f"{np.sum([each.cpu_s for each in found]):.0f} s of processor time")


if __name__ == "__main__":
    main()
