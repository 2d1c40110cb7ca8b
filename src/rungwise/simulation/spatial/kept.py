"""Scenes in space that are kept ready: MuJoCo's data serve one run at a time, and take long to make."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.simulation.state import digest

KEPT = 300_000_000
"""Bytes of scenes at parameters that are kept ready: enough for two hundred small ones."""


class _Free(NamedTuple):
    """What is of use to whoever wants the scene of this key."""

    key: Any
    made: Prepared


_free: list[_Free] = []
"""Those that nobody uses now, used last at the end."""
_in_turn = threading.Lock()


class KeptSimulation(SpaceSimulation):
    """A run of a scene that is kept ready, to be given back."""

    key: Any = None
    made: Prepared | None = None

    def give_back(self) -> None:
        made, self.made = self.made, None
        if made is not None:
            give_back(self.key, made)


def prepared(scene: SpaceScene, parameters: dict[str, float]) -> tuple[Any, Prepared]:
    """The key of a scene at these parameters, and the scene, for one user alone. Raises InvalidScene."""
    key = digest(scene), tuple(parameters.items())
    with _in_turn:
        for k in range(len(_free) - 1, -1, -1):
            if _free[k].key == key:
                return _free.pop(k)
    return key, Prepared.of(scene, parameters)


def give_back(key: Any, made: Prepared) -> None:
    """Its user has no more use for the scene of this key."""
    with _in_turn:
        _free.append(_Free(key, made))
        while len(_free) > 1 and sum(each.made.bytes for each in _free) > KEPT:
            del _free[0]


def kept_simulation(
    scene: SpaceScene, model: Rung, *, parameters: dict[str, float], **options: Any
) -> SpaceSimulation:
    """A run before its first step, of a scene that is kept ready. Raises InvalidScene, SceneError, StateError
    and ModelError."""
    key, made = prepared(scene, scene.parameters(parameters))
    simulation = KeptSimulation(scene, model, parameters=parameters, prepared=made, **options)
    simulation.key, simulation.made = key, made
    return simulation
