"""The capture band of the two-finger grasp on each rung, by bisection, beside the closed forms.

    python examples/bands.py

With prescribed speeds v1 and v2, r = v2 / v1 and friction below tan 45 degrees, the part is caught for r in
one interval around 1, so bisection finds its ends. (With free fingers the set need not be an interval.)
Every outcome other than `goal` counts as not caught. An end may be off by about two steps' travel, 2 h v1.

Closed forms (half-base and height 1, fingers at -0.5 and 0.5, travel 2, start at the origin):
  slowest motion and plastic impact   1/2
  restitution e, rigid contact        1 / (1.5 + 0.5 / (1 + e)): the first impact decides
  compliant, K = 1e6, v1 = 1          C = 1e4: 0.50399; C = 0: 0.567 to 0.570 at the step 1e-4 (limit 4/7)
The upper end is the inverse of the lower one, because the scene is its own mirror image.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import rungwise as rw

STEP = 1.9371e-4
"""No contact time of the scene is a multiple of it: luck with the grid of steps would hide errors."""
COMPLIANT_STEP = 1e-4
OUTSIDE = 0.25
"""A ratio that no rung catches; so is its inverse."""


@dataclass(frozen=True)
class Case:
    """A rung, what differs from the scene's defaults, and the lower end expected (least, greatest)."""

    rung: rw.Rung
    parameters: dict[str, float]
    step: float
    expected: tuple[float, float]
    closed_form: str


@dataclass(frozen=True)
class Band:
    """Measured ends in r, and half the width of the last bracket."""

    lower: float
    upper: float
    bracket: float


def restitution_end(e: float) -> float:
    """Lower end of the band of the rigid dynamic rung with restitution e."""
    return 1.0 / (1.5 + 0.5 / (1.0 + e))


def cases() -> list[Case]:
    """The rows of the table."""
    rows = [
        Case(rung, {}, STEP, (0.5, 0.5), "1/2")
        for rung in (rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)
    ]
    for e in (0.0, 0.5, 1.0):
        end = restitution_end(e)
        rows.append(Case(rw.DYNAMIC_RIGID, {"restitution": e}, STEP, (end, end), f"e = {e:g}: {end:.4f}"))
    damped, undamped = (0.50399, 0.50399), (0.567, 0.570)
    rows.append(Case(rw.DYNAMIC_COMPLIANT, {"damping": 1e4}, COMPLIANT_STEP, damped, "C = 1e4: 0.5040"))
    rows.append(
        Case(rw.DYNAMIC_COMPLIANT, {"damping": 0.0}, COMPLIANT_STEP, undamped, "C = 0: 0.567 to 0.570")
    )
    return rows


def is_caught(scene: rw.Scene, case: Case, ratio: float) -> bool:
    """Whether the run at this ratio reaches the goal; the faster finger has speed 1."""
    v1, v2 = (1.0, ratio) if ratio <= 1.0 else (1.0 / ratio, 1.0)
    parameters = {"mu": 0.5, **case.parameters, "v1": v1, "v2": v2}
    run = rw.simulate(scene, case.rung, parameters=parameters, step=case.step, frames=3)
    return run.outcome.code == rw.Code.GOAL


def band(scene: rw.Scene, case: Case, bisections: int = 13) -> Band:
    """Both ends of the capture band."""
    lower, bracket = _end(scene, case, OUTSIDE, bisections)
    upper, _ = _end(scene, case, 1.0 / OUTSIDE, bisections)
    return Band(lower, upper, bracket)


def _end(scene: rw.Scene, case: Case, outside: float, bisections: int) -> tuple[float, float]:
    inside = 1.0
    if is_caught(scene, case, outside) or not is_caught(scene, case, inside):
        raise ValueError(
            f"{case.rung.name} {case.parameters}: r = 1 must be caught and r = {outside:g} must not"
        )
    for _ in range(bisections):
        middle = (inside * outside) ** 0.5
        if is_caught(scene, case, middle):
            inside = middle
        else:
            outside = middle
    return (inside * outside) ** 0.5, 0.5 * abs(inside - outside)


def main(arguments: Sequence[str] | None = None, bisections: int = 13) -> int:
    """Print one line per case."""
    parser = argparse.ArgumentParser(
        description="Capture bands of the two-finger grasp beside their closed forms."
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    scene = rw.load("two_finger")
    if not options.json:
        print("Capture band in r = v2 / v1, mu = 0.5, faster finger at speed 1")
        print(
            f"{'rung':22s} {'step':>9s} {'from':>8s} {'to':>8s} {'1 / to':>8s}  closed form of the lower end"
        )
    found = []
    for case in cases():
        measured = band(scene, case, bisections)
        found.append(
            {
                "model": case.rung.name,
                "parameters": case.parameters,
                "step": case.step,
                "expected": case.expected,
            }
            | asdict(measured)
        )
        if not options.json:
            print(
                f"{case.rung.name:22s} {case.step:9.4g} {measured.lower:8.5f} {measured.upper:8.5f}"
                f" {1.0 / measured.upper:8.5f}  {case.closed_form}",
                flush=True,
            )
    if options.json:
        print(json.dumps({"bands": found}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
