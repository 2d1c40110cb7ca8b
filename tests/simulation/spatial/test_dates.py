"""When conditions begin to hold: to a nominal step, however long steps are, and more exactly where a segment
ends by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, G, free, run, world
from .rungs import DYNAMIC, MOVING, named

STEP = 2e-3
DRIVEN = '<body name="p"><joint name="j" type="slide"/><geom size=".1" mass="1"/></body>'


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-3, 1e-1])
@pytest.mark.parametrize("at", [0.1234, 0.4, 0.777])
def test_a_condition_ends_a_run_of_long_steps_within_a_nominal_one(
    make: Make, rung: Rung, tol: float | None, at: float
) -> None:
    for name in ("goal", "unsafe", "doomed"):
        scene = make(
            world(DRIVEN, before=NO_GRAVITY), speeds={"p.j": 1.0}, step=STEP, **{name: f"p.j >= {at}"}
        )
        found = run(scene, rung, tol=tol)
        assert found.outcome.name == name
        assert at - 1e-9 <= found.time <= at + STEP + 1e-9
        assert found.final["p"]["j"] == pytest.approx(found.time, abs=1e-12)
    if tol is not None:
        assert found.steps < at / STEP, "steps are longer than nominal ones"


@pytest.mark.few(5)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-2])
def test_a_condition_that_holds_on_the_way_alone_is_seen(make: Make, rung: Rung, tol: float | None) -> None:
    scene = make(
        world(DRIVEN, before=NO_GRAVITY), speeds={"p.j": 1.0}, step=STEP, unsafe="p.j > 0.5 and p.j < 0.52"
    )
    found = run(scene, rung, tol=tol)
    assert found.outcome.name == "unsafe" and abs(found.time - 0.5) <= STEP + 1e-9


@pytest.mark.few(5)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("at", [0.0517, 0.2, 0.333])
def test_a_segment_ends_when_its_condition_begins_to_hold(
    make: Make, rung: Rung, tol: float | None, at: float
) -> None:
    scene = make(
        world(DRIVEN, before=NO_GRAVITY), parameters={"u": {"default": 1.0}}, inputs=["u"],
        speeds={"p.j": "u"}, step=STEP, duration=2.0,
    )  # fmt: skip
    segments = [
        {"duration": 1.0, "until": f"p.j >= {at}"},
        {"inputs": {"u": -1.0}, "duration": 1.0, "until": "p.j <= 0"},
    ]
    found = run(scene, rung, tol=tol, inputs=segments)
    assert found.time == pytest.approx(2.0 * at, abs=4e-3 * STEP)
    turned = float(found.trajectory.position.sel(coordinate="p.j").max())
    assert turned <= at + 2e-3 * STEP


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_fall_ends_when_the_ball_is_near_the_floor(make: Make, rung: Rung) -> None:
    """Gaps count as places do: the moment is that of the fall, as exact as its steps."""
    scene = make(world(FLOOR, free("b", "0 0 1", 'size=".1"')), step=STEP, duration=1.0)
    found = run(scene, rung, inputs=[{"duration": 0.9, "until": "gap(world, b) <= 0.4"}])
    assert found.outcome.name == "timeout"
    assert found.time == pytest.approx(math.sqrt(2.0 * 0.5 / G), abs=STEP)
    assert found.final["b"]["z"] == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize("tol", [None, 1e-3])
def test_a_run_with_a_condition_goes_on_bit_for_bit(make: Make, tol: float | None) -> None:
    scene = make(
        world(FLOOR, free("b", "0 0 .3", 'size=".1"')), step=STEP, duration=0.6, goal="t > 5",
        contacts=[{"restitution": 0.5}], inputs=["u"], parameters={"u": {"default": 0.0}},
    )  # fmt: skip
    inputs = [{"duration": 0.5, "until": "gap(world, b) <= 0.05"}, {"duration": 0.3}]
    whole = run(scene, rw.DYNAMIC_RIGID, tol=tol, inputs=inputs)
    for k in (3, len(whole.states) // 2):
        again = run(scene, rw.DYNAMIC_RIGID, tol=tol, state=whole.states[k])
        assert np.array_equal(again.frames[-1].q, whole.frames[-1].q)
