"""Runs that a loop takes step by step: what is seen, what is told, and that it is the run of its schedule."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.any_run import AnyRun, by_body

from .conftest import MOVING
from .test_stacks import box, on_ground

LOADED = [rung for rung in MOVING if rung.loads]
TOLD = {
    "two_finger": {"v1": (0.5, 1.5), "v2": (0.3, 1.0)},
    "push": {"ux": (0.5, 1.0), "uy": (-0.2, 0.2)},
    "grasp": {},
    "three_finger_lift": {"squeeze": (0.0, 0.02), "rise": (0.0, 0.1)},
    "arm_push": {},
}
"""Scenes, and between what their inputs are drawn; by little about their values where nothing is said."""


def wanted(scene: rw.Scene | rw.SpaceScene, rng: np.random.Generator) -> dict[str, float]:
    """Some inputs of a scene, drawn."""
    own, drawn = TOLD[scene.name], {}
    for name in scene.template.inputs:
        default = scene.file.parameters[name].default
        low, high = own.get(name, (default - 1e-3, default + 1e-3))
        drawn[name] = float(rng.uniform(low, high))
    return {name: value for name, value in drawn.items() if rng.random() < 0.8}


def led(name: str, model: rw.Rung, rng: np.random.Generator, periods: int = 8, **options: Any) -> AnyRun:
    """A run whose inputs are drawn anew for each period, held or ramped."""
    scene = rw.load(name)
    simulation = rw.Simulation(scene, model, **options)
    period = simulation.end / 40.0
    for k in range(periods):
        simulation.step(period * rng.uniform(0.5, 1.5), wanted(scene, rng), ramp=k % 3 == 2)
    run: AnyRun = simulation.result()
    return run


def alike(one: AnyRun, other: AnyRun) -> bool:
    """Whether two runs are one another's beginning, bit for bit, but for the very start, at which one was not
    told anything yet."""
    a, b = one.trajectory, other.trajectory
    times = np.intersect1d(a.time, b.time)[1:]
    assert len(times) > 3
    places, rates = (
        np.array_equal(a[name].sel(time=times), b[name].sel(time=times)) for name in ("position", "velocity")
    )
    return places and rates


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("name", TOLD)
def test_a_run_that_is_led_is_the_run_of_what_it_was_told(
    name: str, rung: rw.Rung, tol: float | None, tmp_path: Path
) -> None:
    run = led(name, rung, np.random.default_rng(3), tol=tol)
    assert sum(each.duration for each in run.inputs) >= run.time * (1 - 1e-12)
    end = float(rw.Simulation(name, rung).end)
    again = rw.simulate(rw.load(name), rung, inputs=run.inputs, duration=end, tol=tol)
    assert alike(run, again)
    loaded = rw.load_run(run.save(tmp_path / "run"))
    assert loaded.inputs == run.inputs and np.array_equal(loaded.state.q, run.state.q)


@pytest.mark.parametrize("name", ["two_finger", "three_finger_lift"])
def test_a_controller_leads_the_run_as_a_loop_does(name: str) -> None:
    seen: list[rw.Observation] = []

    def control(now: rw.Observation) -> dict[str, float]:
        seen.append(now)
        return {first: now.inputs[first] + 1e-3}

    first = rw.load(name).template.inputs[0]
    run = rw.simulate(name, rw.DYNAMIC_RIGID, control=control, rate=25.0, duration=0.4)
    assert [each.time for each in seen] == pytest.approx(np.arange(10) / 25.0)
    assert len(run.inputs) == 10 and run.time == pytest.approx(0.4)
    values = [each.inputs[first] for each in seen]
    assert np.diff(values) == pytest.approx(np.full(9, 1e-3))
    assert run.final == by_body(seen[0].names, run.state.q)


def test_what_nobody_tells_stays_and_is_on_record() -> None:
    """Turns between two periods are segments without inputs, and a period that a limit cuts lasts as long as
    it did."""
    for name in ("push", "three_finger_lift"):
        simulation = rw.Simulation(name, rw.QUASISTATIC_RIGID)
        simulation.advance()
        first = simulation.time
        assert first > 0.0
        if simulation.running:
            simulation.step(0.01 * simulation.end, limit=0)
            between = simulation.time
            simulation.step(0.01 * simulation.end)
            told = simulation.inputs
            assert told[0].duration == first and not told[0].inputs
            assert told[1].duration == between - first
            assert sum(each.duration for each in told) == pytest.approx(simulation.time)


def test_a_run_goes_on_from_a_state_of_one_that_was_led() -> None:
    for name in ("two_finger", "three_finger_lift"):
        run = led(name, rw.DYNAMIC_COMPLIANT, np.random.default_rng(5))
        whole = rw.simulate(name, run.model, inputs=run.inputs, duration=2.0 * run.time)
        rest = rw.simulate(name, run.model, state=run.states[len(run.states) // 2], duration=2.0 * run.time)
        assert alike(whole, rest)
        simulation = rw.Simulation(name, run.model, state=run.state, inputs=[], duration=2.0 * run.time)
        assert simulation.step(0.1 * run.time).time == pytest.approx(1.1 * run.time)
        with pytest.raises(rw.ScheduleError, match=r"^inputs: the run follows the schedule"):
            rw.Simulation(name, run.model, state=run.state, duration=2.0 * run.time).step(0.1)


def resting(name: str, rung: rw.Rung) -> rw.Observation:
    """Boxes at rest on each other, seen after a few steps."""
    scene: Any = name
    if name == "plane":
        scene = on_ground([box(0.0, 0.5), box(0.0, 1.5), box(0.2, 2.5, 0.4)], duration=1.0)
    simulation = rw.Simulation(scene, rung)
    return simulation.step(0.3 if rung.compliant and rung.inertia > 0 else 0.02)


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", LOADED, ids=lambda rung: rung.name)
@pytest.mark.parametrize("name", ["plane", "stack"])
def test_contact_forces_carry_what_rests(name: str, rung: rw.Rung) -> None:
    seen = resting(name, rung)
    contacts = seen.contacts
    weight = 9.81 if name == "plane" else None
    up = -1 if name == "stack" else 1
    moving = {each.partition(".")[0] for each in seen.names}
    total = dict.fromkeys(seen.bodies, 0.0)
    for k, (one, other) in enumerate(contacts.bodies):
        assert contacts.modes[k] == "stick" and contacts.pushes[k] >= 0.0
        assert contacts.pushes[k] == pytest.approx(contacts.forces[k] @ contacts.normals[k])
        assert np.linalg.norm(contacts.normals[k]) == pytest.approx(1.0)
        total[other] += contacts.forces[k][up]
        total[one] -= contacts.forces[k][up]
        ends = [seen[f"{body}.{'y' if up == 1 else 'z'}"] for body in (one, other) if body in moving]
        if len(ends) == 2:  # the normal leads into the second body, and touches are between the middles
            assert np.sign(ends[1] - ends[0]) == np.sign(contacts.normals[k][up])
            assert min(ends) < contacts.points[k][up] < max(ends)
    carried = [total[body] for body in seen.bodies if body in moving]
    assert carried == pytest.approx(np.full(len(carried), weight or carried[0]), rel=1e-3)
    assert carried[0] > 0.0
    ground = next(body for body in seen.bodies if body not in moving)
    assert seen.force(ground) == pytest.approx(sum(carried), rel=1e-3)
    lowest = min(moving, key=lambda body: seen[f"{body}.{'y' if up == 1 else 'z'}"])
    assert seen.force(ground, lowest) == seen.force(lowest, ground) == seen.force(ground)


def test_the_kinematic_rung_knows_where_bodies_touch_and_no_forces() -> None:
    for name in ("plane", "stack"):
        contacts = resting(name, rw.KINEMATIC).contacts
        assert len(contacts) and np.isnan(contacts.forces).all() and np.isnan(contacts.pushes).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["two_finger", "three_finger_lift"])
def test_wrong_input_is_named_in_one_line(name: str) -> None:
    first, second = rw.load(name).template.inputs
    simulation = rw.Simulation(name, "quasistatic-rigid")
    wrong: list[tuple[Any, str]] = [
        ({"nobody": 1.0}, r"^inputs: unknown input 'nobody'"),
        ({first: np.nan}, rf"^inputs\.{first}: "),
        ({first: 1e300}, rf"^inputs\.{first}: .* is outside"),
        ({first: "fast"}, rf"^inputs\.{first}: "),
        (np.zeros(3), rf"^inputs: must be a mapping .* or an array of shape \(2,\) for {first}"),
        (np.zeros((2, 1)), r"not of shape \(2, 1\)"),
        ("fast", r"^inputs: must be a mapping"),
        (3.0, r"^inputs: must be a mapping"),
    ]  # fmt: skip
    for inputs, words in wrong:
        with pytest.raises(rw.ScheduleError, match=words) as caught:
            simulation.step(0.1, inputs)
        assert "\n" not in str(caught.value)
        with pytest.raises(rw.ScheduleError, match=words):
            rw.simulate(name, "quasistatic-rigid", control=lambda _: inputs, rate=10.0)  # noqa: B023
    for duration in (0.0, -1.0, np.nan, "long"):
        with pytest.raises(rw.ModelError, match=r"^duration: must be a finite number greater than 0"):
            simulation.step(duration)  # type: ignore[arg-type]
    assert simulation.time == 0.0 and simulation.inputs == ()
    for options, words in (
        ({"control": 3, "rate": 1.0}, r"^control: must be a function"),
        ({"control": len}, r"^rate: is required with control"),
        ({"rate": 1.0}, r"^rate: says how often control is asked"),
        ({"control": len, "rate": 0.0}, r"^rate: must be a finite number"),
        (
            {"control": len, "rate": 1.0, "inputs": [{"duration": 1.0}]},
            r"^inputs: the run follows a schedule",
        ),
    ):
        with pytest.raises(rw.ModelError, match=words):
            rw.simulate(name, "quasistatic-rigid", **options)  # type: ignore[call-overload]
    seen = simulation.observe()
    for ask in (lambda: seen["nobody.x"], lambda: seen.speed(second), lambda: seen.force("nobody")):
        with pytest.raises(rw.ObservationError, match=r"^observation: unknown .*; valid: "):
            ask()


def test_a_run_that_cannot_begin_is_not_seen() -> None:
    scene = on_ground([box(0.0, 0.2)])
    simulation = rw.Simulation(scene, "dynamic-rigid")
    assert not simulation.running and simulation.outcome == "invalid"
    with pytest.raises(ValueError, match="the run did not begin: bodies"):
        simulation.step(0.1)
