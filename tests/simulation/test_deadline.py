"""A limit in seconds holds within a step, within a proof and within a solver; what was found before is kept.

Nothing here waits for a clock, but for the steps of one run, each of which takes several times as long.
"""

from __future__ import annotations

import itertools
import os
import signal
import threading
import time
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
import scipy.optimize

import rungwise as rw
from rungwise import deadline
from rungwise.cli.terminal import heard_at_once
from rungwise.contact.certify import certify_infeasible
from rungwise.deadline import Deadline, TimeOver
from rungwise.simulation.run import Simulation

from .conftest import MOVING
from .test_stacks import G, box

SHORT = 0.1
"""Seconds: a part of what a long step takes."""
WALL = {"role": "obstacle", "shape": {"kind": "box", "width": 1.0, "height": 40.0}}


def jam(columns: int, rows: int, mu: float, pull: float = 0.5) -> rw.Scene:
    """Boxes that touch each other, two walls and the ground on all sides."""
    bodies: dict[str, Any] = {
        f"b{i}x{j}": box(float(i), 0.5 + j) for i in range(columns) for j in range(rows)
    }
    for name, x in (("left", -1.0), ("right", float(columns))):
        bodies[name] = WALL | {"pose": {"x": x, "y": 0.0}}
    bodies["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    law = {"friction": mu, "stiffness": 1e6, "damping": 1e4}
    contacts = [{"between": ["b*", other], **law} for other in ("b*", "left", "right", "ground")]
    scene = {"name": "jam", "gravity": [pull, -G], "bodies": bodies, "contacts": contacts}
    return rw.load(scene | {"duration": 0.1, "step": 1e-3})


JAMS = {f"{n} x {m}": jam(n, m, mu) for n, m, mu in ((1, 2, 1.0), (2, 2, 0.3), (2, 3, 2.0))}


def taken(run: Simulation) -> int:
    """Steps so far."""
    assert run.workspace is not None
    return int(run.workspace.state.clock[0]["steps"])


@pytest.mark.few(2)
@pytest.mark.parametrize("members", JAMS)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_halted_step_is_not_taken_and_the_run_goes_on_as_if_it_had_not_been(
    model: rw.Rung, members: str
) -> None:
    halted, other = (Simulation(JAMS[members], model) for _ in range(2))
    halted.advance(2)
    assert taken(halted) == 2 and halted.workspace is not None
    halted.workspace.scratch.halt[0] = 1
    assert halted.advance(5) and taken(halted) == 2
    halted.workspace.scratch.halt[0] = 0
    halted.advance(3)
    other.advance(5)
    assert halted.state.q.tobytes() == other.state.q.tobytes()
    assert halted.state.v.tobytes() == other.state.v.tobytes()


@pytest.mark.parametrize("scene", ["two_finger", "push", "three_finger_lift"])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_run_without_time_is_returned_as_it_begins(model: rw.Rung, scene: str) -> None:
    run = rw.simulate(scene, model, limit=0)
    assert run.outcome == "running" and run.steps == 0
    assert run.reason == "limit: 0 s are over, within a step at t = 0"
    assert len(run.trajectory.time) == 1


@pytest.fixture(scope="module")
def long_step() -> Simulation:
    """A run whose steps take some tenths of a second each, with its kernels loaded and no step taken."""
    Simulation(JAMS["2 x 2"], rw.QUASISTATIC_COMPLIANT).advance(1)
    return Simulation(jam(16, 16, 1.0), rw.QUASISTATIC_COMPLIANT)


@pytest.mark.long
def test_a_long_step_ends_with_its_limit(long_step: Simulation) -> None:
    long_step.deadline = Deadline(SHORT)
    with pytest.raises(TimeOver, match="within a step"):
        long_step.advance(1)
    assert taken(long_step) == 0 and long_step.outcome == rw.Code.RUNNING


@pytest.mark.few(2)
@pytest.mark.parametrize("within", [1, 2, 3])
@pytest.mark.parametrize("limit", [None, 1e9])
def test_all_that_runs_can_be_ended_with_a_limit_or_without(limit: float | None, within: int) -> None:
    whole, cells = Deadline(limit), np.zeros((3, 1), np.int64)
    with ExitStack() as open_:
        for cell in cells[:within]:
            open_.enter_context(whole.running(cell))
        deadline.end_all()
        assert whole.halt[0] == 1 and cells[:, 0].tolist() == [1] * within + [0] * (3 - within)
    deadline.end_all()
    assert whole.halt[0] == 0 and not cells.any()


@pytest.mark.long
def test_ctrl_c_is_heard_within_a_long_step(long_step: Simulation) -> None:
    """The step is not taken, and the run goes on as if nothing had been."""
    long_step.deadline = Deadline()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    alarm = threading.Timer(SHORT, os.kill, (os.getpid(), signal.SIGINT))
    try:
        with heard_at_once(), pytest.raises(KeyboardInterrupt):
            alarm.start()
            long_step.advance(1)
            alarm.join()
            time.sleep(SHORT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert taken(long_step) == 0
    long_step.advance(1)
    assert taken(long_step) == 1


@pytest.fixture
def ticking(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that goes on by a second whenever it is read."""
    clock = itertools.count()
    monkeypatch.setattr(deadline.time, "monotonic", lambda: float(next(clock)))


@pytest.mark.usefixtures("ticking")
@pytest.mark.parametrize("limit", [2, 3, 6])
def test_no_linear_program_of_a_proof_begins_when_the_time_is_over(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At each program the clock is read, once for what is left and once after it."""
    programs = itertools.count()
    run = Simulation(JAMS["2 x 3"], rw.QUASISTATIC_RIGID)
    run.advance(1)
    assert run.workspace is not None
    problem = run.workspace.problem
    solve = scipy.optimize.linprog
    monkeypatch.setattr(
        scipy.optimize, "linprog", lambda *given, **named: (next(programs), solve(*given, **named))[1]
    )
    with pytest.raises(TimeOver, match="in the search for a proof"):
        certify_infeasible(problem, Deadline(limit))
    assert next(programs) <= limit


def test_what_ends_the_search_for_a_proof_leaves_the_run_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """The step without solution is there again when the run goes on."""
    run = Simulation("blocks", "quasistatic-rigid", parameters={"slope": 0.4, "mu": 0.1})

    def over(*_: object) -> None:
        raise TimeOver("in the search for a proof")

    whole = rw.simulate("blocks", "quasistatic-rigid", parameters={"slope": 0.4, "mu": 0.1})
    assert whole.outcome == "unsupported"
    with monkeypatch.context() as patch:
        patch.setattr("rungwise.contact.certify.certify_or_balance", over)
        with pytest.raises(TimeOver):
            while run.advance():
                pass
    assert run.outcome == rw.Code.RUNNING and not run.advance()
    assert run.outcome == rw.Code.UNSUPPORTED and run.result().time == whole.time


def test_threads_that_are_halted_take_steps_again() -> None:
    class Enough(Exception):
        pass

    def enough(_done: int) -> None:
        raise Enough

    batch = rw.Batch("two_finger", "dynamic-compliant", ["v2"], threads=2)
    points = np.linspace(0.5, 1.0, 40)[:, None]
    with pytest.raises(Enough):
        batch.run(points, chunk=1, on_progress=enough)
    found = batch.run(points)
    assert (found.outcome != rw.Code.RUNNING).all()


@pytest.mark.parametrize("limit", [-1.0, np.nan, "1", True])
def test_a_limit_is_a_number_of_seconds(limit: Any) -> None:
    for call in (
        lambda: rw.simulate("two_finger", "kinematic", limit=limit),
        lambda: rw.solve(LCP, limit=limit),
    ):
        with pytest.raises(rw.InputError, match="limit: must be a number of seconds"):
            call()


LCP = rw.Problem.lcp(np.eye(2), -np.ones(2))


def test_a_problem_without_time_is_judged_as_far_as_it_has_come() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(300, 300))
    found = rw.solve(rw.Problem.local(A + A.T, rng.normal(size=300), np.full(100, 0.5)), limit=0)
    assert found.status == "not_converged" and found.unfinished
    assert found.reason.startswith("the time is over, before any solver came within tolerance")
    assert np.isfinite(found.x).all() and found.residuals.worst > found.tol
    assert rw.solve(LCP, limit=0).status == "solved"
