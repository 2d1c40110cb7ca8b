"""Travel limits: each end of each joint and tendon keeps a slot of its own, whatever its coefficients."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation

from .conftest import Make
from .measure import NO_GRAVITY, q, v, world
from .rungs import RIGID, named

COEFFICIENTS = [(1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (2.0, -3.0), (-0.5, 0.5), (1.0, -1.0, 2.0, -2.0)]


def _tendon(make: Make, coefficients: tuple[float, ...], span: float, speed: float) -> SpaceScene:
    """Masses on slides along one line, whose places times these coefficients stay within the span."""
    bodies = "".join(
        f'<body name="b{k}" pos="{k} 0 0"><joint name="j{k}" type="slide"/><geom size=".1" mass="1"/></body>'
        for k in range(len(coefficients))
    )
    joints = "".join(f'<joint joint="j{k}" coef="{x}"/>' for k, x in enumerate(coefficients))
    fixed = f'<tendon><fixed name="t" limited="true" range="-{span} {span}">{joints}</fixed></tendon>'
    return make(
        world(bodies, before=NO_GRAVITY, after=fixed), start={"velocities": {"b0.j0": speed}}, duration=0.3
    )


@pytest.mark.few(5)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_both_ends_of_a_tendon_keep_slots_of_their_own(make: Make, coefficients: tuple[float, ...]) -> None:
    simulation = SpaceSimulation(_tendon(make, coefficients, 2e-5, 0.0), rw.DYNAMIC_RIGID)
    stepper, space = simulation.stepper, simulation.space
    assert stepper is not None
    simulation.steps_taken(1)
    assert stepper.contacts == 2, "both ends are near"
    slots = stepper.scratch.slots[:2].tolist()
    assert len(set(slots)) == 2
    # The lower end resists a length that falls, and has the same slot when it alone is near.
    rows = stepper.terms.rows[: 2 * space.size.directions : space.size.directions] @ np.array(coefficients)
    lower = slots[int(np.argmax(rows))]
    alone = SpaceSimulation(
        _tendon(make, coefficients, 0.5, -np.sign(coefficients[0]) * 4.0), rw.DYNAMIC_RIGID
    )
    met = set()
    while alone.advance():
        pass
    assert alone.stepper is not None
    met = {int(s) for s in alone.stepper.scratch.slots[: alone.stepper.contacts]}
    assert met <= {lower}


@pytest.mark.few(3)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
@pytest.mark.parametrize("rung", RIGID[-1:], ids=named)
def test_an_end_of_a_tendon_stops_the_pull_that_it_should(
    make: Make, coefficients: tuple[float, ...], rung: Rung
) -> None:
    """Momentum is shared as by an inelastic impact along the coefficients, the same towards either end."""
    after = []
    for sign in (1.0, -1.0):
        found = rw.simulate(_tendon(make, coefficients, 0.05, sign), rung)
        after.append(sign * v(found))
        pull = np.array(coefficients)
        expected = np.eye(len(pull))[0]
        expected -= pull * (pull @ expected) / (pull @ pull)
        assert sign * v(found) == pytest.approx(expected, abs=1e-9)
        assert abs(abs(q(found) @ pull) - 0.05) < 1e-4
    assert np.allclose(after[0], after[1], atol=1e-12)


def test_what_turns_in_space_has_one_end_whatever_its_axis(make: Make) -> None:
    joint = '<joint name="j" type="ball" range="0 30" limited="true"/>'
    model = world(f'<body name="p">{joint}<geom type="box" size=".1 .1 .1"/></body>', before=NO_GRAVITY)
    slots = set()
    for axis in np.random.default_rng(2).normal(size=(6, 3)):
        spin = dict(
            zip(("p.j_rx", "p.j_ry", "p.j_rz"), (4.0 * axis / np.linalg.norm(axis)).tolist(), strict=True)
        )
        scene = make(model, start={"velocities": spin}, duration=0.3)
        simulation = SpaceSimulation(scene, rw.DYNAMIC_RIGID)
        while simulation.advance():
            pass
        stepper = simulation.stepper
        assert stepper is not None and stepper.contacts == 1
        slots.add(int(stepper.scratch.slots[0]))
    assert len(slots) == 1
