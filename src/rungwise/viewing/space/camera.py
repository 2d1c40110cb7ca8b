"""Pictures of an episode in space, by MuJoCo's renderer."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.state import State
from rungwise.viewing.space.model_solids import colours_of
from rungwise.viewing.write import ViewError

if TYPE_CHECKING:
    import mujoco

PIXELS = 480
"""Height and width of a picture, as in the plane."""
AMBIENT, DIFFUSE = 0.4, 0.6
"""Light from the camera on a model that has no lights, so that white is as bright as a picture can be."""


class _Stage(NamedTuple):
    """A model at parameters, and what draws it."""

    parameters: dict[str, float]
    model: mujoco.MjModel
    data: mujoco.MjData
    renderer: mujoco.Renderer


class Camera:
    """Draws states from where MuJoCo's viewer looks at first. It keeps one renderer, which copies of it do
    without until they draw."""

    def __init__(self, scene: SpaceScene, _model: Rung | None) -> None:
        self._scene = scene
        self._stage: _Stage | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Camera, (self._scene, None)

    def begin(self) -> None:
        """Nothing of an episode is kept."""

    def close(self) -> None:
        """Give the renderer back."""
        if self._stage is not None:
            self._stage.renderer.close()
            self._stage = None

    def picture(self, parameters: Mapping[str, float], state: State) -> NDArray[np.uint8]:
        """Pixels (height, width, 3). Raises ViewError where MuJoCo gets no OpenGL context."""
        import mujoco

        if self._stage is None or self._stage.parameters != parameters:
            self.close()
            self._stage = _staged(self._scene, dict(parameters))
        _, model, data, renderer = self._stage
        data.qpos[:] = state.q
        mujoco.mj_forward(model, data)
        renderer.update_scene(data)
        pixels: NDArray[np.uint8] = renderer.render()
        return pixels


def _staged(scene: SpaceScene, parameters: dict[str, float]) -> _Stage:
    import mujoco

    model = scene.bind(parameters).model
    frame = model.vis.global_
    frame.offwidth, frame.offheight = max(frame.offwidth, PIXELS), max(frame.offheight, PIXELS)
    bare = model.geom_matid < 0
    model.geom_rgba[bare] = colours_of(model)[bare]
    if not model.nlight:
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = AMBIENT, DIFFUSE
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of GLFW, which the error tells as well
            renderer = mujoco.Renderer(model, PIXELS, PIXELS)
    except Exception as error:  # each of MuJoCo's three ways to OpenGL fails in its own way
        why = str(error).partition("\n")[0][:200]
        raise ViewError(
            f"render_mode: MuJoCo gets no OpenGL context ({why}); without a display set the environment"
            " variable MUJOCO_GL to egl or osmesa before Python starts"
        ) from None
    return _Stage(parameters, model, mujoco.MjData(model), renderer)
