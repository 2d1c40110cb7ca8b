"""States that are handed over begin at the nearest place that a run accepts, which it tells."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest

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
    parts = [float(re.search(r"([\d.e-]+) of the size", note)[1]) for note in told]  # type: ignore[index]
    assert model.compliant or max(parts, default=0.0) <= 50.0 * error + 1e-3


def test_a_state_that_a_run_accepts_is_not_touched() -> None:
    run = rw.simulate("gripper", "dynamic-rigid", duration=0.5)
    state = rw.State(run.state.names, run.state.q, run.state.v, 0.5)
    simulation = rw.Simulation("gripper", "dynamic-rigid", state=state)
    assert (simulation.state.q == state.q).all() and not simulation.result().notes


@pytest.mark.parametrize(
    ("name", "q"), [("stack", {"box1.z": 0.296}), ("two_finger", {"finger1.x1": 1.53})], ids=str
)
def test_a_little_overlap_is_opened_and_told(name: str, q: dict[str, float]) -> None:
    state = rw.State.of(name, q)
    run = rw.simulate(name, "dynamic-rigid", state=state, duration=1e-2)
    assert run.outcome != rw.Outcome.INVALID, run.reason
    assert any(note.startswith("state: was moved; the nearest one without overlap") for note in run.notes)


def test_what_is_far_off_is_refused_in_one_line_that_says_how_far() -> None:
    state = rw.State.of("two_finger", {"finger1.x1": 1.8})
    run = rw.simulate("two_finger", "dynamic-rigid", state=state)
    assert run.outcome == rw.Outcome.INVALID
    assert re.fullmatch(
        r"bodies\.finger1: overlaps part by [\d.]+ at the start; the nearest one without overlap, with joints"
        r" closed, has a body [\d.]+ away, [\d.]+ of the size, more than 0\.05",
        run.reason,
    )
    with pytest.raises(rw.StateError, match=r"is outside its travel, 0 to 2; the nearest .* away"):
        rw.simulate("two_finger", "dynamic-rigid", state=rw.State.of("two_finger", {"finger1.x1": 2.9}))
