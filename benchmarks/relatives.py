"""Relatives of planar tasks that others published: the same kinds of task with other numbers, drawn.

`published_tasks.py --relatives N` plans so many of each file. Sizes, frictions, masses, gravity, gaps, where
fingers start and what the goal asks for change, most by up to `SPREAD`. What is measured from an object
follows it: a block stays on its floor and at its wall, and the pose of the goal is that of the turned block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

import numpy as np

SPREAD = 0.2
"""Part by which numbers change at most."""
TURNS = 0.5
"""Change, in radians, of the direction and the angle of a goal seen from above."""

Data = dict[str, Any]
"""A scene as it is read from its file."""


class Draw:
    """Numbers about those of a file."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def about(self, value: float, spread: float = SPREAD) -> float:
        """A number within a part of another one."""
        return float(value * (1.0 + self.between(-spread, spread)))

    def between(self, low: float, high: float) -> float:
        """A number between two others."""
        return float(self._rng.uniform(low, high))


def relative(data: Mapping[str, Any], number: int) -> Data | None:
    """The relative of a task with this number; None where tasks of this name have none."""
    name = str(data["name"])
    change = next((own for begins, own in _KINDS.items() if name.startswith(begins)), None)
    if change is None:
        return None
    found, draw = deepcopy(dict(data)), Draw(number)
    found["name"] = f"{name}_{number}"
    _materials(found, draw)
    change(found, draw)
    return found


def _materials(data: Data, draw: Draw) -> None:
    """Other frictions, another mass of the object, and another gravity, which fingers do not feel."""
    for contact in data["contacts"]:
        contact["friction"] = draw.about(contact["friction"])
    for body in data["bodies"].values():
        if body["role"] == "object":
            body["mass"] = draw.about(body["mass"])
        if "support" in body:
            body["support"]["friction"] = draw.about(body["support"]["friction"])
    if "gravity" in data:
        data["gravity"][1] = draw.about(data["gravity"][1])
        for body in data["bodies"].values():
            if "force" in body:
                body["force"][1] = -body["mass"] * data["gravity"][1]


def _sized(data: Data, draw: Draw) -> tuple[float, float]:
    """Another width and height of the object; returns these."""
    shape = data["bodies"]["part"]["shape"]
    shape["width"], shape["height"] = draw.about(shape["width"]), draw.about(shape["height"])
    return shape["width"], shape["height"]


def _fingers(data: Data, draw: Draw) -> None:
    """Fingers that begin elsewhere, where they may be led through free space; else as near to the object as
    they were."""
    part = data["bodies"]["part"]
    for k in (1, 2):
        if f"x{k}" not in data["parameters"]:
            continue
        place, side = data["parameters"][f"x{k}"], -1.0 if k == 1 else 1.0
        side = math.copysign(1.0, place["default"] - part["pose"]["x"]) or side
        gap = data["bodies"][f"finger{k}"]["shape"]["radius"] + part["shape"]["width"] / 2
        gap += 0.2 * part["shape"]["width"] * draw.between(0.3, 1.0) if "transit" in data["task"] else 0.0
        place["default"] = part["pose"]["x"] + side * gap


def _pushed(data: Data, draw: Draw) -> None:
    """A box seen from above that goes another way, and turns."""
    goal_of = {"hidex": (0.01, 0.0, 0.001), "pang_": (0.0, -1.0, 0.1)}
    x, y, near = goal_of[data["name"][:5]]
    width, height = _sized(data, draw)
    part = data["bodies"]["part"]
    finger = data["bodies"]["finger1"]
    away = (max(width, height) / math.sqrt(2.0) + 2.0 * finger["shape"]["radius"]) * draw.between(1.1, 1.5)
    at = draw.between(-math.pi, math.pi)
    finger["pose"] = {
        "x": part["pose"]["x"] + away * math.cos(at),
        "y": part["pose"]["y"] + away * math.sin(at),
    }
    by, turned, far = draw.between(-TURNS, TURNS), draw.between(-TURNS, TURNS), draw.about(1.0)
    gone = (
        part["pose"]["x"] + far * (x * math.cos(by) - y * math.sin(by)),
        part["pose"]["y"] + far * (x * math.sin(by) + y * math.cos(by)),
    )
    data["goal"] = _placed(*gone, near, turned, 0.1)


def _placed(x: float, y: float, near: float, turned: float, within: float) -> str:
    """The part is near to a place, and turned by an angle up to some error."""
    return f"hypot(part.x - {x!r}, part.y - {y!r}) <= {near!r} and abs(part.angle - {turned!r}) <= {within!r}"


def _pivoted(data: Data, draw: Draw) -> None:
    """A block at a wall that is tipped up about its lower edge."""
    width, height = _sized(data, draw)
    data["bodies"]["part"]["pose"] = {"x": -width / 2, "y": height / 2, "angle": 0}
    wall = data["bodies"]["wall"]
    wall["shape"]["height"] = draw.about(wall["shape"]["height"])
    wall["pose"]["y"] = wall["shape"]["height"] / 2
    _fingers(data, draw)
    data["goal"] = _placed(-height / 2, width / 2, 0.1 * width, -1.5708, 0.35)


def _rolled(data: Data, draw: Draw) -> None:
    """A block on a floor that is turned by a right angle."""
    width, height = _sized(data, draw)
    data["bodies"]["part"]["pose"] = {"x": 0, "y": height / 2, "angle": 0}
    _fingers(data, draw)
    data["goal"] = _placed(draw.between(-0.2, 0.2) * width, width / 2, 0.085 * width, -1.5708, 0.17)


def _tilted(data: Data, draw: Draw) -> None:
    """A block on a floor that is slid to a wall and tilted in the corner."""
    width, height = _sized(data, draw)
    data["bodies"]["part"]["pose"] = {"x": draw.between(0.2, 0.32), "y": height / 2, "angle": 0}
    _fingers(data, draw)
    angle = draw.about(math.pi / 4)
    c, s = math.cos(angle), math.sin(angle)
    data["goal"] = _placed((width * c + height * s) / 2, (width * s + height * c) / 2, 0.01, -angle, 0.1)


def _stood(data: Data, draw: Draw) -> None:
    """A book on a table that is stood upright there."""
    width, height = _sized(data, draw)
    top = data["bodies"]["table"]["shape"]["height"] / 2
    data["bodies"]["part"]["pose"] = {"x": draw.between(-0.05, 0.05), "y": top + height / 2, "angle": 0}
    _fingers(data, draw)
    data["goal"] = (
        f"abs(part.angle + 1.5707963) <= 0.15 and abs(part.y - {top + width / 2!r}) <= 0.04"
        " and abs(part.x + 0.2) <= 0.15"
    )


def _around_a_bend(data: Data, draw: Draw) -> None:
    """A block that passes between two others, seen from above."""
    width, height = _sized(data, draw)
    data["bodies"]["part"]["pose"]["y"] = width / 2
    gap, below = draw.about(max(0.25, 1.15 * height), 0.1), data["bodies"]["w1"]
    top = below["pose"]["y"] + below["shape"]["height"] / 2
    data["bodies"]["w2"]["pose"]["y"] = top + gap + data["bodies"]["w2"]["shape"]["height"] / 2
    for k, side in ((1, -1.0), (2, 1.0)):
        place = data["parameters"].get(f"x{k}")
        away = side * (height / 2 + 0.1 * draw.about(1.0, 0.5))
        if place is None:
            data["bodies"][f"finger{k}"]["pose"]["x"] = away
        else:
            place["default"] = away
    goal = (draw.between(1.35, 1.45), draw.between(1.4, 1.5))
    data["goal"] = _placed(*goal, 0.05, 1.5708, 0.3)


def _turned_on_the_spot(data: Data, draw: Draw) -> None:
    """A ball between two arms that is turned by another angle, to either side."""
    angle = draw.about(0.2618) * (1.0 if draw.between(-1.0, 1.0) > 0.0 else -1.0)
    data["goal"] = f"hypot(ball.x, ball.y - 0.35) <= 0.03 and abs(ball.angle - {angle!r}) <= 0.05"


_KINDS: dict[str, Callable[[Data, Draw], None]] = {
    "hidex_pushing": _pushed,
    "pang_planar_pushing": _pushed,
    "hidex_corner_pivot": _pivoted,
    "hidex_push_reorient": _rolled,
    "cmgmp_corner": _tilted,
    "cmgmp_book": _stood,
    "cmgmp_sofa": _around_a_bend,
    "pang_planar_hand": _turned_on_the_spot,
}
