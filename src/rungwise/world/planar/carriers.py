"""Robots of a planar scene that a task leads: by their own x and y, or by the joints of an arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene import Bound, Scene
from rungwise.scene.fields.fields import Fixed, Free, Hinge
from rungwise.scene.language.expression import STACK
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.records import ALONG, ANGLE, SERVO, SPEED
from rungwise.world.carriers import Driven, Linear, Link, Servos, TaskError


class Held(NamedTuple):
    """A joint of a chain, its record (1,), and the sign with which the record's coordinate moves what is
    farther from the ground."""

    link: Link
    record: NDArray[np.void]
    sign: float


def driven(scene: Scene, name: str, bound: Bound, path: str) -> Driven:
    """How inputs place a body. Raises TaskError, at the path, for one whose x and y no two inputs drive, nor
    inputs the joints of the chain that holds it."""
    number = scene.template.bodies.index(name)
    body, own = bound.records.bodies[number], scene.file.bodies[name]
    x = int(body["coordinate"]) if isinstance(own.motion, Free) else -1
    by_joints = not any(k in own.coordinates and own.coordinates[k].drive for k in "xy")
    chains = _chains(scene, bound, name, frozenset()) if by_joints else []
    chain = chains[0] if len(chains) == 1 and x >= 0 else ()
    rows = [held.record for held in chain]
    if not by_joints and x >= 0:
        rows = [bound.records.coordinates[k : k + 1] for k in (x, x + 1)]
    columns, matrix, zero = _followed(scene, rows, bound)
    kinds, k = {int(row["drive"][0]) for row in rows}, len(rows)
    by_place = kinds == {SERVO}
    fits = by_place or (kinds == {SPEED} and not zero.any())
    if k < 2 or not fits or len(columns) != k or np.linalg.matrix_rank(matrix) < k:
        raise TaskError(f"{path}: {_wanted(name, chain, len(chains))}")
    signs = np.array([held.sign for held in chain] or [1.0] * k)
    reaches = bound.records.shapes["reach"][bound.records.shapes["body"] == number]
    stiffness, limit = (
        np.array([float(row[field][0]) if by_place else np.inf for row in rows])
        for field in ("stiffness", "limit")
    )
    servos = Servos(stiffness, limit)
    return Driven(
        body=name, places=(x, x + 1), columns=tuple(columns),
        led=Linear(signs[:, None] * matrix, signs * zero), by_place=by_place, servos=servos,
        reach=float(reaches.max(initial=0.0)), links=tuple(held.link for held in chain),
        home=np.array([body["x"], body["y"], body["angle"]]),
    )  # fmt: skip


def _wanted(name: str, chain: tuple[Held, ...], chains: int) -> str:
    """What inputs would have to drive."""
    if chains > 1:
        return f"joints hold {name} in {chains} ways; a chain of joints leads an arm"
    if len(chain) == 1:
        return f"one joint, {chain[0].link.name}, holds {name}; an arm needs two at least"
    if chain:
        names = ", ".join(held.link.name for held in chain)
        return (
            f"needs inputs, one for each of {names}, that drive their speeds, or the targets of their servos,"
            " linearly"
        )
    return (
        f"needs two inputs that drive the speeds of {name}.x and {name}.y, or the targets of their servos,"
        " linearly"
    )


def _chains(scene: Scene, bound: Bound, name: str, used: frozenset[str]) -> list[tuple[Held, ...]]:
    """The ways by which joints hold a body, each from the ground on; none where nothing holds it."""
    motion, number = scene.file.bodies[name].motion, scene.template.bodies.index(name)
    if isinstance(motion, Fixed):
        return [()]
    if not isinstance(motion, Free):
        k = int(bound.records.bodies[number]["coordinate"])
        return [(_own(bound, scene.template.coordinates[k], k, isinstance(motion, Hinge)),)]
    found = []
    for index, (joint, own) in enumerate(scene.file.joints.items()):
        if name in own.between and joint not in used:
            nearer = own.between[0] if own.between[1] == name else own.between[1]
            held = () if own.kind == "weld" else (_joint(bound, joint, index, own.between[0] == nearer),)
            found += [(*way, *held) for way in _chains(scene, bound, nearer, used | {joint})]
    return found


def _own(bound: Bound, name: str, k: int, turns: bool) -> Held:
    """The coordinate by which a body moves on the ground."""
    record = bound.records.coordinates[k : k + 1]
    body = bound.records.bodies[int(record["body"][0])]
    at, axis = (np.array([body[f"{of}_x"], body[f"{of}_y"]]) for of in ("pivot", "axis"))
    link = Link(name, not turns, at, axis, float(record["lower"][0]), float(record["upper"][0]))
    return Held(link, record, 1.0)


def _joint(bound: Bound, name: str, index: int, in_order: bool) -> Held:
    """A joint, whose second body is the farther one from the ground where they are `in_order`."""
    joint = bound.records.joints[index]
    turns = bool(bound.records.measures[3 * index + ANGLE]["held"] == 0)
    record = bound.records.measures[3 * index + (ANGLE if turns else ALONG) :][:1]
    lower, upper = float(record["lower"][0]), float(record["upper"][0])
    angle = float(bound.records.bodies[int(joint["body_a"])]["angle"])
    axis = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ [
        joint["axis_x"], joint["axis_y"],
    ]  # fmt: skip
    bounds = (lower, upper) if in_order else (-upper, -lower)
    link = Link(name, not turns, np.array([joint["at_x"], joint["at_y"]]), axis, *bounds)
    return Held(link, record, 1.0 if in_order else -1.0)


def _followed(scene: Scene, rows: list[NDArray[np.void]], bound: Bound) -> tuple[list[int], Reals, Reals]:
    """The inputs that the speeds, or the targets, of driven records follow, the matrix, and what they are
    where these inputs are 0; no inputs where they are no linear functions of them."""
    template = scene.template
    columns = [template.parameters.index(name) for name in template.inputs]

    def followed(levels: Reals, time: float = 0.0) -> Reals:
        values = bound.values.copy()
        values[columns], values[len(template.parameters)] = levels, time
        for numbers in (template.timed_speeds(), template.timed_numbers()):
            evaluate_numbers(numbers, values, np.zeros(STACK), bound.buffer)
        told = [row["drive_speed" if row["drive"][0] == SPEED else "target"][0] for row in rows]
        return np.array(told, float)

    size = len(columns)
    zero = followed(np.zeros(size))
    matrix = np.array([followed(one) - zero for one in np.eye(size)]).reshape(size, len(rows)).T
    trial = np.random.default_rng(0).uniform(-1.0, 1.0, size)
    is_linear = all(
        np.allclose(followed(trial, time), matrix @ trial + zero, rtol=1e-9, atol=0.0) for time in (1.0, 0.0)
    )
    followed(bound.values[columns])
    used = [k for k in range(size) if matrix[:, k].any()] if is_linear else []
    return used, matrix[:, used], zero
