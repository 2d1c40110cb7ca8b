"""Tasks without solution: what is said of them names what is in the way, and comes within the limit."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any

import pytest
import yaml

import rungwise as rw
from rungwise.deadline import TimeOver
from rungwise.planning.modes.planner import mode_planner
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import begin, known
from rungwise.planning.task.task import task_of
from rungwise.scene.scene import LIBRARY

PLUG = {
    "role": "obstacle", "shape": {"kind": "box", "width": 0.02, "height": 0.17},
    "pose": {"x": 0.15, "y": 0.0},
}  # fmt: skip
BUDGET = 30_000


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


@pytest.mark.long
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
    plan = rw.plan(changed(name, **changes), seed=0, budget=BUDGET)
    assert not plan.found and said in plan.reason
    assert "lacks 0 " not in plan.reason


@pytest.mark.few(1)
@pytest.mark.parametrize("reach", [-0.09, -0.12])
def test_the_nearest_place_that_a_tree_foresaw_is_named(reach: float) -> None:
    """Fingers push a card across a table as far as they reach, which is not as far as the goal."""
    data = yaml.safe_load((LIBRARY / "card.yaml").read_text("utf-8"))
    data["goal"] = "abs(card.x + 0.3) <= near"
    data["bodies"]["table"]["pose"]["x"], data["bodies"]["table"]["shape"]["width"] = -1.0, 2.0
    data["task"]["fingers"]["finger*"]["within"] = {"x": [reach, 0.2]}
    work = begin(task_of(rw.load(data)), Budget(10_000), 0, 1)
    planner = mode_planner(work, work.predictor(Stage(rw.QUASISTATIC_RIGID, 1e-2)))
    assert planner is not None
    with suppress(TimeOver):
        assert planner.search(2) is None
    start = re.search(r"than the start, which misses it by ([^;]+)", known(work))
    named = re.search(r"nearest place in trees .* misses it by ([^,]+), with card.x = ([^,]+),", known(work))
    assert start is not None and named is not None, known(work)
    assert float(named[1]) < float(start[1])
    assert reach - 0.06 < float(named[2]) < -0.065
