"""Scenes in space as Gymnasium environments: each episode is the run that `simulate` makes."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import SyncVectorEnv

import rungwise as rw
from rungwise.errors import InputError
from rungwise.gym import SceneEnv, SceneVectorEnv, Transition, make
from rungwise.scene.space import SpaceScene

from .episodes import check_uninterrupted, played, same

PUSHER = """<mujoco><worldbody><geom name="table" type="plane" size="2 2 .1"/>
<body name="pusher" pos="-.1 0 .05"><joint name="along" type="slide"
  axis="1 0 0" limited="true" range="-.1 .4"/>
<geom name="pusher" type="sphere" size=".02" mass=".2"/></body>
<body name="box" pos="0 0 .05"><freejoint/><geom name="box" type="box" size=".05 .05 .05" mass=".5"/></body>
</worldbody>
<actuator><position name="servo" joint="along" kp="400" kv="10"/></actuator></mujoco>"""
WEIGHT = 0.5 * 9.81
FORWARD = np.ones(1)


@pytest.fixture
def scene(tmp_path: Path) -> SpaceScene:
    """A box on a table, and a ball on a slide that pushes it."""
    model = tmp_path / "pusher.xml"
    model.write_text(PUSHER)
    loaded = rw.load(
        {
            "name": "pusher", "model": {"file": str(model)},
            "parameters": {
                "aim": {"default": 0.0, "range": [-0.05, 0.3]},
                "mu": {"default": 0.5, "range": [0.0, 2.0]},
                "goal_x": {"default": 0.2, "range": [0.0, 0.5]},
            },
            "inputs": ["aim"], "controls": {"servo": "aim"},
            "contacts": [{"friction": "mu", "stiffness": 1e5, "damping": 1e2}],
            "goal": "box.x >= goal_x", "step": 4e-3,
            "task": {
                "instances": {"goal_x": {"uniform": [0.05, 0.2]}}, "where": "gap(pusher, box) <= goal_x",
                "uncertain": {"mu": {"uniform": [0.3, 0.6]}},
                "inputs": {"aim": {"range": [-0.05, 0.3], "rate": 0.5}}, "keep_out": ["box.y > 0.5"],
            },
        }
    )  # fmt: skip
    assert isinstance(loaded, SpaceScene)
    return loaded


@pytest.mark.few(1)
@pytest.mark.parametrize("model", ["quasistatic-rigid", "dynamic-compliant"])
@pytest.mark.parametrize("name", ["three_finger_lift", "arm_push"])
def test_gymnasiums_checker_finds_nothing(name: str, model: str) -> None:
    env = gymnasium.make(f"rungwise/{name}-{model}-v0", disable_env_checker=True)
    check_env(env.unwrapped, skip_render_check=True)  # pictures need OpenGL


@pytest.mark.few(1)
@pytest.mark.parametrize("options", [{}, {"step": 4e-3, "theta": 0.5}, {"ramp": False}])
@pytest.mark.parametrize("model", [rung.name for rung in rw.LADDER if rung.moves])
def test_an_episode_is_the_run_that_is_not_interrupted(model: str, options: dict[str, Any]) -> None:
    """To the bit, q, v, time and the conditions' values."""
    env = make("three_finger_lift", model, hold=0.05, **options)
    played(env, 3, 5)
    check_uninterrupted(env, "three_finger_lift", model)
    states = env.replay().state, env.state
    asked = [rw.ask("three_finger_lift", "goal", state, env.parameters) for state in states]
    assert np.array_equal(asked[0].values, asked[1].values)


def test_contacts_are_handed_on_and_episodes_begin_at_states(scene: SpaceScene) -> None:
    env = make(scene, "dynamic-compliant", hold=0.05, vary=[])
    env.reset(seed=0)
    for _ in range(4):
        env.step(FORWARD)
    half = env.state
    env.step(FORWARD)
    again = make(scene, "dynamic-compliant", hold=0.05, vary=[])
    again.reset(options={"state": half})
    again.step(FORWARD)
    assert same(again.state, env.state) and same(again.replay().state, env.state)
    assert env.state["box.x"] > 0.01
    rigid = make(scene, "kinematic", hold=0.05, vary=[])
    rigid.reset(seed=0)
    rigid.step(FORWARD)
    other = make(scene, "dynamic-rigid", hold=0.05, vary=[])
    other.reset(options={"state": rigid.state, "parameters": {"mu": 0.4}})
    other.step(FORWARD)
    assert same(other.replay().state, other.state) and other.parameters["mu"] == 0.4


def test_observations_are_what_they_are_called(scene: SpaceScene) -> None:
    parts = ["q", "v", "instance", "inputs", "forces", "time"]
    env = make(scene, "quasistatic-compliant", observe=parts, dtype="float64", hold=0.05)
    observation, _ = env.reset(seed=0)
    names, space = env.observation_names, env.observation_space
    assert dict(zip(names, observation.tolist(), strict=True))["force(world, box)"] == 0.0
    observation, *_, info = env.step(FORWARD)  # not yet to the box
    seen = dict(zip(names, observation.tolist(), strict=True))
    run = env.replay()
    assert [seen[name] for name in scene.template.coordinates] == run.state.q.tolist()
    assert [seen[f"speed({name})"] for name in scene.template.velocities] == run.state.v.tolist()
    assert seen["goal_x"] == env.parameters["goal_x"] and [seen["aim"]] == info["inputs"].tolist() == [0.025]
    assert seen["force(world, box)"] == pytest.approx(WEIGHT) and seen["t"] == pytest.approx(0.05)
    bounds = dict(zip(names, zip(space.low.tolist(), space.high.tolist(), strict=True), strict=True))
    assert bounds["pusher.along"] == (-0.1, 0.4) and bounds["box.qw"] == (-1.0, 1.0)
    assert bounds["box.x"][1] == -bounds["box.x"][0] > 1e30


def test_starts_are_instances_of_the_task_with_what_is_uncertain(scene: SpaceScene) -> None:
    env = make(scene, "kinematic")
    goals = []
    for seed in range(6):
        env.reset(seed=seed)
        at = env.parameters
        goals.append(at["goal_x"])
        assert 0.3 <= at["mu"] <= 0.6 and env.instance["mu"] == 0.5 and env.instance["goal_x"] == at["goal_x"]
        assert rw.ask(scene, scene.file.task.where, env.state, at).holds[0]  # type: ignore[union-attr]
    assert 0.05 <= min(goals) < max(goals) <= 0.2
    assert env.reset(seed=5)[0] == pytest.approx(make(scene, "kinematic", seed=5).reset()[0], abs=0.0)


@pytest.mark.long
def test_progress_adds_up_and_what_is_kept_out_of_is_unsafe(scene: SpaceScene) -> None:
    told: list[Transition] = []
    env = make(scene, "kinematic", hold=0.1, horizon=2.0)
    _, begun = env.reset(seed=1)
    total, over = 0.0, False
    while not over:
        _, reward, terminated, truncated, info = env.step(FORWARD)
        over, total = terminated or truncated, total + reward
    assert info["outcome"] == "goal" and total == pytest.approx(begun["lack"] + 1.0)
    assert rw.ask(scene, "goal", env.state, env.parameters).holds[0]
    own = make(scene, "kinematic", hold=0.1, reward=lambda step: told.append(step) or 2.0)  # type: ignore[func-returns-value]
    own.reset(options={"state": rw.State.of(scene, {"box.y": 0.6})})
    assert own.state["box.y"] == 0.6 and own._episodes.terminated[0]  # begins where the task keeps out of
    own.reset(seed=0)
    assert own.step(FORWARD)[1] == 2.0 and told[0].q.shape == (8,) and told[0].v.shape == (7,)


def test_copies_go_on_alike() -> None:
    env = make("arm_push", "dynamic-compliant")
    played(env, 4, 3)
    for other in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        branch = copy.deepcopy(env)
        expected, found = branch.step(np.ones(3)), other.step(np.ones(3))
        assert np.array_equal(expected[0], found[0]) and expected[1:4] == found[1:4]
        assert np.array_equal(branch.reset()[0], other.reset()[0])


@pytest.mark.long
def test_many_are_many_single_ones_in_any_number_of_threads(scene: SpaceScene) -> None:
    options: dict[str, Any] = {"hold": 0.1, "horizon": 0.3, "tol": 1e-3}
    single = SyncVectorEnv([lambda: SceneEnv(scene, "kinematic", **options)] * 6)
    for threads in (1, 2):
        vector = SceneVectorEnv(6, scene, "kinematic", threads=threads, **options)
        rng, ends = np.random.default_rng(0), 0
        assert data_equivalence(vector.reset(seed=7), single.reset(seed=7), exact=True)
        for _ in range(6):
            actions = rng.uniform(-1.0, 1.0, (6, 1)).astype(np.float32)
            found = vector.step(actions)
            assert data_equivalence(found, single.step(actions), exact=True)
            ends += int((found[2] | found[3]).sum())
        assert ends >= 6


def test_pictures_are_of_the_state_and_need_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands in for MuJoCo's renderer draws the places that it is given."""

    class Stand:
        def __init__(self, *_: object) -> None:
            self.pixels = np.zeros((480, 480, 3), np.uint8)

        def update_scene(self, data: Any) -> None:
            self.pixels[0, 0, 0] = round(1000.0 * data.qpos[2])

        def render(self) -> Any:
            return self.pixels.copy()

        def close(self) -> None:
            self.pixels[:] = 0

    monkeypatch.setattr(mujoco, "Renderer", Stand)
    env = make("three_finger_lift", "kinematic", render_mode="rgb_array", vary=[])
    env.reset(seed=0)
    copied = copy.deepcopy(env)
    for each in (env, copied):
        first = each.render()
        assert first is not None and first.shape == (480, 480, 3) and first[0, 0, 0] == 50
        each.close()

    def fails(*_: object) -> None:
        raise RuntimeError("no display\nand more")

    monkeypatch.setattr(mujoco, "Renderer", fails)
    with pytest.raises(InputError, match=r"^render_mode: .*\(no display\).*MUJOCO_GL to egl or osmesa.*$"):
        env.render()
    assert make("three_finger_lift", "kinematic").render() is None


def test_wrong_calls_are_refused_by_name(scene: SpaceScene) -> None:
    with pytest.raises(InputError, match="inputs: the scene has none"):
        make("slope", "kinematic")
    with pytest.raises(InputError, match="goal: the scene has none"):
        make(scene.changed(goal=None), "kinematic")
    env = make(scene, "kinematic")
    with pytest.raises(InputError, match=r"state: .*overlap"):
        env.reset(options={"state": rw.State.of(scene, {"box.x": -0.05})})
    with pytest.raises(InputError, match="state: has the coordinates"):
        env.reset(options={"state": rw.State.of("arm_push")})
