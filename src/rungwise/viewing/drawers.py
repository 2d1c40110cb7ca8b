"""What draws the runs of a world: the one place that tells worlds apart for pictures."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.state import State
from rungwise.simulation.trajectory import read_saved
from rungwise.viewing.plane import camera as plane_camera
from rungwise.viewing.plane import pictures
from rungwise.viewing.plane import run_page as planar
from rungwise.viewing.plane.clip import clip
from rungwise.viewing.plane.parting import draw_parting
from rungwise.viewing.space import camera as space_camera
from rungwise.viewing.space import pictures as stills
from rungwise.viewing.space import run_page as spatial
from rungwise.viewing.space.live import Live, open_live
from rungwise.viewing.space.runs import film_of
from rungwise.viewing.write import ViewError


class Camera(Protocol):
    """Draws states, as those of episodes follow each other."""

    def begin(self) -> None:
        """Forget the view of the episode before."""

    def close(self) -> None:
        """Give back what pictures hold."""

    def picture(self, parameters: Mapping[str, float], state: State, /) -> NDArray[np.uint8]:
        """Pixels (height, width, 3). Raises ViewError where something that draws is missing."""


@dataclass(frozen=True)
class Drawer:
    """How runs of a world are drawn. `clip` makes of a run, or of the folder of a saved one, what is drawn;
    `alike` raises InputError where several show different bodies; `name` is the stem of their file and `page`
    the text of a page of at most so many bytes. What the world does not have is None: stills (`strip`), a
    moving picture (`gif`), a page that is served (`live`), the picture of a diagnosis (`parting`), pictures
    of single states as pixels (`camera`).
    """

    runs: str
    clip: Callable[[Any], Any]
    alike: Callable[[Sequence[Any]], None]
    name: Callable[[Any], str]
    page: Callable[[Sequence[Any], int], str]
    strip: Callable[..., Any] | None = None
    gif: Callable[..., None] | None = None
    live: Callable[[Sequence[Any]], Live] | None = None
    parting: Callable[..., Path] | None = None
    camera: Callable[[Any, Rung], Camera] | None = None


PLANE = Drawer(
    "planar runs", clip, planar.same_bodies, lambda each: str(each.scene), planar.page,
    strip=pictures.strip, gif=lambda clips, file: pictures.save_gif(clips, file),
    parting=draw_parting, camera=plane_camera.Camera,
)  # fmt: skip
SPACE = Drawer(
    "runs in space", film_of, spatial.same_bodies, lambda each: str(each.title), spatial.page,
    strip=stills.strip, gif=lambda films, file: stills.save_gif(films, file),
    live=open_live, camera=space_camera.Camera,
)  # fmt: skip
DRAWERS = {"rungwise.world.planar": PLANE, "rungwise.world.spatial": SPACE}
"""By the module of the world, which a scene names."""


def drawer_of(scene: AnyScene) -> Drawer:
    """Raises ViewError where no pictures are drawn of the scene's world."""
    if scene.world not in DRAWERS:
        raise ViewError(f"view: there are no pictures of runs in {scene.world}, the world of {scene.name}")
    return DRAWERS[scene.world]


def drawer_of_saved(folder: Path) -> Drawer:
    """What draws the run that was saved in a folder, by the scene that is kept there. Raises ViewError,
    SceneError; where there is no run that names its scene, planar pictures say so."""
    try:
        data, _ = read_saved(folder)
    except (OSError, ValueError):
        return PLANE
    stored = data.attrs.get("scene_file")
    return PLANE if stored is None else drawer_of(load(json.loads(stored)))
