"""States: a run goes on from one as if never interrupted; states made by hand are checked."""

from __future__ import annotations

import pickle
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.planar.state.workspace import CLOCK, recorded
from rungwise.simulation.run import Simulation
from rungwise.system.planar.contact_manifold import ABSENT

from .conftest import MOVING
from .random_scenes import random_scene

OWN = {"steps", "attempts", "solves", "frames", "since", "stride", "outcome", "worst_residual"}
"""Fields of the clock that count from the beginning of each run."""


STEPS = 60


def recalled(run: rw.Run) -> dict[str, Any]:
    """All that the run handed on from step to step, frame by frame."""
    assert run.workspace is not None
    names = ["values", "start", "recent", "features", "points", "deformation", "modes", "force"]
    names += [name for name in CLOCK.names or () if name not in OWN]
    found = {name: recorded(run.workspace, name) for name in names}
    found["points"][found["features"] == ABSENT] = 0.0  # left over, and read by no step
    return found


def taken(scene: rw.Scene, model: rw.Rung, steps: int, **options: Any) -> rw.Run:
    """The first steps of a run, each of them a frame."""
    simulation = Simulation(scene, model, stride=1, frames=STEPS + 2, **options)
    simulation.advance(steps)
    return simulation.result()


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize(
    "numbers",
    [(20, 30, 90, 130, 150, 170), pytest.param(range(0, 200, 10), marks=pytest.mark.long)],
    ids=["few", "many"],
)
def test_a_run_that_goes_on_is_the_run_that_was_not_interrupted(
    model: rw.Rung, tol: float | None, numbers: Sequence[int]
) -> None:
    """Bit for bit, at random cuts of random scenes: impacts, friction, joints, servos, supports."""
    rng, cuts, touching = np.random.default_rng(0), 0, 0
    for number in numbers:
        options: dict[str, Any] = {"tol": tol, "theta": float(rng.choice([0.5, 1.0]))}
        scene = rw.load(random_scene(number))
        whole = taken(scene, model, STEPS, **options)
        states = whole.states
        if len(states) < 2:
            continue
        expected = recalled(whole)
        for cut in rng.choice(len(states) - 1, min(len(states) - 1, 5), replace=False):
            again = taken(scene, model, len(states) - 1 - cut, state=states[cut], **options)
            assert again.outcome == whole.outcome
            for name, values in recalled(again).items():
                assert np.array_equal(values, expected[name][cut:], equal_nan=True), (number, cut, name)
            cuts += 1
            touching += bool(expected["modes"][cut].any())
    assert cuts > 3 * len(numbers) and touching > len(numbers) / 2


@pytest.mark.few(2)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_cut_at_any_time_differs_by_no_more_than_the_error(model: rw.Rung) -> None:
    options: dict[str, Any] = {"tol": 1e-4, "parameters": {"v1": 1.0, "v2": 0.7}}
    whole = rw.simulate("two_finger", model, **options)
    for cut in np.random.default_rng(1).uniform(0.1, 1.0, 5) * whole.time:
        first = rw.simulate("two_finger", model, duration=cut, **options)
        assert first.state.time == pytest.approx(cut)
        again = rw.simulate("two_finger", model, state=first.state, **options)
        assert again.outcome == whole.outcome and again.time == pytest.approx(whole.time, abs=2e-3)
        assert again.final["part"]["x3"] == pytest.approx(whole.final["part"]["x3"], abs=1e-2)


@pytest.mark.long
def test_a_state_is_lifted_to_every_other_rung_and_to_other_parameters() -> None:
    """The part is pushed, and goes on being pushed: deformations and forces are found again where they are
    not handed on."""
    for low in MOVING:
        state = rw.simulate("two_finger", low, duration=1.2).state
        for high in MOVING:
            for parameters in ({}, {"mu": 0.4}):
                run = rw.simulate("two_finger", high, state=state, parameters=parameters)
                assert str(run.outcome) in ("goal", "doomed", "jammed"), (low.name, high.name, run.reason)
                assert run.states[0].time == state.time and np.array_equal(run.states[0].q, state.q)


def test_saved_and_loaded(tmp_path: Path) -> None:
    half = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT.with_inertia(0.5), duration=1.2, theta=0.5)
    file = half.state.save(tmp_path / "half.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["half.npz"]
    ends = [
        rw.simulate("two_finger", half.model, state=state, theta=0.5).state
        for state in (half.state, rw.load_state(file))
    ]
    assert ends[0].memory is not None and ends[1].memory is not None
    assert np.array_equal(ends[0].memory.values, ends[1].memory.values, equal_nan=True)
    (tmp_path / "none.npz").write_bytes(b"text")
    with pytest.raises(rw.StateError, match=r"none\.npz' holds no saved state"):
        rw.load_state(tmp_path / "none.npz")
    with pytest.raises(FileNotFoundError):
        rw.load_state(tmp_path / "missing.npz")


def test_states_by_hand() -> None:
    scene = rw.load("two_finger")
    state = rw.State.of(scene, {"part.x3": 0.1}, time=0.5)
    run = rw.simulate(scene, rw.QUASISTATIC_RIGID, state=state)
    assert run.states[0].time == 0.5 and run.states[0]["part.x3"] == 0.1 == state["part.x3"]
    assert repr(state) == "State(time=0.5, finger1.x1=0, finger2.x2=0, part.x3=0.1)"
    assert repr(run.state).endswith(", of a quasistatic-rigid run)")


@pytest.mark.parametrize(
    "change, text",
    [
        (
            {"q": {"part.x4": 0.0}},
            r"state\.q: unknown 'part\.x4' \(did you mean part\.x3\?\); valid: finger1\.x1, .*part\.x3",
        ),
        ({"v": {"part.x3": "fast"}}, r"state\.v\.part\.x3: must be a number, not 'fast'"),
        ({"q": {"part.x3": np.nan}}, r"state\.q\.part\.x3: must be finite, not nan"),
        ({"time": np.inf}, r"state\.time: must be finite, not inf"),
    ],
)
def test_wrong_values(change: dict[str, Any], text: str) -> None:
    with pytest.raises(rw.StateError, match=text):
        rw.State.of(rw.load("two_finger"), **change)


def test_wrong_states() -> None:
    scene = rw.load("two_finger")
    over = rw.State.of(scene, {"finger1.x1": 1.9})
    run = rw.simulate(scene, rw.KINEMATIC, state=over)
    assert str(run.outcome) == "invalid" and "bodies.finger1: overlaps part by" in run.reason
    names = scene.template.coordinates
    for state, text in (
        (rw.State(names, np.zeros(2), np.zeros(3)), r"state\.q: must have the shape \(3,\), not \(2,\)"),
        (rw.State(("a.x",), np.zeros(1), np.zeros(1)), r"state: has the coordinates a\.x, and the scene "),
        (rw.State(names, np.full(3, np.nan), np.zeros(3)), r"state\.q\.finger1\.x1: must be finite, not nan"),
        (5, r"state: must be a State, not 5"),
    ):
        with pytest.raises(rw.StateError, match=text):
            rw.simulate(scene, rw.KINEMATIC, state=state)  # type: ignore[arg-type]
    with pytest.raises(rw.ModelError, match="duration: the run ends at 1, and the state is at 2"):
        rw.simulate(scene, rw.KINEMATIC, state=rw.State.of(scene, time=2.0), duration=1.0)
    with pytest.raises(rw.StateError, match=r"state: unknown 'x'; valid: "):
        over["x"]


def test_an_open_joint_and_a_place_outside_travel_are_named() -> None:
    scene = rw.load("two_link")
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, state=rw.State.of(scene, {"lower.y": 0.4}))
    assert (
        str(run.outcome) == "invalid" and "joints.elbow: its across is off by 0.1 at the start" in run.reason
    )
    stopped = rw.load(
        {
            "name": "slider",
            "bodies": {
                "block": {
                    "role": "object", "mass": 1.0, "shape": {"kind": "disc", "radius": 0.1},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
                    "coordinates": {"s": {"upper": 1.0}},
                }
            },
        }
    )  # fmt: skip
    with pytest.raises(rw.StateError, match=r"state\.q\.block\.s: 2 is outside its travel, -inf to 1"):
        rw.simulate(stopped, rw.DYNAMIC_RIGID, state=rw.State.of(stopped, {"block.s": 2.0}))


def test_a_pickled_run_has_the_same_trajectory_and_states() -> None:
    run = rw.simulate("two_finger", rw.QUASISTATIC_COMPLIANT, duration=1.2)
    copy = pickle.loads(pickle.dumps(run))
    assert copy.trajectory.identical(run.trajectory)
    assert [state.q.tolist() for state in copy.states] == [state.q.tolist() for state in run.states]


LIFTED = [(low, high) for low in MOVING for high in MOVING if low != high]


@pytest.mark.few(1)
@pytest.mark.parametrize("low, high", LIFTED, ids=lambda model: model.name)
def test_states_of_any_run_are_lifted_with_the_errors_and_deformations_of_its_steps(
    low: rw.Rung, high: rw.Rung
) -> None:
    scenes = [rw.load(random_scene(number)) for number in range(0, 60, 6)]
    for scene in (*scenes, rw.load("two_link")):
        run = taken(scene, low, STEPS, tol=1e-3)
        if not run.states:
            continue
        assert not rw.geometry(scene, run.states).collides.any()
        for state in (run.states[len(run.states) // 2], run.states[-1]):
            if state.time < (run.scene.bind().records.world[0]["duration"]):
                lifted = Simulation(scene, high, state=state)
                assert str(lifted.result().outcome) != "invalid", (scene.name, lifted.reason)
                assert lifted.time == state.time


def arm(turned: dict[str, Any] | None = None) -> rw.Scene:
    """An arm in a hinge, whose servo turns it, and a block on a slide, whose servo pulls it."""
    drive = {"kind": "servo", "stiffness": 1e3, "damping": 10.0, "target_speed": "rate"}
    return rw.load(
        {
            "name": "arm", "duration": 4.0, "step": 1e-2,
            "parameters": {
                "rate": {"default": 0.2}, "high": {"default": 1.0}, "most": {"default": 3.0},
                "wide": {"default": 0.1, "range": [0.01, 10.0]},
            },
            "bodies": {
                "wall": {"role": "obstacle", "shape": {"kind": "point", "at": [0.0, "high"]}},
                "arm": {
                    "role": "robot", "mass": 1.0, "shape": {"kind": "capsule", "length": 0.4, "radius": 0.05},
                    "pose": {"x": 0.2, "y": "high"}, "motion": {"kind": "free"},
                    **(turned or {}),
                },
                "block": {
                    "role": "object", "mass": 1.0, "shape": {"kind": "disc", "radius": "wide"},
                    "pose": {"x": 2.0}, "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
                    "coordinates": {"s": {"upper": "most", "drive": drive}},
                },
                "post": {"role": "obstacle", "shape": {"kind": "disc", "radius": 0.1}},
            },
            "joints": {
                "hinge": {
                    "kind": "hinge", "between": ["wall", "arm"], "at": [0.0, "high"],
                    "coordinate": {"lower": -3.0, "upper": "most", "drive": drive},
                }
            },
            "contacts": [{"between": ["block", "post"]}],
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    "change, reason",
    [
        ({"high": 1.1}, "joints.hinge: its .* is off by 0.1 "),
        ({"wide": 2.5}, "bodies.block: overlaps post by "),
    ],
)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_other_parameters_may_neither_open_joints_nor_make_bodies_overlap(
    model: rw.Rung, change: dict[str, float], reason: str
) -> None:
    scene = arm()
    state = rw.simulate(scene, model, duration=1.0).state
    run = rw.simulate(scene, model, state=state, parameters=change)
    assert str(run.outcome) == "invalid"
    assert re.search(reason, run.reason), run.reason


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_places_outside_the_travel_at_other_parameters_are_refused(model: rw.Rung) -> None:
    scene = arm()
    state = rw.simulate(scene, model, duration=1.0).state
    with pytest.raises(rw.StateError, match=r"state\.q\.block\.s: .* is outside its travel, -inf to 0\.1"):
        rw.simulate(scene, model, state=state, parameters={"most": 0.1})
    still = replace(rw.State.of(scene, {n: state[n] for n in state.names if n[:3] == "arm"}), time=1.0)
    run = rw.simulate(scene, model, state=still, parameters={"most": 0.1})
    assert "joints.hinge: its angle is off by" in run.reason
    fingers = rw.simulate("two_finger", model, duration=1.2).state
    with pytest.raises(rw.StateError, match=r"finger1\.x1: 1\.2 is outside its travel, 0 to 1; .* 0\.2 away"):
        rw.simulate("two_finger", model, state=fingers, parameters={"travel": 1.0})


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_servos_are_led_on_without_a_jump(model: rw.Rung) -> None:
    """Of states by hand at any time, and of states of runs whose servos had another speed."""
    scene = arm()
    by_hand = rw.State.of(scene, time=2.0)
    of_run = rw.simulate(scene, rw.KINEMATIC, parameters={"rate": 0.5}, duration=2.0).state
    for state in (by_hand, of_run):
        run = rw.simulate(scene, model, state=state, duration=2.5)
        moved = np.array([run.final["block"]["s"] - state["block.s"],
                          run.final["arm"]["angle"] - state["arm.angle"]])  # fmt: skip
        assert moved == pytest.approx(0.1, abs=1e-9 if model == rw.KINEMATIC else 0.02)
        frames = np.array([each.q for each in run.states])
        assert np.abs(np.diff(frames, axis=0)).max() < 0.02
    assert by_hand["block.s"] == 0.0 and of_run["block.s"] == pytest.approx(1.0)


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_run_from_the_scenes_start_by_hand_is_the_run_of_the_scene(model: rw.Rung) -> None:
    """Also where joints with servos are turned there."""
    places = {"x": 0.2 * np.cos(0.3) - 0.2, "y": 0.2 * np.sin(0.3), "angle": 0.3}
    turned = {"coordinates": {name: {"start": float(place)} for name, place in places.items()}}
    for scene in (arm(), arm(turned)):
        run = rw.simulate(scene, model, duration=1.0)
        again = rw.simulate(scene, model, state=rw.State.of(scene), duration=1.0)
        assert again.trajectory.identical(run.trajectory)
        moved = run.final["arm"]["angle"] - run.states[0]["arm.angle"]
        assert moved == pytest.approx(0.2, abs=1e-9 if model == rw.KINEMATIC else 0.02)


@pytest.mark.parametrize("field", ["q", "v", "time"])
def test_a_state_that_was_changed_is_not_taken_for_that_of_its_run(field: str) -> None:
    scene = rw.load("two_finger")
    state = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.5).state
    changed = replace(state, **{field: getattr(state, field) + 0.1})
    for model in MOVING:
        with pytest.raises(rw.StateError, match=rf"state\.{field}: differs from the state's memory; make "):
            rw.simulate(scene, model, state=changed)
    with pytest.raises(rw.StateError, match=rf"state\.{field}: differs"):
        rw.geometry(scene, changed)
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, state=replace(changed, memory=None), duration=0.7)
    assert np.array_equal(run.states[0].q, changed.q)


def test_arrays_of_states_are_read_only() -> None:
    scene, places = rw.load("two_finger"), np.zeros(3)
    run = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.5)
    assert run.state.memory is not None
    own = rw.State(scene.template.coordinates, places, places)
    places[0] = 1.0
    assert own["finger1.x1"] == 0.0
    copied = pickle.loads(pickle.dumps(run.state))
    assert np.array_equal(copied.memory.values, run.state.memory.values, equal_nan=True)
    for array in (
        run.state.q, run.state.v, run.state.memory.values, run.states[0].q, own.q, own.v,
        copied.q, copied.memory.values,
    ):  # fmt: skip
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_memories_that_are_none_of_the_scene_are_refused() -> None:
    scene = rw.load("two_finger")
    state = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.5).state
    memory = state.memory
    assert memory is not None
    for values in (memory.values[:-1], np.zeros(0), np.append(memory.values, 0.0)):
        other = replace(state, memory=replace(memory, values=values))
        with pytest.raises(rw.StateError, match=rf"state\.memory: has {len(values)} numbers, and a run of "):
            rw.simulate(scene, rw.DYNAMIC_RIGID, state=other)
        with pytest.raises(rw.StateError, match=r"state\.memory: has "):
            scene.goal(other)
    wrong = [{"values": np.zeros((2, 2))}, {"scene": 5}, {"model": "kinematic"}, {"theta": "1"}]
    values = memory.values.copy()
    values[Simulation(scene, rw.DYNAMIC_RIGID).workspace.state.clock.nbytes // 8] = -1.0  # v1
    with pytest.raises(rw.StateError, match=r"state\.memory: parameters\.v1: -1 is outside 1e-06 to 1e\+06"):
        rw.simulate(scene, rw.KINEMATIC, state=replace(state, memory=replace(memory, values=values)))
    for none in (5, memory.values, *(replace(memory, **change) for change in wrong)):
        with pytest.raises(rw.StateError, match=r"state\.memory: must be null, or the memory of "):
            rw.simulate(scene, rw.DYNAMIC_RIGID, state=replace(state, memory=none))  # type: ignore[arg-type]


def test_files_that_hold_no_state(tmp_path: Path) -> None:
    """Whatever array has another shape or type, and wherever a byte of the file is another one."""
    state = rw.simulate("two_finger", rw.DYNAMIC_RIGID, duration=0.5).state
    file = state.save(tmp_path / "state.npz")
    with np.load(file) as saved:
        arrays = dict(saved)
    wrong = [np.zeros((2, 2)), np.zeros(7, complex), np.array("x"), np.array(["x"]), np.array(1.0)]
    for name in arrays:
        for value in wrong:
            np.savez(tmp_path / "wrong.npz", **arrays | {name: value})
            try:
                rw.simulate("two_finger", rw.DYNAMIC_RIGID, state=rw.load_state(tmp_path / "wrong.npz"))
            except rw.StateError as error:
                assert "\n" not in str(error)
    np.save(tmp_path / "row.npy", np.zeros(3))
    with pytest.raises(rw.StateError, match=r"state: 'row\.npy' holds no saved state"):
        rw.load_state(tmp_path / "row.npy")
    rng, content = np.random.default_rng(0), file.read_bytes()
    for at in rng.choice(len(content), 200, replace=False):
        torn = bytearray(content)
        torn[at] ^= int(rng.integers(1, 256))
        (tmp_path / "torn.npz").write_bytes(torn if at % 2 else torn[:at])
        try:
            rw.load_state(tmp_path / "torn.npz")
        except rw.StateError as error:
            assert "\n" not in str(error)
    for none in (5, None, 1.5, [], b"state.npz"):
        with pytest.raises(rw.StateError, match=r"file: must be a path, not "):
            rw.load_state(none)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [5, [1.0], "x", np.zeros(3), {1.0}])
@pytest.mark.parametrize("field", ["q", "v"])
def test_places_by_hand_are_a_mapping(field: str, value: Any) -> None:
    with pytest.raises(
        rw.StateError, match=rf"state\.{field}: must be a mapping of coordinates to numbers, not"
    ):
        rw.State.of(rw.load("two_finger"), **{field: value})


@pytest.mark.parametrize(
    "value",
    [10**400, -(10**400), np.inf, 1j, True, np.True_, None, "1", [1.0]],
    ids=lambda value: repr(value)[:5],
)
def test_numbers_by_hand_are_finite_reals(value: Any) -> None:
    scene = rw.load("two_finger")
    for change in ({"q": {"part.x3": value}}, {"v": {"part.x3": value}}, {"time": value}):
        with pytest.raises(rw.StateError, match=r"state\.[qvt].*: must be (finite|a number), not "):
            rw.State.of(scene, **change)


@pytest.mark.parametrize("kind", [object, "U5", complex, bool])
def test_arrays_of_other_types_are_refused(kind: Any) -> None:
    scene = rw.load("two_finger")
    values = np.array(["a", "b", "c"], kind) if kind in (object, "U5") else np.zeros(3, kind)
    for q, v in ((values, np.zeros(3)), (np.zeros(3), values)):
        with pytest.raises(rw.StateError, match=r"state\.[qv]\.finger1\.x1: must be a number, not "):
            rw.simulate(scene, rw.KINEMATIC, state=rw.State(scene.template.coordinates, q, v))


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_scene_in_which_nothing_moves(model: rw.Rung) -> None:
    still = rw.load(
        {
            "name": "wall",
            "bodies": {"wall": {"role": "obstacle", "shape": {"kind": "halfplane"}}},
            "duration": 0.1,
        }
    )
    run = rw.simulate(still, model, duration=0.05)
    assert run.time == pytest.approx(0.05) and run.final == {}
    assert rw.simulate(still, model, state=run.state).time == pytest.approx(0.1)
    assert rw.simulate(still, model, state=rw.State.of(still)).time == pytest.approx(0.1)


def test_a_part_of_a_run_takes_the_steps_of_the_whole() -> None:
    """Under error control steps are measured against the end of the run, or the span that is given."""
    whole = {"inputs": [{"inputs": {"v1": 0.7}, "duration": 0.5}, {"inputs": {"v2": 0.4}, "duration": 0.7}]}
    run = rw.simulate("two_finger", rw.DYNAMIC_RIGID, tol=1e-3, **whole)  # type: ignore[arg-type]
    parts = {}
    for span in (None, 1.2):
        state = None
        for segment in whole["inputs"]:
            part = rw.simulate(
                "two_finger", rw.DYNAMIC_RIGID, tol=1e-3, span=span, state=state, inputs=[segment]
            )
            state = part.state
        parts[span] = part
    assert np.array_equal(parts[1.2].state.q, run.state.q) and parts[1.2].time == run.time
    assert parts[None].state.q == pytest.approx(run.state.q, abs=1e-3)
    with pytest.raises(rw.ModelError, match="span: must be a finite number greater than 0"):
        rw.simulate("two_finger", rw.DYNAMIC_RIGID, span=0.0)
