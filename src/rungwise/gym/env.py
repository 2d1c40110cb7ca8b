"""A scene on a rung as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from rungwise.gym.episodes import Episodes
from rungwise.gym.settings import GymError, Options, Settings, read_settings
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State
from rungwise.viewing.drawers import DRAWERS, Camera
from rungwise.viewing.write import ViewError

RENDER_MODES = ("rgb_array",)
ROW = np.zeros(1, np.int64)


class SceneEnv(gymnasium.Env[NDArray[Any], NDArray[Any]]):
    """A scene on a rung: actions are the scene's inputs, each held for a while.

    Args:
        scene, model: as for `rungwise.simulate`; the scene needs a goal and inputs.
        parameters: values by name; the others keep their defaults.
        hold: seconds for which an action is held; a hundredth of the horizon if not given.
        horizon: longest episode, in seconds, rounded up to whole holds; if not given, the longest that the
            moves of the scene's task may take, or the scene's duration.
        bounds: least and greatest value by input, where not those of the task or of the parameter's range.
        ramp: whether inputs go to their values linearly; if not given, where some input has a rate.
        vary: what a reset draws: "instances" and "uncertain" parameters of the scene's task.
        observe: any of "q", "v", "instance" (the parameters that the task's instances vary), "inputs",
            "forces" (normal forces of contacts) and "time".
        reward: "progress", by how much the goal's lack (see `rungwise.ask`) became less, and `bonus` at the
            goal; "sparse", only the bonus; or a function of a `Transition`.
        scaled: whether actions are in -1..1, from the least to the greatest value of each input.
        dtype: of observations and actions, "float32" or "float64".
        step, tol, theta: as for `rungwise.simulate`; steps are error-controlled, to a thousandth of the size
            of the largest object, if neither `step` nor `tol` is given.
        threads: of compiled runs; one environment uses one.
        render_mode: None or "rgb_array"; in space by MuJoCo's renderer, which needs an OpenGL context.
        seed: of the first reset that gets none.

    Raises GymError, SceneError, ModelError and TaskError: one line that names the option.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        scene: AnyScene | str | Path | Mapping[str, Any],
        model: Rung | str,
        *,
        render_mode: str | None = None,
        seed: int | None = None,
        **options: Unpack[Options],
    ) -> None:
        self.settings = read_settings(scene, model, options)
        self.render_mode = checked_render_mode(render_mode)
        self._episodes = Episodes(self.settings, 1)
        self.observation_space = self._episodes.observed.space
        self.action_space = self._episodes.action_space
        self._camera = None if self.render_mode is None else camera_of(self.settings)
        if seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin an episode; options: "state" (a `rungwise.State`) and "parameters" (values by name)."""
        super().reset(seed=seed)
        self._episodes.begin(0, self.np_random, options)
        if self._camera is not None:
            self._camera.begin()
        return self._episodes.observe()[0], self._episodes.info(0)

    def step(self, action: NDArray[Any]) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Hold the inputs. Raises GymError for an action that is no row of finite numbers; one beyond its
        bounds counts as the bound (`info["inputs"]` are the inputs as applied)."""
        episodes = self._episodes
        if episodes.over[0]:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset")
        reward = episodes.advance(ROW, checked_actions(action, (len(self.settings.low),))[None])
        observation, info = episodes.observe()[0], episodes.info(0)
        return observation, float(reward[0]), bool(episodes.terminated[0]), bool(episodes.truncated[0]), info

    def render(self) -> NDArray[np.uint8] | None:
        """The bodies now (height, width, 3), in the plane with contact forces; None without a render mode."""
        return None if self._camera is None else pictured(self._camera, self.parameters, self.state)

    def close(self) -> None:
        """Give back what pictures hold."""
        if self._camera is not None:
            self._camera.close()

    @property
    def observation_names(self) -> tuple[str, ...]:
        """What each component of an observation is."""
        return self._episodes.observed.names

    @property
    def state(self) -> State:
        """Where the episode has come to: go on from it with inputs, by `rungwise.simulate` or a reset."""
        return self._episodes.state(0)

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters of the episode's run."""
        return self._episodes.parameters(0)

    @property
    def instance(self) -> dict[str, float]:
        """The parameters of the task's instance, before what is uncertain was drawn."""
        return self._episodes.instance(0)

    @property
    def schedule(self) -> list[Segment]:
        """The inputs of the episode so far, as `rungwise.simulate` takes them."""
        return self._episodes.schedule(0)

    def replay(self) -> AnyRun:
        """The episode so far once more as one run, bit for bit, with trajectory, reason and certificate."""
        return self._episodes.replay(0)


def camera_of(settings: Settings) -> Camera:
    """What draws episodes. Raises GymError where nothing does."""
    drawer = DRAWERS.get(settings.scene.world)
    if drawer is None or drawer.camera is None:
        raise GymError(f"render_mode: nothing draws the bodies of {settings.scene.name}; valid: null")
    return drawer.camera(settings.scene, settings.model)


def pictured(camera: Camera, parameters: dict[str, float], state: State) -> NDArray[np.uint8]:
    """Pixels (height, width, 3). Raises GymError where something that draws is missing."""
    try:
        return camera.picture(parameters, state)
    except ViewError as error:
        raise GymError(str(error)) from None


def checked_render_mode(mode: object) -> str | None:
    if mode is not None and mode not in RENDER_MODES:
        raise GymError(f"render_mode: must be null or rgb_array, not {shown(mode)}")
    return None if mode is None else str(mode)


def checked_actions(given: object, shape: tuple[int, ...]) -> NDArray[Any]:
    """Actions of this shape. Raises GymError."""
    try:
        actions = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise GymError(f"action: must be numbers in an array, not {shown(given)}") from None
    if actions.shape != shape:
        raise GymError(f"action: must have the shape {shape}, not {actions.shape}")
    if not np.isfinite(actions).all():
        raise GymError("action: must be finite")
    return actions


def make(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    *,
    render_mode: str | None = None,
    seed: int | None = None,
    **options: Unpack[Options],
) -> SceneEnv:
    """An environment of a scene on a rung; options and errors as for `SceneEnv`."""
    return SceneEnv(scene, model, render_mode=render_mode, seed=seed, **options)
