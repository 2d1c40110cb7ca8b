"""States of runs in space: going on, on the same rung and on others, and states that are refused."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene

from .conftest import Make
from .measure import FLOOR, free, q, run, v, world
from .rungs import COMPLIANT, MOVING, RIGID, named

RNG = np.random.default_rng(5)
SOFT = {"contacts": [{"stiffness": 4e3}]}


def _standing(make: Make, **fields: Any) -> SpaceScene:
    """A box of 1 kg on the floor, which yields more than a rigid step may overlap."""
    box = 'type="box" size=".1 .1 .1"'
    return make(world(FLOOR, free("b", "0 0 .1", box)), **(SOFT | fields))


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("own", COMPLIANT, ids=named)
def test_a_run_goes_on_from_contacts_that_yield_on_every_rung(make: Make, own: Rung, rung: Rung) -> None:
    scene = _standing(make)
    whole = run(scene, own, duration=0.4)
    state = whole.states[100]
    sunk = 0.1 - state["b.z"]
    assert sunk > 5e-5
    found = run(scene, rung, state=state, duration=0.4)
    assert found.outcome.name == "timeout", found.reason
    if rung is own:
        assert np.array_equal(q(found), q(whole))
    elif rung.compliant:  # at rest on the other rung, it stays where it is
        assert abs(found.final["b"]["z"] - state["b.z"]) < 0.05 * sunk
    else:  # bodies come apart within two steps, and come to rest where they touch
        assert abs(found.final["b"]["z"] - 0.1) < 2e-5 and np.abs(v(found)).max() < 1e-9


@pytest.mark.parametrize("rung", RIGID, ids=named)
def test_other_parameters_may_not_make_an_overlap_worse(make: Make, rung: Rung) -> None:
    plain = make(world(FLOOR, free("b", "0 0 .1", 'name="g" type="box" size=".1 .1 .1"')))
    size = {"set": {"geoms": {"g": {"size": [0.1, 0.1, "0.1 + more"]}}}}
    more = {"more": {"default": 0.0, "range": [-0.05, 0.05]}}
    fields = {"name": "grows", "parameters": more, "model": {"file": plain.file.model.file, **size}}
    scene = rw.load(fields | SOFT)
    state = run(scene, rw.DYNAMIC_COMPLIANT, duration=0.2).state
    refused = rw.simulate(scene, rung, state=state, parameters={"more": 0.04}, duration=0.4)
    assert refused.outcome.name == "invalid"
    assert refused.reason.startswith("state: world (floor) and b (g) overlap by 0.04")
    for less in (0.0, -0.02):
        found = run(scene, rung, state=state, parameters={"more": less}, duration=0.4)
        assert found.outcome.name == "timeout" or (less and rung.inertia == 0.0), found.reason


def test_a_state_that_differs_from_its_memory_is_refused(make: Make) -> None:
    scene = _standing(make)
    state = run(scene, rw.DYNAMIC_COMPLIANT, duration=0.02).state
    for field, value in (("q", state.q + 1e-3), ("v", state.v + 1.0), ("time", 0.5)):
        changed = dataclasses.replace(state, **{field: value})
        with pytest.raises(rw.StateError, match=f"state.{field}: differs from the state's memory"):
            rw.simulate(scene, rw.DYNAMIC_RIGID, state=changed)


TURNING = '<body name="p" pos="0 0 2"><joint name="j" type="ball"/><geom size=".1"/></body>'
NO_TURN = [(0.0, 0.0, 0.0, 0.0), (1e-320, 0.0, 0.0, 0.0)]
PARTS = ("qw", "qx", "qy", "qz")


@pytest.mark.few(1)
@pytest.mark.parametrize("turn", NO_TURN, ids=str)
@pytest.mark.parametrize("body", ["b.", "p.j_"])
def test_a_quaternion_without_direction_is_refused_wherever_it_stands(
    make: Make, body: str, turn: tuple[float, ...]
) -> None:
    parts = world(TURNING, free("b", "0 0 .5", 'size=".1"'))
    places = {f"{body}{part}": x for part, x in zip(PARTS, turn, strict=True)}
    line = f"{body[:-1]}: the quaternion qw, qx, qy, qz is"
    wrong = rw.simulate(make(parts, start={"places": places}), rw.DYNAMIC_RIGID)
    assert wrong.outcome.name == "invalid" and wrong.reason.startswith(f"start.places.{line}")
    scene = make(parts)
    with pytest.raises(rw.StateError, match=f"state.q.{line}"):
        rw.State.of(scene, places)
    good = rw.State.of(scene)
    bad = good.q.copy()
    bad[[good.names.index(name) for name in places]] = turn
    with pytest.raises(rw.StateError, match=f"state.q.{line}"):
        rw.simulate(scene, rw.DYNAMIC_RIGID, state=dataclasses.replace(good, q=bad))
    with pytest.raises(rw.StateError, match=f"states.q.{line}"):
        rw.geometry(scene, bad[None])
    rolled = rw.rollout(scene, rw.DYNAMIC_RIGID, bad[None], durations=0.01)
    assert line in rolled.faults[0]
    key = " ".join(str(x) for x in bad)
    told = rw.simulate(
        make(f'{parts}<keyframe><key name="k" qpos="{key}"/></keyframe>', start={"keyframe": "k"}),
        rw.DYNAMIC_RIGID,
    )
    # MuJoCo makes what has no direction the identity while it reads a file
    assert told.outcome.name == "timeout" or line in told.reason


@pytest.mark.parametrize("scale", [1e-150, 1e-3, 7.0, 1e9])
def test_a_quaternion_of_any_length_turns_as_its_direction_says(make: Make, scale: float) -> None:
    scene = make(world(free("b", "0 0 .5", 'type="box" size=".1 .2 .3"'), before='<option gravity="0 0 0"/>'))
    turn = RNG.normal(size=4)
    places = {f"b.{part}": float(x) for part, x in zip(PARTS, scale * turn, strict=True)}
    state = rw.State.of(scene, places)
    assert [state[f"b.{part}"] for part in PARTS] == pytest.approx(
        list(turn / np.linalg.norm(turn)), abs=1e-15
    )
