"""The derivative of one step of a scene with respect to its start, its inputs and the scene's parameters.

The data that a step assembles are smooth while its features and decisions stay as they are: which points
touch, which contacts bounce, which coordinates have come to the end of their travel, theta, and how small the
eps of a quasistatic rung is. So the data are differenced, centrally, with features and decisions held; the
solution is then differentiated exactly (`contact.analysis.sensitivity`). A gap enters as psi / h and is not
differenced through the threshold below which it counts as zero. No step but the one from the state is solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rungwise.contact.analysis import DATA, RightHandSide, Sensitivity
from rungwise.content import ByContent
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.plain import brief
from rungwise.scene import Scene
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.scene.space import SpaceScene
from rungwise.simulation.derivatives.assembly import Assembly
from rungwise.simulation.derivatives.changes import KINDS, STATE, Base, Block, Changes
from rungwise.simulation.derivatives.space_assembly import SpaceAssembly
from rungwise.simulation.derivatives.steps import Array, Data, Held, Start, Steps
from rungwise.simulation.options import ModelError
from rungwise.wording import choices

WRT = ("q", "v", "inputs", "parameters")


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSensitivity(ByContent):
    """The state that steps lead to: `q` (n_q,), `v` (n,), `deformation` (slots, d), d = 2 directions in the
    plane; and its derivatives dq, dv (n, m), ddeformation (d slots, m) by kind of unknown: "q", "v" and
    "deformation" at the start, "inputs", which are the speed of a prescribed velocity and a force on any
    other, and "parameters" in the order of `names`. NaN where nothing determines the derivative.

    Changes of q are those of velocities' coordinates, before the steps and after them: in space a turn is a
    vector about the body's own axes, and q has more entries than dq has rows."""

    q: Array
    v: Array
    deformation: Array
    dq: dict[str, Array]
    dv: dict[str, Array]
    ddeformation: dict[str, Array]
    names: tuple[str, ...]

    __repr__ = brief


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
            space slots are in the order in which contacts are found at q, in their frames.
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
    parts, directions = each_alone(changes, wrt)
    step = differentiated(here, changes, start, directions, deadline)
    return StepSensitivity(
        **fields_of(step.end, step.state, parts), names=changes.names, contact=step.contact
    )


def prepared(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str,
    parameters: Mapping[str, float] | None, h: float | None, theta: float, wrt: Sequence[str],
    names: Sequence[str] | None, deadline: Deadline,
) -> tuple[Steps, Changes]:  # fmt: skip
    """The objects that differentiate steps of a scene, as long as its own if h is not given. Raises
    ModelError, and TimeOver."""
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
    return here, Changes(here, scene, model, values, chosen, deadline)


def each_alone(changes: Changes, wrt: Sequence[str]) -> tuple[dict[str, slice], dict[str, Array]]:
    """Where the directions by the unknowns of each kind of `wrt` are, and these directions (unknowns, m) by
    kinds, those of the state among them: in each one unknown changes by one."""
    parts, count = dict[str, slice](), 0
    for kind in (kind for kind in KINDS if kind in wrt):
        parts[kind] = slice(count, count + changes.size(kind))
        count = parts[kind].stop
    directions = {kind: np.zeros((changes.size(kind), count)) for kind in dict.fromkeys((*STATE, *parts))}
    for kind, part in parts.items():
        directions[kind][:, part] = np.eye(changes.size(kind))
    return parts, directions


def fields_of(end: Start, state: dict[str, Array], parts: dict[str, slice]) -> dict[str, Any]:
    """What a `StateSensitivity` says of an end and its derivatives along directions of these parts."""
    fields: dict[str, Any] = {}
    for name in ("q", "v", "deformation"):
        fields[name] = getattr(end, name)
        fields[f"d{name}"] = {kind: state[name][:, part] for kind, part in parts.items()}
    return fields


def started(here: Steps, q: ArrayLike, v: ArrayLike, deformation: ArrayLike | None, time: float) -> Start:
    """The start of a step. Raises ModelError naming the argument of wrong shape."""
    begun = here.begun
    like = begun.deformation.shape
    strain = begun.deformation if deformation is None else np.asarray(deformation, np.float64)
    if strain.shape != like or not np.isfinite(strain).all():
        raise ModelError(f"deformation: must have shape {like} and be finite")
    places, speeds = _vector("q", q, len(begun.q)), _vector("v", v, len(begun.v))
    return replace(begun, q=places, v=speeds, deformation=strain, time=time)


def _vector(name: str, value: ArrayLike, size: int) -> Array:
    array = np.asarray(value, np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ModelError(f"{name}: must be {size} finite numbers, one for each coordinate")
    return array


class Differentiated(NamedTuple):
    """One step: its end, the derivatives (unknowns, m) of what it hands on, by the kinds of `STATE`, along
    the directions given, and the contact problem that it solved last."""

    end: Start
    state: dict[str, Array]
    contact: Sensitivity


def differentiated(
    here: Steps, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline,
    labels: Sequence[str] = (),
) -> Differentiated:  # fmt: skip
    """Take the step from `start`, and differentiate its end along directions (unknowns of a kind, m), which
    have labels (m,) where they are fewer than the unknowns that move.

    Raises ModelError if the step cannot be taken, or has no derivative, and TimeOver.
    """
    with deadline.running(here.halt):
        return _differentiated(here, changes, start, directions, deadline, labels)


def _differentiated(
    here: Steps, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline,
    labels: Sequence[str],
) -> Differentiated:  # fmt: skip
    """See `differentiated`."""
    deadline.look()
    taken = here.taken(start)
    n, count = len(start.v), next(iter(directions.values())).shape[1]
    trial, none = None, np.zeros((n, count))
    turn, lost = none, np.zeros(count, bool)
    for held, contact, speed in here.linearised(start, taken):
        lost |= np.isnan(turn).any(axis=0)
        by = directions if trial is None else {**directions, "trial": np.where(lost, 0.0, turn)}
        base = Base(held, start, trial, here.data(held, start, trial))
        right, data = _combined(contact, base.data, changes.blocks(base, by, labels), count)
        change = contact.solved(right, limit=deadline.seconds)
        turn = data["speed"].copy()
        turn[here.free] = change.v
        trial = speed
    turn[:, lost] = np.nan
    free = np.isin(np.arange(n), here.free)[:, None]
    dv = np.where(free, (turn - (1.0 - held.theta) * directions.get("v", none)) / held.theta, turn)
    strain = _deformed(here, held, start, contact, data, change.force, directions)
    state = {
        "q": here.ended(start, taken.speed, directions.get("q", none), turn),
        "v": dv,
        "deformation": here.followed(taken, strain),
        **here.handed_on(held, data),
    }
    return Differentiated(taken.end, state, contact)


def _combined(
    contact: Sensitivity, data: Data, blocks: Iterator[Block], count: int
) -> tuple[RightHandSide, Data]:
    """The right-hand side along all directions, and the changes of other data along them."""
    right = contact.right_hand_side({"c": np.zeros((len(contact.problem.c), count))})
    own = {name: np.zeros((*data[name].shape, count)) for name in data.keys() - {*DATA, "gap"}}
    for change, size, by in blocks:
        part = contact.right_hand_side({name: change[name] for name in DATA if name in change}, size)
        right = RightHandSide(*map(np.add, right, part.along(by)))
        for name in own.keys() & change.keys():
            own[name] += change[name] @ by
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
        K, C = held.terms["contact_stiffness"][k], held.terms["contact_damping"][k]
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
