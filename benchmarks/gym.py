"""Steps per second of Gymnasium's loop over many environments, and of one compiled call for many, or of
processes for a scene in space.

    python benchmarks/gym.py [--envs N] [--steps N] [--json]

Actions are drawn; episodes that end begin anew in the next step, also in the loop. `together` is
`SceneVectorEnv`, `loop` is `gymnasium.vector.SyncVectorEnv` of `SceneEnv`; they take turns, and `ratio` is
the median over rounds of the ratio within one round. `same` says whether they gave the same bits.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv

from rungwise.gym import SceneEnv, SceneVectorEnv

CASES = (
    ("two_finger", "quasistatic-rigid"),
    ("push", "quasistatic-rigid"),
    ("push", "dynamic-rigid"),
    ("peg_in_hole", "quasistatic-compliant"),
    ("grasp", "dynamic-compliant"),
    ("three_finger_lift", "dynamic-rigid"),
)
ROUNDS = 3


@dataclass
class Row:
    """A scene on a rung: steps of environments per second, each way."""

    scene: str
    model: str
    envs: int
    together: float
    loop: float
    ratio: float
    same: bool


def taken(env: VectorEnv[Any, Any, Any], steps: int) -> tuple[float, Any]:
    """Seconds of so many steps from a seeded reset, and the last observation."""
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, *env.action_space.shape))
    began = time.perf_counter()
    for each in actions.astype(np.float32):
        observation, *_ = env.step(each)
    return time.perf_counter() - began, observation


def compared(scene: str, model: str, envs: int, steps: int, rounds: int) -> Row:
    together = SceneVectorEnv(envs, scene, model)
    loop = SyncVectorEnv([lambda: SceneEnv(scene, model)] * envs)
    same = np.array_equal(taken(together, 2)[1], taken(loop, 2)[1])  # also compiles what is needed
    seconds: list[tuple[float, float]] = []
    for _ in range(rounds):
        (one, found), (many, expected) = taken(together, steps), taken(loop, steps)
        same &= np.array_equal(found, expected)
        seconds.append((one, many))
    done = envs * steps
    return Row(
        scene, model, envs, together=done / median(one for one, _ in seconds),
        loop=done / median(many for _, many in seconds),
        ratio=median(many / one for one, many in seconds), same=bool(same),
    )  # fmt: skip


def main(
    arguments: list[str] | None = None, cases: Sequence[tuple[str, str]] = CASES, rounds: int = ROUNDS
) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--envs", type=int, default=128)
    parser.add_argument("--steps", type=int, default=30, help="steps of each environment in a round")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    rows = [compared(*case, given.envs, given.steps, rounds) for case in cases]
    if given.json:
        print(json.dumps([asdict(row) for row in rows]))
    else:
        print(f"{given.envs} environments, median of {rounds}: steps of environments per second")
        print(f"{'scene':18}{'model':24}{'together':>10}{'loop':>10}{'ratio':>8}  same")
        for row in rows:
            line = f"{row.scene:18}{row.model:24}{row.together:10.0f}{row.loop:10.0f}{row.ratio:8.1f}"
            print(f"{line}  {'yes' if row.same else 'no'}")
    return 0 if all(row.same for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
