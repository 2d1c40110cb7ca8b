"""Joined bodies in steps in which they turn far: the energy that they gain is told, to the last digit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.system.spatial.turning import PART

from .conftest import Make
from .measure import FLOOR, run, world
from .rungs import DYNAMIC, named


def _arm(rng: np.random.Generator) -> str:
    """One to four bodies on hinges, slides and balls."""
    bodies, long, count = "", 0.0, int(rng.integers(1, 5))
    for _k in range(count):
        kind = rng.choice(["hinge", "slide", "ball"], p=[0.8, 0.1, 0.1])
        axis = "" if kind == "ball" else f'axis="{rng.choice(["0 1 0", "0 0 1", "1 0 0", ".6 .8 0"])}"'
        mass, before, long = 10.0 ** rng.uniform(-1, 1), long, rng.uniform(0.1, 0.6)
        bodies += (
            f'<body pos="{before} 0 0"><joint type="{kind}" {axis}/><geom type="capsule" size=".03"'
            f' fromto="0 0 0 {long} 0 {rng.uniform(-0.1, 0.1)}" mass="{mass}" contype="0" conaffinity="0"/>'
        )
    return bodies + "</body>" * count


def _steps(simulation: SpaceSimulation) -> tuple[float, float]:
    """The energy gained in a run, beside the greatest that there was, and how exactly the run knows it."""
    stepper, space, turning = simulation.stepper, simulation.space, simulation.space.turning.numbers[0]
    assert stepper is not None
    kinetic, height, still = list[float](), list[float](), np.zeros(len(stepper.v))

    def look() -> None:
        height.append(space.energy(stepper.q, still))
        kinetic.append(stepper.rung.inertia * (space.energy(stepper.q, stepper.v) - height[-1]))

    look()
    while simulation.outcome == Code.RUNNING and np.isfinite(kinetic[-1]):
        simulation.steps_taken(1)
        look()
    if not np.isfinite(kinetic[-1]):
        return np.inf, 0.0
    gained, size = np.add(kinetic, height), max(map(abs, kinetic)) + max(height) - min(height)
    gained -= gained[0]
    return gained.max() / size, abs(turning.gained - gained[-1]) / size


@pytest.mark.few(15)
@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize(
    "rung", [*DYNAMIC, rw.DYNAMIC_RIGID.with_inertia(0.5)], ids=["rigid", "compliant", "half"]
)
@pytest.mark.parametrize("seed", range(30))
def test_energy_that_arms_gain_is_told(
    make: Make, seed: int, rung: Rung, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes of what runs away into a file
    rng = np.random.default_rng(seed)
    step, gravity = 10.0 ** rng.uniform(-3.0, -0.7), rng.choice(["0 0 0", "0 0 -9.81"])
    scene = make(world(_arm(rng), before=f'<option gravity="{gravity}"/>'))
    simulation = SpaceSimulation(scene, rung, step=step, duration=40 * step)
    assert simulation.stepper is not None
    simulation.stepper.v[:] = rng.normal(size=len(simulation.stepper.v)) * 10.0 ** rng.uniform(0.0, 2.0)
    simulation.begins(simulation.stepper)
    gained, error = _steps(simulation)
    assert error < 1e-6
    told = any("turn so far" in note for note in simulation.result().notes)
    assert told or not gained > PART


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_arms_that_are_followed_gain_nothing_worth_telling(make: Make, rung: Rung) -> None:
    """A double pendulum that swings, an arm that a servo lifts slowly, and a ball that tumbles far."""
    arm = (
        '<body pos="0 0 {}"><joint name="{}" axis="0 1 0"/>'
        '<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.4" contype="0" conaffinity="0"/>'
    )
    swings = arm.format(2, "a") + arm.format(-0.4, "b") + "</body></body>"
    start = {"velocities": {"body1.a": 1.0, "body2.b": -2.0}}
    assert run(make(world(swings), start=start, duration=1.0), rung, step=1e-3).notes == ()
    servo = '<actuator><position name="up" joint="a" kp="500" kv="50"/></actuator>'
    lifted = make(
        world(arm.format(2, "a") + "</body>", after=servo), controls={"up": "-.2 * t"}, duration=2.0
    )
    assert run(lifted, rung, step=1e-2).notes == ()
    ball = '<body pos="0 0 3"><freejoint name="f"/><geom type="box" size=".1 .2 .3"/></body>'
    tumbles = make(world(FLOOR, ball), start={"velocities": {"body1.rx": 30.0}}, duration=0.3)
    assert run(tumbles, rung, step=0.1).notes == ()


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("speed", [1e2, 1e3, 1e5])
def test_joined_bodies_that_turn_far_in_each_step_end_and_are_told(
    make: Make, rung: Rung, speed: float
) -> None:
    """By ten to ten thousand radians: where they are is not known, and the note tells the energy that they
    gained, or lost."""
    arm = (
        '<body pos="{} 0 0"><joint name="{}" axis="0 0 1"/><geom type="box" size=".3 .03 .03" pos=".3 0 0"/>'
    )
    bodies = arm.format(0, "a") + arm.format(0.6, "b") + "</body></body>"
    before = '<option gravity="0 0 0"/>'
    scene = make(world(bodies, before=before), start={"velocities": {"body1.a": speed}})
    simulation = SpaceSimulation(scene, rung, step=0.1, duration=100.0)
    stepper = simulation.stepper
    assert stepper is not None
    energies = [simulation.space.energy(stepper.q, stepper.v)]
    while simulation.steps_taken(1):
        energies.append(simulation.space.energy(stepper.q, stepper.v))
    found, changes = simulation.result(), np.array(energies) - energies[0]
    assert stepper.attempts < 2000 and np.isfinite(stepper.v).all()
    (note,) = (note for note in found.notes if "turn so far" in note)
    what, told = re.search(r"they (gained|lost) up to (\S+) of energy", note).groups()  # type: ignore[union-attr]
    most = changes[np.argmax(np.abs(changes))]
    assert what == ("gained" if most > 0.0 else "lost")
    assert float(told) == pytest.approx(abs(most), rel=1e-2)
