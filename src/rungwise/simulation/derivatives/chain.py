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
from rungwise.scene.contract import AnyScene
from rungwise.simulation.derivatives.changes import STATE
from rungwise.simulation.derivatives.sensitivity import (
    WRT,
    StateSensitivity,
    differentiated,
    each_alone,
    fields_of,
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
) -> RunSensitivity:
    """Take `steps` steps of length h, and differentiate the state after them.

    Args:
        scene, model, parameters, theta: as for `simulate`.
        steps: how many, at least 1.
        h: length of each; the scene's own if not given.
        q, v: (n_q,), (n,) at the start, both or none. If none, the run starts as the scene does, and its
            start depends on parameters.
        deformation: (slots, d) of contacts at the start, as for `step_sensitivity`; none if not given.
        time: at the start, for numbers that depend on time.
        wrt: which of "q", "v", "deformation", "inputs", "parameters"; all but "deformation" if not given.
        names: the parameters to differentiate by; all if not given.

    Raises:
        ModelError: an argument is wrong, or a step, which is named, cannot be taken as it is: no solution, a
            limit of travel or a new feature reached within it, or a contact changes its feature with an
            unknown, which is named.
        LimitError: `limit` seconds are over before all steps, and all differences, are taken: the derivative
            after fewer steps would be another answer.
    """
    deadline = Deadline(seconds(limit))
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or steps < 1:
        raise ModelError(f"steps: must be a whole number of at least 1, not {steps!r}")
    if (q is None) != (v is None):
        raise ModelError("q and v: give both, or none to start as the scene does")
    start = _Asked(q, v, deformation, time, WRT if wrt is None else wrt, names)
    with deadline.needed_for(WHOLE):
        return _chained(scene, model, parameters, steps, h, start, theta, deadline)


class _Asked(NamedTuple):
    """Where steps start, and by what they are differentiated; see `run_sensitivity`."""

    q: ArrayLike | None
    v: ArrayLike | None
    deformation: ArrayLike | None
    time: float
    wrt: Sequence[str]
    names: Sequence[str] | None


def _chained(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str,
    parameters: Mapping[str, float] | None, steps: int, h: float | None, asked_for: _Asked, theta: float,
    deadline: Deadline,
) -> RunSensitivity:  # fmt: skip
    """See `run_sensitivity`. Raises ModelError, and TimeOver."""
    q, v, deformation, time, wrt, names = asked_for
    here, changes = prepared(scene, model, parameters, h, theta, wrt, names, deadline)
    begin_q, begin_v = (here.begun.q, here.begun.v) if q is None or v is None else (q, v)
    start = started(here, begin_q, begin_v, deformation, time)
    parts, directions = each_alone(changes, wrt)
    if q is None and "parameters" in parts:
        for kind, begun in zip(("q", "v"), changes.begins(), strict=True):
            directions[kind][:, parts["parameters"]] = begun
    labels = [changes.label(kind, i) for kind in parts for i in range(changes.size(kind))]
    weak: list[int] = []
    lost = np.zeros(directions["q"].shape[1], bool)
    for number in range(steps):
        try:
            step = differentiated(here, changes, start, directions, deadline, labels)
        except LimitError:
            raise
        except ValueError as error:
            reason = str(error).removeprefix("step: ")
            raise ModelError(f"step {number}, from time {start.time:.6g}: {reason}") from None
        lost |= ~np.isfinite(np.vstack(list(step.state.values()))).all(axis=0)
        directions |= {kind: np.where(lost, 0.0, value) for kind, value in step.state.items()}
        if step.contact.weak or step.contact.weak_rows:
            weak.append(number)
        start = step.end
    state = {kind: np.where(lost, np.nan, directions[kind]) for kind in STATE}
    return RunSensitivity(
        **fields_of(start, state, parts), time=start.time, names=changes.names, weak=tuple(weak)
    )
