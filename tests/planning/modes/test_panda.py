"""The Panda of example-robot-data pushes a T past a post."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.planner import ModePlanner
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

SCENE = Path(__file__).parents[3] / "examples" / "data" / "panda_tee.yaml"


@pytest.fixture(scope="module")
def panda() -> Any:
    try:
        return rw.load(SCENE)
    except rw.SceneError as error:
        if "example-robot-data" not in str(error):
            raise
        pytest.skip("the model of the arm needs example-robot-data: pip install example-robot-data")


def test_the_arm_rests_and_its_stick_is_led_by_seven_joints(panda: Any) -> None:
    run = rw.simulate(panda, "dynamic-compliant", duration=0.05)
    assert run.outcome == "timeout", run.reason
    planner = ModePlanner(begin(task_of(panda), Budget(None, None), 0, 1))
    (finger,) = planner.scene.fingers
    assert finger.is_redundant and len(finger.carrier.columns) == 7


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_tee_lies_on_the_table_at_its_goal_and_on_its_way_past_the_post(panda: Any, seed: int) -> None:
    work = begin(task_of(panda), Budget(None, None), seed, 1)
    planner = ModePlanner(work)
    tee = planner.scene.grounds["tee"]
    nearest = goals_of(work)[0][tee.places]
    assert nearest[2] == pytest.approx(0.02, abs=1e-3) and nearest[4:6] == pytest.approx([0, 0], abs=1e-2)
    assert planner.is_barred
    way = planner._course(tee)[:, tee.places]
    assert way[:, 2] == pytest.approx(np.full(len(way), 0.02), abs=1e-3)
    # The post stands at (0.5, 0), and the shortest half width of the T is 0.02.
    assert np.hypot(way[:, 0] - 0.5, way[:, 1]).min() > 0.02 + 0.025


@pytest.mark.long
def test_the_tee_is_pushed_to_its_pose_and_a_policy_corrects_where_it_begins(panda: Any) -> None:
    plan = rw.plan(panda, schedule="direct", seed=0)
    assert plan.found, plan.reason
    policy, start = plan.policy(), rw.State.of(panda)
    first = policy(replace(start, q=start.q + 0.005 * (np.array(start.names) == "tee.x")))
    assert set(first) == set(panda.template.inputs)
    assert policy.proposals[-1].found and policy.status != "lost", policy.reason
