"""Chains of bodies without momentum: what dampers, springs and servos hold moves or rests, whatever else
moves fast; what nothing holds is unsupported, with a proof."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import world
from .rungs import QUASISTATIC, named

FREE, DAMPED, SPRUNG, BOTH, SERVO = range(5)


def _chain(rng: np.random.Generator) -> tuple[str, str, list[int]]:
    """One to four bodies on hinges and slides under gravity, their servos, and what holds each joint."""
    kinds = rng.integers(0, 5, rng.integers(1, 5)).tolist()
    bodies, servos = "", ""
    for k, held in enumerate(kinds):
        slides = rng.random() < 1.0 / 3.0
        axis = rng.choice(["0 1 0", "1 0 0", "0 0 1" if slides else ".6 .8 0"])
        law = f'damping="{10.0 ** rng.uniform(-2, 1)}" ' if held in (DAMPED, BOTH) else ""
        law += f'stiffness="{10.0 ** rng.uniform(0, 2.5)}"' if held in (SPRUNG, BOTH) else ""
        if held == SERVO:
            most, gain, damp = 10.0 ** rng.uniform([-1, 1, -1], [2, 3, 1])
            servos += f'<position joint="j{k}" kp="{gain}" kv="{damp}" forcerange="-{most} {most}"/>'
        bodies += (
            f'<body name="b{k}" pos="{".3 0 0" if k else "0 0 3"}">'
            f'<joint name="j{k}" type="{"slide" if slides else "hinge"}" axis="{axis}" {law}/>'
            f'<geom type="capsule" fromto="0 0 0 .3 0 {rng.uniform(-0.1, 0.1)}" size=".03"'
            f' mass="{10.0 ** rng.uniform(-1, 1)}" contype="0" conaffinity="0"/>'
        )
    return bodies + "</body>" * len(kinds), f"<actuator>{servos}</actuator>" if servos else "", kinds


@pytest.mark.few(24)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", range(60))
def test_chains_move_rest_or_are_proved_unsupported(make: Make, seed: int, rung: Rung) -> None:
    rng = np.random.default_rng(seed)
    bodies, servos, kinds = _chain(rng)
    scene = make(world(bodies, after=servos), step=10.0 ** rng.uniform(-3, -2))
    simulation = SpaceSimulation(scene, rung, duration=0.1)
    simulation.steps_taken(2000)
    stepper = simulation.stepper
    assert stepper is not None and simulation.outcome in (Code.TIMEOUT, Code.UNSUPPORTED, Code.MODEL_INVALID)
    assert stepper.residual <= 1e-8
    if simulation.outcome == Code.UNSUPPORTED:
        assert simulation.certificate is not None and (FREE in kinds or SERVO in kinds)
    if simulation.outcome == Code.TIMEOUT:
        assert simulation.time == pytest.approx(0.1)


@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", range(6))
def test_damped_pendulums_fall_at_load_over_damping(make: Make, seed: int, rung: Rung) -> None:
    """A double pendulum: its first step is that of C v = load; with one joint free it is unsupported."""
    rng = np.random.default_rng(seed)
    damping, masses = 10.0 ** rng.uniform(0, 2, 2), 10.0 ** rng.uniform(-1, 1, 2)
    for first, outcome in ((damping[0], Code.RUNNING), (0.0, Code.UNSUPPORTED)):
        bodies = ""
        for k, c in enumerate((first, damping[1])):
            bodies += (
                f'<body pos="{0.5 * k} 0 0"><joint axis="0 1 0" damping="{c}"/>'
                f'<geom type="capsule" fromto="0 0 0 .5 0 0" size=".02" mass="{masses[k]}" contype="0"'
                ' conaffinity="0"/>'
            )
        simulation = SpaceSimulation(make(world(bodies + "</body></body>")), rung, step=1e-6, duration=1.0)
        simulation.steps_taken(1)
        assert simulation.outcome == outcome
        if outcome == Code.RUNNING:
            torque = 9.81 * np.array([0.25 * masses[0] + 0.75 * masses[1], 0.25 * masses[1]])
            assert simulation.stepper is not None
            np.testing.assert_allclose(simulation.stepper.v, torque / damping, rtol=1e-6)
