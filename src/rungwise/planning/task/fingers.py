"""Fingers: robots that a planner by contact modes may place on objects, and what it may do with each.

A scene's `task.fingers` names them. Without it they are the robots of `task.transit`, and in a task that
leads none through free space all robots that inputs lead to touch an object; those have default values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.task.task import Task, task_of
from rungwise.scene.fields.task import Finger as FingerFields
from rungwise.world.carriers import Driven, TaskError, pair
from rungwise.world.contract import OBJECT, OUTLINES, ROBOT, Instance, Load
from rungwise.world.find import world_of

LEAST_PRESS, MOST_PRESS = 0.05, 20.0
"""Least and greatest normal force of a contact over the greatest load of the objects, if not given."""
RESERVE = 0.1
"""Part of friction that fingers keep in hand, if not given."""
OF_REACH, OF_SIZE = 0.5, 0.05
"""Greatest part of a finger's own reach and of the objects' size in its clearance, if not given."""
CROSSES = 0.01
"""Part of the scene's duration in which servos without rates cross the range of their inputs, if no speed is
given."""


@dataclass(frozen=True)
class Finger:
    """A robot that may touch objects at places that a planner chooses. Lengths, forces and times are in the
    scene's units.

    name: its body; inputs (k,): the parameters that drive it, two of x and y, or one for each joint; objects:
    bodies that it may touch; speed: of the body on its ways; press: least and greatest normal force of each
    of its contacts, None where speeds are given, which press as hard as it takes; within (2, d): least and
    greatest place of its centre, infinite where nothing bounds it; clearance: its distance from all else on
    its ways; contacts: most places of contact with objects at a time; reserve: part of friction that it keeps
    in hand (forces stay within (1 - reserve) mu); over: whether it may pass above objects, off the plane;
    lift: then the column of the input that raises it, and how high plans raise it; driven: which numbers lead
    it, and how its inputs give them.
    """

    name: str
    inputs: tuple[str, ...]
    objects: tuple[str, ...]
    speed: float
    press: tuple[float, float] | None
    within: Reals
    clearance: float
    contacts: int
    reserve: float
    over: bool
    lift: tuple[int, float] | None
    driven: Driven

    @property
    def is_rigid(self) -> bool:
        """Whether it moves at given speeds, whatever it takes."""
        return not self.driven.by_place

    @property
    def is_arm(self) -> bool:
        """Whether joints place it, not x and y of its own."""
        return len(self.driven.links) > 0 or self.within.shape[1] > 2


class Taken(NamedTuple):
    """Robots of a task that are fingers; others, each with the reason; and what should be known of them."""

    fingers: tuple[Finger, ...]
    others: dict[str, str]
    notes: tuple[str, ...]


class _Said(NamedTuple):
    """What a scene says of a finger: the path of its entry, speed, clearance, None where it says nothing,
    and the objects that it names."""

    path: str
    speed: float | None
    clearance: float | None
    objects: tuple[str, ...] = ("*",)

    @property
    def is_stated(self) -> bool:
        """Whether the task names it."""
        return self.path.startswith("task.")


def fingers_of(task: Task) -> tuple[Finger, ...]:
    """The fingers of a task, in the order of the scene's bodies. Raises TaskError: one line that names the
    field."""
    return taken(task).fingers


def stated_of(task: Task) -> dict[str, Finger]:
    """The fingers that the task itself names, by their bodies; none where it names none, or in space."""
    if not task.scene.file.task.fingers or world_of(task.scene).shapes != OUTLINES:
        return {}
    return {finger.name: finger for finger in fingers_of(task)}


def with_fingers(task: Task) -> Task:
    """The task as one that names its fingers, where inputs over time lead all its robots, each input has a
    rate, and each belongs to a finger on servos; else the task itself. So contact modes can lead it."""
    fields = task.scene.file.task
    if world_of(task.scene).shapes != OUTLINES or task.carriers or fields.fingers:
        return task
    found = fingers_of(task)
    led = {name for finger in found for name in finger.inputs}
    led |= {task.scene.template.inputs[k] for k in task.lifting}
    if not found or led != set(task.scene.template.inputs) or any(finger.is_rigid for finger in found):
        return task
    if not np.isfinite(task.rate).all():
        return task
    named = {each.name: FingerFields(speed=each.speed, clearance=each.clearance) for each in found}
    scene = task.scene.changed(task=fields.model_copy(update={"fingers": named}))
    return task_of(scene, task.parameters)


def demand_known(task: Task) -> None:
    """Raises TaskError where a finger is to do what no plan makes it do, and as `fingers_of`."""
    for finger in fingers_of(task):
        for lacks in _not_known(task, finger):
            raise TaskError(f"task.fingers: {lacks}")


def _not_known(task: Task, finger: Finger) -> Iterator[str]:
    """What a task asks of a finger that no plan makes it do."""
    if finger.over and finger.lift is None:
        yield (
            f"{finger.name} may pass over objects, off the plane; in space its joints lead it there; leave"
            " over out"
        )
    if finger.contacts > 1 and finger.is_arm and world_of(task.scene).shapes == OUTLINES:
        yield (
            f"{finger.name} may touch objects at {finger.contacts} places, and joints that turn it lead it:"
            " plans place such a finger at one; leave contacts out"
        )


def taken(task: Task) -> Taken:
    """What robots of a task are to a planner by contact modes. Raises TaskError as `fingers_of`."""
    here, found, others = world_of(task.scene).at(task.parameters), list[tuple[Finger, _Said]](), {}
    for name, said in _candidates(task):
        if isinstance(said, str):
            others[name] = said
            continue
        try:
            found.append((_finger(task, here, name, said), said))
        except TaskError as error:
            if said.is_stated:
                raise
            others[name] = str(error).removeprefix(f"{said.path}: ")
    led = {name: [f.name for f, _ in found if name in f.inputs] for name in task.scene.template.inputs}
    for finger, said in list(found):
        shared = next((name for name in finger.inputs if len(led[name]) > 1), None)
        if shared is not None:
            others[finger.name] = f"the input {shared} leads {' and '.join(led[shared])}"
            found.remove((finger, said))
            if said.is_stated:
                raise TaskError(f"{said.path}: {others[finger.name]}")
    notes = (note for finger, said in found for note in _notes(task, finger, said, here.loads))
    return Taken(tuple(finger for finger, _ in found), others, tuple(notes))


def _candidates(task: Task) -> Iterator[tuple[str, _Said | str]]:
    """Robots with what the scene says of each, or why one is none."""
    fields, numbers = task.scene.file.task, task.numbers
    carriers = {carrier.body: carrier for carrier in task.carriers}
    world, names = world_of(task.scene), task.scene.template.coordinates
    for name in [name for name, role in world.roles(task.parameters).items() if role == ROBOT]:
        own = [each for each in names if each.startswith(f"{name}.")]
        pattern = next((each for each in fields.fingers if fnmatchcase(name, each)), None)
        if world.shapes == OUTLINES and not {f"{name}.x", f"{name}.y"} <= set(own):
            yield name, f"its place is not free: {' and '.join(own) or 'nothing'} alone moves it"
        elif pattern is not None:
            path = f"task.fingers.{pattern}"
            given = (numbers[f"{path}.speed"], numbers[f"{path}.clearance"])
            yield name, _Said(path, *given, fields.fingers[pattern].objects)
        elif name in carriers:
            yield name, _Said(f"task.transit.{name}", carriers[name].speed, carriers[name].clearance)
        elif fields.fingers:
            yield name, "no pattern of task.fingers fits it"
        elif carriers:
            yield name, "task.transit does not name it"
        else:
            yield name, _Said(f"robot {name}", None, None)


def _finger(task: Task, here: Instance, name: str, said: _Said) -> Finger:
    """A robot as a finger. Raises TaskError, at the path of its entry."""
    path, numbers = said.path, task.numbers
    own = here.driven(name, path)
    objects = _objects(task, name, said)
    contacts = numbers.get(f"{path}.contacts", 1.0)
    if contacts != int(contacts):
        raise TaskError(f"{path}.contacts: must be a whole number, not {contacts:g}")
    clearance = said.clearance
    if clearance is None:
        clearance = min(OF_REACH * own.reach or math.inf, OF_SIZE * task.size)
    fields = task.scene.file.task.fingers.get(path.removeprefix("task.fingers."))
    over = fields is not None and fields.over
    return Finger(
        name=name, inputs=tuple(task.scene.template.inputs[k] for k in own.columns), objects=objects,
        speed=_speed(task, here, own) if said.speed is None else said.speed,
        press=_press(own, path, numbers, [here.loads[each] for each in objects if each in here.loads]),
        within=_within(task, own, path), clearance=clearance, contacts=int(contacts),
        reserve=numbers.get(f"{path}.reserve", RESERVE), over=over, driven=own,
        lift=_lift(task, name, path, clearance) if over else None,
    )  # fmt: skip


def _lift(task: Task, name: str, path: str, clearance: float) -> tuple[int, float] | None:
    """The column of the input that raises a finger, and how high plans raise it: by its clearance, as far as
    the input goes. None in space. Raises TaskError where no input of its own does that alone."""
    if world_of(task.scene).shapes != OUTLINES:
        return None
    names, bodies = task.scene.template.inputs, task.planar.file.bodies
    raised = bodies[name].raised
    column = names.index(raised) if isinstance(raised, str) and raised in names else -1
    alone = [other for other, body in bodies.items() if body.raised == raised] == [name]
    suits = column in task.lifting and alone and task.high[column] > 0.0 >= task.low[column]
    if not suits or task.parameters[names[column]] != 0.0:
        raise TaskError(
            f"{path}.over: bodies.{name}.raised must be an input of its own that is 0 at the start and drives"
            f" nothing else, not {raised!r}; leave raised out, and one is made"
        )
    return column, min(clearance, float(task.high[column]))


def _objects(task: Task, name: str, said: _Said) -> tuple[str, ...]:
    """The objects that a finger may touch. Raises TaskError where there are none."""
    roles, pairs = world_of(task.scene).roles(task.parameters), task.scene.template.contacts
    named = [
        each for each, role in roles.items()
        if role == OBJECT and any(fnmatchcase(each, pattern) for pattern in said.objects)
    ]  # fmt: skip
    found = tuple(each for each in named if (name, each) in pairs or (each, name) in pairs)
    if not found:
        path = said.path if said.objects == ("*",) else f"{said.path}.objects"
        which = ", ".join(named) or "an object"
        raise TaskError(f"{path}: {name} touches no object: no entry of contacts names it and {which}")
    return found


def _levers(own: Driven) -> Reals:
    """How far a finger moves at most per unit of each of what leads it (k,)."""
    if own.levers:
        return np.array(own.levers)
    arms = [1.0 if link.slides else math.dist(link.at, own.home[:2]) + own.reach for link in own.links]
    return np.array(arms or [1.0] * len(own.led.matrix))


def _speed(task: Task, here: Instance, own: Driven) -> float:
    """The speed that the bounds and rates of its inputs leave a finger in any direction."""
    columns = list(own.columns)
    low, high, rate = task.low[columns], task.high[columns], task.rate[columns]
    if not own.by_place:
        rate = np.maximum(np.abs(low), np.abs(high))
    rate = np.where(np.isfinite(rate), rate, (high - low) / (CROSSES * here.duration))
    return float((_levers(own) * (np.abs(own.led.matrix) @ rate)).min())


def _press(
    own: Driven, path: str, numbers: Mapping[str, float], loads: list[Load]
) -> tuple[float, float] | None:
    """Least and greatest normal force of a contact. Raises TaskError for such of speeds."""
    given = f"{path}.press.0" in numbers
    if not own.by_place:
        if given:
            raise TaskError(
                f"{path}.press: {own.body} moves at given speeds, which press as hard as it takes; only"
                " servos press by a given force"
            )
        return None
    if given:
        least, most = pair(numbers, f"{path}.press")
        if least > _limit(own):
            raise TaskError(f"{path}.press: servos push {own.body} with at most {_limit(own):g}")
        return least, min(most, _limit(own))
    load = max((load.force + load.friction for load in loads), default=0.0)
    if load > 0.0 and _limit(own) > LEAST_PRESS * load:
        return LEAST_PRESS * load, min(MOST_PRESS * load, _limit(own))
    levers = _levers(own)
    most = min(_limit(own), float((own.servos.stiffness / levers**2).min()) * own.reach)
    return LEAST_PRESS / MOST_PRESS * most, most


def _limit(own: Driven) -> float:
    """The greatest force that its servos push with in any direction."""
    return float((own.servos.limit / _levers(own)).min())


def _within(task: Task, own: Driven, path: str) -> Reals:
    """Least and greatest place (2, d) of a finger's centre. Raises TaskError where there is none."""
    size = 2 if world_of(task.scene).shapes == OUTLINES else 3
    found = np.repeat([[-math.inf], [math.inf]], size, axis=1)
    if own.by_place and not own.links and size == 2:
        columns = list(own.columns)
        ends = np.stack([task.low[columns], task.high[columns]])
        middle, reach = own.led.at(ends.mean(axis=0)), np.abs(own.led.matrix) @ np.ptp(ends, axis=0)
        found = np.stack([middle - reach / 2.0, middle + reach / 2.0])
    for k, axis in enumerate("xyz"[:size]):
        if f"{path}.within.{axis}.0" not in task.numbers:
            continue
        low, high = pair(task.numbers, f"{path}.within.{axis}")
        if low > found[1, k] or high < found[0, k]:
            raise TaskError(
                f"{path}.within.{axis}: {low:g} to {high:g} is out of reach: the inputs lead {own.body} to"
                f" {found[0, k]:g} to {found[1, k]:g}"
            )
        found[:, k] = max(low, found[0, k]), min(high, found[1, k])
    return found


def _notes(task: Task, finger: Finger, said: _Said, loads: Mapping[str, Load]) -> Iterator[str]:
    """What should be known of a finger before a search: what no plan makes it do, where it can only jam, and
    what it is not given."""
    yield from _not_known(task, finger)
    for name in finger.objects if finger.is_rigid else ():
        load = loads.get(name)
        if load is not None and load.force > 0.0 and load.obstacles:
            yield (
                f"{finger.name} moves at given speeds, and gravity presses {name} on"
                f" {', '.join(load.obstacles)}: where {name} cannot give way, such a finger jams; drive it by"
                " servos with a limit of force"
            )
    path = f"{said.path}.press.1"
    if finger.press is not None and task.numbers.get(path, 0.0) > finger.press[1]:
        yield f"{said.path}.press: servos push {finger.name} with at most {finger.press[1]:g}"
