"""Batches give what single runs give, whatever the threads and chunks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import rungwise as rw
from rungwise.outcome import Code
from tests.simulation.test_hindered import tower
from tests.simulation.test_rest import Wedge

MOVING = [model for model in rw.LADDER if model.moves]
POINTS = np.random.default_rng(4).uniform((0.2, 0.2, 0.0, 0.8), (2.0, 2.0, 0.9, 1.3), (12, 4))
OVER = ("v1", "v2", "mu", "half_base")


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_batch_is_its_runs(model: rw.Rung) -> None:
    """Bit by bit what each point gives in a batch of its own: nothing is left over from the run before.

    And to rounding what `simulate` gives.
    """
    scene = rw.load("two_finger")
    found = rw.Batch(scene, model, OVER, threads=1).run(POINTS)
    for k, point in enumerate(POINTS):
        alone = rw.Batch(scene, model, OVER, threads=1).run(point[None])
        for name in found.__dataclass_fields__:
            assert getattr(alone, name)[0].tobytes() == getattr(found, name)[k].tobytes()
        parameters = dict(zip(OVER, map(float, point), strict=True))
        run = rw.simulate(scene, model, parameters=parameters, tol=1e-3)
        assert found.outcome[k] == run.outcome.code and found.steps[k] == run.steps
        assert found.time[k] == pytest.approx(run.time, rel=1e-9)
        assert found.final[k].tolist() == pytest.approx(places(run), rel=1e-9, abs=1e-9)


def places(run: rw.Run) -> list[float]:
    return [x for many in run.final.values() for x in many.values()]


@pytest.mark.few(1)
@pytest.mark.parametrize("scene", ["two_finger_servo", "four_finger", "two_link"])
def test_scenes_of_every_kind(scene: str) -> None:
    loaded = rw.load(scene)
    name = next(iter(loaded.file.parameters))
    points = loaded.file.parameters[name].default * np.array([[1.0], [0.9], [1.0]])
    found = rw.Batch(loaded, rw.DYNAMIC_RIGID, (name,), threads=1, duration=0.05).run(points)
    run = rw.simulate(loaded, rw.DYNAMIC_RIGID, tol=1e-3, duration=0.05)
    assert found.final[0].tobytes() == found.final[2].tobytes() != found.final[1].tobytes()
    assert found.final[0].tolist() == pytest.approx(places(run), rel=1e-9, abs=1e-9)
    assert found.outcome[0] == run.outcome.code


def test_threads_and_chunks_change_no_bit() -> None:
    scene, whole = rw.load("two_finger"), None
    points = np.random.default_rng(5).uniform(0.2, 2.0, (300, 2))
    for threads, chunk in itertools.product((1, 3), (1, 64, 1000)):
        found = rw.Batch(scene, rw.DYNAMIC_COMPLIANT, ("v1", "v2"), threads=threads).run(points, chunk=chunk)
        data = [getattr(found, name).tobytes() for name in found.__dataclass_fields__]
        assert whole is None or data == whole
        whole = data


def test_what_cannot_be_run_is_invalid_and_the_rest_goes_on() -> None:
    scene = rw.load("two_finger")
    points = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, np.nan], [1.0, 0.9]])
    found = rw.Batch(scene, rw.QUASISTATIC_RIGID, ("v1", "v2"), threads=1).run(points)
    assert found.outcome.tolist() == [Code.GOAL, Code.INVALID, Code.INVALID, Code.GOAL]
    assert np.isnan(found.margin).tolist() == [False, True, True, False]
    # A part that stands under the fingers from the start.
    low = rw.Batch(scene, rw.DYNAMIC_RIGID, ("height",), threads=1).run(np.array([[9.0], [1.0]]))
    assert low.outcome.tolist() == [Code.INVALID, Code.GOAL]


@pytest.mark.parametrize("model", [rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=str)
def test_margin_passes_zero_where_the_outcome_changes(model: rw.Rung) -> None:
    """At r = 1/2 the slack of the capture and the gap that is left at a miss both vanish."""
    ratios = 0.5 + np.array([-1e-2, -1e-3, -1e-4, 1e-3, 2e-3, 1e-2])
    margin = rw.Batch(rw.load("two_finger"), model, ("v2",), threads=1).run(ratios[:, None]).margin
    assert (np.diff(margin) > 0.0).all() and margin[2] < 0.0 < margin[3]
    assert np.abs(margin).max() < 0.05 and margin[4] - margin[3] == pytest.approx(2e-3, rel=0.7)


def test_ctrl_c_ends_a_batch_and_the_next_one_works() -> None:
    batch = rw.Batch(rw.load("two_finger"), rw.KINEMATIC, ("v2",), threads=2)
    points = np.linspace(0.2, 2.0, 3000)[:, None]

    def stop(_done: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.run(points, on_progress=stop)
    assert (batch.run(points).outcome != Code.RUNNING).all()


def test_wrong_input() -> None:
    scene = rw.load("two_finger")
    with pytest.raises(rw.SceneError, match="over: unknown parameter 'speed'"):
        rw.Batch(scene, rw.KINEMATIC, ("speed",))
    with pytest.raises(rw.SceneError, match="v1 is given twice"):
        rw.Batch(scene, rw.KINEMATIC, ("v1", "v1"))
    with pytest.raises(rw.ModelError, match="geometric"):
        rw.Batch(scene, "geometric", ("v1",))
    with pytest.raises(rw.ModelError, match="threads"):
        rw.Batch(scene, rw.KINEMATIC, ("v1",), threads=0)
    with pytest.raises(ValueError, match="points"):
        rw.Batch(scene, rw.KINEMATIC, ("v1",)).run(np.zeros((3, 2)))


@pytest.mark.parametrize("count", [6, pytest.param(37, marks=pytest.mark.long)])
def test_rollouts_say_of_what_nothing_balances_what_runs_say(count: int) -> None:
    """Also where a step has no solution, however short, and a run proves that nothing supports its loads."""
    said = set[str]()
    for seed, model in itertools.product(
        range(3, 3 + count), (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)
    ):
        wedge = Wedge(seed)
        scene, tol = wedge.scene(), 1e-3 * wedge.size if seed % 2 else None
        outcomes = rw.rollout(scene, model, tol=tol, threads=1).outcomes
        assert outcomes[0] == str(rw.simulate(scene, model, tol=tol, frames=3).outcome), (seed, model.name)
        said.add(str(outcomes[0]))
    assert {"timeout", "unsupported"} <= said


@pytest.mark.long
@pytest.mark.parametrize("top", [1e2, 1e6])
@pytest.mark.parametrize("softness", [30.0, 1000.0])
@pytest.mark.parametrize("number", range(4))
def test_batches_tell_that_contacts_are_crushed(number: int, softness: float, top: float) -> None:
    scene = tower(number, softness, top) | {"parameters": {"none": {"default": 0.0, "range": [-1.0, 1.0]}}}
    found = rw.Batch(scene, rw.QUASISTATIC_COMPLIANT, ["none"], threads=1).run(np.zeros((2, 1)))
    assert found.outcomes.tolist() == ["model_invalid"] * 2
