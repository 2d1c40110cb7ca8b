"""A clip snaps in between two noses, or jams: rung by rung, with the forces of the closed form.

    python examples/snap.py                            two tables
    python examples/snap.py --figure docs/snap.png     only the picture, at that place
    python examples/snap.py --json                     only the numbers, as one JSON object

The closed form is that of a contact whose force is proportional to how deep it is. With the barb at x, a nose
of radius L touches the clip in the direction phi to the way across, and is d deep:

    phi = atan(-x / c), at most the angle of the face; c = L - interference
    d = L - c cos(phi) + x sin(phi)
    F = 2 K d (sin(phi) + mu cos(phi))        what two noses oppose to the way in
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

import rungwise as rw
from rungwise.viewing.plane.clip import clip
from rungwise.viewing.plane.draw_frame import INK, ROLES, placed, pose_at, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = dict[str, Any]
TOL = 1e-7
"""Error allowed per step, in metres."""
BISECTIONS = 10
WITHIN = 0.1
"""Loads are looked for so far from the closed form, as a part of it."""
CASES = ((0.14, 1.0, 0.0), (0.14, 1.0, 0.2), (0.3, 0.3, 0.2), (0.5, 0.2, 0.4))
"""Angles of the faces in front and behind, and friction."""
AWAY = {"u": 0.0, "apart": 1.0, "seat": 1.0, "damping": 0.0, "drag": 1.0}
"""A rod that is elsewhere, and a goal that ends no run."""
MM = 1e3


def opposed(place: np.ndarray, scene: rw.Scene, **given: float) -> np.ndarray:
    """Force (n,) with which the noses oppose the way in, with the barb at these places (n,)."""
    p = scene.parameters(given)
    c = p["nose"] - p["interference"]
    phi = np.clip(np.arctan2(-place, c), -p["back"], p["lead"])
    deep = p["nose"] - c * np.cos(phi) + place * np.sin(phi)
    return 2.0 * p["stiffness"] * np.maximum(deep, 0.0) * (np.sin(phi) + p["mu"] * np.cos(phi))


def peak(scene: rw.Scene, face: str, **given: float) -> float:
    """Greatest force on the way over the `lead` or the `back`: at the end of that face, or where the noses
    roll over the barb at an angle at which the force is greatest."""
    p = scene.parameters(given)
    length, mu = p["nose"], p["mu"]
    c = length - p["interference"]

    def falls(phi: float) -> float:
        tilt = math.sin(phi) + mu * math.cos(phi)
        return length * math.sin(phi) * math.cos(phi) * tilt - (length * math.cos(phi) - c)

    phi = min(p[face], brentq(falls, 0.0, math.acos(c / length)))
    tilt = math.sin(phi) + mu * math.cos(phi)
    return 2.0 * p["stiffness"] * (length - c / math.cos(phi)) * tilt


def pushed(scene: rw.Scene, model: str, **given: float) -> rw.Run:
    """The run in which the rod pushes."""
    return rw.simulate(scene, model, parameters=given, tol=TOL, frames=100_000)


def push_of(run: rw.Run) -> np.ndarray:
    """Force (m,) of the rod on the clip over a run."""
    points = [str(point) for point in run.trajectory.point.values]
    force = run.trajectory["contact_force"].sel(direction="normal").values
    return np.asarray(force[:, [point.startswith("rod|clip") for point in points]].sum(axis=1))


def rungs(scene: rw.Scene) -> list[Row]:
    """How the push ends on each rung, where, and with what greatest force, beside the closed form."""
    p = scene.parameters()
    predicted = peak(scene, "lead") + p["drag"] * p["v"]
    rows = []
    for rung in rw.LADDER[1:]:
        run = pushed(scene, rung.name)
        row: Row = {
            "model": rung.name,
            "outcome": str(run.outcome),
            "place": run.final["clip"]["x"],
            "proof": "" if run.certificate is None else f"{run.certificate.kind} certificate",
        }
        if rung.compliant:
            row |= {"force": float(push_of(run).max()), "predicted": predicted}
        rows.append(row)
    return rows


def passes(scene: rw.Scene, load: float, **given: float) -> bool:
    """Whether a load alone takes the clip from one side of the noses to the other."""
    start = -math.copysign(1.5, load) * scene.parameters(given)["nose"]
    over = {**AWAY, **given, "load": load, "start": start}
    run = rw.simulate(scene, "quasistatic-compliant", parameters=over, tol=TOL, duration=0.1)
    return run.final["clip"]["x"] * start < 0.0 and abs(run.final["clip"]["x"]) > abs(start)


def least(scene: rw.Scene, face: str, **given: float) -> float:
    """The least load that takes the clip in over its lead, or out over its back."""
    predicted, sign = peak(scene, face, **given), 1.0 if face == "lead" else -1.0
    low, high = (1.0 - WITHIN) * predicted, (1.0 + WITHIN) * predicted
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if passes(scene, sign * middle, **given) else (middle, high)
    return 0.5 * (low + high)


def loads(scene: rw.Scene, cases: Sequence[tuple[float, float, float]]) -> list[Row]:
    """Least loads in and out, beside the closed form."""
    rows = []
    for lead, back, mu in cases:
        given = {"lead": lead, "back": back, "mu": mu}
        row: Row = dict(given)
        for name, face in (("in", "lead"), ("out", "back")):
            row |= {name: least(scene, face, **given), f"{name}_predicted": peak(scene, face, **given)}
        rows.append(row)
    return rows


def draw(scene: rw.Scene, file: Path) -> None:
    """The clip jammed on a rigid rung and snapped in on a compliant one, and the force over the way."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    axes = figure.subplot_mosaic([["rigid", "force"], ["compliant", "force"]], width_ratios=(1.0, 1.25))
    for name in ("rigid", "compliant"):
        run = rw.simulate(scene, f"quasistatic-{name}", frames=2000)
        said = {"rigid": "jammed", "compliant": "snapped in"}[name]
        _show(axes[name], run, f"quasistatic-{name}: {said}")
    _forces(axes["force"], scene)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=130)


def _show(axes: Axes, run: rw.Run, title: str) -> None:
    """The bodies at the end of a run."""
    from matplotlib.patches import Polygon

    shown = clip(run)
    pose = pose_at(shown, shown.time[-1])
    for outline in shown.outlines:
        corners = MM * placed(rounded(outline), pose[outline.body])
        colour = ROLES[shown.roles[outline.body]]
        axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=INK, linewidth=1.0))
    axes.set(xlim=(-14.5, 9.0), ylim=(-5.5, 5.5), aspect="equal", xticks=[], yticks=[])
    axes.set_title(title, fontsize=10)


def _forces(axes: Axes, scene: rw.Scene) -> None:
    """The force of the rod over the place of the barb: closed form, and a run."""
    p, way = scene.parameters(), np.linspace(-2e-3, 8e-4, 1400)
    for mu, colour in ((0.0, "#0072b2"), (0.2, "#c14e00")):
        run = rw.simulate(scene, "quasistatic-compliant", parameters={"mu": mu}, frames=100)
        place, force = run.trajectory.position.sel(coordinate="clip.x").values, push_of(run)
        axes.plot(MM * way, opposed(way, scene, mu=mu), color=colour, label=f"closed form, mu = {mu:g}")
        touches = force > 0.0
        force = force[touches] - p["drag"] * p["v"]
        axes.plot(MM * place[touches], force, "o", color=colour, markersize=4)
    jam = pushed(scene, "quasistatic-rigid").final["clip"]["x"]
    axes.axvline(MM * jam, color=INK, linestyle=":", label="rigid rungs jam")
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set(xlim=(-2.0, 0.8), xlabel="barb beyond the noses [mm]", ylabel="force on the way in [N]")
    axes.set_title("dots: the rod's force, quasistatic-compliant", fontsize=10)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, frameon=False, fontsize=9)


def table(found: dict[str, list[Row]]) -> str:
    """Both tables as text."""
    lines = [f"{'model':22} {'outcome':8} {'barb [mm]':>9} {'force [N]':>9} {'predicted':>9}"]
    for row in found["rungs"]:
        forces = f"{row['force']:9.3f} {row['predicted']:9.3f}" if "force" in row else f"  {row['proof']}"
        lines.append(f"{row['model']:22} {row['outcome']:8} {MM * row['place']:9.4f} {forces}")
    lines.append(
        f"\n{'lead':>5} {'back':>5} {'mu':>4} {'in [N]':>8} {'predicted':>9} {'out [N]':>8} {'predicted':>9}"
    )
    lines += [
        f"{row['lead']:5g} {row['back']:5g} {row['mu']:4g} {row['in']:8.3f} {row['in_predicted']:9.3f}"
        f" {row['out']:8.3f} {row['out_predicted']:9.3f}"
        for row in found["loads"]
    ]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables or draw the picture; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figure", type=Path, help="draw the picture into this file")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    scene = rw.load("snap")
    if options.figure:
        draw(scene, options.figure)
        return 0
    found = {"rungs": rungs(scene), "loads": loads(scene, CASES)}
    print(json.dumps(found) if options.json else table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
