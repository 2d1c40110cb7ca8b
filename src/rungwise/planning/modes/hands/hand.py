"""A hand: chains of joints on servos whose last bodies may touch an object."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.joints.chains import Chain, chain_of
from rungwise.planning.task.task import Task
from rungwise.scene.language.lasting import names_in
from rungwise.world.carriers import Driven, Surroundings, TaskError
from rungwise.world.contract import OBJECT, ROBOT, Instance
from rungwise.world.find import world_of

MOVED = 1e-6
"""Change of a joint that shows which bodies it moves."""


@dataclass(frozen=True)
class Finger:
    """A chain of joints (k,). driven: how inputs lead it; loose (k,): joints that lead no other finger, the
    others stand still; low, high (k,): to where inputs and travel let joints go; bodies: those that it moves;
    touching: the scene's contacts of its last bodies with the object; tips: the last body in each of these;
    around: all of its contacts but those with other fingers."""

    driven: Driven
    chain: Chain
    loose: NDArray[np.bool_]
    low: Reals
    high: Reals
    bodies: frozenset[int]
    touching: tuple[int, ...]
    tips: tuple[int, ...]
    around: Ints

    def rates(self, q: Reals) -> Reals:
        """Changes (m, k) of the chain's velocities per joint at a place (n_q,), 0 of joints that stand."""
        return np.where(self.loose, self.chain.rates(q), 0.0)

    def posed(self, q: Reals, joints: Reals) -> Reals:
        """The place (n_q,) with the joints at these values (k,), within their bounds where they are loose."""
        found: Reals = np.where(self.loose, np.clip(joints, self.low, self.high), self.chain.joints(q))
        return self.chain.posed(q, found)


@dataclass(frozen=True)
class Hand:
    """Fingers about an object. columns: those of the object's velocities; between: contacts of fingers with
    each other; fixed: contacts of the object with what no finger moves."""

    around: Surroundings
    fingers: tuple[Finger, ...]
    body: int
    columns: Ints
    between: Ints
    fixed: frozenset[int]
    size: float


def hand_of(task: Task) -> Hand | None:
    """The hand of a task; None where it has fewer than two fingers that may touch an object of which the
    goal speaks, or where some input leads none of them."""
    around = world_of(task.scene).surroundings(task.parameters)
    body = _asked(task)
    if around is None or body is None or task.carriers:
        return None
    fingers = _fingers(task, around, body)
    if len(fingers) < 2:
        return None
    names, pairs = list(task.scene.template.bodies), task.scene.template.contacts
    numbers = [(names.index(a), names.index(b)) for a, b in pairs]
    owner = {own: f for f, finger in enumerate(fingers) for own in finger.bodies}
    between = [
        k for k, (a, b) in enumerate(numbers) if a in owner and b in owner and owner[a] != owner[b]
    ]  # fmt: skip
    fixed = [k for k, both in enumerate(numbers) if body in both and not owner.keys() & set(both)]
    return Hand(
        around, fingers, body, np.flatnonzero(around.owners == body), np.array(between, np.int64),
        frozenset(fixed), task.size,
    )  # fmt: skip


def _asked(task: Task) -> int | None:
    """The object of which the goal speaks; None where there are none or several."""
    roles, names = world_of(task.scene).roles(task.parameters), list(task.scene.template.bodies)
    said = names_in(task.scene.file.goal or "")
    found = [name for name, role in roles.items() if role == OBJECT and name in said]
    return names.index(found[0]) if len(found) == 1 else None


def _fingers(task: Task, around: Surroundings, body: int) -> tuple[Finger, ...]:
    """The fingers of a task that may touch an object: of the chains of joints those that are no part of
    another's."""
    here, names = world_of(task.scene).at(task.parameters), list(task.scene.template.bodies)
    roles = world_of(task.scene).roles(task.parameters)
    chains = dict[frozenset[int], Driven]()
    for name, role in roles.items():
        driven = _driven(here, name) if role == ROBOT else None
        if driven is not None:
            chains.setdefault(frozenset(driven.columns), driven)
    whole = [own for own in chains if not any(own < other for other in chains)]
    shared = frozenset[int]().union(*(a & b for a, b in combinations(whole, 2)))
    pairs = [(names.index(a), names.index(b)) for a, b in task.scene.template.contacts]
    found = (_finger(task, here.q, around, chains[own], shared, pairs, body) for own in whole)
    return tuple(finger for finger in found if finger is not None and finger.touching)


def _driven(here: Instance, name: str) -> Driven | None:
    """How servos lead a body by joints; None where they do not."""
    try:
        driven = here.driven(name, name)
    except TaskError:
        return None
    return driven if driven.by_place and (driven.links or driven.rates) else None


def _finger(
    task: Task, q: Reals, around: Surroundings, driven: Driven, shared: frozenset[int],
    pairs: list[tuple[int, int]], body: int,
) -> Finger | None:  # fmt: skip
    """A chain as a finger; None where all its joints lead others, too."""
    chain = chain_of(task, driven)
    columns = list(driven.columns)
    if chain is None:
        return None
    loose = ~np.array([bool(np.abs(row[[c in shared for c in columns]]).any()) for row in driven.led.matrix])
    if not loose.any():
        return None
    middle = driven.led.matrix @ (0.5 * (task.low + task.high)[columns]) + driven.led.zero
    reach = np.abs(driven.led.matrix) @ (0.5 * (task.high - task.low)[columns])
    low, high = (np.clip(bound, -np.pi, np.pi) if chain.hinges.all() else bound for bound in chain.bounds)
    last = np.flatnonzero(loose)[-1]
    bodies, tips = (_moved(around, chain, q, joints) for joints in (np.flatnonzero(loose), [last]))
    touching = [k for k, both in enumerate(pairs) if body in both and tips & set(both)]
    own = [k for k, (a, b) in enumerate(pairs) if (a in bodies) != (b in bodies)]
    return Finger(
        driven, chain, loose, np.maximum(low, middle - reach), np.minimum(high, middle + reach), bodies,
        tuple(touching), tuple(pairs[k][pairs[k][0] == body] for k in touching), np.array(own, np.int64),
    )  # fmt: skip


def _moved(around: Surroundings, chain: Chain, q: Reals, joints: Ints | list[np.intp]) -> frozenset[int]:
    """The bodies that joints of a chain move."""
    before, values = around.poses(q), chain.joints(q)
    found = set[int]()
    for joint in joints:
        other = values.copy()
        other[joint] += MOVED
        away = np.abs(around.poses(chain.posed(q, other)) - before).max(axis=1)
        found |= set(np.flatnonzero(away > 1e-3 * MOVED).tolist())
    return frozenset(found)
