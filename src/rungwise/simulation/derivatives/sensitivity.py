"""The derivative of one step of a scene with respect to its start, its inputs and the scene's parameters.

The data that a step assembles are smooth while its features and decisions stay as they are: which points
touch, which contacts bounce, which coordinates have come to the end of their travel, theta, and how small the
eps of a quasistatic rung is. So the data are differenced, centrally, with features and decisions held; the
solution is then differentiated exactly (`contact.analysis.sensitivity`). A gap enters as psi / h and is not
differenced through the threshold below which it counts as zero. No step but the one from the state is solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rungwise.contact.analysis import DATA, RightHandSide, Sensitivity
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.scene.space import SpaceScene
from rungwise.simulation.derivatives.assembly import Assembly
from rungwise.simulation.derivatives.changes import KINDS, Block, Changes, EndSensitivity
from rungwise.simulation.derivatives.space_assembly import SpaceAssembly
from rungwise.simulation.derivatives.steps import Array, Data, Held, Start, Steps
from rungwise.simulation.options import ModelError
from rungwise.wording import choices

WRT = ("q", "v", "inputs", "parameters")


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class StateSensitivity(EndSensitivity):
    """The `deformation` (slots, d) beside q and v, d = 2 directions in the plane, and its derivatives
    ddeformation (d slots, m); inputs are the speed of a prescribed velocity and a force on any other.

    Changes of q are those of velocities' coordinates, before the step and after it: in space a turn is a
    vector about the body's own axes, and q has more entries than dq has rows."""

    deformation: Array
    ddeformation: dict[str, Array]


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class StepSensitivity(StateSensitivity):
    """A step from (q, v), and the derivatives of its end (see `StateSensitivity`).

    `contact` is the linearised contact problem: where its `weak` is not empty the derivatives are one-sided,
    for each column increased by itself."""

    contact: Sensitivity


@keywords
def step_sensitivity(
    scene: AnyScene | str | Path | Mapping[str, Any],
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
    limit: float | None = None,
) -> StepSensitivity:
    """Take one step of length h from (q, v) and differentiate it.

    Args:
        scene, model, parameters, theta: as for `simulate`.
        q, v: (n_q,), (n,) in the order of the scene's coordinates and velocities.
        wrt: which of "q", "v", "deformation", "inputs", "parameters"; all but "deformation" if not given.
        names: the parameters to differentiate by; all if not given.
        deformation: (slots, d) of contacts at the start, as `Workspace.state` has it; none if not given. In
            space slots are in the order in which MuJoCo finds contacts at q, in its frames.
        time: at the start of the step, for numbers that depend on time.

    Raises:
        ModelError: an argument is wrong, or the step cannot be taken as it is: no solution, a limit of travel
            reached within it; or a contact changes its feature with an unknown, which is named.
        LimitError: `limit` seconds are over before all differences are taken.
    """
    deadline = Deadline(seconds(limit))
    with deadline.needed_for("the step was differentiated"):
        return _step_sensitivity(
            scene, model, parameters, q, v, h, wrt, names, deformation, time, theta, deadline
        )


def _step_sensitivity(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str,
    parameters: Mapping[str, float] | None, q: ArrayLike, v: ArrayLike, h: float, wrt: Sequence[str],
    names: Sequence[str] | None, deformation: ArrayLike | None, time: float, theta: float,
    deadline: Deadline,
) -> StepSensitivity:  # fmt: skip
    """See `step_sensitivity`. Raises TimeOver."""
    here, changes = prepared(scene, model, parameters, h, theta, wrt, names, deadline)
    start = started(here, q, v, deformation, time)
    sizes = [changes.size(kind) for kind in changes.kinds]
    first = np.concatenate([[0], np.cumsum(sizes)])
    directions = {
        kind: np.eye(size, first[-1], k) for kind, size, k in zip(changes.kinds, sizes, first, strict=False)
    }
    step = differentiated(here, changes, start, directions, deadline)
    parts = {kind: slice(a, b) for kind, a, b in zip(changes.kinds, first, first[1:], strict=False)}
    dq, dv, strain = (
        {kind: of[:, part] for kind, part in parts.items()} for of in (step.dq, step.dv, step.ddeformation)
    )
    return StepSensitivity(
        q=step.end.q, v=step.end.v, deformation=step.end.deformation, dq=dq, dv=dv, ddeformation=strain,
        names=changes.names, contact=step.contact,
    )  # fmt: skip


def prepared(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str,
    parameters: Mapping[str, float] | None, h: float, theta: float, wrt: Sequence[str],
    names: Sequence[str] | None, deadline: Deadline,
) -> tuple[Steps, Changes]:  # fmt: skip
    """The objects that differentiate steps of a scene. Raises ModelError, and TimeOver."""
    scene = load(scene)
    values = scene.parameters(parameters)
    chosen = tuple(values) if names is None else tuple(names)
    for name in chosen:
        if name not in values:
            raise ModelError(f"names: unknown parameter {name!r}{choices(name, values)}")
    for kind in wrt:
        if kind not in KINDS:
            raise ModelError(f"wrt: {kind!r} is none of {', '.join(KINDS)}")
    here: Steps
    if isinstance(scene, Scene):
        here = Assembly(scene, model, values, h, theta)
    elif isinstance(scene, SpaceScene):
        here = SpaceAssembly(scene, model, values, h, theta)
    else:
        raise ModelError(f"scene: derivatives of steps do not work for {scene.name}")
    return here, Changes(here, scene, model, values, chosen, wrt, deadline)


def started(here: Steps, q: ArrayLike, v: ArrayLike, deformation: ArrayLike | None, time: float) -> Start:
    """The start of a step. Raises ModelError naming the argument of wrong shape."""
    like = here.shape
    strain = np.zeros(like) if deformation is None else np.asarray(deformation, np.float64)
    if strain.shape != like or not np.isfinite(strain).all():
        raise ModelError(f"deformation: must have shape {like} and be finite")
    return Start(_vector("q", q, len(here.begun[0])), _vector("v", v, len(here.lever)), strain, time)


def _vector(name: str, value: ArrayLike, size: int) -> Array:
    array = np.asarray(value, np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ModelError(f"{name}: must be {size} finite numbers, one for each coordinate")
    return array


class Differentiated(NamedTuple):
    """One step: its end, and the derivatives (n or slots d, m) of the end along the directions given."""

    end: Start
    dq: Array
    dv: Array
    ddeformation: Array
    contact: Sensitivity


def differentiated(
    here: Steps, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline
) -> Differentiated:
    """Take the step from `start`, and differentiate its end along directions (unknowns of a kind, m).

    Raises ModelError if the step cannot be taken, or has no derivative, and TimeOver.
    """
    with deadline.running(here.halt):
        return _differentiated(here, changes, start, directions, deadline)


def _differentiated(
    here: Steps, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline
) -> Differentiated:
    """See `differentiated`."""
    deadline.look()
    taken = here.taken(start)
    n, count = len(start.v), next(iter(directions.values())).shape[1]
    trial, none = None, np.zeros((n, count))
    turn, lost = none, np.zeros(count, bool)
    for held, contact, speed in here.linearised(start, taken):
        lost |= np.isnan(turn).any(axis=0)
        by = directions if trial is None else {**directions, "trial": np.where(lost, 0.0, turn)}
        right, data = _combined(contact, changes.blocks(held, start, trial, by), here, count)
        change = contact.solved(right, limit=deadline.seconds)
        turn = data["speed"].copy()
        turn[here.free] = change.v
        trial = speed
    turn[:, lost] = np.nan
    free = np.isin(np.arange(n), here.free)[:, None]
    dv = np.where(free, (turn - (1.0 - held.theta) * directions.get("v", none)) / held.theta, turn)
    strain = _deformed(here, held, start, contact, data, change.force, directions)
    return Differentiated(
        taken.end,
        here.ended(start, taken.speed, directions.get("q", none), turn),
        dv,
        here.followed(taken, strain),
        contact,
    )


def _combined(
    contact: Sensitivity, blocks: Iterator[Block], here: Steps, count: int
) -> tuple[RightHandSide, Data]:
    """The right-hand side along all directions, and the changes of other data along them."""
    problem = contact.problem
    right = contact.right_hand_side({"c": np.zeros((len(problem.c), count))})
    own = {"speed": np.zeros((len(here.lever), count))}
    own |= {name: np.zeros((*problem.R.shape, count)) for name in ("stiffness", "damping")}
    for change, size, by in blocks:
        part = contact.right_hand_side({name: change[name] for name in DATA}, size)
        right = RightHandSide(*map(np.add, right, part.along(by)))
        for name, total in own.items():
            total += change[name] @ by
    return right, own


def _deformed(
    here: Steps, held: Held, start: Start, contact: Sensitivity, data: Data, force: Array,
    directions: dict[str, Array],
) -> Array:  # fmt: skip
    """Derivatives of the deformations after the step, R (h lambda + (C - (1 - theta) h K) delta) for the
    contacts of the step; the derivatives of other slots stay."""
    slots, d = start.deformation.shape
    count = data["speed"].shape[1]
    found = directions.get("deformation", np.zeros((slots * d, count))).reshape(slots, d, count).copy()
    h = here.h
    if not here.rung[0]["compliant"]:
        return np.zeros((slots * d, count))
    lam = contact.force[: len(held.slots) * d].reshape(-1, d)
    for k, slot in enumerate(held.slots):
        K, C = held.stiffness[k], held.damping[k]
        if not np.isfinite(K).all():
            continue
        pushed = bool((lam[k] != 0.0).any())
        theta, early = (held.theta, (1.0 - held.theta) * h) if pushed else (1.0, 0.0)
        dK, dC = data["stiffness"][k], data["damping"][k]
        delta, own = start.deformation[slot], found[slot].copy()
        soft = theta * h * K + C
        after = np.linalg.solve(soft, h * lam[k] + (C - early * K) @ delta)
        push = h * force[k * d : (k + 1) * d] + (C - early * K) @ own
        push += np.einsum("ijm,j->im", dC - early * dK, delta)
        push -= np.einsum("ijm,j->im", theta * h * dK + dC, after)
        found[slot] = np.linalg.solve(soft, push)
    return found.reshape(slots * d, count)
