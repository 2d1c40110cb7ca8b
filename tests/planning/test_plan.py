"""Plans are found, held on the rung asked for, saved, replayed to the bit; nothing found is said, too."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.budget import Budget
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.plan import Stage
from rungwise.planning.search import problem as planning
from rungwise.planning.task.reserve import tightened
from rungwise.planning.task.task import task_of
from rungwise.world.planar import runs as planar_runs

PUSH = rw.load("push")


@pytest.fixture(scope="module")
def found() -> rw.Plan:
    return rw.plan(PUSH, task_seed=4, schedule="quasistatic")


@pytest.mark.long
def test_plan_holds_on_the_rung_asked_for_at_a_tenth_of_its_accuracy(found: rw.Plan) -> None:
    assert found.found, str(found)
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    run = found.replay(tol=found.tol / 10)
    assert str(run.outcome) == "goal"
    box, p = run.final["box"], found.parameters
    assert np.hypot(box["x"] - p["goal_x"], box["y"] - p["goal_y"]) <= p["near"]
    assert abs(box["angle"] - p["goal_angle"]) <= p["aligned"]


@pytest.mark.long
def test_transits_touch_nothing(found: rw.Plan) -> None:
    """Between a draw-back and the next push the rod keeps its distance from box and posts."""
    run = found.replay(tol=found.tol)
    data = run.trajectory
    ends = np.cumsum([segment.duration for segment in found.segments])
    begins = ends - [segment.duration for segment in found.segments]
    rod = [k for k, name in enumerate(data.contact.values) if str(name).startswith("rod|")]
    first = found.labels.index("push")
    for begin, end, label in list(zip(begins, ends, found.labels, strict=True))[first:]:
        if label == "transit":
            within = (data.time.values > begin + 1e-9) & (data.time.values < end - 1e-9)
            assert (data.gap.values[within][:, rod] > 0.0).all()


@pytest.mark.long
def test_every_stage_is_recorded_with_its_steps(found: rw.Plan) -> None:
    assert [record.stage for record in found.records] == [
        "quasistatic-rigid @ 0.001", "dynamic-compliant @ 0.001",
    ]  # fmt: skip
    assert all(record.steps > 0 for record in found.records)
    assert found.records[0].how == "planned"


def test_same_seed_same_plan_whatever_the_threads(found: rw.Plan) -> None:
    again = rw.plan(PUSH, task_seed=4, schedule="quasistatic", threads=1)
    assert again.segments == found.segments
    other = rw.plan(PUSH, task_seed=4, schedule="quasistatic", seed=1)
    assert other.found and other.segments != found.segments


def test_saved_plan_replays_to_the_bit_in_another_process(found: rw.Plan, tmp_path: Path) -> None:
    file = found.save(tmp_path / "plan.json")
    loaded = rw.load_plan(file)
    assert loaded.segments == found.segments and loaded.parameters == found.parameters
    assert str(loaded) == str(found)
    code = (
        "import sys, rungwise as rw; run = rw.load_plan(sys.argv[1]).replay();"
        "print(run.outcome, run.state.q.tobytes().hex())"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=True
    )
    assert printed.stdout.split() == ["goal", found.replay().state.q.tobytes().hex()]


def test_timetable_has_the_inputs_over_time(found: rw.Plan) -> None:
    rows = list(csv.DictReader(StringIO(found.timetable())))
    assert len(rows) == 2 * len(found.segments)
    assert float(rows[-1]["time"]) == pytest.approx(found.duration)
    assert [row["label"] for row in rows[::2]] == list(found.labels)
    assert [float(row["ux"]) for row in rows[1::2]] == [segment.inputs["ux"] for segment in found.segments]


def test_plan_that_is_given_is_lifted(found: rw.Plan) -> None:
    lifted = rw.plan(PUSH, parameters=found.parameters, to="dynamic-rigid", schedule="direct", initial=found)
    assert lifted.found and lifted.records[0].how in ("held", "repaired move by move", "repaired at its end")


def test_the_work_of_moves_adds_up_to_the_work_of_the_whole() -> None:
    """A run that goes on from the memory of another counts its own work alone."""
    work = planning.begin(task_of(PUSH), Budget(), 1, 2)
    run = Predictor(PUSH, Stage(rw.DYNAMIC_COMPLIANT, 1e-3), 1e-4, {}, Budget(), 2).run
    levels, durations = np.array([[[0.05, 0.0], [0.05, 0.02]]]), np.array([[0.4, 0.4]])
    whole = run(work.start, levels, durations)
    first = run(work.start, levels[:, :1], durations[:, :1])
    second = run(first.places, levels[:, 1:], durations[:, 1:])
    assert first.work[0] > 0.0
    assert first.work + second.work == pytest.approx(whole.work, rel=1e-4)  # steps differ


def test_moves_that_take_too_many_steps_are_told_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planar_runs, "LONGEST", 1)
    work, budget = planning.begin(task_of(PUSH), Budget(), 1, 2), Budget()
    run = Predictor(PUSH, Stage(rw.DYNAMIC_COMPLIANT, 1e-3), 1e-4, {}, budget, 2).run
    run(work.start, np.array([[[0.05, 0.0]]]), np.array([[0.4]]))
    assert dict(budget.outcomes) == {"too many steps": 1}


@pytest.mark.long
def test_plans_are_improved_by_the_cost_of_the_task() -> None:
    found = rw.plan(PUSH, task_seed=1000)
    better = rw.plan(PUSH, task_seed=1000, improve=60_000)
    assert found.cost == pytest.approx(found.duration)
    assert better.found and better.cost < found.cost
    assert str(better.replay(tol=better.tol / 10).outcome) == "goal"
    assert [record.steps for record in better.records[:-1]] == [record.steps for record in found.records]
    assert "improved" in better.records[-1].how


@pytest.mark.long
def test_the_time_limit_holds_inside_a_search() -> None:
    began = time.perf_counter()
    none = rw.plan(PUSH, task_seed=4, parameters={"near": 1e-7}, limit=1.0)
    assert not none.found and "the time is over" in none.reason
    assert time.perf_counter() - began < 10.0


def test_nothing_found_says_what_is_known() -> None:
    none = rw.plan(PUSH, task_seed=4, schedule="direct", budget=400)
    assert not none.found
    assert "the budget is spent" in none.reason and "misses the goal by" in none.reason
    with pytest.raises(ValueError, match="plan: there is none"):
        none.replay()
    assert json.dumps(none.summary())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"schedule": "zzz"}, "schedule: unknown 'zzz'; valid: coarse-fine, climb, quasistatic, direct"),
        ({"schedule": ["zzz"]}, "model: unknown 'zzz'; valid: "),
        ({"schedule": [("kinematic", -1.0)]}, "schedule: a stage must be a rung, or a rung and an accuracy"),
        ({"schedule": []}, "schedule: needs at least one stage"),
        ({"from_": "dynamic-compliant", "to": "kinematic"}, "from: dynamic-compliant is above kinematic"),
        ({"parameters": {"zzz": 1.0}}, "parameters: unknown 'zzz'"),
        ({"parameters": {"post1_x": 0.0, "post1_y": 0.0}}, "start: box and post1 overlap by "),
    ],
)
def test_wrong_input_is_one_line(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        rw.plan(PUSH, **options)  # type: ignore[arg-type]
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


def test_scene_without_a_task_is_refused() -> None:
    with pytest.raises(rw.TaskError, match="task: the scene has none"):
        rw.plan("pivot")


@pytest.mark.parametrize("text", ["", "{}", "[1]", "not json", '{"format": "rungwise plan 1"}'])
def test_file_that_holds_no_plan_is_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text(text)
    with pytest.raises(rw.PlanError, match="holds no saved plan"):
        rw.load_plan(file)


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("box.x <= 1", "box.x <= 1 - 0.2 * abs(1)"),
        ("box.x >= 1", "box.x >= 1 + 0.2 * abs(1)"),
        ("not box.x < 1", "not box.x < 1 + 0.2 * abs(1)"),
        ("-1 <= box.x <= 1", "-1 + 0.2 * abs(-1) <= box.x and box.x <= 1 - 0.2 * abs(1)"),
        ("box.x <= rod.x and mu < 1", "box.x <= rod.x and mu < 1"),
    ],
)
def test_goals_are_tightened(condition: str, holds: str) -> None:
    assert tightened(condition, 0.2) == holds


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("scene", "changes", "to", "first"),
    [
        ("push", {}, "dynamic-compliant", "quasistatic-rigid @ 0.001"),
        ("push", {"v": 0.3}, "dynamic-compliant", "dynamic-compliant @ 0.01"),
        ("push", {}, "kinematic", "kinematic @ 0.01"),
        ("two_finger", {}, "dynamic-rigid", "dynamic-rigid @ 0.01"),
    ],
)
def test_slow_pushes_begin_on_the_quasistatic_rung(
    scene: str, changes: dict[str, float], to: str, first: str
) -> None:
    """An object that coasts by less than a hundredth of its size, v^2 / (2 mu g), is pushed slowly."""
    plan = rw.plan(scene, parameters=changes, task_seed=4, to=to, budget=2000)
    assert plan.records[0].stage == first
