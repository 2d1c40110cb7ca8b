"""The joints on servos that bring a robot's own body to where a goal asks for it, and their inverse
kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.joints.chains import Chain, chain_of
from rungwise.planning.motion.free_paths import always
from rungwise.planning.motion.placements import Placing, placed_part
from rungwise.planning.task.task import Task
from rungwise.scene.language.lasting import names_in
from rungwise.world.carriers import Driven, Surroundings, TaskError, turn_of
from rungwise.world.contract import OBJECT, ROBOT, SOLIDS, Instance
from rungwise.world.find import world_of

ITERATIONS, LONGEST, DAMPING = 40, 0.2, 1e-6
"""Steps of inverse kinematics, how far a joint goes in one, and their damping, over the trace of their
matrix."""
DIFFERENCE, CLOSE = 1e-6, 1e-7
"""Change of joints for differences of poses; how near poses come, in parts of the size and in radians."""
FREE = 6
"""Velocities of a free body."""
CROSSED = 0.2
"""Part of the scene's duration in which an input crosses its range that is given no rate."""


@dataclass(frozen=True)
class Arm:
    """Joints (k,) on servos that lead bodies of which a goal speaks.

    chains: those of the joints, and how inputs lead each; asked: the bodies by their numbers; objects
    (n_v,): whether a velocity belongs to an object of which the goal speaks as well; moved: all bodies
    that the joints move; low, high (k,): to where inputs and travel let joints go; rates (k,): how fast
    their targets may change."""

    task: Task
    around: Surroundings
    chains: tuple[tuple[Chain, Driven], ...]
    asked: Ints
    objects: Ints
    moved: Ints
    low: Reals
    high: Reals
    rates: Reals

    @property
    def columns(self) -> Ints:
        """The columns of the joints' velocities (k,)."""
        return np.concatenate([chain.columns for chain, _ in self.chains])

    @property
    def places(self) -> Ints:
        """The columns of the joints' coordinates (k,)."""
        return np.concatenate([chain.places for chain, _ in self.chains])

    def posed(self, q: Reals, joints: Reals) -> Reals:
        """The place (n_q,) with the joints at these values (k,), within their bounds."""
        found: Reals = q.copy()
        found[self.places] = np.clip(joints, self.low, self.high)
        return found

    def poses(self, q: Reals) -> Reals:
        """Poses (b, 7) of the bodies of which the goal speaks."""
        return self.around.poses(q)[self.asked]

    def brought(self, q: Reals, aims: Reals) -> tuple[Reals, float]:
        """The place (n_q,) from which steps of least squares bring these bodies to poses (b, 7), and by
        how much their origins miss these. Turns are made as far as the joints can without giving up the
        places of origins (Nakamura and Hanafusa 1987)."""
        found, missed = q, np.inf
        for _ in range(ITERATIONS):
            ways, turns = self._off(found, aims)
            missed = float(np.linalg.norm(ways))
            if missed < CLOSE * self.task.size and float(np.linalg.norm(turns)) < CLOSE:
                break
            step = self._step(found, ways.ravel(), turns.ravel())
            joints = found[self.places] + np.clip(step, -LONGEST, LONGEST)
            after = self.posed(found, joints)
            if np.abs(after - found).max() < 0.1 * CLOSE:
                break
            found = after
        return found, missed

    def _off(self, q: Reals, aims: Reals) -> tuple[Reals, Reals]:
        """What is left to poses (b, 7): ways (b, 3) and turns (b, 3) about the world's axes."""
        now = self.poses(q)
        turns = [turn_between(a, b) for a, b in zip(now[:, 3:], aims[:, 3:], strict=True)]
        return aims[:, :3] - now[:, :3], np.array(turns)

    def _step(self, q: Reals, ways: Reals, turns: Reals) -> Reals:
        """Changes of the joints (k,): least squares for ways, then for turns among those that keep ways."""
        joints, now = q[self.places], self.poses(q)
        moving, turning = np.zeros((2, len(ways), len(joints)))
        for k in range(len(joints)):
            other = q.copy()
            other[self.places[k]] += DIFFERENCE
            after = self.poses(other)
            moving[:, k] = (after[:, :3] - now[:, :3]).ravel() / DIFFERENCE
            bent = [turn_between(a, b) for a, b in zip(now[:, 3:], after[:, 3:], strict=True)]
            turning[:, k] = np.ravel(bent) / DIFFERENCE
        inverse = _damped(moving)
        first = inverse @ ways
        kept = np.eye(len(joints)) - inverse @ moving
        second = _damped(turning @ kept) @ (turns - turning @ first)
        return np.asarray(first + kept @ second)

    def levels(self, q: Reals, before: Reals) -> Reals:
        """Inputs (u,) with which servos hold the joints at a place (n_q,) against the arm's weight, as far
        as the inputs go, beside others (u,)."""
        loads, found = self.around.loads(q), before.copy()
        for chain, driven in self.chains:
            wanted = q[chain.places] - loads[chain.columns] / driven.servos.stiffness
            found[list(driven.columns)] = driven.levels(wanted[None], wanted[None])[0]
        return np.clip(found, self.task.low, self.task.high)

    @property
    def lag(self) -> float:
        """By how much time joints lag behind their targets at most."""
        return max(driven.servos.lag for _, driven in self.chains)


def turn_between(a: Reals, b: Reals) -> Reals:
    """The turn (3,) about the world's axes, as a vector, that leads from one quaternion (4,) to another."""
    turned = turn_of(b) @ turn_of(a).T
    axis = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(axis)), 0.5 * (float(np.trace(turned)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-9:
        return np.asarray(axis * (angle / sine))
    if cosine > 0.0:
        return axis
    values, vectors = np.linalg.eigh(turned)
    return np.asarray(angle * vectors[:, int(np.abs(values - 1.0).argmin())])


def turned_by(quaternion: Reals, turn: Reals) -> Reals:
    """A quaternion (4,) after a turn (3,) about the world's axes."""
    angle = float(np.linalg.norm(turn))
    w, half = np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * turn
    a, b = quaternion[0], quaternion[1:]
    return np.concatenate([[w * a - half @ b], w * b + a * half + np.cross(half, b)])


def _damped(matrix: Reals) -> Reals:
    """The damped pseudoinverse (k, m) of a matrix (m, k)."""
    square = matrix @ matrix.T
    damping = DAMPING * float(np.trace(square)) + 1e-300
    return np.asarray(matrix.T @ np.linalg.inv(square + damping * np.eye(len(square))))


def arm_of(task: Task, start: Reals) -> Arm | None:
    """The arm of a task in space, from a place (n_q,) on, whose goal says where bodies are that inputs lead,
    by the targets of servos of their joints; None where it does not, where robots push objects by fingers or
    in transit, or where free bodies have to be elsewhere, to which reaching does not bring them."""
    world, goal = world_of(task.scene), placed_part(task.scene.file.goal or "")
    if world.shapes != SOLIDS or goal is None or task.carriers or task.scene.file.task.fingers:
        return None
    around, roles, names = world.surroundings(task.parameters), world.roles(task.parameters), names_in(goal)
    bodies = list(task.scene.template.bodies)
    asked = [bodies.index(name) for name, role in roles.items() if role == ROBOT and name in names]
    if around is None or not asked:
        return None
    led = [
        each for each in _chains(task, roles) if set(asked) & set(around.moved_by(each[0].columns).tolist())
    ]
    if not led:
        return None
    moved = np.unique(np.concatenate([around.moved_by(chain.columns) for chain, _ in led]))
    if not set(asked) <= set(moved.tolist()):
        return None
    owners = [bodies[owner] for owner in around.owners.tolist()]
    objects = [k for k, name in enumerate(owners) if roles[name] == OBJECT and name in names]
    free = [k for k in objects if owners.count(owners[k]) == FREE]
    if free and not _holds_with(task, start, np.setdiff1d(np.arange(len(owners)), free)):
        return None
    bounds = [_bounds(task, chain, driven) for chain, driven in led]
    low, high, rates = (np.concatenate(each) for each in zip(*bounds, strict=True))
    return Arm(
        task,
        around,
        tuple(led),
        np.array(asked, np.int64),
        np.array(objects, np.int64),
        moved,
        low,
        high,
        rates,
    )


def _holds_with(task: Task, start: Reals, loose: Ints) -> bool:
    """Whether a place at the goal was found to which these velocities (k,) alone lead, overlaps aside."""
    placing = Placing(task, task.scene, start, loose=loose)
    found = placing.goals(np.random.default_rng(0), always, apart=False)
    return len(found.places) > 0


def _chains(task: Task, roles: dict[str, str]) -> list[tuple[Chain, Driven]]:
    """Chains of joints on servos that are no part of another's."""
    here, found = world_of(task.scene).at(task.parameters), dict[frozenset[int], Driven]()
    for name, role in roles.items():
        driven = _driven(here, name) if role == ROBOT else None
        if driven is not None:
            found.setdefault(frozenset(driven.columns), driven)
    whole = [driven for own, driven in found.items() if not any(own < other for other in found)]
    chains = [(chain_of(task, driven), driven) for driven in whole]
    return [(chain, driven) for chain, driven in chains if chain is not None]


def _driven(here: Instance, name: str) -> Driven | None:
    """How servos lead a body by joints; None where they do not."""
    try:
        driven = here.driven(name, name)
    except TaskError:
        return None
    return driven if driven.by_place and driven.rates else None


def _bounds(task: Task, chain: Chain, driven: Driven) -> tuple[Reals, Reals, Reals]:
    """Least and greatest places of joints (k,), and how fast their targets may change."""
    columns, matrix = list(driven.columns), np.abs(driven.led.matrix)
    ends = driven.led.matrix @ (0.5 * (task.low + task.high)[columns]) + driven.led.zero
    reach = matrix @ (0.5 * (task.high - task.low)[columns])
    duration = world_of(task.scene).at(task.parameters).duration
    usual = (task.high - task.low)[columns] / (CROSSED * duration)
    rate = np.where(np.isfinite(task.rate[columns]), task.rate[columns], usual)
    low, high = (np.where(chain.hinges, np.clip(each, -np.pi, np.pi), each) for each in chain.bounds)
    return np.maximum(low, ends - reach), np.minimum(high, ends + reach), matrix @ rate
