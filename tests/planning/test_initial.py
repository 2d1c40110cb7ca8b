"""Searches that are used again: plans, and schedules of segments, to begin with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.task.task import TaskError

STAGE = [("quasistatic-rigid", 1e-3)]


@pytest.fixture(scope="module")
def push() -> rw.Plan:
    found = rw.plan("push", task_seed=1003, schedule=STAGE)
    assert found.found
    return found


def begun(plan: rw.Plan, segments: object, budget: int = 20_000) -> rw.Plan:
    return rw.plan(
        plan.scene, parameters=plan.parameters, schedule=STAGE, budget=budget, initial=segments  # type: ignore[arg-type]
    )  # fmt: skip


def test_a_schedule_that_comes_to_the_goal_is_a_plan(push: rw.Plan) -> None:
    found = begun(push, push.segments, budget=5_000)
    assert found.found, found.reason
    assert found.records[-1].how == "held"
    assert found.segments == push.segments
    assert found.replay().ok


def test_a_schedule_goes_through_several_stages(push: rw.Plan) -> None:
    found = rw.plan(
        "push", parameters=push.parameters, initial=list(push.segments),
        schedule=[*STAGE, ("dynamic-compliant", 1e-3)],
    )  # fmt: skip
    assert found.found, found.reason
    assert found.replay("dynamic-compliant").ok


@pytest.mark.long
def test_a_schedule_that_misses_is_led_on(push: rw.Plan) -> None:
    """The last push is missing: what is left keeps its beginning."""
    last = len(push.segments) - 1 - push.labels[::-1].index("push")
    ways = [k for k in range(last) if push.labels[k] in ("back", "wait")]
    head = push.segments[: ways[-1] + 1]
    found = begun(push, head, budget=400_000)
    assert found.found, found.reason
    assert found.records[-1].how == "continued with new moves"
    assert found.segments[: len(head) // 2] == head[: len(head) // 2]
    assert found.replay().ok


def test_inputs_alone_are_repaired_as_moves() -> None:
    """Two fingers that close with speeds off their band: held segments are moves, and these are mended."""
    plan = rw.plan("two_finger", task_seed=3, schedule=STAGE)
    others = [
        replace(each, inputs=dict(each.inputs) | {"v1": 0.1 * each.inputs["v1"]}) for each in plan.segments
    ]
    assert not rw.simulate(plan.scene, rw.QUASISTATIC_RIGID, parameters=plan.parameters, inputs=others).ok
    found = rw.plan("two_finger", parameters=plan.parameters, schedule=STAGE, initial=others)
    assert found.found, found.reason
    assert found.records[-1].how in ("held", "repaired move by move", "repaired at its end")
    assert found.replay().ok


def around(height: float, width: float, far: float) -> rw.Scene:
    """A box on a table, a wall between it and its goal, and a finger."""
    speeds = {"x": "v * ux", "y": "v * uy", "angle": 0.0}
    return rw.load(
        {
            "name": "around",
            "parameters": {
                "v": {"default": 0.02},
                "ux": {"default": 0.0, "range": [-1, 1]},
                "uy": {"default": 0.0, "range": [-1, 1]},
            },
            "inputs": ["ux", "uy"],
            "bodies": {
                "rod": {
                    "role": "robot", "shape": {"kind": "disc", "radius": 0.005}, "pose": {"x": -far - 0.06},
                    "motion": {"kind": "free"},
                    "coordinates": {k: {"drive": {"kind": "speed", "speed": x}} for k, x in speeds.items()},
                },
                "part": {
                    "role": "object", "mass": 0.5, "motion": {"kind": "free"}, "pose": {"x": -far},
                    "shape": {"kind": "box", "width": 0.05, "height": 0.05},
                    "support": {"friction": 0.4, "load": 5.0},
                },
                "wall": {"role": "obstacle", "shape": {"kind": "box", "width": width, "height": height}},
            },
            "contacts": [{"between": ["*", "*"], "friction": 0.4}],
            "goal": f"hypot(part.x - {far}, part.y) <= 0.02",
            "tolerance": 1e-7, "duration": 20.0, "step": 0.01,
            "task": {"fingers": {"rod": {"speed": "v", "clearance": 0.004}}, "moves": [1, 20]},
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("height", "width", "far", "below", "seed"),
    [(0.06, 0.01, 0.06, 0.08, 3), pytest.param(0.14, 0.02, 0.1, 0.14, 1, marks=pytest.mark.long)],
)
def test_a_path_is_followed(height: float, width: float, far: float, below: float, seed: int) -> None:
    """A box that a wall parts from its goal is led around the end that the path goes around."""
    path = np.array([[-far, 0.0, 0.0], [-far, -below, 0.0], [far, -below, 0.0], [far, 0.0, 0.0]])
    way = np.vstack([path, 0.5 * (path[1:] + path[:-1])])
    plan = rw.plan(around(height, width, far), schedule=STAGE, initial=way, budget=300_000, seed=seed)
    assert plan.found, plan.reason
    assert min(place[plan.scene.template.coordinates.index("part.y")] for place in plan.waypoints) < -0.03
    assert plan.replay().ok


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("initial", "words"),
    [
        ([], "initial: has no segments"),
        ("push", "initial: must be a plan, a list of segments, or an array of poses, not 'push'"),
        (np.zeros((3, 2)), "initial: a path has poses (n, 3)"),
        (np.full((3, 3), np.nan), "initial: poses of a path must be finite"),
        ([rw.Segment({"zzz": 1.0}, 1.0)], "initial.0.inputs: unknown input 'zzz'"),
        ([rw.Segment({}, -1.0)], "initial.0.duration: must be >= 0"),
    ],
)
def test_what_is_no_beginning_is_refused_in_one_line(initial: object, words: str) -> None:
    with pytest.raises(TaskError) as caught:
        rw.plan("push", initial=initial, budget=10)  # type: ignore[arg-type]
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)
