"""A push found by the cross-entropy method in many environments at once, then tried on every rung.

    python examples/gym_push.py [--model M] [--seed N] [--json]

A rod pushes a box to a pose (scene `push`). Sequences of actions are drawn about a mean, run together in a
`SceneVectorEnv`, and the mean and the deviation of the best become those of the next draw (Rubinstein: The
cross-entropy method for combinatorial and continuous optimization, 1999). The best sequence found on one
rung is then held in a `SceneEnv` on each.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rungwise as rw
from rungwise.gym import SceneEnv, SceneVectorEnv

MANY, BEST, ROUNDS = 128, 12, 30
"""Sequences of a round, how many of them make the next one, and most rounds."""
LEAST = 0.02
"""Least deviation of an action, so that draws never become all the same."""
OPTIONS: dict[str, Any] = {
    "parameters": {
        "goal_x": 0.1, "goal_y": 0.03, "goal_angle": 0.3, "near": 0.002, "aligned": 0.02, "offset": 0.0
    },
    "bounds": {"ux": (0.0, 1.0), "uy": (-1.0, 1.0)},
    "hold": 1.0,
    "horizon": 10.0,
    "vary": (),
}  # fmt: skip


def returns(env: SceneVectorEnv, actions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of rewards (m,) of the sequences (m, steps, u) until their episodes end."""
    env.reset(seed=0)
    total, goes_on = np.zeros(env.num_envs), np.ones(env.num_envs, bool)
    for step in range(actions.shape[1]):
        _, reward, terminated, truncated, _ = env.step(actions[:, step])
        total += np.where(goes_on, reward, 0.0)
        goes_on &= ~(terminated | truncated)
    return total


def search(model: str, seed: int) -> tuple[NDArray[np.float64], list[float]]:
    """The best sequence (steps, u), and the best return of each round."""
    env, rng = SceneVectorEnv(MANY, "push", model, **OPTIONS), np.random.default_rng(seed)
    shape = (env.settings.holds, len(env.settings.low))
    mean, deviation, found = np.zeros(shape), np.ones(shape), list[float]()
    best = mean
    for _ in range(ROUNDS):
        actions = np.clip(mean + deviation * rng.standard_normal((MANY, *shape)), -1.0, 1.0)
        actions[0] = best
        value = returns(env, actions)
        order = np.argsort(-value, kind="stable")
        best, elite = actions[order[0]], actions[order[:BEST]]
        mean, deviation = elite.mean(axis=0), np.maximum(elite.std(axis=0), LEAST)
        found.append(float(value[order[0]]))
        if found[-1] > 1.0:  # the bonus of the goal, which progress alone never makes up
            break
    return best, found


def tried(model: str, actions: NDArray[np.float64]) -> dict[str, Any]:
    """How an episode with these actions ends."""
    env = SceneEnv("push", model, **OPTIONS)
    env.reset(seed=0)
    for action in actions:
        *_, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    return {"model": model, "success": info["is_success"], "lack": info["lack"], "time": info["time"]}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    moving = [rung.name for rung in rw.LADDER if rung.moves]
    parser.add_argument("--model", default="quasistatic-rigid", choices=moving)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    actions, found = search(given.model, given.seed)
    rows = [tried(model, actions) for model in moving]
    if given.json:
        print(json.dumps({"returns": found, "rows": rows}))
    else:
        print(f"{given.model}: best return {found[-1]:.3f} after {len(found)} rounds of {MANY} sequences")
        for row in rows:
            end = "goal" if row["success"] else f"lacks {row['lack']:.3f}"
            print(f"{row['model']:24}{end:14}t = {row['time']:.2f}")
    return 0 if any(row["success"] for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
