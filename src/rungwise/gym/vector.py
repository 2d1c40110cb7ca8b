"""Many environments of one scene on one rung, advanced by compiled code on threads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from rungwise.gym.env import RENDER_MODES, camera_of, checked_actions, checked_render_mode, pictured
from rungwise.gym.episodes import Episodes
from rungwise.gym.settings import GymError, Options, read_settings
from rungwise.kernel import Ints
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.simulation.options import count
from rungwise.simulation.state import State

Stepped = tuple[NDArray[Any], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
MASK = "reset_mask"
"""Option of a reset that says which environments begin anew."""


class SceneVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """`num_envs` environments, each to the bit a `SceneEnv` with its own generator; other options are those
    of `SceneEnv`. Seeds of a reset are one for each environment, or a number to which its row is added.

    autoreset_mode: of Gymnasium: "NextStep" (the step after the end of an episode begins the next one),
    "SameStep" (the step that ends it does, with "final_obs" and "final_info") or "Disabled" (reset with
    the option "reset_mask").
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        scene: AnyScene | str | Path | Mapping[str, Any],
        model: Rung | str,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Unpack[Options],
    ) -> None:
        super().__init__()
        self.num_envs = count("num_envs", num_envs, 1)
        self.settings = read_settings(scene, model, options)
        self.render_mode = checked_render_mode(render_mode)
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self._episodes = Episodes(self.settings, self.num_envs)
        self.single_observation_space = self._episodes.observed.space
        self.single_action_space = self._episodes.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs
        cameras = 0 if self.render_mode is None else self.num_envs
        self._cameras = [camera_of(self.settings) for _ in range(cameras)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin episodes in all environments, or in those of the option "reset_mask"; other options as for
        `SceneEnv.reset`, for all of them."""
        given = dict(options or {})
        rows = self._masked(given.pop(MASK, None))
        for row, each in zip(range(self.num_envs), self._seeds(seed), strict=True):
            if row in rows and (each is not None or self._generators[row] is None):
                self._generators[row], _ = seeding.np_random(each)
        self._begin(rows, given)
        return self._episodes.observe(), self._infos(rows)

    def step(self, actions: NDArray[Any]) -> Stepped:
        """Hold the inputs in all environments; errors as of `SceneEnv.step`."""
        episodes, m = self._episodes, self.num_envs
        held = checked_actions(actions, (m, len(self.settings.low)))
        over, rewards = episodes.over.copy(), np.zeros(m)
        if over.any() and self.autoreset_mode != AutoresetMode.NEXT_STEP:
            raise gymnasium.error.ResetNeeded(f"the episode of environment {np.argmax(over)} is over")
        rows = np.flatnonzero(~over)
        if len(rows):
            rewards[rows] = episodes.advance(rows, held[rows])
        self._begin(np.flatnonzero(over), {})
        terminated, truncated = episodes.terminated, episodes.truncated
        infos: dict[str, Any] = {}
        ended = np.flatnonzero(terminated | truncated)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and len(ended):
            final, told = episodes.observe(), self._infos(ended)
            infos = {"final_obs": np.full(m, None, object), "final_info": told}
            for row in ended:
                infos["final_obs"][row] = final[row]
            mask = terminated | truncated
            infos |= {"_final_obs": mask, "_final_info": mask.copy()}
            self._begin(ended, {})
        return episodes.observe(), rewards, terminated, truncated, self._infos(np.arange(m)) | infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of each environment, or None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(
            pictured(camera, self._episodes.parameters(row), self._episodes.state(row))
            for row, camera in enumerate(self._cameras)
        )

    def close_extras(self, **_kwargs: Any) -> None:
        """Give back what pictures hold."""
        for camera in self._cameras:
            camera.close()

    @property
    def states(self) -> list[State]:
        """Where the episodes have come to."""
        return [self._episodes.state(row) for row in range(self.num_envs)]

    @property
    def observation_names(self) -> tuple[str, ...]:
        """What each component of an observation is."""
        return self._episodes.observed.names

    def _begin(self, rows: Ints, options: Mapping[str, Any]) -> None:
        for row in rows.tolist():
            generator = self._generators[row]
            if generator is None:
                raise gymnasium.error.ResetNeeded("call reset before step")
            self._episodes.begin(row, generator, options)
            if self._cameras:
                self._cameras[row].begin()

    def _infos(self, rows: Ints) -> dict[str, Any]:
        """What each of these environments tells, as Gymnasium joins it."""
        infos: dict[str, Any] = {}
        mask = np.isin(np.arange(self.num_envs), rows)
        for name, values in self._episodes.infos(rows).items():
            nothing = None if values.dtype == object else 0
            infos[name] = np.full((self.num_envs, *values.shape[1:]), nothing, values.dtype)
            infos[name][rows] = values
            infos[f"_{name}"] = mask.copy()
        return infos

    def _masked(self, mask: object) -> Ints:
        if mask is None:
            return np.arange(self.num_envs)
        is_array = isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,)
        if not is_array or not np.any(np.asarray(mask)):
            raise GymError(f"options.{MASK}: must be an array of {self.num_envs} truths, one of them true")
        return np.flatnonzero(np.asarray(mask))

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise GymError(f"seed: must be a number or {self.num_envs} of them, not {len(seed)}")
        return seed


def _mode(given: object) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError:
        names = ", ".join(str(mode.value) for mode in AutoresetMode)
        raise GymError(f"autoreset_mode: unknown {shown(given)}; valid: {names}") from None
