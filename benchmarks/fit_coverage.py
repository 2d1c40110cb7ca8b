"""Whether intervals of fits hold what they promise: true values lie within, and what is open is named.

    python benchmarks/fit_coverage.py [--draws N] [--trials N] [--only CASE ...] [--json FILE]

A rung makes noisy trials at parameters that are drawn; `rw.fit` finds them again. A case is right where the
true values lie within their 95 % intervals in 90 to 99 % of the draws, and where what cannot be determined is
named each time.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw

PLACE, TURN, SPEED, RATE = 3e-4, 3e-3, 2e-2, 2e-1
"""Deviations of the measurement: m, rad, m/s, rad/s."""
TOL = 1e-7
"""Error per step (m) of the runs that make the motions; those that are fitted choose their own."""
FRAMES, PUSHED = 0.004, 0.02
"""Seconds between frames of drops, and of pushes."""

DROP: dict[str, Any] = {
    "name": "drop",
    "parameters": {
        "mu": {"default": 0.5, "range": [0.0, 1.0]},
        "e": {"default": 0.5, "range": [0.0, 1.0]},
        "K": {"default": 1e6, "range": [1e5, 1e8]},
        "C": {"default": 300.0, "range": [10.0, 3000.0]},
        "mass": {"default": 1.0, "range": [0.1, 10.0]},
    },
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
    "parameters": {
        "mu": {"default": 0.3, "range": [0.0, 1.0]},
        "c": {"default": 0.03, "range": [0.005, 0.06]},
        "centre": {"default": 0.0, "range": [-0.02, 0.02]},
        "K": {"default": 1e6, "range": [1e5, 1e8]},
        "y": {"default": 0.0, "range": [-0.04, 0.04]},
    },
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


@dataclass(frozen=True)
class Case:
    """What is drawn and sought on a rung, and what must be named as open."""

    model: str
    scene: dict[str, Any]
    drawn: dict[str, tuple[float, float]]
    open: tuple[str, ...]
    make: Callable[[Case, dict[str, float], int, np.random.Generator], rw.Motions]

    @property
    def over(self) -> tuple[str, ...]:
        return (*self.drawn, *self.open)


@dataclass(frozen=True)
class Coverage:
    """Of so many draws: how often each true value lay in its interval, how often what is open was named, how
    often what is not was, and the median width of intervals over their ranges."""

    case: str
    draws: int
    within: dict[str, float]
    named: float
    wrongly_named: float
    widths: dict[str, float]


def falling(trials: int, rng: np.random.Generator) -> Any:
    """States (m, 6) of a part over the table, on its way down with a spin."""
    q = [np.zeros(trials), rng.uniform(0.06, 0.09, trials), rng.uniform(-3.0, 3.0, trials)]
    v = [rng.uniform(-1.0, 1.0, trials), rng.uniform(-1.5, -0.5, trials), rng.uniform(-10.0, 10.0, trials)]
    return np.column_stack([*q, *v])


def drops(case: Case, true: dict[str, float], trials: int, rng: np.random.Generator) -> rw.Motions:
    """Drops of a box with a spin onto a table."""
    names = ("part.x", "part.y", "part.angle")
    places, speeds = _run(case, true, falling(trials, rng), 40, FRAMES)
    places += rng.normal(size=places.shape) * [PLACE, PLACE, TURN]
    speeds += rng.normal(size=speeds.shape) * [SPEED, SPEED, RATE]
    deviations = dict(zip(names, (PLACE, PLACE, TURN), strict=True))
    deviations |= {f"speed({name})": x for name, x in zip(names, (SPEED, SPEED, RATE), strict=True)}
    return rw.Motions(names, FRAMES * np.arange(41), places, speeds, deviations=deviations)


def pushes(case: Case, true: dict[str, float], trials: int, rng: np.random.Generator) -> rw.Motions:
    """Slow pushes of a box on a support, each at a height that is known."""
    start = np.zeros((trials, 8))
    start[:, 4] = 0.05
    heights = rng.uniform(-0.035, 0.035, trials)
    places, _ = _run(case, true | {"y": heights}, start, 40, PUSHED)
    places += rng.normal(size=places.shape) * [1e-9, PLACE, PLACE, TURN]
    names = ("rod.x", "box.x", "box.y", "box.angle")
    deviations = {"box.x": PLACE, "box.y": PLACE, "box.angle": TURN}
    return rw.Motions(names, PUSHED * np.arange(41), places, parameters={"y": heights}, deviations=deviations)


def _run(
    case: Case, true: dict[str, Any], starts: Any, frames: int, step: float
) -> tuple[Any, Any]:  # fmt: skip
    """Places and speeds (m, frames + 1, n) of runs from starts."""
    durations = np.full((len(starts), frames), step)
    found = rw.rollout(case.scene, case.model, starts, durations=durations, parameters=true, tol=TOL)
    n = found.q.shape[2]
    return (
        np.concatenate([starts[:, None, :n], found.q], axis=1),
        np.concatenate([starts[:, None, n:], found.v], axis=1),
    )


CASES = {
    "impacts": Case("dynamic-rigid", DROP, {"mu": (0.1, 0.4), "e": (0.1, 0.7)}, (), drops),
    "mass under gravity": Case("dynamic-rigid", DROP, {"mu": (0.1, 0.4), "e": (0.1, 0.7)}, ("mass",), drops),
    "compliant impacts": Case("dynamic-compliant", DROP, {"mu": (0.1, 0.4), "C": (100.0, 600.0)}, (), drops),
    "support": Case(
        "quasistatic-rigid", PUSH, {"mu": (0.1, 0.5), "c": (0.02, 0.05), "centre": (-0.01, 0.01)}, (), pushes
    ),
    "stiffness from slow pushes": Case("quasistatic-compliant", PUSH, {"c": (0.02, 0.05)}, ("K",), pushes),
}


def covered(name: str, draws: int, trials: int) -> Coverage:
    """Fits of one case at so many draws."""
    case, within, named, wrong = CASES[name], [], [], []
    widths = []
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        true = {each: float(rng.uniform(*ends)) for each, ends in case.drawn.items()}
        found = rw.fit(case.scene, case.model, case.make(case, true, trials, rng), case.over, seed=seed)
        ends = {each: found.intervals[each] for each in case.drawn}
        within.append([low <= true[each] <= high for each, (low, high) in ends.items()])
        ranges = {each: np.ptp(case.scene["parameters"][each]["range"]) for each in case.drawn}
        widths.append([(high - low) / ranges[each] for each, (low, high) in ends.items()])
        named.append(set(case.open) <= set(found.open))
        wrong.append(bool(set(found.open) - set(case.open)))
    shares = np.mean(within, axis=0).tolist()
    return Coverage(
        name, draws, dict(zip(case.drawn, shares, strict=True)), float(np.mean(named)), float(np.mean(wrong)),
        dict(zip(case.drawn, np.median(widths, axis=0).tolist(), strict=True)),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    lines = []
    print(
        "| case | draws | within the 95 % interval | width / range | open named | wrongly |\n|" + "---|" * 6
    )
    for name in given.only:
        line = covered(name, given.draws, given.trials)
        lines.append(line)
        within = ", ".join(f"{each} {share:.1%}" for each, share in line.within.items())
        widths = ", ".join(f"{each} {width:.2g}" for each, width in line.widths.items())
        cells = (name, line.draws, within, widths, f"{line.named:.0%}", f"{line.wrongly_named:.0%}")
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(line) for line in lines], indent=1))


if __name__ == "__main__":
    main()
