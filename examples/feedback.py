"""Controllers in the loop: a rod keeps a pushed box on its course, and fingers close until they feel enough.

    python examples/feedback.py             two tables
    python examples/feedback.py --json      only the numbers, as one JSON object

The rod pushes the box at one point, which is unstable: the box turns away. The controller moves the rod along
the edge, towards the side to which the box turns. The fingers know neither the ball's size nor its friction:
they close until each presses with the wanted force, and only then the palm rises. The first scene is planar,
the second in space; both are led in the same manner.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import numpy as np

import rungwise as rw

RUNGS = ("quasistatic-rigid", "dynamic-compliant")
RATE = 20.0
"""Times per second at which controllers are asked."""
LONG = {"goal_x": 0.3, "goal_y": 0.0, "goal_angle": 0.0, "near": 0.02, "aligned": 0.3}
FAR = {"offset": 0.005, "travel": 0.4, "post1_y": 0.5, "post2_y": -0.5}
ENOUGH = 1.5
"""Force of each finger at which the palm rises, in N; the ball weighs 2 N."""
FINGERS = ("finger0", "finger1", "finger2")


def on_course(now: rw.Observation) -> dict[str, float]:
    """Speeds of the rod over that of the scene: ahead, and along the edge of the box to where it turns the
    box back."""
    turned, aside = now["box.angle"], now["box.y"]
    wanted = np.clip(0.06 * turned + 0.5 * aside, -0.03, 0.03) - 0.05 * turned
    along = 20.0 * (wanted - (now["rod.y"] - aside))
    return {"ux": 1.0, "uy": float(np.clip(along, -0.5, 0.5))}


def by_touch(now: rw.Observation) -> dict[str, float]:
    """Close the fingers until each feels enough, then rise."""
    if min(now.force(finger, "ball") for finger in FINGERS) < ENOUGH and now.inputs["rise"] == 0.0:
        return {"squeeze": min(now.inputs["squeeze"] + 0.001, 0.08)}
    return {"rise": min(now.inputs["rise"] + 0.002, 0.1)}


def pushes() -> list[dict[str, Any]]:
    """The same push with and without the controller, at several frictions between rod and box."""
    rows = []
    for rung in RUNGS:
        for mu in (0.15, 0.25, 0.4):
            parameters = FAR | LONG | {"mu": mu}
            for led in (False, True):
                control = {"control": on_course, "rate": RATE} if led else {}
                run = rw.simulate("push", rung, parameters=parameters, **control)  # type: ignore[call-overload]
                end = run.final["box"]
                rows.append(
                    {"rung": rung, "mu": mu, "led": led, "outcome": str(run.outcome)}
                    | {"turned": round(end["angle"], 2), "aside": round(end["y"], 3)}
                )
    return rows


def grasps() -> list[dict[str, Any]]:
    """The same controller with balls of several frictions."""
    rows = []
    for rung in RUNGS:
        for mu in (0.5, 0.8):
            run = rw.simulate(
                "three_finger_lift", rung, parameters={"mu": mu}, control=by_touch, rate=2 * RATE, duration=6
            )
            told = {name: value for each in run.inputs for name, value in each.inputs.items()}
            rows.append(
                {"rung": rung, "mu": mu, "outcome": str(run.outcome)}
                | {"closed": round(told["squeeze"], 3), "lifted": round(run.final["ball"]["z"] - 0.05, 3)}
            )
    return rows


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args(arguments)
    found = {"pushes": pushes(), "grasps": grasps()}
    if wanted.json:
        print(json.dumps(found))
    else:
        print(f"{'rung':20s} {'mu':>5s} {'control':>8s} {'outcome':>8s} {'turned':>7s} {'aside':>7s}")
        for row in found["pushes"]:
            control = "yes" if row["led"] else "no"
            print(f"{row['rung']:20s} {row['mu']:5.2f} {control:>8s} {row['outcome']:>8s}", end=" ")
            print(f"{row['turned']:7.2f} {row['aside']:7.3f}")
        print(f"{'rung':20s} {'mu':>5s} {'outcome':>8s} {'closed':>7s} {'lifted':>7s}")
        for row in found["grasps"]:
            print(f"{row['rung']:20s} {row['mu']:5.2f} {row['outcome']:>8s}", end=" ")
            print(f"{row['closed']:7.3f} {row['lifted']:7.3f}")
    kept = all((row["outcome"] == "goal") == row["led"] for row in found["pushes"])
    return 0 if kept and all(row["outcome"] == "goal" for row in found["grasps"]) else 1


if __name__ == "__main__":
    sys.exit(main())
