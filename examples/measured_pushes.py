"""From measured pushes to a plan: fit, the simplest rung that explains them, a plan, and its rate of success.

    python examples/measured_pushes.py

A rod pushes a box on a table a few times. The pushes are made by `dynamic-compliant` with the noise of a
camera, in place of real ones; friction and the centre of pressure are to be found. The rung that explains
them plans a push to a goal, which is verified under what the pushes left uncertain, and run at the true
values, which no fit has seen.
"""

from __future__ import annotations

import argparse

import numpy as np

import rungwise as rw

TRUE = {"mu": 0.35, "press_y": 0.006}
PLACE, TURN = 2e-4, 2e-3
"""Deviations of the measurement, in m and rad."""
BOX = {"mu": (0.0, 1.0), "press_y": (-0.02, 0.02)}
NAMES = ("rod.x", "rod.y", "rod.angle", "box.x", "box.y", "box.angle")


def measured(trials: int, seed: int = 0) -> rw.Motions:
    """Pushes at offsets that are known, as a camera sees them."""
    rng, scene = np.random.default_rng(seed), rw.load("push")
    offsets = rng.uniform(-0.045, 0.045, trials)
    times = np.linspace(0.0, 4.0, 41)
    places = []
    for offset in offsets:
        run = rw.rollout(
            scene.changed(goal=None), "dynamic-compliant", durations=np.diff(times),
            parameters=TRUE | {"offset": offset, "apart": 1e-4}, tol=1e-5,
        )  # fmt: skip
        start = rw.State.of(scene, parameters={"offset": offset, "apart": 1e-4})
        places.append(np.vstack([start.q, run.q[0]]))
    seen = np.array(places)
    seen[..., 3:] += rng.normal(size=seen[..., 3:].shape) * [PLACE, PLACE, TURN]
    deviations = {"box.x": PLACE, "box.y": PLACE, "box.angle": TURN}
    return rw.Motions(NAMES, times, seen, parameters={"offset": offsets}, deviations=deviations)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--trials", type=int, default=12)
    parser.add_argument("--samples", type=int, default=40)
    given = parser.parse_args()
    rungs = ("kinematic", "quasistatic-rigid", "dynamic-rigid")
    found = rw.explain("push", measured(given.trials), over=tuple(BOX), box=BOX, models=rungs)
    print(found.verdict)
    fit = found.rungs[found.adequate].fit
    for name, (low, high) in fit.intervals.items():
        print(f"{name}: {low:.4f} to {high:.4f}, true {TRUE[name]:g}")
    plan = rw.plan(fit.scene, task_seed=3, from_=found.adequate, to="dynamic-compliant", seed=1)
    print(f"planned: {plan.found}")
    for mode in ("open loop", "re-planning"):
        verified = rw.verify(plan, samples=given.samples, mode=mode)
        print(f"{mode}: {verified.successes} of {verified.samples} reach the goal under what is uncertain")
    true = rw.simulate(
        fit.scene, "dynamic-compliant", parameters=plan.parameters | TRUE, inputs=plan.segments, tol=1e-3
    )
    print(f"at the true values: {true.outcome}")


if __name__ == "__main__":
    main()
