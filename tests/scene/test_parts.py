"""Models of several parts, servos on joints, and patterns of names in scenes in space."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.planning.task.task import task_of
from rungwise.world.find import world_of

ROOM = """<mujoco><worldbody>
  <body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size="0.1" mass="1"/></body>
</worldbody></mujoco>"""
LINK = (
    '<inertial><mass value="1"/><inertia ixx="{0}" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><geometry><box size=".1 .1 .4"/></geometry></collision>'
)
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="1 0 0"/>'
    '<axis xyz="0 0 1"/><limit lower="-.5" upper=".7" effort="10" velocity="1"/>'
    '<dynamics damping="2" friction=".3"/></joint>'
)


def _folder(folder: Path, ixx: float = 0.1) -> Path:
    (folder / "arms" / "urdf").mkdir(parents=True)
    (folder / "room.xml").write_text(ROOM)
    links = "".join(f'<link name="{name}">{LINK.format(ixx)}</link>' for name in ("l0", "l1", "l2"))
    joints = JOINT.format("j.1", "l0", "l1") + JOINT.format("j.2", "l1", "l2")
    (folder / "arms" / "urdf" / "arm.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    return folder


def _scene(folder: Path, **fields: Any) -> dict[str, Any]:
    arm = {"file": str(folder / "arms/urdf/arm.urdf"), "xyz": [0, "height", 0], "rpy": [0, 0, "pi / 2"]}
    model = {"file": str(folder / "room.xml"), "parts": {"arm": arm}} | fields.pop("model", {})
    height = {"default": 3.0, "range": [0.0, 9.0]}
    return {"name": "s", "parameters": {"height": height}, "model": model} | fields


def _loaded(folder: Path, **fields: Any) -> Any:
    return rw.load(_scene(folder, **fields))


def test_a_part_stands_where_it_is_put_under_names_of_its_own(tmp_path: Path) -> None:
    scene = _loaded(_folder(tmp_path))
    bodies = ("world", "ball", "arm_l0", "arm_l1", "arm_l2")
    assert scene.template.bodies == bodies
    for height in (3.0, 5.0):
        bound = scene.bind({"height": height})
        data = mujoco.MjData(bound.model)
        mujoco.mj_kinematics(bound.model, data)
        at = [data.body(name).xpos for name in bodies[2:]]
        np.testing.assert_allclose(at, [[0, height, 0], [0, height + 1, 0], [0, height + 2, 0]], atol=1e-12)
    again = rw.load(yaml.safe_load(scene.yaml()))
    assert again.content == scene.content
    written = mujoco.MjModel.from_xml_string(rw.mjcf(scene))
    assert written.body("arm_l2").id == 4


def test_turns_about_the_fixed_axes_follow_each_other_as_in_urdf(tmp_path: Path) -> None:
    roll, pitch, yaw = 0.3, -0.7, 1.1
    given = _scene(_folder(tmp_path))
    given["model"]["parts"]["arm"]["rpy"] = [roll, pitch, yaw]
    bound = rw.load(given).bind()
    data = mujoco.MjData(bound.model)
    mujoco.mj_kinematics(bound.model, data)
    (a, b), (c, d), (e, f) = ((np.cos(x), np.sin(x)) for x in (roll, pitch, yaw))
    x, y, z = (
        np.array([[1, 0, 0], [0, a, -b], [0, b, a]]),
        np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]]),
        np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]]),
    )
    np.testing.assert_allclose(data.body("arm_l0").xmat.reshape(3, 3), z @ y @ x, atol=1e-12)


def test_inertias_of_a_part_that_no_body_can_have_are_balanced_and_a_remark_says_so(tmp_path: Path) -> None:
    bound = _loaded(_folder(tmp_path, ixx=0.9)).bind()
    assert any(note.startswith("model.parts.arm: inertias that no body can have") for note in bound.notes)
    assert not _loaded(_folder(tmp_path / "other")).bind().notes


@pytest.mark.parametrize(("place", "begun"), [(None, 0.0), (0.4, 0.4), ("height / 10 + 0.1", 0.4)])
def test_servos_hold_joints_where_the_scene_puts_them(
    tmp_path: Path, place: float | str | None, begun: float
) -> None:
    start = {} if place is None else {"places": {"arm_l1.arm_j_1": place}}
    servos = {"*_j.1": {"stiffness": "100 * height", "damping": 5}, "arm_*": {"stiffness": 7, "force": 2}}
    scene = _loaded(
        _folder(tmp_path),
        model={"servos": servos, "set": {"joints": {"arm_*": {"damping": 0.5}}}},
        start=start,
    )
    assert scene.template.inputs == ("arm_j_1", "arm_j_2")
    assert scene.file.parameters["arm_j_1"].default == pytest.approx(begun)
    assert scene.file.parameters["arm_j_1"].range == (-0.5, 0.7)
    model = scene.bind().model
    np.testing.assert_array_equal(model.actuator_gainprm[:, 0], [300.0, 7.0])
    np.testing.assert_array_equal(model.actuator_biasprm[:, 1:3], [[-300.0, -5.0], [-7.0, 0.0]])
    np.testing.assert_array_equal(model.actuator_forcerange[1], [-2.0, 2.0])
    np.testing.assert_array_equal(model.actuator_forcelimited, [0, 1])
    np.testing.assert_array_equal(model.dof_damping[-2:], 0.5)
    run = rw.simulate(scene, "dynamic-rigid", duration=0.2)
    assert run.final["arm_l1"]["arm_j_1"] == pytest.approx(begun, abs=1e-6)


def test_bounds_of_inputs_may_be_given_by_patterns(tmp_path: Path) -> None:
    task = {"inputs": {"arm_j_2": {"range": [-0.1, 0.2]}, "arm_*": {"rate": "height"}}}
    scene = _loaded(
        _folder(tmp_path), model={"servos": {"arm_*": {"stiffness": 7}}}, task=task, goal="ball.z <= 0.5"
    )
    found = task_of(scene)
    np.testing.assert_array_equal([found.low, found.high], [[-0.5, -0.1], [0.7, 0.2]])
    np.testing.assert_array_equal(found.rate, [3.0, np.inf])
    assert world_of(scene).roles()["arm_l2"] == "robot"


def test_a_model_is_found_by_the_package_that_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = _scene(_folder(tmp_path))
    given["model"]["parts"]["arm"]["file"] = "package://arms/urdf/arm.urdf"
    with pytest.raises(
        rw.SceneError, match=r"^model\.parts\.arm\.file: 'package://arms/urdf/arm\.urdf' is no"
    ):
        rw.load(given)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert "arm_l2" in rw.load(given).template.bodies


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (
            {"servos": {"leg_*": {"stiffness": 1}}},
            r"model\.servos: 'leg_\*' names no joint without an actuator",
        ),
        ({"servos": {"*": {"stiffness": "wide"}}}, r"model\.servos\.\*\.stiffness: unknown name wide"),
        ({"servos": {"*": {"stiffness": 0}}}, r"model\.servos\.\*\.stiffness: 0 must be > 0"),
        ({"servos": {"*": {"stiffness": 1, "damping": -1}}}, r"model\.servos\.\*\.damping: -1 must be >= 0"),
        ({"set": {"joints": {"leg_*": {"damping": 1}}}}, r"model\.set\.joints\.leg_\*: unknown joint"),
        ({"parts": {"arm": {"file": "no.urdf"}}}, r"model\.parts\.arm\.file: 'no\.urdf' is no file"),
    ],
)
def test_wrong_parts_and_servos_are_refused_in_one_line(tmp_path: Path, model: Any, message: str) -> None:
    with pytest.raises(rw.InputError, match=message) as refused:
        _loaded(_folder(tmp_path), model=model).bind()
    assert "\n" not in str(refused.value)


def test_a_pattern_that_fits_no_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(rw.SceneError, match=r"task\.inputs: unknown input 'leg_\*'"):
        _loaded(_folder(tmp_path), task={"inputs": {"leg_*": {"rate": 1}}}, goal="ball.z <= 0.5")


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ('<option iterations="7" integrator="RK4" cone="elliptic"/>', ""),
        ('<size nuser_jnt="2" nconmax="9" nuserdata="4"/><visual><map znear="0.5"/></visual>', ""),
        ('<option timestep="0.5" gravity="0 0 1"/>', "its gravity and timestep gave way to the model's own"),
        ('<option><flag gravity="disable"/></option>', "its disableflags gave way to the model's own"),
    ],
)
def test_settings_of_a_part_give_way_to_the_models_own_without_a_warning(
    settings: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo would write its log
    (tmp_path / "room.xml").write_text(ROOM)
    body = '<body><joint name="j" user="1 2"/><geom size="0.1"/></body>'
    (tmp_path / "part.xml").write_text(f"<mujoco>{settings}<worldbody>{body}</worldbody></mujoco>")
    parts = {"arm": {"file": "part.xml", "xyz": [0, 1, 0]}}
    (tmp_path / "scene.yaml").write_text(
        yaml.safe_dump({"name": "s", "model": {"file": "room.xml", "parts": parts}})
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = rw.simulate(tmp_path / "scene.yaml", "dynamic-rigid", duration=0.01)
    assert capfd.readouterr() == ("", "") and not (tmp_path / "MUJOCO_LOG.TXT").exists()
    assert run.final["ball"]["z"] < 1.0 and run.scene.bind().model.opt.timestep == 0.002
    assert [note for note in run.notes if "gave way" in note] == (
        [f"model.parts.arm: {told}"] if told else []
    )
