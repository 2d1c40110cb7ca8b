"""Does a plan of fingers in space hold on other rungs and in MuJoCo? A shipped scene is planned, and drawn.

    python examples/fingers_in_space.py block_turn [--seed 0] [--limit 120] [--out block_turn.png]

The picture shows the object and its fingers at the start, at two moments on the way, and at the goal, on the
richest rung. It needs an OpenGL context (MUJOCO_GL=egl where there is no screen).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import rungwise as rw

PARTS = (0.0, 0.4, 0.7, 1.0)
PIXELS, AWAY = (300, 400), 0.45
"""Height and width of a picture, and how far the camera is from where the object is on the way, in metres."""
FLOOR, OBJECT, FINGERS = (0.95, 0.95, 0.93, 1.0), (0.9, 0.55, 0.2, 1.0), (0.25, 0.4, 0.7, 1.0)


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args(given)
    plan = rw.plan(asked.scene, seed=asked.seed, limit=asked.limit)
    if not plan.found:
        print(plan.reason)
        return 1
    print(f"{asked.scene}: {len(plan.waypoints)} legs, {sum(each.duration for each in plan.segments):.3g} s")
    for model in rw.LADDER[2:]:
        print(f"  {model.name:22} {plan.replay(model, tol=0.1 * plan.tol).outcome}")
    run = plan.replay()
    print(f"  {'MuJoCo':22} {rw.replay(run).outcome}")
    if asked.out is not None:
        draw(run, asked.out)
    return 0


def draw(run: rw.SpaceRun, out: Path) -> None:
    """Write moments of a run side by side."""
    import mujoco
    from PIL import Image

    model = run.scene.bind(run.parameters).model
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    moved = np.array([state.q[:3] for state in run.states])
    camera.lookat[:], camera.distance = moved.mean(axis=0), AWAY
    camera.azimuth, camera.elevation = 110.0, -45.0
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.5
    roots = model.body_rootid[model.geom_bodyid]
    for colour, own in ((FLOOR, roots == 0), (OBJECT, roots == 1), (FINGERS, roots > 1)):
        model.geom_rgba[own] = colour
    pictures = []
    with mujoco.Renderer(model, *PIXELS) as renderer:
        for part in PARTS:
            data.qpos[:] = run.states[round(part * (len(run.states) - 1))].q
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            pictures.append(renderer.render())
    Image.fromarray(np.hstack(pictures)).save(out)


if __name__ == "__main__":
    sys.exit(main())
