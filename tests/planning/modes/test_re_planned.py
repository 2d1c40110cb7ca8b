"""Plans by contact modes, executed in worlds that are not quite as planned: legs are proposed anew."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.deadline import Deadline
from rungwise.kernel import Reals
from rungwise.planning.execution.feedback import Replanner
from rungwise.planning.execution.remaining_legs import run_pieces
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of
from rungwise.scene.scene import LIBRARY
from rungwise.world.nearest import apart
from rungwise.world.planar.surroundings import PlanarSurroundings

ERRORS = {"mu": 0.1, "mu_s": 0.15, "mass": 0.1, "inside": 0.15}
"""Errors of parameters, at most, as parts of their values."""


def uncertain(name: str) -> rw.Scene:
    """A shipped scene with these errors."""
    file = yaml.safe_load((LIBRARY / f"{name}.yaml").read_text("utf-8"))
    file["task"]["uncertain"] = {
        key: {"uniform": [f"{1.0 - part} * {key}", f"{1.0 + part} * {key}"]} for key, part in ERRORS.items()
    }
    return rw.load(file)


@cache
def planned(name: str) -> rw.Plan:
    found = rw.plan(uncertain(name), seed=1)
    assert found.found, found.reason
    return found


def drawn(plan: rw.Plan, number: int) -> dict[str, float]:
    """The parameters of a world."""
    rng = np.random.default_rng(number)
    errors = {key: part * rng.uniform(-1.0, 1.0) for key, part in ERRORS.items()}
    return plan.parameters | {key: (1.0 + error) * plan.parameters[key] for key, error in errors.items()}


@pytest.mark.few(1)
@pytest.mark.parametrize("number", range(8))
@pytest.mark.parametrize("name", ["card", "book"])
def test_legs_are_proposed_anew_where_the_object_leaves_the_way(name: str, number: int) -> None:
    """Worlds of other friction, mass and place come to the goal, and what was executed comes there again at a
    tenth of its error, as plans are confirmed, or finer where that run does not converge: its own error
    decides nothing where a run chatters."""
    plan = planned(name)
    assert plan.stage is not None
    world = drawn(plan, number)
    outcome, executed = Replanner(plan, plan.stage, plan.tol).execute(world, {}, number)
    assert outcome == rw.Code.GOAL
    for part in (0.1, 0.05, 0.03):
        again = rw.simulate(
            plan.scene, plan.stage.model, parameters=world, inputs=list(executed), tol=part * plan.tol
        )
        if again.outcome != rw.Outcome.NOT_CONVERGED:
            break
    assert again.outcome == rw.Outcome.GOAL


def test_a_plan_is_run_as_it_is_where_nothing_differs() -> None:
    """No leg is proposed anew: the schedule is the plan's, in pieces."""
    plan = planned("card")
    assert plan.stage is not None
    outcome, executed = Replanner(plan, plan.stage, plan.tol).execute(plan.parameters, {}, 0)
    assert outcome == rw.Code.GOAL
    assert sum(each.duration for each in executed) <= plan.duration * (1.0 + 1e-9)
    ends = {tuple(each.inputs.values()) for each in executed}
    gone = [tuple(each.inputs.values()) in ends for each in plan.segments]
    assert all(gone[:-3])


def test_re_planning_of_legs_ends_within_its_limit() -> None:
    plan, deadline = planned("card"), Deadline(2.5)
    found = rw.verify(plan, samples=1000, mode="re-planning", limit=0.5)
    assert not deadline.is_over and "before the time was over" in found.unfinished


def test_a_state_is_taken_over_with_its_inputs() -> None:
    """A ramp from there begins at the inputs that the world had, not at those of the scene."""
    task = task_of(rw.load("corner_pivot"))
    work = begin(task, Budget(), 0, 1)
    predictor = work.predictor(Stage(rw.DYNAMIC_COMPLIANT, 1e-3))
    lead = rw.Segment({"x1": -0.15, "y1": 0.08}, 1.0, ramp=True)
    _, _, now = run_pieces(predictor, work.start, [lead])
    taken = predictor.taken_over(now, task.scene, np.array([-0.15, 0.08]))
    _, _, after = run_pieces(predictor, taken, [rw.Segment(lead.inputs, 0.05, ramp=True)])
    assert after.q[0, :2] == pytest.approx([-0.15, 0.08], abs=1e-3)


@pytest.mark.parametrize("deep", [1e-6, 1e-4, 2e-3])
def test_bodies_that_overlap_are_moved_apart(deep: float) -> None:
    """By little more than they overlap; what touches nothing stays."""
    scene = rw.load("corner_pivot")
    around = PlanarSurroundings(scene, scene.parameters())
    q = rw.State.of(scene).q.copy()
    q[[3, 4]] += deep * np.array([1.0, -1.0])
    opened = apart(around, q)
    assert around.touches(opened, 0.0).least.min() >= 0.0
    assert np.linalg.norm(opened - q) <= 1.5 * 2.0**0.5 * deep and (opened[:3] == q[:3]).all()


class Levers:
    """Surroundings of two numbers that change two gaps of pairs; shared: how the first changes both."""

    def __init__(self, lean: float, shared: float = 1.0) -> None:
        self._rows = np.array([[1.0, 0.0], [shared, lean]])

    def touches(self, q: Reals, _within: float) -> Any:
        gaps = self._rows @ q
        rows = self._rows[:, None]
        return SimpleNamespace(gaps=gaps, rows=rows, pairs=np.array([0, 0]))

    def changed(self, q: Reals, change: Reals) -> Reals:
        return q + change


@pytest.mark.parametrize(("lean", "is_far"), [(1e-4, False), (0.1, True)])
def test_contacts_that_hardly_move_by_themselves_move_no_joint_far(lean: float, is_far: bool) -> None:
    """Both are closed where that takes little; else the joint that would tell them apart stays, nearly."""
    around: Any = Levers(lean)
    q = np.array([-1e-5, 1e-5 / lean])
    found = apart(around, q, 1e-3, np.array([0, 0]))
    assert around.touches(found, 0.0).gaps.min() > -1e-6
    assert (abs(found[1] - q[1]) > 0.9 * abs(q[1])) == is_far


@pytest.mark.parametrize(("lever", "opens"), [(3e-4, True), (1e-5, True), (1e-7, False)])
def test_contacts_near_the_axis_of_a_joint_are_opened_by_it(lever: float, opens: bool) -> None:
    """However much farther others move; but where all that moves a contact is rounding, nothing does."""
    around: Any = Levers(lever, shared=0.0)
    found = apart(around, np.array([1e-6, -1e-6 / lever * 0.01]))
    assert (around.touches(found, 0.0).gaps.min() >= 0.0) == opens
    assert abs(found[1]) < 1.0


@pytest.mark.parametrize("named", [1, 2])
def test_as_many_contacts_of_a_pair_are_closed_as_are_expected(named: int) -> None:
    """The nearest: a block that leans on an edge keeps leaning where one contact is expected."""
    scene = rw.load("corner_pivot")
    around = PlanarSurroundings(scene, scene.parameters())
    q = rw.State.of(scene).q.copy()
    q[[3, 4, 5]] += [-0.05, 0.002, 0.03]
    floor = next(k for k, pair in enumerate(scene.template.contacts) if set(pair) == {"block", "floor"})
    found = apart(around, q, 0.01, np.full(named, floor))
    gaps = np.sort(around.touches(found, 0.02).gaps[around.touches(found, 0.02).pairs == floor])
    assert np.abs(gaps[:named]).max() < 2e-5
    assert (abs(found[5] - q[5]) < 0.01) == (named == 1)


def test_contacts_are_closed_to_the_gaps_that_are_expected_of_them() -> None:
    """An edge that leans on a face keeps leaning: to press it flat, however little is open, turns a lot."""
    around: Any = Levers(0.1)
    q = np.array([-1e-5, 2e-3])  # gaps of -0.01 and 0.19 mm
    for expected, far in (np.array([2e-4, 0.0]), 2e-5), (None, 1e-3):
        found = apart(around, q, 1e-3, np.array([0, 0]), expected=expected)
        gaps = around.touches(found, 0.0).gaps
        assert gaps.min() > -1e-6 and gaps.max() < (2e-6 if expected is None else 2.1e-4)
        assert (abs(found[1] - q[1]) > far) == (expected is None)


def test_a_place_is_measured_where_the_scene_cannot_start_after_the_inputs() -> None:
    """The start that follows inputs is the plan's: fingers that were led on need not fit in there."""
    file = LIBRARY / "space" / "floor_push.yaml"
    fields = yaml.safe_load(file.read_text("utf-8"))
    fields["model"]["file"] = str(file.parent / fields["model"]["file"])
    fields["start"] = {"settle": True, "places": {"finger0.z0": "4 * z0"}}
    scene = rw.load(fields)
    inputs, start = scene.template.inputs, rw.State.of(scene)
    levels = np.array([-0.1 * (name == "z0") for name in inputs])
    with pytest.raises(rw.InputError, match=r"start\.settle: "):
        rw.State.of(scene, parameters=dict(zip(inputs, levels.tolist(), strict=True)))
    work = begin(task_of(scene, scene.parameters()), Budget(), 0, 1)
    predictor = work.predictor(Stage(rw.DYNAMIC_COMPLIANT, 1e-3))
    now = predictor.measured(start.q, start.v, levels)
    assert (now.q[0] == start.q).all()
    held = rw.Segment(dict(zip(inputs, levels.tolist(), strict=True)), 0.5, ramp=True)
    _, _, after = run_pieces(predictor, now, [held])
    assert after.q[0, list(scene.template.coordinates).index("finger0.z0")] == pytest.approx(-0.09, abs=0.01)


def test_bodies_stay_where_no_contact_tells_how_they_come_apart() -> None:
    def touches(_q: Reals, within: float) -> Any:
        gaps = np.full(int(within == 0.0), -1e-3)
        return SimpleNamespace(gaps=gaps, rows=np.ones((len(gaps), 1, 1)), pairs=np.zeros(len(gaps), int))

    around: Any = SimpleNamespace(touches=touches)
    assert apart(around, np.zeros(1)).tolist() == [0.0]
