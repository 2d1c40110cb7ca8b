"""Whether squeezes orient a part as planned, from random orientations, and up to which friction.

    python benchmarks/squeeze.py [--samples 10000] [--model quasistatic-rigid] [--shift 0] [--json]

An unsymmetrical pentagon lies on a table, in a random orientation, between two jaws. `rw.squeeze_plan`
says at which angles they close, and where the part ends. Each squeeze is simulated, from where the one before
left the part, with its middle between the jaws, so that both touch it at once; `--shift D` leaves it up to D
beside the middle. Without friction all must end alike. Then friction between jaws and part is bisected on a
tenth of them, for the greatest at which they still do, beside what the squeeze function with friction says.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from typing import Any

import numpy as np

import rungwise as rw

PART = np.array([[0.0, 0.0], [0.05, 0.0], [0.06, 0.02], [0.03, 0.04], [0.0, 0.03]])
ALIKE = 1e-3
"""Angles of parts that ended alike differ by less, in radians."""
HIGHEST, BISECTIONS = 0.5, 8
SHOWN = (0.02, 0.05, 0.1, 0.2, 0.3)


def scene(outline: np.ndarray) -> rw.Scene:
    """The scene `squeeze` with this part, without a goal."""
    file = json.loads(rw.load("squeeze").file.model_dump_json(exclude_unset=True))
    file["bodies"]["part"]["shape"] = {"kind": "polygon", "vertices": outline.tolist()}
    widest = float(np.max(np.hypot(*(outline[:, None] - outline).T)))
    width, height = np.ptp(outline, axis=0).tolist()
    sizes = {"width": width, "height": height, "opening": 0.55 * widest, "close": 0.55 * widest}
    for name, value in (sizes | {"jaw": 4.0 * widest}).items():
        file["parameters"][name]["default"] = value
    del file["goal"]
    return rw.load(file)


class Bench:
    """The part's scene and plan on one rung; the same random starts at every friction."""

    def __init__(self, model: str, samples: int, shift: float) -> None:
        self.plan, self.scene, self.model = rw.squeeze_plan(PART), scene(PART), model
        rng = np.random.default_rng(0)
        self.starts = rng.uniform(-math.pi, math.pi, samples)
        self.shifts = rng.uniform(-shift, shift, (len(self.plan.angles), samples))

    def ends(self, friction: float, samples: int) -> np.ndarray:
        """Angles of the part after the plan."""
        angles = self.starts[:samples]
        column = self.scene.template.coordinates.index("part.angle")
        for turn, shift in zip(self.plan.angles, self.shifts[:, :samples], strict=True):
            x, y = self.between(angles, turn, shift)
            given = {"turn": turn, "angle": angles, "x": x, "y": y, "mu": friction}
            angles = rw.rollout(self.scene, self.model, parameters=given, tol=1e-2, keep=False).final[
                :, column
            ]
        return angles

    def between(self, angles: np.ndarray, turn: float, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places of the part's frame with its middle between the jaws, but for a shift."""
        cos, sin = np.cos(angles - turn), np.sin(angles - turn)
        reach = np.multiply.outer(cos, PART[:, 0]) - np.multiply.outer(sin, PART[:, 1])
        across = np.multiply.outer(sin, PART[:, 0]) + np.multiply.outer(cos, PART[:, 1])
        along = shift - (reach.max(axis=1) + reach.min(axis=1)) / 2.0
        side = -(across.max(axis=1) + across.min(axis=1)) / 2.0
        return along * np.cos(turn) - side * np.sin(turn), along * np.sin(turn) + side * np.cos(turn)

    def alike(self, friction: float, samples: int) -> int:
        return int(np.sum(self.plan.off(self.ends(friction, samples)) < ALIKE))

    def predicted(self, friction: float, samples: int) -> int:
        ends = self.plan.predicted(self.starts[:samples], friction=friction)
        return int(np.sum(self.plan.off(ends) < ALIKE))


def greatest(holds: Any) -> float:
    """The greatest friction up to which something holds, by bisection."""
    low, high = 0.0, HIGHEST
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--samples", type=int, default=10000)
    parser.add_argument("--model", default="quasistatic-rigid")
    parser.add_argument(
        "--shift", type=float, default=0.0, help="part beside the middle of the jaws, at most"
    )
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    bench, began = Bench(given.model, given.samples, given.shift), time.perf_counter()
    most, few = given.samples, max(given.samples // 10, 1)
    found = {
        "model": given.model,
        "squeezes": [math.degrees(angle) for angle in bench.plan.angles],
        "final": math.degrees(bench.plan.final),
        "period": math.degrees(bench.plan.period),
        "samples": most,
        "alike": bench.alike(0.0, most),
        "greatest": greatest(lambda mu: bench.alike(mu, few) == few),
        "predicted": greatest(lambda mu: bench.predicted(mu, few) == few),
        "rows": [(mu, bench.alike(mu, few) / few, bench.predicted(mu, few) / few) for mu in SHOWN],
    }
    found["seconds"] = time.perf_counter() - began
    print(json.dumps(found) if given.json else told(found))
    return 0 if found["alike"] == given.samples else 1


def told(found: dict[str, Any]) -> str:
    angles = ", ".join(f"{angle:.2f}" for angle in found["squeezes"])
    lines = [
        f"plan: squeezes at {angles} degrees; the end is {found['final']:.2f}, up to {found['period']:g}",
        f"{found['model']}, no friction: {found['alike']} of {found['samples']} end there",
        f"of the first tenth, all end there up to a friction of {found['greatest']:.3f};"
        f" predicted: {found['predicted']:.3f}",
        "  friction   end there   predicted",
        *(f"  {mu:8g} {100 * said:9.1f} % {100 * told:9.1f} %" for mu, said, told in found["rows"]),
        f"{found['seconds']:.0f} s",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    raise SystemExit(main())
