"""Sliding, rolling, sticking and tipping against rigid-body statics and dynamics."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw

DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
G = 9.81


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
@pytest.mark.parametrize(
    ("gyration", "fraction", "time"), [(0.5, 2 / 3, 1 / 3), (0.4, 5 / 7, 2 / 7), (1.0, 1 / 2, 1 / 2)]
)
def test_slide_then_roll(model: rw.Rung, gyration: float, fraction: float, time: float) -> None:
    for v0, mu in ((1.0, 0.2), (3.3, 0.07)):
        run = rw.simulate(
            "slide_roll", model, parameters={"gyration": gyration, "v0": v0, "mu": mu, "damping": 3e3}
        )
        assert run.outcome.name == "goal"
        assert run.time == pytest.approx(time * v0 / (mu * G), rel=2e-3)
        speed = float(run.trajectory.velocity.sel(coordinate="disc.x")[-1])
        assert speed == pytest.approx(fraction * v0, rel=2e-3)
        distance = v0 * run.time - 0.5 * mu * G * run.time**2
        assert run.final["disc"]["x"] == pytest.approx(distance, rel=2e-3)


def test_rolling_lasts_and_dissipates_nothing() -> None:
    data = rw.load("slide_roll").file.model_dump(mode="json")
    data["goal"] = "t >= 2 and speed(disc.x) > 0"
    run = rw.simulate(rw.load(data), rw.DYNAMIC_RIGID, duration=2.1, step=1e-3)
    speeds = run.trajectory.velocity.sel(coordinate="disc.x").values
    assert speeds[-1] == pytest.approx(2 / 3, rel=1e-3)
    rolling = run.trajectory.time.values > 0.2
    assert np.ptp(speeds[rolling]) < 1e-12
    assert np.ptp(run.trajectory.kinetic_energy.values[rolling]) < 1e-12


def block(slope: float, mu: float, **more: float) -> dict[str, float]:
    return {"slope": slope, "mu": mu, "mu_stack": mu, **more}


@pytest.mark.few(3)
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
@pytest.mark.parametrize("slope", [0.1, 0.3, -0.45])
def test_blocks_stay_iff_friction_holds(model: rw.Rung, slope: float) -> None:
    limit = math.tan(abs(slope))
    kept = rw.simulate("blocks", model, parameters=block(slope, 1.01 * limit, layer=0.3))
    assert kept.outcome.name == "goal"
    assert abs(kept.final["lone"]["angle"] - slope) < 1e-5
    slid = rw.simulate("blocks", model, parameters=block(slope, 0.97 * limit, layer=0.3))
    assert slid.outcome.name == "timeout"


@pytest.mark.parametrize("slope", [0.2, 0.35])
def test_no_creep_and_no_lift_off_on_the_rigid_rung(slope: float) -> None:
    scene = rw.load("blocks")
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters=block(slope, 0.5))
    moved = np.abs(run.trajectory.position.values - run.trajectory.position.values[0]).max()
    assert run.outcome.name == "goal" and moved < 1e-13
    slid = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters=block(slope, 0.1, density=2.0))
    assert float(abs(slid.trajectory.gap.sel(contact="lone|ground")).max()) < 1e-12


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_sliding_acceleration(model: rw.Rung) -> None:
    slope, mu = 0.5, 0.2
    run = rw.simulate("blocks", model, parameters=block(slope, mu), duration=1.0, step=1e-3)
    along = run.trajectory.velocity.sel(coordinate=["lone.x", "lone.y"]).values @ -np.array(
        [math.cos(slope), math.sin(slope)]
    )
    acceleration = G * (math.sin(slope) - mu * math.cos(slope))
    assert along[-1] == pytest.approx(acceleration * run.time, rel=2e-3)


def test_compliant_block_keeps_its_elastic_offset() -> None:
    slope, stiffness = 0.3, 1e5
    parameters = block(slope, 0.8, stiffness=stiffness, damping=1e3, layer=0.3)
    data = rw.load("blocks").file.model_dump(mode="json") | {"goal": None}
    run = rw.simulate(rw.load(data), rw.DYNAMIC_COMPLIANT, parameters=parameters, duration=2.0, step=2e-4)
    start, end = run.trajectory.position[0], run.trajectory.position[-1]
    down = -np.array([math.cos(slope), math.sin(slope)])
    slip = (end - start).sel(coordinate=["lone.x", "lone.y"]).values @ down
    weight = 1.0 * G
    tilt = slip - weight * math.sin(slope) / (2.0 * stiffness)
    turned = float((end - start).sel(coordinate="lone.angle"))
    assert tilt == pytest.approx(0.5 * turned, rel=2e-2)
    assert np.abs(run.trajectory.velocity[-1]).max() < 1e-9


@pytest.mark.few(3)
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
@pytest.mark.parametrize("aspect", [0.4, 0.7])
def test_block_tips_iff_its_weight_falls_outside_its_base(model: rw.Rung, aspect: float) -> None:
    critical = math.atan(aspect)
    for slope, expected in ((critical - 0.02, "goal"), (critical + 0.02, "unsafe")):
        parameters = block(slope, 5.0, height=1.0 / aspect, layer=0.2)
        run = rw.simulate("blocks", model, parameters=parameters, duration=20.0)
        assert run.outcome.name == expected, (slope, run.reason)


def test_overhanging_stack_falls() -> None:
    stays = rw.simulate("blocks", rw.DYNAMIC_RIGID, parameters=block(0.0, 0.5, shift=0.48))
    falls = rw.simulate("blocks", rw.DYNAMIC_RIGID, parameters=block(0.0, 0.5, shift=0.52), duration=20.0)
    assert stays.outcome.name == "goal" and falls.outcome.name == "unsafe"


def test_rocking_block_overturns_iff_its_energy_lifts_it_over_the_corner() -> None:
    width, height = 1.0, 2.0
    arm = 0.5 * math.hypot(width, height)
    about_corner = (width**2 + height**2) / 3.0
    lift = arm - 0.5 * height
    # The impulse that starts rocking about a corner keeps angular momentum about it: omega = I_c spin / I_o.
    about_centre = (width**2 + height**2) / 12.0
    needed = math.sqrt(2.0 * G * lift / about_corner) * about_corner / about_centre
    for factor, expected in ((0.97, "goal"), (1.03, "unsafe")):
        parameters = block(0.0, 10.0, height=height, spin=factor * needed)
        run = rw.simulate("blocks", rw.DYNAMIC_RIGID, parameters=parameters, duration=20.0, step=1e-3)
        assert run.outcome.name == expected


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT], ids=str)
def test_quasistatic_block_is_unsupported_iff_it_would_slide(model: rw.Rung) -> None:
    slope = 0.3
    assert (
        rw.simulate("blocks", model, parameters=block(slope, 1.01 * math.tan(slope))).outcome.name == "goal"
    )
    run = rw.simulate("blocks", model, parameters=block(slope, 0.97 * math.tan(slope)))
    assert run.outcome.name == "unsupported" and run.certificate is not None


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_bouncing_disc(restitution: float) -> None:
    data = rw.load("slide_roll").file.model_dump(mode="json") | {"goal": None}
    data["bodies"]["disc"]["coordinates"]["y"] = {"start": 0.5}
    run = rw.simulate(
        rw.load(data),
        rw.DYNAMIC_RIGID,
        parameters={"restitution": restitution, "v0": 1e-6},
        duration=0.6,
        step=1e-4,
    )
    speed = run.trajectory.velocity.sel(coordinate="disc.y").values
    impact = math.sqrt(2.0 * G * 0.5)
    assert speed.max() == pytest.approx(restitution * impact, abs=2e-3 * impact)


@pytest.mark.parametrize(
    ("slope", "mu", "spin"), [(0.3, 0.4, 0.5), (0.3, 0.2, 0.5), (0.2, 0.5, 1.0), (0.0, 0.5, 1.0)]
)
def test_a_block_that_rattles_to_rest_takes_hardly_more_steps_than_it_is_given(
    slope: float, mu: float, spin: float
) -> None:
    data = rw.load("blocks").file.model_dump(mode="json")
    for contact in data["contacts"]:
        contact["restitution"] = 0.2
    data["goal"] = "t > 1e3"
    run = rw.simulate(data, rw.DYNAMIC_RIGID, parameters=block(slope, mu, spin=spin))
    assert run.outcome.name == "timeout" and run.worst_residual <= 1e-8
    assert run.attempts < 5000 * 1.05
    assert run.final["lone"]["angle"] == pytest.approx(slope, abs=1e-9)


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize("beyond", [3e-10, 1e-6])
def test_a_box_slides_hardly_beyond_its_angle_of_friction_in_any_unit(size: float, beyond: float) -> None:
    mu, g, h, until = 0.9, 9.81 * size, 1e-3, 0.25
    slope = math.atan(mu) + beyond
    box = {"kind": "box", "width": 0.2 * size, "height": 0.1 * size}
    part = {"role": "object", "shape": box, "mass": 1.3, "motion": {"kind": "free"}}
    given = {
        "name": "slope",
        "gravity": [g * math.sin(slope), -g * math.cos(slope)],
        "bodies": {
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
            "box": part | {"pose": {"x": 0.0, "y": 0.05 * size}},
        },
        "contacts": [{"between": ["*", "*"], "friction": mu}],
        "step": h, "duration": until, "tolerance": 1e-6 * size,
    }  # fmt: skip
    run = rw.simulate(given, rw.DYNAMIC_RIGID)
    pull = 9.81 * (math.sin(slope) - mu * math.cos(slope))
    assert run.final["box"]["x"] / size == pytest.approx(0.5 * pull * until * (until + h), rel=1e-5)
