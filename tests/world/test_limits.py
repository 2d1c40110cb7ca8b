"""Many runs keep a limit in seconds, in the plane and in space, in one thread or process and in several: what
goes on then is left where it has come to, and what was done is kept.

Runs here would take minutes, at steps far too short; how far they come does not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import Deadline, end_all
from rungwise.simulation.run import Simulation
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.world.run import simulation_of
from tests.simulation.conftest import MOVING

SCENES: dict[str, Callable[[Any, int], object]] = {
    "two_finger": Simulation.advance,
    "slope": SpaceSimulation.steps_taken,
}
"""Scenes, and how so many steps are taken of one."""
SHORT = 1e-9
"""A step of which a second takes minutes."""


def taken(scene: str, model: rw.Rung, steps: int) -> rw.State:
    """The state after so many short steps."""
    run = simulation_of(scene, model, step=SHORT)
    SCENES[scene](run, steps)
    state: rw.State = run.state
    return state


class Hand:
    """A limit that is over when `looks` were made, or so many runs are done; told as progress."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, looks: int = 0, done: int = 0) -> None:
        self._looks, self._done, self._made = looks, done, list[Deadline]()
        monkeypatch.setattr("rungwise.world.rollout.Deadline", self._deadline)
        monkeypatch.setattr("rungwise.world.batch.Deadline", self._deadline)

    def _deadline(self, limit: float | None) -> Deadline:
        self._made.append(Deadline(limit))
        return self._made[-1]

    def __call__(self, done: int) -> None:
        self._looks -= 1
        if self._looks < 0 and done >= self._done:
            self._made[-1].ends = 0.0
            end_all()


@pytest.mark.few(1)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("scene", SCENES)
def test_a_run_that_the_limit_ends_is_left_where_it_has_come_to(
    scene: str, model: rw.Rung, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {"step": SHORT, "tol": None, "threads": 1}
    rw.rollout(scene, model, durations=SHORT, **options)  # loads what is compiled
    found = rw.rollout(scene, model, limit=1e9, on_progress=Hand(monkeypatch, looks=2), **options)
    assert found.outcomes.tolist() == ["running"] and "the time was over" in found.reason(0)
    state, same = found.state(0), taken(scene, model, int(found.steps[0]))
    assert state.time == same.time == found.time[0]
    assert state.q.tobytes() == same.q.tobytes() == found.final[0].tobytes()
    assert state.v.tobytes() == same.v.tobytes() == found.speed[0].tobytes()


@pytest.mark.parametrize("scene", SCENES)
def test_runs_that_were_done_are_kept_and_others_have_not_begun(
    scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first runs end at once, and the others take minutes each."""
    durations = np.where(np.arange(12) < 8, 4.0 * SHORT, 1.0)[:, None]
    options: dict[str, Any] = {"step": SHORT, "tol": None, "threads": 1, "chunk": 1}
    whole = rw.rollout(scene, "kinematic", durations=durations[:8], **options)
    hand = Hand(monkeypatch, done=8)
    found = rw.rollout(scene, "kinematic", durations=durations, limit=1e9, on_progress=hand, **options)
    assert (found.outcome[:8] == whole.outcome).all() and (whole.outcome != rw.Code.RUNNING).all()
    assert found.final[:8].tobytes() == whole.final.tobytes()
    assert (found.outcome[8:] == rw.Code.RUNNING).all()
    assert np.isnan(found.final[-1]).all() and np.isnan(found.margin[-1])
    with pytest.raises(ValueError, match="has no state"):
        found.state(11)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("scene", "over"), [("two_finger", "v2"), ("slope", "mu")])
def test_without_time_no_run_begins(scene: str, over: str, threads: int) -> None:
    batch = rw.Batch(scene, "dynamic-rigid", [over], step=SHORT, tol=None, threads=threads)
    for found in (
        rw.rollout(scene, "dynamic-rigid", parameters={over: np.full(8, 0.5)}, limit=0, threads=threads),
        batch.run(np.full((8, 1), 0.5), limit=0),
    ):
        assert (found.outcome == rw.Code.RUNNING).all() and not found.steps.any()
        assert np.isnan(found.final).all() and np.isnan(found.margin).all()


@pytest.mark.few(1)
@pytest.mark.parametrize(("scene", "over"), [("two_finger", "v2"), ("slope", "mu")])
def test_a_batch_keeps_its_limit(scene: str, over: str, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = rw.Batch(scene, "dynamic-rigid", [over], step=SHORT, tol=None, threads=1)
    found = batch.run(np.full((3, 1), 0.5), limit=1e9, on_progress=Hand(monkeypatch, looks=2))
    assert (found.outcome == rw.Code.RUNNING).all() and not found.steps[1:].any()


@pytest.mark.few(1)
@pytest.mark.parametrize("scene", SCENES)
def test_what_progress_raises_ends_a_run_between_its_steps(scene: str) -> None:
    class Enough(Exception):
        pass

    def enough(_done: int) -> None:
        raise Enough

    with pytest.raises(Enough):
        rw.rollout(scene, "kinematic", step=SHORT, tol=None, threads=1, on_progress=enough)
