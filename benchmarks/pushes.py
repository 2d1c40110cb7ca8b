"""Straight, symmetric pushes per second and core, on each rung and in other engines.

    python benchmarks/pushes.py [--runs N] [--json]

A rod pushes a box of 0.1 m that lies on a table, in the middle of its face, 0.1 m along x: where the box ends
does not depend on the law of the support, on friction or on mass, which are drawn for each run. The box ends
at x = 0.1 m (on dynamic rungs it coasts less than a tenth of a millimetre). Each engine takes equal steps,
the fewest of `STEPS` with which every run ends within a millimetre (places, and angle times 0.05 m), and runs
on one core. rungwise makes its runs by `rollout`, with one thread; the others as their Python users would:
Box2D and pymunk step by step, with friction joints between box and ground, MuJoCo by `mujoco.rollout`, which
makes its runs in compiled code, with dry friction of the box's joints and a rod of great mass that coasts.
The engines take turns; `relative` compares medians in the same run."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from statistics import median

import numpy as np
from numpy.typing import NDArray

import rungwise as rw

Poses = NDArray[np.float64]
SIZE, WAY, SPEED, ROD, LEVER = 0.1, 0.1, 0.02, 0.005, 0.05
DURATION = WAY / SPEED
ALLOWED = 1e-3
STEPS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
G = 9.81
REPEATS = 5


@dataclass(frozen=True)
class Draw:
    """Friction at the rod and at the table, and mass, (m,) each."""

    mu: Poses
    mu_s: Poses
    mass: Poses


@dataclass
class Row:
    """An engine: steps in a run, greatest error (m), runs per second, and that over the first engine's."""

    engine: str
    steps: int
    error: float
    runs_per_s: float
    relative: float


Engine = Callable[[Draw, int], Poses]
"""Poses (m, 3) of the box at the end of runs of so many steps."""


def drawn(count: int) -> Draw:
    rng = np.random.default_rng(0)
    return Draw(rng.uniform(0.1, 0.5, count), rng.uniform(0.2, 0.5, count), rng.uniform(0.5, 2.0, count))


def rungwise(scene: rw.Scene, rung: rw.Rung, draw: Draw, steps: int) -> Poses:
    parameters = {"offset": 0.0, "mu": draw.mu, "mu_s": draw.mu_s, "mass": draw.mass}
    found = rw.rollout(
        scene, rung, durations=DURATION, parameters=parameters, step=DURATION / steps, tol=None, keep=False,
        threads=1,
    )  # fmt: skip
    return found.final[:, -3:]


def box2d(draw: Draw, steps: int) -> Poses:
    import Box2D

    # Lengths in decimetres: the engine's slop is 0.005 of its units, and boxes should be of size 1.
    unit, poses = 10.0, np.zeros((len(draw.mu), 3))
    for i, (mu, mu_s, mass) in enumerate(zip(draw.mu, draw.mu_s, draw.mass, strict=True)):
        world = Box2D.b2World(gravity=(0, 0), doSleep=False)
        ground, side = world.CreateStaticBody(), unit * SIZE
        box = world.CreateDynamicBody()
        box.CreatePolygonFixture(box=(side / 2, side / 2), density=mass / side**2, friction=mu, restitution=0)
        load = mu_s * mass * G * unit
        world.CreateFrictionJoint(
            bodyA=ground, bodyB=box, anchor=(0, 0), maxForce=load, maxTorque=0.3826 * side * load
        )
        rod = world.CreateKinematicBody(
            position=(-side / 2 - unit * ROD, 0), linearVelocity=(unit * SPEED, 0)
        )
        rod.CreateCircleFixture(radius=unit * ROD, friction=mu, restitution=0)
        for _ in range(steps):
            world.Step(DURATION / steps, 10, 10)
        poses[i] = box.position[0] / unit, box.position[1] / unit, box.angle
    return poses


def pymunk(draw: Draw, steps: int) -> Poses:
    import pymunk

    poses = np.zeros((len(draw.mu), 3))
    for i, (mu, mu_s, mass) in enumerate(zip(draw.mu, draw.mu_s, draw.mass, strict=True)):
        space = pymunk.Space()
        box = pymunk.Body(mass, pymunk.moment_for_box(mass, (SIZE, SIZE)))
        face = pymunk.Poly.create_box(box, (SIZE, SIZE))
        rod = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        rod.position, rod.velocity = (-SIZE / 2 - ROD, 0.0), (SPEED, 0.0)
        tip = pymunk.Circle(rod, ROD)
        face.friction = tip.friction = math.sqrt(mu)
        load = mu_s * mass * G
        slides = pymunk.PivotJoint(space.static_body, box, (0, 0), (0, 0))
        turns = pymunk.GearJoint(space.static_body, box, 0.0, 1.0)
        slides.max_bias = turns.max_bias = 0.0
        slides.max_force, turns.max_force = load, 0.3826 * SIZE * load
        space.add(box, face, rod, tip, slides, turns)
        for _ in range(steps):
            space.step(DURATION / steps)
        poses[i] = *box.position, box.angle
    return poses


def mujoco(draw: Draw, steps: int) -> Poses:
    import mujoco
    from mujoco import rollout

    base = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{DURATION / steps}" gravity="0 0 0" cone="elliptic"/>
      <default><geom solref="{2 * DURATION / steps} 1" condim="3"/></default>
      <worldbody><body name="rod" pos="{-SIZE / 2 - ROD} 0 0"><joint type="slide" axis="1 0 0"/>
      <geom type="cylinder" size="{ROD} .05" mass="1e6"/></body>
      <body name="box"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <joint type="hinge" axis="0 0 1"/><geom type="box" size="{SIZE / 2} {SIZE / 2} .05" mass="1"/></body>
      </worldbody></mujoco>""")
    models, data = [], mujoco.MjData(base)
    for mu, mu_s, mass in zip(draw.mu, draw.mu_s, draw.mass, strict=True):
        model, load = base.__copy__(), mu_s * mass * G
        model.geom_friction[:, 0] = mu
        model.body_mass[2], model.body_inertia[2] = mass, base.body_inertia[2] * mass
        model.dof_frictionloss[1:] = load, load, 0.3826 * SIZE * load
        models.append(model)
    size = mujoco.mj_stateSize(base, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros(size)
    data.qvel[0] = SPEED
    mujoco.mj_getState(base, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states, _ = rollout.rollout(models, data, np.tile(start, (len(models), 1)), nstep=steps)
    return np.asarray(states[:, -1, 2:5])


def engines() -> dict[str, Engine]:
    """The rungs, and the engines that are installed."""
    scene = rw.load("push")
    found: dict[str, Engine] = {rung.name: partial(rungwise, scene, rung) for rung in rw.LADDER if rung.moves}
    for module, name, engine in (
        ("Box2D", "Box2D", box2d), ("pymunk", "pymunk", pymunk), ("mujoco", "MuJoCo", mujoco),
    ):  # fmt: skip
        if find_spec(module) is not None:
            found[f"{name} {version(module)}"] = engine
    return found


def worst(poses: Poses) -> float:
    """The greatest distance (m) from where the box belongs."""
    off = np.abs(poses - np.array([WAY, 0.0, 0.0])) * np.array([1.0, 1.0, LEVER])
    return float(off.max())


def measured(count: int, repeats: int) -> list[Row]:
    """Steps, errors and speeds of all engines, which take turns."""
    few, draw, chosen = drawn(min(count, 20)), drawn(count), dict[str, int]()
    for name, engine in engines().items():
        chosen[name] = next((n for n in STEPS if worst(engine(few, n)) <= ALLOWED), STEPS[-1])
    took: dict[str, list[float]] = {name: [] for name in chosen}
    errors = dict[str, float]()
    for _ in range(repeats):
        for name, engine in engines().items():
            began = time.perf_counter()
            poses = engine(draw, chosen[name])
            took[name].append(time.perf_counter() - began)
            errors[name] = worst(poses)
    speeds = {name: count / median(many) for name, many in took.items()}
    first = next(iter(speeds.values()))
    return [Row(name, chosen[name], errors[name], speed, speed / first) for name, speed in speeds.items()]


def main(arguments: Sequence[str] | None = None, repeats: int = REPEATS) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=500, help="runs of each engine")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    rows = measured(given.runs, repeats)
    if given.json:
        print(json.dumps([asdict(row) for row in rows]))
        return 0
    print(f"{'engine':24}{'steps':>7}{'error, m':>12}{'runs/s':>10}{'relative':>10}")
    for row in rows:
        print(f"{row.engine:24}{row.steps:7}{row.error:12.1e}{row.runs_per_s:10.0f}{row.relative:10.3f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
