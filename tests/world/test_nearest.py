"""States that are handed over begin at the nearest place that a run accepts, which it tells."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.world.find import world_of

SCENES = (
    "two_finger", "gripper", "push", "pivot", "peg_in_hole", "planar_hand", "four_finger", "arm_push",
    "blocks", "stack", "three_fingers", "hand_turn", "arm_turn", "peg", "door", "floor_push", "two_link",
)  # fmt: skip
"""Grasps, pushes, hands and arms, in the plane and in space."""
MODELS = [model for model in rw.LADDER if model.loads]


@cache
def states_of(name: str, model: rw.Rung) -> tuple[rw.State, ...]:
    return tuple(rw.simulate(name, model, duration=0.5, tol=1e-3, frames=20).states)


def measured(name: str, model: rw.Rung, number: int) -> tuple[rw.State, float]:
    """A state of a run as it is measured, with errors between 1e-12 and 1e-2 of the size, and that part."""
    rng, moved = np.random.default_rng(number), world_of(rw.load(name)).at().moved
    states = states_of(name, model)
    state, error = states[int(rng.integers(len(states)))], 10.0 ** rng.uniform(-12.0, -2.0)
    units = np.where(
        moved.weights > 0.0, moved.size / np.where(moved.weights > 0.0, moved.weights, 1.0), moved.size
    )
    q = state.q + error * units * rng.uniform(-1.0, 1.0, len(state.q))
    return rw.State(state.names, q, state.v, state.time), error


@pytest.mark.few(5)
@pytest.mark.parametrize("number", range(12))
@pytest.mark.parametrize("model", MODELS, ids=str)
@pytest.mark.parametrize("name", SCENES)
def test_no_measured_state_is_lost(name: str, model: rw.Rung, number: int) -> None:
    """A run begins there, and says how far that is; no farther than errors and their leverage
    explain, where contacts do not yield."""
    state, error = measured(name, model, number)
    run = rw.simulate(name, model, state=state, duration=state.time + 1e-3)
    assert run.outcome != rw.Outcome.INVALID, (error, run.reason)
    told = [note for note in run.notes if note.startswith("state: was moved")]
    parts = [float(re.search(r"([\d.e+-]+) of the size", note)[1]) for note in told]  # type: ignore[index]
    assert model.compliant or max(parts, default=0.0) <= 50.0 * error + 1e-3


def test_a_state_that_a_run_accepts_is_not_touched() -> None:
    run = rw.simulate("gripper", "dynamic-rigid", duration=0.5)
    state = rw.State(run.state.names, run.state.q, run.state.v, 0.5)
    simulation = rw.Simulation("gripper", "dynamic-rigid", state=state)
    assert (simulation.state.q == state.q).all() and not simulation.result().notes


def moved_in(run: rw.Run | rw.SpaceRun) -> list[str]:
    return [note for note in run.notes if note.startswith("state: was moved by at most")]


@pytest.mark.parametrize(
    ("name", "q"), [("stack", {"box1.z": 0.296}), ("two_finger", {"finger1.x1": 1.53})], ids=str
)
def test_a_little_overlap_is_opened_and_told(name: str, q: dict[str, float]) -> None:
    """By runs, rollouts and environments alike."""
    state = rw.State.of(name, q)
    run = rw.simulate(name, "dynamic-rigid", state=state, duration=1e-2)
    assert run.outcome != rw.Outcome.INVALID and len(moved_in(run)) == 1
    found = rw.rollout(name, "dynamic-rigid", state, durations=1e-2)
    assert rw.Outcome.INVALID.code != found.outcome[0]


@pytest.mark.parametrize(("deep", "begins"), [(0.005, True), (0.19, False)])
def test_a_stack_that_sank_as_a_whole_is_moved_as_far_as_it_sank(deep: float, begins: bool) -> None:
    """Up to a stated part of the size; nearly a box is more."""
    start = rw.State.of("stack")
    sunk = {name: start[name] - deep for name in start.names if name.endswith(".z")}
    run = rw.simulate("stack", "dynamic-rigid", state=rw.State.of("stack", sunk), duration=1e-2)
    assert (run.outcome != rw.Outcome.INVALID) == begins, run.reason
    assert "of the size" in (moved_in(run)[0] if begins else run.reason)


SLIDER = """
<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1" pos="0 0 {top}"/>
<body name="cart" pos="0 0 .1"><joint name="x" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="1"/></body></worldbody></mujoco>
"""


def test_what_cannot_be_moved_apart_is_refused_in_one_line(tmp_path: Path) -> None:
    """No joint lifts the cart off the floor that is within it."""
    (tmp_path / "cart.xml").write_text(SLIDER.format(top=0.0))
    scene = rw.load({"name": "cart", "model": {"file": str(tmp_path / "cart.xml")}, "duration": 0.1})
    (tmp_path / "high.xml").write_text(SLIDER.format(top=0.01))
    high = rw.load({"name": "cart", "model": {"file": str(tmp_path / "high.xml")}, "duration": 0.1})
    run = rw.simulate(high, "dynamic-rigid", state=rw.State.of(scene))
    assert run.outcome == rw.Outcome.INVALID
    assert "no place at which a run begins was found within 0.05 of the size" in run.reason


JOINED = """
name: joined
bodies:
  heavy: {role: object, mass: 100, shape: {kind: disc, radius: 0.1}, motion: {kind: free}, pose: {x: 0, y: 0}}
  light: {role: object, mass: 1, shape: {kind: disc, radius: 0.1}, motion: {kind: free}, pose: {x: 1, y: 0}}
joints:
  hinge: {kind: hinge, between: [heavy, light], at: [0.5, 0]}
duration: 0.1
step: 0.001
"""


def test_measured_speeds_are_joined_by_inertia() -> None:
    """However little the joint is open: momentum along the line through both stays as it is."""
    scene = rw.load(yaml.safe_load(JOINED))
    for open_by in (0.0, 1e-5):
        state = rw.State.of(scene, {"light.x": 1.0 + open_by}, {"light.x": 1.0})
        run = rw.simulate(scene, "dynamic-rigid", state=state, duration=0.01)
        assert bool(moved_in(run)) == bool(open_by)
        momentum = 100.0 * run.state.v[0] + run.state.v[3]
        assert momentum == pytest.approx(1.0, abs=1e-3)


def test_a_schedule_goes_on_from_a_state_that_is_moved() -> None:
    """The fingers come down on a part that is a little larger at the other parameters."""
    data = rw.load("two_finger").file.model_dump(mode="json", exclude_unset=True)
    data["parameters"]["grown"] = {"default": 0.0, "range": [0.0, 0.1]}
    data["bodies"]["finger1"]["shape"] = {"kind": "disc", "radius": "0.01 + grown"}
    scene = rw.load(data)
    segments = [rw.Segment({}, 1.4), rw.Segment({}, 0.6)]
    state = rw.simulate(scene, "dynamic-rigid", inputs=segments, duration=1.49).state
    run = rw.simulate(scene, "dynamic-rigid", state=state, parameters={"grown": 0.01})
    assert run.outcome != rw.Outcome.INVALID, run.reason
    assert len(run.inputs) == 2 and len(moved_in(run)) == 1


def placed(width: float) -> np.ndarray:
    """How far two boxes of a width are moved that overlap a little, in widths and radians."""
    body = {"role": "object", "mass": 1.0, "motion": {"kind": "free"}}
    body["shape"] = {"kind": "box", "width": width, "height": width}
    places = {"a": {"x": 0, "y": 0}, "b": {"x": 1.1 * width, "y": 0.3 * width}}
    scene = rw.load(
        {
            "name": "two", "duration": 1.0, "step": 1e-3,
            "bodies": {name: body | {"pose": pose} for name, pose in places.items()},
            "contacts": [{"between": ["a", "b"], "friction": 0.5, "stiffness": 1e6, "damping": 1e3}],
        }
    )  # fmt: skip
    state = rw.State.of(scene, {"b.x": 0.98 * width, "b.angle": 0.02})
    found = rw.Simulation(scene, "dynamic-rigid", state=state).state
    return (found.q - state.q) / np.array([width, width, 1.0] * 2)


def test_the_nearest_place_does_not_depend_on_the_unit_of_length() -> None:
    whole = placed(1.0)
    assert np.abs(whole).max() > 1e-3
    for width in (1e-2, 1e2):
        assert placed(width) == pytest.approx(whole, rel=1e-6, abs=1e-9)


def test_what_is_far_off_is_refused_in_one_line_that_says_how_far() -> None:
    state = rw.State.of("two_finger", {"finger1.x1": 1.8})
    run = rw.simulate("two_finger", "dynamic-rigid", state=state)
    assert run.outcome == rw.Outcome.INVALID
    assert re.fullmatch(
        r"bodies\.finger1: overlaps part by [\d.]+ at the start; the nearest one that was found at which a"
        r" run begins has a body [\d.]+ away, [\d.]+ of the size of the largest object, more than 0\.05",
        run.reason,
    )
    with pytest.raises(rw.StateError, match=r"is outside its travel, 0 to 2; the nearest one .* away"):
        rw.simulate("two_finger", "dynamic-rigid", state=rw.State.of("two_finger", {"finger1.x1": 2.9}))
