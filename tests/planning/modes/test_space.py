"""Contact modes in space: surfaces, what touches, cones of eight edges, pushes over a floor, plans of
fingers."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.modes.balance import carried, drags, is_led, modes, motion, rests
from rungwise.planning.modes.fingers import fingers_of
from rungwise.planning.modes.forces.cones import SLIDE, STICK, memory_for
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.guide import guide
from rungwise.planning.task.task import task_of
from rungwise.scene.space import SpaceScene
from rungwise.world.carriers import Surroundings, turn_of
from rungwise.world.find import world_of

BOX = '<geom name="object" type="box" size=".06 .04 .04" mass=".4"/>'
HOMES = {1: [(-0.2, 0.0)], 2: [(-0.2, 0.0), (0.2, 0.0)], 3: [(-0.2, 0.0), (0.1, 0.17), (0.1, -0.17)]}


def fingers(
    folder: Path, count: int, goal: str, body: str = BOX, high: float = 0.04, others: str = "",
    friction: float = 0.4,
) -> SpaceScene:  # fmt: skip
    """A body on a floor, and fingers on three slides each with servos."""
    bodies, drives, names = list[str](), list[str](), list[str]()
    for k, (x, y) in enumerate(HOMES[count]):
        joints = "".join(
            f'<joint name="{axis}{k}" type="slide" axis="{way}" range="{room}" damping="2"/>'
            for axis, way, room in zip(
                "xyz", ("1 0 0", "0 1 0", "0 0 1"), ("-.5 .5", "-.5 .5", "-.15 .4"), strict=True
            )
        )  # fmt: skip
        bodies.append(f'<body name="finger{k}" pos="{x} {y} .1">{joints}<geom size=".012" mass=".1"/></body>')
        for axis in "xyz":
            names.append(f"{axis}{k}")
            drives.append(
                f'<position name="{axis}{k}" joint="{axis}{k}" kp="800" kv="40" forcerange="-15 15"/>'
            )
    (folder / "fingers.xml").write_text(
        f'<mujoco><compiler angle="radian"/><worldbody><geom name="floor" type="plane" size="1 1 .1"/>'
        f'<body name="object" pos="0 0 {high}"><freejoint/>{body}</body>{others}{"".join(bodies)}</worldbody>'
        f"<actuator>{''.join(drives)}</actuator></mujoco>"
    )
    law = {"stiffness": 1e5, "damping": 200}
    scene = rw.load({
        "name": "fingers", "model": {"file": str(folder / "fingers.xml")}, "inputs": names,
        "parameters": {name: {"default": 0.0, "range": [-0.5, 0.5]} for name in names},
        "controls": {name: name for name in names},
        "contacts": [{"between": ["object", "floor"], "friction": friction, **law}, {"friction": 0.8, **law}],
        "goal": goal, "duration": 4.0, "step": 2e-3,
        "task": {
            "fingers": {"finger*": {"speed": 0.1, "clearance": 0.015, "press": [0.05, 8]}}, "moves": [1, 6],
        },
    })  # fmt: skip
    assert isinstance(scene, SpaceScene)
    return scene


def ground_of(scene: SpaceScene) -> tuple[Ground, Seen]:
    task = task_of(scene)
    around = world_of(scene).surroundings(task.parameters)
    assert around is not None
    ground = Ground.of(task, around, fingers_of(task), scene.template.bodies.index("object"))
    return ground, ground.look(world_of(scene).at(task.parameters).q)


def touching(ground: Ground, q: Reals, points: list[Reals]) -> tuple[Seen, Reals]:
    """What is seen where the first fingers touch next to points of the object's frame."""
    used = np.zeros(len(ground.fingers), np.int64)
    for f, point in enumerate(points):
        part, _ = ground.around.outline(ground.body).part_of(point)
        found = ground.placed(q, f, part)
        assert found is not None
        q, used[f] = found, 1
    return ground.look(q), used


SHAPES = {
    "box": ('type="box" size=".06 .04 .02"', 8 * (0.06 * 0.04 + 0.04 * 0.02 + 0.02 * 0.06)),
    "sphere": ('size=".05"', 4 * math.pi * 0.05**2),
    "capsule": ('type="capsule" size=".02 .05"', 4 * math.pi * 0.02 * (0.05 + 0.02)),
    "cylinder": ('type="cylinder" size=".03 .05"', 2 * math.pi * 0.03 * (2 * 0.05 + 0.03)),
    "ellipsoid": ('type="ellipsoid" size=".06 .04 .02"', None),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("shape", SHAPES)
def test_places_lie_on_the_surface_evenly_and_normals_point_outwards(tmp_path: Path, shape: str) -> None:
    """The integral of the place along the normal is three times the volume; that of the normal vanishes."""
    words, area = SHAPES[shape]
    scene = fingers(
        tmp_path, 1, "object.x >= 1", f'<geom {words} pos=".01 0 0" euler=".3 .2 .1" mass=".2"/>', 0.2
    )
    ground, _ = ground_of(scene)
    points, normals = ground.around.outline(ground.body)(np.arange(0.5, 960) / 960)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    assert np.abs(normals.mean(axis=0)).max() < 0.12
    bound = scene.bind(None)
    volume = {
        "box": 8 * 0.06 * 0.04 * 0.02, "sphere": 4 / 3 * math.pi * 0.05**3,
        "capsule": math.pi * 0.02**2 * (0.1 + 4 / 3 * 0.02), "cylinder": math.pi * 0.03**2 * 0.1,
    }  # fmt: skip
    if area is not None:
        middle = points - bound.model.body_ipos[ground.body]
        assert area * (middle * normals).sum(axis=1).mean() / 3.0 == pytest.approx(volume[shape], rel=0.08)


def test_places_within_another_geom_of_the_body_are_none(tmp_path: Path) -> None:
    tee = (
        '<geom type="box" size=".06 .02 .02" mass=".2"/>'
        '<geom type="box" size=".02 .04 .02" pos="0 -.06 0" mass=".2"/>'
    )
    ground, _ = ground_of(fingers(tmp_path, 1, "object.x >= 1", tee, 0.02))
    points, _ = ground.around.outline(ground.body)(np.arange(0.5, 960) / 960)
    seam = (np.abs(points[:, 0]) < 0.02 - 1e-6) & (np.abs(points[:, 1] + 0.02) < 1e-9)
    assert not seam.any()


def check_rates(around: Surroundings, q: Reals, rng: np.random.Generator) -> None:
    """Rows of gaps beside differences."""
    change = 1e-6 * rng.normal(size=len(around.owners))
    seen = around.touches(q, 0.02)
    after = around.touches(around.changed(q, change), 0.02)
    for k, feature in enumerate(seen.features.tolist()):
        same = np.flatnonzero(after.features == feature)
        if len(same) == 1 and (seen.features == feature).sum() == 1:
            moved = after.gaps[same[0]] - seen.gaps[k]
            assert moved == pytest.approx(float(seen.rows[k, 0] @ change), abs=2e-9)
    assert around.change(q, around.changed(q, change)) == pytest.approx(change, abs=1e-12)


def test_rows_of_what_touches_are_rates_of_gaps(tmp_path: Path) -> None:
    ground, seen = ground_of(fingers(tmp_path, 2, "object.x >= 1"))
    rng = np.random.default_rng(0)
    held, _ = touching(ground, seen.q, [np.array([-0.06, 0.01, 0.0]), np.array([0.06, 0.0, 0.01])])
    assert len(held.closed) == 4 and (held.held >= 0).all()
    for _ in range(5):
        check_rates(ground.around, held.q, rng)
    near = ground.around.near(seen.q, int(ground.own[0]))
    own = ground.around.near(ground.around.changed(seen.q, 1e-6 * near.rows[0]), int(ground.own[0]))
    assert own.gap - near.gap == pytest.approx(1e-6 * float(near.rows[0] @ near.rows[0]), rel=1e-3)


def test_cones_in_space_have_eight_edges_within_them() -> None:
    ring = memory_for(1, 1, 0, 6, 9, 2).ring
    assert ring.shape == (8, 2) and np.linalg.norm(ring, axis=1) == pytest.approx(1.0)
    assert np.abs(ring.sum(axis=0)).max() < 1e-12


def test_quaternions_turn_as_rotations_do() -> None:
    rng = np.random.default_rng(0)
    w = rng.normal(size=4)
    turn = turn_of(w)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(turn) == pytest.approx(1.0)
    assert turn == pytest.approx(turn_of(-w))


def test_a_push_behind_the_centre_leads_ahead_and_one_beside_it_turns(tmp_path: Path) -> None:
    """One finger does not lead a box; the friction of the floor says how it turns: as far to one side as, at
    the mirrored place, to the other."""
    ground, seen = ground_of(fingers(tmp_path, 1, "object.x >= 1"))
    want = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    turned = []
    slides = (SLIDE,) * len(seen.closed)
    for y in (0.0, 0.02, -0.02):
        points, normals = ground.around.outline(ground.body)(np.arange(0.5, 960) / 960)
        own = points[(normals[:, 0] < -0.9) & (np.abs(points[:, 2]) < 0.02)]
        begun, used = touching(ground, seen.q, [own[np.abs(own[:, 1] - y).argmin()]])
        assert carried(ground, begun) is None and not is_led(ground, begun, used, slides)
        assert drags(ground, begun, slides)
        found = motion(ground, begun, used, slides, want, 0.05)
        assert found is not None and found.change[0] > 0.0
        assert found.change[2:5] == pytest.approx(0.0, abs=1e-9)
        turned.append(found.change[5] / found.change[0])
    assert abs(turned[0]) < 2.0 and turned[1] < 0.0 < turned[2]


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_a_finger_that_presses_on_top_drags_against_the_friction_of_its_own_load(
    tmp_path: Path, seed: int
) -> None:
    """The floor resists with its friction times weight and load. Where it has as much friction as the finger,
    no load is enough."""
    rng = np.random.default_rng(seed)
    x, y, z = rng.uniform(0.05, 0.07), rng.uniform(0.03, 0.05), rng.uniform(0.01, 0.03)
    mass, way = rng.uniform(0.1, 1.0), rng.uniform(0.0, 2.0 * math.pi)
    body = f'<geom name="object" type="box" size="{x} {y} {z}" mass="{mass}"/>'
    want = 0.1 * np.array([math.cos(way), math.sin(way), 0.0, 0.0, 0.0, 0.0])
    for friction, drags_on in ((0.4, True), (rng.uniform(0.1, 0.5), True), (0.9, False)):
        ground, seen = ground_of(fingers(tmp_path, 1, "object.x >= 1", body, z, friction=friction))
        ground = replace(ground, fingers=tuple(replace(each, press=(0.0, 1e3)) for each in ground.fingers))
        off = rng.uniform(-0.1, 0.1, 2) * [x, y]
        begun, used = touching(ground, seen.q, [np.array([*off, z])])
        found = motion(ground, begun, used, (SLIDE,) * len(seen.closed), want, 0.05)
        assert (found is not None) == drags_on
        if found is not None:
            *along, down = found.pushes[ground.fingers[0].moved]
            load = mass * 9.81 - down
            assert down < 0.0 and math.hypot(*along) == pytest.approx(friction * load, rel=0.05)


@pytest.mark.few(1)
@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("side", [0.0, 0.12])
def test_a_way_past_a_post_keeps_an_object_on_its_floor(tmp_path: Path, side: float, own: bool) -> None:
    """Where the post is beside the straight way there is nothing to go around; the post may be a body of its
    own, or, as the floor, a part of the world."""
    body, world = (f'pos=".13 {side} .04"', "") if own else ("", f'pos=".13 {side} .04"')
    post = f'<geom type="cylinder" size=".02 .04" {world}/>'
    post = f'<body name="post" {body}>{post}</body>' if own else post
    ground, seen = ground_of(fingers(tmp_path, 1, "object.x >= 1", others=post))
    change = np.zeros(len(ground.around.owners))
    change[ground.columns] = [0.26, 0.0, 0.0, 0.0, 0.0, 0.7]
    goal = ground.around.changed(seen.q, change)
    way = guide(ground, seen.q, goal, 0, lambda: True)
    assert way is not None and (len(way) > 2) == (side == 0.0)
    for a, b in pairwise(way):
        for part in np.linspace(0.0, 1.0, 20):
            q = ground.around.changed(a, part * ground.around.change(a, b))
            assert len(ground.look(q).closed) == 4
            assert ground.around.least(q, ground.pairs).min() > -1e-9
    if len(way):
        assert ground.away(way[0], seen.q) < 1e-9 and ground.away(way[-1], goal) < 1e-6


def test_two_fingers_lead_a_box_on_a_floor_and_three_hold_one_above_it(tmp_path: Path) -> None:
    ground, seen = ground_of(fingers(tmp_path, 3, "object.z >= 1", high=0.2))
    assert not len(seen.closed) and rests(ground, seen, np.zeros(3, np.int64)) is None
    places = [np.array([-0.06, 0.0, 0.0]), np.array([0.02, 0.04, 0.0]), np.array([0.02, -0.04, 0.0])]
    held, used = touching(ground, seen.q, places)
    pushes = rests(ground, held, used)
    assert pushes is not None
    carriers = [finger.moved[2] for finger in ground.fingers]
    assert -pushes[carriers].sum() == pytest.approx(-0.4 * 9.81, rel=1e-4)
    assert is_led(ground, held, used, ())
    ground, seen = ground_of(fingers(tmp_path, 2, "object.x >= 1"))
    held, used = touching(ground, seen.q, [np.array([-0.06, 0.02, 0.0]), np.array([-0.06, -0.02, 0.0])])
    want = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    slides = modes(ground, held, want)[0][0]
    assert set(slides) == {SLIDE} and is_led(ground, held, used, slides)
    assert not is_led(ground, held, np.array([1, 0]), slides)
    found = motion(ground, held, used, slides, want, 0.05)
    assert found is not None and found.change == pytest.approx([0.1, 0, 0, 0, 0, 0], abs=1e-9)
    force = found.pushes[[finger.moved[0] for finger in ground.fingers]].sum()
    assert 0.8 * 0.4 * 0.4 * 9.81 < force < 1.1 * 0.4 * 0.4 * 9.81
    assert STICK not in slides


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "floor_push",
        *(pytest.param(name, marks=pytest.mark.long) for name in ("arm_turn", "block_turn", "door")),
    ],
)
def test_a_scene_with_fingers_in_space_is_planned_and_holds_at_a_tenth_of_the_error(name: str) -> None:
    plan = rw.plan(name, seed=0)
    assert plan.found, plan.reason
    assert plan.stage is not None and plan.stage.model is rw.DYNAMIC_COMPLIANT
    assert {"touch", "follow"} <= set(plan.labels)
    assert plan.replay(tol=0.1 * plan.tol).outcome == rw.Outcome.GOAL


@pytest.mark.long
def test_three_fingers_lift_and_turn_a_ball(tmp_path: Path) -> None:
    goal = "object.z >= 0.08 and abs(angle_about(object, z) - 0.6) <= 0.1"
    ball = '<geom name="object" size=".05" mass=".2"/>'
    plan = rw.plan(fingers(tmp_path, 3, goal, ball, 0.05), seed=0)
    assert plan.found, plan.reason
    assert plan.replay(tol=0.1 * plan.tol).outcome == rw.Outcome.GOAL


def test_an_arm_of_few_joints_is_placed_on_a_surface_beside_the_points_that_it_misses() -> None:
    """Its tool stands upright at one height: points of other heights are touched above or below them."""
    task = task_of(rw.load("arm_turn"))
    around, scene = world_of(task.scene).surroundings(task.parameters), task.scene
    assert around is not None
    ground = Ground.of(task, around, fingers_of(task), scene.template.bodies.index("box"))
    q, off = world_of(scene).at(task.parameters).q, list[float]()
    points, _ = ground.around.outline(ground.body)(np.arange(0.5, 960) / 960)
    for part in np.linspace(0.01, 0.99, 16).tolist():
        place = ground.placed(q, 0, part)
        if place is not None:
            seen = ground.look(place)
            assert ground.fingers[0].reaches(place, around)
            at, turned = seen.touches.poses[ground.body, :3], turn_of(seen.touches.poses[ground.body, 3:])
            wanted = at + turned @ points[int(part * len(points))]
            off.append(float(np.linalg.norm((seen.touches.points[seen.held[0]] - wanted)[:2])))
    assert len(off) >= 6 and sum(each < 2e-3 for each in off) >= 6


def test_what_presses_a_finger_of_hinges_is_torque_over_lever() -> None:
    finger = fingers_of(task_of(rw.load("arm_turn")))[0]
    levers = finger.carrier.levers
    assert levers[0] > levers[1] > levers[2] > 0.03
    assert finger.press[1] == pytest.approx(0.9 * min(20 / levers[0], 20 / levers[1], 2 / levers[2]))


@pytest.mark.parametrize(("angle", "axis"), [(0.5, "z"), (3.0, "z"), (-2.0, "x"), (1.0, "y")])
def test_a_turn_about_an_axis_is_that_of_the_quaternion_and_its_negative(angle: float, axis: str) -> None:
    """Also where another axis is tilted first."""
    scene = rw.load("ball")
    names = list(scene.template.coordinates)
    for sign in (1.0, -1.0):
        state = rw.State.of(scene)
        q = state.q.copy()
        q[[names.index(f"ball.q{each}") for each in "wxyz"]] = 0.0
        q[names.index("ball.qw")] = sign * math.cos(angle / 2)
        q[names.index(f"ball.q{axis}")] = sign * math.sin(angle / 2)
        found = rw.ask(scene, f"angle_about(ball, {axis}) >= 0", replace(state, q=q))
        assert found.values[0, 0] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize("far", [1.0, 10.0, 1e3, 1e6])
def test_what_lies_far_away_has_a_gap_and_a_normal(far: float) -> None:
    """Also beyond where distances are measured; a ball that has rolled off a table goes on falling."""
    task = task_of(rw.load("ball_turn"))
    around, q = world_of(task.scene).surroundings(task.parameters), rw.State.of(task.scene).q.copy()
    assert around is not None
    q[task.scene.template.coordinates.index("ball.z")] += far
    for pair, names in enumerate(task.scene.template.contacts):
        near = around.near(q, pair)
        assert np.linalg.norm(near.normal) == pytest.approx(1.0)
        assert near.gap > 0.5 or "ball" not in names
