"""Rates of success that are asked for, guarded moves, and what samples fail for."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.stats import beta

import rungwise as rw
from rungwise.planning.execution.guards import guarded
from rungwise.planning.execution.robust import made_robust
from rungwise.planning.execution.verify import bound_below
from rungwise.planning.motion.budget import Budget
from rungwise.scene.scene import LIBRARY
from rungwise.world.planar.world import PlanarWorld

STRAIGHT = {"offset": 0.0, "goal_x": 0.06, "goal_y": 0.0, "goal_angle": 0.0, "near": 0.01, "aligned": 0.1}
"""A push through the middle of the box: whatever the friction, the box ends where the rod ends."""


def push(uncertain: dict[str, object]) -> rw.Scene:
    file: dict[str, Any] = yaml.safe_load((LIBRARY / "push.yaml").read_text("utf-8"))
    file["task"]["uncertain"] = uncertain
    return rw.load(file)


def planned(uncertain: dict[str, object], **options: Any) -> rw.Plan:
    found = rw.plan(push(uncertain), to="quasistatic-rigid", parameters=STRAIGHT | {"apart": 0.02}, **options)
    assert found.segments
    return found


def silent(line: str) -> None:
    pass


@pytest.fixture(scope="module")
def plan() -> rw.Plan:
    return planned({"x": {"uniform": [-0.01, 0.01]}, "mu": {"uniform": ["0.7 * mu", "1.3 * mu"]}}, seed=5)


def test_guarded_moves_end_at_the_touch(plan: rw.Plan) -> None:
    """A move with a guard is parted where the rod touches the box; as planned, the motion is the
    same but for the error that the plan allows."""
    found = guarded(plan)
    assert found is not None and found.mode == "guarded moves"
    guards = [segment for segment in found.segments if segment.until]
    assert guards and all(segment.until == "gap(rod, box) <= tolerance" for segment in guards)
    blind, seen = plan.replay(), found.replay()
    assert str(blind.outcome) == str(seen.outcome) == "goal"
    for name in ("x", "y", "angle"):
        assert seen.final["box"][name] == pytest.approx(blind.final["box"][name], abs=plan.tol)


def test_a_guard_takes_the_error_of_the_place_into_account(plan: rw.Plan) -> None:
    """A box that stands further away is pushed as far, and not less far, after the touch."""
    found = guarded(plan)
    assert found is not None

    def pushed(which: rw.Plan, x: float) -> float:
        at = which.parameters | {"x": x, "near": 0.0}
        run = rw.simulate(
            which.scene, "quasistatic-rigid", inputs=which.segments, tol=which.tol, parameters=at
        )
        return run.final["box"]["x"] - x

    assert pushed(found, 0.004) == pytest.approx(pushed(found, 0.0), abs=3e-4)
    assert pushed(plan, 0.004) < pushed(plan, 0.0) - 0.003


def test_guards_are_kept_by_files(plan: rw.Plan, tmp_path: Path) -> None:
    found = guarded(plan)
    assert found is not None
    again = rw.load_plan(found.save(tmp_path / "plan.json"))
    assert again.segments == found.segments and again.mode == "guarded moves"
    assert "gap(rod, box) <= tolerance" in again.timetable()
    assert rw.verify(again, samples=5).mode == "guarded moves"
    with pytest.raises(rw.TaskError, match="mode: the plan has guarded moves"):
        rw.verify(again, samples=5, mode="open loop")


def test_causes_name_what_varies(plan: rw.Plan) -> None:
    """Only the place of the box makes the plan fail: with it as planned, all failures would succeed."""
    far = replace(plan, scene=push({"y": {"uniform": [-0.03, 0.03]}, "mass": {"uniform": [0.9, 1.1]}}))
    found = rw.verify(far, samples=60)
    failures = sum(found.failures.values())
    assert failures > 5
    assert found.causes["y"] == found.explained == min(failures, 50)
    assert (
        found.causes["mass"] == 0 == found.causes["only two together"] == found.causes["only more together"]
    )
    assert f"of {failures} failures, would succeed with a value as planned: y {failures}" in str(found)


def test_a_plan_that_fails_by_itself_is_said(plan: rw.Plan) -> None:
    short = replace(plan, segments=plan.segments[:1], labels=plan.labels[:1])
    found = rw.verify(short, samples=7)
    assert found.successes == 0 and found.causes == {"the plan fails without errors, too": 7}


def test_the_mode_that_measures_least_is_taken() -> None:
    easy = planned({"mass": {"uniform": [0.9, 1.1]}}, robust=0.9, samples=40)
    assert easy.found and easy.mode == "open loop" and [check.mode for check in easy.checks] == ["open loop"]
    assert easy.checks[0].lower == pytest.approx(0.05 ** (1 / 40))
    assert "open loop: 40 of 40 samples succeed" in str(easy)
    assert json.loads(easy.text())["mode"] == "open loop"


@pytest.mark.long
def test_re_planning_where_blind_execution_does_not_do(tmp_path: Path) -> None:
    hard = planned(
        {"y": {"uniform": [-0.02, 0.02]}, "angle": {"uniform": [-0.2, 0.2]}}, robust=0.8, samples=25
    )
    assert hard.found and hard.mode == "re-planning"
    assert [check.mode for check in hard.checks] == ["open loop", "guarded moves", "re-planning"]
    assert hard.checks[0].lower < 0.8 <= hard.checks[-1].lower
    again = rw.load_plan(hard.save(tmp_path / "plan.json"))
    assert again.mode == "re-planning" and again.checks == hard.checks


@pytest.mark.long
def test_a_rate_out_of_reach_is_no_plan(plan: rw.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Posts that may stand in the way of the box: nothing helps, and samples end early."""
    monkeypatch.setattr(PlanarWorld, "replanning_steps", 10_000)
    blocked = replace(
        plan, scene=push({"post1_x": {"uniform": [0.0, 0.2]}, "post1_y": {"uniform": [-0.1, 0.1]}})
    )
    found = made_robust(blocked, 0.95, 60, None, silent, Budget())
    assert not found.found and found.reason.startswith("robust: no mode of execution")
    assert found.checks[-1].samples < 60
    assert found.segments == plan.segments


@pytest.mark.parametrize(
    ("robust", "message"),
    [(0.0, "robust: must be between 0 and 1, not 0"), (1.5, "not 1.5"), (float("nan"), "robust: ")],
)
def test_a_rate_that_cannot_be_is_refused(robust: float, message: str) -> None:
    with pytest.raises(rw.TaskError, match=message):
        rw.plan("push", robust=robust)


def test_too_few_samples_are_refused() -> None:
    with pytest.raises(rw.TaskError, match=r"samples: 28 cannot prove a rate of 0\.9; it takes at least 29"):
        rw.plan("push", robust=0.9, samples=28)


def test_bound_of_all_and_none() -> None:
    assert bound_below(0, 50) == 0.0
    assert bound_below(188, 200) == pytest.approx(float(beta.ppf(0.05, 188, 13)))
    assert bound_below(188, 200) >= 0.9 > bound_below(187, 200)


@pytest.fixture
def scheduler() -> Iterator[str]:
    distributed = pytest.importorskip("distributed", reason="needs the extra cluster (dask.distributed)")
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        host="127.0.0.1",
        protocol="tcp",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.parametrize("mode", ["open loop", pytest.param("re-planning", marks=pytest.mark.long)])
def test_workers_of_a_cluster_give_the_same_samples(plan: rw.Plan, scheduler: str, mode: str) -> None:
    options: dict[str, Any] = {"samples": 12, "mode": mode, "seed": 3}
    one, two = rw.verify(plan, **options), rw.verify(plan, cluster=scheduler, **options)
    assert one.summary() == two.summary()


def test_no_scheduler_is_one_line(plan: rw.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    from rungwise import cluster

    monkeypatch.setattr(cluster, "CONNECT_S", 0.3)
    with pytest.raises(rw.TaskError, match="cluster: no scheduler answers"):
        rw.verify(plan, samples=2, cluster="tcp://127.0.0.1:9")


def test_points_are_drawn_as_the_task_says(plan: rw.Plan) -> None:
    from rungwise.models.ladder import QUASISTATIC_RIGID
    from rungwise.planning.execution.trials import Trials

    trials = Trials(plan, QUASISTATIC_RIGID, plan.tol, "open loop", 0)
    points = trials.draw(500)
    assert trials.names == ["x", "mu"] and (points[:, 0] == np.arange(500)).all()
    assert np.abs(points[:, 1]).max() <= 0.01 and points[:, 1].std() == pytest.approx(0.01 / 3**0.5, rel=0.1)
    assert trials.nominal.tolist() == [0.0, 0.25]
