"""Arms in space with more joints than a touch takes: joints that are held, touches clear of all else, lag."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.arm_paths import arms_way
from rungwise.planning.modes.balance import modes, motion
from rungwise.planning.modes.fingers import contacts_of, fingers_of
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.tried import covered, supposed
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of
from rungwise.world.find import world_of

JOINTS = {"yaw": 0.0, "shoulder": -0.8, "elbow": 1.5, "pitch": 0.87, "roll": 0.3}
ARM = """<mujoco><compiler angle="radian"/><worldbody><geom name="table" type="plane" size="1 1 .1"/>
<body name="box" pos=".42 0 .03"><freejoint/><geom type="box" size=".06 .04 .03" mass=".3"/></body>
<body name="turret" pos="0 0 .2"><joint name="yaw" axis="0 0 1"/><geom size=".02"/>
<body name="upper"><joint name="shoulder" axis="0 1 0"/>
<geom type="capsule" fromto=".05 0 0 .25 0 0" size=".02"/>
<body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 1 0"/>
<geom type="capsule" fromto=".05 0 0 .25 0 0" size=".02"/>
<body name="wrist" pos=".3 0 0"><joint name="pitch" axis="0 1 0"/><geom size=".02"/>
<body name="hand"><joint name="roll" axis="1 0 0" damping=".4"/>
<geom type="box" size=".01 .03 .01" pos=".02 0 0"/>
<body name="left" pos=".03 0 0"><joint name="left" type="slide" axis="0 1 0" range="0 .03"/>
<geom type="capsule" fromto="0 .012 0 .07 .012 0" size=".008"/></body>
<body name="right" pos=".03 0 0"><joint name="right" type="slide" axis="0 -1 0" range="0 .03"/>
<geom type="capsule" fromto="0 -.012 0 .07 -.012 0" size=".008"/></body>
</body></body></body></body></body></worldbody><actuator>
<position name="yaw" joint="yaw" kp="60" kv="6"/><position name="shoulder" joint="shoulder" kp="60" kv="6"/>
<position name="elbow" joint="elbow" kp="60" kv="6"/><position name="pitch" joint="pitch" kp="20" kv="2"/>
<position name="roll" joint="roll" kp="20" kv="2"/><position name="left" joint="left" kp="500" kv="5"/>
<position name="right" joint="right" kp="500" kv="5"/></actuator></mujoco>"""


JOINED = '</actuator><equality><joint joint1="left" joint2="right"/></equality>'


def arm(folder: Path, model: str = ARM, goal: str = "box.x >= 0.5", **told: str | float) -> Ground:
    """A box on a table among an arm of five hinges that inputs lead, with two jaws that are held."""
    (folder / "arm.xml").write_text(model)
    bodies = {"yaw": "turret", "shoulder": "upper", "elbow": "fore", "pitch": "wrist", "roll": "hand"}
    scene = rw.load({
        "name": "arm", "model": {"file": str(folder / "arm.xml")}, "inputs": list(JOINTS),
        "parameters": {name: {"default": angle, "range": [-3, 3]} for name, angle in JOINTS.items()},
        "controls": {name: name for name in JOINTS} | {"left": 0.002, "right": 0.0} | told,
        "start": {"places": {f"{bodies[name]}.{name}": angle for name, angle in JOINTS.items()}},
        "contacts": [{"friction": 0.4, "stiffness": 1e5, "damping": 200}],
        "goal": goal, "duration": 4.0, "step": 2e-3,
        "task": {"fingers": {"left": {"speed": 0.1, "clearance": 0.015}}, "moves": [1, 4]},
    })  # fmt: skip
    task = task_of(scene)
    around = world_of(scene).surroundings(task.parameters)
    assert around is not None
    return Ground.of(task, around, fingers_of(task), scene.template.bodies.index("box"))


def test_joints_that_are_held_are_none_of_the_arm_and_what_hangs_on_them_is(tmp_path: Path) -> None:
    """The other jaw is no surroundings on which the box might rest, and keeps away from it."""
    ground = arm(tmp_path)
    finger, names = ground.fingers[0], ground.task.scene.template.contacts
    assert len(finger.carrier.places) == len(JOINTS) and finger.is_redundant
    assert finger.carrier.servos.lag == pytest.approx(2.4 / 20.0)
    assert [names[k] for k in ground.pairs] == [("world", "box")]
    assert ("box", "right") in [names[k] for k in ground.avoided]
    assert {"upper", "hand", "right"} <= {
        name for k in contacts_of(ground.fingers[0], ground.task, ground.around) for name in names[k]
    }


@pytest.mark.parametrize("told", ["0.002 * t", "0.01 * yaw"])
def test_joints_that_time_or_shared_inputs_lead_are_not_held(tmp_path: Path, told: str) -> None:
    with pytest.raises(rw.InputError, match=r"task\.fingers\.left: needs inputs, one for each of"):
        arm(tmp_path, left=told)


def test_an_arm_touches_sides_of_a_box_clear_of_the_table_and_with_one_jaw_alone(tmp_path: Path) -> None:
    ground = arm(tmp_path)
    q = world_of(ground.task.scene).at(ground.task.parameters).q
    parts = (np.arange(0.5, 240) / 240)[::8]
    points, normals = ground.around.outline(ground.body)(parts)
    sides = (np.abs(normals[:, 2]) < 0.5) & (np.abs(points[:, 2]) < 0.02)
    free = 0
    for part in parts[sides].tolist():
        place = ground.placed(q, 0, part)
        if place is None:
            continue
        seen, used = ground.look(place), np.ones(1, np.int64)
        if ground.begins_free(seen, used) and seen.held[0] >= 0:
            free += 1
            assert (ground.around.least(place, ground.avoided) >= ground.kept_apart).all()
            assert abs(ground.part(seen, 0)[0] - part) < 0.02 or not ground.is_held(seen, used)
    assert free >= 0.7 * sides.sum()


def test_links_of_an_arm_are_kept_off_what_is_on_their_way(tmp_path: Path) -> None:
    """The wrist would go through the box where the jaws pass above it."""
    ground = arm(tmp_path)
    q = world_of(ground.task.scene).at(ground.task.parameters).q
    finger = ground.fingers[0]
    ends = [finger.put(q, np.array([turn, -0.3, 1.2, -2.47, 0.0])) for turn in (-0.4, 0.4)]
    own = contacts_of(finger, ground.task, ground.around)
    assert min(ground.around.least(end, own).min() for end in ends) > 0.0
    way = arms_way(ground, *ends, np.array([0]), 0, lambda: True)
    assert way is not None
    for a, b in pairwise(way):
        for part in np.linspace(0.0, 1.0, 30):
            there = finger.put(a, finger.drives(a) + part * (finger.drives(b) - finger.drives(a)))
            assert ground.around.least(there, own).min() > 0.0


def test_places_at_the_goal_lie_on_the_table_also_where_jaws_are_joined(tmp_path: Path) -> None:
    """As they do where they are not: joints between bodies of the robot say nothing of the object."""
    goal = "hypot(box.x - 0.5, box.y - 0.1) <= 0.01 and abs(angle_about(box, z) - 0.8) <= 0.1"
    ground = arm(tmp_path, ARM.replace("</actuator>", JOINED), goal)
    work = begin(ground.task, Budget(None, None), 0, 1)
    q, places = work.start.q[0], goals_of(work)
    assert len(places) and rw.ask(ground.task.scene, goal, places).holds.all()
    assert ground.around.least(places[0], ground.pairs) == pytest.approx([0.0], abs=1e-3)
    own = places[:, ground.places]
    assert np.linalg.norm(own[:, 3:], axis=1) == pytest.approx(np.ones(len(places)), abs=1e-9)
    assert own[0, 4:6] == pytest.approx([0.0, 0.0], abs=1e-3) and own[0, 2] == pytest.approx(0.03, abs=1e-3)
    others = np.setdiff1d(np.arange(len(q)), ground.places)
    assert (places[:, others] == q[others]).all()


@pytest.mark.parametrize(("raised", "lies"), [(0.0, True), (1e-5, True), (-1e-5, True), (0.01, False)])
def test_no_finger_touches_an_object_where_it_lies_on_a_table(
    tmp_path: Path, raised: float, lies: bool
) -> None:
    """Also where they overlap a little; where the object is raised there is room under it."""
    ground = arm(tmp_path)
    q = world_of(ground.task.scene).at(ground.task.parameters).q.copy()
    q[ground.places[2]] += raised
    parts = np.arange(0.5, 240) / 240
    points, normals = ground.around.outline(ground.body)(parts)
    under = normals[:, 2] < -0.5
    assert under.any() and (covered(ground, ground.look(q), parts) == (under & lies)).all()
    room = ground.around.room(q, ground.body, points[under], normals[under], ground.pairs)
    assert room == pytest.approx(np.full(len(room), raised), abs=1e-9)
    none = ground.around.room(q, ground.body, points, normals, ground.avoided)
    assert np.isinf(none[under]).all()


@pytest.mark.long
def test_a_touch_is_supposed_to_be_as_it_is_where_an_arm_is_placed(tmp_path: Path) -> None:
    ground, one = arm(tmp_path), np.ones(1, np.int64)
    q = world_of(ground.task.scene).at(ground.task.parameters).q
    begun, compared = ground.look(q), 0
    want = ground.off(q, ground.around.changed(q, np.eye(len(ground.around.owners))[0] * 0.05))
    for part in ((np.arange(0.5, 240) / 240)[::6]).tolist():
        place = ground.placed(q, 0, part)
        seen = None if place is None else ground.look(place)
        if seen is None or seen.held[0] < 0 or abs(ground.part(seen, 0)[0] - part) > 1e-3:
            continue
        hoped = supposed(ground, begun, one, one, np.array([part]))
        theirs, ours = (each.touches.rows[each.held[0]][:, ground.columns] for each in (seen, hoped))
        assert ours[0] == pytest.approx(theirs[0], abs=2e-3)
        across = [rows[1:].T @ rows[1:] for rows in (theirs, ours)]
        # A jaw along a side touches it at several heights, of which one is the nearest.
        assert across[1] == pytest.approx(across[0], abs=6e-3)
        assert hoped.touches.friction[hoped.held[0]] == seen.touches.friction[seen.held[0]]
        compared += 1
        for mode, _ in modes(ground, begun, want)[:2]:
            moves = [motion(ground, each, one, mode, want, 0.05) is not None for each in (seen, hoped)]
            assert moves[0] == moves[1]
    assert compared >= 5
