"""Picture of a design: the best value of each parameter, and how far it may drift."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rungwise.planning.design.design import Design
from rungwise.viewing.units import titled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, GOOD, REST = "#1b1f24", "#4c9f70", "#e4e7eb"


def design_bars(found: Design) -> Figure:
    """A bar for each parameter, from one end of its interval to the other: green where success is kept while
    the others stay at their best values."""
    from matplotlib.figure import Figure

    names = list(found.values)
    figure = Figure(figsize=(7.2, 1.3 + 0.62 * len(names)), layout="constrained")
    axes = figure.subplots()
    for row, name in enumerate(reversed(names)):
        low, high = found.box[name]

        def part(value: float, low: float = low, high: float = high) -> float:
            return (value - low) / (high - low)

        first, last = (part(value) for value in found.drift[name])
        axes.barh(row, 1.0, height=0.34, color=REST)
        axes.barh(row, last - first, left=first, height=0.34, color=GOOD)
        at = part(found.values[name])
        axes.plot([at, at], [row - 0.26, row + 0.26], color=INK, linewidth=2.5)
        axes.annotate(_short(found.values[name]), (at, row + 0.28), ha="center", va="bottom", fontsize=9)
        for place, value, side in ((0.0, low, "left"), (1.0, high, "right")):
            axes.annotate(_short(value), (place, row - 0.2), ha=side, va="top", fontsize=8, color="#5b6570")
    axes.set_yticks(range(len(names)), [titled(found.scene.file, name) for name in reversed(names)])
    axes.set_xticks([])
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.6, len(names) - 0.3)
    axes.spines[:].set_visible(False)
    axes.tick_params(left=False)
    figure.suptitle(
        f"{found.scene.name} on {found.model.name}: best values, and how far each may drift", fontsize=10
    )
    return figure


def _short(value: float) -> str:
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")
