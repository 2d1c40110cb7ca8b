"""Painleve's rod: where rigid contact with friction has no answer, or several.

    python examples/painleve.py                              the table, and the figure in out/painleve.png
    python examples/painleve.py --figure docs/painleve.png   the figure at that place
    python examples/painleve.py --json                       only the numbers, as one JSON object

A uniform rod (half-length, mass and gravity 1) slides with speed 1 on one end, which leads its centre, at an
angle theta to the ground. A normal force n on the end accelerates it upwards by p n, friction included, with
p = 1 + 3 cos^2 - 3 mu sin cos. For p < 0, which is mu > (1 + 3 cos^2) / (3 sin cos), at the least 4/3 at
tan theta = 2, the equation of accelerations 0 <= n _|_ p n + b >= 0 has no solution where the end would
otherwise be pressed down (b < 0), and two where it would rise (b > 0, the rod spins). Source: Genot and
Brogliato, European J. Mechanics A/Solids 18 (1999) 653-677.

A step of length h has speeds and impulses instead, in which the end may stop at once: one solution for b < 0;
for b > 0 three where p < 0 and h b (W_tn + mu W_tt) <= |p|, else one. `rw.solutions` finds all of them.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rungwise as rw
from rungwise.contact.analysis.pieces import check

STEP = 1e-2
ANGLES = (15.0, 30.0, 45.0, 60.0, math.degrees(math.atan(2.0)), 75.0)
HIGHEST = 4.0
BISECTIONS = 20
GRID = 31
COLOURS = ("#c44e52", "#dfe8f0", "#e8a33d", "#55a868")
"""For none, one, two and three solutions."""


@dataclass(frozen=True)
class Rod:
    """A rod at an angle (rad) with friction mu; `rising`: it spins so that its end would leave the ground."""

    angle: float
    mu: float
    rising: bool

    def response(self) -> NDArray[np.float64]:
        """W (2, 2): normal and tangential acceleration of the end per force on it."""
        sine, cosine = math.sin(self.angle), math.cos(self.angle)
        inverse_inertia = 3.0
        arm = np.array([-cosine, sine])
        return np.eye(2) + inverse_inertia * np.outer(arm, arm)

    def free(self) -> NDArray[np.float64]:
        """Acceleration (normal, tangential) of the end without contact: +-1 up, by gravity and spin."""
        outward = 2.0 / math.sin(self.angle) if self.rising else 0.0
        return np.array([outward * math.sin(self.angle) - 1.0, outward * math.cos(self.angle)])

    def slope(self) -> float:
        """p, from the response."""
        return float(self.response()[0] @ [1.0, self.mu])

    def accelerations(self) -> rw.Problem:
        return rw.Problem.lcp([[self.slope()]], [self.free()[0]])

    def step(self) -> rw.Problem:
        """Impulses and speeds at the end of a step."""
        speeds = np.array([0.0, -1.0]) + STEP * self.free()
        return rw.Problem.local(self.response(), speeds, [self.mu], directions=2)

    def stops(self) -> bool:
        """Whether a step of the rising rod has three solutions, by the closed form."""
        pull = float(self.response()[1] @ [1.0, self.mu])
        normal, tangential = STEP * self.free()
        return self.slope() < 0.0 and normal * pull <= (1.0 - tangential) * -self.slope()


def number(problem: rw.Problem) -> int:
    """How many solutions the problem has, all of them single points."""
    found = rw.solutions(problem)
    if not check(found) or any(piece.motions or piece.forces for piece in found.pieces):
        raise ArithmeticError(f"the solutions are {found.kind} and not single points")
    return len(found.pieces)


def threshold(angle: float) -> float:
    """The friction of the closed form, at an angle (rad)."""
    sine, cosine = math.sin(angle), math.cos(angle)
    return (1.0 + 3.0 * cosine**2) / (3.0 * sine * cosine)


def measured(angle: float, form: Callable[[Rod], rw.Problem], rising: bool) -> float:
    """The friction from which on the number of solutions is not 1, by bisection."""
    low, high = 0.0, HIGHEST
    if number(form(Rod(angle, high, rising))) == 1:
        return math.inf
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if number(form(Rod(angle, middle, rising))) == 1:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def table() -> list[dict[str, float]]:
    """Closed form and measured thresholds over the angles (degrees)."""
    rows = []
    for degrees in ANGLES:
        angle = math.radians(degrees)
        rows.append(
            {
                "angle": degrees,
                "closed_form": threshold(angle),
                "no_acceleration": measured(angle, Rod.accelerations, False),
                "two_accelerations": measured(angle, Rod.accelerations, True),
                "three_steps": measured(angle, Rod.step, True),
                "pressed_steps": number(Rod(angle, HIGHEST, False).step()),
            }
        )
    return rows


def sweep(form: Callable[[Rod], rw.Problem], rising: bool) -> NDArray[np.int64]:
    """Numbers of solutions over friction (rows) and angle."""
    angles, frictions = axes()
    rods = [[Rod(math.radians(angle), mu, rising) for angle in angles] for mu in frictions]
    return np.array([[number(form(rod)) for rod in row] for row in rods])


def axes() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles in degrees, and friction."""
    return np.linspace(5.0, 87.0, GRID), np.linspace(0.05, 3.0, GRID)


def draw(path: Path) -> None:
    """Numbers of solutions for accelerations and for a step, pressed down and rising."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    angles, frictions = axes()
    figure, panels = pyplot.subplots(2, 2, figsize=(8.4, 6.6), sharex=True, sharey=True, layout="constrained")
    fine = np.linspace(4.0, 88.0, 400)
    curve = [threshold(math.radians(angle)) for angle in fine]
    shades = ListedColormap(COLOURS)
    for row, (name, form) in zip(
        panels, (("accelerations", Rod.accelerations), (f"a step, h = {STEP:g} s", Rod.step)), strict=True
    ):
        for panel, rising in zip(row, (False, True), strict=True):
            counts = sweep(form, rising)
            norm = BoundaryNorm(np.arange(-0.5, 4.0), 4)
            panel.pcolormesh(angles, frictions, counts, cmap=shades, norm=norm, shading="nearest")
            panel.plot(fine, curve, color="black", linewidth=1.2, label="closed form of accelerations")
            panel.set_title(f"{name}, end {'rising' if rising else 'pressed down'}", fontsize=10)
            panel.set_ylim(frictions[0], frictions[-1])
            panel.set_xlim(angles[0], angles[-1])
        row[0].set_ylabel("friction")
    for panel in panels[1]:
        panel.set_xlabel("angle to the ground (degrees)")
    names = ("no solution", "one", "two", "three")
    keys = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, names, strict=True)]
    figure.legend(handles=[*keys, *panels[0, 0].lines], loc="outside lower center", ncols=5, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Painleve's rod: numbers of solutions.")
    parser.add_argument("--figure", type=Path, default=None, help="only draw, into this file")
    parser.add_argument("--json", action="store_true", help="print the numbers as one JSON object")
    options = parser.parse_args(arguments)
    if options.figure is not None:
        draw(options.figure)
        return 0
    rows = table()
    if options.json:
        print(json.dumps({"step": STEP, "rows": rows}))
        return 0
    print("friction above which there is not exactly one solution\n")
    print(" angle  closed form  no acceleration  two accelerations  three steps  steps, pressed, mu = 4")
    for row in rows:
        print(
            f"{row['angle']:6.2f}{row['closed_form']:13.5f}{row['no_acceleration']:17.5f}"
            f"{row['two_accelerations']:19.5f}{row['three_steps']:13.5f}{row['pressed_steps']:25d}"
        )
    draw(Path("out/painleve.png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
