"""Conditions, gaps and poses at given states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.run import Simulation
from rungwise.world.margins import Question

from .conftest import MOVING
from .random_scenes import random_scene

SCENE = rw.load("two_finger")
"""Fingers come down at x = -+1/2 from y = 2, and meet the faces of a triangle of slope 1."""


def test_the_goal_of_a_run_is_the_goal_of_its_last_state() -> None:
    for v2 in (0.4, 0.7, 1.0):
        run = rw.simulate(SCENE, rw.QUASISTATIC_RIGID, parameters={"v2": v2})
        found = SCENE.goal(run.states, {"v2": v2})
        assert not found.holds[:-1].any() and bool(found.holds[-1]) == (str(run.outcome) == "goal")
        assert (found.holds == (found.margin >= 0.0)).all()
        doomed = rw.ask(SCENE, "doomed", run.states, {"v2": v2})
        assert bool(doomed.holds[-1]) == (str(run.outcome) == "doomed")


def test_forces_and_impulses_are_those_of_the_run() -> None:
    run = rw.simulate(SCENE, rw.DYNAMIC_COMPLIANT, parameters={"v2": 0.7}, frames=50)
    found = rw.ask(
        SCENE, "force(finger1, part) >= 0 and impulse(part, finger1) >= 0", run.states, {"v2": 0.7}
    )
    pushed = run.trajectory.contact_force.sel(direction="normal").values[:, :2].sum(axis=1)
    assert found.values[:, 0] == pytest.approx(pushed, abs=1e-9)
    assert found.values[-1, 1] > 0.0 and found.units == ("force", "impulse")
    assert rw.ask(SCENE, "force(finger1, part) > 0", rw.State.of(SCENE)).holds.tolist() == [False]


def test_gaps_and_poses() -> None:
    """A finger above the middle of a face of slope 1: the nearest point is the triangle's apex at first."""
    heights = np.linspace(0.0, 2.0, 9)
    places = np.stack([heights, np.zeros(9), np.zeros(9)], axis=1)
    found = rw.geometry(SCENE, places)
    exact = np.where(heights < 0.5, np.hypot(0.5, 1.0 - heights), (1.5 - heights) / np.sqrt(2.0))
    gaps = found.gaps[:, found.contacts.index(("finger1", "part"))]
    assert gaps[:7] == pytest.approx(exact[:7], abs=1e-12)
    assert (found.collides == ((heights > 1.5) & (heights < 2.0))).all()
    assert found.poses[:, found.bodies.index("finger1"), 1] == pytest.approx(2.0 - heights)


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_gaps_at_states_are_the_gaps_of_the_run(model: rw.Rung) -> None:
    """Whatever order they are asked in."""
    for name in ("four_finger", "blocks", "two_link"):
        scene = rw.load(name)
        simulation = Simulation(scene, model, stride=1, frames=100)
        simulation.advance(60)
        run = simulation.result()
        gaps, states = run.trajectory.gap.values, run.states
        near = gaps < 1e-3
        found = rw.geometry(scene, states).gaps
        assert found[near] == pytest.approx(gaps[near], abs=1e-12)
        assert (found >= gaps - 1e-12).all()
        assert np.array_equal(rw.geometry(scene, states[::-1]).gaps[::-1], found)
        assert np.array_equal(rw.geometry(scene, np.array([s.q for s in states])).gaps, found)


def test_random_scenes_are_asked() -> None:
    for number in range(0, 200, 5):
        scene = rw.load(random_scene(number))
        found = rw.geometry(scene, rw.State.of(scene))
        assert np.isfinite(found.poses).all() and not np.isnan(found.gaps).any()


def test_terms_have_units_and_scales() -> None:
    text = (
        "not (gap(part, finger1) < 0.2 or part.x3 * part.x3 > 1) and force(finger1, part) >= 2"
        " and 0 <= t <= 3 and speed(part.x3) / 2 <= sqrt(v1 * v1) and mu <= 0.5 and part.x3 ** 3 < mu"
    )
    found = rw.ask(SCENE, text, rw.State.of(SCENE))
    assert found.units == (
        "length", "length^2", "force", "time", "time", "speed", "number", "length^3",
    )  # fmt: skip
    assert found.terms[:2] == ("gap(part, finger1) < 0.2", "part.x3 * part.x3 > 1")
    length, time = found.scales[0], found.scales[3]
    assert found.scales[1] == pytest.approx(length**2) and found.scales[5] == pytest.approx(length / time)
    assert found.margin[0] == pytest.approx((found.values / found.scales)[0, 2]) and not found.holds[0]
    hinged = rw.load("four_finger")
    assert rw.ask(hinged, "abs(part.angle) <= 0.2 and speed(part.angle) < 1", rw.State.of(hinged)).units == (
        "angle", "angular speed",
    )  # fmt: skip


def test_a_margin_does_not_depend_on_units_of_length() -> None:
    def margin(size: float) -> np.ndarray[Any, Any]:
        block = {
            "role": "object", "mass": 1.0, "shape": {"kind": "box", "width": size, "height": size},
            "motion": {"kind": "free"}, "pose": {"x": 3.0 * size},
        }  # fmt: skip
        wall = {"role": "obstacle", "shape": {"kind": "box", "width": size, "height": size}}
        scene = rw.load(
            {
                "name": "block", "bodies": {"block": block, "wall": wall},
                "contacts": [{"between": ["block", "wall"]}],
                "goal": f"gap(block, wall) <= {0.1 * size} and abs(block.angle) <= 0.1 and t >= 0",
            }
        )  # fmt: skip
        turned = rw.State.of(scene, {"block.angle": 0.5})
        found = scene.goal([rw.State.of(scene), turned])
        assert found.units == ("length", "angle", "time")
        return found.margin

    assert margin(1e-6) == pytest.approx(margin(1.0), rel=1e-9)


@pytest.mark.parametrize(
    "condition, states, text",
    [
        (
            "part.x4 > 0",
            rw.State.of(SCENE),
            r"condition: unknown name part\.x4 \(did you mean part\.x3\?\); valid: ",
        ),
        ("unsafe", rw.State.of(SCENE), r"unsafe: the scene states none"),
        (5, rw.State.of(SCENE), r"condition: must be text, not 5"),
        ("goal", np.zeros((2, 2)), r"states: must have the shape \(m, 3\) or \(m, 6\), not \(2, 2\)"),
        ("goal", np.full((2, 3), np.nan), r"states: row 0 is not finite"),
        ("goal", 7, r"states: must be states, or an array of places, not 7"),
        ("goal", [7], r"state: must be a State, not 7"),
    ],
)
def test_wrong_input(condition: Any, states: Any, text: str) -> None:
    with pytest.raises((rw.SceneError, rw.StateError), match=text):
        rw.ask(SCENE, condition, states)


def test_scenes_without_motion_and_no_states() -> None:
    still = rw.load(
        {"name": "wall", "bodies": {"wall": {"role": "obstacle", "shape": {"kind": "halfplane"}}}}
    )
    found = rw.geometry(still, rw.State.of(still))
    assert found.gaps.shape == (1, 0) and found.poses.tolist() == [[[0.0, 0.0, 0.0]]]
    assert found.collides.tolist() == [False]
    assert rw.ask(SCENE, "goal", []).holds.shape == (0,) and rw.geometry(SCENE, []).gaps.shape == (0, 2)


CONDITIONS = (
    "part.x3 ** 1e6 >= 0", "part.x3 ** 400 * part.x3 ** 400 > 0", "t ** 1e308 * t ** 1e308 < part.x3",
    "part.x3 ** 1e999 <= 1", "(v1 * part.x3) ** 3 > 0", "part.x3 > 0", "not part.x3 <= 0", "not part.x3 > 0",
    "not (part.x3 <= 0 or t > 0)", "part.x3 ** 300 < 0 and t <= 0", "0 / part.x3 > 1",
    "-1e300 < part.x3 ** 3",
    "part.x3 * 1e200 >= part.x3 ** 3 / 1e200", "force(finger1, part) < 0 or 1 / part.x3 >= 2",
)  # fmt: skip
"""Also with powers, quotients and differences beyond floats."""


@pytest.mark.parametrize("half_base", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("condition", CONDITIONS)
def test_margins_agree_with_what_holds(condition: str, half_base: float) -> None:
    places = np.zeros((7, 3))
    places[:, 2] = [0.0, -0.0, 5e-324, -5e-324, 1.0, -1e-200, 1e60]
    found = rw.ask(SCENE, condition, places, {"half_base": half_base})
    assert np.array_equal(found.holds, found.margin >= 0.0) and not np.isnan(found.margin).any()
    assert (np.isfinite(found.scales) & (found.scales > 0.0)).all()


@pytest.mark.parametrize("kind", [object, "U5", complex, bool, "M8[s]"])
def test_arrays_of_other_types_are_refused(kind: Any) -> None:
    for ask in (rw.geometry, lambda scene, states: scene.goal(states)):
        with pytest.raises(rw.StateError, match=r"^states: must be an array of real numbers, not of "):
            ask(SCENE, np.zeros((2, 3)).astype(kind) if kind != "M8[s]" else np.zeros((2, 3), kind))
    assert rw.geometry(SCENE, np.zeros((2, 3), int)).gaps.shape == (2, 2)


def test_gaps_are_finite_wherever_places_are_taken() -> None:
    with pytest.raises(rw.StateError, match=r"^states: row 1 is not within -1e\+75\.\.1e\+75$"):
        rw.geometry(SCENE, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e300]]))
    with pytest.raises(
        rw.StateError, match=r"^state\.q\.part\.x3: must be within -1e\+75\.\.1e\+75, not 1e\+300$"
    ):
        rw.geometry(SCENE, rw.State.of(SCENE, {"part.x3": 1e300}))
    for number in range(0, 200, 5):
        scene = rw.load(random_scene(number))
        near = np.isfinite(rw.geometry(scene, rw.State.of(scene)).gaps)
        for name in scene.template.coordinates:
            for place in (1e75, -1e75):
                gaps = rw.geometry(scene, rw.State.of(scene, {name: place})).gaps
                assert np.isfinite(gaps[near]).all(), (number, name, gaps)


def test_what_parts_of_a_condition_lack_adds_up() -> None:
    """The parts that "and" joins, also in brackets and chains; "or" and "not" are one part."""
    condition = "(part.x3 >= 1 and finger1.x1 >= 2) and 0 <= finger2.x2 <= 1 and (part.x3 >= 4 or t >= 0)"
    found = rw.ask(SCENE, condition, np.random.default_rng(0).uniform(0.0, 3.0, (50, 3)))
    assert found.lacks.shape == (50, 5) and (found.lacks >= 0.0).all()
    assert found.lacks.sum(axis=1) == pytest.approx(found.lack, rel=1e-12)
    assert (found.lacks[:, 0] > 0.0).tolist() == (found.values[:, 0] < 0.0).tolist()
    assert rw.ask(SCENE, "part.x3 >= 1 or t > 1", np.zeros((2, 3))).lacks.shape == (2, 1)


def test_conditions_read_from_memories_are_those_asked_of_states() -> None:
    """Each row at its own parameters, also where the goal's bounds depend on them."""
    scene, places = rw.load("push"), rw.instances("push", 0, 6)
    asked = Question(scene, "goal")
    for parameters in places:
        run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, parameters=parameters, duration=2.0)
        assert run.workspace is not None
        read = asked.read(run.workspace.state.values[None])
        found = rw.ask(scene, "goal", run.state, parameters)
        assert read.values.tolist() == found.values.tolist() and read.holds.tolist() == found.holds.tolist()
    assert not asked.of_contacts and Question(scene, "gap(rod, box) > 0").of_contacts
