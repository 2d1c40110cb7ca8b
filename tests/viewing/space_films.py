"""Films of MuJoCo's own steps, for tests of pictures: no model of the package is needed."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np

from rungwise.viewing.space.film import OPEN, SLIP, STICK, Film, Touches
from rungwise.viewing.space.model_solids import film_of_model

SCENE = """
<mujoco model="ball and box">
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.8 0.8 0.8 1"/>
    <body name="ball" pos="-0.5 0 0.1">
      <freejoint/><geom type="sphere" size="0.1" mass="1" rgba="0.9 0.5 0.2 1"/>
    </body>
    <body name="box" pos="0.1 0 0.08">
      <freejoint/><geom type="box" size="0.08 0.1 0.08" mass="0.5"/>
    </body>
  </worldbody>
</mujoco>"""
BRINK = 0.98
"""MuJoCo's contacts creep: one whose friction is so near its limit is taken to slip."""


def filmed(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    duration: float,
    rung: str = "",
    every: int = 5,
    **said: object,
) -> Film:
    """The film of a run from the state in `data`, a frame every so many steps."""
    names, solids = film_of_model(model)
    time, places, turns, rows, curves = [], [], [], [], []
    pairs: dict[tuple[str, str], int] = {}
    for step in range(round(duration / model.opt.timestep) + 1):
        if step % every == 0:
            mujoco.mj_forward(model, data)
            now: dict[int, tuple[float, float]] = {}
            for k, contact in enumerate(data.contact):
                first, second = (names[model.geom_bodyid[g]] for g in contact.geom)
                pair = pairs.setdefault((first, second), len(pairs))
                axes, local = contact.frame.reshape(3, 3), np.zeros(6)
                mujoco.mj_contactForce(model, data, k, local)
                push, pull = local[0], float(np.hypot(local[1], local[2]))
                mode = OPEN if push <= 0.0 else SLIP if pull > BRINK * contact.friction[0] * push else STICK
                gap, total = now.get(pair, (np.inf, 0.0))
                now[pair] = min(gap, contact.dist), total + push
                force = axes.T @ local[:3]
                rows.append((len(time), pair, *contact.pos, *axes[0], *force, contact.friction[0], mode))
            time.append(data.time)
            places.append(data.xpos.copy())
            turns.append(data.xquat.copy())
            curves.append(now)
        mujoco.mj_step(model, data)
    table = np.array(rows).reshape(-1, 13)
    whole = table[:, [0, 1, 12]].astype(np.int64)
    values = np.full((len(time), len(pairs), 2), (np.nan, 0.0))
    for frame, now in enumerate(curves):
        for pair, both in now.items():
            values[frame, pair] = both
    assert all(a < b for a, b in pairwise(time))
    return Film(
        title=model.names.split(b"\0")[0].decode(),
        model=rung,
        bodies=tuple(names),
        solids=tuple(solids),
        time=np.array(time),
        places=np.array(places),
        turns=np.array(turns),
        pairs=tuple(pairs),
        touches=Touches(
            whole[:, 0], whole[:, 1], table[:, 2:5], table[:, 5:8], table[:, 8:11], table[:, 11], whole[:, 2]
        ),
        gaps=values[:, :, 0],
        pushes=values[:, :, 1],
        units={"length": "m", "force": "N", "time": "s"},
        **said,  # type: ignore[arg-type]
    )


def ball_and_box(speed: float, rung: str, duration: float = 0.6) -> Film:
    """A ball rolls against a box and pushes it."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    return filmed(model, data, duration, rung, outcome="goal", reason="the box is where it should be")
