"""Pictures of an episode, as arrays of pixels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.simulation.state import State
from rungwise.viewing.plane.arrows import View, view_of
from rungwise.viewing.plane.clip import still
from rungwise.viewing.plane.draw_frame import draw_frame
from rungwise.viewing.write import needs_matplotlib

PIXELS, INCHES = 480, 4.8
"""Height and width of a picture; at this size its lines are as thick as in the package's other pictures."""


class Camera:
    """Draws the states of one episode; the view grows when bodies leave it, and never shrinks."""

    def __init__(self, scene: Scene, model: Rung) -> None:
        self._scene, self._model = scene, model
        self.begin()

    def begin(self) -> None:
        """Forget the view of the episode before."""
        self._view: View | None = None

    def close(self) -> None:
        """Nothing is held."""

    def picture(self, parameters: Mapping[str, float], state: State) -> NDArray[np.uint8]:
        """Pixels (height, width, 3). Raises ViewError where matplotlib is missing."""
        needs_matplotlib("render_mode")
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        clip = still(self._scene, self._model, parameters, state)
        figure = Figure(figsize=(INCHES, INCHES), dpi=PIXELS / INCHES)
        canvas = FigureCanvasAgg(figure)
        self._view = _joined(self._view, view_of([clip], [state.time]))
        draw_frame(figure.add_axes((0.0, 0.0, 1.0, 1.0)), [clip], state.time, self._view)
        canvas.draw()  # type: ignore[no-untyped-call]
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]


def _joined(before: View | None, now: View) -> View:
    """A view with room for both, in which forces have the scale of the greater ones."""
    if before is None:
        return now
    (a, b, c, d), (e, f, g, h) = before.extent, now.extent
    extent = (min(a, e), min(b, f), max(c, g), max(d, h))
    return View(extent, min(before.per_force, now.per_force), max(before.longest, now.longest))
