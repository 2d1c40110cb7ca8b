"""States: a run goes on from one as if never interrupted; states made by hand are checked."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.planar.workspace import CLOCK, recorded
from rungwise.system.planar.manifold import ABSENT

from .conftest import MOVING
from .random_scenes import random_scene

OWN = {"steps", "attempts", "solves", "frames", "since", "stride", "outcome", "worst_residual"}
"""Fields of the clock that count from the beginning of each run."""


STEPS = 60


def recalled(run: rw.Run) -> dict[str, Any]:
    """All that the run handed on from step to step, frame by frame."""
    assert run.workspace is not None
    names = ["values", "start", "recent", "features", "points", "deformation", "modes", "force"]
    names += [name for name in CLOCK.names or () if name not in OWN]
    found = {name: recorded(run.workspace, name) for name in names}
    found["points"][found["features"] == ABSENT] = 0.0  # left over, and read by no step
    return found


def taken(scene: rw.Scene, model: rw.Rung, steps: int, **options: Any) -> rw.Run:
    """The first steps of a run, each of them a frame."""
    simulation = rw.Simulation(scene, model, stride=1, frames=STEPS + 2, **options)
    simulation._turn = steps
    simulation.advance()
    return simulation.result()


@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("tol", [None, 1e-3])
def test_a_run_that_goes_on_is_the_run_that_was_not_interrupted(model: rw.Rung, tol: float | None) -> None:
    """Bit for bit, at random cuts of random scenes: impacts, friction, joints, servos, supports."""
    rng, cuts, touching = np.random.default_rng(0), 0, 0
    for number in range(0, 200, 5):
        options: dict[str, Any] = {"tol": tol, "theta": float(rng.choice([0.5, 1.0]))}
        scene = rw.load(random_scene(number))
        whole = taken(scene, model, STEPS, **options)
        states = whole.states
        if len(states) < 2:
            continue
        expected = recalled(whole)
        for cut in rng.choice(len(states) - 1, min(len(states) - 1, 5), replace=False):
            again = taken(scene, model, len(states) - 1 - cut, state=states[cut], **options)
            assert again.outcome == whole.outcome
            for name, values in recalled(again).items():
                assert np.array_equal(values, expected[name][cut:], equal_nan=True), (number, cut, name)
            cuts += 1
            touching += bool(expected["modes"][cut].any())
    assert cuts > 100 and touching > 20


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_cut_at_any_time_differs_by_no_more_than_the_error(model: rw.Rung) -> None:
    options: dict[str, Any] = {"tol": 1e-4, "parameters": {"v1": 1.0, "v2": 0.7}}
    whole = rw.simulate("two_finger", model, **options)
    for cut in np.random.default_rng(1).uniform(0.1, 1.0, 5) * whole.time:
        first = rw.simulate("two_finger", model, duration=cut, **options)
        assert first.state.time == pytest.approx(cut)
        again = rw.simulate("two_finger", model, state=first.state, **options)
        assert again.outcome == whole.outcome and again.time == pytest.approx(whole.time, abs=2e-3)
        assert again.final["part"]["x3"] == pytest.approx(whole.final["part"]["x3"], abs=1e-2)


def test_a_state_is_lifted_to_every_other_rung_and_to_other_parameters() -> None:
    """The part is pushed, and goes on being pushed: deformations and forces are found again where they are
    not handed on."""
    for low in MOVING:
        state = rw.simulate("two_finger", low, duration=1.2).state
        for high in MOVING:
            for parameters in ({}, {"mu": 0.4}):
                run = rw.simulate("two_finger", high, state=state, parameters=parameters)
                assert str(run.outcome) in ("goal", "doomed", "jammed"), (low.name, high.name, run.reason)
                assert run.states[0].time == state.time and np.array_equal(run.states[0].q, state.q)


def test_saved_and_loaded(tmp_path: Path) -> None:
    half = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT.with_inertia(0.5), duration=1.2, theta=0.5)
    file = half.state.save(tmp_path / "half.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["half.npz"]
    ends = [
        rw.simulate("two_finger", half.model, state=state, theta=0.5).state
        for state in (half.state, rw.load_state(file))
    ]
    assert ends[0].memory is not None and ends[1].memory is not None
    assert np.array_equal(ends[0].memory.values, ends[1].memory.values, equal_nan=True)
    (tmp_path / "none.npz").write_bytes(b"text")
    with pytest.raises(rw.StateError, match=r"none\.npz' holds no state that was saved"):
        rw.load_state(tmp_path / "none.npz")
    with pytest.raises(FileNotFoundError):
        rw.load_state(tmp_path / "missing.npz")


def test_states_by_hand() -> None:
    scene = rw.load("two_finger")
    state = rw.State.of(scene, {"part.x3": 0.1}, time=0.5)
    run = rw.simulate(scene, rw.QUASISTATIC_RIGID, state=state)
    assert run.states[0].time == 0.5 and run.states[0]["part.x3"] == 0.1 == state["part.x3"]
    assert repr(state) == "State(time=0.5, finger1.x1=0, finger2.x2=0, part.x3=0.1)"
    assert repr(run.state).endswith(", of a quasistatic-rigid run)")


@pytest.mark.parametrize(
    "change, text",
    [
        ({"q": {"part.x4": 0.0}}, r"state\.q: unknown 'part\.x4'; valid: finger1\.x1, .*part\.x3"),
        ({"v": {"part.x3": "fast"}}, r"state\.v\.part\.x3: must be a number, not 'fast'"),
        ({"q": {"part.x3": np.nan}}, r"state\.q\.part\.x3: must be finite, not nan"),
        ({"time": np.inf}, r"state\.time: must be finite, not inf"),
    ],
)
def test_wrong_values(change: dict[str, Any], text: str) -> None:
    with pytest.raises(rw.StateError, match=text):
        rw.State.of(rw.load("two_finger"), **change)


def test_wrong_states() -> None:
    scene = rw.load("two_finger")
    over = rw.State.of(scene, {"finger1.x1": 1.9})
    run = rw.simulate(scene, rw.KINEMATIC, state=over)
    assert str(run.outcome) == "invalid" and "bodies.finger1: overlaps part by" in run.reason
    names = scene.template.coordinates
    for state, text in (
        (rw.State(names, np.zeros(2), np.zeros(3)), r"state\.q: must have the shape \(3,\), not \(2,\)"),
        (rw.State(("a.x",), np.zeros(1), np.zeros(1)), r"state: has the coordinates a\.x, and the scene "),
        (rw.State(names, np.full(3, np.nan), np.zeros(3)), r"state\.q\.finger1\.x1: must be finite, not nan"),
        (5, r"state: must be a State, not 5"),
    ):
        with pytest.raises(rw.StateError, match=text):
            rw.simulate(scene, rw.KINEMATIC, state=state)  # type: ignore[arg-type]
    with pytest.raises(rw.ModelError, match="time: the run ends at 1, and the state is of 2"):
        rw.simulate(scene, rw.KINEMATIC, state=rw.State.of(scene, time=2.0), duration=1.0)
    with pytest.raises(rw.StateError, match=r"state: unknown 'x'; valid: "):
        over["x"]


def test_an_open_joint_and_a_place_outside_travel_are_named() -> None:
    scene = rw.load("two_link")
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, state=rw.State.of(scene, {"lower.y": 0.4}))
    assert (
        str(run.outcome) == "invalid" and "joints.elbow: its across is off by 0.1 at the start" in run.reason
    )
    stopped = rw.load(
        {
            "name": "slider",
            "bodies": {
                "block": {
                    "role": "object", "mass": 1.0, "shape": {"kind": "disc", "radius": 0.1},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
                    "coordinates": {"s": {"upper": 1.0}},
                }
            },
        }
    )  # fmt: skip
    with pytest.raises(rw.StateError, match=r"state\.q\.block\.s: 2 is outside its travel, -inf to 1"):
        rw.simulate(stopped, rw.DYNAMIC_RIGID, state=rw.State.of(stopped, {"block.s": 2.0}))


def test_a_pickled_run_has_the_same_trajectory_and_states() -> None:
    run = rw.simulate("two_finger", rw.QUASISTATIC_COMPLIANT, duration=1.2)
    copy = pickle.loads(pickle.dumps(run))
    assert copy.trajectory.identical(run.trajectory)
    assert [state.q.tolist() for state in copy.states] == [state.q.tolist() for state in run.states]
