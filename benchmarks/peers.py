"""The same two tasks in other engines, as their own users would write them. Each is imported when first used.

Two fingers: a triangle (half-base and height 1, mass 1) that slides along x, and two discs of radius `TIP`
that come down along x = -0.5 and 0.5 at prescribed speeds. The fingers start so much higher that their discs
touch the faces where points would. Block: a unit cube, or square, on a slope, under gravity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

TIP = 0.01
HEIGHT = 2.0 + TIP * math.sqrt(2.0)
"""Height at which the centre of a finger starts."""
OFFSET = 0.5
MU = 0.5
G = 9.81
CAUGHT = 2e-3
"""Gap below which a finger counts as closed: the slop of engines that let bodies overlap or float."""


@dataclass(frozen=True)
class Slope:
    """What a block did on a slope: distance along it, and the most that it rose off it."""

    distance: float
    lift: float


@dataclass(frozen=True)
class Peer:
    """One engine: name with version, whether it catches at a ratio (and in how many steps), its block, and
    its own loop, so many steps of the fingers in which nobody reads or sets anything."""

    name: str
    catch: Callable[[float, float], tuple[bool, int]]
    block: Callable[[float, float, float, float], Slope] | None
    bare: Callable[[float, float, int], None]


def is_caught(x1: float, x2: float, x3: float) -> bool | None:
    """Verdict on finger travels and the part's place: True, False, or None while it is open."""
    if abs(x3) > OFFSET:
        return False
    left = (2.0 - x1) - (1.0 - abs(-OFFSET - x3))
    right = (2.0 - x2) - (1.0 - abs(OFFSET - x3))
    if max(left, right) <= CAUGHT:
        return True
    return False if x1 >= 2.0 and x2 >= 2.0 else None


def peers() -> list[Peer]:
    """Those engines that are installed."""
    known = {
        "mujoco": ("MuJoCo", mujoco_catch, mujoco_block, mujoco_bare),
        "Box2D": ("Box2D", box2d_catch, None, box2d_bare),
        "pymunk": ("pymunk", pymunk_catch, None, pymunk_bare),
    }
    return [
        Peer(f"{name} {version(module)}", *rest)
        for module, (name, *rest) in known.items()
        if find_spec(module) is not None
    ]


def mujoco_fingers(h: float) -> tuple[Any, Any]:
    """Elliptic cones, the stiffest contact that the step allows (time constant 2 h), heavy fingers."""
    import mujoco

    finger = """<body name="{0}" pos="{1} 0 {2}"><joint name="{0}" type="slide" axis="0 0 -1"/>
      <geom type="sphere" size="{3}" mass="1e6"/></body>"""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{h}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-12"
       iterations="200"/>
      <default><geom friction="{MU}" condim="3" solref="{2 * h} 1" solimp="0.99 0.999 0.0001"/></default>
      <asset><mesh name="prism" vertex="-1 -.2 0  1 -.2 0  0 -.2 1  -1 .2 0  1 .2 0  0 .2 1"/></asset>
      <worldbody>{finger.format("left", -OFFSET, HEIGHT, TIP)}{finger.format("right", OFFSET, HEIGHT, TIP)}
      <body name="part"><joint name="part" type="slide" axis="1 0 0"/>
      <geom type="mesh" mesh="prism" mass="1"/></body></worldbody></mujoco>""")
    return model, mujoco.MjData(model)


def mujoco_bare(ratio: float, h: float, steps: int) -> None:
    import mujoco

    model, data = mujoco_fingers(h)
    data.qvel[:2] = 1.0, ratio
    mujoco.mj_step(model, data, nstep=steps)


def mujoco_catch(ratio: float, h: float) -> tuple[bool, int]:
    """Fingers are placed before each step."""
    import mujoco

    model, data = mujoco_fingers(h)
    speeds = (1.0, ratio)
    steps, verdict = 0, None
    while verdict is None:
        for k in range(2):
            data.qpos[k] = min(speeds[k] * data.time, 2.0)
            data.qvel[k] = speeds[k] if data.qpos[k] < 2.0 else 0.0
        mujoco.mj_step(model, data)
        steps += 1
        verdict = is_caught(*(float(q) for q in data.qpos))
    return verdict, steps


def mujoco_block(angle: float, mu: float, time: float, h: float) -> Slope:
    """A cube that starts in touch with a tilted plane (gravity is tilted instead)."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{h}" gravity="{G * math.sin(angle)} 0 {-G * math.cos(angle)}" cone="elliptic"/>
      <default><geom friction="{mu}"/></default>
      <worldbody><geom type="plane" size="0 0 1"/><body name="block" pos="0 0 .5"><freejoint/>
      <geom type="box" size=".5 .5 .5" mass="1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    lift = 0.0
    for _ in range(round(time / h)):
        mujoco.mj_step(model, data)
        lift = max(lift, float(data.qpos[2]) - 0.5)
    return Slope(float(data.qpos[0]), lift)


def box2d_fingers(ratio: float) -> tuple[Any, Any, list[Any]]:
    """Kinematic fingers, a prismatic joint for the part."""
    import Box2D

    world = Box2D.b2World(gravity=(0, 0), doSleep=False)
    ground = world.CreateStaticBody()
    triangle = Box2D.b2PolygonShape(vertices=[(-1, 0), (1, 0), (0, 1)])
    part = world.CreateDynamicBody()
    part.CreateFixture(shape=triangle, density=1.0, friction=MU, restitution=0.0)
    world.CreatePrismaticJoint(bodyA=ground, bodyB=part, anchor=(0, 0), axis=(1, 0))
    fingers = []
    for x, speed in ((-OFFSET, 1.0), (OFFSET, ratio)):
        finger = world.CreateKinematicBody(position=(x, HEIGHT), linearVelocity=(0, -speed))
        finger.CreateCircleFixture(radius=TIP, friction=MU, restitution=0.0)
        fingers.append(finger)
    return world, part, fingers


def box2d_bare(ratio: float, h: float, steps: int) -> None:
    world, _, _ = box2d_fingers(ratio)
    for _ in range(steps):
        world.Step(h, 10, 10)


def box2d_catch(ratio: float, h: float) -> tuple[bool, int]:
    world, part, fingers = box2d_fingers(ratio)
    steps, verdict = 0, None
    while verdict is None:
        world.Step(h, 10, 10)
        steps += 1
        travels = [HEIGHT - finger.position[1] for finger in fingers]
        for finger, travel in zip(fingers, travels, strict=True):
            if travel >= 2.0:
                finger.linearVelocity = (0, 0)
        # Box2D's polygons have a skin of 0.01, with which they keep apart.
        verdict = is_caught(
            travels[0] + 0.01 * math.sqrt(2.0), travels[1] + 0.01 * math.sqrt(2.0), part.position[0]
        )
    return verdict, steps


def pymunk_fingers(ratio: float) -> tuple[Any, Any, list[Any]]:
    """Kinematic fingers, a part that neither turns nor leaves its line."""
    import pymunk

    space = pymunk.Space()
    space.iterations = 30
    space.collision_slop = 1e-4
    part = pymunk.Body(1.0, math.inf)
    triangle = pymunk.Poly(part, [(-1, 0), (1, 0), (0, 1)])
    space.add(part, triangle)
    for x in (-0.5, 0.5):
        space.add(pymunk.GrooveJoint(space.static_body, part, (-9, 0), (9, 0), (x, 0)))
    fingers = []
    for x, speed in ((-OFFSET, 1.0), (OFFSET, ratio)):
        finger = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        finger.position, finger.velocity = (x, HEIGHT), (0, -speed)
        tip = pymunk.Circle(finger, TIP)
        tip.friction, triangle.friction = 1.0, MU
        space.add(finger, tip)
        fingers.append(finger)
    return space, part, fingers


def pymunk_bare(ratio: float, h: float, steps: int) -> None:
    space, _, _ = pymunk_fingers(ratio)
    for _ in range(steps):
        space.step(h)


def pymunk_catch(ratio: float, h: float) -> tuple[bool, int]:
    space, part, fingers = pymunk_fingers(ratio)
    steps, verdict = 0, None
    while verdict is None:
        space.step(h)
        steps += 1
        travels = [HEIGHT - finger.position.y for finger in fingers]
        for finger, travel in zip(fingers, travels, strict=True):
            if travel >= 2.0:
                finger.velocity = (0, 0)
        verdict = is_caught(travels[0], travels[1], part.position.x)
    return verdict, steps
