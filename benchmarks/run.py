"""Speed of the two-finger scene on every rung that moves, beside a loop written by hand for this scene alone.

    python benchmarks/run.py [--json]

One thread. Every figure is the median of repeats that alternate between the rungs, so that a busy machine
disturbs all of them alike; ratios to the hand-written loop of the same run are what to compare.

  steps/s   accepted steps over time in the compiled loop, summed over the ratios r = v2 / v1, to the outcome
  relative  the same over that of the hand-written compiled loop at the same step
  flight    steps/s before any contact; contact: steps/s from the first contact on, by difference
  set-up    time of `simulate` outside the loop, per run: binding, workspace, result
  command   wall time of `rungwise sim two_finger` in a process of its own, at the scene's own step
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from statistics import median

import hand_loop  # beside this file
from arguments import wants_json

import rungwise as rw

RATIOS = (0.35, 0.55, 0.75, 0.9, 1.15, 1.6, 2.5)
STEPS = (2e-4, 2e-3)
"""Lengths of step; at speeds of about 1 they give about 8000 and 800 steps."""
FIRST_CONTACT = 1.5
"""Travel of the faster finger at which it touches the part."""
REPEATS = 7
PYTHON_STEP = STEPS[1]
BY_HAND, BY_HAND_PYTHON = "hand-written, compiled", "hand-written, Python"


@dataclass(frozen=True)
class Sample:
    """Steps and loop time over all ratios, to the outcome and to the first contact; set-up time per run."""

    steps: int
    loop_s: float
    flight_steps: int
    flight_s: float
    setup_s: float


@dataclass(frozen=True)
class Row:
    """One line of the table; rates in steps per second, times in seconds."""

    model: str
    step: float
    steps_per_s: float
    relative: float
    flight_per_s: float
    contact_per_s: float
    setup_s: float
    command_s: float | None = None


def measure_rung(scene: rw.Scene, rung: rw.Rung, step: float, ratios: Sequence[float]) -> Sample:
    """One repeat of rungwise on one rung."""
    totals = [0, 0.0, 0, 0.0, 0.0]
    for ratio in ratios:
        parameters = {"v1": 1.0, "v2": ratio}
        for place, duration in ((0, None), (2, FIRST_CONTACT / max(1.0, ratio))):
            began = time.perf_counter()
            run = rw.simulate(scene, rung, parameters=parameters, step=step, duration=duration)
            took = time.perf_counter() - began
            totals[place] += run.steps
            totals[place + 1] += run.wall_s
            if duration is None:
                totals[4] += (took - run.wall_s) / len(ratios)
    return Sample(int(totals[0]), totals[1], int(totals[2]), totals[3], totals[4])


def measure_by_hand(
    loop: Callable[..., tuple[int, int, float, float, float]], step: float, ratios: Sequence[float]
) -> Sample:
    """One repeat of the hand-written loop (rigid dynamic model)."""
    totals = [0, 0.0, 0, 0.0]
    for ratio in ratios:
        for place, duration in ((0, 1e9), (2, FIRST_CONTACT / max(1.0, ratio))):
            began = time.perf_counter()
            _, steps, _, _, _ = loop(1.0, ratio, 0.5, 1.0, step, duration)
            totals[place] += steps
            totals[place + 1] += time.perf_counter() - began
    return Sample(int(totals[0]), totals[1], int(totals[2]), totals[3], 0.0)


def measure_command(rung: rw.Rung) -> float:
    """Wall time of the command in its own process."""
    program = "from rungwise.cli import main; main()"
    command = [
        sys.executable,
        "-c",
        program,
        "sim",
        "two_finger",
        "--model",
        rung.name,
        "--set",
        "v2=0.9",
        "--json",
    ]
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def agree(scene: rw.Scene, ratios: Sequence[float]) -> None:
    """The hand-written loop must tell the same story before it may serve as reference."""
    for rung, inertia in ((rw.QUASISTATIC_RIGID, 0.0), (rw.DYNAMIC_RIGID, 1.0)):
        for ratio in ratios:
            run = rw.simulate(scene, rung, parameters={"v2": ratio}, step=STEPS[1])
            outcome, _, _, x3, _ = hand_loop.compiled(1.0, ratio, 0.5, inertia, STEPS[1], 1e9)
            if outcome != run.outcome.code or abs(x3 - run.final["part"]["x3"]) > 4 * STEPS[1] * max(
                1.0, ratio
            ):
                raise SystemExit(
                    f"{rung.name}, r = {ratio:g}: the hand-written loop disagrees ({outcome}, x3 = {x3:g})"
                )


def benchmark(
    ratios: Sequence[float] = RATIOS, repeats: int = REPEATS, with_command: bool = True
) -> list[Row]:
    """All rows of the table."""
    scene = rw.load("two_finger")
    rungs = [rung for rung in rw.LADDER if rung.moves]
    agree(scene, ratios)
    tasks: dict[tuple[str, float], Callable[[], Sample]] = {}
    for step in STEPS:
        tasks[BY_HAND, step] = partial(measure_by_hand, hand_loop.compiled, step, ratios)
        for rung in rungs:
            tasks[rung.name, step] = partial(measure_rung, scene, rung, step, ratios)
    tasks[BY_HAND_PYTHON, PYTHON_STEP] = partial(measure_by_hand, hand_loop.hand_loop, PYTHON_STEP, ratios)
    samples: dict[tuple[str, float], list[Sample]] = {key: [] for key in tasks}
    for task in tasks.values():
        task()
    for _ in range(repeats):
        for key, task in tasks.items():
            samples[key].append(task())
    commands = {rung.name: measure_command(rung) for rung in rungs} if with_command else {}
    reference = {step: _rate(samples[BY_HAND, step]) for step in STEPS}
    return [
        Row(
            model=model,
            step=step,
            steps_per_s=_rate(many),
            relative=_rate(many) / reference[step],
            flight_per_s=median(s.flight_steps / s.flight_s for s in many),
            contact_per_s=median((s.steps - s.flight_steps) / max(s.loop_s - s.flight_s, 1e-9) for s in many),
            setup_s=median(s.setup_s for s in many),
            command_s=commands.get(model) if step == STEPS[0] else None,
        )
        for (model, step), many in samples.items()
    ]


def _rate(samples: Sequence[Sample]) -> float:
    return median(s.steps / s.loop_s for s in samples)


def table(rows: Sequence[Row]) -> str:
    """The rows as text."""
    lines = [
        f"{'':24s} {'step':>6s} {'steps/s':>10s} {'relative':>9s} {'flight':>10s} {'contact':>10s}"
        f" {'set-up':>8s} {'command':>8s}"
    ]
    for row in rows:
        setup = f"{1e3 * row.setup_s:.2f} ms" if row.setup_s else "-"
        command = f"{row.command_s:.2f} s" if row.command_s else "-"
        lines.append(
            f"{row.model:24s} {row.step:6.0e} {row.steps_per_s:10.3g} {row.relative:9.2g}"
            f" {row.flight_per_s:10.3g} {row.contact_per_s:10.3g} {setup:>8s} {command:>8s}"
        )
    return "\n".join(lines)


def main(
    arguments: Sequence[str] | None = None,
    ratios: Sequence[float] = RATIOS,
    repeats: int = REPEATS,
    with_command: bool = True,
) -> int:
    """Print the table, or one JSON object."""
    as_json = wants_json(arguments, "Steps per second of the two-finger scene on each rung.")
    rows = benchmark(ratios, repeats, with_command)
    if as_json:
        print(
            json.dumps({"scene": "two_finger", "ratios": list(ratios), "rows": [asdict(row) for row in rows]})
        )
    else:
        spread = f"{len(ratios)} ratios from {min(ratios):g} to {max(ratios):g}"
        print(f"two_finger, {spread}, median of {repeats}, one thread")
        print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
