"""Jams by friction in space, bracketed about the friction angle, with certificates that the checker takes."""

from __future__ import annotations

from math import atan, cos, sin

import numpy as np
import pytest

import rungwise as rw
from rungwise.contact.judge import Certificate
from rungwise.contact.judge.certificate import check
from rungwise.contact.step import trim
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import Array, run, world
from .rungs import RIGID, named

R = 0.1


def turned(axis: Array, angle: float) -> Array:
    """The matrix of a turn (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + sin(angle) * cross + (1.0 - cos(angle)) * cross @ cross)


def squeezed(make: Make, angle: float, mu: float, seed: int, condim: int = 3) -> SpaceScene:
    """A ball between two plates, one fixed, one that comes nearer; their faces enclose the angle. All turned
    at random."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    turn = turned(axis / np.linalg.norm(axis), rng.uniform(0.0, 3.0))
    frames = [turn, turn @ turned(np.array([0.0, 1.0, 0.0]), angle)]
    plates = []
    for name, frame, side in (("low", frames[0], -1.0), ("high", frames[1], 1.0)):
        centre, both = side * (R + 0.01) * frame[:, 2], frame[:, :2].T.ravel()
        place = " ".join(f"{x:.17g}" for x in centre)
        axes = " ".join(f"{x:.17g}" for x in both)
        joint = "" if side < 0 else '<joint name="s" type="slide" axis="0 0 1"/>'
        plates.append(
            f'<body name="{name}" pos="{place}" xyaxes="{axes}">{joint}'
            f'<geom type="box" size="0.05 0.05 0.01" mass="1" condim="{condim}"/></body>'
        )
    ball = f'<body name="ball"><freejoint/><geom size="{R}" mass="1" condim="{condim}"/></body>'
    return make(
        world(*plates, ball, before='<option gravity="0 0 0"/>'),
        speeds={"high.s": -0.1},
        contacts=[{"between": ["*", "*"], "friction": mu}],
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", RIGID, ids=named)
@pytest.mark.parametrize(("mu", "seed"), [(0.1, 1), (0.3, 2), (0.8, 3)])
def test_a_ball_jams_between_plates_within_twice_the_friction_angle(
    make: Make, rung: Rung, mu: float, seed: int
) -> None:
    both = [squeezed(make, 2.0 * atan(mu) * part, mu, seed) for part in (0.999, 1.001)]
    jam = rw.simulate(both[0], rung, duration=0.01, step=1e-3)
    assert jam.outcome.name == "jammed"
    assert jam.certificate is not None and jam.certificate.kind == "frictional"
    assert run(both[1], rung, duration=0.01, step=1e-3).outcome.name == "timeout"


def test_the_checker_takes_no_proof_of_another_problem(make: Make) -> None:
    simulation = SpaceSimulation(squeezed(make, atan(0.3), 0.3, 4), rw.DYNAMIC_RIGID, duration=0.01)
    while simulation.advance():
        pass
    stepper, found = simulation.stepper, simulation.certificate
    assert stepper is not None and found is not None
    problem = trim(
        stepper.problem, int(stepper.clock["free"]), stepper.contacts, int(stepper.clock["limited"])
    )
    assert check(problem, found)
    assert not check(problem, Certificate(found.kind, found.vectors[:-1], found.modes[:-1]))
    assert not check(problem, Certificate(found.kind, tuple(-p for p in found.vectors), found.modes))
    problem.mu[:] = 0.1
    assert not check(problem, found)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_a_ball_among_plates_moves_on_or_is_proved_to_jam(make: Make, seed: int) -> None:
    """Three or four plates touch it anywhere, and one pushes."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(3 + seed % 2, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    plates = []
    for i, normal in enumerate(normals):
        first = np.cross(normal, [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        axes = " ".join(f"{x:.17g}" for x in (*first, *np.cross(normal, first)))
        place = " ".join(f"{x:.17g}" for x in -(R + 0.002) * normal)
        joint = '<joint name="s" type="slide" axis="0 0 1"/>' if i == 0 else ""
        plates.append(
            f'<body name="p{i}" pos="{place}" xyaxes="{axes}">{joint}'
            '<geom type="box" size="0.01 0.01 0.002" mass="1"/></body>'
        )
    ball = f'<body name="ball"><freejoint/><geom size="{R}" mass="1"/></body>'
    scene = make(
        world(*plates, ball, before='<option gravity="0 0 0"/>'),
        speeds={"p0.s": 0.1},
        contacts=[{"between": ["*", "*"], "friction": float(rng.uniform(0.1, 0.8))}],
    )
    found = rw.simulate(scene, rw.QUASISTATIC_RIGID, duration=5e-3, step=1e-3)
    assert found.outcome.name in ("timeout", "jammed")
    assert (found.outcome.name == "jammed") == (found.certificate is not None)


@pytest.mark.parametrize("condim", [4, 6])
def test_with_torsion_a_jam_by_friction_has_no_proof(make: Make, condim: int) -> None:
    for part, outcome in ((0.9, "not_converged"), (1.1, "timeout")):
        scene = squeezed(make, 2.0 * atan(0.3) * part, 0.3, 5, condim)
        assert rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.01, step=1e-3).outcome.name == outcome
