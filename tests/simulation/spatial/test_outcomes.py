"""What runs in space may come to, with certificates and reasons."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, SLIDER, free, q, run, world
from .rungs import COMPLIANT, DYNAMIC, MOVING, QUASISTATIC, named

BALL = free("b", "0.01 0.02 .1", 'size=".1"')
LOW = [{"friction": 0.1}]


def _finger(k: int) -> str:
    x, y = cos(2.0 * pi * k / 3.0), sin(2.0 * pi * k / 3.0)
    return (
        f'<body name="f{k}" pos="{0.3 * x:.17g} {0.3 * y:.17g} 0.11">'
        f'<joint name="s{k}" type="slide" axis="{-x:.17g} {-y:.17g} 0"/><geom size="0.05" mass="1"/></body>'
    )


def _wall(name: str, x: float) -> str:
    return (
        f'<body name="{name}" pos="{x} 0 0.1"><joint name="s" type="slide" axis="1 0 0"/>'
        '<geom type="box" size="0.1 0.2 0.09" mass="1"/></body>'
    ).replace('"s"', f'"s_{name}"')


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_three_fingers_that_close_on_a_ball_jam_or_sink_in(make: Make, rung: Rung) -> None:
    """Somewhat above its middle: with the floor, the ball cannot give way. Rigid contacts end there, with a
    certificate; compliant ones yield until their model ends."""
    fingers = [_finger(k) for k in range(3)]
    scene = make(
        world(FLOOR, *fingers, BALL), contacts=LOW, speeds={f"f{k}.s{k}": 0.5 for k in range(3)}, step=2e-3
    )
    found = run(scene, rung)
    closed = 0.3 - np.sqrt(0.15**2 - 0.01**2)
    if rung in COMPLIANT:
        assert found.outcome.name == "model_invalid"
        assert 0.5 * found.time == pytest.approx(closed, abs=0.012)
        return
    assert found.outcome.name == "jammed"
    assert found.certificate is not None and found.certificate.kind == "kinematic"
    np.testing.assert_allclose(q(found)[:3], closed, atol=1e-4)
    np.testing.assert_allclose(q(found)[3:6], [0.0, 0.0, 0.1], atol=1e-4)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_walls_that_close_on_a_block_jam_or_sink_in(make: Make, rung: Rung) -> None:
    block = free("b", "0.01 0.02 .1", 'type="box" size=".1 .1 .1"')
    walls = [_wall("l", -0.3), _wall("r", 0.3)]
    scene = make(world(FLOOR, *walls, block), contacts=LOW, speeds={"l.s_l": 0.5, "r.s_r": -0.5}, step=2e-3)
    found = run(scene, rung)
    if rung in COMPLIANT:
        assert found.outcome.name == "model_invalid" and found.time > 0.2
        return
    assert found.outcome.name == "jammed"
    assert found.certificate is not None
    assert found.time == pytest.approx(0.2, abs=1e-9)
    np.testing.assert_allclose(q(found)[2:5], [0.0, 0.02, 0.1], atol=1e-8)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_ball_in_the_air_falls_rests_or_is_unsupported(make: Make, rung: Rung) -> None:
    scene = make(world(FLOOR, free("b", "0 0 .5", 'size=".1"')), duration=0.1, step=1e-2)
    found = run(scene, rung)
    if rung in QUASISTATIC:
        assert found.outcome.name == "unsupported"
        assert found.certificate is not None and found.certificate.kind == "unsupported"
    else:
        assert (found.outcome.name, q(found)[2] < 0.5) == ("timeout", rung in DYNAMIC)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_an_overlap_at_the_start_is_invalid_and_names_the_geoms(make: Make, rung: Rung) -> None:
    scene = make(world(FLOOR, free("b", "0 0 .05", 'name="shell" size=".1"')))
    found = run(scene, rung)
    assert found.outcome.name == "invalid"
    assert found.reason.startswith("start: world (floor) and b (shell) overlap by 0.05; start.settle")


def test_a_contact_that_is_too_soft_ends_the_run(make: Make) -> None:
    scene = make(world(FLOOR, BALL), contacts=[{"stiffness": 500.0}])
    for rung in COMPLIANT:
        assert run(scene, rung).outcome.name == "model_invalid"


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_conditions_read_gaps_forces_speeds_and_places(make: Make, rung: Rung) -> None:
    scene = make(
        world(FLOOR, _wall("l", -0.3), free("b", "0 0 .1", 'type="box" size=".1 .1 .1"')),
        contacts=[{"between": ["b", "world"], "friction": 0.25}, {"friction": 0.5}],
        speeds={"l.s_l": 0.5},
        inputs=["far"],
        parameters={"far": {"default": 0.3}},
        step=2e-3,
        goal="b.x >= far",
    )
    until = [
        ("gap(l, b) <= 0.02", 0.16),
        ("force(b, l) > 0" if rung.loads else "gap(b, l) <= 1e-9", 0.2),
        ("speed(b.x) > 0.4 and l.s_l > 0.15", 0.302),
    ]
    for condition, time in until:
        held = rw.simulate(scene, rung, inputs=[{"duration": 1.0, "until": condition}])
        assert held.outcome.name == "missed"
        assert held.time == pytest.approx(time, abs=6e-3), condition
    assert run(scene, rung).outcome.name == "goal"
    assert run(scene, rung, duration=0.3).outcome.name == "timeout"
    unmet = rw.simulate(scene, rung, inputs=[{"duration": 0.2, "until": "b.x > 5"}])
    assert (unmet.outcome.name, unmet.reason) == (
        "timeout", "inputs.0.until: b.x > 5 did not hold within 0.2 (from t = 0 on)",
    )  # fmt: skip


def test_the_pushing_force_is_the_friction_on_the_floor(make: Make) -> None:
    block = free("b", "0 0 .1", 'type="box" size=".1 .1 .1"')
    for bound, holds in ((0.999, True), (1.001, False)):
        scene = make(
            world(FLOOR, _wall("l", -0.3), block),
            contacts=[{"between": ["b", "world"], "friction": 0.25}, {"friction": 0.0}],
            speeds={"l.s_l": 0.5},
            step=2e-3,
            goal=f"force(l, b) >= {bound * 0.25 * 9.81} and t > 0.25",
            duration=0.4,
        )
        for rung in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT):
            assert (run(scene, rung).outcome.name == "goal") == holds, rung.name


def test_unsafe_is_judged_before_the_goal(make: Make) -> None:
    scene = make(world(SLIDER), goal="p.j < -0.1", unsafe="p.j < -0.1")
    assert run(scene, rw.DYNAMIC_RIGID, step=1e-3).outcome.name == "unsafe"


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("aim", [1e-6, 3e-6, 1e-5, 1e-4, 3e-4, 1e-3])
def test_what_has_come_to_rest_without_load_stays_at_rest(make: Make, rung: Rung, aim: float) -> None:
    """One step closes an equality that is open by `aim`; afterwards no force is called for."""
    equality = f'<equality><joint joint1="j" polycoef="{aim} 0 0 0 0"/></equality>'
    scene = make(world(SLIDER, before=NO_GRAVITY, after=equality), duration=0.04)
    found = run(scene, rung)
    assert str(found.outcome) == "timeout", found.reason
    np.testing.assert_allclose(q(found), aim, atol=1e-12)


@pytest.mark.parametrize("step", [0, -1e-3, float("nan"), float("inf"), "x"])
def test_a_replay_with_an_impossible_step_is_refused(make: Make, step: object) -> None:
    found = run(make(world(SLIDER), duration=0.01), rw.DYNAMIC_RIGID)
    with pytest.raises(rw.InputError, match="step: must be a finite number greater than 0"):
        rw.replay(found, step=step)  # type: ignore[arg-type]
