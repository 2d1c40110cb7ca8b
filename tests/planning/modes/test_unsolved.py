"""Tasks without solution: what is said of them names what is in the way, and comes within the limit."""

from __future__ import annotations

import time
from typing import Any

import pytest
import yaml

import rungwise as rw
from rungwise.scene.scene import LIBRARY

PLUG = {
    "role": "obstacle", "shape": {"kind": "box", "width": 0.02, "height": 0.17},
    "pose": {"x": 0.15, "y": 0.0},
}  # fmt: skip
LIMIT = 3.0
"""Seconds."""


def changed(name: str, **changes: Any) -> rw.Scene:
    """A shipped scene with other parameters, goal, bodies or press."""
    data = yaml.safe_load((LIBRARY / f"{name}.yaml").read_text("utf-8"))
    data["goal"] = changes.pop("goal", data["goal"])
    data["bodies"] |= changes.pop("bodies", {})
    for finger in data["task"]["fingers"].values():
        finger |= {"press": press} if (press := changes.pop("press", None)) else {}
    for parameter, value in changes.items():
        data["parameters"][parameter]["default"] = value
    return rw.load(data)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("corridor", {"mass": 100.0}, "fingers press too weakly"),
        ("corner_pivot", {"press": [1e-4, 1e-3]}, "fingers press too weakly"),
        ("corridor", {"bodies": {"plug": PLUG}}, "no path for the object"),
        ("corridor", {"goal": "hypot(box.x - 0.1, box.y - 0.3) <= near"}, "box and inner overlap"),
        ("corner_pivot", {"mu": 0.0}, "no balance"),
    ],
    ids=["heavy", "weak", "closed", "in a wall", "slippery"],
)
def test_what_is_in_the_way_is_named(name: str, changes: dict[str, Any], said: str) -> None:
    began = time.monotonic()
    plan = rw.plan(changed(name, **changes), seed=0, budget=None, limit=LIMIT)
    assert time.monotonic() - began < LIMIT + 5.0
    assert not plan.found and said in plan.reason
    assert "lacks 0 " not in plan.reason
