"""Runs in space as films."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rungwise.scene.space.model import library
from rungwise.simulation.spatial.frames import Frame
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.viewing.space.film import SLIP, Film, FilmError, Touches
from rungwise.viewing.space.mjcf import film_of_model

if TYPE_CHECKING:
    import mujoco

UNITS = {"length": "m", "time": "s", "force": "N"}


def film_of(run: SpaceRun) -> Film:
    """The film of a run: poses, contacts, and curves of gaps and normal forces of the bodies that met. Raises
    FilmError for a run that never began."""
    if run.space is None or not run.frames:
        raise FilmError(f"run: did not begin: {run.reason}")
    model = run.space.model
    _, solids = film_of_model(model)
    bodies = run.scene.labels.bodies
    places, turns = _poses(model, run.frames)
    touches, pairs, gaps, pushes = _touches(run, run.space.solids.body.astype(int).tolist())
    return Film(
        title=run.scene.name, model=run.model.name, bodies=bodies, solids=tuple(solids),
        time=np.array([frame.time for frame in run.frames]), places=places, turns=turns, pairs=pairs,
        touches=touches, gaps=gaps, pushes=pushes, outcome=str(run.outcome), reason=run.reason,
        notes=run.notes, units=UNITS,
    )  # fmt: skip


def _poses(model: mujoco.MjModel, frames: tuple[Frame, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Places (f, b, 3) and turns (f, b, 4)."""
    mujoco = library()
    data = mujoco.MjData(model)
    places, turns = np.zeros((len(frames), model.nbody, 3)), np.zeros((len(frames), model.nbody, 4))
    for k, frame in enumerate(frames):
        data.qpos[:] = frame.q
        mujoco.mj_kinematics(model, data)
        places[k], turns[k] = data.xpos, data.xquat
    return places, turns


def _touches(
    run: SpaceRun, body: list[int]
) -> tuple[Touches, tuple[tuple[str, str], ...], np.ndarray, np.ndarray]:
    """Contacts of all frames, the pairs of bodies (p,) that met, their gaps and pushes (f, p)."""
    names, frames = run.scene.labels.bodies, run.frames
    met = sorted({(body[a], body[b]) for frame in frames for a, b in frame.touch.geoms})
    number = {pair: k for k, pair in enumerate(met)}
    rows = [[number[body[a], body[b]] for a, b in frame.touch.geoms] for frame in frames]
    gaps, pushes = np.full((len(frames), len(met)), np.nan), np.zeros((len(frames), len(met)))
    for f, frame in enumerate(frames):
        for c, pair in enumerate(rows[f]):
            gaps[f, pair] = np.fmin(gaps[f, pair], frame.touch.gap[c])
            pushes[f, pair] += float(frame.touch.force[c] @ frame.touch.normal[c])
    counts = [len(each) for each in rows]

    def joined(field: str, width: int) -> np.ndarray:
        parts = [getattr(frame.touch, field).reshape(-1, width) for frame in frames]
        return np.concatenate(parts) if parts else np.zeros((0, width))

    touches = Touches(
        frame=np.repeat(np.arange(len(frames)), counts),
        pair=np.array([pair for each in rows for pair in each], np.int64),
        point=joined("point", 3), normal=joined("normal", 3), force=joined("force", 3),
        friction=joined("friction", 1)[:, 0],
        mode=np.minimum(joined("mode", 1)[:, 0], SLIP).astype(np.int64),
    )  # fmt: skip
    return touches, tuple((names[a], names[b]) for a, b in met), gaps, pushes
