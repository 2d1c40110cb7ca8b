"""What a model file says of its joints, tendons and actuators: it moves as in MuJoCo, or is refused."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene import SceneError
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.laws import default_law

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, q, run, world
from .rungs import MOVING, WITH_LOADS, named

ARM = (
    '<site name="s" pos="0 .3 1"/>'
    '<body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" {j}/>'
    '<geom name="g" type="capsule" fromto="0 0 0 .5 0 0" size=".04" mass="1" {g}/>'
    '<site name="o" pos=".4 0 0"/>'
    '<body name="b" pos=".5 0 0" {b}><joint name="k" axis="0 1 0"/>'
    '<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass=".6"/></body></body>'
)
TENDONS = (
    '<tendon><fixed name="t" {t}><joint joint="j" coef="1"/><joint joint="k" coef="-1"/></fixed>'
    '<spatial name="r" {r}><site site="s"/><site site="o"/></spatial></tendon>'
)
FLAGS = ("actuation", "clampctrl", "spring", "damper", "gravity", "frictionloss", "limit", "equality")
FEATURES: list[dict[str, str]] = [
    {},
    *({"flag": f'<flag {name}="disable"/>'} for name in FLAGS),
    {"flag": '<flag override="enable"/>'},
    {"option": 'actuatorgroupdisable="0"'},
    {"option": 'wind="9 0 0"'},
    *({"j": f'{name}="{value}"'} for name, value in (
        ("actuatorfrcrange", "-1 2"), ("stiffness", "20"), ("stiffness", "20 5"), ("damping", "1"),
        ("damping", "1 2"), ("armature", ".3"), ("springyield", ".1"), ("springref", "20"),
    )),
    {"j": 'actuatorfrcrange="-1 2" actuatorgravcomp="true"', "b": 'gravcomp="1"'},
    {"j": 'stiffness="20" springyield=".1"'},
    {"b": 'gravcomp=".5"'},
    {"g": 'adhesion="1"'},
    {"g": 'surfacevel="1 0 0 0 0 0"'},
    *({own: f'{name}="{value}"'} for own in "tr" for name, value in (
        ("actuatorfrcrange", "-1 2"), ("stiffness", "20"), ("stiffness", "20 5"), ("damping", "1"),
        ("armature", ".3"), ("springlength", ".1"),
    )),
    *({"m": f'<motor joint="j" {more}/>'} for more in (
        'gear="3"', 'ctrlrange="-1 1"', 'forcerange="-1 3"', 'damping="2" gear="2"', 'damping="1 1"',
        'armature="2"', 'delay=".05" nsample="100"',
    )),
    *({"m": f'<general joint="j" {more}/>'} for more in (
        'biastype="none" biasprm="1 -9 -9"', 'biastype="affine" biasprm="1 -9 -9"', 'dyntype="filter"',
        'gaintype="affine" gainprm="1 2 3"', 'biastype="affine" biasprm="1 9 0"',
    )),
    {"m": '<position joint="j" kp="50" kv="5" forcerange="-3 5"/>'},
    {"m": '<velocity joint="j" kv="5"/>', "j": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor tendon="t" gear="2"/>', "t": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor tendon="t" gear="2"/>', "j": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor tendon="r"/>', "j": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor joint="j"/><motor joint="j" gear="-2"/>', "j": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor joint="j" gear="-2" forcerange="-9 .5"/>', "j": 'actuatorfrcrange="-1 2"'},
    {"m": '<motor site="o" gear="0 1 2 1 0 0"/>'},
]  # fmt: skip


def text_of(feature: dict[str, str]) -> str:
    """A model with every kind of element, and this feature."""
    parts = {own: feature.get(own, "") for own in "jgbtr"}
    parts["r"] += "" if "stiffness" in parts["r"] else ' stiffness="3"'
    actuators = feature.get("m", '<motor joint="j" ctrllimited="true" ctrlrange="-2 2"/>')
    return world(
        ARM.format(**parts),
        before=f"<option {feature.get('option', '')}>{feature.get('flag', '')}</option>",
        after=f"{TENDONS.format(**parts)}<actuator>{actuators}</actuator>",
    )


@pytest.mark.few(3)
@pytest.mark.parametrize("feature", FEATURES, ids=str)
def test_a_feature_of_a_file_moves_as_in_mujoco_or_is_refused(make: Make, feature: dict[str, str]) -> None:
    text, duration, told = text_of(feature), 0.15, 2.5
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
    model.opt.timestep, data = 2.5e-4, mujoco.MjData(model)
    data.ctrl[:] = told
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
    controls = {f"actuator{k}": told for k in range(model.nu)}
    try:
        scene = make(text, controls=controls, duration=duration)
    except SceneError as error:
        if "has no counterpart" in str(error):
            return
        raise
    np.testing.assert_allclose(q(run(scene, rw.DYNAMIC_RIGID, step=5e-4)), data.qpos, atol=5e-3)


SLIDE = '<joint name="j" type="slide"/>'
STARTS = [
    (
        '<joint name="j" axis="0 1 0" range="10 20" limited="true"/>',
        "",
        "p.j is beyond its range (0.174533 to",
    ),
    ('<joint name="j" type="ball" range="0 20" limited="true"/>', "", None),
    (
        SLIDE,
        '<tendon><fixed name="t" limited="true" range="1 2"><joint joint="j" coef="1"/></fixed></tendon>',
        "t is beyond its range (1 to 2) by 1;",
    ),
    (
        SLIDE,
        '<equality><joint name="e" joint1="j" polycoef=".5 0 0 0 0"/></equality>',
        "equality e (joint of p.j) is open by 0.5;",
    ),
    (SLIDE, '<equality><joint joint1="j" polycoef="1e-4 0 0 0 0"/></equality>', None),
]


@pytest.mark.parametrize(("joint", "after", "why"), STARTS)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_start_beyond_a_limit_or_with_an_open_equality_is_refused(
    make: Make, joint: str, after: str, why: str | None, rung: Rung
) -> None:
    scene = make(world(f'<body name="p">{joint}<geom size=".1"/></body>', before=NO_GRAVITY, after=after))
    found = rw.simulate(scene, rung, duration=0.01)
    if why is None:
        assert found.outcome.name == "timeout", found.reason
    else:
        assert found.outcome.name == "invalid"
        assert found.reason.startswith(f"start: {why}")


SEEN_ONLY = '<geom name="seen" size=".3" pos="0 0 .2" contype="0" conaffinity="0" mass="0" {}/>'
IN_PAIR = '<contact><pair geom1="floor" geom2="own"/></contact>'


def test_geoms_that_touch_nothing_change_nothing(make: Make) -> None:
    """Neither the distance of bodies, nor the stiffness of contacts, nor the motion."""
    found = []
    for seen in ("", SEEN_ONLY.format(""), SEEN_ONLY.format("").replace(".3", "1e-4")):
        body = f'<body name="b" pos="0 0 .5"><freejoint/><geom size=".1" mass="1"/>{seen}</body>'
        scene = make(world(FLOOR, body), goal="gap(world, b) <= 1e-4", duration=0.6)
        result = run(scene, rw.DYNAMIC_COMPLIANT, step=2e-3)
        assert isinstance(scene, SpaceScene)
        found.append((*default_law(scene.bind().model), scene.size, result.time, *q(result)))
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=1e-12)
    assert found[0][3] == pytest.approx(np.sqrt(2.0 * 0.4 / 9.81), abs=5e-3)


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_pair_that_names_geoms_is_as_their_types(make: Make, rung: Rung) -> None:
    """Contacts have the same size, law, room and motion, whichever way the file lets two geoms touch."""
    found = []
    for apart, after in (("", ""), ('contype="0" conaffinity="0"', IN_PAIR)):
        geom = f'<geom name="own" type="box" size=".1 .2 .1" {apart}/>'
        body = f'<body name="b" pos="0 0 .1"><freejoint/>{geom}</body>'
        floor = FLOOR.replace("/>", f" {apart}/>")
        scene = make(world(floor, body, after=after), start={"velocities": {"b.x": 1.0}}, duration=0.1)
        result = run(scene, rung)
        assert isinstance(scene, SpaceScene)
        assert result.space is not None
        found.append((*default_law(scene.bind().model), scene.size, result.space.room, *q(result)))
    assert found[1] == pytest.approx(found[0], abs=1e-9)
