"""A micro part that adhesion lifts and ledges strip off: what holds, what lets go, against the pull-offs."""

from __future__ import annotations

import math
from typing import Any

import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

LOADED = [rung for rung in rw.LADDER if rung.moves and rung.loads]
on_loaded = pytest.mark.parametrize("rung", LOADED, ids=lambda rung: rung.name)
TIP, SIZE, DENSITY = 1e-5, 5e-5, 2330.0
WEIGHT = DENSITY * SIZE**3 * 9.81


def at(run: Any, name: str) -> float:
    """A coordinate at the end of a run."""
    return float(run.state.q[run.scene.template.coordinates.index(name)])


def work(force: float, radius: float) -> float:
    """The work of adhesion at which a bump of this radius holds a force."""
    return force / (1.5 * math.pi * radius)


@on_loaded
def test_the_part_is_lifted_stripped_off_and_held(rung: Rung) -> None:
    run = rw.simulate("micro_pick", rung)
    assert run.outcome.name == "goal"
    assert at(run, "part.y") == pytest.approx(1.5 * SIZE, rel=1e-4)
    assert at(run, "part.x") == pytest.approx(0.0, abs=1e-9)


@on_loaded
@pytest.mark.parametrize("more", [-0.02, 0.02])
def test_two_bumps_lift_the_weight_and_the_pull_of_the_slide_and_no_more(rung: Rung, more: float) -> None:
    slide = 1.5 * math.pi * 0.05 * 1e-6
    held = (1.0 + more) * (slide + 0.5 * WEIGHT)
    run = rw.simulate("micro_pick", rung, parameters={"needle_w": work(held, TIP)}, duration=0.3)
    assert (at(run, "part.y") > 0.6 * SIZE) == (more > 0.0)


@on_loaded
@pytest.mark.parametrize("more", [-0.02, 0.02])
def test_the_ledges_hold_the_weight_at_four_points(rung: Rung, more: float) -> None:
    ledge = work((1.0 + more) * WEIGHT / 4.0, 1e-6)
    run = rw.simulate("micro_pick", rung, parameters={"ledge_w": ledge})
    assert (run.outcome.name == "goal") == (more > 0.0)


def test_without_loads_nothing_is_lifted() -> None:
    run = rw.simulate("micro_pick", "kinematic")
    assert run.outcome.name == "timeout" and at(run, "part.y") == pytest.approx(0.5 * SIZE)
