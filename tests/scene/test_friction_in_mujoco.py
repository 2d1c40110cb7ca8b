"""MuJoCo steps with the friction that a scene gives as if the model's file gave it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw

mujoco = pytest.importorskip("mujoco")

MODEL = """
<mujoco>
  <option cone="{cone}" integrator="{integrator}"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 1" friction="{floor}"/>
    <body name="box" pos="0 0 0.05">
      <freejoint/>
      <geom name="box" type="box" size="0.05 0.05 0.05" mass="1" friction="{box}"/>
    </body>
    <body name="ball" pos="0 0.3 0.05">
      <freejoint/>
      <geom name="ball" size="0.05" mass="1" condim="6" friction="{box}"/>
    </body>
  </worldbody>
</mujoco>
"""
SCENE = """
name: slide
model: {file: model.xml}
contacts:
  - {between: [box, floor], friction: 0.3}
  - {between: [ball, floor], friction: 0.3, torsional_friction: 0.004, rolling_friction: 0.001}
"""


def at(folder: Path, scene: str, **given: str) -> rw.SpaceScene:
    folder.mkdir()
    (folder / "model.xml").write_text(MODEL.format(**given))
    (folder / "scene.yaml").write_text(scene)
    return rw.load(folder / "scene.yaml")  # type: ignore[return-value]


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_friction_of_the_scene_is_that_of_the_contacts(cone: str, integrator: str, tmp_path: Path) -> None:
    """To the bit, also with friction of turning."""
    own = "0.3 0.004 0.001"
    named = at(tmp_path / "a", SCENE, cone=cone, integrator=integrator, floor="1", box="1 0.02 0.02").bind()
    whole = at(tmp_path / "b", SCENE, cone=cone, integrator=integrator, floor=own, box=own).bind()
    one, other = mujoco.MjData(named.model), mujoco.MjData(whole.model)
    for data in (one, other):
        data.qvel[:] = [1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0, 0.5, 0.0, 0.0, 10.0, 5.0]
    for _ in range(200):
        named.step_in_mujoco(one)
        mujoco.mj_step(whole.model, other)
    assert np.array_equal(one.qpos, other.qpos)
    assert one.qpos[0] == pytest.approx(1.0 / (2 * 0.3 * 9.81), rel=0.05)


def test_without_friction_in_the_scene_steps_are_the_models(tmp_path: Path) -> None:
    plain = "name: slide\nmodel: {file: model.xml}\n"
    bound = at(tmp_path / "a", plain, cone="elliptic", integrator="RK4", floor="1", box="0.5").bind()
    one, other = mujoco.MjData(bound.model), mujoco.MjData(bound.model)
    one.qvel[0] = other.qvel[0] = 1.0
    for _ in range(100):
        bound.step_in_mujoco(one)
        mujoco.mj_step(bound.model, other)
    assert np.array_equal(one.qpos, other.qpos)
