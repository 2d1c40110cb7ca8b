"""Rollouts: many runs from states, each with inputs in segments."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.options import moving_rung
from rungwise.simulation.rows import States
from rungwise.simulation.state import State
from rungwise.world.arguments import asked
from rungwise.world.find import world_of
from rungwise.world.nearest import accepted
from rungwise.world.rolled import Rolled

if TYPE_CHECKING:
    import rungwise


class RolloutKeywords(TypedDict, total=False):
    """Keywords of `rollout`, for type checkers."""

    until: Sequence[str | None] | None
    ramp: bool | Sequence[bool]
    parameters: Mapping[str, ArrayLike] | None
    step: float | None
    tol: float | None
    theta: float
    motion: Mapping[str, float] | None
    keep: bool
    budget: int | None
    threads: int | None
    chunk: int | None
    limit: float | None
    on_progress: Callable[[int], None] | None


@overload
def rollout(
    scene: rungwise.Scene, model: Rung | str, states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None, durations: ArrayLike | None = None,
    **options: Unpack[RolloutKeywords],
) -> rungwise.Rollouts: ...  # fmt: skip
@overload
def rollout(
    scene: rungwise.SpaceScene, model: Rung | str, states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None, durations: ArrayLike | None = None,
    **options: Unpack[RolloutKeywords],
) -> rungwise.SpaceRollouts: ...  # fmt: skip
@overload
def rollout(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str, states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None, durations: ArrayLike | None = None,
    **options: Unpack[RolloutKeywords],
) -> Rolled: ...  # fmt: skip
@keywords
def rollout(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    states: States | None = None,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
    durations: ArrayLike | None = None,
    *,
    until: Sequence[str | None] | None = None,
    ramp: bool | Sequence[bool] = False,
    parameters: Mapping[str, ArrayLike] | None = None,
    step: float | None = None,
    tol: float | None = 1e-3,
    theta: float = 1.0,
    motion: Mapping[str, float] | None = None,
    keep: bool = True,
    budget: int | None = None,
    threads: int | None = None,
    chunk: int | None = None,
    limit: float | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> Rolled:
    """Make m runs, each with its own start, and its own inputs in s segments, on compiled threads. The
    bytes do not depend on `threads`.

    Args:
        scene, model, step, tol, theta, motion: as for `simulate`, except that steps are error-controlled
            unless `tol` is None.
        states: one state or m states; or positions (m, n), or positions and velocities (m, 2 n), at t = 0;
            the scene's start if not given. A state continues as in `simulate(..., state=)`, one of no run
            at the nearest that is accepted; positions stay as they are given.
        inputs: values (m, s, u) of the scene's inputs, or (s, u) for all samples, or a mapping of names to
            values (m, s), (s,) or a number; inputs not named stay as they are.
        durations: of segments, (m, s), (s,), or a number for all; 0 skips one. The runs end with the last.
            Without durations there is no segment, and runs end with the scene.
        until: for each segment a condition that ends it sooner, or None; see `Segment`.
        ramp: whether inputs go to their values linearly, for all segments or for each.
        parameters: values by name, a number or (m,) each.
        keep: whether the states at the switches are kept (see `Rolled`).
        budget: most steps of one run, a million if not given; a run that takes more has not converged.
        chunk: how many runs a thread takes at a time; it changes nothing but speed.
        threads: how many; as many as there are cores if not given.
        limit: seconds after which unfinished runs are interrupted, also from within a step: their outcome is
            `running`, and they are kept so far. Runs that had not begun have positions of nan.
        on_progress: called with the number of runs done. Ctrl-C raises KeyboardInterrupt within one run.

    Raises SceneError, StateError, ScheduleError or ModelError for wrong shapes, names and options. A wrong
    value makes its sample `invalid`, with a line in `faults`; the other samples run. A value for one sample,
    also an array of one row, is used for all m."""
    deadline = Deadline(seconds(limit))
    scene, rung = load(scene), moving_rung(model)
    wanted = asked(
        scene, _accepted(scene, rung, states, parameters), inputs, durations, until, ramp, parameters
    )
    options = {"step": step, "tol": tol, "theta": theta, "motion": motion}
    return world_of(scene).rollout(
        rung, wanted, options, keep=keep, budget=budget, threads=threads, chunk=chunk, deadline=deadline,
        on_progress=on_progress,
    )  # fmt: skip


def _accepted(
    scene: AnyScene, rung: Rung, states: States | None, parameters: Mapping[str, ArrayLike] | None
) -> States | None:
    """States, each the nearest that a run accepts at the parameters that are numbers for all samples."""
    if states is None or isinstance(states, np.ndarray):
        return states
    given = {
        name: float(np.asarray(value)) for name, value in (parameters or {}).items() if np.ndim(value) == 0
    }
    if isinstance(states, State):
        return accepted(scene, rung, [states], given)[0]
    if not isinstance(states, Sequence) or not all(isinstance(each, State) for each in states):
        return states
    return accepted(scene, rung, states, given)
