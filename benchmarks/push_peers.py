"""MuJoCo, Box2D and pymunk on the measured push of benchmarks/real_push.py, in the place of a rung.

The rod hangs on the same spring and damper, which moves as measured. In MuJoCo the part stands on six feet on
a circle, whose radius and centre are those of the pressure. There the weight follows from statics, so the
centre of mass is put at the centre of the circle. Box2D and pymunk have no support; there a joint
resists sliding, with a force up to mu_s times the weight, and another one turning, with a torque up to that
force times the radius: both at once in full, so force and torque do not limit each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals

STEPS = 4
"""Steps between two frames."""
GRAVITY = 9.81
LARGE = 100.0
"""Box2D gets the scene so many times as large: its polygons have a skin of a hundredth."""
FOOT = 0.002
Engine = Callable[[dict[str, float]], Callable[[Any, Any], Iterator[Any]]]


class Pushed(NamedTuple):
    """What is pushed, and how: corners (6, 2), thickness and mass of the part, radius of the rod; places and
    speeds (k, 4) of the end of the arm, at equal intervals."""

    corners: Reals
    thick: float
    mass: float
    radius: float
    path: Reals
    period: float

    @property
    def inertia(self) -> float:
        """Of a uniform hexagon."""
        return 5.0 / 12.0 * self.mass * float(self.corners[0] @ self.corners[0])

    def led(self, values: dict[str, float]) -> Callable[[int, int, Any, Any], Reals]:
        """Force of the arm on the rod in a step of an interval between frames, at a place and velocity."""
        path = self.path.copy()
        path[:, :2] += values["lag"] * path[:, 2:]

        def force(frame: int, step: int, x: Any, v: Any) -> Reals:
            part = (step + 0.5) / STEPS
            aim = (1.0 - part) * path[frame] + part * path[frame + 1]
            found: Reals = values["arm"] * (aim[:2] - x) + values["arm_C"] * (aim[2:] - v)
            return found

        return force


def mujoco(pushed: Pushed) -> Engine:
    """MuJoCo in space. What is in the body's frame at first would stay there."""
    import mujoco as mj

    height = 0.5 * pushed.thick
    mesh = " ".join(f"{x} {y} {z}" for x, y in pushed.corners for z in (-height, height))
    feet = "".join(f'<geom name="foot{i}" type="sphere" size="{FOOT}" pos="0.01 0 0"/>' for i in range(6))
    pairs = "".join(f'<pair geom1="table" geom2="foot{i}" condim="3"/>' for i in range(6))
    tilt = pushed.mass * (0.5 * pushed.inertia / pushed.mass + pushed.thick**2 / 12.0)
    text = f"""<mujoco><option timestep="{pushed.period / STEPS}" gravity="0 0 -{GRAVITY}" cone="elliptic"/>
      <default><geom contype="0" conaffinity="0"/></default>
      <asset><mesh name="part" vertex="{mesh}"/></asset>
      <worldbody><geom name="table" type="plane" size="2 2 .1"/>
      <body name="rod" pos="0 0 {height + 2 * FOOT}"><joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 1 0"/><geom name="rod" type="cylinder" size="{pushed.radius} {height}"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
      <body name="part"><freejoint/>
      <inertial pos="0.01 0 0" mass="{pushed.mass}" diaginertia="{tilt} {tilt} {pushed.inertia}"/>
      <geom name="part" type="mesh" mesh="part"/>{feet}</body></worldbody>
      <contact>{pairs}<pair geom1="rod" geom2="part" condim="3"/></contact></mujoco>"""
    model = mj.MjModel.from_xml_string(text)
    data = mj.MjData(model)
    turns = np.arange(6) * math.pi / 3.0
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    under = [model.geom(f"foot{i}").id for i in range(6)]
    model.pair_solref[:] = 0.002, 1.0

    def at(values: dict[str, float]) -> Any:
        model.pair_friction[:6, :2], model.pair_friction[6, :2] = values["mu_s"], values["mu"]
        model.body_mass[model.body("rod").id] = values["rod"]
        centre = (values["centre_x"], values["centre_y"])
        model.geom_pos[under, :2] = values["press"] * circle + centre
        model.geom_pos[under, 2] = -height
        model.body_ipos[model.body("part").id] = *centre, 0.0
        force = pushed.led(values)

        def run(start: Any, durations: Any) -> Iterator[Any]:
            mj.mj_resetData(model, data)
            half = 0.5 * start[5]
            data.qpos[:2] = start[:2]
            data.qpos[2:] = start[3], start[4], height + FOOT, math.cos(half), 0.0, 0.0, math.sin(half)
            angle = float(start[5])
            for frame in range(len(durations)):
                for step in range(STEPS):
                    data.qfrc_applied[:2] = force(frame, step, data.qpos[:2], data.qvel[:2])
                    mj.mj_step(model, data)
                turned = 2.0 * math.atan2(data.qpos[8], data.qpos[5]) - angle
                angle += (turned + math.pi) % (2.0 * math.pi) - math.pi
                yield np.array([*data.qpos[:2], 0.0, *data.qpos[2:4], angle])

        return run

    return at


def box2d(pushed: Pushed) -> Engine:
    """Box2D, lengths `LARGE` times as large."""
    from Box2D import b2CircleShape, b2FixtureDef, b2MassData, b2PolygonShape, b2World

    def at(values: dict[str, float]) -> Any:
        force, most = pushed.led(values), values["mu_s"] * pushed.mass * GRAVITY
        centre = (LARGE * values["centre_x"], LARGE * values["centre_y"])

        def run(start: Any, durations: Any) -> Iterator[Any]:
            world = b2World(gravity=(0.0, 0.0), doSleep=False)
            rod = world.CreateDynamicBody(position=tuple(LARGE * start[:2]), fixedRotation=True)
            part = world.CreateDynamicBody(position=tuple(LARGE * start[3:5]), angle=float(start[5]))
            polygon = b2PolygonShape(vertices=[tuple(LARGE * corner) for corner in pushed.corners])
            for body, shape in ((rod, b2CircleShape(radius=LARGE * pushed.radius)), (part, polygon)):
                body.CreateFixture(b2FixtureDef(shape=shape, density=1.0, friction=values["mu"]))
            rod.massData = b2MassData(mass=values["rod"], I=0.0)
            part.massData = b2MassData(mass=pushed.mass, I=LARGE**2 * pushed.inertia)
            world.CreateFrictionJoint(
                bodyA=world.CreateStaticBody(), bodyB=part, localAnchorB=centre, maxForce=LARGE * most,
                maxTorque=LARGE**2 * values["press"] * most,
            )  # fmt: skip
            for frame in range(len(durations)):
                for step in range(STEPS):
                    x, v = (np.array([*own]) / LARGE for own in (rod.position, rod.linearVelocity))
                    rod.ApplyForce(tuple(LARGE * force(frame, step, x, v)), rod.worldCenter, True)
                    world.Step(pushed.period / STEPS, 20, 20)
                yield _places(rod.position, part.position, part.angle, LARGE)

        return run

    return at


def pymunk(pushed: Pushed) -> Engine:
    """pymunk (Chipmunk)."""
    import pymunk as munk

    def at(values: dict[str, float]) -> Any:
        force, most = pushed.led(values), values["mu_s"] * pushed.mass * GRAVITY

        def run(start: Any, durations: Any) -> Iterator[Any]:
            space = munk.Space()
            space.iterations, space.collision_slop = 40, 1e-6
            rod = munk.Body(values["rod"], math.inf)
            part = munk.Body(pushed.mass, pushed.inertia)
            rod.position, part.position = tuple(map(float, start[:2])), tuple(map(float, start[3:5]))
            part.angle = float(start[5])
            corners = [tuple(map(float, corner)) for corner in pushed.corners]
            shapes = munk.Circle(rod, pushed.radius), munk.Poly(part, corners)
            for shape in shapes:
                shape.friction, shape.elasticity = math.sqrt(values["mu"]), 0.0
            centre = (values["centre_x"], values["centre_y"])
            slides = munk.PivotJoint(space.static_body, part, (0.0, 0.0), centre)
            turns = munk.GearJoint(space.static_body, part, 0.0, 1.0)
            slides.max_force, turns.max_force = most, values["press"] * most
            slides.max_bias = turns.max_bias = 0.0
            space.add(rod, part, *shapes, slides, turns)
            for frame in range(len(durations)):
                for step in range(STEPS):
                    acts = force(frame, step, np.array(rod.position), np.array(rod.velocity))
                    rod.apply_force_at_world_point(tuple(map(float, acts)), rod.position)
                    space.step(pushed.period / STEPS)
                yield _places(rod.position, part.position, part.angle, 1.0)

        return run

    return at


def _places(rod: Any, part: Any, angle: float, scale: float) -> Reals:
    """Coordinates of the scene."""
    return np.array([rod[0] / scale, rod[1] / scale, 0.0, part[0] / scale, part[1] / scale, angle])
