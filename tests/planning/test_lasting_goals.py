"""Plans to goals that must hold for a time: robots stand still until it is over."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.placements import jumps, placed_part
from tests.planning.members import push
from tests.planning.modes.test_modes import block_at_a_wall


def held_at_the_end(plan: rw.Plan, lasts: float, now: str) -> None:
    """The plan comes to its goal, also at a tenth of the error, and what must hold does so in all frames of
    that time."""
    assert plan.found, plan.reason
    assert plan.replay(tol=plan.tol / 10).ok
    run = plan.replay(tol=plan.tol)
    assert run.ok
    late = [state for state in run.states if state.time >= run.time - (1.0 - 1e-6) * lasts]
    assert late and rw.ask(plan.scene, now, late, plan.parameters).holds.all()
    assert run.time > lasts


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [0, 3])
def test_a_box_stays_where_it_was_pushed_to(seed: int) -> None:
    now = push(seed).file.goal
    assert now is not None
    scene = push(seed).changed(goal=f"({now}) and rest(box) for 1.5")
    plan = rw.plan(scene, to=rw.QUASISTATIC_RIGID, task_seed=seed, budget=600_000, threads=1)
    held_at_the_end(plan, 1.5, now)
    assert plan.labels[-1] == "wait"


def led(goal: str) -> rw.Scene:
    """A robot that cannot stand still pushes a part along."""
    drive = {"kind": "speed", "speed": "u"}
    robot = {"role": "robot", "shape": {"kind": "disc", "radius": 0.1}}
    robot |= {"motion": {"kind": "slide", "axis": [1, 0]}, "coordinates": {"s": {"drive": drive}}}
    part = robot | {"role": "object", "mass": 1.0, "pose": {"x": 0.4}, "coordinates": {"s": {"damping": 1.0}}}
    return rw.load(
        {
            "name": "led", "parameters": {"u": {"default": 0.0}}, "inputs": ["u"],
            "duration": 1.0, "step": 1e-2, "goal": goal,
            "bodies": {"robot": robot, "part": part}, "contacts": [{"between": ["robot", "part"]}],
            "task": {"inputs": {"u": {"range": [0.1, 1.0]}}, "moves": [1, 2], "duration": [0.3, 1.0]},
        }
    )  # fmt: skip


def test_a_goal_without_robots_that_are_led() -> None:
    plan = rw.plan(led("part.s >= 0.3 for 0.8"), to=rw.KINEMATIC, budget=100_000, threads=1)
    held_at_the_end(plan, 0.8, "part.s >= 0.3")


def test_where_a_goal_is_only_crossed_the_reason_says_so() -> None:
    plan = rw.plan(led("abs(part.s - 0.3) <= 0.1 for 5"), to=rw.KINEMATIC, budget=20_000, threads=1)
    assert not plan.found and "misses the goal by 0" not in plan.reason
    assert "plans reached the goal, but did not hold it for 5" in plan.reason


def test_a_block_that_is_tipped_is_held() -> None:
    """A block that falls over crosses the goal, and is not held there."""
    now = block_at_a_wall().file.goal
    assert now is not None
    scene = block_at_a_wall().changed(goal=f"{now} for 2")
    plan = rw.plan(scene, to=rw.QUASISTATIC_RIGID, threads=1, seed=9)
    held_at_the_end(plan, 2.0, now)


def test_what_places_decide_of_such_a_goal() -> None:
    assert placed_part("part.x > 1 and force(a, b) > 1 for 2") == "(part.x > 1)"
    assert placed_part("(part.x > 1 and rest(part) for 2) and part.y < 1") == "(part.x > 1) and (part.y < 1)"
    assert placed_part("not (part.x > 1 for 2)") is None and placed_part("rest(part) for 1") is None
    assert jumps("floor(part.x) >= 1 for 2") and not jumps("part.x >= 1 for 2")


def test_doomed_sets_know_no_times() -> None:
    scene = push(0).changed(goal="box.x > 0.1 for 1")
    with pytest.raises(rw.SetError, match=r"^goal: for how long a condition has held is no state"):
        rw.doomed_set(scene, rw.QUASISTATIC_RIGID, over=["box.x"], inputs={"ux": (0.0, 1.0)})


def test_environments_reward_the_time_that_has_passed() -> None:
    gym = pytest.importorskip("rungwise.gym")
    scene = push(0).changed(goal="box.x < 9 for 4 * 1.5", unsafe=None)
    env = gym.SceneEnv(scene, rw.QUASISTATIC_RIGID, hold=2.0)
    env.reset(seed=0)
    rewards, done = list[float](), False
    while not done and len(rewards) < 10:
        _, reward, done, _, info = env.step(np.zeros(env.action_space.shape))
        rewards.append(float(reward))
    assert done and info["outcome"] == "goal" and info["time"] == pytest.approx(6.0, abs=1e-6)
    assert rewards[0] == pytest.approx(rewards[1]) and rewards[0] > 0.0
