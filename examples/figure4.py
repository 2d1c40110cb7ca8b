"""The paper's Figure 4: C_free of the two-finger grasp, and which ratios of speeds four models catch.

    python examples/figure4.py                            table, and the figure in out/figure4.png
    python examples/figure4.py --figure docs/figure4.png  only the figure, at that place
    python examples/figure4.py --json                     only the numbers, as one JSON object

(a) quasistatic-rigid; (b) dynamic-compliant, K = 1e6, C = 1e4; (c) the same with C = 0; (d) the same as (b)
with free fingers, thrown at the part and pulled by a potential whose least is the goal edge. Steps of 1e-4
and mu = 0.5, as printed. Runs of (a) that are lost go on, dotted, beyond the scene's rule, to the palm.
Numbers that the paper leaves open are varied: each line of the table is one choice.

A set of ratios need not be an interval, so it is scanned, and its ends are then found by bisection.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.viewing.plane.strata import Space

STEP = 1e-4
RATIOS = tuple(float(r) for r in np.geomspace(0.05, 1.0, 40))
"""Scanned; those above 1 follow, because the scene is its own mirror image (the tests see to that)."""
BISECTIONS = 12
LOW, HIGH = (0.0, 0.0, -2.0), (2.0, 2.0, 2.0)
"""The part of C_free that is drawn, in (x1, x2, x3)."""
FAN = (0.1, 0.3, 0.45, 0.52, 0.55, 0.62, 0.75, 0.9)
"""Ratios drawn, with their inverses and 1."""

Set = list[tuple[float, float]]
"""Intervals of ratios from `RATIOS[0]` to 1."""


@dataclass(frozen=True)
class Panel:
    """One of the four models, with a speed of the faster finger and other parameters."""

    letter: str
    title: str
    scene: str
    rung: rw.Rung
    speed: float = 1.0
    parameters: dict[str, float] = field(default_factory=dict)

    def run(
        self, scene: rw.Scene, ratio: float, frames: int = 3, motion: dict[str, float] | None = None
    ) -> rw.Run:
        """The run at v2 / v1 = ratio."""
        v1, v2 = (self.speed, self.speed * ratio) if ratio <= 1.0 else (self.speed / ratio, self.speed)
        parameters = {"mu": 0.5, **self.parameters, "v1": v1, "v2": v2}
        return rw.simulate(scene, self.rung, parameters=parameters, step=STEP, frames=frames, motion=motion)

    def beyond(self, scene: rw.Scene, ratio: float, slowest: bool = False) -> rw.Run:
        """The run without the scene's rule `doomed`, and on to the palm.

        The faster finger is at the palm when the other one meets the apex. There the model has two answers:
        the part is jammed, which is the slowest motion, or gives way, as in the paper.
        """
        free = scene.file.model_dump(mode="json", exclude_unset=True) | {"doomed": None}
        away = {"part.x3": 1e-3 if ratio < 1.0 else -1e-3}
        return self.run(rw.load(free), ratio, frames=600, motion=None if slowest else away)

    def varied(self, speed: float | None = None, **changes: float) -> Panel:
        """The same with other numbers."""
        return replace(self, speed=speed or self.speed, parameters={**self.parameters, **changes})

    def on(self, rung: rw.Rung, **changes: float) -> Panel:
        """The same on another rung."""
        return replace(self.varied(**changes), rung=rung)

    def with_servos(self, gain: float) -> Panel:
        """The same with fingers that follow their speeds by a force, `gain` per speed that they lack."""
        return replace(self.varied(gain=gain, push=1e9), scene="two_finger_servo")

    def numbers(self) -> str:
        """What was chosen, in words."""
        model = "" if self.letter != "d" else f"{self.rung.name}, "
        return model + ", ".join(f"{k} = {v:g}" for k, v in {"speed": self.speed, **self.parameters}.items())


A = Panel("a", "quasistatic, rigid", "two_finger", rw.QUASISTATIC_RIGID)
B = Panel("b", "dynamic, compliant, damped", "two_finger", rw.DYNAMIC_COMPLIANT, 1.0, {"damping": 1e4})
C = Panel("c", "dynamic, compliant, undamped", "two_finger", rw.DYNAMIC_COMPLIANT, 1.0, {"damping": 0.0})
D = Panel("d", "free fingers, damped", "two_finger_free", rw.DYNAMIC_COMPLIANT, 1.0, {"damping": 1e4})
PANELS = (A, B, C, D)

_OPEN = ({"mu": 0.0}, {"mu": 0.9}, {"stiffness": 1e5}, {"stiffness": 1e7})
LINES: tuple[Panel, ...] = (
    A, A.varied(mu=0.0), A.varied(mu=0.9),
    B, B.varied(0.1), B.varied(10.0), *(B.varied(**o) for o in _OPEN),
    B.varied(damping=1e5), B.varied(damping=1e3), *(B.with_servos(gain) for gain in (1e5, 1e3, 10.0)),
    C, C.varied(0.1), C.varied(10.0), *(C.varied(**o) for o in _OPEN),
    *(C.with_servos(gain) for gain in (1e5, 1e3, 10.0)),
    D, D.varied(0.3), D.varied(3.0), D.varied(10.0), D.varied(mu=0.0), D.varied(mu=0.9),
    D.varied(align=0.0), D.varied(align=10.0), D.varied(well=0.0, align=0.0),
    D.varied(finger_mass=0.1), D.varied(finger_mass=10.0), D.varied(finger_mass=100.0),
    D.on(rw.DYNAMIC_RIGID, restitution=0.0), D.on(rw.DYNAMIC_RIGID, restitution=0.5),
    D.on(rw.DYNAMIC_RIGID, restitution=1.0),
    D.varied(damping=1e3), D.varied(3.0, damping=1e3), D.varied(10.0, damping=1e3),
    D.varied(damping=0.0), D.varied(3.0, damping=0.0), D.varied(finger_mass=10.0, damping=0.0),
)  # fmt: skip
"""What the table shows: each panel as drawn, then with one open number changed."""


def is_caught(panel: Panel, scene: rw.Scene, ratio: float) -> bool:
    return panel.run(scene, ratio).outcome.code == rw.Code.GOAL


def caught(panel: Panel, ratios: Sequence[float] = RATIOS, bisections: int = BISECTIONS) -> Set:
    """The intervals of ratios that are caught, as far as the scan sees them."""
    scene = rw.load(panel.scene)
    held = [is_caught(panel, scene, ratio) for ratio in ratios]
    ends: list[float] = [ratios[0]] if held[0] else []
    for k in range(len(ratios) - 1):
        if held[k] != held[k + 1]:
            low, high = ratios[k], ratios[k + 1]
            for _ in range(bisections):
                middle = (low * high) ** 0.5
                low, high = (middle, high) if is_caught(panel, scene, middle) == held[k] else (low, middle)
            ends.append((low * high) ** 0.5)
    if held[-1]:
        ends.append(ratios[-1])
    return list(zip(ends[::2], ends[1::2], strict=True))


def guaranteed(bisections: int = 40) -> float:
    """Least ratio at which every admissible quasistatic motion leads to the goal.

    The part rests until a finger touches it; from then on it may slide ahead of the finger, on a palm without
    friction, as far as nothing is in its way. It cannot be lost if the other finger is below the peak then.
    """
    space = Space(rw.load("two_finger"))
    touch = _first_zero(lambda x1: float(space.gaps(np.array([x1, 0.0, 0.0]))[0]), 0.0, 2.0)
    ahead = np.linspace(0.0, 0.5, 501)

    def escapes(ratio: float) -> bool:
        return all(space.gaps(np.array([0.0, ratio * touch, x3]))[1] >= 0.0 for x3 in ahead)

    low, high = 0.05, 1.0
    for _ in range(bisections):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if escapes(middle) else (low, middle)
    return 0.5 * (low + high)


def _first_zero(function: Any, low: float, high: float) -> float:
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)


def print_beyond(ratios: Sequence[float]) -> None:
    """Where runs of (a) end that go on beyond the rule `doomed`, by both answers of the model at the apex."""
    scene = rw.load(A.scene)
    for ratio in ratios:
        found = []
        for slowest in (False, True):
            run = A.beyond(scene, ratio, slowest)
            place = ", ".join(f"{x:.4g}" for x in run.trajectory["position"].to_numpy()[-1])
            found.append(f"{run.outcome} at ({place})")
        print(f"(a) beyond the rule, r = {ratio:.4g}: {found[0]}, as drawn, or {found[1]}", flush=True)


def shown(intervals: Set) -> str:
    """Intervals in words; those that reach 1 go on to the inverse of their lower end."""
    parts = [
        f"{'<= ' if low <= RATIOS[0] else ''}{low:.4f} to " + ("1" if high >= 1.0 else f"{high:.4f}")
        for low, high in intervals
        if high > low
    ]
    return ", ".join(parts) if parts else "none but 1" if intervals else "none"


def main(
    arguments: Sequence[str] | None = None,
    lines: Sequence[Panel] = LINES,
    ratios: Sequence[float] = RATIOS,
    bisections: int = BISECTIONS,
) -> int:
    """Print the table and draw the figure; returns the exit code."""
    parser = argparse.ArgumentParser(description="The paper's Figure 4, and what its panels claim.")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the figure")
    parser.add_argument("--figure", type=Path, help="draw the figure there, and print no table")
    parser.add_argument("--json", action="store_true", help="print one JSON object, and draw nothing")
    options = parser.parse_args(arguments)
    if options.figure is not None:
        return 0 if draw_if_possible(options.figure, ratios, bisections) else 1
    rows = []
    if not options.json:
        print("Ratios r = v2 / v1 <= 1 caught, and so are their inverses; h = 1e-4, mu = 0.5 if not given")
    for panel in lines:
        intervals = caught(panel, ratios, bisections)
        rows.append({"panel": panel.letter, "model": panel.rung.name, "speed": panel.speed,
                     "parameters": panel.parameters, "caught": intervals})  # fmt: skip
        if not options.json:
            print(f"({panel.letter}) {panel.numbers():66s} {shown(intervals)}", flush=True)
    least = guaranteed()
    if options.json:
        print(json.dumps({"lines": rows, "guaranteed": least}))
        return 0
    print(f"every admissible quasistatic motion: {least:.4f} to 1; the paper: about 0.7 to 1.4")
    print_beyond([r for r in FAN if r < 0.5])
    draw_if_possible(options.out / "figure4.png", ratios, bisections)
    return 0


def draw_if_possible(path: Path, ratios: Sequence[float], bisections: int) -> bool:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        print("No figure: matplotlib is not installed (pip install -e .[view])", file=sys.stderr)
        return False
    from families import Family, draw_families

    families = []
    for panel in PANELS:
        scene = rw.load(panel.scene)
        fan = sorted({*FAN, *(1.0 / r for r in FAN), 1.0})
        runs = [panel.run(scene, ratio, frames=600) for ratio in fan]
        half = caught(panel, ratios, bisections)
        both = half + [(1.0 / high, 1.0 / low) for low, high in half]
        lost = [(r, run) for r, run in zip(fan, runs, strict=True) if run.outcome.code == rw.Code.DOOMED]
        beyond = [(panel.beyond(scene, ratio), run.time) for ratio, run in lost] if panel is A else []
        families.append(Family(f"({panel.letter}) {panel.title}", scene, runs, both, beyond))
    bands = {
        "slowest motion": (0.5, 2.0),
        "every motion": (guaranteed(), 1.0 / guaranteed()),
        "paper, about": (0.7, 1.4),
    }
    draw_families(path, families, LOW, HIGH, bands, ratio_range=(ratios[0], 1.0 / ratios[0]))
    print(f"The figure is in {path}")
    return True


if __name__ == "__main__":
    sys.exit(main())
