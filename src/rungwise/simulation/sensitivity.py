"""The derivative of one step of a scene with respect to where it starts, what drives it, and its parameters.

What a step assembles is smooth while its features and decisions stay as they are: which points touch, which
contacts bounce, which coordinates have come to the end of their travel, theta, and how small the eps of a
quasistatic rung is. So it is differenced, centrally, with those held; the solution is then differentiated
exactly (`contact.sensitivity`). A gap enters as psi / h and is not differenced through the threshold below
which it counts as zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.contact.problem import trim
from rungwise.contact.sensitivity import DATA, Sensitivity
from rungwise.contact.solvers.planar import solve_planar
from rungwise.models.ladder import Rung
from rungwise.scene import Scene, load
from rungwise.scene.records import FREE, HINGE
from rungwise.simulation.attempt import MAX_LINEARISATIONS, TAKEN, attempt
from rungwise.simulation.differences import Assembly, Held
from rungwise.simulation.run import ModelError
from rungwise.simulation.step import SUPPORTED, solve_step

Array: TypeAlias = NDArray[np.float64]
WRT = ("q", "v", "inputs", "parameters")
_STEP, _SAME = 1e-5, 1e-11


@dataclass(frozen=True)
class StepSensitivity:
    """A step from (q, v) to `q`, `v` (n,), and its derivatives dq, dv (n, m) by what they are taken for.

    `inputs` are the speed of a prescribed coordinate and a force on any other; `parameters` are in the order
    of `names`. `contact` is the linearised contact problem: where its `weak` is not empty the derivatives are
    one-sided, for each column increased by itself. NaN where nothing determines the derivative.
    """

    q: Array
    v: Array
    dq: dict[str, Array]
    dv: dict[str, Array]
    names: tuple[str, ...]
    contact: Sensitivity


def step_sensitivity(
    scene: Scene | str | Path | Mapping[str, Any],
    model: Rung | str,
    parameters: Mapping[str, float] | None,
    q: ArrayLike,
    v: ArrayLike,
    h: float,
    *,
    wrt: Sequence[str] = WRT,
    names: Sequence[str] | None = None,
    deformation: ArrayLike | None = None,
    time: float = 0.0,
    theta: float = 1.0,
) -> StepSensitivity:
    """Take one step of length h from (q, v) and differentiate it.

    Args:
        scene, model, parameters, theta: as for `Simulation`.
        q, v: (n,) in the order of the scene's coordinates.
        wrt: which of "q", "v", "inputs", "parameters".
        names: the parameters to differentiate by; all if not given.
        deformation: (slots, 2) of contacts at the start, as `Workspace.state` has it; none if not given.
        time: at the start of the step, for what depends on it.

    Raises:
        ModelError: an argument is wrong, or the step cannot be taken as it is: no solution, a limit of travel
            reached within it.
    """
    scene = scene if isinstance(scene, Scene) else load(scene)
    values = scene.parameters(parameters)
    chosen = tuple(values) if names is None else tuple(names)
    for name in chosen:
        if name not in values:
            raise ModelError(f"names: unknown parameter {name!r}; valid: {', '.join(values) or 'none'}")
    for name in wrt:
        if name not in WRT:
            raise ModelError(f"wrt: {name!r} is none of {', '.join(WRT)}")
    here = Assembly(scene, model, values, h, theta, time)
    start = _vector("q", q, len(here.state.q)), _vector("v", v, len(here.state.q))
    strain = None if deformation is None else np.asarray(deformation, np.float64)
    if strain is not None and strain.shape != here.state.deformation.shape:
        raise ModelError(f"deformation: must have shape {here.state.deformation.shape}")
    went = _taken(here, start, strain, h)
    directions = _Directions(here, scene, model, values, chosen, tuple(wrt), start, h, theta, time)
    quantum = float(here.workspace.terms.rounding[0]) / h
    trial, turn = None, np.zeros((len(start[0]), directions.count))
    for _ in range(MAX_LINEARISATIONS):
        held, contact, speed = _solved(here, start, strain, trial)
        turn = directions.differentiate(held, contact, strain, trial, turn)
        trial = speed
        if np.abs(speed - went).max(initial=0.0) <= _SAME * np.abs(went).max(initial=0.0) + quantum:
            break
        if not here.rung[0]["metric"]:
            raise ModelError("step: it could not be repeated")
    else:
        raise ModelError("step: it could not be repeated")
    return directions.result(went, turn, held, contact)


def _vector(name: str, value: ArrayLike, size: int) -> Array:
    array = np.asarray(value, np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ModelError(f"{name}: must be {size} finite numbers, one for each coordinate")
    return array


def _taken(here: Assembly, start: tuple[Array, Array], strain: Array | None, h: float) -> Array:
    """Velocities with which the simulation moves in this step."""
    here.put(*start, strain)
    if here.set_speeds() < h:
        raise ModelError("step: a coordinate reaches the end of its travel within it; take a shorter step")
    if attempt(here.records, here.rung, here.workspace, h, h) != TAKEN:
        raise ModelError("step: no step of this length can be taken from here; take a shorter one")
    return here.workspace.scratch.v_new.copy()


def _solved(
    here: Assembly, start: tuple[Array, Array], strain: Array | None, trial: Array | None
) -> tuple[Held, Sensitivity, Array]:
    """What is held, the sensitivity of the contact problem, and all speeds of the step."""
    work, h = here.workspace, here.h
    here.place(*start, strain, trial)
    state, scratch, clock = work.state, work.scratch, work.state.clock[0]
    for _ in range(MAX_LINEARISATIONS):
        count = here.gather(trial)
        if solve_step(here.rung, h, work.terms, count, state, scratch, work.problem) != SUPPORTED:
            raise ModelError("step: it has no solution")
        if not here.widened(scratch.v_new):
            break
    n, limited = int(clock["free"]), int(clock["limited"])
    # Where forces vanish in a limit they were set to zero; the pieces need those that were found.
    solve_planar(
        work.problem, n, count, limited, scratch.mode, scratch.x, scratch.contact_force,
        scratch.limited_force, scratch.matrix, scratch.order,
    )  # fmt: skip
    problem = trim(work.problem, n, count, limited)
    contact = Sensitivity(
        problem, scratch.x[:n].copy(), scratch.contact_force[: 2 * count].copy(),
        scratch.limited_force[:limited].copy(),
    )  # fmt: skip
    return here.hold(count, problem), contact, scratch.v_new.copy()


class _Directions:
    """The columns, and the data that each changes."""

    def __init__(
        self, here: Assembly, scene: Scene, model: Rung | str, values: dict[str, float],
        names: tuple[str, ...], wrt: tuple[str, ...], start: tuple[Array, Array],
        h: float, theta: float, time: float,
    ) -> None:  # fmt: skip
        self.here, self.start, self.names = here, start, names
        n, reach = len(start[0]), float(here.state.clock[0]["reach"])
        bodies = here.records.bodies
        first = bodies["coordinate"]
        angles = [*first[bodies["motion"] == HINGE], *(first[bodies["motion"] == FREE] + 2)]
        turns = np.isin(np.arange(n), angles)
        self.length = _STEP * np.where(turns, 1.0, reach or 1.0)
        fast = max(float(np.abs(start[1]).max(initial=0.0)), 1e-3 * (reach or 1.0) / h)
        self.speed = np.full(n, _STEP * fast)
        self.columns = [(kind, i) for kind in WRT if kind in wrt
                        for i in range(len(names) if kind == "parameters" else n)]  # fmt: skip
        self.count = len(self.columns)
        self.varied: dict[int, list[tuple[float, Assembly]]] = {}
        for i, name in enumerate(names if "parameters" in wrt else ()):
            declared = scene.file.parameters[name]
            low, high = declared.range or (-np.inf, np.inf)
            size = _STEP * (abs(values[name]) or min(1.0, high - low))
            nodes = (-1.0, 1.0)
            if values[name] - size < low or values[name] + size > high:
                side = 1.0 if values[name] - size < low else -1.0
                nodes = (side, 2.0 * side)
            self.varied[i] = [
                (s * size, Assembly(scene, model, {**values, name: values[name] + s * size}, h, theta, time))
                for s in nodes
            ]

    def differentiate(
        self, held: Held, contact: Sensitivity, strain: Array | None, trial: Array | None, turn: Array
    ) -> Array:
        """Derivatives (n, m) of the speeds of the step, where those of the trial are `turn`."""
        base = self.here.data(held, *self.start, strain, trial)
        changes = [self._change(j, held, base, strain, trial, turn[:, j]) for j in range(self.count)]
        here, n = self.here, len(self.start[0])
        speeds = np.zeros((n, self.count))
        if not changes:
            return speeds
        data = {name: np.stack([change[name] for change in changes], axis=-1) for name in DATA}
        free = here.state.free[: len(contact.v)]
        for j, change in enumerate(changes):
            speeds[:, j] = change["speed"]
        speeds[free] = contact.forward(**data).v
        return speeds

    def _change(
        self,
        j: int,
        held: Held,
        base: dict[str, Array],
        strain: Array | None,
        trial: Array | None,
        turn: Array,
    ) -> dict[str, Array]:
        kind, i = self.columns[j]
        q, v = self.start
        one = np.zeros(len(q))
        prescribed = bool(self.here.state.prescribed[i]) if kind != "parameters" else False
        if kind == "parameters":
            samples = [
                (s, at.data(held, q, v, strain, None if trial is None else trial + s * turn))
                for s, at in self.varied[i]
            ]
        elif kind == "inputs" and not prescribed:
            samples = [(s, self.here.data(held, q, v, strain, None if trial is None else trial + s * turn))
                       for s in (-self.speed[i], self.speed[i])]  # fmt: skip
        else:
            one[i] = 1.0
            size = float((self.length if kind == "q" else self.speed)[i])
            nothing = np.zeros(len(q))
            moves = [one if kind == name else nothing for name in ("q", "v", "inputs")]
            samples = [
                (s, self.here.data(held, q + s * moves[0], v + s * moves[1], strain,
                                   None if trial is None else trial + s * turn, s * moves[2]))
                for s in (-size, size)
            ]  # fmt: skip
        (s, low), (t, high) = samples
        # The parabola through the base and both samples; the chord when they lie on either side alike.
        change = {
            name: ((low[name] - base[name]) * t / s - (high[name] - base[name]) * s / t) / (t - s)
            if s != -t else (high[name] - low[name]) / (t - s)
            for name in base if name != "F"
        }  # fmt: skip
        finite = np.isfinite(base["F"])
        change["F"] = np.zeros(len(base["F"]))
        change["F"][finite] = (high["F"][finite] - low["F"][finite]) / (t - s)
        change["w"][::2] += np.where(held.bounced, 0.0, change.pop("gap") / self.here.h)
        if kind == "inputs" and not prescribed and self.here.rung[0]["loads"]:
            change["c"] = change["c"] + (self.here.state.free[: len(base["c"])] == i)
        return change

    def result(self, speed: Array, turn: Array, held: Held, contact: Sensitivity) -> StepSensitivity:
        here, (q, v), theta = self.here, self.start, held.theta
        driven = here.state.prescribed.astype(bool)
        dq, dv = {}, {}
        for kind in dict.fromkeys(kind for kind, _ in self.columns):
            of = [j for j, (name, _) in enumerate(self.columns) if name == kind]
            rate = turn[:, of]
            own = np.eye(len(q))
            dq[kind] = here.h * rate + (own if kind == "q" else 0.0)
            end = (rate - (1.0 - theta) * (own if kind == "v" else 0.0)) / theta
            dv[kind] = np.where(driven[:, None], rate, end)
        end = np.where(driven, speed, (speed - (1.0 - theta) * v) / theta)
        return StepSensitivity(q + here.h * speed, end, dq, dv, self.names, contact)
