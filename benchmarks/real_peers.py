"""MuJoCo, Box2D and pymunk in the place of a rung: their runs from measured states, fitted by the same code.

Each has the parameters that its users have: friction; time constant and damping ratio of contact (MuJoCo's
`solref`); restitution (Box2D, pymunk). All take steps of `STEP`. In the plane MuJoCo's bodies slide and turn
on three joints. Box2D is tuned to metres, and gets the scene `LARGE` times as large.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import rungwise as rw
from rungwise.fitting.predict import Predictor
from rungwise.fitting.prepare import Prepared

STEP = 1e-3
LARGE = 20.0
GRAVITY = 9.81
PARAMETERS = {
    "friction": {"default": 0.2, "range": [0.0, 1.0]},
    "bounce": {"default": 0.3, "range": [0.0, 1.0]},
    "time_constant": {"default": 0.005, "range": [0.002, 0.05]},
    "damping_ratio": {"default": 0.5, "range": [0.01, 2.0]},
}
"""Of the others; rungs of the scene do not read them."""


@dataclass(frozen=True)
class Outline:
    """A convex part in the plane: corners (k, 2), and how far the table is from y = 0."""

    corners: Any
    inertia: float
    table: str = ""


class Peer(Predictor):
    """Runs by another simulator: `engine` yields places of one run from a start, at times."""

    engine: Callable[..., Iterator[Any]]

    def places(self, points: Any, starts: Any) -> tuple[Any, Any]:
        """See `Predictor.places`."""
        p, s = starts.shape[:2]
        n, (_, g) = self.spans.q.shape[1], self.spans.counts.shape
        q = np.zeros((p, s, g, n))
        for i, point in enumerate(points):
            self._deadline.look()
            values = self.scene.parameters(self._given | dict(zip(self.over, point.tolist(), strict=True)))
            run = self.engine(values)
            for j in range(s):
                q[i, j] = list(run(starts[i, j], self.spans.durations[j]))
        return q, np.ones((p, s), bool)


@dataclass(frozen=True)
class WithPeer(Prepared):
    """A fit whose runs a peer makes."""

    engine: Callable[..., Any] = None  # type: ignore[assignment]

    def predictor(self, spans: Any, deadline: Any, log: Any = None) -> Peer:
        own = super().predictor(spans, deadline, log)
        found = object.__new__(Peer)
        vars(found).update(vars(own) | {"engine": self.engine})
        return found


def with_peer(prepared: Prepared, engine: Callable[..., Any]) -> WithPeer:
    return WithPeer(**vars(prepared), engine=engine)


def mujoco_plane(part: Outline) -> Callable[[dict[str, float]], Any]:
    """MuJoCo in the plane: x, z and a turn about -y. The table is off the origin at first: one in its body's
    frame would stay there."""
    import mujoco

    corners = " ".join(f"{x} {side} {z}" for x, z in part.corners for side in (-0.05, 0.05))
    text = f"""<mujoco><option timestep="{STEP}" gravity="0 0 -{GRAVITY}" cone="elliptic"/>
      <asset><mesh name="part" vertex="{corners}"/></asset>
      <worldbody><geom name="table" type="plane" size="5 5 .1" pos="0 0 1"/>
      <body name="part"><inertial pos="0 0 0" mass="1" diaginertia="1 {part.inertia} 1"/>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 -1 0"/>
      <geom name="part" type="mesh" mesh="part" friction="1 0 0"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)

    def at(values: dict[str, float]) -> Any:
        _set_contact(model, values)
        model.geom_pos[0, 2] = values.get(part.table, 0.0)
        return partial(_ran, mujoco, model, data)

    return at


def mujoco_space(file: str) -> Callable[[dict[str, float]], Any]:
    """MuJoCo with the scene's own model of one free body: places, then the quaternion."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(file)
    data = mujoco.MjData(model)
    model.opt.cone, model.opt.timestep = mujoco.mjtCone.mjCONE_ELLIPTIC, STEP

    def at(values: dict[str, float]) -> Any:
        _set_contact(model, values)
        return partial(_ran, mujoco, model, data)

    return at


def _ran(mujoco: Any, model: Any, data: Any, start: Any, durations: Any) -> Iterator[Any]:
    """Places after each of the durations, from places and velocities."""
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = start[: model.nq], start[model.nq :]
    for duration in durations:
        _advance(mujoco, model, data, float(duration))
        yield data.qpos.copy()


def _set_contact(model: Any, values: dict[str, float]) -> None:
    model.geom_friction[:, 0] = values["friction"]
    model.geom_solref[:] = values["time_constant"], values["damping_ratio"]


def _advance(mujoco: Any, model: Any, data: Any, duration: float) -> None:
    """Equal steps no longer than STEP."""
    steps = max(1, math.ceil(duration / STEP - 1e-6)) if duration > 0.0 else 0
    if steps:
        model.opt.timestep = duration / steps
        mujoco.mj_step(model, data, steps)


def box2d(part: Outline) -> Callable[[dict[str, float]], Any]:
    """Box2D, lengths `LARGE` times as large."""
    from Box2D import b2EdgeShape, b2FixtureDef, b2PolygonShape, b2World

    def at(values: dict[str, float]) -> Any:
        def run(start: Any, durations: Any) -> Iterator[Any]:
            world = b2World(gravity=(0.0, -GRAVITY * LARGE), doSleep=False)
            level = LARGE * values.get(part.table, 0.0)
            table = world.CreateStaticBody()
            table.CreateFixture(
                b2FixtureDef(
                    shape=b2EdgeShape(vertices=[(-500.0, level), (500.0, level)]),
                    friction=values["friction"], restitution=values["bounce"],
                )
            )  # fmt: skip
            body = world.CreateDynamicBody(position=tuple(LARGE * start[:2]), angle=float(start[2]))
            shape = b2PolygonShape(vertices=[tuple(LARGE * corner) for corner in part.corners])
            body.CreateFixture(
                b2FixtureDef(
                    shape=shape, density=1.0, friction=values["friction"], restitution=values["bounce"]
                )
            )
            body.linearVelocity, body.angularVelocity = tuple(LARGE * start[3:5]), float(start[5])
            for duration in durations:
                steps = max(1, math.ceil(duration / STEP - 1e-6)) if duration > 0.0 else 0
                for _ in range(steps):
                    world.Step(float(duration) / steps, 10, 10)
                yield np.array([body.position[0] / LARGE, body.position[1] / LARGE, body.angle])

        return run

    return at


def pymunk(part: Outline) -> Callable[[dict[str, float]], Any]:
    """pymunk (Chipmunk)."""
    import pymunk as munk

    def at(values: dict[str, float]) -> Any:
        def run(start: Any, durations: Any) -> Iterator[Any]:
            space = munk.Space()
            space.gravity, space.iterations, space.collision_slop = (0.0, -GRAVITY), 20, 1e-5
            level = values.get(part.table, 0.0)
            table = munk.Segment(space.static_body, (-50.0, level - 1.0), (50.0, level - 1.0), 1.0)
            body = munk.Body(1.0, part.inertia)
            shape = munk.Poly(body, [tuple(map(float, corner)) for corner in part.corners])
            for each in (table, shape):
                each.friction, each.elasticity = math.sqrt(values["friction"]), math.sqrt(values["bounce"])
            space.add(table, body, shape)
            body.position, body.angle = tuple(map(float, start[:2])), float(start[2])
            body.velocity, body.angular_velocity = tuple(map(float, start[3:5])), float(start[5])
            for duration in durations:
                steps = max(1, math.ceil(duration / STEP - 1e-6)) if duration > 0.0 else 0
                for _ in range(steps):
                    space.step(float(duration) / steps)
                yield np.array([body.position.x, body.position.y, body.angle])

        return run

    return at


def with_parameters(file: Path) -> Any:
    """The scene of a file, with the parameters of the others as well."""
    data = yaml.safe_load(file.read_text("utf-8"))
    data["parameters"] |= PARAMETERS
    if "model" in data:
        data["model"]["file"] = str(file.parent / data["model"]["file"])
    return rw.load(data)
