"""A scene's task at one instance: bounds, distances, and the scene that a search runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import Deadline, LimitError, seconds
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.planning.task.reserve import search_scene
from rungwise.scene import InvalidScene, Scene
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.task import Task as TaskFields
from rungwise.scene.language.expression import STACK, Programs, evaluate
from rungwise.scene.read import load
from rungwise.simulation import options
from rungwise.simulation.state import State
from rungwise.world.carriers import Carrier, TaskError, pair, pushes_of
from rungwise.world.contract import OUTLINES, ROBOT, Instance
from rungwise.world.find import world_of
from rungwise.world.margins import ask, geometry

ROUNDING = 1e-9
"""Part of the ends of a range by which values may lie outside it."""
COASTS = 0.01
"""Part of their size by which objects may coast in a task that counts as slow."""
STILL, WAITS = 1e-2, 10.0
"""Part of the robots' speed below which objects rest, and how many longest pushes robots wait for them."""
PUSHES, LEAN = (0.05, 5.0), math.pi / 4.0
"""Lengths of pushes over the objects' size, and how far they lean, of robots named as fingers alone."""
DRAWS = 1000
"""Most draws for each instance or sample wanted."""


@dataclass(frozen=True)
class Task:
    """The task of a scene at one instance.

    scene: the scene as given; search: the same with the goal tightened by the reserve, and with the
    conditions to keep out of as unsafe; parameters: of the instance; low, high, rate (u,): of the inputs;
    duration: least and greatest of a move without transit; moves: least and greatest number; weights (n,):
    of coordinates in distances, 0 for robots; numbers: of the task, by their paths; size: how far the
    largest object reaches from its centre; slides: whether all objects lie on supports; is_slow: whether
    robots push these so slowly that nothing coasts;
    lasting: for how long some part of the goal must hold, at most;
    turns (r, 4): columns of quaternions; rates (n_v,): weights of velocities in speeds of objects;
    tolerance: of the scene, in its unit of length.
    """

    scene: AnyScene
    search: AnyScene
    parameters: dict[str, float]
    low: Reals
    high: Reals
    rate: Reals
    duration: tuple[float, float]
    moves: tuple[int, int]
    carriers: tuple[Carrier, ...]
    weights: Reals
    numbers: dict[str, float]
    size: float
    slides: bool
    is_slow: bool
    turns: Ints
    rates: Reals
    tolerance: float
    lasting: float

    @property
    def still(self) -> float:
        """Speed below which objects count as at rest."""
        return STILL * min(self._speeds)

    @property
    def fastest(self) -> float:
        """The speed of the fastest robot that is led; 0 where none is."""
        return max(self._speeds, default=0.0)

    @property
    def _speeds(self) -> list[float]:
        """The speeds of robots that are led: of carriers, else of the fingers that the task names."""
        named = [self.numbers[f"task.fingers.{pattern}.speed"] for pattern in fields_of(self.scene).fingers]
        return [carrier.speed for carrier in self.carriers] or named

    @property
    def at_rest(self) -> str:
        """The condition that objects are at rest."""
        names = world_of(self.scene).velocities
        each = [
            f"abs(speed({name})) * {rate!r} <= {self.still!r}"
            for name, rate in zip(names, self.rates.tolist(), strict=True) if rate > 0.0
        ]  # fmt: skip
        return " and ".join(each)

    def resting(self, q: Reals) -> Reals:
        """The state (1, n_q + n_v) at rest at a place (n_q,), as questions take it."""
        return np.concatenate([q, np.zeros(len(self.rates))])[None]

    @property
    def patience(self) -> float:
        """How long robots wait at most for objects to rest."""
        farthest = PUSHES[1] * self.size / min(self._speeds)
        return WAITS * max((carrier.push[1] / carrier.speed for carrier in self.carriers), default=farthest)

    @property
    def span(self) -> float | None:
        """How long a run lasts of which moves are parts, where objects coast on after pushes at given speeds:
        an error of their speed counts by how far it leads. None where they do not."""
        coasts = self.slides and self.carriers and not self.is_slow and not self.by_place
        return self.patience if coasts else None

    def moving(self, v: Reals) -> NDArray[np.bool_]:
        """Whether objects move at velocities (m, n_v)."""
        speeds = np.abs(v) * self.rates
        return np.asarray((speeds > self.still).any(axis=1))

    def held(self, levels: Reals) -> Reals:
        """Inputs (m, u) with which robots hold still, after inputs `levels` (m, u)."""
        found = levels.copy()
        for carrier in self.carriers:
            if not carrier.by_place:
                nowhere = np.zeros((len(levels), len(carrier.places)))
                found[:, list(carrier.columns)] = carrier.levels(nowhere, nowhere)
        return found

    @property
    def free(self) -> Ints:
        """Columns of the inputs that no carrier uses, and that do not only raise robots off the plane."""
        return np.array([k for k in self._unled if k not in self.lifting], np.int64)

    @property
    def _unled(self) -> list[int]:
        """Columns of the inputs that no carrier uses."""
        used = {column for carrier in self.carriers for column in carrier.columns}
        return [k for k in range(len(self.low)) if k not in used]

    @property
    def lifting(self) -> frozenset[int]:
        """Columns of the inputs that only raise robots off the plane."""
        if world_of(self.scene).shapes != OUTLINES:
            return frozenset()
        readers = self.planar.template.readers
        return frozenset(
            k for k, name in enumerate(self.scene.template.inputs)
            if readers[name] and all(path.endswith(".raised") for path in readers[name])
        )  # fmt: skip

    @property
    def is_led(self) -> bool:
        """Whether robots lead objects: where no support holds these, or the task says which are fingers, and
        servos or joints drive these; given speeds push."""
        named = bool(fields_of(self.scene).fingers) and (self.by_place or not self.carriers)
        if world_of(self.scene).shapes != OUTLINES:
            return named
        return named or (bool(self.carriers) and not self.slides)

    @property
    def by_place(self) -> bool:
        """Whether robots are led by the targets of servos, and so by ramps."""
        return any(carrier.by_place for carrier in self.carriers)

    @property
    def before(self) -> Reals:
        """Inputs (u,) before the first move: those of the instance, 0 where a carrier uses them."""
        held, unled = np.zeros(len(self.low)), self._unled
        held[unled] = [self.parameters[self.scene.template.inputs[k]] for k in unled]
        return held

    @property
    def planar(self) -> Scene:
        """The scene, where it is planar. Raises TaskError for one of another world."""
        return in_plane(self.scene)

    def allows(self, levels: Reals) -> NDArray[np.bool_]:
        """Whether inputs (..., u) keep their bounds, up to rounding."""
        slack = ROUNDING * (np.abs(self.low) + np.abs(self.high))
        return np.asarray(((levels >= self.low - slack) & (levels <= self.high + slack)).all(axis=-1))

    def away(self, q: Reals, aim: Reals) -> Reals:
        """Distances (m,) of objects at places (m, n) from where they are at `aim` (n,)."""
        return np.asarray(np.linalg.norm(self.off(q, aim), axis=1))

    def off(self, q: Reals, aim: Reals) -> Reals:
        """The parts (m, n) of these distances along each coordinate."""
        change = q - aim
        for columns in self.turns:
            other = q[:, columns] + aim[columns]  # a quaternion and its negative are the same turn
            nearer = np.linalg.norm(other, axis=1) < np.linalg.norm(change[:, columns], axis=1)
            change[np.ix_(nearer, columns)] = other[nearer]
        return np.asarray(change * self.weights)

    def cost(self, time: Reals | float, work: Reals | float, moves: Ints | int) -> Reals:
        """The task's cost of plans of these durations and this work of drives."""
        weights = [self.numbers[f"task.cost.{name}"] for name in ("time", "work", "moves")]
        return np.asarray(weights[0] * time + weights[1] * work + weights[2] * moves)

    def with_reserve(self, reserve: float) -> Task:
        """The same task with another reserve of its goal."""
        numbers = {**self.numbers, "task.reserve": reserve}
        search = search_scene(self.scene, fields_of(self.scene), reserve)
        return replace(self, numbers=numbers, search=search)


def task_of(scene: AnyScene, parameters: Mapping[str, float] | None = None) -> Task:
    """The task of a scene at one instance. Raises TaskError and SceneError."""
    fields = fields_of(scene)
    if scene.file.goal is None:
        raise TaskError("goal: the scene has none; a plan needs one")
    if not scene.template.inputs:
        raise TaskError("inputs: the scene has none; name the parameters that a plan may change over time")
    values = scene.parameters(parameters)
    numbers = numbers_at(scene, values)
    carriers: tuple[Carrier, ...] = ()
    here = world_of(scene).at(values)
    own, stops = here.moved, here.stops
    carriers = tuple(_carrier(here, name, numbers) for name in fields.transit)
    carriers += tuple(_of_fingers(scene, here, numbers))
    if len({carrier.by_place for carrier in carriers}) > 1:
        raise TaskError("task.transit: either all robots are led by speeds, or all by the targets of servos")
    low, high, rate = _bounds(scene, fields, numbers)
    duration = (0.0, here.duration) if fields.duration is None else pair(numbers, "task.duration")
    weights = [numbers.get(f"task.weights.{name}", 0.0) for name in scene.template.coordinates]
    return Task(
        scene=scene, search=search_scene(scene, fields, numbers["task.reserve"]), parameters=values,
        numbers=numbers, low=low, high=high, rate=rate, duration=duration,
        moves=(int(fields.moves[0]), int(fields.moves[1])), carriers=carriers,
        weights=np.array(weights) if fields.weights else own.weights, size=own.size,
        slides=stops is not None,
        is_slow=stops is not None and _is_slow(stops, carriers, own.size),
        turns=own.turns, rates=own.rates, tolerance=here.tolerance,
        lasting=_lasting(scene, values),
    )  # fmt: skip


def _carrier(here: Instance, name: str, numbers: Mapping[str, float]) -> Carrier:
    """A robot to lead through free space. Raises TaskError where inputs lead none, and for planar arms."""
    path = f"task.transit.{name}"
    own = here.driven(name, path)
    if own.links:
        raise TaskError(f"{path}: joints lead {name}; robots with transit have two inputs for their x and y")
    return Carrier(**vars(own), **pushes_of(name, numbers))


def _of_fingers(scene: AnyScene, here: Instance, numbers: Mapping[str, float]) -> Iterator[Carrier]:
    """Robots that a task names as fingers alone, as those that it leads through free space; arms in the plane
    are not led so. Raises TaskError for one that inputs do not lead."""
    fields, world = fields_of(scene), world_of(scene)
    for name, role in world.roles().items():
        pattern = next((each for each in fields.fingers if fnmatchcase(name, each)), None)
        is_free = world.shapes != OUTLINES or {f"{name}.x", f"{name}.y"} <= set(scene.template.coordinates)
        if role != ROBOT or pattern is None or name in fields.transit or not is_free:
            continue
        path = f"task.fingers.{pattern}"
        own = here.driven(name, path)
        if not own.links:
            push = (PUSHES[0] * here.moved.size, PUSHES[1] * here.moved.size)
            speed, clearance = numbers[f"{path}.speed"], numbers[f"{path}.clearance"]
            yield Carrier(**vars(own), speed=speed, clearance=clearance, push=push, lean=LEAN)


def _is_slow(stops: Reals, carriers: tuple[Carrier, ...], size: float) -> bool:
    """Whether robots push objects on supports at given speeds v so slowly that these coast by no more than a
    part `COASTS` of their size: v^2 / 2 over the friction force per mass, `stops`."""
    if not carriers or any(carrier.by_place for carrier in carriers):
        return False
    fastest = max(carrier.speed for carrier in carriers)
    return bool((0.5 * fastest**2 <= COASTS * size * stops).all())


def in_plane(scene: AnyScene) -> Scene:
    """A planar scene. Raises TaskError for one of another world."""
    if world_of(scene).shapes != OUTLINES:
        raise TaskError(f"scene: {scene.name} is not planar; this works for planar scenes only")
    return cast(Scene, scene)


def fields_of(scene: AnyScene) -> TaskFields:
    """The scene's task as written. Raises TaskError where there is none."""
    if scene.file.task is None:
        raise TaskError("task: the scene has none; add what a planner may do (see the scene's reference)")
    fields: TaskFields = scene.file.task
    return fields


@keywords
def instances(
    scene: AnyScene | str | Path | Mapping[str, Any],
    seed: int,
    count: int = 1,
    *,
    limit: float | None = None,
) -> list[dict[str, float]]:
    """Parameters of `count` instances of the scene's task, drawn from `seed`. Raises TaskError where too few
    draws fit the task's `where` with bodies apart, and LimitError where `limit` seconds are over before there
    are so many."""
    deadline = Deadline(seconds(limit))
    loaded, number = load(scene), options.count("count", count, 1)
    fields, found = fields_of(loaded), list[dict[str, float]]()
    rng = np.random.default_rng(options.count("seed", seed, 0))
    for _ in range(DRAWS * number):
        if len(found) == number:
            return found
        if deadline.is_over:
            raise LimitError(f"limit: {deadline.words}, when {len(found)} of {number} instances were drawn")
        values = drawn(loaded, "instances", loaded.parameters(), rng)
        if values is not None and _fits(loaded, values, fields.where):
            found.append(values)
    raise TaskError(f"task.where: {DRAWS * number} draws gave {len(found)} instances that fit, of {number}")


def drawn(
    scene: AnyScene, table: str, given: Mapping[str, float], rng: np.random.Generator
) -> dict[str, float] | None:
    """The parameters given, with those of a table of the task ("instances", "uncertain") drawn; None where
    one falls out of its range."""
    fields, values = fields_of(scene), dict(given)
    numbers = numbers_at(scene, given)
    for name, spread in getattr(fields, table).items():
        if spread.uniform is not None:
            values[name] = float(rng.uniform(*pair(numbers, f"task.{table}.{name}.uniform")))
        else:
            mean, deviation = (numbers[f"task.{table}.{name}.normal.{k}"] for k in (0, 1))
            values[name] = float(mean + deviation * rng.standard_normal())
        low, high = scene.file.parameters[name].range or (-math.inf, math.inf)
        if not low <= values[name] <= high:
            return None
    return values


def _fits(scene: AnyScene, values: dict[str, float], where: str | None) -> bool:
    """Whether an instance can start: bodies are apart, and the condition holds."""
    try:
        start = State.of(scene, parameters=values)
    except InvalidScene:
        return False
    if geometry(scene, start, values).collides[0]:
        return False
    return where is None or bool(ask(scene, where, start, values).holds[0])


def numbers_at(scene: AnyScene, parameters: Mapping[str, float]) -> dict[str, float]:
    """The numbers of the scene's task, by their paths, at these parameters."""
    fields_of(scene)
    return dict(scene.task_numbers(parameters))


def _lasting(scene: AnyScene, parameters: Mapping[str, float]) -> float:
    """For how long parts of the goal must hold, one within the other."""
    code = scene.template.names().condition(scene.file.goal, "goal", "goal")
    if not code.lasting:
        return 0.0
    programs, values = Programs([part.span for part in code.lasting]), np.array([*parameters.values(), 0.0])
    spans = (
        evaluate(programs.code, programs.constants, first, last, values, np.zeros(STACK))
        for first, last in programs.table
    )
    return float(sum(spans))


def _bounds(scene: AnyScene, fields: TaskFields, numbers: Mapping[str, float]) -> tuple[Reals, Reals, Reals]:
    """Bounds and rates (u,) of the scene's inputs."""
    rows = []
    for name in scene.template.inputs:
        path = f"task.inputs.{next((each for each in fields.inputs if fnmatchcase(name, each)), name)}"
        low, high = scene.file.parameters[name].range or (-math.inf, math.inf)
        if f"{path}.range.0" in numbers:
            least, most = pair(numbers, f"{path}.range")
            if not low <= least <= most <= high:
                raise TaskError(f"{path}.range: must lie in the range of {name}, {low:g} to {high:g}")
            low, high = least, most
        if not math.isfinite(low + high):
            raise TaskError(f"{path}: needs a range, because the parameter has none")
        rows.append((low, high, numbers.get(f"{path}.rate", math.inf)))
    low_, high_, rate = np.array(rows).T
    return low_, high_, rate
