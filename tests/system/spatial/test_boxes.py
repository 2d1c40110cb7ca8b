"""Contacts of boxes face to face, where MuJoCo alone finds one of two edges every tenth time."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rungwise.system.spatial.boxes import Boxes

WALL, BOX = np.array([0.1, 0.2, 0.09]), np.array([0.1, 0.1, 0.1])
MODEL = """<mujoco><worldbody><body pos="0 0 .1"><geom type="box" size=".1 .2 .09"/></body>
<body><freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody></mujoco>"""

PLATE = """<mujoco><worldbody><body pos="0 0 .04"><geom type="box" size=".05 .04 .04"/></body>
<body><freejoint/><geom type="box" size=".03 .006 .025"/></body></worldbody></mujoco>"""


def collided(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """With the contacts that MuJoCo finds."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return data


def placed(model: mujoco.MjModel, gap: float, turn: np.ndarray) -> mujoco.MjData:
    """Contacts of the box that stands beside the wall, turned by a vector (3,)."""
    data = mujoco.MjData(model)
    data.qpos[:3] = 0.2 + gap, 0.02, 0.1
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(data.qpos[3:], turn / max(angle, 1e-300), angle)
    return collided(model, data)


def test_boxes_face_to_face_have_four_contacts_however_little_they_are_turned() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    model.geom_margin[:] = 0.05
    boxes, draw, mended = Boxes(model), np.random.default_rng(0), 0
    for _ in range(300):
        turn = draw.normal(size=3) * 10.0 ** draw.uniform(-16.0, -6.0)
        gap = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-16.0, -4.0)
        data = placed(model, gap, turn)
        before = data.ncon
        boxes.mend(data)
        mended += before == 1
        assert data.ncon == 4
        for contact in data.contact:
            np.testing.assert_allclose(contact.frame[:3], [1.0, 0.0, 0.0], atol=1e-5)
            frame = contact.frame.reshape(3, 3)
            np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
            corner = np.array([-0.1, *(contact.pos - [0.2 + gap, 0.02, 0.1])[1:]])
            place = corner + np.cross(turn, corner) + [0.2 + gap, 0.02, 0.1]
            assert contact.dist == pytest.approx(place[0] - WALL[0], abs=1e-9)
        assert sorted(round(contact.pos[1], 3) for contact in data.contact) == [-0.08, -0.08, 0.12, 0.12]
    assert mended > 10


def test_boxes_edge_to_edge_keep_their_one_contact() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    model.geom_margin[:] = 0.05
    data = mujoco.MjData(model)
    turned = np.zeros(4)
    data.qpos[:3] = 0.24, 0.02, 0.3
    mujoco.mju_euler2Quat(turned, np.array([0.5, 0.7, 0.3]), "xyz")
    data.qpos[3:] = turned
    collided(model, data)
    before = [(contact.dist, *contact.pos) for contact in data.contact]
    Boxes(model).mend(data)
    assert [(contact.dist, *contact.pos) for contact in data.contact] == before


def pressed(model: mujoco.MjModel, at: np.ndarray, depth: float, turn: np.ndarray) -> mujoco.MjData:
    """Contacts of a plate that is turned by a vector (3,) and pressed on the side of a box so deep, with its
    centre at x and z."""
    data, turned, half = mujoco.MjData(model), np.zeros(9), np.array([0.03, 0.006, 0.025])
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(data.qpos[3:], turn / angle, angle)
    mujoco.mju_quat2Mat(turned, data.qpos[3:])
    data.qpos[:3] = at[0], 0.04 + np.abs(turned[3:6]) @ half - depth, at[1]
    return collided(model, data)


def test_a_plate_that_presses_at_a_small_angle_and_hangs_over_an_edge_touches_with_its_face() -> None:
    """On the normals of faces the boxes overlap most beyond the edge, where they do not touch."""
    model = mujoco.MjModel.from_xml_string(PLATE)
    model.geom_margin[:] = 1e-3
    boxes, draw, mended = Boxes(model), np.random.default_rng(0), 0
    for _ in range(300):
        lean, twist, turn = draw.uniform(-1.0, 1.0, size=3) * [1e-4, 1e-2, 1e-4]
        data = pressed(model, np.array([0.005, 0.08]), 2e-5, np.array([lean, twist, turn]))
        before = data.ncon
        boxes.mend(data)
        mended += before == 1
        assert data.ncon > 3
        for contact in data.contact if before == 1 else ():
            x, _, z = contact.pos - data.qpos[:3]
            gap = data.qpos[1] - 0.046 + x * turn - z * lean
            assert contact.pos[2] < 0.08 + 1e-6 and contact.dist == pytest.approx(gap, abs=2e-7)
    assert mended > 20


@pytest.mark.long
@pytest.mark.parametrize(
    ("least", "most", "depth", "deepest"), [(3e-3, 6e-3, 1e-4, 1e-5), (0.2, 0.6, 2e-3, 2e-3)]
)
def test_edges_that_cross_where_faces_press_at_no_other_point_keep_their_one_contact(
    least: float, most: float, depth: float, deepest: float
) -> None:
    """So do those of boxes that overlap more between their faces than by their edges."""
    model = mujoco.MjModel.from_xml_string(PLATE)
    model.geom_margin[:] = 1e-3
    boxes, draw, single = Boxes(model), np.random.default_rng(1), 0
    for _ in range(2000):
        turn = draw.uniform(least, most, 3) * draw.choice([-1.0, 1.0], 3)
        data = pressed(model, draw.uniform([0.04, 0.08], [0.06, 0.1]), depth, turn)
        normals = np.hstack([np.eye(3), data.geom_xmat[1].reshape(3, 3)]).T
        if data.ncon != 1 or np.abs(normals @ data.contact.frame[0, :3]).max() > 1.0 - 1e-9:
            continue
        if not -deepest < data.contact.dist[0] < 0.0:
            continue
        before = [data.contact.dist[0], *data.contact.frame[0]]
        boxes.mend(data)
        single += 1
        assert data.ncon == 1 and [data.contact.dist[0], *data.contact.frame[0]] == before
    assert single > 20
