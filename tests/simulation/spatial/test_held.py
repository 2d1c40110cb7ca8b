"""Bodies that faces and sides of other bodies hold lie still on all rungs with forces."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.spatial.result import SpaceRun

from .conftest import Make
from .measure import FLOOR, world
from .rungs import COMPLIANT, DYNAMIC, WITH_LOADS, named

LIES = 'euler="90 0 0"'
PADS = {
    "box": ('type="box" size=".01 .02 .02"', 0.01),
    "capsule": (f'type="capsule" size=".01 .02" {LIES}', 0.01),
    "cylinder": (f'type="cylinder" size=".01 .02" {LIES}', 0.01),
    "sphere": ('size=".01"', 0.01),
}
PARTS = {
    "sphere": ('size=".01"', 0.01),
    "capsule": (f'type="capsule" size=".01 .03" {LIES}', 0.01),
    "upright capsule": ('type="capsule" size=".01 .03"', 0.01),
    "cylinder": (f'type="cylinder" size=".01 .03" {LIES}', 0.01),
    "upright cylinder": ('type="cylinder" size=".01 .03"', 0.01),
    "cylinder by its ends": ('type="cylinder" size=".02 .01" euler="0 90 0"', 0.01),
    "ellipsoid": ('type="ellipsoid" size=".01 .02 .015"', 0.01),
    "box": ('type="box" size=".01 .03 .02"', 0.01),
}
ONE_POINT = {("capsule", "ellipsoid", "quasistatic-compliant")}
"""What rolls between two points, and is not held there."""


def lies_still(found: object, sinks: float = 2e-4) -> bool:
    assert isinstance(found, SpaceRun) and found.outcome == "timeout", found
    return bool(np.abs(found.frames[-1].q - found.frames[0].q).max() < sinks)


@pytest.mark.few(8)
@pytest.mark.parametrize(
    ("pad", "part", "rung"),
    [each for each in product(PADS, PARTS, WITH_LOADS) if (*each[:2], each[2].name) not in ONE_POINT],
    ids=lambda value: value if isinstance(value, str) else named(value),
)
def test_a_part_pinched_between_two_pads_is_held(make: Make, pad: str, part: str, rung: Rung) -> None:
    """Friction carries twenty times the weight; pads are shorter than the part."""
    (geom, wide), (own, half) = PADS[pad], PARTS[part]
    jaws = "".join(
        f'<body name="{name}" pos="{-sign * (wide + half)} 0 .2"><joint name="{name}" type="slide"'
        f' axis="{sign} 0 0"/><geom {geom} mass=".1" friction=".7"/></body>'
        for name, sign in (("l", 1), ("r", -1))
    )
    held = f'<body name="part" pos="0 0 .2"><freejoint/><geom {own} mass=".0428" friction=".7"/></body>'
    servos = "".join(f'<position name="a{name}" joint="{name}" kp="2000" kv="20"/>' for name in "lr")
    scene = make(
        world(jaws, held, after=f"<actuator>{servos}</actuator>"), controls={"al": 0.003, "ar": 0.003},
        duration=0.2, step=2e-3,
    )  # fmt: skip
    assert lies_still(rw.simulate(scene, rung))


def rails(kind: str, x: float) -> str:
    return "".join(f'<geom type="{kind}" size=".01 .05" pos="{p} 0 .01" {LIES}/>' for p in (-x, x))


PEDESTAL = '<geom type="box" size=".02 .02 .02" pos="0 0 .02"/>'
RESTS = {
    "capsule on a pedestal": (PEDESTAL, f'type="capsule" size=".01 .05" {LIES}', 0.05),
    "cylinder on a pedestal": (PEDESTAL, f'type="cylinder" size=".01 .05" {LIES}', 0.05),
    "capsule on two boxes": (
        "".join(f'<geom type="box" size=".02 .02 .02" pos="0 {y} .02"/>' for y in (-0.05, 0.05)),
        f'type="capsule" size=".01 .08" {LIES}', 0.05,
    ),
    "plate on capsules": (rails("capsule", 0.03), 'type="box" size=".05 .04 .005"', 0.025),
    "plate on cylinders": (rails("cylinder", 0.03), 'type="box" size=".05 .04 .005"', 0.025),
    "cylinder across rails": (rails("capsule", 0.03), 'type="cylinder" size=".01 .05" euler="0 90 0"', 0.03),
    "cylinder along rails": (
        rails("capsule", 0.015), f'type="cylinder" size=".02 .04" {LIES}',
        0.01 + float(np.sqrt(0.03**2 - 0.015**2)),
    ),
    "ellipsoid on a box": (PEDESTAL, 'type="ellipsoid" size=".03 .05 .02"', 0.06),
    "box on a log": (FLOOR + f'<geom type="capsule" size=".02 .1" pos="0 0 .02" {LIES} condim="4"/>',
                     'type="box" size=".05 .03 .005"', 0.045),
}  # fmt: skip


@pytest.mark.few(6)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("name", RESTS)
def test_what_lies_across_other_bodies_lies_still(make: Make, name: str, rung: Rung) -> None:
    below, geom, height = RESTS[name]
    body = f'<body name="b" pos="0 0 {height:.12f}"><freejoint/><geom {geom} mass=".1" friction=".7"/></body>'
    assert lies_still(rw.simulate(make(world(below, body), duration=0.2, step=2e-3), rung))


@pytest.mark.parametrize("rung", COMPLIANT, ids=named)
@pytest.mark.parametrize("angle", [0.0, 0.005, 0.01, 0.015, 0.05])
def test_a_log_that_lies_nearly_along_another_does_not_turn(make: Make, angle: float, rung: Rung) -> None:
    """It is held across by joints; the places at both of its ends come and go together."""
    log = 'type="capsule" size=".02 .1" euler="90 0 0"'
    body = (
        f'<body name="b" pos="0 0 .06" euler="0 0 {np.degrees(angle)}"><joint type="slide" axis="0 0 1"/>'
        f'<joint axis="0 0 1"/><joint axis="1 0 0"/><geom {log} mass=".1" friction=".7"/></body>'
    )
    run = rw.simulate(make(world(f'<geom {log} pos="0 0 .02"/>', body), duration=0.3, step=2e-3), rung)
    assert lies_still(run, 2e-4) and abs(run.frames[-1].q[1] - run.frames[0].q[1]) < 2e-5
    assert np.ptp([each.q for each in run.frames[-20:]], axis=0).max() < 1e-12


FIELD = '<hfield name="h" nrow="21" ncol="21" size=".2 .2 .05 .05" elevation="{}"/>'
ON_FIELD = {
    "box": 'type="box" size=".02 .02 .02"', "ball": 'size=".02"', "can": 'type="cylinder" size=".02 .02"',
    "capsule": f'type="capsule" size=".02 .03" {LIES}', "egg": 'type="ellipsoid" size=".03 .03 .02"',
}  # fmt: skip


def on_field(make: Make, geom: str, height: float, heights: str) -> rw.Scene:
    body = (
        f'<body name="b" pos=".013 .007 {height}"><freejoint/><geom {geom} mass=".1" friction=".7"/></body>'
    )
    ground = '<geom type="hfield" hfield="h" friction=".7"/>'
    before = f"<asset>{FIELD.format(heights)}</asset>"
    return make(world(ground, body, before=before), duration=0.5, step=2e-3)  # type: ignore[return-value]


@pytest.mark.few(5)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("kind", ON_FIELD)
def test_what_lies_on_a_level_height_field_lies_still(make: Make, kind: str, rung: Rung) -> None:
    """Across the edges of its triangles."""
    level = " ".join(["0"] * 441)
    assert lies_still(rw.simulate(on_field(make, ON_FIELD[kind], 0.02, level), rung))


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_ball_that_falls_on_a_level_height_field_stays_where_it_falls(make: Make, rung: Rung) -> None:
    run = rw.simulate(on_field(make, 'size=".02"', 0.05, " ".join(["0"] * 441)), rung)
    assert abs(run.final["b"]["x"] - 0.013) < 1e-9 and abs(run.final["b"]["y"] - 0.007) < 1e-9


def test_a_ball_rolls_down_a_height_field_as_down_a_plane(make: Make) -> None:
    """By 5/7 of what would slide: over edges that are level with the triangles beside them."""
    slope = " ".join(f"{k / 20:.6f}" for _ in range(21) for k in range(21))
    scene = on_field(make, 'size=".02"', 0.05 * 0.5325 + 0.02 * np.hypot(1.0, 0.125), slope)
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.3)
    lean = np.arctan(0.05 / 0.4)
    way = 0.5 * 5.0 / 7.0 * 9.81 * np.sin(lean) * 0.3**2 * np.cos(lean)
    assert 0.013 - run.final["b"]["x"] == pytest.approx(way, rel=0.02)
    assert abs(run.final["b"]["y"] - 0.007) < 1e-6
