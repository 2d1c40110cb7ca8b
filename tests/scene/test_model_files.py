"""Model files as packages bring them: files named by package, inertias that no body has, actuators as
inputs."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

import rungwise as rw

pytest.importorskip("mujoco")

CORNERS = ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def mesh(path: Path) -> None:
    """A tetrahedron, as binary STL."""
    path.parent.mkdir(parents=True, exist_ok=True)
    faces = [struct.pack("<12fH", 0, 0, 0, *(x for k in face for x in CORNERS[k]), 0) for face in FACES]
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(faces)) + b"".join(faces))


def urdf(path: Path, file: str, inertia: str = "0.01 0.01 0.01") -> Path:
    """An arm of one link, whose shape is a mesh."""
    x, y, z = inertia.split()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f"""<robot name="arm"><link name="base"/><link name="link"><inertial><mass value="1"/>
        <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><mesh filename="{file}"/></geometry></collision></link>
        <joint name="turn" type="revolute"><parent link="base"/><child link="link"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="10" velocity="1"/></joint></robot>"""
    )
    return path


@pytest.mark.parametrize("scheme", ["package://", "model://", "package:///"])
@pytest.mark.parametrize("where", ["above", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "python"])
def test_files_of_packages_are_found(
    scheme: str, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = tmp_path / "robots" / "arm_description"
    other = tmp_path / "elsewhere"
    folder = {
        "above": beside, "ROS_PACKAGE_PATH": other / "arm_description",
        "AMENT_PREFIX_PATH": other / "share" / "arm_description", "python": other / "arm_description",
    }[where]  # fmt: skip
    mesh(folder / "meshes" / "link.stl")
    if where.isupper():
        monkeypatch.setenv(where, f"{tmp_path / 'nowhere'}:{other}")
    if where == "python":
        (other / "arm_description" / "__init__.py").write_text("")
        monkeypatch.syspath_prepend(str(other))
    scene = rw.load(urdf(beside / "urdf" / "arm.urdf", f"{scheme}arm_description/meshes/link.stl"))
    assert scene.template.coordinates == ("link.turn",)
    assert rw.simulate(scene, "dynamic-rigid", duration=0.01).outcome == "timeout"


def test_a_model_includes_files_of_packages_and_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folders of a package count as well, and files beside the model are found as without packages."""
    package = tmp_path / "robots" / "arms"
    mesh(package / "meshes" / "link.stl")
    (package / "__init__.py").write_text("")
    (package / "arm.xml").write_text(
        """<mujocoinclude><body name="link"><joint name="turn"/><geom type="mesh" mesh="link"/></body>
        </mujocoinclude>"""
    )
    (tmp_path / "table.xml").write_text(
        """<mujocoinclude><geom name="table" type="plane" size="1 1 .1" pos="0 0 -9"/></mujocoinclude>"""
    )
    path = tmp_path / "scene.xml"
    path.write_text(
        """<mujoco><compiler meshdir="package://arms/meshes"/>
        <asset><mesh name="link" file="link.stl"/></asset><worldbody><include file="table.xml"/><include file="package://arms/arm.xml"/></worldbody></mujoco>"""
    )
    monkeypatch.syspath_prepend(str(package.parent))
    scene = rw.load(path)
    assert scene.template.coordinates == ("link.turn",)
    assert rw.simulate(scene, "dynamic-rigid", duration=0.01).outcome == "timeout"


def test_a_file_that_is_nowhere_is_named(tmp_path: Path) -> None:
    path = urdf(tmp_path / "arm.urdf", "package://arm_description/meshes/link.stl")
    with pytest.raises(
        rw.SceneError, match=r"'package://arm_description/meshes/link\.stl' is no file beside"
    ):
        rw.load(path)


def test_inertias_that_no_body_has_are_balanced_and_told(tmp_path: Path) -> None:
    mesh(tmp_path / "link.stl")
    scene = rw.load(urdf(tmp_path / "arm.urdf", "link.stl", "1 0.1 0.1"))
    run = rw.simulate(scene, "dynamic-rigid", duration=0.01)
    assert any("inertias that no body can have were balanced" in note for note in run.notes)


DRIVEN = """<mujoco><worldbody><body name="cart"><joint name="s" type="slide" axis="1 0 0"/><geom size="0.1"/>
    </body></worldbody><actuator><position name="grip_force" joint="s" kp="10" ctrlrange="-1 2"/></actuator>
    <keyframe><key name="home" qpos="0.5" ctrl="0.5"/></keyframe></mujoco>"""


def test_actuators_of_a_named_model_are_inputs(tmp_path: Path) -> None:
    (tmp_path / "cart.xml").write_text(DRIVEN)
    (tmp_path / "cart.yaml").write_text("{name: cart, model: {file: cart.xml}, start: {keyframe: home}}")
    bare, named = rw.load(tmp_path / "cart.xml"), rw.load(tmp_path / "cart.yaml")
    assert bare.file.inputs == named.file.inputs == ("grip_force",)
    assert named.file.parameters["grip_force"].default == 0.5
    assert named.file.parameters["grip_force"].range == (-1.0, 2.0)
    run = rw.simulate(named, "quasistatic-rigid", parameters={"grip_force": 1.0}, duration=1.0)
    assert run.final["cart"]["s"] == pytest.approx(1.0)


def test_a_scene_that_states_its_controls_has_no_others(tmp_path: Path) -> None:
    (tmp_path / "cart.xml").write_text(DRIVEN)
    (tmp_path / "cart.yaml").write_text("{name: cart, model: {file: cart.xml}, controls: {}}")
    assert rw.load(tmp_path / "cart.yaml").file.inputs == ()
