"""Episodes of environments: what they tell, and states that are compared."""

from __future__ import annotations

from typing import Any

import numpy as np

import rungwise as rw
from rungwise.gym import SceneEnv


def played(env: SceneEnv, seed: int, most: int = 1000) -> list[tuple[Any, ...]]:
    """What an episode with drawn actions gives."""
    env.reset(seed=seed)
    env.action_space.seed(seed)
    told: list[tuple[Any, ...]] = []
    while len(told) < most and not (told and (told[-1][2] or told[-1][3])):
        told.append(env.step(env.action_space.sample()))
    return told


def same(state: rw.State, other: rw.State) -> bool:
    """Whether q, v and time are the same to the bit."""
    return np.array_equal(state.q, other.q) and np.array_equal(state.v, other.v) and state.time == other.time


def check_uninterrupted(env: SceneEnv, scene: str, model: str) -> None:
    """That the state of an episode is that of the run with its inputs, which no holds interrupt."""
    s = env.settings
    whole = rw.simulate(
        scene, model, parameters=env.parameters, inputs=env.schedule, step=s.steps.step,
        tol=s.steps.tol, theta=s.steps.theta, span=s.horizon,
    )  # fmt: skip
    assert same(whole.state, env.state) and same(env.replay().state, env.state)
