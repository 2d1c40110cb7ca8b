"""The two-finger grasp on every rung that moves: who catches the part, at which ratio of the fingers' speeds?

    python examples/two_finger_ladder.py                            table, saved runs and figure below out/
    python examples/two_finger_ladder.py --figure docs/ladder.png   only the figure, at that place

Two fingers come down at speeds v1 and v2 and push a triangle that slides on a palm; r = v2 / v1. The part is
caught when both fingers rest on opposite faces (paper, section 4). Each rung answers for each ratio.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rungwise as rw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE = "two_finger"
RATIOS = (0.45, 0.55, 0.9, 1.1, 1.8, 2.2)
"""Two outside every band, two inside that of plastic impacts only, two inside every band."""
SAVED_RATIO = 0.9
JAM = {"v2": 0.9, "mu": 1.2}
"""Beyond mu = tan 45 degrees a finger sticks to its face."""
CASES: tuple[tuple[str, rw.Rung, dict[str, float]], ...] = (
    *((rung.name, rung, {}) for rung in rw.LADDER if rung.moves),
    ("dynamic-rigid, e = 1", rw.DYNAMIC_RIGID, {"restitution": 1.0}),
)

PANELS: tuple[tuple[str, rw.Rung, dict[str, float]], ...] = (
    ("kinematic", rw.KINEMATIC, {}),
    ("quasistatic, rigid", rw.QUASISTATIC_RIGID, {}),
    ("quasistatic, compliant", rw.QUASISTATIC_COMPLIANT, {}),
    ("dynamic, rigid, plastic impact", rw.DYNAMIC_RIGID, {}),
    ("dynamic, compliant, damped", rw.DYNAMIC_COMPLIANT, {}),
    ("dynamic, compliant, undamped", rw.DYNAMIC_COMPLIANT, {"damping": 0.0}),
)
FAN = (0.35, 0.45, 0.52, 0.55, 0.62, 0.75, 0.9)
"""Ratios drawn, with their inverses and 1."""
CAUGHT, LOST, GOAL, BEYOND = "#1f5fa8", "#c4622d", "#2a8a57", "0.93"


def main(arguments: Sequence[str] | None = None, ratios: Sequence[float] = RATIOS) -> int:
    """Print the table, save one run per rung and draw the figure; returns the exit code."""
    parser = argparse.ArgumentParser(description="The two-finger grasp on every rung that moves.")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for runs and figure")
    parser.add_argument("--figure", type=Path, help="draw the figure there, and do nothing else")
    options = parser.parse_args(arguments)
    scene = rw.load(SCENE)
    if options.figure is not None:
        return 0 if _draw_if_possible(scene, options.figure) else 1
    folder = options.out / SCENE
    print_table(scene, ratios, folder)
    jam(scene)
    print(f"\nThe runs at r = {SAVED_RATIO:g} are in {folder}/<rung>/; read one with rungwise.load_run.")
    _draw_if_possible(scene, folder.with_suffix(".png"))
    return 0


def print_table(scene: rw.Scene, ratios: Sequence[float], folder: Path) -> None:
    """One line per rung and ratio; the run at `SAVED_RATIO` of each rung goes into `folder`/<rung>."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(
        title="Two fingers, r = v2 / v1, mu = 0.5", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1)
    )
    table.add_column("rung", no_wrap=True)
    for heading in ("r", "outcome", "final x3", "time", "steps", "residual"):
        table.add_column(heading, justify="left" if heading == "outcome" else "right", no_wrap=True)
    for label, rung, parameters in CASES:
        for index, ratio in enumerate(ratios):
            run = rw.simulate(scene, rung, parameters={**parameters, "v2": ratio})
            if ratio == SAVED_RATIO and not parameters:
                run.save(folder / rung.name)
            style = "green" if run.outcome.code == rw.Code.GOAL else "yellow"
            table.add_row(
                label if index == 0 else "",
                f"{ratio:.2f}",
                f"[{style}]{run.outcome}[/]",
                f"{run.final['part']['x3']:+.4f}",
                f"{run.time:.4f}",
                str(run.steps),
                f"{run.worst_residual:.0e}",
                end_section=index == len(ratios) - 1,
            )
    Console(highlight=False).print(table)


def jam(scene: rw.Scene) -> None:
    """What the rungs say where no motion exists: a proof, or that the model no longer holds."""
    print(f"mu = {JAM['mu']:g}, r = {JAM['v2']:g}: the finger that touches first sticks to its face")
    for rung in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT):
        run = rw.simulate(scene, rung, parameters=JAM)
        proof = f", {run.certificate.kind} certificate" if run.certificate else ""
        print(f"  {rung.name:18s} {run.outcome} at t = {run.time:.4f}{proof}")


def _draw_if_possible(scene: rw.Scene, path: Path) -> bool:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        print("No figure: matplotlib is not installed (pip install -e .[view])", file=sys.stderr)
        return False
    draw(scene, path)
    print(f"The paths of each rung are drawn in {path}")
    return True


def draw(scene: rw.Scene, path: Path, fan: Sequence[float] = FAN) -> None:
    """The scene, and for each rung x3 over the fingers' mean travel, in which the goal edge is upright."""
    from matplotlib.figure import Figure

    picture = Figure(figsize=(11.0, 5.8), dpi=150, layout="constrained")
    grid = picture.add_gridspec(2, 4, width_ratios=(1.05, 1, 1, 1))
    sketch(picture.add_subplot(grid[:, 0]))
    ratios = sorted({*fan, *(1.0 / r for r in fan), 1.0})
    first: Axes | None = None
    for index, (title, rung, parameters) in enumerate(PANELS):
        axes = picture.add_subplot(grid[index // 3, 1 + index % 3], sharex=first, sharey=first)
        first = first or axes
        panel(axes, scene, rung, parameters, ratios)
        axes.set_title(title, fontsize=10)
        axes.tick_params(labelleft=index % 3 == 0, labelbottom=index >= 3)
        if index % 3 == 0:
            axes.set_ylabel("part  $x_3$ [m]")
        if index >= 3:
            axes.set_xlabel("mean travel  $(x_1 + x_2)/2$ [m]")
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.savefig(path)


def panel(
    axes: Axes, scene: rw.Scene, rung: rw.Rung, parameters: dict[str, float], ratios: Sequence[float]
) -> None:
    """One rung: a path for each ratio, up to its outcome."""
    caught: list[float] = []
    for ratio in ratios:
        speeds = {"v1": 1.0, "v2": ratio}
        run = rw.simulate(scene, rung, parameters={**parameters, **speeds}, frames=1000)
        position = run.trajectory["position"]
        travel = (
            0.5 * (position.sel(coordinate="finger1.x1") + position.sel(coordinate="finger2.x2")).to_numpy()
        )
        x3 = position.sel(coordinate="part.x3").to_numpy()
        is_caught = run.outcome.code == rw.Code.GOAL
        if is_caught:
            caught.append(ratio)
        colour = CAUGHT if is_caught else LOST
        axes.plot(travel, x3, color=colour, lw=1.3, zorder=4 if is_caught else 3, solid_capstyle="round")
        axes.plot(
            travel[-1],
            x3[-1],
            "o" if is_caught else "x",
            color=colour,
            ms=4,
            mew=1.3,
            zorder=5,
            clip_on=False,
        )
    axes.plot([1.5, 1.5], [-0.5, 0.5], color=GOAL, lw=5, alpha=0.45, zorder=2, solid_capstyle="butt")
    for sign in (-1, 1):
        axes.axhspan(0.5 * sign, 0.7 * sign, color=BEYOND, zorder=0, lw=0)
    axes.set(xlim=(0.9, 1.56), ylim=(-0.7, 0.7), xticks=(1.0, 1.25, 1.5), yticks=(-0.5, 0.0, 0.5))
    axes.spines[["top", "right"]].set_visible(False)
    within = f", r = {min(caught):.2f} to {max(caught):.2f}" if caught else ""
    axes.text(
        0.92, 0.6, f"{len(caught)} of {len(ratios)} caught{within}", fontsize=9, va="center", color="0.25"
    )


def sketch(axes: Axes) -> None:
    """The scene at its start, and what the marks in the other panels mean."""
    axes.fill([-1, 1, 0], [0, 0, 1], color="#d9e2ec", ec="0.25", lw=1.2)
    axes.plot([-1.5, 1.5], [0, 0], color="0.25", lw=1.5)
    for x, name in ((-0.5, "1"), (0.5, "2")):
        axes.plot(x, 2.0, "o", color="0.15", ms=7)
        axes.annotate(
            "",
            (x, 1.35),
            (x, 1.93),
            arrowprops={"arrowstyle": "->", "color": "0.15", "lw": 1.3, "shrinkA": 0},
        )
        axes.text(x + 0.09, 1.6, f"$v_{name}$", va="center", fontsize=12)
        axes.plot([x, x], [1.35, 0.5], color="0.6", lw=0.8, ls=":")
    axes.annotate("", (0.55, 0.3), (0, 0.3), arrowprops={"arrowstyle": "->", "color": "0.15", "lw": 1.3})
    axes.plot(0, 0.3, "|", color="0.15", ms=9)
    axes.text(0.06, 0.13, "$x_3$", va="center", fontsize=12)
    axes.text(
        0, 2.4, "two fingers, one part\n$r = v_2/v_1$,  $\\mu = 0.5$", ha="center", va="bottom", fontsize=11
    )
    legend = (
        ("-", CAUGHT, 1.5, "o", "caught"),
        ("-", LOST, 1.5, "x", "lost: no input can catch it"),
        ("-", GOAL, 5, "", "goal edge: both faces touched"),
        ("-", BEYOND, 9, "", "beyond the fingers: $|x_3| > 1/2$"),
    )
    for style, colour, width, marker, text in legend:
        axes.plot([], [], style, color=colour, lw=width, marker=marker, ms=4, mew=1.3, label=text)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.27), frameon=False, fontsize=9.5)
    axes.set(xlim=(-1.55, 1.55), ylim=(-1.9, 3.3), aspect="equal")
    axes.axis("off")


if __name__ == "__main__":
    sys.exit(main())
