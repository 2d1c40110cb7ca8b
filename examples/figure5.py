"""Figure 5 of the paper: which speeds of two fingers capture the part, and why more friction helps.

    python examples/figure5.py [--tol T] [--out DIR]

prints the tables of docs/figure5.md and draws figure5.png in DIR (out if not given). Z_F: speeds v1, v2 and
friction mu that lead from the start to the goal. Z_A: those that lead to a state which the scene's rule
calls doomed. Several kinds of fingers:

  prescribed      quasistatic-rigid, two_finger: speeds whatever the force; from mu = 1 on they jam
  force-limited   quasistatic-rigid, two_finger_servo: from mu = 1 on the first finger sticks, and waits
  free            dynamic-rigid, two_finger_free without potential: thrown at the part, plastic impacts
  free, pulled    dynamic-compliant, two_finger_free: the same with a weak potential towards closure
  soft servos     dynamic-compliant, two_finger_servo: speed set points, a force of 1 N per missing 1 m/s

Closed forms of the least ratio r = v2 / v1 caught, for plastic impacts, fingers of mass m, a part of mass M
and mu < 1 = tan 45 degrees: after the impact the first finger and the part go at the speed a v1, where
a = m / (m + M (1 + mu) / (1 - mu)), and the other finger must be below the peak when the part has moved
by half the fingers' distance, a time T later:

  r = 1 / (3/2 + v1 T),  v1 T = 1/2 (prescribed), 1 / (2 a) (free), or, with servos of gain g,
  1/2 = v1 T - v1 (1 - a) s (1 - exp(-T / s)),  s = (m + M (1 + mu) / (1 - mu)) / g

As mu tends to 1, a and r tend to 0: free fingers fill the quadrant gradually, force-limited ones at once.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rungwise as rw
from rungwise.viewing.sets.slices import draw_surface

Reals = NDArray[np.float64]
BOX = {"v1": (0.1, 2.0), "v2": (0.1, 2.0), "mu": (0.0, 1.5)}
FRICTION = (0.0, 0.25, 0.5, 0.75, 0.9, 0.98, 1.01, 1.4)
"""Columns of the table."""
LEAST, SCANNED, BISECTIONS = 0.01, 48, 14
"""Ratios are scanned from 1 down to `LEAST`, and the end of those that are caught is found by bisection."""
ACCURACY = 1e-3
"""Error allowed per step of a run."""
PAPER = 0.7


def share(mu: float, finger: float = 1.0) -> float:
    """Part of its speed that a free finger keeps in a plastic impact with the part, of mass 1."""
    return finger * (1.0 - mu) / (finger * (1.0 - mu) + 1.0 + mu) if mu < 1.0 else 0.0


def prescribed(mu: float, _: float = 1.0) -> float:
    """Least ratio of fingers that do not yield: from mu = 1 on they jam unless both touch at once."""
    return 0.5 if mu < 1.0 else 1.0


def force_limited(mu: float, _: float = 1.0) -> float:
    """Least ratio of strong fingers that can stall."""
    return 0.5 if mu < 1.0 else 0.0


def free(mu: float, _: float = 1.0) -> float:
    """Least ratio of free fingers, of mass 1 as the part."""
    return 1.0 / (1.5 + 0.5 / share(mu)) if mu < 1.0 else 0.0


def soft_servos(mu: float, fast: float = 1.0, gain: float = 1.0, finger: float = 1.0) -> float:
    """Least ratio of servos that bring a finger back to its speed, `fast`, after the impact."""
    if mu >= 1.0:
        return 0.0
    slow = (finger + (1.0 + mu) / (1.0 - mu)) / gain
    behind = (1.0 - share(mu, finger)) * slow
    low, high = 0.5 / fast, 0.5 / (fast * share(mu, finger))
    for _ in range(60):
        middle = 0.5 * (low + high)
        moved = fast * (middle - behind * (1.0 - math.exp(-middle / slow)))
        low, high = (middle, high) if moved < 0.5 else (low, middle)
    return 1.0 / (1.5 + fast * high)


@dataclass(frozen=True)
class Case:
    """Fingers, the model that moves them, and the least ratio caught in closed form."""

    name: str
    scene: str
    rung: rw.Rung
    parameters: dict[str, float] = field(default_factory=dict)
    closed_form: Callable[[float, float], float] | None = None
    color: str = "#bbbbbb"


LOOSE = {"well": 0.0, "align": 0.0}
PULLED, SOFT = {"well": 0.01, "align": 0.01}, {"gain": 1.0, "finger_mass": 1.0}
CASES = (
    Case("prescribed", "two_finger", rw.QUASISTATIC_RIGID, {}, prescribed),
    Case("force-limited", "two_finger_servo", rw.QUASISTATIC_RIGID, {}, force_limited, "#3b6fb6"),
    Case("free", "two_finger_free", rw.DYNAMIC_RIGID, LOOSE, free, "#2a9d5c"),
    Case("free, pulled", "two_finger_free", rw.DYNAMIC_COMPLIANT, PULLED, None, "#c8553d"),
    Case("soft servos", "two_finger_servo", rw.DYNAMIC_COMPLIANT, SOFT, soft_servos, "#8d5fb0"),
    Case("free, strongly pulled", "two_finger_free", rw.DYNAMIC_COMPLIANT),
    Case("free, compliant", "two_finger_free", rw.DYNAMIC_COMPLIANT, LOOSE),
    Case("free, restitution 1/2", "two_finger_free", rw.DYNAMIC_RIGID, LOOSE | {"restitution": 0.5}),
)
"""The last three: a potential that outweighs the throw, and fingers that bounce and are not brought back."""
SHOWN, DRAWN = CASES[:5], CASES[1:5]


def least_ratios(case: Case, friction: Reals, v1: float = 1.0) -> Reals:
    """Least ratio r = v2 / v1 such that all scanned from there to 1 are caught, for each friction.

    nan: not even 1; 0: all."""
    parameters = {**case.parameters, "v1": v1}
    batch = rw.Batch(case.scene, case.rung, ("v2", "mu"), parameters=parameters, tol=ACCURACY)

    def caught(ratios: Reals, mu: Reals) -> NDArray[np.bool_]:
        return batch.run(np.column_stack([v1 * ratios, mu])).outcome == rw.Code.GOAL

    ratios = np.geomspace(1.0, LEAST, SCANNED)
    grid = caught(np.tile(ratios, len(friction)), np.repeat(friction, len(ratios)))
    held = np.logical_and.accumulate(grid.reshape(len(friction), -1), axis=1).sum(axis=1)
    high = ratios[np.maximum(held - 1, 0)]
    low = ratios[np.minimum(held, len(ratios) - 1)]
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        inside = caught(middle, friction)
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    found = np.sqrt(low * high)
    return np.where(held == 0, np.nan, np.where(held == len(ratios), 0.0, found))


def print_ratios() -> None:
    """Print the least ratios beside their closed forms."""
    print(f"least v2 / v1 caught at v1 = 1 (0: all down to {LEAST:g})")
    print(f"{'mu':22s}" + "".join(f"{mu:8g}" for mu in FRICTION))
    for case in CASES:
        found = least_ratios(case, np.array(FRICTION))
        print(f"{case.name:22s}" + "".join(f"{r:8.4f}" for r in found), flush=True)
        if case.closed_form is not None:
            print(f"{'  closed form':22s}" + "".join(f"{case.closed_form(mu, 1.0):8.4f}" for mu in FRICTION))


def part_of_the_box(closed_form: Callable[[float, float], float], points: int = 60) -> float:
    """Part of the box in which the slower finger has at least the least ratio."""
    v, mu = (low + (high - low) * (np.arange(points) + 0.5) / points for low, high in (BOX["v1"], BOX["mu"]))
    caught = 0.0
    for friction in mu:
        slowest = np.array([closed_form(friction, fast) for fast in v]) * v
        # By symmetry: all slower speeds of one finger for each speed of the faster one, twice.
        caught += 2.0 * float(np.sum(v - np.maximum(slowest, BOX["v1"][0])))
    return caught * (v[1] - v[0]) / (points * (BOX["v1"][1] - BOX["v1"][0]) ** 2)


def feasible(case: Case, tol: float) -> rw.FeasibleSet:
    """The set of a case over v1, v2 and mu; a line says what becomes of which part of the box."""
    began = time.perf_counter()
    # A free finger that a coarse step stops short of the face is pulled on by nothing, and misses the goal.
    found = rw.feasible_set(
        case.scene, case.rung, tuple(BOX), tol=tol, accuracy=ACCURACY, box=BOX, parameters=case.parameters
    )
    took = time.perf_counter() - began
    parts = found.volumes(n=1_000_000)
    exact = "" if case.closed_form is None else f" (closed form {part_of_the_box(case.closed_form):.3f})"
    print(
        f"{case.name:14s}{case.rung.name:18s} Z_F {parts['feasible']:.3f}{exact}, Z_A {parts['doomed']:.3f}"
        f" of the box, {found.evaluations} runs, {took:.1f} s",
        flush=True,
    )
    return found


def draw(path: Path, tol: float) -> None:
    """Four sets in space, and all least ratios over friction."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7.2, 11.0), layout="constrained", dpi=160)
    grid = drawing.add_gridspec(3, 2, height_ratios=(0.95, 0.95, 1.0))
    for k, case in enumerate(DRAWN):
        axis = drawing.add_subplot(grid[k // 2, k % 2], projection="3d", computed_zorder=False)
        draw_surface(axis, feasible(case, tol), case.color)
        _label_space(axis)
        axis.set_title(f"({'abcd'[k]}) {case.name}\n{case.rung.name}", fontsize=11, y=1.0)
    _ratios(drawing.add_subplot(grid[2, :]))
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(path)
    print(f"wrote {path}")


def _label_space(axis: Any) -> None:
    axis.view_init(elev=24.0, azim=-135.0)
    axis.set_box_aspect((1.0, 1.0, 0.8), zoom=0.98)
    axis.set(xticks=(0.5, 1.0, 1.5, 2.0), yticks=(0.5, 1.0, 1.5, 2.0), zticks=(0.0, 0.5, 1.0, 1.5))
    axis.zaxis.set_rotate_label(False)  # an upright letter is read at once
    axis.set(xlabel="$v_1$ [m/s]", ylabel="$v_2$ [m/s]", zlabel="$\\mu$")
    for x, y, z, text in (
        (1.7, 1.7, 0.45, "$Z_F$"),
        (1.75, 0.35, 0.25, "$Z_A$"),
        (0.35, 1.75, 0.25, "$Z_A$"),
    ):
        axis.text(x, y, z, text, fontsize=14, ha="center", va="center", zorder=100)


def _ratios(axis: Any) -> None:
    """All ratios that are caught, r and 1 / r, over friction; the closed forms are dashed."""
    friction = np.union1d(np.linspace(0.0, 1.5, 61), (0.995, 1.005))
    friction = friction[friction != 1.0]
    for case in SHOWN:
        kept = friction[friction < 1.0] if case.name == "prescribed" else friction
        found = least_ratios(case, kept)
        for side in (1.0, -1.0):
            axis.plot(kept, _on_scale(found) ** side, color=case.color, lw=_width(case))
        axis.plot([], [], color=case.color, lw=_width(case), label=case.name)
        if case.closed_form is not None:
            exact = np.array([case.closed_form(mu, 1.0) for mu in kept])
            for side in (1.0, -1.0):
                axis.plot(kept, _on_scale(exact) ** side, color="black", ls=(0, (2, 2)), lw=1.0)
    axis.plot([], [], color="black", ls=(0, (2, 2)), lw=1.0, label="closed form")
    axis.fill_between((0.0, 1.0), PAPER, 1.0 / PAPER, color="#fbe8b8", zorder=0, label="paper, $\\mu < 1$")
    axis.plot([], [], " ", label="$Z_F$: speeds that catch the part")
    axis.plot([], [], " ", label="$Z_A$: speeds that lose it")
    axis.set(yscale="log", ylim=(1.0 / 30.0, 30.0), xlim=(0.0, 1.5))
    ticks = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()
    axis.set(xlabel="friction $\\mu$ of the fingers", ylabel="$v_2 / v_1$, the faster finger at 1 m/s")
    axis.set_title("(e) ratios of speeds at which $Z_F$ ends", fontsize=11)
    for x, y, text in (
        (0.12, 1.0, "$Z_F$"),
        (0.12, 14.0, "$Z_A$"),
        (0.12, 1 / 14.0, "$Z_A$"),
        (1.25, 1.0, "$Z_F$"),
    ):
        axis.text(x, y, text, fontsize=14, ha="center", va="center")
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, fontsize=10, frameon=False)


def _width(case: Case) -> float:
    return 7.0 if case.name == "prescribed" else 3.0


def _on_scale(ratios: Reals) -> Reals:
    """Ratios with those that are zero below the end of the picture."""
    return np.where(ratios > 0.0, ratios, 1e-3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the ends of the sets and their sizes, and draw them."""
    parser = argparse.ArgumentParser(description="Feasible sets of the two-finger grasp (Figure 5).")
    parser.add_argument("--tol", type=float, default=0.01, help="accuracy, as a part of each interval")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for figure5.png")
    options = parser.parse_args(arguments)
    print_ratios()
    draw(options.out / "figure5.png", options.tol)
    return 0


if __name__ == "__main__":
    sys.exit(main())
