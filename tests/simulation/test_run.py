"""How runs end, what they record, and how they are taken in turns."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.content import same
from rungwise.simulation import trajectory
from rungwise.simulation.options import ModelError
from rungwise.simulation.planar import loop
from rungwise.simulation.run import Simulation

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


@pytest.mark.few(3)
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
    with pytest.raises(ModelError, match=f"^{named}: must be"):
        rw.simulate("two_finger", rw.DYNAMIC_RIGID, **options)


@pytest.mark.parametrize("option", ["step", "tol", "duration", "theta", "frames", "stride"])
@pytest.mark.parametrize(
    "value", ["a", "1", "a\nb", True, [1.0], {}, b"1", 1j, np.array([1.0]), 10**400, object], ids=ascii
)
def test_options_of_the_wrong_type(option: str, value: object) -> None:
    with pytest.raises(ModelError) as caught:
        Simulation("two_finger", rw.DYNAMIC_RIGID, **{option: value})  # type: ignore[arg-type]
    name = "time" if option == "duration" else option
    assert str(caught.value).startswith(f"{name}: must be a ") and str(caught.value).isprintable()


def test_options_that_are_too_many_or_of_no_value() -> None:
    for options in (
        {"theta": None},
        {"frames": None},
        {"frames": 3.5},
        {"frames": 10**12},
        {"stride": 10**30},
    ):
        with pytest.raises(ModelError, match=f"^{next(iter(options))}: must be a "):
            Simulation("two_finger", rw.DYNAMIC_RIGID, **options)  # type: ignore[arg-type]


def test_options_of_other_number_types() -> None:
    options = {
        "duration": np.float32(0.5),
        "theta": np.float64(0.5),
        "frames": np.int64(3),
        "step": Fraction(1, 64),
    }
    run = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT, **options)
    assert run.time == 0.5 and run.steps == 32 and run.trajectory.sizes["time"] <= 3


def test_what_does_not_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def allocate(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("rungwise.simulation.run.allocate", allocate)
    with pytest.raises(
        ModelError, match=r"frames: 2000 states and 2 pairs of shapes .* do not fit into memory"
    ):
        Simulation("two_finger", rw.DYNAMIC_RIGID)


def test_models_that_are_not_accepted() -> None:
    with pytest.raises(ModelError, match="geometric"):
        rw.simulate("two_finger", rw.GEOMETRIC)
    for model in ("rigid", "", None, 5, np.array(["kinematic"]), ["kinematic"]):
        with pytest.raises(ModelError, match=r"^model: unknown .*quasistatic-rigid"):
            rw.simulate("two_finger", model)  # type: ignore[arg-type]


def test_inertia_that_is_not_accepted() -> None:
    for rung in (rw.KINEMATIC, rw.GEOMETRIC):
        with pytest.raises(ValueError, match=f"^inertia: the {rung.name} rung has none"):
            rung.with_inertia(0.5)
    for value in (-0.1, 1.1, math.nan, "a", None, True):
        with pytest.raises(ValueError, match=r"^inertia: must be a number in 0..1, not "):
            rw.DYNAMIC_RIGID.with_inertia(value)  # type: ignore[arg-type]
    assert rw.DYNAMIC_RIGID.with_inertia(0.5).inertia == 0.5


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("tiny", [1e-300, 5e-324])
@pytest.mark.parametrize("option", ["tol", "step"])
def test_demands_that_numbers_cannot_meet(model: rw.Rung, option: str, tiny: float) -> None:
    """They end the run with a verdict or leave it going, and never raise.

    A scene in which no speed changes but at impacts meets any tolerance.
    """
    for scene in ("two_finger", "slide_roll", "blocks"):
        simulation = Simulation(scene, model, **{option: tiny})  # type: ignore[arg-type]
        simulation.advance(30)
        run = simulation.result()
        assert ("(residual " in run.reason) == (run.outcome.name == "not_converged")
        if scene == "two_finger" and option == "tol":
            assert run.outcome.name in ("goal", "not_converged")


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
    assert np.polyfit(np.log([4e-3, 2e-3, 1e-3]), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.02)


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


RUNS = {
    "compliant": lambda: rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT, step=2e-3),
    "rigid": lambda: rw.simulate("slide_roll", rw.DYNAMIC_RIGID, duration=0.05),
    "half": lambda: rw.simulate("push", rw.DYNAMIC_RIGID.with_inertia(0.5), theta=0.5, duration=0.5),
    "inputs": lambda: rw.simulate(
        "two_finger", "kinematic", inputs=[{"inputs": {"v2": 0.9}, "duration": 0.5}]
    ),
    "jam": lambda: rw.simulate("two_finger", "quasistatic-rigid", parameters={"mu": 1.2, "v2": 0.9}),
    "space": lambda: rw.simulate("ball", "dynamic-rigid", duration=0.1),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", RUNS)
def test_saved_runs_come_back_as_they_were(name: str, tmp_path: Path) -> None:
    run = RUNS[name]()
    assert run.save(tmp_path) == tmp_path
    read = rw.load_run(tmp_path)
    assert type(read) is type(run) and read.scene == run.scene and read.model == run.model
    assert read.trajectory.equals(run.trajectory) and read.trajectory.attrs == run.trajectory.attrs
    assert read.summary() == run.summary() and read.theta == run.theta and read.inputs == run.inputs
    assert len(read.states) == len(run.states) and read.energy_gained == run.energy_gained
    for one, other in zip(read.states, run.states, strict=True):
        assert np.array_equal(one.memory.values, other.memory.values, equal_nan=True)
        assert np.array_equal(one.q, other.q) and np.array_equal(one.v, other.v) and one.time == other.time
    assert same(read.certificate, run.certificate)
    assert all(page.stat().st_size > 1000 for page in rw.view(read, html=tmp_path / "run.html"))
    on = [rw.simulate(each.scene, each.model, state=each.states[2], parameters=each.parameters,
                      theta=each.theta, duration=run.time) for each in (read, run)]  # fmt: skip
    assert on[0].final == on[1].final and on[0].steps == on[1].steps


def test_saved_runs_are_replaced_whole(tmp_path: Path) -> None:
    for run in (RUNS["compliant"](), RUNS["rigid"]()):
        run.save(tmp_path)
        assert rw.load_run(tmp_path).summary() == run.summary()
        files = sorted(p.name for p in tmp_path.iterdir())
        assert files == [trajectory.SUMMARY, trajectory.STATES, trajectory.STORE]


def test_folders_without_a_run_or_without_its_states(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no saved run"):
        rw.load_run(tmp_path)
    RUNS["rigid"]().save(tmp_path)
    (tmp_path / trajectory.STATES).unlink()
    with pytest.raises(rw.StateError, match="an earlier version saved"):
        rw.load_run(tmp_path)


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


@pytest.mark.few(3)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("options", [{"step": 3.1e-3}, {"tol": 1e-4}], ids=str)
def test_small_turns_change_nothing(model: rw.Rung, options: dict[str, float]) -> None:
    parameters = {"v2": 0.83, "mu": 0.4}
    whole = rw.simulate("two_finger", model, parameters=parameters, frames=50, **options)
    simulation = Simulation("two_finger", model, parameters=parameters, frames=50, **options)
    turns = 0
    while simulation.advance(2):
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


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_step_beyond_all_numbers_is_not_taken(model: rw.Rung) -> None:
    scene = slider({"speed": 1e10, "drive": {"kind": "force", "force": 1.0}, "damping": 1e-10}, wall=1.0)
    for name in (scene, "blocks", "slide_roll"):
        simulation = Simulation(name, model, step=1e300, duration=1e300)
        simulation.advance()
        run = simulation.result()
        assert all(math.isfinite(x) for body in run.final.values() for x in body.values())
        assert np.isfinite(run.trajectory.position).all()


FIELDS = {
    "speed": {"kind": "speed", "speed": "{}"},
    "force": {"kind": "force", "force": "{}"},
    "target": {"kind": "servo", "stiffness": 1.0, "target": "{}"},
    "target_speed": {"kind": "servo", "stiffness": 1.0, "target": 0.0, "target_speed": "{}"},
}


@pytest.mark.few(20)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("options", [{"step": 1 / 64}, {"tol": 1e-3}, {"tol": 1e-3, "theta": 0.5}], ids=str)
@pytest.mark.parametrize("field", FIELDS)
def test_numbers_of_time_that_stop_being_finite(
    model: rw.Rung, options: dict[str, float], field: str
) -> None:
    drive = {
        name: text.format("sqrt(0.5 - t)") if type(text) is str else text
        for name, text in FIELDS[field].items()
    }
    run = rw.simulate(slider({"drive": drive, "damping": 1.0}), model, **options)
    assert run.outcome.name == "invalid"
    assert run.reason.startswith(
        f"bodies.block.coordinates.s.drive.{field}: must be finite, not nan, at t = 0.5"
    )
    assert 0.5 - run.time <= 1 / 64 and run.trajectory.sizes["time"] > 1


def test_a_load_that_stops_being_finite() -> None:
    scene = slider({}).file.model_dump(mode="json")
    scene["bodies"]["block"]["force"] = ["log(0.25 - t)", 0]
    run = rw.simulate(rw.load(scene), rw.DYNAMIC_RIGID, step=1 / 64)
    assert run.outcome.name == "invalid"
    assert run.reason == "bodies.block.force.0: must be finite, not -inf, at t = 0.25"


def test_a_speed_without_bound_is_seen_where_it_is_met() -> None:
    scene = slider({"drive": {"kind": "speed", "speed": "1 / (t - 0.5)"}, "lower": -1e3})
    # A step takes a speed as it is in its middle.
    for step, theta, before in ((0.2, 1.0, 0.4), (0.2, 0.5, 0.4)):
        run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, step=step, theta=theta)
        assert run.outcome.name == "invalid" and run.time == before
        assert run.reason == "bodies.block.coordinates.s.drive.speed: must be finite, not inf, at t = 0.5"


def test_goal_before_a_number_stops_being_finite() -> None:
    """A long step that would reach past the end of what is defined is cut, not refused."""
    scene = slider(
        {"drive": {"kind": "speed", "speed": "0.2 + 0 * sqrt(0.5 - t)"}},
        duration=10.0,
        goal="block.s >= 0.0995",
    )
    assert rw.simulate(scene, rw.KINEMATIC, tol=1e-2).outcome.name == "goal"


def test_wall_time_is_without_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call, which compiles, is over before the clock starts."""
    now, spent = [0.0], [60.0, 1.0, 1.0]
    advance = loop.advance

    def slow(*arguments: object) -> int:
        now[0] += spent.pop(0)
        return int(advance(*arguments))  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "advance", slow)
    simulation = Simulation("two_finger", rw.KINEMATIC)
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    simulation.advance()
    assert simulation.result().wall_s == 1.0


def test_summaries_are_json_without_nan(tmp_path: Path) -> None:
    run = rw.simulate("two_finger", rw.KINEMATIC, duration=0.01)
    broken = dataclasses.replace(run, worst_residual=math.inf, parameters={"v1": math.nan})
    text = (broken.save(tmp_path) / trajectory.SUMMARY).read_text()
    read = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert read["worst_residual"] is None and read["parameters"] == {"v1": None}


def pusher(**drive: Any) -> dict[str, Any]:
    """A finger at 0, a part at 0.5 in its way (a little aside), both of radius 0.1."""
    disc = {"kind": "disc", "radius": 0.1}
    damped = {name: {"damping": 1.0} for name in ("x", "y", "angle")}
    return {
        "name": "pusher",
        "bodies": {
            "finger": {
                "role": "robot",
                "shape": disc,
                "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
                "coordinates": {"x": {"drive": drive}},
            },
            "part": {
                "role": "object",
                "shape": disc,
                "pose": {"x": 0.5, "y": 0.02},
                "mass": 1.0,
                "motion": {"kind": "free"},
                "coordinates": damped,
            },
        },
        "contacts": [{"between": ["finger", "part"], "friction": 0.2}],
        "duration": 1.0,
        "step": 1e-3,
    }


@pytest.mark.parametrize("target", [0.35, 0.9])
def test_a_servo_that_jumps_is_named_by_the_kinematic_rung(target: float) -> None:
    """It is followed exactly there, and would pass through what stands in its way."""
    scene = pusher(kind="servo", stiffness=1e3, damping=1e2, target=target)
    run = rw.simulate(scene, rw.KINEMATIC)
    assert run.outcome.name == "not_converged" and run.time == 0.0
    assert run.reason.startswith(f"bodies.finger.coordinates.x.drive: its target is {target} away")
    assert rw.simulate(scene, rw.QUASISTATIC_RIGID).outcome.name == "timeout"
    free = rw.simulate(pusher(kind="servo", stiffness=1e3, target=0.2), rw.KINEMATIC)
    assert free.outcome.name == "missed" and free.final["finger"]["x"] == 0.2


@pytest.mark.parametrize("h", [1e-3, 1e-2, 0.1, 1.0])
def test_a_kinematic_step_does_not_lead_past_what_it_pushes(h: float) -> None:
    """A finger that would cover 0.9 in one step pushes the part ahead, or around itself."""
    run = rw.simulate(pusher(kind="speed", speed=0.9 / h), rw.KINEMATIC, step=h, duration=h)
    assert run.outcome.name == "timeout" and run.final["finger"]["x"] == pytest.approx(0.9)
    part = run.final["part"]
    assert np.hypot(part["x"] - 0.9, part["y"]) >= 0.2 - 1e-9
    assert part["x"] > 0.85 and part["y"] < 0.2


def test_a_step_that_was_far_too_long_is_told() -> None:
    long = rw.simulate("slide_roll", rw.DYNAMIC_RIGID, step=5.0)
    assert any(note.startswith("step: 5 is longer than the whole run") for note in long.notes)
    assert rw.simulate("slide_roll", rw.DYNAMIC_RIGID).notes == ()


def test_options_that_a_rung_does_not_use_are_told() -> None:
    for model in MOVING:
        run = rw.simulate("two_finger", model, theta=0.5, duration=0.1)
        used = model == rw.DYNAMIC_COMPLIANT
        assert [note.partition(":")[0] for note in run.notes] == ([] if used else ["theta"])


@pytest.mark.parametrize("seed", range(6))
def test_a_target_that_jumps_names_its_servo(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at, far = rng.uniform(0.1, 0.9), rng.uniform(0.1, 3.0) * rng.choice([-1.0, 1.0])
    smooth = f"{rng.uniform(-1, 1)} * sin(3 * t)"
    for target, jumps in ((f"{smooth} + ({far} if t > {at} else 0)", True), (f"{smooth} + {far} * t", False)):
        drive = {"kind": "servo", "stiffness": 100.0, "damping": 20.0, "target": target}
        run = rw.simulate(slider({"drive": drive}), rw.KINEMATIC, duration=1.0, step=0.03)
        remarks = [note for note in run.notes if note.startswith("bodies.block.coordinates.s.drive")]
        assert len(remarks) == jumps
        assert not jumps or f"t = {at:.6g}" in remarks[0]
    walled = slider({"drive": {**drive, "target": f"{abs(far)} if t > {at} else 0"}}, wall=0.05)
    run = rw.simulate(walled, rw.KINEMATIC)
    told = " ".join((run.reason, *run.notes))
    assert run.outcome.name in ("jammed", "not_converged") and "bodies.block.coordinates.s.drive" in told
