"""A scene on a rung as a Gymnasium environment: what checkers ask, and what runs say."""

from __future__ import annotations

import copy
import importlib
import math
import pickle
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rungwise as rw
import rungwise.gym
from rungwise.errors import InputError
from rungwise.gym import SceneEnv, Transition, make
from rungwise.gym.registration import SCENES
from rungwise.scene.space.read import shipped_in_space

from .episodes import check_uninterrupted, played, same

PAIRS = (
    ("push", "dynamic-rigid"),
    ("two_finger", "quasistatic-rigid"),
    ("grasp", "dynamic-compliant"),
    ("peg_in_hole", "quasistatic-compliant"),
    ("gripper", "kinematic"),
)

GRIPPER = {"squeeze": (10.0, 20.0), "v": (0.01, 0.1)}


@pytest.mark.long
@pytest.mark.parametrize(("scene", "model"), PAIRS)
def test_gymnasiums_checker_finds_nothing(scene: str, model: str) -> None:
    """Not even a warning, which the tests count as errors."""
    env = gymnasium.make(f"rungwise/{scene}-{model}-v0", render_mode="rgb_array", disable_env_checker=True)
    check_env(env.unwrapped)


@pytest.mark.long
def test_each_shipped_scene_with_inputs_is_registered_on_each_rung_that_moves() -> None:
    moving = [rung.name for rung in rw.LADDER if rung.moves]
    expected = {f"rungwise/{scene}-{model}-v0" for scene in SCENES for model in moving}
    assert {name for name in gymnasium.registry if name.startswith("rungwise/")} == expected | {
        "rungwise/Scene-v0"
    }
    in_space = {name: rw.load(name).file for name in shipped_in_space()}
    assert set(SCENES) == {name for name in rw.shipped() if rw.load(name).template.inputs} | {
        name for name, file in in_space.items() if file.inputs and file.goal
    }
    env = gymnasium.make("rungwise/Scene-v0", scene="push", model="kinematic", hold=1.0).unwrapped
    assert isinstance(env, SceneEnv) and env.settings.hold == 1.0


@pytest.mark.few(5)
@pytest.mark.parametrize("options", [{}, {"step": 2e-3}, {"ramp": True, "theta": 0.5}, {"ramp": False}])
@pytest.mark.parametrize("model", ["kinematic", "quasistatic-rigid", "dynamic-rigid", "dynamic-compliant"])
def test_an_episode_is_the_run_that_is_not_interrupted(model: str, options: dict[str, Any]) -> None:
    """To the bit, from the start and from a state, at fixed and at controlled steps."""
    env = make("two_finger", model, **options)
    played(env, 3, 6)
    check_uninterrupted(env, "two_finger", model)


def test_contacts_that_hold_a_part_are_handed_on() -> None:
    env = make("gripper", "dynamic-compliant", bounds=GRIPPER)
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.zeros(2))
    assert same(env.replay().state, env.state)
    half = env.state
    env.step(np.ones(2))
    ended = env.state
    again = make("gripper", "dynamic-compliant", bounds=GRIPPER)
    again.reset(options={"state": half})
    again.step(np.ones(2))
    assert same(again.state, ended) and same(again.replay().state, ended)


def test_seeds_decide() -> None:
    env, other = make("push", "kinematic"), make("push", "kinematic", seed=5)
    first = [env.reset(seed=5)[0], env.reset()[0]]
    assert all(np.array_equal(a, b) for a, b in zip(first, [other.reset()[0], other.reset()[0]], strict=True))
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(first[0], env.reset(seed=6)[0])


def test_starts_are_instances_of_the_task_with_what_is_uncertain() -> None:
    scene, env = rw.load("push"), make("push", "kinematic")
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        seen = dict(zip(env.observation_names, observation.tolist(), strict=True))
        at = env.parameters
        assert -0.3 <= at["goal_x"] <= 0.3 and at["near"] == 0.01
        assert seen["goal_x"] == pytest.approx(at["goal_x"]) and seen["box.x"] == pytest.approx(at["x"])
        assert 0.0 < abs(at["x"]) <= 0.002 and "mu" not in seen
        assert rw.ask(scene, scene.file.task.where, env.state, at).holds[0]  # type: ignore[union-attr]
        # As it was meant to be, and as it is.
        assert env.instance["x"] == 0.0 and env.instance["mu"] == scene.parameters()["mu"] != at["mu"]
    fixed = make("push", "kinematic", vary=())
    fixed.reset(seed=0)
    assert fixed.parameters == scene.parameters()
    only = make("push", "kinematic", vary=["instances"])
    only.reset(seed=0)
    assert only.parameters == only.instance


def changed(**task: Any) -> rw.Scene:
    """`push` with another task."""
    given = rw.load("push").file.model_dump(exclude_unset=True)
    return rw.load(given | {"task": given["task"] | task})


@pytest.mark.long
def test_conditions_of_a_task_may_speak_of_contacts() -> None:
    """Of contacts that no condition of the scene names, too, however far they are."""
    free = {"instances": {"apart": {"uniform": [0.0, 0.1]}}, "uncertain": {}}
    scene = changed(where="gap(rod, post1) >= 0.35 and gap(rod, box) >= 0.02", **free)
    env = make(scene, "kinematic")
    apart = [env.reset(seed=seed)[0][env.observation_names.index("apart")] for seed in range(20)]
    starts = [rw.State.of(scene, parameters={"apart": float(each)}) for each in apart]
    far = rw.ask(scene, "gap(rod, post1) >= 0.35", starts).holds
    assert min(apart) >= 0.02 and max(apart) > 0.06 and far.all()
    with pytest.raises(InputError, match="task: 1000 draws gave no instance that can start"):
        make(changed(where="gap(rod, box) > 1", **free), "kinematic").reset(seed=0)


def test_what_a_task_keeps_out_of_is_unsafe() -> None:
    env = make(changed(keep_out=["rod.y > 0.05"]), "kinematic", vary=[])
    env.reset(seed=0)
    first, second = (env.step(np.array([0.0, 1.0])) for _ in range(2))  # 0.03 m each, from 0.015 m
    assert not first[2] and second[2] and second[-1]["outcome"] == "unsafe"


def test_observations_are_what_they_are_called() -> None:
    parts = ["q", "v", "instance", "inputs", "forces", "time"]
    env = make("gripper", "quasistatic-compliant", observe=parts, dtype="float64", bounds=GRIPPER)
    env.reset(seed=0)
    for _ in range(5):
        observation, *_, info = env.step(np.array([0.5, -1.0]))
    seen = dict(zip(env.observation_names, observation.tolist(), strict=True))
    run = env.replay()
    assert seen["part.y"] == run.final["part"]["y"] and seen["speed(part.y)"] == run.state.v[7]
    assert [seen["squeeze"], seen["v"]] == info["inputs"].tolist() == [17.5, 0.01]
    assert seen["t"] == pytest.approx(5 * env.settings.hold) == pytest.approx(info["time"])
    assert seen["force(left, part)"] == pytest.approx(17.5, rel=1e-6)
    assert env.observation_space.contains(observation)


def test_progress_adds_up_to_what_the_start_lacked() -> None:
    env = make("two_finger", "quasistatic-rigid", bonus=2.0)
    _, begun = env.reset(seed=1)
    assert begun["lack"] == rw.ask("two_finger", "goal", env.state, env.parameters).lack[0] > 0.0
    total, info, over = 0.0, begun, False
    while not over:
        _, reward, terminated, truncated, info = env.step(np.ones(2))
        over, total = terminated or truncated, total + reward
        assert info["margin"] == pytest.approx(
            rw.ask("two_finger", "goal", env.state, env.parameters).margin[0]
        )
    assert info["outcome"] == "goal" and info["is_success"] and info["lack"] == 0.0
    assert total == pytest.approx(begun["lack"] + 2.0)


def test_rewards_of_ones_own() -> None:
    told: list[Transition] = []

    def reward(step: Transition) -> float:
        told.append(step)
        return -float(np.abs(step.inputs).sum())

    env = make("push", "kinematic", reward=reward, vary=[])
    env.reset(seed=0)
    _, given, *_ = env.step(np.array([1.0, 0.5]))
    (step,) = told
    assert given == -1.5 and step.outcome == "running" and step.time == env.settings.hold
    assert step.q[0] - step.q_before[0] == pytest.approx(0.02 * env.settings.hold)
    sparse = make("push", "kinematic", reward="sparse", vary=[])
    sparse.reset(seed=0)
    assert sparse.step(np.array([1.0, 0.5]))[1] == 0.0


def test_inputs_keep_their_bounds_and_rates() -> None:
    env = make("two_finger", "kinematic", hold=0.1)
    _, info = env.reset(seed=0)
    before = info["inputs"]
    for sign in (1.0, 1.0, -1.0, 1.0):
        *_, info = env.step(np.array([sign, -100.0]))
        assert np.abs(info["inputs"] - before).max() <= 2.0 * 0.1 * (1.0 + 1e-12)
        assert info["inputs"].min() >= 0.1 and info["inputs"].max() <= 1.5
        before = info["inputs"]
    plain = make("push", "kinematic", scaled=False, bounds={"ux": (0.0, 0.5)}, dtype="float64")
    assert plain.action_space.low.tolist() == [0.0, -1.0] and plain.action_space.high.tolist() == [0.5, 1.0]
    plain.reset(seed=0)
    assert plain.step(np.array([0.25, 7.0]))[-1]["inputs"].tolist() == [0.25, 1.0]


def test_time_is_limited_and_an_episode_that_is_over_takes_no_step() -> None:
    env = make("push", "quasistatic-rigid", horizon=0.25, hold=0.1, vary=[])
    told = played(env, 0)
    assert [row[3] for row in told] == [False, False, True] and not told[-1][2]
    assert env.settings.horizon == pytest.approx(0.3)
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(np.zeros(2))
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        make("push", "kinematic").step(np.zeros(2))


def test_a_jam_ends_an_episode_and_its_replay_has_the_certificate() -> None:
    env = make("snap", "quasistatic-rigid")
    env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, info = env.step(np.ones(1))
    assert terminated and info["outcome"] == "jammed" and not info["is_success"]
    assert info["reason"] == rw.OUTCOMES[rw.Code.JAMMED].meaning
    run = env.replay()
    assert run.outcome == "jammed" and run.certificate is not None
    assert run.state.q == pytest.approx(
        env.state.q, abs=float(rw.load("snap").bind().records.world[0]["tolerance"])
    )


def test_a_reset_begins_at_states_and_parameters() -> None:
    env = make("push", "dynamic-rigid")
    state = rw.State.of("push", {"box.y": 0.05})
    observation, _ = env.reset(seed=0, options={"state": state, "parameters": {"mu": 0.5}})
    assert observation[env.observation_names.index("box.y")] == np.float32(0.05)
    assert env.parameters == rw.load("push").parameters({"mu": 0.5})
    env.step(np.array([1.0, 0.0]))
    assert same(env.replay().state, env.state)
    env.reset(seed=0, options={"parameters": {"goal_x": 0.2, "mu": 0.5}})
    assert env.parameters["goal_x"] == 0.2 and env.parameters["mu"] == 0.5 and env.parameters["x"] != 0.0


def test_copies_go_on_alike() -> None:
    env = make("push", "dynamic-rigid")
    played(env, 4, 5)
    for other in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert same(other.state, env.state)
        branch, mine = copy.deepcopy(env), other
        for action in (np.array([1.0, 0.3]), np.array([0.2, -1.0])):
            expected, found = branch.step(action), mine.step(action)
            assert np.array_equal(expected[0], found[0]) and expected[1:4] == found[1:4]
        assert np.array_equal(branch.reset()[0], mine.reset()[0])


def test_pictures_show_what_moves() -> None:
    env = make("push", "dynamic-rigid", render_mode="rgb_array", vary=[])
    env.reset(seed=0)
    first = env.render()
    for _ in range(3):
        env.step(np.array([1.0, 0.0]))
    second = env.render()
    assert first is not None and second is not None and first.shape == second.shape == (480, 480, 3)
    assert first.dtype == np.uint8 and len(np.unique(first.reshape(-1, 3), axis=0)) > 3
    assert (first != second).any(axis=2).mean() > 0.01
    assert make("push", "kinematic").render() is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"holds": 1}, r"holds: unknown option \(did you mean hold\?\)"),
        ({"hold": 0.0}, "hold: must be greater than 0"),
        ({"hold": 2.0, "horizon": 1.0}, "hold: must be at most the horizon"),
        ({"horizon": math.nan}, "horizon: must be finite"),
        ({"bounds": {"u": (0, 1)}}, "bounds: unknown input 'u'"),
        ({"bounds": {"ux": (1, 0)}}, "bounds.ux"),
        ({"bounds": {"ux": (0, 100)}}, "bounds.ux: must lie in the parameter's range, -10 to 10"),
        ({"bounds": {"ux": (1, 1)}}, "bounds.ux: the least, 1, is not below the greatest, 1"),
        ({"vary": ["instance"]}, r"vary: unknown 'instance' \(did you mean instances\?\)"),
        ({"observe": "q"}, "observe: must be a list of names"),
        ({"reward": "dense"}, "reward: must be progress, sparse or a function"),
        ({"dtype": "int8"}, "dtype: must be float32 or float64"),
        ({"scaled": 1}, "scaled: must be true or false"),
        ({"render_mode": "human"}, "render_mode: must be null or rgb_array, not 'human'"),
        ({"parameters": {"nu": 1.0}}, "nu"),
        ({"tol": -1.0}, "tol: must be"),
        ({"theta": 0.1}, "theta: must be"),
        ({"threads": 0}, "threads"),
    ],
)
def test_wrong_options_are_refused_by_name(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        make("push", "kinematic", **options)


def test_wrong_calls_are_refused_by_name() -> None:
    env = make("push", "kinematic")
    env.reset(seed=0)
    for action, said in (
        (np.zeros(3), r"action: must have the shape \(2,\), not \(3,\)"),
        (np.array([0.0, math.nan]), "action: must be finite"),
        ("left", "action: must be numbers"),
    ):
        with pytest.raises(InputError, match=said):
            env.step(action)  # type: ignore[arg-type]
    for options, said in (
        ({"start": 1}, r"options: unknown 'start' \(did you mean state\?\); valid: state, parameters"),
        ({"parameters": {"nu": 1.0}}, "nu"),
        ({"parameters": 1}, "options.parameters: must be a mapping"),
        ({"state": rw.State.of("two_finger")}, "state: has the coordinates"),
        ({"state": rw.State.of("push", {"box.x": -0.05})}, "overlaps"),
    ):
        with pytest.raises(InputError, match=said):
            env.reset(options=options)
    with pytest.raises(InputError, match="inputs: the scene has none"):
        make("pivot", "kinematic")
    with pytest.raises(InputError, match="model: the geometric rung"):
        make("push", "geometric")
    squeeze = make("squeeze", "kinematic", bounds={"close": (0.0, 0.04)})
    with pytest.raises(InputError, match="parameters: a coordinate may travel beyond the space"):
        squeeze.reset(options={"parameters": {"opening": 0.05}})


def test_without_gymnasium_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ImportError, match=r"needs gymnasium \(pip install 'rungwise\[gym\]'\)"):
        importlib.reload(rungwise.gym)
