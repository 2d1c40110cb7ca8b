"""The derivative of the state after several steps with respect to their start, inputs and parameters.

Directions go through one step after another: the change of a step's data along each direction is of first
order, and where a mode is about to change the solution still has a derivative along directions
(`contact.analysis.sensitivity`), which obeys the chain rule though it is not linear. Source: Robinson, Math.
Oper. Res. 16 (1991) 292-309 (chain rule of B-derivatives).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.deadline import Deadline, LimitError, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.scene.space import SpaceScene
from rungwise.simulation.derivatives.changes import KINDS
from rungwise.simulation.derivatives.in_space import SpaceSensitivity, run_sensitivity_in_space
from rungwise.simulation.derivatives.sensitivity import (
    WRT,
    StateSensitivity,
    differentiated,
    prepared,
    started,
)
from rungwise.simulation.options import ModelError

Array: TypeAlias = NDArray[np.float64]
WHOLE = "all steps and their differences were taken"


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class RunSensitivity(StateSensitivity):
    """The state after steps, at `time`, and its derivatives (see `StateSensitivity`); inputs are the same in
    all steps. `weak` are the numbers of steps with a contact about to change its mode: if there are any,
    derivatives are one-sided, for each column increased by itself."""

    time: float
    weak: tuple[int, ...]


@keywords
def run_sensitivity(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    parameters: Mapping[str, float] | None = None,
    *,
    steps: int,
    h: float | None = None,
    q: ArrayLike | None = None,
    v: ArrayLike | None = None,
    deformation: ArrayLike | None = None,
    time: float = 0.0,
    wrt: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    theta: float = 1.0,
    limit: float | None = None,
) -> RunSensitivity | SpaceSensitivity:
    """Take `steps` steps of length h, and differentiate the state after them.

    Args:
        scene, model, parameters, theta: as for `simulate`.
        steps: how many, at least 1.
        h: length of each; the scene's own if not given.
        q, v: (n,) at the start, both or none. If none, the run starts as the scene does, and its start
            depends on parameters.
        deformation: (slots, 2) of contacts at the start, as `Workspace.state` has it; none if not given.
        time: at the start, for numbers that depend on time.
        wrt: which of "q", "v", "deformation", "inputs", "parameters"; all but "deformation" if not given.
        names: the parameters to differentiate by; all if not given.

    In space derivatives are by differences of runs (see `SpaceSensitivity`), with respect to "q", "v" and
    "parameters" (inputs included); by default to parameters alone.

    Raises:
        ModelError: an argument is wrong, or a step, which is named, cannot be taken as it is: no solution, a
            limit of travel or a new feature reached within it.
        LimitError: `limit` seconds are over before all steps, and all differences, are taken: the derivative
            after fewer steps would be another answer.
    """
    deadline = Deadline(seconds(limit))
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or steps < 1:
        raise ModelError(f"steps: must be a whole number of at least 1, not {steps!r}")
    if (q is None) != (v is None):
        raise ModelError("q and v: give both, or none to start as the scene does")
    scene = load(scene)
    if isinstance(scene, SpaceScene):
        if deformation is not None or time != 0.0:
            raise ModelError(
                "deformation and time: runs in space begin at 0, with contacts that do not yield yet"
            )
        asked_in_space = ("parameters",) if wrt is None else wrt
        with deadline.needed_for(WHOLE):
            return run_sensitivity_in_space(
                scene, model, parameters, steps, h, q, v, asked_in_space, names, theta, deadline
            )
    if not isinstance(scene, Scene):
        raise ModelError(f"scene: derivatives of runs do not work for {scene.name}")
    start = _Asked(q, v, deformation, time, WRT if wrt is None else wrt, names)
    with deadline.needed_for(WHOLE):
        return _in_plane(scene, model, parameters, steps, h, start, theta, deadline)


class _Asked(NamedTuple):
    """Where steps start, and by what they are differentiated; see `run_sensitivity`."""

    q: ArrayLike | None
    v: ArrayLike | None
    deformation: ArrayLike | None
    time: float
    wrt: Sequence[str]
    names: Sequence[str] | None


def _in_plane(
    scene: Scene, model: Rung | str, parameters: Mapping[str, float] | None, steps: int, h: float | None,
    asked_for: _Asked, theta: float, deadline: Deadline,
) -> RunSensitivity:  # fmt: skip
    """See `run_sensitivity`. Raises ModelError, and TimeOver."""
    q, v, deformation, time, wrt, names = asked_for
    values = scene.parameters(parameters)
    length = float(scene.bind(values).records.world[0]["step"]) if h is None else h
    kinds = (*wrt, "q", "v", "deformation")
    here, changes = prepared(scene, model, values, length, theta, kinds, names, deadline)
    begin_q, begin_v = here.begun if q is None or v is None else (q, v)
    start = started(here, begin_q, begin_v, deformation, time)
    asked = [kind for kind in KINDS if kind in wrt]
    first = np.concatenate([[0], np.cumsum([changes.size(kind) for kind in asked])]).astype(int)
    parts = {kind: slice(a, b) for kind, a, b in zip(asked, first, first[1:], strict=False)}
    directions = {}
    for kind in changes.kinds:
        directions[kind] = np.zeros((changes.size(kind), first[-1]))
        if kind in parts:
            directions[kind][:, parts[kind]] = np.eye(changes.size(kind))
    if q is None and "parameters" in parts:
        for kind, begun in zip(("q", "v"), changes.begins(), strict=True):
            directions[kind][:, parts["parameters"]] = begun
    weak: list[int] = []
    lost = np.zeros(first[-1], bool)
    for number in range(steps):
        try:
            step = differentiated(here, changes, start, directions, deadline)
        except LimitError:
            raise
        except ValueError as error:
            reason = str(error).removeprefix("step: ")
            raise ModelError(f"step {number}, from time {start.time:.6g}: {reason}") from None
        state = {"q": step.dq, "v": step.dv, "deformation": step.ddeformation}
        lost |= ~np.isfinite(np.vstack(list(state.values()))).all(axis=0)
        directions |= {kind: np.where(lost, 0.0, value) for kind, value in state.items()}
        if step.contact.weak or step.contact.weak_rows:
            weak.append(number)
        start = step.end
    dq, dv, strain = (
        {kind: np.where(lost, np.nan, directions[of])[:, part] for kind, part in parts.items()}
        for of in ("q", "v", "deformation")
    )
    return RunSensitivity(
        time=start.time, q=start.q, v=start.v, deformation=start.deformation, dq=dq, dv=dv,
        ddeformation=strain, names=changes.names, weak=tuple(weak),
    )  # fmt: skip
