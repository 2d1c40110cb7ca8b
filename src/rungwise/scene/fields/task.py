"""What a planner may do in a scene, and how instances of the task are drawn.

The goal and the unsafe and doomed conditions are the scene's. Every `Number` is a number or an expression of
the scene's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.values import Finite, Flag, Name, Number, Pair, Pattern, Patterns, Text


class Spread(Strict):
    """How a parameter is drawn: evenly between two values, or normally about a mean with a deviation."""

    uniform: Pair | None = None
    normal: Pair | None = None

    @model_validator(mode="after")
    def _is_one(self) -> Spread:
        if (self.uniform is None) == (self.normal is None):
            raise PydanticCustomError(
                "task", "needs either uniform: [low, high] or normal: [mean, deviation]"
            )
        return self


class Bounds(Strict):
    """Least and greatest value of an input, those of the parameter if not given, and how fast it may
    change."""

    range: Pair | None = None
    rate: Number | None = None


class Transit(Strict):
    """A robot that may be led through free space between its pushes.

    Its coordinates are driven at speeds that follow the inputs linearly. It moves at `speed`, begins each
    push at `clearance` from an object, goes `push` far (least and greatest), within the angle `lean` of the
    object's normal, and draws back by `clearance`.
    """

    speed: Number
    clearance: Number
    push: Pair
    lean: Number = "pi / 4"


class Finger(Strict):
    """What a planner by contact modes may do with robots.

    It moves them at `speed`, and with this `clearance` to all else between contacts; `press` bounds the
    normal force of each of their contacts, for robots on servos; `within` bounds where their centres may be,
    axis by axis; `contacts` is how many places of contact with objects each has at most, `reserve` the part
    of friction that it keeps in hand, `objects` what it may touch; one that may go `over` lifts off the plane
    and passes above objects.
    """

    speed: Number
    clearance: Number
    press: Pair | None = None
    within: dict[Text, Pair] = {}
    contacts: Number = 1.0
    reserve: Number = 0.1
    objects: Patterns = ("*",)
    over: Flag = False


class Cost(Strict):
    """Weights of a plan's duration, of the work of its drives and of the number of its moves."""

    time: Number = 1.0
    work: Number = 0.0
    moves: Number = 0.0


class Task(Strict):
    """The planner's part of a scene.

    instances: how the parameters of an instance are drawn, again and again until `where` holds at the start
    and bodies are apart; uncertain: how starts, parameters and inputs vary about an instance; inputs: bounds
    and rates by patterns of names, of which the first that fits an input holds (if not given, the ranges of
    the parameters); transit: robots that may go anywhere; fingers: the
    same for contact modes, by patterns of names, of which the first that fits a robot holds; keep_out:
    conditions that must not hold; moves: least and greatest number of moves; duration: least and greatest, of
    one move of a task without transit (up to the scene's duration, if not given); weights: of the coordinates
    of objects in distances between states; reserve: the part by which plans keep within the goal's bounds.
    """

    instances: dict[Name, Spread] = {}
    where: Text | None = None
    uncertain: dict[Name, Spread] = {}
    inputs: dict[Pattern, Bounds] = {}
    transit: dict[Name, Transit] = {}
    fingers: dict[Pattern, Finger] = {}
    keep_out: tuple[Text, ...] = ()
    moves: tuple[Finite, Finite] = (1.0, 3.0)
    duration: Pair | None = None
    weights: dict[Text, Number] = {}
    cost: Cost = Cost()
    reserve: Number = 0.2


class Place(NamedTuple):
    """A number of a task: its path, the number, and its bounds."""

    path: str
    number: Number
    at_least: float = -math.inf
    above: float | None = None
    at_most: float = math.inf


def numbers_of(task: Task) -> list[Place]:
    """All numbers of a task, in the order of their records."""
    return list(_numbers(task))


def _numbers(task: Task) -> Iterator[Place]:
    for table in ("instances", "uncertain"):
        for name, spread in getattr(task, table).items():
            kind = "uniform" if spread.uniform is not None else "normal"
            for k, number in enumerate(getattr(spread, kind)):
                least = 0.0 if kind == "normal" and k == 1 else -math.inf
                yield Place(f"task.{table}.{name}.{kind}.{k}", number, least)
    for name, bounds in task.inputs.items():
        ends = enumerate(bounds.range or ())
        yield from (Place(f"task.inputs.{name}.range.{k}", number) for k, number in ends)
        if bounds.rate is not None:
            yield Place(f"task.inputs.{name}.rate", bounds.rate, above=0.0)
    for name, transit in task.transit.items():
        path = f"task.transit.{name}"
        yield Place(f"{path}.speed", transit.speed, above=0.0)
        yield Place(f"{path}.clearance", transit.clearance, above=0.0)
        yield from (Place(f"{path}.push.{k}", number, above=0.0) for k, number in enumerate(transit.push))
        yield Place(f"{path}.lean", transit.lean, 0.0, at_most=math.pi / 2.0)
    for name, finger in task.fingers.items():
        yield from _of_finger(f"task.fingers.{name}", finger)
    for k, number in enumerate(task.duration or ()):
        yield Place(f"task.duration.{k}", number, above=0.0)
    for name, number in task.weights.items():
        yield Place(f"task.weights.{name}", number, 0.0)
    for name in Cost.model_fields:
        yield Place(f"task.cost.{name}", getattr(task.cost, name), 0.0)
    yield Place("task.reserve", task.reserve, 0.0, at_most=0.9)


def _of_finger(path: str, finger: Finger) -> Iterator[Place]:
    yield Place(f"{path}.speed", finger.speed, above=0.0)
    yield Place(f"{path}.clearance", finger.clearance, above=0.0)
    for k, number in enumerate(finger.press or ()):
        yield Place(f"{path}.press.{k}", number, 0.0, above=None if k == 0 else 0.0)
    for axis, pair in finger.within.items():
        yield from (Place(f"{path}.within.{axis}.{k}", number) for k, number in enumerate(pair))
    yield Place(f"{path}.contacts", finger.contacts, 1.0)
    yield Place(f"{path}.reserve", finger.reserve, 0.0, at_most=0.9)
