"""Longer tasks of published kinds: corridors with more bends, two boxes in turn, a block that is turned on.

`published_tasks.py --schedules --longer` plans them, where contact models that answer before anything is run
should pay most: they ask for more legs, regrasps and ways than the tasks from which they are made.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml

import rungwise as rw
from rungwise.scene.scene import LIBRARY

TURNED = "hidex_push_reorient_servo_transit"
"""The published task in which two fingers turn a block on a floor."""
Data = dict[str, Any]
"""A scene as it is read from its file."""


def longer(folder: Path) -> list[rw.Scene]:
    """All of them, those of published files where the folder has these."""
    made = [_bends(2), _bends(3), _two_boxes(True), _two_boxes(False)]
    file = folder / f"{TURNED}.yaml"
    if file.is_file():
        made += [_turned(yaml.safe_load(file.read_text("utf-8")), quarters) for quarters in (2, 3)]
    return [rw.load(data) for data in made]


def _bends(count: int) -> Data:
    """The shipped corridor as a staircase with so many bends."""
    data = _with_boxes(f"corridor_{count}_bends", ["box"])
    far, half = "(wall + passage / 2)", "passage / 2"
    data["bodies"] |= {
        "below": _wall(("-wall - passage", f"{far} + {half}"), (f"-{half} - edge", f"-{half}")),
        "first": _wall(("-wall - passage", f"{far} - {half}"), (half, f"{far} + {half}")),
        "second": _wall((f"{far} + {half}", f"2 * {far} + {half}"), (f"-{half}", f"{far} - {half}")),
    }
    if count == 2:
        data["bodies"]["lid"] = _wall((f"{far} - {half}", f"2 * {far} + {half}"), _strip(f"{far} + {half}"))
        data["goal"] = f"hypot(box.x - 2 * {far}, box.y - {far}) <= near and abs(box.angle) <= aligned"
    else:
        data["bodies"]["third"] = _wall(
            (f"{far} - {half}", f"2 * {far} - {half}"), (f"{far} + {half}", f"2 * {far} + {half}")
        )
        data["bodies"]["last"] = _wall(
            _strip(f"2 * {far} + {half}"), (f"{far} - {half}", f"2 * {far} + {half}")
        )
        data["goal"] = (
            f"hypot(box.x - 2 * {far}, box.y - 2 * {far}) <= near and abs(box.angle - pi / 2) <= aligned"
        )
    return _longer(data, count, 0.9)


def _two_boxes(apart: bool) -> Data:
    """Two boxes that are led past a post to poses of their own; or one into the place of the other, which has
    to leave it before."""
    data = _with_boxes("two_boxes" if apart else "two_boxes_in_turn", ["box", "other"])
    at = ("0.06", "0.22") if apart else ("0.28", "0.0")
    data["bodies"]["other"]["pose"] = {"x": at[0], "y": at[1]}
    data["bodies"]["post"] = _wall(("0.12", "0.15"), ("0.08", "0.12"))
    goals = [("box", "0.28", "0.0", "pi / 2"), ("other", "0.28", "0.25", "0")]
    data["goal"] = " and ".join(
        f"hypot({name}.x - {x}, {name}.y - {y}) <= near and abs({name}.angle - {angle}) <= aligned"
        for name, x, y, angle in goals
    )
    return _longer(data, 2, 0.6)


def _turned(data: Data, quarters: int) -> Data:
    """The published block, turned by so many quarters of a turn."""
    data["name"] = f"reorient_{quarters}_quarters"
    x, angle = 0.001 * quarters, 1.5708 * quarters
    data["goal"] = f"hypot(part.x - {x}, part.y - 0.01) <= 0.0017 and abs(part.angle + {angle}) <= 0.17"
    data["task"]["moves"] = [1, quarters * data["task"]["moves"][1]]
    data["duration"] = quarters * data["duration"]
    return data


def _with_boxes(called: str, boxes: Sequence[str]) -> Data:
    """The fingers and the floor of the shipped corridor, without its walls, and so many of its boxes."""
    data = dict(yaml.safe_load((LIBRARY / "corridor.yaml").read_text("utf-8")))
    box = data["bodies"].pop("box")
    fingers = {name: body for name, body in data["bodies"].items() if body["role"] == "robot"}
    data["name"], data["bodies"] = called, fingers | {name: deepcopy(box) for name in boxes}
    first, second, *rest = data["contacts"]
    pairs = [{**pair, "between": [own if each == "box" else each for each in pair["between"]]}
             for own in boxes for pair in (first, second)]  # fmt: skip
    data["contacts"] = [*pairs[::2], *pairs[1::2], *rest]
    return data


def _longer(data: Data, times: int, room: float) -> Data:
    """More moves and time, and room for the fingers."""
    data["task"]["moves"] = [1, 12 * times]
    data["task"]["inputs"] = {
        name: {"range": [-0.4, room] if name.startswith("x") else [-0.25, room]} for name in data["inputs"]
    }
    data["duration"] = f"{times} * ({data['duration']})"
    return data


def _wall(x: tuple[str, str], y: tuple[str, str]) -> Data:
    """An obstacle between these bounds."""
    (left, right), (low, high) = x, y
    return {
        "role": "obstacle",
        "shape": {"kind": "box", "width": f"({right}) - ({left})", "height": f"({high}) - ({low})"},
        "pose": {"x": f"(({left}) + ({right})) / 2", "y": f"(({low}) + ({high})) / 2"},
    }


def _strip(begins: str) -> tuple[str, str]:
    """As thick as an edge, from there on."""
    return begins, f"{begins} + edge"
