"""How runs end, what they record, and how they are taken in turns."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation import trajectory
from rungwise.simulation.run import ModelError, Simulation

from .conftest import MOVING

DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)


def changed(scene: str, **fields: Any) -> rw.Scene:
    """A shipped scene with other fields."""
    return rw.load(rw.load(scene).file.model_dump(mode="json") | fields)


def slider(coordinate: dict[str, Any], wall: float | None = None, **fields: Any) -> rw.Scene:
    """A block on rails, and maybe a wall in front of its right face at `wall`."""
    body = {
        "role": "robot",
        "mass": 2.0,
        "shape": {"kind": "box", "width": 1.0, "height": 1.0},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": coordinate},
    }
    bodies: dict[str, Any] = {"block": body}
    if wall is not None:
        bodies["wall"] = {
            "role": "obstacle",
            "shape": {"kind": "halfplane", "normal": [-1, 0], "at": [0.5 + wall, 0]},
        }
    contacts = [] if wall is None else [{"between": ["block", "wall"], "stiffness": 1e5, "damping": 1e3}]
    scene = {"name": "slider", "bodies": bodies, "contacts": contacts, "duration": 1.0, "step": 1e-3}
    return rw.load(scene | fields)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_outcomes_that_hold_at_the_start(model: rw.Rung) -> None:
    reached = rw.simulate(changed("two_finger", goal="t <= 1"), model)
    assert (reached.outcome.name, reached.time, reached.steps) == ("goal", 0.0, 0)
    doomed = rw.simulate("two_finger", model, parameters={"x3": 0.6})
    assert (doomed.outcome.name, doomed.steps) == ("doomed", 0)
    assert "no input" in doomed.reason and doomed.outcome.exit_code == 1
    unsafe = rw.simulate(changed("two_finger", goal="t <= 1", unsafe="part.x3 < 1"), model)
    assert unsafe.outcome.name == "unsafe"
    assert doomed.trajectory.sizes["time"] == 1


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_timeout_and_missed(model: rw.Rung) -> None:
    moving = slider({"upper": 0.4, "drive": {"kind": "speed", "speed": 1.0}}, goal="block.s > 1")
    late = rw.simulate(moving, model, duration=0.3)
    assert late.outcome.name == "timeout" and late.time == pytest.approx(0.3) and "--time" in late.reason
    missed = rw.simulate(moving, model)
    assert missed.outcome.name == "missed" and "inputs are spent" in missed.reason


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_overlap_at_the_start_is_invalid_and_names_the_bodies(model: rw.Rung) -> None:
    run = rw.simulate("two_finger", model, parameters={"travel": 0.3})
    assert run.outcome.name == "invalid" and run.outcome.exit_code == 2
    assert "finger" in run.reason and "part" in run.reason and "overlaps" in run.reason
    with pytest.raises(ValueError, match="did not begin"):
        _ = run.trajectory


def test_contact_too_soft_for_its_model() -> None:
    data = rw.load("slide_roll").file.model_dump(mode="json") | {"goal": None}
    run = rw.simulate(rw.load(data), rw.DYNAMIC_COMPLIANT, parameters={"stiffness": 100.0, "damping": 1.0})
    assert run.outcome.name == "model_invalid" and "stiffness" in run.reason
    # Sinking by a tenth of the radius takes sqrt(2 * 0.01 / g) in free fall; the spring delays it.
    assert math.sqrt(2 * 0.01 / 9.81) < run.time < 1.2 * math.sqrt(2 * 0.01 / 9.81)


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT], ids=str)
def test_unsupported_has_a_certificate(model: rw.Rung) -> None:
    run = rw.simulate("blocks", model, parameters={"slope": 0.4, "mu": 0.1})
    assert run.outcome.name == "unsupported" and run.certificate is not None and run.problem is not None
    assert run.certificate.kind == "unsupported" and "dynamic rung" in run.reason


@pytest.mark.parametrize("model", [rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=str)
def test_prescribed_speed_into_a_wall_jams(model: rw.Rung) -> None:
    run = rw.simulate(slider({"drive": {"kind": "speed", "speed": 1.0}}, wall=0.2), model)
    assert run.outcome.name == "jammed" and run.certificate is not None
    assert run.final["block"]["s"] == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"step": 0.0}, "step"),
        ({"step": math.nan}, "step"),
        ({"tol": -1.0}, "tol"),
        ({"duration": math.inf}, "time"),
        ({"theta": 0.4}, "theta"),
        ({"theta": 1.1}, "theta"),
        ({"theta": math.nan}, "theta"),
        ({"frames": 2}, "frames"),
        ({"stride": 0}, "stride"),
    ],
)
def test_options_that_are_not_accepted(options: dict[str, Any], named: str) -> None:
    with pytest.raises(ModelError, match=named):
        rw.simulate("two_finger", rw.DYNAMIC_RIGID, **options)


def test_models_that_are_not_accepted() -> None:
    with pytest.raises(ModelError, match="geometric"):
        rw.simulate("two_finger", rw.GEOMETRIC)
    with pytest.raises(ModelError, match="quasistatic-rigid"):
        rw.simulate("two_finger", "rigid")


@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("options", [{"step": 3e-3}, {"tol": 1e-4}], ids=str)
def test_travel_limit_ends_a_motion_exactly(model: rw.Rung, options: dict[str, float]) -> None:
    scene = slider({"upper": 0.5, "drive": {"kind": "speed", "speed": 1.0}}, goal="block.s > 1")
    data = rw.simulate(scene, model, stride=1, **options).trajectory
    position, time = data.position.values[:, 0], data.time.values
    assert position[-1] == 0.5 and position.max() == 0.5
    assert time[position == 0.5][0] == pytest.approx(0.5, abs=1e-12)
    assert position == pytest.approx(np.minimum(time, 0.5), abs=1e-12)


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_what_is_rigid_stops_without_a_bounce(theta: float) -> None:
    """A travel limit, and dry friction that brings a block to rest, whatever the theta of the step."""
    for coordinate in ({"speed": 1.0, "upper": 0.2003}, {"speed": 1.0, "dry_friction": 5.0}):
        run = rw.simulate(slider(coordinate), rw.DYNAMIC_COMPLIANT, theta=theta)
        velocity = run.trajectory.velocity.values[:, 0]
        assert velocity.min() >= -1e-12 and velocity[-1] == pytest.approx(0.0, abs=1e-12)
        assert run.final["block"]["s"] == pytest.approx(0.2003 if "upper" in coordinate else 0.2, abs=1e-3)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_finger_at_its_limit_does_not_jam_the_part(model: rw.Rung) -> None:
    scene = changed("two_finger", goal=None, doomed=None)
    run = rw.simulate(scene, model, parameters={"v2": 0.05}, step=0.0137, duration=4.0)
    assert run.outcome.name == "timeout" and run.final["finger1"]["x1"] == 2.0
    pushed = run.final["part"]["x3"]
    if model.inertia == 0.0:
        assert pushed == pytest.approx(0.5, abs=1e-3)
    else:
        assert pushed > 2.0


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_speed_in_time(model: rw.Rung) -> None:
    scene = slider({"drive": {"kind": "speed", "speed": "v1 * cos(t)"}}, parameters={"v1": {"default": 0.7}})
    errors = []
    for step in (4e-3, 2e-3, 1e-3):
        run = rw.simulate(scene, model, step=step)
        errors.append(abs(run.final["block"]["s"] - 0.7 * math.sin(1.0)))
    assert np.polyfit(np.log([4e-3, 2e-3, 1e-3]), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("model", MOVING[1:], ids=str)
@pytest.mark.parametrize("stop", ["wall", "limit"])
def test_servo_stalls_at_its_force_limit(model: rw.Rung, stop: str) -> None:
    servo = {"kind": "servo", "stiffness": 100.0, "damping": 40.0, "target": 1.0, "limit": 3.0}
    scene = slider(
        {"drive": servo} | ({} if stop == "wall" else {"upper": 0.2}), 0.2 if stop == "wall" else None
    )
    run = rw.simulate(scene, model, stride=1)
    data = run.trajectory
    assert run.outcome.name == "timeout"
    assert run.final["block"]["s"] == pytest.approx(0.2, abs=1e-4)
    assert float(data.drive_force[-1, 0]) == pytest.approx(3.0, rel=1e-9)
    if "contact_force" in data:
        total = float(data.contact_force[-1].sel(direction="normal").sum())
    else:
        total = float(data.contact_impulse[-1].sel(direction="normal").sum()) / 1e-3
    assert total == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("model", MOVING[1:], ids=str)
def test_prescribed_reaction_is_minus_the_contact_force(model: rw.Rung) -> None:
    """A finger pushes a block at constant speed against drag: F = d v."""
    bodies = {
        "finger": {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 2.0},
            "pose": {"x": -3.0},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"drive": {"kind": "speed", "speed": 0.3}}},
        },
        "block": {
            "role": "object",
            "mass": 0.5,
            "shape": {"kind": "box", "width": 2.0, "height": 2.0},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"damping": 5.0}},
        },
    }
    contact = {"between": ["finger", "block"], "stiffness": 1e4, "damping": 1e2}
    scene = rw.load({"name": "push", "bodies": bodies, "contacts": [contact], "duration": 2.0})
    data = rw.simulate(scene, model, stride=1, step=1e-3, frames=5000).trajectory
    if "contact_force" in data:
        force = data.contact_force.sel(direction="normal").sum("point").values[1:]
    else:
        force = data.contact_impulse.sel(direction="normal").sum("point").values[1:] / 1e-3
    drive = data.drive_force.sel(coordinate="finger.s").values[1:]
    assert drive == pytest.approx(force, rel=1e-9, abs=1e-12)
    assert drive[-1] == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize("frames", [3, 7, 51, 2000])
def test_thinning_keeps_the_ends_and_the_impulses(frames: int) -> None:
    scene = changed("slide_roll", goal=None)
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.2, step=1e-3, stride=1, frames=frames)
    data = run.trajectory
    assert 3 <= data.sizes["time"] <= frames
    assert data.time.values[0] == 0.0 and data.time.values[-1] == run.time
    assert np.all(np.diff(data.time.values) > 0.0)
    impulse = data.contact_impulse.sum(("time", "point"))
    momentum = (data.velocity[-1] - data.velocity[0]).values
    assert float(impulse.sel(direction="normal")) == pytest.approx(9.81 * run.time, rel=1e-9)
    assert abs(float(impulse.sel(direction="tangent"))) == pytest.approx(abs(momentum[0]), rel=1e-9)


def test_impulse_of_an_impact_is_the_change_of_momentum() -> None:
    data = rw.load("slide_roll").file.model_dump(mode="json") | {"goal": None, "gravity": [0, 0]}
    data["bodies"]["disc"]["coordinates"]["y"] = {"start": 0.1, "speed": -2.0}
    parameters = {"restitution": 0.6, "mu": 0.05, "mass": 3.0}
    run = rw.simulate(rw.load(data), rw.DYNAMIC_RIGID, parameters=parameters, duration=0.2, step=1e-3)
    impulse = run.trajectory.contact_impulse.sum(("time", "point"))
    velocity = run.trajectory.velocity
    assert float(velocity.sel(coordinate="disc.y")[-1]) == pytest.approx(1.2, rel=1e-9)
    assert float(impulse.sel(direction="normal")) == pytest.approx(3.0 * 3.2, rel=1e-9)
    slowed = velocity.sel(coordinate="disc.x")[0] - velocity.sel(coordinate="disc.x")[-1]
    assert float(slowed) == pytest.approx(0.05 * 3.2, rel=1e-9)


def test_stride_and_names() -> None:
    run = rw.simulate("two_finger", rw.DYNAMIC_RIGID, duration=0.1, step=1e-3, stride=10)
    data = run.trajectory
    assert data.time.values == pytest.approx(np.linspace(0.0, 0.1, 11))
    assert list(data.coordinate.values) == ["finger1.x1", "finger2.x2", "part.x3"]
    assert "finger1|part" in data.contact.values
    assert float(data.position.sel(coordinate="finger1.x1")[-1]) == run.final["finger1"]["x1"]
    assert data.attrs["outcome"] == "timeout"


def test_saved_runs_come_back_and_are_replaced_whole(tmp_path: Path) -> None:
    first = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT, step=2e-3)
    second = rw.simulate("slide_roll", rw.DYNAMIC_RIGID, duration=0.05)
    for run in (first, second):
        assert run.save(tmp_path) == tmp_path
        data, summary = trajectory.load(tmp_path)
        assert data.equals(run.trajectory) and data.attrs == run.trajectory.attrs
        assert summary == run.summary()
        assert sorted(p.name for p in tmp_path.iterdir()) == [trajectory.SUMMARY, trajectory.STORE]


def test_a_folder_without_a_run(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no saved run"):
        trajectory.load(tmp_path)


def test_progress_and_interruption() -> None:
    scene = rw.load("two_finger")
    seen: list[float] = []
    whole = rw.simulate(scene, rw.DYNAMIC_RIGID, on_progress=lambda s: seen.append(s.progress))
    assert seen and seen == sorted(seen) and 0.0 < seen[0] < 1.0
    held: list[Simulation] = []

    def interrupt(simulation: Simulation) -> None:
        held.append(simulation)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rw.simulate(scene, rw.DYNAMIC_RIGID, on_progress=interrupt)
    stopped = held[0].result()
    assert stopped.outcome.name == "running" and stopped.trajectory.sizes["time"] > 1
    while held[0].advance():
        pass
    assert held[0].result().trajectory.equals(whole.trajectory)


@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("options", [{"step": 3.1e-3}, {"tol": 1e-4}], ids=str)
def test_small_turns_change_nothing(model: rw.Rung, options: dict[str, float]) -> None:
    parameters = {"v2": 0.83, "mu": 0.4}
    whole = rw.simulate("two_finger", model, parameters=parameters, frames=50, **options)
    simulation = Simulation("two_finger", model, parameters=parameters, frames=50, **options)
    turns = 0
    simulation._turn = 2
    while simulation.advance():
        simulation._turn = 2
        turns += 1
    parts = simulation.result()
    assert turns >= whole.steps // 2 - 1 > 2
    assert parts.final == whole.final and parts.steps == whole.steps and parts.attempts == whole.attempts
    assert parts.trajectory.identical(whole.trajectory)
    assert not simulation.advance() and simulation.progress == 1.0


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_long_steps_notice_a_condition_within_a_nominal_step(model: rw.Rung) -> None:
    """Free flight allows steps of a hundredth of the duration; what began in one of them is dated."""
    scene = slider({"speed": 1.0}, duration=100.0, step=1e-3, goal="block.s >= 3.7003", doomed="t >= 50")
    run = rw.simulate(scene, model, tol=1e-3)
    assert run.outcome.name == "goal" and run.steps < 100
    assert 3.7003 <= run.time <= 3.7003 + 1e-3
