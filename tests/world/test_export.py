"""What other programs read of runs and scenes says what the run says: read again, it is the same."""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from io import StringIO
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

import rungwise as rw
from rungwise.cli import app
from rungwise.simulation.any_run import AnyRun

SCENES = {"two_finger": 3, "push": 3, "two_link": 2, "arm_push": 4, "three_finger_lift": 4}
"""Scenes, and how many segments a schedule has."""
MJCF = ("ball", "slope", "stack", "arm_push", "three_finger_lift", "peg", "shadow_hand")


def run_of(name: str, model: str = "dynamic-compliant", duration: float | None = 0.2) -> AnyRun:
    """A run whose inputs go up and down a little."""
    scene = rw.load(name)
    schedule = [
        {"inputs": {each: scene.file.parameters[each].default + 1e-3 * k for each in scene.template.inputs},
         "duration": 0.05, "ramp": True}
        for k in (1, 2, 1, 0)
    ]  # fmt: skip
    return rw.simulate(scene, model, inputs=schedule if scene.template.inputs else None, duration=duration)


def _read(text: str) -> tuple[list[str], np.ndarray[Any, Any]]:
    head, *rows = csv.reader(StringIO(text))
    return head, np.array([[float(x) for x in row] for row in rows])


@pytest.mark.parametrize("name", ["two_finger", "push", "arm_push", "three_finger_lift"])
def test_tables_and_messages_say_where_joints_are(name: str, tmp_path: Path) -> None:
    run = run_of(name)
    found = run.joint_trajectory()
    roles = run.scene.template.coordinates
    assert set(found.names) <= set(roles) and len(found.names) == len(found.joints) > 0
    data = run.trajectory
    known = list(data.coordinate.values)
    for k, each in enumerate(found.names):
        assert np.array_equal(found.position[:, k], data.position.values[:, known.index(each)])
    head, rows = _read(found.csv())
    count = len(found.joints)
    assert head[: 1 + count] == ["time", *found.joints] and len(head) == 1 + 3 * count
    assert np.array_equal(rows[:, 1 : 1 + count], found.position)
    assert np.array_equal(rows[:, 1 + count : 1 + 2 * count], found.velocity)
    message = json.loads(found.save(tmp_path / "arm.json").read_text())
    assert message["joint_names"] == list(found.joints) and len(message["points"]) == len(rows)
    last = message["points"][-1]
    stamp = last["time_from_start"]
    assert last["positions"] == found.position[-1].tolist()
    assert stamp["sec"] + 1e-9 * stamp["nanosec"] == pytest.approx(run.time, abs=1e-9)
    assert (tmp_path / "arm.json").is_file() and found.save(tmp_path / "arm.csv").read_text() == found.csv()


def test_rates_take_rows_between_frames_and_the_end() -> None:
    run = run_of("arm_push", duration=0.215)
    found = run.joint_trajectory(rate=100.0)
    assert found.time == pytest.approx([*np.arange(22) / 100.0, 0.215])
    whole = run.joint_trajectory()
    assert np.array_equal(found.position[-1], whole.position[-1])
    steps = np.abs(np.diff(whole.position, axis=0)).max()
    for k in range(len(found.names)):
        near = np.interp(found.time, whole.time, whole.position[:, k])
        assert found.position[:, k] == pytest.approx(near, abs=steps)


def test_the_models_own_names_of_joints_are_told(tmp_path: Path) -> None:
    """A name with a dot is another label, and the joint's own name in the message."""
    file = tmp_path / "arm.xml"
    file.write_text(
        '<mujoco><worldbody><body name="l.1"><joint name="j.1" axis="0 0 1"/><geom size=".1"/>'
        '<body name="l.2" pos="1 0 0"><joint name="j.2" type="slide"/><geom size=".1"/></body></body>'
        '</worldbody><actuator><position name="a" joint="j.1" kp="10"/>'
        '<position name="b" joint="j.2" kp="10"/></actuator></mujoco>'
    )
    run = rw.simulate(file, "dynamic-rigid", duration=0.05)
    found = run.joint_trajectory()
    assert found.joints == ("j.1", "j.2") and found.names == ("l_1.j_1", "l_2.j_2")
    assert run.joint_trajectory(["j.2"]).names == run.joint_trajectory(["l_2.j_2"]).names == ("l_2.j_2",)


@pytest.mark.few(3)
@pytest.mark.parametrize("name", MJCF)
def test_mjcf_puts_mujoco_into_the_states(name: str, tmp_path: Path) -> None:
    run = run_of(name, duration=0.1)
    assert run.began
    times = [0.0, 0.05, run.time]
    file = tmp_path / "elsewhere" / "scene.xml"
    file.parent.mkdir()
    file.write_text(run.mjcf(times))
    model = mujoco.MjModel.from_xml_path(str(file))
    own = run.scene.bind(run.parameters).model
    for field in ("body_mass", "geom_size", "geom_pos", "jnt_axis", "actuator_biasprm", "dof_damping"):
        assert np.allclose(getattr(model, field), getattr(own, field), rtol=1e-5, atol=1e-8), field
    assert model.nkey == len(times)
    data = mujoco.MjData(model)
    recorded = np.array([state.time for state in run.states])
    for k, time in enumerate(times):
        state = run.states[int(np.argmin(np.abs(recorded - time)))]
        mujoco.mj_resetDataKeyframe(model, data, k)
        # MuJoCo makes quaternions unit ones, which are so up to 1e-12 here.
        assert np.allclose(data.qpos, state.q, rtol=0.0, atol=1e-12) and np.array_equal(data.qvel, state.v)
        assert data.time == state.time
    assert "laws of contact" in file.read_text() or not run.scene.file.contacts
    if not model.nmesh and not own.nmocap:
        again = rw.load(file)
        assert again.template.coordinates == run.scene.template.coordinates


def test_controls_of_a_keyframe_are_those_that_the_run_told() -> None:
    run = run_of("three_finger_lift")
    text = run.mjcf([0.1])
    model = mujoco.MjModel.from_xml_string(text)
    state = run.states[int(np.argmin([abs(each.time - 0.1) for each in run.states]))]
    bound = run.scene.bind(run.parameters)
    lift = run.scene.labels.actuators.index("lift")
    assert model.key_ctrl[0][lift] == pytest.approx(2e-3, abs=2e-4) and bound.control[lift] == 0.0
    by_hand = rw.mjcf(run.scene, rw.State.of(run.scene, {"ball.z": 0.3}), parameters={"rise": 0.01})
    model = mujoco.MjModel.from_xml_string(by_hand)
    assert model.key_ctrl[0][lift] == 0.01 and model.key_qpos[0][2] == 0.3
    assert state.time == pytest.approx(0.1, abs=0.01)


def test_keyframes_alone_are_included_in_a_file_of_ones_own(tmp_path: Path) -> None:
    run = run_of("arm_push")
    keys = run.mjcf(whole=False)
    tree = ET.fromstring(keys)
    assert len(tree.findall("./keyframe/key")) == len(run.states)
    (tmp_path / "keys.xml").write_text(keys)
    spec = mujoco.MjSpec.from_string(run.mjcf())
    for key in list(spec.keys):
        spec.delete(key)
    own = spec.to_xml().replace("</mujoco>", '<include file="keys.xml"/></mujoco>')
    (tmp_path / "own.xml").write_text(own)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "own.xml"))
    assert np.array_equal(model.key_qpos[-1], run.state.q)


def test_a_settled_start_is_written_with_what_it_leaves_out(tmp_path: Path) -> None:
    """Bodies that are built into each other do not touch in the file, either."""
    file = tmp_path / "hand.xml"
    file.write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 0 1"/><geom size=".1"/>'
        '<body name="b" pos=".05 0 0"><joint name="k" axis="0 0 1"/><geom size=".1"/>'
        '<body name="c" pos=".05 0 0"><joint name="l" axis="0 0 1"/><geom size=".1"/></body></body></body>'
        "</worldbody></mujoco>"
    )
    scene = rw.load(file, settle=True)
    model = mujoco.MjModel.from_xml_string(rw.mjcf(scene))
    assert model.nexclude == scene.bind().model.nexclude > 0


def test_what_cannot_be_written_is_said_in_one_line(tmp_path: Path) -> None:
    run = run_of("push")
    for call, words in (
        (lambda: run.mjcf(), "scene: push has no MuJoCo model"),
        (lambda: rw.mjcf("two_finger"), "scene: two_finger has no MuJoCo model"),
        (lambda: run.joint_trajectory(["nobody"]), "names: 'nobody' is no joint"),
        (lambda: run.joint_trajectory("rod.x"), "names: must be a list"),
        (lambda: run.joint_trajectory().save(tmp_path / "a.xlsx"), "file: must end in .csv, .json"),
        (lambda: run_of("arm_push").mjcf(5.0), "at: 5 is outside the run, 0 to 0.2"),
        (lambda: rw.simulate("ball", "kinematic").joint_trajectory(), "names: nothing drives a joint"),
    ):
        with pytest.raises(rw.ExportError) as caught:
            call()
        assert str(caught.value).startswith(words) and "\n" not in str(caught.value)
    with pytest.raises(rw.ModelError, match=r"^rate: "):
        run.joint_trajectory(rate=-1.0)


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("wanted", "code", "words"),
    [
        (["arm_push", "--out", "a.csv", "--time", "0.1"], 0, "a table of joints"),
        (
            ["push", "--out", "a.json", "--model", "kinematic", "--rate", "20"],
            0,
            "a message of joints",
        ),
        (["stack", "--out", "a.xml", "--at", "0,0.05", "--time", "0.1"], 0, "MJCF"),
        (["stack", "--out", "a.xml", "--keyframes", "--time", "0.02"], 0, "MJCF"),
        (["run", "--out", "b.csv"], 0, "a table of joints"),
        (["push", "--out", "a.txt"], 2, "out: must end in .csv, .json, .xml"),
        (["push", "--out", "a.csv", "--at", "1"], 2, "at: does not apply to .csv files"),
        (["push", "--out", "a.xml", "--time", "0.1"], 2, "scene: push has no MuJoCo model"),
        (["stack", "--out", "a.xml", "--at", "soon"], 2, "at: 'soon' must be times"),
    ],
)
def test_the_command_writes_files(
    wanted: list[str], code: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if wanted[0] == "run":
        run_of("two_finger").save("run")
    done = CliRunner().invoke(app, ["export", *wanted], standalone_mode=False)
    assert words in done.output, (done.output, done.exception)
    assert done.exit_code == code or done.return_value in (0, 1)
    assert Path(wanted[2]).is_file() == (code == 0)
