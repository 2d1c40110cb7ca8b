"""Many environments by one compiled call: each is the single environment, as Gymnasium's own loop runs it."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import rungwise as rw
from rungwise.errors import InputError
from rungwise.gym import SceneEnv, SceneVectorEnv

MANY = 5


@pytest.mark.few(1)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(("scene", "model"), [("two_finger", "dynamic-rigid"), ("push", "quasistatic-rigid")])
def test_many_are_many_single_ones(scene: str, model: str, mode: AutoresetMode) -> None:
    """Observations, rewards, ends and infos over several episodes, to the bit."""
    options = {"horizon": 0.6, "hold": 0.1} if scene == "push" else {"hold": 0.15}
    vector = SceneVectorEnv(MANY, scene, model, autoreset_mode=mode, **options)  # type: ignore[arg-type]
    single = SyncVectorEnv([lambda: SceneEnv(scene, model, **options)] * MANY, autoreset_mode=mode)  # type: ignore[arg-type, list-item]
    assert vector.observation_space == single.observation_space
    assert vector.action_space == single.action_space
    assert vector.metadata["autoreset_mode"] == mode
    assert data_equivalence(vector.reset(seed=7), single.reset(seed=7), exact=True)
    rng, ends = np.random.default_rng(0), 0
    for _ in range(20):
        actions = rng.uniform(-1.0, 1.0, vector.action_space.shape).astype(np.float32)
        found, expected = vector.step(actions), single.step(actions)
        assert data_equivalence(found, expected, exact=True)
        ends += int(found[2].sum() + found[3].sum())
    assert ends > MANY


def test_environments_begin_anew_as_the_mask_says() -> None:
    vector = SceneVectorEnv(3, "push", "kinematic", autoreset_mode="Disabled", hold=0.1, horizon=0.2)
    vector.reset(seed=[3, None, 5])
    for _ in range(2):
        *_, truncated, _ = vector.step(np.zeros((3, 2)))
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded, match="environment 0 is over"):
        vector.step(np.zeros((3, 2)))
    before = vector.states
    mask = np.array([True, False, True])
    _, infos = vector.reset(seed=[3, 4, 5], options={"reset_mask": mask})
    assert infos["_time"].tolist() == mask.tolist() and mask.tolist() == [True, False, True]
    assert [state.time for state in vector.states] == [0.0, before[1].time, 0.0]
    with pytest.raises(gymnasium.error.ResetNeeded, match="environment 1 is over"):
        vector.step(np.zeros((3, 2)))


def test_states_and_threads() -> None:
    """What many environments come to does not depend on threads, and is a state to go on from."""
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (4, MANY, 2))
    ends = []
    for threads in (1, 3):
        vector = SceneVectorEnv(MANY, "two_finger", "dynamic-compliant", threads=threads)
        vector.reset(seed=0)
        for each in actions:
            vector.step(each)
        ends.append(vector.states)
    for one, three in zip(*ends, strict=True):
        assert np.array_equal(one.q, three.q) and np.array_equal(one.v, three.v)
    state = ends[0][0]
    run = rw.simulate("two_finger", "dynamic-compliant", state=state, inputs=[{"duration": 0.1}])
    assert run.time == state.time + 0.1


def test_gymnasium_makes_many_by_name() -> None:
    many = gymnasium.make_vec("rungwise/push-kinematic-v0", num_envs=2, render_mode="rgb_array")
    assert isinstance(many, SceneVectorEnv)
    many.reset(seed=0)
    pictures = many.render()
    assert pictures is not None and [picture.shape for picture in pictures] == [(480, 480, 3)] * 2
    sync = gymnasium.make_vec("rungwise/push-kinematic-v0", num_envs=2, vectorization_mode="sync")
    assert data_equivalence(many.reset(seed=1)[0], sync.reset(seed=1)[0], exact=True)


def test_wrong_calls_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="autoreset_mode: unknown 'Later'; valid: NextStep"):
        SceneVectorEnv(2, "push", "kinematic", autoreset_mode="Later")
    with pytest.raises(InputError, match="num_envs: must be a whole number"):
        SceneVectorEnv(0, "push", "kinematic")
    many = SceneVectorEnv(2, "push", "kinematic")
    with pytest.raises(gymnasium.error.ResetNeeded):
        many.step(np.zeros((2, 2)))
    with pytest.raises(InputError, match="seed: must be a number or 2 of them, not 3"):
        many.reset(seed=[1, 2, 3])
    with pytest.raises(InputError, match="reset_mask: must be an array of 2 truths"):
        many.reset(options={"reset_mask": np.zeros(2, bool)})
    many.reset(seed=0)
    with pytest.raises(InputError, match=r"action: must have the shape \(2, 2\)"):
        many.step(np.zeros(2))
