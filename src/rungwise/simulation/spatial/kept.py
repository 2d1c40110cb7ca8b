"""Scenes in space that a thread keeps ready: MuJoCo's data belong to one process, and take long to make."""

from __future__ import annotations

import threading
from typing import Any

from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.simulation.state import digest

KEPT = 150_000_000
"""Bytes of scenes at parameters that a thread keeps ready: enough for a hundred small ones."""

_own = threading.local()


def prepared(scene: SpaceScene, parameters: dict[str, float]) -> Prepared:
    """The scene at these parameters, kept ready in this thread. Raises InvalidScene."""
    kept: dict[Any, Prepared] = _own.__dict__.setdefault("kept", {})
    key = digest(scene), tuple(parameters.items())
    made = kept.pop(key, None)
    if made is None:
        made = Prepared.of(scene, parameters)
        while kept and sum(each.bytes for each in (made, *kept.values())) > KEPT:
            del kept[next(iter(kept))]
    kept[key] = made  # behind those that were used less lately
    return made


def kept_simulation(
    scene: SpaceScene, model: Rung, *, parameters: dict[str, float], **options: Any
) -> SpaceSimulation:
    """A run before its first step, of a scene that is kept ready. Raises InvalidScene, SceneError, StateError
    and ModelError."""
    made = prepared(scene, scene.parameters(parameters))
    return SpaceSimulation(scene, model, parameters=parameters, prepared=made, **options)
