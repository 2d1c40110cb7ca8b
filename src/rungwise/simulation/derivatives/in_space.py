"""The derivative of the end of a run in space with respect to its start and parameters, by differences.

Each unknown is moved either way by two lengths, and Richardson's extrapolation of the two central
differences is taken: its error is of fourth order in the length, and is estimated by what the extrapolation
changes. Where contacts do not stick, slip and open at the same steps in all these runs, a column is `weak`:
there the end has a kink or a jump within the differences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.deadline import Deadline
from rungwise.models.ladder import Rung
from rungwise.scene.fields.laws.contact import LAWS, titles
from rungwise.scene.space import SpaceScene
from rungwise.simulation.derivatives.changes import EndSensitivity
from rungwise.simulation.options import ModelError, moving_rung
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.simulation.state import State
from rungwise.wording import choices, listed

if TYPE_CHECKING:
    import mujoco

Array: TypeAlias = NDArray[np.float64]
KINDS = ("q", "v", "parameters")
LENGTH = 1e-3
"""Length of the wider differences, over the size of the unknown: residuals of 1e-9 then leave six digits.
Chosen by trial, to a decade."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SpaceSensitivity(EndSensitivity):
    """The state `q` (n_q,), `v` (n_v,) after the steps, at `time`, and its derivatives (see
    `EndSensitivity`).

    Changes of places are those of velocities' coordinates, so that a turn is a vector about the body's own
    axes. dq_error, dv_error: how far they may be off. `weak` (m,), by kind: columns in which a contact
    changes its mode within the differences.
    """

    time: float
    dq_error: dict[str, Array]
    dv_error: dict[str, Array]
    weak: dict[str, NDArray[np.bool_]]


class _End(NamedTuple):
    """Where a run came to, and what each contact did in each step."""

    time: float
    q: Array
    v: Array
    modes: tuple[bytes, ...]


@dataclass(frozen=True)
class _Runs:
    """Runs of so many steps of length h; they raise TimeOver where the deadline has come."""

    scene: SpaceScene
    model: Rung
    steps: int
    h: float
    theta: float
    deadline: Deadline

    def end(self, values: Mapping[str, float], begin: tuple[Array, Array] | None) -> _End:
        """The end of a run at these parameters from (q, v), or from the scene's start."""
        state = None if begin is None else State(self.scene.template.coordinates, *begin, 0.0)
        run = SpaceSimulation(
            self.scene.changed(goal=None, unsafe=None, doomed=None), self.model, parameters=values,
            state=state, step=self.h, theta=self.theta, duration=(self.steps + 1) * self.h, frames=None,
        )  # fmt: skip
        run.deadline = self.deadline
        modes = list[bytes]()
        for number in range(self.steps):
            taken = run.steps
            before = run.time
            if run.steps_taken(1) == 0 or run.steps == taken:
                raise ModelError(f"step {number}, from time {before:.6g}: {run.result().reason}")
            if abs(run.time - before - self.h) > 1e-9 * self.h:
                raise ModelError(
                    f"step {number}, from time {before:.6g}: has no solution; only shorter steps have one"
                )
            assert run.stepper is not None
            kept, state_modes = run.space.kept, run.stepper.state.modes
            known = np.flatnonzero(kept.geoms[:, 0] >= 0)
            modes.append(np.column_stack([kept.geoms[known], state_modes[known]]).tobytes())
        assert run.stepper is not None
        return _End(run.time, run.stepper.q.copy(), run.stepper.v.copy(), tuple(modes))


def run_sensitivity_in_space(
    scene: SpaceScene, model: Rung | str, parameters: Mapping[str, float] | None, steps: int,
    h: float | None, q: ArrayLike | None, v: ArrayLike | None, wrt: Sequence[str],
    names: Sequence[str] | None, theta: float, deadline: Deadline,
) -> SpaceSensitivity:  # fmt: skip
    """See `run_sensitivity`. Raises ModelError, and TimeOver."""
    for kind in wrt:
        if kind not in KINDS:
            raise ModelError(f"wrt: unknown kind {str(kind)[:60]!r}{choices(str(kind), KINDS)}")
    values = scene.parameters(parameters)
    chosen = tuple(values) if names is None else tuple(names)
    for name in chosen:
        if name not in values:
            raise ModelError(f"names: unknown parameter {str(name)[:60]!r}{choices(str(name), values)}")
    bound = scene.bind(values)
    pulls = [law.title for law in LAWS if law.pull is not None and law.title in titles(bound.named)]
    if pulls:
        raise ModelError(
            f"contacts: steps with {listed(pulls)} end at edges of pulls, and cannot be differentiated; leave"
            " it out"
        )
    runs = _Runs(scene, moving_rung(model), steps, bound.step if h is None else h, theta, deadline)
    begin = None if q is None or v is None else (np.array(q, float), np.array(v, float))
    start = (bound.place, bound.motion) if begin is None else begin
    middle = runs.end(values, begin)
    found: dict[str, list[Any]] = {}
    for kind in wrt:
        columns = []
        for k in range(len(chosen) if kind == "parameters" else len(start[1])):
            columns.append(_column(runs, bound.model, kind, k, chosen, values, begin, start, middle))
        found[kind] = (
            [np.array(part) for part in zip(*columns, strict=True)] if columns else [np.zeros(0)] * 5
        )
    dq, dv, dq_error, dv_error = ({k: np.atleast_2d(found[k][i]).T for k in wrt} for i in range(4))
    weak = {kind: np.asarray(found[kind][4], bool) for kind in wrt}
    return SpaceSensitivity(
        time=middle.time, q=middle.q, v=middle.v, dq=dq, dv=dv, dq_error=dq_error, dv_error=dv_error,
        weak=weak, names=chosen,
    )  # fmt: skip


def _column(
    runs: _Runs, model: mujoco.MjModel, kind: str, k: int, names: Sequence[str], values: dict[str, float],
    begin: tuple[Array, Array] | None, start: tuple[Array, Array], middle: _End,
) -> tuple[Array, Array, Array, Array, bool]:  # fmt: skip
    """dq, dv, their errors, and whether modes change, along one unknown."""
    length = LENGTH * _size(runs.scene, kind, k, names, values, start[1], model)
    slopes, weak = [], False
    for delta in (length, 0.5 * length):
        ends = []
        for side in (-delta, delta):
            if kind == "parameters":
                end = runs.end(values | {names[k]: values[names[k]] + side}, begin)
            else:
                end = runs.end(values, _moved(model, start, kind, k, side))
            weak |= end.modes != middle.modes
            ends.append(end)
        slopes.append(np.concatenate([_apart(model, *ends), ends[1].v - ends[0].v]) / (2.0 * delta))
    best = slopes[1] + (slopes[1] - slopes[0]) / 3.0
    error, n = np.abs(slopes[1] - slopes[0]) / 3.0, len(middle.v)
    return best[:n], best[n:], error[:n], error[n:], weak


def _size(
    scene: SpaceScene, kind: str, k: int, names: Sequence[str], values: Mapping[str, float], v: Array,
    model: mujoco.MjModel,
) -> float:  # fmt: skip
    """The size of an unknown: of a parameter, at most what its range leaves on either side."""
    if kind != "parameters":
        return float(max(abs(v[k]), 1e-3)) if kind == "v" else float(model.stat.extent)
    low, high = scene.file.parameters[names[k]].range or (-math.inf, math.inf)
    value = values[names[k]]
    size = abs(value) if value != 0.0 else min(high - low, 1.0)
    room = min(high - value, value - low) / LENGTH
    if not room > 0.0:
        raise ModelError(f"names: {names[k]} is at an end of its range, {value:g}")
    return float(min(size, room))


def _moved(
    model: mujoco.MjModel, start: tuple[Array, Array], kind: str, k: int, by: float
) -> tuple[Array, Array]:
    import mujoco

    q, v = start[0].copy(), start[1].copy()
    if kind == "v":
        v[k] += by
    else:
        mujoco.mj_integratePos(model, q, np.eye(len(v))[k], by)
    return q, v


def _apart(model: mujoco.MjModel, one: _End, other: _End) -> Array:
    """The change of places from one end to the other, as velocities over a unit of time (n_v,)."""
    import mujoco

    found = np.zeros(len(one.v))
    mujoco.mj_differentiatePos(model, found, 1.0, one.q, other.q)
    return found
