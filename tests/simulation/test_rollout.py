"""Rollouts: samples of segments from states, equal to runs one by one."""

from __future__ import annotations

import signal
import threading
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from tests.simulation.conftest import MOVING

M, K = 60, 3
UNTIL = [None, "gap(finger1, part) <= 0.2", None]
RAMP = [False, True, False]


def draws(seed: int = 0) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Inputs (m, s, u) and durations (m, s)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.2, 1.5, (M, K, 2)), rng.uniform(0.1, 0.8, (M, K))


@pytest.mark.few(2)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_sample_is_the_run_that_simulate_makes_of_it(model: rw.Rung, tol: float | None) -> None:
    scene, (inputs, durations) = rw.load("two_finger"), draws()
    mu = np.random.default_rng(1).uniform(0.1, 1.0, M)
    found = rw.rollout(
        scene, model, inputs=inputs, durations=durations, until=UNTIL, ramp=RAMP,
        parameters={"mu": mu, "mass": 2.0}, tol=tol, step=2e-3 if tol is None else None,
    )  # fmt: skip
    assert len(set(found.outcome)) >= 3
    for i in range(0, M, 4):
        run = found.run(i)
        assert run.outcome.code == found.outcome[i] and run.time == found.time[i]
        assert run.steps == found.steps[i] and found.reason(i) == run.reason
        assert np.array_equal(run.state.q, found.final[i]) and np.array_equal(run.state.v, found.speed[i])
        last = min(int(found.switches[i]), K - 1)
        assert np.array_equal(found.q[i, last], found.final[i]) and found.times[i, last] == run.time
        assert np.isnan(found.times[i, last + 1 :]).all()


def test_the_bytes_do_not_depend_on_threads_or_chunks() -> None:
    scene, (inputs, durations) = rw.load("two_finger"), draws()
    one, other = (
        rw.rollout(scene, "dynamic-rigid", inputs=inputs, durations=durations, until=UNTIL, **options)
        for options in ({"threads": 1}, {"threads": 3, "chunk": 7})
    )
    for name in ("outcome", "margin", "time", "steps", "attempts", "switches", "final", "memory"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_segments_one_after_the_other_are_segments_from_states(model: rw.Rung) -> None:
    scene, (inputs, durations) = rw.load("two_finger"), draws()
    options = {"step": 2e-3, "tol": None}
    whole = rw.rollout(scene, model, inputs=inputs, durations=durations, **options)
    first = rw.rollout(scene, model, inputs=inputs[:, :1], durations=durations[:, :1], **options)
    go = np.flatnonzero(first.switches == 1)
    states = [first.state(i) for i in go]
    rest = rw.rollout(scene, model, states, inputs[go, 1:], durations[go, 1:], **options)
    assert len(go) > M // 2
    assert np.array_equal(rest.final, whole.final[go]) and np.array_equal(rest.outcome, whole.outcome[go])
    assert np.array_equal(rest.times, whole.times[go, 1:], equal_nan=True)
    assert np.array_equal(rest.forces, whole.forces[go, 1:], equal_nan=True)


def test_states_of_one_rung_go_on_on_another_and_at_other_parameters() -> None:
    scene = rw.load("two_finger")
    for low in MOVING:
        state = rw.simulate(scene, low, duration=1.2).state
        for high in MOVING:
            found = rw.rollout(
                scene, high, state, {"v1": [[0.5], [1.0], [1.5]]}, 0.3, parameters={"mu": [0.4, 0.5, 0.6]}
            )
            for i in range(3):
                run = found.run(i)
                assert run.outcome.code == found.outcome[i] and np.array_equal(run.state.q, found.final[i])


def test_places_and_velocities_as_arrays() -> None:
    scene = rw.load("two_finger")
    rng = np.random.default_rng(2)
    places = np.column_stack([rng.uniform(0.0, 1.0, (9, 2)), rng.uniform(-0.2, 0.2, 9)])
    moving = np.hstack([places, rng.normal(size=(9, 3))])
    for states in (places, moving):
        found = rw.rollout(scene, "dynamic-rigid", states, durations=0.2)
        for i in range(9):
            run = found.run(i)
            assert np.array_equal(run.state.q, found.final[i])
            v = dict(zip(scene.template.coordinates, states[i, 3:], strict=False))
            q = dict(zip(scene.template.coordinates, states[i, :3], strict=True))
            alone = rw.simulate(
                scene, "dynamic-rigid", state=rw.State.of(scene, q, v), inputs=[{"duration": 0.2}], tol=1e-3,
            )  # fmt: skip
            assert np.array_equal(alone.state.q, found.final[i])


def test_one_samples_fault_is_named_and_the_others_go_on() -> None:
    scene = rw.load("two_finger")
    inputs, durations = draws()
    good = rw.rollout(scene, "kinematic", inputs=inputs, durations=durations)
    inputs[3, 1, 0], inputs[4, 0, 1], durations[5, 2] = np.nan, -1.0, -0.1
    mu = np.full(M, 0.5)
    mu[6], mu[7] = np.nan, 1e9
    places = np.tile(rw.State.of(scene).q, (M, 1))
    places[8, 2], places[9, 0], places[10] = np.nan, 99.0, (1.9, 1.9, 0.0)
    found = rw.rollout(scene, "kinematic", places, inputs, durations, parameters={"mu": mu})
    assert found.faults == {
        3: "sample 3: inputs.v1: must be finite, and is not in segment 1",
        4: "sample 4: inputs.v2: -1 is outside 1e-06 to 1e+06, in segment 0",
        5: "sample 5: durations.2: must be finite and >= 0, not -0.1",
        6: "sample 6: parameters.mu: must be finite, not nan",
        7: "sample 7: parameters.mu: 1e+09 is outside 0 to 100",
        8: "sample 8: states.q.part.x3: must be finite and within -1e+75..1e+75, not nan",
    }
    wrong = np.isin(np.arange(M), range(3, 11))
    assert (found.outcome[wrong] == rw.Code.INVALID).all()
    assert np.array_equal(found.outcome[~wrong], good.outcome[~wrong])
    assert np.array_equal(found.final[~wrong], good.final[~wrong])
    assert found.reason(9).startswith("state.q.finger1.x1: 99 is outside its travel, 0 to 2; the nearest")
    assert found.reason(10).startswith("bodies.finger1: overlaps part by")


def test_a_condition_that_never_holds_is_named_for_its_sample() -> None:
    found = rw.rollout(
        rw.load("two_finger"), "kinematic", inputs={"v1": [[0.1], [1.0]]}, durations=1.0,
        until=["finger1.x1 >= 0.5"],
    )  # fmt: skip
    assert [rw.Code(code).name for code in found.outcome] == ["TIMEOUT", "MISSED"]
    assert found.reason(0).startswith("inputs.0.until: finger1.x1 >= 0.5 did not hold within 1")


def test_arguments_of_one_sample_serve_all() -> None:
    """Every choice of the arguments that have one row against the same arguments written out m times."""
    m, rng = 4, np.random.default_rng(3)
    full = {
        "states": np.hstack([rng.uniform(-0.1, 0.1, (m, 3)) * (0.0, 0.0, 1.0), np.zeros((m, 3))]),
        "inputs": rng.uniform(0.5, 1.0, (m, 2, 2)),
        "durations": rng.uniform(0.2, 0.5, (m, 2)),
        "parameters": {"mu": rng.uniform(0.0, 0.5, m)},
    }

    def pick(name: str, rows: slice) -> Any:
        value = full[name]
        return {"mu": value["mu"][rows]} if isinstance(value, dict) else value[rows]

    for chosen in range(1, 16):
        single = {name for k, name in enumerate(full) if chosen >> k & 1}
        given = {name: pick(name, slice(1) if name in single else slice(None)) for name in full}
        rows = 1 if len(single) == len(full) else m
        written = {
            name: {"mu": np.repeat(value["mu"], rows if name in single else 1)}
            if isinstance(value, dict)
            else np.repeat(value, rows if name in single else 1, axis=0)
            for name, value in given.items()
        }
        found, expected = (rw.rollout("two_finger", "quasistatic-rigid", **each) for each in (given, written))
        assert np.array_equal(found.final, expected.final, equal_nan=True)
        assert np.array_equal(found.outcome, expected.outcome)
        assert len(found.final) == rows


WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"inputs": [[1.0, 1.0]]}, rw.ScheduleError, "durations: are required with inputs"),
    ({"inputs": np.ones((4, 2, 2)), "durations": [1.0]}, rw.ScheduleError, "inputs: must have the shape"),
    (
        {"inputs": np.ones((4, 1, 2)), "durations": np.ones((5, 1))},
        rw.ScheduleError,
        "inputs: has 4 samples, and durations has 5: must be 1 or 5",
    ),
    ({"inputs": {"w": 1.0}, "durations": 1.0}, rw.ScheduleError, "inputs: unknown input 'w'; valid: v1"),
    ({"inputs": "x", "durations": 1.0}, rw.ScheduleError, "inputs: must be numbers in an array, not 'x'"),
    ({"durations": [1.0, 1.0], "until": ["t > 0"]}, rw.ScheduleError, "until: must be a list of 2"),
    ({"durations": [1.0], "until": ["zzz > 0"]}, rw.ScheduleError, "until.0: unknown name zzz"),
    ({"durations": [1.0], "ramp": [True, True]}, rw.ScheduleError, "ramp: must be true or false, or 1"),
    ({"states": np.zeros((4, 5))}, rw.StateError, "states: must have the shape (m, 3) or (m, 6)"),
    ({"states": 5}, rw.StateError, "states: must be states, or an array of places, not 5"),
    ({"parameters": {"zzz": 1.0}}, rw.SceneError, "parameters: unknown parameter 'zzz'"),
    ({"durations": [1.0], "ramp": "n"}, rw.ScheduleError, "ramp: must be true or false, or 1"),
    ({"chunk": 0}, rw.ModelError, "chunk: must be a whole number"),
    ({"threads": 0}, rw.ModelError, "threads: 0 must be at least 1"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "error", "message"), WRONG, ids=[w[2] for w in WRONG])
def test_wrong_shapes_and_names(options: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error) as raised:
        rw.rollout(rw.load("two_finger"), "kinematic", **options)
    assert str(raised.value).startswith(message) and "\n" not in str(raised.value)


@pytest.mark.long
def test_progress_and_interruption() -> None:
    scene, seen = rw.load("two_finger"), list[int]()
    rw.rollout(scene, "kinematic", inputs=draws()[0], durations=draws()[1], chunk=20, on_progress=seen.append)
    assert seen[-1] == M and seen == sorted(seen)

    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rw.rollout(
            scene, "kinematic", inputs=draws()[0], durations=draws()[1], chunk=1, on_progress=interrupt
        )
    # A shell that starts the tests in the background has them ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, signal.raise_signal, (signal.SIGINT,))
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            rw.rollout(scene, "dynamic-compliant", inputs=np.ones((20_000, 1, 2)), durations=1.0, tol=None)
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)


def test_no_samples_and_schedules_of_no_length() -> None:
    scene = rw.load("push")
    none = rw.rollout(scene, "kinematic", inputs=np.zeros((0, 3, 2)), durations=np.zeros((0, 3)))
    assert len(none.outcome) == len(none.final) == 0 and none.q.shape == (0, 3, 6)
    assert len(rw.rollout(scene, "kinematic", np.zeros((0, 6))).outcome) == 0
    assert len(rw.rollout(scene, "kinematic", parameters={"mu": np.zeros(0)}).outcome) == 0
    for state in (None, rw.simulate(scene, "kinematic", duration=3.0, tol=1e-3).state):
        found = rw.rollout(scene, "kinematic", state, np.ones((3, 1, 2)), [[0.0], [1.0], [0.5]])
        began = 0.0 if state is None else state.time
        assert [rw.Code(code).name for code in found.outcome] == ["MISSED"] * 3
        assert np.array_equal(found.time, [began, began + 1.0, began + 0.5])
        assert found.run(0).outcome.name == "missed"


def test_segments_that_end_at_once_are_kept_where_they_end() -> None:
    scene = rw.load("push")
    found = rw.rollout(scene, "kinematic", inputs=[[[1.0, 0.2], [1.0, 0.3]]], durations=[[0.0, 1.0]])
    assert found.times.tolist() == [[0.0, 1.0]] and found.q[0, 0, 0] == rw.State.of(scene)["rod.x"]
    state = rw.simulate(scene, "kinematic", duration=3.0, tol=1e-3).state
    held = rw.rollout(scene, "kinematic", state, {"ux": 1.0}, 2.0, until=["rod.x > -10"])
    assert held.time[0] == state.time and np.array_equal(held.final[0], state.q)
    run = held.run(0)
    assert run.time == state.time and run.outcome.name == "missed"


def test_a_number_is_the_duration_of_all_segments() -> None:
    inputs = draws()[0]
    one, other = (
        rw.rollout("two_finger", "kinematic", inputs=inputs, durations=durations)
        for durations in (0.3, [0.3, 0.3, 0.3])
    )
    assert one.memory.tobytes() == other.memory.tobytes()


def test_a_run_that_takes_more_steps_than_allowed_has_not_converged() -> None:
    for budget, outcome in ((3, "not_converged"), (None, "goal")):
        found = rw.Batch("two_finger", "kinematic", ("v2",), budget=budget).run(np.array([[1.0]]))
        assert list(found.outcomes) == [outcome]
    with pytest.raises(ValueError, match="budget: must be"):
        rw.Batch("two_finger", "kinematic", ("v2",), budget=0)
