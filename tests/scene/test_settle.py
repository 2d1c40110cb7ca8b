"""Starts that are not allowed are moved to the nearest that are, and what was done is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rungwise as rw
from rungwise.cli import app

mujoco = pytest.importorskip("mujoco")

FLOOR = '<geom name="floor" type="plane" size="2 2 1"/>'


def scene_of(inside: str, folder: Path, more: str = "", settle: bool = True) -> rw.SpaceScene:
    """A model with these bodies, in a file."""
    path = folder / "model.xml"
    path.write_text(f"<mujoco><worldbody>{inside}</worldbody>{more}</mujoco>")
    return rw.load(path, settle=settle)  # type: ignore[return-value]


def ball(name: str, x: float, z: float, joints: str = "<freejoint/>", mass: float = 1.0) -> str:
    geom = f'<geom name="g{name}" type="sphere" size="0.1" mass="{mass}"/>'
    return f'<body name="{name}" pos="{x} 0 {z}">{joints}{geom}</body>'


def places(scene: rw.SpaceScene) -> dict[str, float]:
    return dict(zip(scene.template.coordinates, scene.start()[0].tolist(), strict=True))


@pytest.mark.parametrize("mass", [0.01, 1.0, 100.0])
def test_two_balls_part_by_half_each_whatever_they_weigh(mass: float, tmp_path: Path) -> None:
    found = places(scene_of(ball("a", 0, 1) + ball("b", 0.16, 1, mass=mass), tmp_path))
    assert found["a.x"] == pytest.approx(-0.02, abs=1e-6)
    assert found["b.x"] == pytest.approx(0.18, abs=1e-6)
    assert found["a.z"] == pytest.approx(1.0, abs=1e-9)


def test_a_ball_rises_from_the_floor_by_its_overlap(tmp_path: Path) -> None:
    found = places(scene_of(FLOOR + ball("a", 0.3, 0.07), tmp_path))
    assert found["a.z"] == pytest.approx(0.1, abs=1e-6)
    assert found["a.x"] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("number", range(40))
def test_curved_bodies_part_from_boxes_the_short_way(number: int, tmp_path: Path) -> None:
    """Where a corner of a box is in the side of a cylinder, contacts of their faces lead another way."""
    rng = np.random.default_rng([number, 12])
    turn, other = (" ".join(f"{x:.6f}" for x in rng.normal(size=4)) for _ in range(2))
    way = rng.normal(size=3)
    far = 0.1 * float(rng.uniform(0.2, 0.5)) * way / np.linalg.norm(way) + [0, 0, 1]
    box = f'<geom type="box" size="0.02 0.02 0.03" pos="0 0 1" quat="{turn}"/>'
    place = " ".join(f"{x:.6f}" for x in far)
    can = '<geom type="cylinder" size="0.035 0.035"/>'
    can = f'<body name="can" pos="{place}" quat="{other}"><freejoint/>{can}</body>'
    still = '<option gravity="0 0 0"/>'
    scene, given = (scene_of(box + can, tmp_path, still, settle=settle) for settle in (True, False))
    run = rw.simulate(scene, "dynamic-compliant", duration=0.002)
    assert run.outcome == "timeout", run.reason
    model, data = given.bind().model, mujoco.MjData(given.bind().model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
    mujoco.mj_forward(model, data)
    deep = -min([*data.contact.dist.tolist(), 0.0])
    moved = np.linalg.norm(scene.start()[0][:3] - given.start()[0][:3])
    assert moved <= 1.1 * deep + 1e-5


def test_a_start_that_is_allowed_stays_to_the_bit(tmp_path: Path) -> None:
    inside = FLOOR + ball("a", 0.3, 0.1) + ball("b", 0.6, 0.1)
    here, given = (scene_of(inside, tmp_path, settle=settle) for settle in (True, False))
    assert np.array_equal(here.start()[0], given.start()[0])
    assert not any("settle" in note for note in here.bind().notes)


def arm(rng: np.random.Generator) -> str:
    """A chain of capsules on hinges, of which some must not be at zero."""
    inside, count = "", int(rng.integers(2, 7))
    for number in reversed(range(count)):
        axis = " ".join(f"{x:.3f}" for x in rng.normal(size=3))
        low, width = float(rng.uniform(-0.4, 0.2)), float(rng.uniform(0.1, 0.6))
        joint = f'<joint name="j{number}" axis="{axis}" limited="true" range="{low} {low + width}"/>'
        geom = '<geom type="capsule" fromto="0 0 0.04 0 0 0.16" size="0.02"/>'
        inside = f'<body name="l{number}" pos="0 0 {0.2 if number else 0.3}">{joint}{geom}{inside}</body>'
    around = [ball(f"o{k}", *rng.uniform(-0.1, 0.6, 2).tolist()) for k in range(int(rng.integers(0, 4)))]
    return FLOOR + inside + "".join(around)


@pytest.mark.few(4)
@pytest.mark.parametrize("number", range(40))
def test_arms_out_of_their_ranges_start(number: int, tmp_path: Path) -> None:
    rng = np.random.default_rng([number, 35])
    scene = scene_of(arm(rng), tmp_path, '<compiler angle="radian"/>')
    run = rw.simulate(scene, "dynamic-compliant", duration=0.002)
    assert run.outcome == "timeout", run.reason
    bound = scene.bind()
    low, high = bound.model.jnt_range[bound.model.jnt_limited == 1].T
    q = bound.place[bound.model.jnt_qposadr[bound.model.jnt_limited == 1]]
    assert (q >= low - 1e-6).all() and (q <= high + 1e-6).all()


def test_a_hinge_goes_to_the_end_of_its_range_and_no_farther(tmp_path: Path) -> None:
    joint = '<joint name="j" axis="0 1 0" limited="true" range="20 60"/>'
    geom = '<geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.02"/>'
    body = f'<body name="arm" pos="0 0 1">{joint}{geom}</body>'
    scene = scene_of(body, tmp_path)
    assert places(scene)["arm.j"] == pytest.approx(np.deg2rad(20), abs=1e-8)
    (note,) = (note for note in scene.bind().notes if "settle" in note)
    assert "arm.j by +0.349" in note


def test_an_open_equality_is_closed(tmp_path: Path) -> None:
    slide = '<joint name="s" type="slide" axis="1 0 0"/>'
    bodies = ball("a", 0, 1, slide) + ball("b", 1, 1, slide)
    couple = '<equality><joint joint1="s" joint2="t" polycoef="0.1 1 0 0 0"/></equality>'
    found = places(scene_of(bodies.replace('name="s"', 'name="t"', 1), tmp_path, couple))
    assert found["b.s"] - found["a.t"] == pytest.approx(0.1, abs=1e-8)
    assert found["b.s"] == pytest.approx(0.05, abs=1e-6)


def test_links_built_into_each_other_do_not_touch_and_are_named(tmp_path: Path) -> None:
    """The second link of a finger lies within the palm, wherever its joints stand."""
    tip = '<body name="tip"><joint axis="0 0 1"/><geom type="sphere" size="0.05"/></body>'
    link = f'<body name="link"><joint axis="0 0 1"/><geom type="sphere" size="0.01" contype="0"/>{tip}</body>'
    palm = f'<body name="palm" pos="0 0 1"><freejoint/><geom type="sphere" size="0.1"/>{link}</body>'
    scene = scene_of(palm, tmp_path)
    assert any("palm and tip" in note for note in scene.bind().notes)
    assert rw.simulate(scene, "dynamic-compliant", duration=0.01).outcome == "timeout"


def test_what_stands_on_the_world_is_not_built_into_it(tmp_path: Path) -> None:
    slide = '<joint type="slide" axis="1 0 0"/>'
    run = rw.simulate(scene_of(FLOOR + ball("puck", 0, 0.08, slide), tmp_path), "dynamic-compliant")
    assert run.outcome == "invalid" and "start.settle: world and puck overlap by 0.02" in run.reason


def test_what_motion_capture_leads_comes_along(tmp_path: Path) -> None:
    lead = '<body name="lead" mocap="true" pos="0 0 0.05"/>'
    weld = '<equality><weld body1="lead" body2="a"/></equality>'
    bound = scene_of(FLOOR + lead + ball("a", 0, 0.05), tmp_path, weld).bind()
    assert bound.place[2] == pytest.approx(0.1, abs=1e-6)
    assert bound.model.body("lead").pos[2] == pytest.approx(0.1, abs=1e-6)


def test_a_far_start_is_refused(tmp_path: Path) -> None:
    joint = '<joint name="s" type="slide" axis="1 0 0" limited="true" range="5 6"/>'
    run = rw.simulate(scene_of(ball("a", 0, 1, joint), tmp_path), "dynamic-rigid")
    assert run.outcome == "invalid" and "more than 0.5 of the size of what moves" in run.reason


def test_the_command_hints_and_settles(tmp_path: Path) -> None:
    scene_of(FLOOR + ball("a", 0, 0.07), tmp_path)
    given = ["sim", str(tmp_path / "model.xml"), "--model", "dynamic-compliant", "--time", "0.01", "--json"]
    refused, settled = (CliRunner().invoke(app, [*given, *more]) for more in ([], ["--settle"]))
    assert "--settle" in refused.stderr and refused.exit_code == 2
    assert json.loads(settled.stdout)["outcome"] == "timeout"


def test_the_plane_refuses_it() -> None:
    with pytest.raises(rw.SceneError, match="settle: works for scenes in space only"):
        rw.load("push", settle=True)
