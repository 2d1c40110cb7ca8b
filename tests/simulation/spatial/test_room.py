"""Room for many bodies: what does not fit into memory is refused in one line."""

from __future__ import annotations

import pytest

import rungwise as rw
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.simulation.stepping import stepper

from .conftest import Make
from .measure import FLOOR, free, world


def _spheres(count: int) -> str:
    return world(FLOOR, *(free(f"s{k}", f"{0.3 * k} 0 .1", 'size=".1"') for k in range(count)))


def test_steps_have_room_for_the_contacts_within_reach_at_once(make: Make) -> None:
    """Slots of features, which are twice as many, take no rows of all velocities."""
    simulation = SpaceSimulation(make(_spheres(12)), rw.DYNAMIC_RIGID)
    assert simulation.stepper is not None
    room, d = simulation.space.room, simulation.space.size.directions
    assert len(simulation.stepper.terms.rows) == len(simulation.stepper.problem.W) == room * d


def test_rows_that_do_not_fit_into_memory_are_refused_in_one_line(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_sizes: object, **_more: object) -> None:
        raise MemoryError

    monkeypatch.setattr(stepper, "allocate_terms", full)
    with pytest.raises(rw.InputError, match=r"scene: rows of \d+ contacts by 12 velocities") as refused:
        rw.simulate(make(_spheres(2)), rw.DYNAMIC_RIGID)
    assert "\n" not in str(refused.value)
