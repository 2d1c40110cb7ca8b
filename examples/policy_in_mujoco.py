"""A plan in MuJoCo's own loop: as it is, and with its policy, which is called on MuJoCo's state.

python examples/policy_in_mujoco.py [PLAN.json]
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import mujoco
import numpy as np

import rungwise as rw
from rungwise.kernel import Reals


def run(plan: rw.Plan, levels: Callable[[rw.State], Reals], period: float, duration: float) -> str:
    """Inputs are ramped over a period to those that `levels` gives; the scene says which controls follow."""
    scene, template = plan.scene, plan.scene.template
    bound = scene.bind(plan.parameters)
    model, values = bound.model, bound.values.copy()
    data, start = mujoco.MjData(model), rw.State.of(scene, parameters=plan.parameters)
    data.qpos[:] = start.q
    inputs = [template.parameters.index(name) for name in template.inputs]
    before = values[inputs]
    steps = max(1, round(period / model.opt.timestep))
    while data.time < duration:
        state = rw.State(start.names, data.qpos, data.qvel, data.time)
        if scene.goal(state, plan.parameters).holds[0]:
            return f"goal after {data.time:.2f} s"
        after = levels(state)
        for k in range(steps):
            values[inputs] = before + (k + 1) / steps * (after - before)
            values[-1] = data.time
            bound.tell(values)
            data.ctrl[:] = bound.control
            bound.step_in_mujoco(data)
        before = after
    return "missed"


def main(plan: rw.Plan | None = None) -> None:
    plan = plan or rw.plan("ball_turn", seed=0)
    policy = plan.policy()
    rows, durations = plan.levels()
    start = np.array([plan.parameters[name] for name in plan.scene.template.inputs])
    ends, levels = np.concatenate([[0.0], np.cumsum(durations)]), np.vstack([start, rows])
    period = 1.0 / policy.rate

    def as_it_is(state: rw.State) -> Reals:
        return np.array([np.interp(state.time + period, ends, column) for column in levels.T])

    def with_policy(state: rw.State) -> Reals:
        return np.array(list(policy(state).values()))

    print("as it is:   ", run(plan, as_it_is, period, plan.duration))
    print("with policy:", run(plan, with_policy, period, policy.duration))
    print(len(policy.proposals), "proposals,", policy.status)


if __name__ == "__main__":
    main(rw.load_plan(sys.argv[1]) if len(sys.argv) > 1 else None)
