"""Robots in space that are led through free space between pushes: arms by servos, a gantry by speeds."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.motion.budget import Budget
from rungwise.planning.motion.propagate import Places
from rungwise.planning.search.problem import Work, begin
from rungwise.planning.task.task import task_of
from rungwise.scene.space import SpaceScene
from rungwise.world.spatial.configurations import SpatialConfigurations as SpaceRoom

STAGE = [("dynamic-compliant", 1e-2)]
GANTRY = """<mujoco><compiler angle="radian"/><worldbody><geom name="table" type="plane" size="2 2 .1"/>
<body name="can" pos="0 0 .05"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>
<body name="post" pos="-.14 0 .1"><geom type="box" size=".02 .1 .1"/></body>
<body name="beam" pos="-.3 0 .06"><joint name="x" type="slide" axis="1 0 0" range="-.5 1" limited="true"/>
<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body name="tip"><joint name="y" type="slide" axis="0 1 0" range="-.6 .6" limited="true"/>
<joint name="z" type="slide" axis="0 0 1" range="-.02 .5" limited="true"/>
<geom type="sphere" size=".015" mass=".1"/></body></body>
</worldbody></mujoco>"""


def arm(side: float = 1.0, **fields: Any) -> SpaceScene:
    """The arm of `arm_push`, on one side of the box or, mirrored, on the other."""
    angles = {"shoulder_to": -1.2 * side, "elbow_to": 1.8 * side, "wrist_to": 0.0}
    ranges = {"shoulder_to": 3.0, "elbow_to": 2.8, "wrist_to": 3.0}
    file: dict[str, Any] = {
        "name": "two_sides", "model": {"file": "arm_push.xml"},
        "parameters": {
            name: {"default": value, "range": [-ranges[name], ranges[name]]} for name, value in angles.items()
        },
        "inputs": list(angles),
        "controls": {"shoulder": "shoulder_to", "elbow": "elbow_to", "wrist": "wrist_to"},
        "start": {"places": {"upper.shoulder": -1.2 * side, "fore.elbow": 1.8 * side, "box.x": 0.42}},
        "contacts": [
            {"between": ["box", "table"], "friction": 0.3, "stiffness": 1e5, "damping": 200},
            {"friction": 0.5, "stiffness": 1e5, "damping": 200},
        ],
        "goal": f"box.x <= 0.39 and {side} * box.y >= 0.06",
        "duration": 3.0, "step": 2e-3, "tolerance": 1e-3,
        "task": {
            "transit": {"tool": {"speed": 0.3, "clearance": 0.015, "push": [0.01, 0.2], "lean": 0.8}},
            "moves": [1, 4],
        },
    }  # fmt: skip
    scene = rw.load(file | fields)
    assert isinstance(scene, SpaceScene)
    return scene


def gantry(folder: Path, task: dict[str, Any] | None = None, **fields: Any) -> SpaceScene:
    path = folder / "gantry.xml"
    path.write_text(GANTRY)
    names = ("vx", "vy", "vz")
    file: dict[str, Any] = {
        "name": "gantry", "model": {"file": str(path)}, "inputs": names,
        "parameters": {name: {"default": 0.0, "range": [-0.5, 0.5]} for name in names},
        "speeds": {"beam.x": "vx", "tip.y": "vy", "tip.z": "vz"},
        "contacts": [{"friction": 0.3, "stiffness": 1e5, "damping": 200}],
        "goal": "can.x >= 0.1 and abs(can.y) <= 0.02", "duration": 3.0, "step": 2e-3, "tolerance": 1e-3,
        "task": {
            "transit": {"tip": {"speed": 0.2, "clearance": 0.02, "push": [0.02, 0.2], "lean": 0.8}},
            "moves": [1, 2],
        } | (task or {}),
    }  # fmt: skip
    scene = rw.load(file | fields)
    assert isinstance(scene, SpaceScene)
    return scene


def beside(work: Work, count: int = 140) -> tuple[Places, Reals]:
    """Places at which moves that are drawn begin, and their vectors, of those that can be made."""
    vectors = np.random.default_rng(0).random((count, work.moves.size))
    found, fits = work.moves.begin(vectors, work.start.take(np.zeros(count, np.int64)))
    return found.take(np.flatnonzero(fits)), vectors[fits]


def least(scene: SpaceScene, a: Reals, b: Reals, pairs: list[tuple[str, str]]) -> float:
    """The least gap of pairs on a straight way."""
    found = rw.geometry(scene, a + np.linspace(0.0, 1.0, 500)[:, None] * (b - a))
    return float(found.gaps[:, [found.contacts.index(pair) for pair in pairs]].min())


@pytest.fixture(scope="module")
def plan() -> rw.Plan:
    return rw.plan(arm(), schedule="coarse-fine", budget=60_000, threads=1, seed=2)


@pytest.mark.long
def test_an_arm_goes_around_a_box_and_pulls_it(plan: rw.Plan) -> None:
    """The box comes nearer: the arm, which begins beside it, has to push from behind."""
    assert plan.found, plan.reason
    assert set(plan.labels) <= {"transit", "change", "push", "back", "wait"}
    assert plan.labels[0] == "transit"
    assert "push" in plan.labels
    run = plan.replay(frames=4000)
    assert str(run.outcome) == "goal"
    assert run.final["box"]["x"] <= 0.39


@pytest.mark.long
def test_nothing_is_touched_in_transit(plan: rw.Plan) -> None:
    first = next(k for k, label in enumerate(plan.labels) if label != "transit")
    led = rw.simulate(plan.scene, "dynamic-compliant", inputs=plan.segments[:first], tol=plan.tol)
    states = [state.q for state in led.states]
    gaps = rw.geometry(plan.scene, np.array(states))
    assert gaps.gaps[:, gaps.contacts.index(("box", "tool"))].min() > 0.0
    assert led.final["box"]["x"] == pytest.approx(0.42, abs=1e-6)


@pytest.mark.long
def test_the_mirrored_plan_reaches_the_mirrored_goal(plan: rw.Plan) -> None:
    mirrored = [
        rw.Segment({name: -value for name, value in each.inputs.items()}, each.duration, None, each.ramp)
        for each in plan.segments
    ]
    run = rw.simulate(arm(-1.0), "dynamic-compliant", inputs=mirrored, tol=plan.tol)
    assert str(run.outcome) == "goal"
    own = plan.replay()
    assert run.final["box"]["y"] == pytest.approx(-own.final["box"]["y"], abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["arm", "gantry"])
def test_moves_begin_at_their_clearance_and_ways_keep_apart(kind: str, tmp_path: Path) -> None:
    scene = arm() if kind == "arm" else gantry(tmp_path)
    work = begin(task_of(scene), Budget(), 0, 1)
    places, _ = beside(work)
    (carrier,) = work.task.carriers
    pair = ("box", "tool") if kind == "arm" else ("can", "tip")
    found = rw.geometry(scene, places.q)
    gaps = found.gaps[:, found.contacts.index(pair)]
    assert len(gaps) >= 8
    assert np.abs(gaps / carrier.clearance - 1.0).max() <= 0.25
    others = np.setdiff1d(np.arange(len(work.start.q[0])), carrier.places)
    assert (places.q[:, others] == work.start.q[0, others]).all()
    ways = [work.transit.way(work.start.q[0], q, 0) for q in places.q[:8]]
    assert all(way is not None for way in ways)
    pairs = [pair] if kind == "arm" else [pair, ("world", "tip"), ("post", "tip")]
    for way in ways:
        assert way is not None
        assert all(least(scene, a, b, pairs) > 0.0 for a, b in pairwise(way))
    assert max(len(way) for way in ways if way is not None) > 2


def test_pushes_go_along_lines_at_the_speed_of_the_task(tmp_path: Path) -> None:
    """Three slides lead the tip along any line: the way of a push is as long as it says, and straight."""
    work = begin(task_of(gantry(tmp_path)), Budget(), 0, 1)
    places, vectors = beside(work)
    segments = work.moves.segments_of(vectors, places, np.zeros((len(vectors), 3)))
    way = segments.levels[:, -2] * segments.durations[:, -2:-1]
    speed = np.linalg.norm(segments.levels[:, -2], axis=1)
    ends = places.q[:, 7:] + way
    low, high = np.array([-0.5, -0.6, -0.02]), np.array([1.0, 0.6, 0.5])
    free = ((ends > low + 1e-6) & (ends < high - 1e-6)).all(axis=1)  # others end at the stop of a slide
    assert free.sum() >= 8
    assert speed[free] == pytest.approx(0.2, rel=1e-3)
    length = 0.02 * (0.2 / 0.02) ** vectors[free, 4] + 0.02
    assert np.linalg.norm(way[free], axis=1) == pytest.approx(length, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(
    ("far", "aside", "seed"), [(0.05, 0.03, 2), pytest.param(0.1, 0.02, 0, marks=pytest.mark.long)]
)
def test_a_gantry_goes_around_a_post_to_push_a_can(
    tmp_path: Path, far: float, aside: float, seed: int
) -> None:
    scene = gantry(tmp_path, goal=f"can.x >= {far} and abs(can.y) <= {aside}")
    plan = rw.plan(scene, schedule=STAGE, budget=60_000, threads=1, seed=seed)
    assert plan.found, plan.reason
    assert plan.labels.count("transit") >= 2, "the post is in the way"
    assert plan.replay().final["can"]["x"] >= far
    ways = plan.segments[: plan.labels.index("push")]
    led = rw.simulate(plan.scene, "dynamic-compliant", inputs=ways, tol=plan.tol)
    assert led.final["can"]["x"] == pytest.approx(0.0, abs=1e-6), "transit touches nothing"


def test_gaps_shrink_by_no_more_than_is_said() -> None:
    scene = arm()
    task = task_of(scene)
    room = SpaceRoom(scene, task.parameters, task.size)
    rng, q = np.random.default_rng(0), rw.State.of(scene).q
    for _ in range(50):
        a, b = (q + np.r_[np.zeros(7), rng.uniform(-1.0, 1.0, 3)] for _ in range(2))
        change = np.abs(np.diff(room.look(np.stack([a, b]))[0], axis=0))[0]
        assert (change <= room.moved(np.stack([a, b]))[0][room.pairs].sum(axis=1) + 1e-9).all()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"task": {"transit": {"hand": {}}}}, "task.transit.hand"),
        (
            {"speeds": {"beam.x": "vx", "tip.y": "vy"}},
            "task.transit.tip: needs inputs, one for each of beam.x, tip.y, tip.z, that drive their speeds",
        ),
        (
            {"speeds": {"beam.x": "vx", "tip.y": "vy", "tip.z": "vz * t"}},
            "linearly and whatever the time",
        ),
        (
            {"task": {"transit": {"can": {"speed": 1, "clearance": 1, "push": [1, 1]}}}},
            "task.transit.can: needs inputs, one for each of its joints",
        ),
        (
            {"task": {"transit": {"table": {"speed": 1, "clearance": 1, "push": [1, 1]}}}},
            "task.transit: unknown free robot 'table'",
        ),
    ],
)
def test_wrong_transits_are_told_in_one_line(tmp_path: Path, fields: dict[str, Any], words: str) -> None:
    with pytest.raises(rw.InputError, match=words) as told:
        rw.plan(gantry(tmp_path, **fields), schedule=STAGE, threads=1)
    assert "\n" not in str(told.value)
