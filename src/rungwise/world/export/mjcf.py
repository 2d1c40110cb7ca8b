"""Scenes of MuJoCo models as MJCF, at states that keyframes hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.keywords import keywords
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import finite
from rungwise.scene.read import load
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.state import State, check_state
from rungwise.world.find import world_of
from rungwise.world.parts import ExportError


@keywords
def mjcf(
    scene: AnyScene | str | Path | Mapping[str, Any],
    states: State | Sequence[State] | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    whole: bool = True,
) -> str:
    """A scene of a MuJoCo model as the text of an MJCF file, with a keyframe for each state: time, qpos, qvel
    and controls in full, called state0, state1, ... MuJoCo is put there as into any keyframe.

    Args:
        scene: a scene in space, or a source that `load` takes.
        states: states of it; the scene's start if not given. Controls are those of the run at that time, or
            follow from the parameters.
        parameters: values by name, with which the model's numbers are set.
        whole: whether the model is written, or the keyframes alone, for `<include>` in a file of one's own.

    Meshes and textures are named by the places of their files. Laws of contact of a scene's own are not part
    of MJCF; a comment says so. Raises ExportError for a scene that has no model, StateError for a state of
    another scene, InvalidScene where the scene is impossible.
    """
    loaded = load(scene)
    values = loaded.parameters(parameters)
    if states is None:
        states = State.of(loaded, parameters=values)
    chosen = [states] if isinstance(states, State) else list(states)
    for state in chosen:
        check_state(state, loaded)
    if not chosen:
        raise ExportError("states: must be one or more")
    return world_of(loaded).mjcf(values, chosen, whole=whole)


def states_at(run: AnyRun, at: float | Sequence[float] | None, all_frames: bool) -> list[State]:
    """The recorded states of a run that are nearest to these times, each once; where no time is given all, or
    the one at the end. Raises ExportError, and ValueError for a run that never began."""
    run.check_begun()
    states = run.states
    if at is None:
        return states if all_frames else [run.state]
    times = [finite("at", time, ExportError) for time in np.atleast_1d(np.asarray(at, object)).tolist()]
    known = np.array([state.time for state in states])
    for time in times:
        if not known[0] <= time <= known[-1] * (1.0 + 1e-12):
            raise ExportError(f"at: {time:g} is outside the run, {known[0]:g} to {known[-1]:g}")
    numbers = sorted({int(np.argmin(np.abs(known - time))) for time in times})
    return [states[number] for number in numbers]
