"""The geometric rung in space: places at goals, ways of bodies that turn, and what bounds both."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.task.task import task_of
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.laws import touching_pairs
from rungwise.world.contract import Configurations
from rungwise.world.find import world_of
from rungwise.world.spatial.configurations import SpatialConfigurations as SpaceRoom

PLATE = """<mujoco><option gravity="0 0 0"/><worldbody>
<geom type="box" size="{thick} 3 6" pos=".4 {left} 0"/>
<geom type="box" size="{thick} 3 6" pos=".4 {right} 0"/>
<body name="plate"><freejoint/><geom type="box" size=".1 .1 .01" mass="1"/></body>
<body name="ball" pos="-.5 {ball} 0"><joint name="along" type="slide" axis="1 0 0" range="-.3 .2"/>
<geom type="sphere" size=".03" mass="1"/></body>
</worldbody><actuator><position name="servo" joint="along" kp="10" kv="1"/></actuator></mujoco>"""
"""A plate before a wall with a slit, which is narrow in y and open in z; and a ball on a slide."""
ARM = """<mujoco><compiler angle="radian"/><worldbody><geom name="table" type="plane" size="2 2 .1"/>
<geom name="post" type="capsule" size=".03 .2" pos=".3 .3 .2"/>
<body name="box" pos=".6 0 .0502"><freejoint/><geom type="box" size=".05 .05 .05" mass=".5"/></body>
<body name="upper" pos="0 0 .3"><joint name="turn" axis="0 0 1" range="-3 3" limited="true"/>
<joint name="lift" axis="0 1 0" range="-1 1" limited="true"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".5"/>
<body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 1 0" range="-2 2" limited="true"/>
<geom type="capsule" fromto="0 0 0 .25 0 0" size=".02" mass=".3"/></body></body>
</worldbody><actuator><position name="turn" joint="turn" kp="9" kv="1"/>
<position name="lift" joint="lift" kp="9" kv="1"/><position name="elbow" joint="elbow" kp="9" kv="1"/>
</actuator></mujoco>"""
Make = Callable[..., SpaceScene]


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """A scene of a model's text, with a goal and other fields."""
    folder = tmp_path_factory.mktemp("models")

    def made(model: str, goal: str, **fields: Any) -> SpaceScene:
        path = folder / f"m{abs(hash(model))}.xml"
        path.write_text(model)
        actuator = mujoco.MjModel.from_xml_string(model).actuator(0).name
        given: dict[str, Any] = {
            "name": "placed", "model": {"file": str(path)}, "inputs": ["aim"], "goal": goal, "task": {},
            "parameters": {"aim": {"default": 0.0, "range": [-1.0, 1.0]}}, "controls": {actuator: "aim"},
        }  # fmt: skip
        scene = rw.load(given | fields)
        assert isinstance(scene, SpaceScene)
        return scene

    return made


def plate(half: float, thick: float = 0.02, ball: float = 0.0) -> str:
    return PLATE.format(left=3.0 + half, right=-3.0 - half, thick=thick, ball=ball)


BEYOND = "plate.x >= 0.7 and abs(plate.y) <= 0.05 and abs(plate.z) <= 0.05"


def way_of(plan: rw.Plan) -> Reals:
    return np.array([rw.State.of(plan.scene, parameters=plan.parameters).q, *plan.waypoints])


def configurations(scene: SpaceScene) -> Configurations:
    task = task_of(scene)
    return world_of(scene).configurations(task.parameters, task.size)


def rows_on(scene: SpaceScene, way: Reals, count: int = 1000) -> Reals:
    room = configurations(scene)
    return np.concatenate([room.between(a, b, np.linspace(0.0, 1.0, count)) for a, b in pairwise(way)])


def overlap(scene: SpaceScene, rows: Reals) -> float:
    """How deep MuJoCo's own contacts are at most."""
    model = scene.bind().model
    data, deepest = mujoco.MjData(model), 0.0
    for row in rows:
        data.qpos[:] = row
        mujoco.mj_fwdPosition(model, data)
        deepest = max([deepest, *(-data.contact.dist)])
    return float(deepest)


@pytest.mark.few(1)
@pytest.mark.parametrize("thick", [0.02, 1e-3])
def test_a_plate_goes_through_a_slit_turned(make: Make, thick: float) -> None:
    scene = make(plate(0.06, thick), BEYOND)
    plan = rw.plan(scene, to="geometric")
    assert plan.found, plan.reason
    rows = rows_on(scene, way_of(plan))
    assert overlap(scene, rows) <= 1e-4
    assert rw.ask(scene, "goal", rows[-1:]).holds[0]
    # Where its middle is within the slit, the plate is cut along a line that the slit is wide enough for.
    w, x, y, z = rows[np.abs(rows[:, 0] - 0.4) <= 0.005][:, 3:7].T
    across, up = 2.0 * (y * z - w * x), 1.0 - 2.0 * (x**2 + y**2)
    assert len(w)
    assert (0.095 * np.abs(up) <= 0.06 * np.hypot(across, up) + 0.01 * np.abs(across)).all()


@pytest.mark.long
def test_a_slit_that_is_thinner_than_the_plate_is_in_the_way(make: Make) -> None:
    plan = rw.plan(make(plate(0.009), BEYOND), to="geometric")
    assert plan.reason == "geometric @ 0.01: no path for the bodies was found, world being in the way"


def test_the_mirror_image_of_a_way_is_a_way_in_the_mirrored_scene(make: Make) -> None:
    aside = "plate.x >= 0.7 and plate.y >= 0.2 and plate.z >= 0.1"
    scene = make(plate(0.06, ball=0.1), aside)
    mirrored = make(plate(0.06, ball=-0.1), aside.replace("plate.y >= 0.2", "plate.y <= -0.2"))
    way = way_of(rw.plan(scene, to="geometric"))
    image = way * [1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0]
    rows = rows_on(mirrored, image)
    assert overlap(mirrored, rows) <= 1e-4
    assert rw.ask(mirrored, "goal", rows[-1:]).holds[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("plate.x >= 1 and plate.x <= -1", "no placement of the bodies was found at which it holds; at the"),
        ("ball.along >= 0.3", "these terms fail: ball.along >= 0.3 (by 0.1)"),
        ("gap(plate, ball) <= -0.035", "holds only where plate and ball overlap"),
        ("plate.qw ** 2 >= 1.1", "these terms fail: plate.qw ** 2 >= 1.1 (by 0.1)"),
    ],
)
def test_goals_that_cannot_be_are_told_before_anything_is_tried(make: Make, goal: str, words: str) -> None:
    plan = rw.plan(make(plate(0.03), goal))
    assert not plan.found
    assert plan.reason.startswith("goal: ")
    assert words in plan.reason
    assert not plan.records


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "goal",
    [
        "gap(plate, ball) <= 0", "plate.qx ** 2 >= 0.7", "gap(plate, ball) <= 0 and plate.y >= 0.1",
        "gap(plate, world) <= 0 and plate.qz >= 0.4",
    ],
)  # fmt: skip
def test_places_are_found_where_contacts_close_and_bodies_turn(make: Make, goal: str) -> None:
    scene = make(plate(0.03), goal)
    plan = rw.plan(scene, to="geometric")
    assert plan.found, plan.reason
    assert rw.ask(scene, goal, way_of(plan)[-1:]).holds[0]
    assert overlap(scene, rows_on(scene, way_of(plan))) <= 1e-4


@pytest.mark.long
def test_an_arm_reaches_over_the_table_within_its_ranges(make: Make) -> None:
    goal = "gap(fore, box) <= 0.01 and box.x <= 0.2 and box.y >= 0.3"
    scene = make(ARM, goal)
    plan = rw.plan(scene, to="geometric")
    assert plan.found, plan.reason
    way = way_of(plan)
    assert overlap(scene, rows_on(scene, way)) <= 1e-4
    assert (np.abs(way[:, 7:]) <= [3.0, 1.0, 2.0]).all()
    assert "; box travels " in str(plan).splitlines()[0]


@pytest.mark.long
def test_a_climb_says_that_nothing_touched_the_box(make: Make) -> None:
    scene = make(ARM, "box.x >= 0.65", task={"moves": [1, 1]})
    plan = rw.plan(scene, from_="geometric", to="kinematic", budget=300, threads=1)
    assert plan.records[0].how == "planned"
    told = plan.diagnosis[0]
    assert told.causes == ("untouched",)
    assert told.body == "box"
    assert told.details["untouched"]["moved"] >= 0.05
    assert told.details["untouched"]["touched"] == 0.0


def test_plans_of_places_are_saved_and_not_replayed(make: Make, tmp_path: Path) -> None:
    plan = rw.plan(make(plate(1.0), BEYOND), to="geometric", seed=3)
    again = rw.load_plan(plan.save(tmp_path / "plan.json"))
    assert again.waypoints == plan.waypoints
    assert again.waypoints == rw.plan(plan.scene, to="geometric", seed=3).waypoints
    with pytest.raises(rw.PlanError, match="it is of the geometric rung: it has places, but no inputs"):
        again.replay()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<equality><weld body1="box"/></equality>', "left out: bodies are joined"),
        (
            '<tendon><fixed range="-1 1" limited="true"><joint joint="turn" coef="1"/></fixed></tendon>',
            "left out: tendons bound places",
        ),
    ],
)
def test_what_else_bounds_places_is_left_to_richer_rungs(make: Make, more: str, words: str) -> None:
    plan = rw.plan(make(ARM.replace("</mujoco>", f"{more}</mujoco>"), "box.x >= 0.8"), to="geometric")
    assert words in plan.reason


@pytest.mark.long
def test_ways_keep_out_of_what_is_unsafe(make: Make) -> None:
    band = "abs(plate.x - 0.2) <= 0.02 and hypot(plate.y, plate.z - 1) >= 0.2"
    scene = make(plate(1.0), "plate.x >= 0.3 and abs(plate.z) <= 0.1", task={"keep_out": [band]})
    plan = rw.plan(scene, to="geometric")
    assert plan.found, plan.reason
    assert len(plan.waypoints) > 1
    assert not rw.ask(scene, band, rows_on(scene, way_of(plan))).holds.any()


def test_bodies_move_no_farther_than_is_said(make: Make) -> None:
    """Points of all geoms, on straight ways between places that are drawn."""
    scene = make(ARM, "box.x >= 1")
    room, model = configurations(scene), scene.bind().model
    data, rng, q = mujoco.MjData(model), np.random.default_rng(0), rw.State.of(scene).q
    for _ in range(20):
        a, b = room.changed(q, rng.normal(0.0, 1.0, (2, model.nv)))
        rows = room.between(a, b, np.linspace(0.0, 1.0, 200))
        most = room.moved(room.look(np.stack([a, b]))[1])[0]
        points = []
        for row in rows:
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            points.append(data.geom_xpos + data.geom_xmat[:, [0, 3, 6]] * model.geom_aabb[:, 3:4])
        moved = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum(axis=0)
        assert (moved <= most[model.geom_bodyid] * (1.0 + 1e-9)).all()


def test_half_way_of_a_turn_is_half_the_turn(make: Make) -> None:
    scene = make(plate(0.03), BEYOND)
    room, a = configurations(scene), rw.State.of(scene).q
    b = a.copy()
    b[3:7] = [-math.cos(0.5), 0.0, 0.0, -math.sin(0.5)]  # a turn by 1 about z, of the other sign
    middle = room.between(a, b, np.array([0.5]))[0]
    assert np.abs(middle[3:7] @ [math.cos(0.25), 0.0, 0.0, math.sin(0.25)]) == pytest.approx(1.0)
    assert room.lengths(np.stack([a, middle, b])) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("name", ["arm_push", "three_fingers", "pile", "peg"])
def test_geoms_that_may_touch_are_those_that_mujoco_lets_touch(name: str) -> None:
    scene = rw.load(name)
    assert isinstance(scene, SpaceScene)
    bound = scene.bind()
    model, data, rng = bound.model, mujoco.MjData(bound.model), np.random.default_rng(0)
    known, distance = set(map(tuple, touching_pairs(model).tolist())), mujoco.mj_geomDistance
    for _ in range(50):
        mujoco.mj_integratePos(model, data.qpos, 0.3 * rng.standard_normal(model.nv), 1.0)
        mujoco.mj_fwdPosition(model, data)
        touched = {tuple(sorted(pair)) for pair in data.contact.geom.tolist()}
        assert touched <= known
        deep = {(a, b) for a, b in known if distance(model, data, a, b, 1.0, None) < -1e-3}
        assert deep <= touched


def test_gaps_are_those_that_questions_answer(make: Make) -> None:
    scene = make(ARM, "box.x >= 1")
    room = configurations(scene)
    assert isinstance(room, SpaceRoom)
    rows = room.changed(rw.State.of(scene).q, np.random.default_rng(1).normal(0.0, 0.3, (20, 9)))
    asked, found = rw.geometry(scene, rows), room.look(rows)[0]
    for pair, gaps in zip(room.pairs, found.T, strict=True):
        k = asked.contacts.index((asked.bodies[pair[0]], asked.bodies[pair[1]]))
        assert gaps == pytest.approx(asked.gaps[:, k], abs=1e-12)
