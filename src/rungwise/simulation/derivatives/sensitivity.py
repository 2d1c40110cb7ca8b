"""The derivative of one step of a scene with respect to its start, its inputs and the scene's parameters.

The data that a step assembles are smooth while its features and decisions stay as they are: which points
touch, which contacts bounce, which coordinates have come to the end of their travel, theta, and how small the
eps of a quasistatic rung is. So the data are differenced, centrally, with features and decisions held; the
solution is then differentiated exactly (`contact.analysis.sensitivity`). A gap enters as psi / h and is not
differenced through the threshold below which it counts as zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rungwise.contact.analysis import DATA, RightHandSide, Sensitivity
from rungwise.contact.step import Elimination, Sizes, Unknowns, matrix_size, solve_planar, trim
from rungwise.deadline import Deadline, go_on, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.read import load_planar
from rungwise.simulation.core.state import Trial
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.core.tolerances import LINEARISATIONS, ROUNDING
from rungwise.simulation.derivatives.assembly import Assembly, Held, Start
from rungwise.simulation.derivatives.changes import KINDS, Changes, Data, EndSensitivity
from rungwise.simulation.options import ModelError
from rungwise.simulation.planar.step.attempt import TAKEN, attempt
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.seams import is_continued
from rungwise.wording import choices

Array: TypeAlias = NDArray[np.float64]
WRT = ("q", "v", "inputs", "parameters")


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class PlanarSensitivity(EndSensitivity):
    """The `deformation` (slots, 2) beside q and v, and its derivatives ddeformation (2 slots, m); inputs are
    the speed of a prescribed coordinate and a force on any other."""

    deformation: Array
    ddeformation: dict[str, Array]


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class StepSensitivity(PlanarSensitivity):
    """A step from (q, v), and the derivatives of its end (see `PlanarSensitivity`).

    `contact` is the linearised contact problem: where its `weak` is not empty the derivatives are one-sided,
    for each column increased by itself."""

    contact: Sensitivity


@keywords
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
    limit: float | None = None,
) -> StepSensitivity:
    """Take one step of length h from (q, v) and differentiate it.

    Args:
        scene, model, parameters, theta: as for `simulate`.
        q, v: (n,) in the order of the scene's coordinates.
        wrt: which of "q", "v", "deformation", "inputs", "parameters"; all but "deformation" if not given.
        names: the parameters to differentiate by; all if not given.
        deformation: (slots, 2) of contacts at the start, as `Workspace.state` has it; none if not given.
        time: at the start of the step, for numbers that depend on time.

    Raises:
        ModelError: an argument is wrong, or the step cannot be taken as it is: no solution, a limit of travel
            reached within it.
        LimitError: `limit` seconds are over before all differences are taken.
    """
    deadline = Deadline(seconds(limit))
    with deadline.needed_for("the step was differentiated"):
        return _step_sensitivity(
            scene, model, parameters, q, v, h, wrt, names, deformation, time, theta, deadline
        )


def _step_sensitivity(
    scene: Scene | str | Path | Mapping[str, Any], model: Rung | str,
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
    scene: Scene | str | Path | Mapping[str, Any], model: Rung | str,
    parameters: Mapping[str, float] | None, h: float, theta: float, wrt: Sequence[str],
    names: Sequence[str] | None, deadline: Deadline,
) -> tuple[Assembly, Changes]:  # fmt: skip
    """The objects that differentiate steps of a scene. Raises ModelError, and TimeOver."""
    scene = load_planar(scene)
    values = scene.parameters(parameters)
    chosen = tuple(values) if names is None else tuple(names)
    for name in chosen:
        if name not in values:
            raise ModelError(f"names: unknown parameter {name!r}{choices(name, values)}")
    for kind in wrt:
        if kind not in KINDS:
            raise ModelError(f"wrt: {kind!r} is none of {', '.join(KINDS)}")
    here = Assembly(scene, model, values, h, theta)
    return here, Changes(here, scene, model, values, chosen, wrt, deadline)


def started(here: Assembly, q: ArrayLike, v: ArrayLike, deformation: ArrayLike | None, time: float) -> Start:
    """The start of a step. Raises ModelError naming the argument of wrong shape."""
    n, like = len(here.state.q), here.state.deformation
    strain = np.zeros_like(like) if deformation is None else np.asarray(deformation, np.float64)
    if strain.shape != like.shape or not np.isfinite(strain).all():
        raise ModelError(f"deformation: must have shape {like.shape} and be finite")
    return Start(_vector("q", q, n), _vector("v", v, n), strain, time)


def _vector(name: str, value: ArrayLike, size: int) -> Array:
    array = np.asarray(value, np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ModelError(f"{name}: must be {size} finite numbers, one for each coordinate")
    return array


class Differentiated(NamedTuple):
    """One step: its end, and the derivatives (n or 2 slots, m) of the end along the directions given."""

    end: Start
    dq: Array
    dv: Array
    ddeformation: Array
    contact: Sensitivity


def differentiated(
    here: Assembly, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline
) -> Differentiated:
    """Take the step from `start`, and differentiate its end along directions (unknowns of a kind, m).

    Raises ModelError if the step cannot be taken, or has no derivative, and TimeOver.
    """
    with deadline.running(here.workspace.scratch.halt):
        return _differentiated(here, changes, start, directions, deadline)


def _differentiated(
    here: Assembly, changes: Changes, start: Start, directions: dict[str, Array], deadline: Deadline
) -> Differentiated:
    """See `differentiated`."""
    deadline.look()
    went, features, end = _taken(here, start)
    n, count = len(start.q), next(iter(directions.values())).shape[1]
    quantum = float(here.workspace.terms.rounding[0]) / here.h
    trial, turn = None, np.zeros((n, count))
    for _ in range(LINEARISATIONS):
        held, contact, speed = _solved(here, start, trial)
        by = directions if trial is None else {**directions, "trial": turn}
        right, data = _combined(contact, changes.blocks(held, start, trial, by), here, count)
        change = contact.solved(right, limit=deadline.seconds)
        free = here.state.free[: len(contact.v)]
        turn = data["speed"].copy()
        turn[free] = change.v
        trial = speed
        off, size = (np.abs(changes.lever * x).max(initial=0.0) for x in (speed - went, went))
        if off <= ROUNDING * size + quantum:
            break
        if not here.rung[0]["metric"]:
            raise ModelError("step: it could not be repeated")
    else:
        raise ModelError("step: it could not be repeated")
    none = np.zeros((n, count))
    driven = here.state.prescribed.astype(bool)[:, None]
    dv = np.where(driven, turn, (turn - (1.0 - held.theta) * directions.get("v", none)) / held.theta)
    return Differentiated(
        end,
        directions.get("q", none) + here.h * turn,
        dv,
        _followed(here, features, end, _deformed(here, held, start, contact, data, change.force, directions)),
        contact,
    )


def _combined(
    contact: Sensitivity, blocks: Iterator[tuple[Data, Array]], here: Assembly, count: int
) -> tuple[RightHandSide, Data]:
    """The right-hand side along all directions, and the changes of other data along them."""
    problem = contact.problem
    right = contact.right_hand_side({"c": np.zeros((len(problem.c), count))})
    own = {"speed": np.zeros((len(here.state.q), count))}
    own |= {name: np.zeros((*problem.R.shape, count)) for name in ("stiffness", "damping")}
    for change, by in blocks:
        data = {name: change[name] for name in DATA}
        part = contact.right_hand_side(data, {name: np.abs(value) for name, value in data.items()})
        right = RightHandSide(*map(np.add, right, part.along(by)))
        for name, total in own.items():
            total += change[name] @ by
    return right, own


def _taken(here: Assembly, start: Start) -> tuple[Array, NDArray[np.int64], Start]:
    """Velocities with which the simulation moves in this step, the features of the slots before it, and its
    end."""
    here.put(start)
    before = here.state.manifolds.features.copy()
    if here.set_speeds() < here.h:
        raise ModelError("step: a coordinate reaches the end of its travel within it; take a shorter step")
    if attempt(here.records, here.rung, here.workspace, here.h, here.h) != TAKEN:
        go_on(here.workspace.scratch.halt)
        raise ModelError("step: no step of this length can be taken from here; take a shorter one")
    state = here.state
    features = state.manifolds.features.copy()
    end = Start(state.q.copy(), state.v.copy(), state.deformation.copy(), start.time + here.h, features)
    return here.workspace.scratch.v_new.copy(), before, end


def _solved(here: Assembly, start: Start, trial: Array | None) -> tuple[Held, Sensitivity, Array]:
    """The held choices, the sensitivity of the contact problem, and all speeds of the step."""
    work, h = here.workspace, here.h
    here.place(start, trial)
    state, scratch, clock = work.state, work.scratch, work.state.clock[0]
    for _ in range(LINEARISATIONS):
        count = here.gather(trial)
        if solve_step(Trial(here.rung, h, work.terms, count, state, scratch, work.problem)) != SUPPORTED:
            go_on(scratch.halt)
            raise ModelError("step: it has no solution")
        if not here.widened(scratch.v_new):
            break
    n, limited = int(clock["free"]), int(clock["limited"])
    # Where forces vanish in a limit they were set to zero; the pieces need the forces that were found.
    unknowns = Unknowns(scratch.mode, scratch.x, scratch.contact_force, scratch.limited_force)
    size = matrix_size(n, count, limited)
    room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
    solve_planar(work.problem, Sizes(n, count, limited), unknowns, room, scratch.halt)
    problem = trim(work.problem, n, count, limited)
    contact = Sensitivity(
        problem, scratch.x[:n].copy(), scratch.contact_force[: 2 * count].copy(),
        scratch.limited_force[:limited].copy(),
    )  # fmt: skip
    return here.hold(count, problem), contact, scratch.v_new.copy()


def _deformed(
    here: Assembly, held: Held, start: Start, contact: Sensitivity, data: Data, force: Array,
    directions: dict[str, Array],
) -> Array:  # fmt: skip
    """Derivatives of the deformations after the step, R (h lambda + (C - (1 - theta) h K) delta) for the
    contacts of the step; the derivatives of other slots stay."""
    slots, d = start.deformation.shape
    count = data["speed"].shape[1]
    found = directions.get("deformation", np.zeros((slots * d, count))).reshape(slots, d, count).copy()
    terms, h = here.workspace.terms, here.h
    if not here.rung[0]["compliant"]:
        return np.zeros((slots * d, count))
    lam = contact.force[: len(held.keys) * d].reshape(-1, d)
    for k, slot in enumerate(held.slots):
        K, C = terms.contact_stiffness[k], terms.contact_damping[k]
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


def _followed(here: Assembly, before: NDArray[np.int64], end: Start, found: Array) -> Array:
    """Derivatives of deformations in the slots to which their features have gone, also over seams.

    Raises ModelError where a contact that is deformed goes over to another feature.
    """
    assert end.features is not None
    slots = found.reshape(len(end.deformation), -1, found.shape[1])
    moved = np.zeros_like(slots)
    moved[len(before) :] = slots[len(before) :]
    for slot, feature in enumerate(before):
        pair = slot - slot % 2
        to = pair + np.flatnonzero(end.features[pair : pair + 2] == feature)
        if not len(to) and slots[slot].any():
            to = np.array([k for k in range(len(before)) if _is_carried(here, before, end.features, slot, k)])
        if len(to):
            moved[to[0]] = slots[slot]
        elif end.features[slot] != ABSENT and slots[slot].any():
            raise ModelError("step: a contact moves to another feature; there is no derivative here")
    return moved.reshape(found.shape)


def _is_carried(
    here: Assembly, before: NDArray[np.int64], after: NDArray[np.int64], old: int, new: int
) -> bool:
    """Whether the feature of slot `old` has come to slot `new` of another pair over a seam."""
    seams = here.workspace.seams
    if old // 2 == new // 2 or not seams.joined[0] or after[new] == ABSENT:
        return False
    fresh = after[new] not in before[new - new % 2 : new - new % 2 + 2]
    return bool(fresh and is_continued(before[old], after[new], here.state.placed.outline, seams))
