"""Runs in space as films: of a run, or of the folder in which one was saved."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Outcome
from rungwise.scene.space import load_space
from rungwise.scene.space.mujoco_model import library
from rungwise.simulation.trajectory import read_saved
from rungwise.viewing.space.film import SLIP, Film, FilmError, Touches
from rungwise.viewing.space.goal import goal_poses
from rungwise.viewing.space.model_solids import film_of_model

if TYPE_CHECKING:
    import mujoco
    import xarray

    from rungwise.scene.space import SpaceScene

UNITS = {"length": "m", "time": "s", "force": "N"}


def film_of(source: Any) -> Film:
    """The film of a run, or of a folder of one: poses, contacts, and curves of gaps and normal forces of the
    bodies that met. Raises FilmError for a run that never began."""
    if isinstance(source, str | Path):
        data, told = read_saved(source)
        scene = load_space(json.loads(data.attrs["scene_file"]))
        return _film(
            scene, told["parameters"], scene.bind(told["parameters"]).model, data, tuple(told["notes"])
        )
    if not source.began:
        raise FilmError(f"run: did not begin: {source.reason}")
    space = source.space
    model = source.scene.bind(source.parameters).model if space is None else space.model
    return _film(source.scene, source.parameters, model, source.trajectory, source.notes)


def _film(
    scene: SpaceScene, parameters: Mapping[str, float], model: mujoco.MjModel, data: xarray.Dataset,
    notes: tuple[str, ...],
) -> Film:  # fmt: skip
    _, solids = film_of_model(model)
    places, turns = _poses(model, data.position.values)
    touches, pairs, gaps, pushes = _touches(scene.labels.bodies, model.geom_bodyid, data)
    outcome, reason = data.attrs["outcome"], data.attrs["reason"]
    if outcome == Outcome.GOAL:  # the advice would differ from film to film, by the name of the next rung
        reason = Outcome.GOAL.meaning
    return Film(
        title=scene.name, model=data.attrs["model"], bodies=scene.labels.bodies, solids=tuple(solids),
        time=data.time.values, places=places, turns=turns, pairs=pairs, touches=touches, gaps=gaps,
        pushes=pushes, outcome=outcome, reason=reason, notes=notes, units=UNITS,
        goal=goal_poses(scene, model, parameters, data.position.values[-1]),
    )  # fmt: skip


def _poses(model: mujoco.MjModel, q: Reals) -> tuple[Reals, Reals]:
    """Places (f, b, 3) and turns (f, b, 4) at q (f, n_q)."""
    mujoco = library()
    data = mujoco.MjData(model)
    places, turns = np.zeros((len(q), model.nbody, 3)), np.zeros((len(q), model.nbody, 4))
    for k, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        places[k], turns[k] = data.xpos, data.xquat
    return places, turns


def _touches(
    names: tuple[str, ...], body: Any, data: xarray.Dataset
) -> tuple[Touches, tuple[tuple[str, str], ...], Reals, Reals]:
    """Contacts of all frames, the pairs of bodies (p,) that met, their gaps and pushes (f, p)."""
    frame, sides = data.touch_frame.values, body[data.touch_geoms.values].reshape(-1, 2)
    met = sorted({(int(a), int(b)) for a, b in sides})
    number = {pair: k for k, pair in enumerate(met)}
    pair = np.array([number[int(a), int(b)] for a, b in sides], np.int64)
    force, normal = data.touch_force.values, data.touch_normal.values
    gaps = np.full((len(data.time), len(met)), np.inf)
    np.minimum.at(gaps, (frame, pair), data.touch_gap.values)
    pushes = np.zeros((len(data.time), len(met)))
    np.add.at(pushes, (frame, pair), (force * normal).sum(axis=1))
    touches = Touches(
        frame=frame, pair=pair, point=data.touch_point.values, normal=normal, force=force,
        friction=data.touch_friction.values,
        mode=np.minimum(data.touch_mode.values, SLIP).astype(np.int64),
    )  # fmt: skip
    gaps[np.isinf(gaps)] = np.nan
    return touches, tuple((names[a], names[b]) for a, b in met), gaps, pushes
