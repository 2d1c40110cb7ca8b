"""Pieces of models, and measures of runs, that tests of scenes in space share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.spatial.run import SpaceSimulation

Array = NDArray[np.float64]
G = 9.81
NO_GRAVITY = '<option gravity="0 0 0"/>'
FLOOR = '<geom name="floor" type="plane" size="5 5 0.1"/>'
SLIDER = '<body name="p"><joint name="j" type="slide" axis="0 0 1"/><geom size=".1" mass="2"/></body>'


def world(*parts: str, before: str = "", after: str = "") -> str:
    return f"{before}<worldbody>{''.join(parts)}</worldbody>{after}"


def free(name: str, place: str, geom: str, more: str = "") -> str:
    """A free body of one geom of mass 1, unless `geom` says another."""
    mass = "" if "mass" in geom or "density" in geom else 'mass="1"'
    return f'<body name="{name}" pos="{place}" {more}><freejoint/><geom {geom} {mass}/></body>'


def run(scene: rw.Scene | SpaceScene, model: Rung, **options: Any) -> SpaceRun:
    """A run whose steps are all solved."""
    found = rw.simulate(scene, model, **options)
    assert isinstance(found, SpaceRun)
    assert found.worst_residual <= 1e-8, found
    return found


def forces(scene: SpaceScene, model: Rung, **options: Any) -> tuple[SpaceRun, SpaceSimulation]:
    """A run, and the simulation behind it with the forces of its last step."""
    simulation = SpaceSimulation(scene, model, **options)
    while simulation.advance():
        pass
    return simulation.result(), simulation


def q(found: SpaceRun) -> Array:
    return np.asarray(found.frames[-1].q)


def v(found: SpaceRun) -> Array:
    return np.asarray(found.frames[-1].v)
