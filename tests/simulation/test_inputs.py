"""Inputs over time: segments held, ramped, or ended by a condition."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.scene.scene import LIBRARY
from tests.simulation.conftest import MOVING

TWO = {"v1": 1.0, "v2": 1e-6}


def slider(drive: dict[str, Any], **more: Any) -> rw.Scene:
    """A block on a line, driven by the input u."""
    body = {
        "role": "robot",
        "shape": {"kind": "box", "width": 0.2, "height": 0.1},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
        "coordinates": {"s": {"drive": drive, "damping": 2.0}},
    }
    scene = {
        "name": "slider",
        "parameters": {"u": {"default": 0.3, "range": [-10.0, 10.0]}},
        "inputs": ["u"],
        "bodies": {"block": body},
        "duration": 1.0,
        "step": 1e-2,
    }
    return rw.load(scene | more)


SPEED = {"kind": "speed", "speed": "u"}
SEGMENTS = [
    {"inputs": {"u": 1.0}, "duration": 0.37},
    {"inputs": {"u": -0.5}, "duration": 0.41, "ramp": True},
    {"duration": 0.2},
    {"inputs": {"u": 0.25}, "duration": 0.0, "ramp": True},
    {"inputs": {"u": 2.0}, "duration": 0.1, "ramp": True},
]
WAY = 0.37 + 0.41 * 0.25 - 0.5 * 0.2 + 0.1 * (0.25 + 2.0) / 2.0


@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_speed_follows_held_and_ramped_inputs_exactly(model: rw.Rung, tol: float | None) -> None:
    run = rw.simulate(slider(SPEED), model, inputs=SEGMENTS, tol=tol, stride=1)
    assert str(run.outcome) == "missed" and run.time == 0.37 + 0.41 + 0.2 + 0.1
    assert run.final["block"]["s"] == pytest.approx(WAY, rel=1e-12)
    for switch in (0.37, 0.37 + 0.41, 0.37 + 0.41 + 0.2):
        assert switch in run.trajectory.time.values


@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_target_is_followed_over_switches(model: rw.Rung) -> None:
    scene = slider({"kind": "servo", "stiffness": 4e4, "damping": 400.0, "target": "u"})
    segments = [
        {"inputs": {"u": 0.0}, "duration": 0.1},
        {"inputs": {"u": 0.5}, "duration": 0.5, "ramp": True},
        {"duration": 0.6},
    ]
    run = rw.simulate(scene, model, inputs=segments)
    assert run.final["block"]["s"] == pytest.approx(0.5, abs=1e-6)
    middle = run.trajectory.position.interp(time=0.35).item()
    assert middle == pytest.approx(0.25, abs=0.02)


def test_a_force_is_an_input_where_there_are_forces_and_the_kinematic_rung_says_that_it_has_none() -> None:
    scene = slider({"kind": "force", "force": "u"})
    segments = [{"inputs": {"u": 4.0}, "duration": 0.5}, {"inputs": {"u": -2.0}, "duration": 0.5}]
    run = rw.simulate(scene, "quasistatic-rigid", inputs=segments)
    assert run.final["block"]["s"] == pytest.approx((4.0 - 2.0) / 2.0 * 0.5, rel=1e-6)
    assert not [note for note in run.notes if note.startswith("inputs")]
    still = rw.simulate(scene, "kinematic", inputs=segments)
    assert still.final["block"]["s"] == 0.0
    assert [note for note in still.notes if note.startswith("inputs")] == [
        "inputs.u: has no effect on the kinematic rung, which has no forces; it is read by"
        " bodies.block.coordinates.s.drive.force"
    ]


@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_guarded_move_ends_where_its_condition_begins_to_hold(model: rw.Rung, tol: float | None) -> None:
    scene = slider(SPEED, step=1e-2)
    for u, place in ((0.7, 0.123), (1.3, 0.4567)):
        segments = [
            {"inputs": {"u": u}, "duration": 5.0, "until": f"block.s >= {place}"},
            {"inputs": {"u": 0.0}, "duration": 0.1},
        ]
        run = rw.simulate(scene, model, inputs=segments, tol=tol)
        late = run.final["block"]["s"] - place
        assert 0.0 <= late <= 1.01e-3 * 1e-2 * u, "known to a thousandth of a nominal step"
        assert run.time == pytest.approx(place / u + 0.1, abs=1.1e-5)


@pytest.mark.parametrize("model", MOVING[1:], ids=str)
def test_a_finger_stops_at_a_force(model: rw.Rung) -> None:
    """A servo presses against a wall; its target moves on until the force is met."""
    scene = rw.load(
        {
            "name": "touch",
            "parameters": {"u": {"default": 0.0}},
            "inputs": ["u"],
            "bodies": {
                "finger": {
                    "role": "robot",
                    "mass": 0.5,
                    "shape": {"kind": "disc", "radius": 0.01},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
                    "coordinates": {
                        "x": {"drive": {"kind": "servo", "stiffness": 200.0, "damping": 40.0, "target": "u"}}
                    },
                },
                "wall": {
                    "role": "obstacle",
                    "shape": {"kind": "halfplane", "normal": [-1, 0], "at": [0.1, 0]},
                },
            },
            "contacts": [{"between": ["finger", "wall"], "stiffness": 1e5, "damping": 30.0}],
            "step": 1e-3,
        }
    )
    segments = [
        {"inputs": {"u": 0.2}, "duration": 20.0, "ramp": True, "until": "force(finger, wall) >= 5"},
        {"duration": 0.5},
    ]
    run = rw.simulate(scene, model, inputs=segments)
    assert str(run.outcome) == "missed"
    target = 0.01 * (run.time - 0.5)
    assert 200.0 * (target - run.final["finger"]["x"]) == pytest.approx(5.0, rel=0.01)


def test_a_condition_that_never_holds_ends_the_run_and_is_named() -> None:
    run = rw.simulate(
        slider(SPEED), "kinematic",
        inputs=[{"duration": 0.1}, {"inputs": {"u": 1.0}, "duration": 0.5, "until": "block.s >= 9"}],
    )  # fmt: skip
    assert str(run.outcome) == "timeout" and run.time == pytest.approx(0.6)
    assert run.reason == "inputs.1.until: block.s >= 9 did not hold within 0.5 (from t = 0.1 on)"


def test_a_condition_that_holds_already_ends_its_segment_at_once() -> None:
    run = rw.simulate(
        slider(SPEED), "kinematic",
        inputs=[{"inputs": {"u": 1.0}, "duration": 9.0, "until": "block.s >= -1"}, {"duration": 0.5}],
    )  # fmt: skip
    assert run.time == 0.5 and run.final["block"]["s"] == pytest.approx(0.5)


@pytest.mark.parametrize("before", [[], [{"duration": 0.2}]])
def test_a_segment_of_no_length_whose_condition_does_not_hold_ends_the_run(before: list[Any]) -> None:
    unmet = {"duration": 0.0, "until": "block.s >= 9"}
    run = rw.simulate(slider(SPEED), "kinematic", inputs=[*before, unmet, {"duration": 1.0}])
    assert str(run.outcome) == "timeout" and run.time == pytest.approx(0.2 * len(before))
    assert f"inputs.{len(before)}.until: block.s >= 9 did not hold within 0" in run.reason


def test_the_run_goes_on_after_its_schedule_where_a_duration_is_given() -> None:
    segments = [{"inputs": {"u": 1.0}, "duration": 0.25, "ramp": True}]
    run = rw.simulate(slider(SPEED), "dynamic-rigid", inputs=segments, duration=1.0)
    assert run.time == 1.0 and str(run.outcome) == "timeout"
    assert run.final["block"]["s"] == pytest.approx(0.25 * (0.3 + 1.0) / 2 + 0.75)


@pytest.mark.few(1)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_a_run_cut_within_its_schedule_goes_on_bit_for_bit(
    model: rw.Rung, tol: float | None, tmp_path: Any
) -> None:
    segments = [
        {"inputs": TWO, "duration": 3, "until": "gap(finger1, part) <= 0.1"},
        {"inputs": {"v1": 0.5, "v2": 2.0}, "duration": 0.5, "ramp": True},
        {"inputs": {"v1": 1e-6}, "duration": 0.1},
    ]
    options: dict[str, Any] = {"tol": tol} if tol else {"step": 2e-3}
    whole = rw.simulate("two_finger", model, inputs=segments, stride=1, **options)
    states = whole.states[1:-1]
    for cut in np.random.default_rng(5).choice(len(states), min(8, len(states)), replace=False):
        rw.load_state(states[cut].save(tmp_path / "cut.npz"))
        rest = rw.simulate("two_finger", model, state=rw.load_state(tmp_path / "cut.npz"), **options)
        assert rest.outcome == whole.outcome and rest.time == whole.time
        assert np.array_equal(rest.state.q, whole.state.q) and np.array_equal(rest.state.v, whole.state.v)
    again = rw.simulate(
        "two_finger", model, state=states[len(states) // 2], inputs=[{"duration": 0.25}], **options
    )
    assert again.time == pytest.approx(states[len(states) // 2].time + 0.25) or str(again.outcome) != "missed"


DRIVES: dict[str, dict[str, Any]] = {
    "servo": {"kind": "servo", "stiffness": 300, "damping": 30, "limit": "torque"},
    "stiff": {"kind": "servo", "stiffness": 300, "damping": 30},
    "speed": {"kind": "speed"},
    "force": {"kind": "force"},
}


def arm(drive: str) -> rw.Scene:
    """The scene `two_link` without its goal, each joint driven by an input."""
    file = yaml.safe_load((LIBRARY / "two_link.yaml").read_text("utf-8"))
    file.pop("goal")
    for joint in ("shoulder", "elbow"):
        field = "target" if "stiffness" in DRIVES[drive] else drive
        file["joints"][joint]["coordinate"]["drive"] = DRIVES[drive] | {field: joint}
        file["parameters"][joint].pop("unit", None)  # an angle in the library
    return rw.load(file | {"inputs": ["shoulder", "elbow"]})


@pytest.mark.few(4)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("drive", DRIVES)
def test_drives_of_joints_follow_a_schedule_and_go_on_within_it(
    drive: str, model: rw.Rung, tol: float | None
) -> None:
    """Random segments, some guarded; a run that is cut, also at its end, is the run that is not, and so is
    the rollout."""
    scene, rng = arm(drive), np.random.default_rng(4)
    segments = [
        rw.Segment(
            {"shoulder": float(rng.uniform(-0.2, 0.5)), "elbow": float(rng.uniform(-0.4, 0.4))}, 0.1,
            "gap(disc, lower) <= 0.02" if k == 2 else None, bool(k % 2),
        )
        for k in range(4)
    ]  # fmt: skip
    options: dict[str, Any] = {"tol": tol} if tol else {"step": 4e-3}
    whole = rw.simulate(scene, model, inputs=segments, stride=1, **options)
    for cut in (1, len(whole.states) // 2, -1):
        rest = rw.simulate(scene, model, state=whole.states[cut], **options)
        assert rest.outcome == whole.outcome, (rest.reason, whole.reason)
        assert np.array_equal(rest.state.q, whole.state.q) and np.array_equal(rest.state.v, whole.state.v)
    levels = {name: [segment.inputs[name] for segment in segments] for name in ("shoulder", "elbow")}
    found = rw.rollout(
        scene, model, inputs=levels, durations=[0.1] * 4, until=[segment.until for segment in segments],
        ramp=[segment.ramp for segment in segments], **({"tol": None} | options),
    )  # fmt: skip
    if str(whole.outcome) in ("missed", "timeout"):
        assert found.outcome[0] == whole.outcome.code
        assert np.array_equal(found.final[0], whole.state.q)


def test_a_target_of_a_joint_that_jumps_is_named_on_the_kinematic_rung() -> None:
    jump = [{"inputs": {"shoulder": -1.5}, "duration": 0.5}]
    run = rw.simulate(
        arm("stiff"), "kinematic", inputs=jump, tol=1e-4, parameters={"shoulder": 0, "elbow": 0}
    )
    assert str(run.outcome) == "not_converged"
    assert run.reason.startswith("joints.shoulder.coordinate.drive: its target is ")


def test_a_state_within_a_schedule_goes_on_with_it_on_other_rungs() -> None:
    segments = [{"inputs": {"v1": 0.5, "v2": 0.25}, "duration": 1.0, "ramp": True}, {"duration": 0.5}]
    for low in MOVING:
        state = rw.simulate("two_finger", low, inputs=segments).states[700]
        for high in MOVING:
            run = rw.simulate("two_finger", high, state=state)
            assert run.time == 1.5 and run.final["finger1"]["x1"] == pytest.approx(1.0, rel=1e-9)


def test_conditions_at_states_read_the_inputs_there() -> None:
    scene = slider(SPEED)
    run = rw.simulate(scene, "kinematic", inputs=SEGMENTS, stride=1)
    found = rw.ask(scene, "u >= 0", run.states)
    assert found.holds.all() != found.holds.any()
    assert found.values[-1, 0] == 2.0 and rw.ask(scene, "u >= 0", rw.State.of(scene)).values[0, 0] == 0.3


WRONG = [
    ("x", "inputs: must be a list of segments, not 'x'"),
    ([5], "inputs.0: must be a mapping of fields, not 5; valid: inputs, duration, until, ramp"),
    ([{"duration": 1, "foo": 2}], "inputs.0: unknown field 'foo'; valid: inputs, duration, until, ramp"),
    ([{"inputs": {}}], "inputs.0.duration: is required"),
    ([{"duration": -1}], "inputs.0.duration: must be >= 0, not -1"),
    ([{"duration": math.nan}], "inputs.0.duration: must be finite, not nan"),
    ([{"duration": 1}, {"duration": 1, "inputs": {"w": 1}}], "inputs.1.inputs: unknown input 'w'; valid: u"),
    ([{"duration": 1, "inputs": {"u": math.inf}}], "inputs.0.inputs.u: must be finite, not inf"),
    ([{"duration": 1, "inputs": {"u": 99}}], "inputs.0.inputs.u: 99 is outside -10 to 10"),
    ([{"duration": 1, "inputs": {"u": "1"}}], "inputs.0.inputs.u: must be a number, not '1'"),
    ([{"duration": 1, "ramp": 1}], "inputs.0.ramp: must be true or false, not 1"),
    (
        [{"duration": 1, "until": "zzz > 0"}],
        "inputs.0.until: unknown name zzz; valid: u, t, tolerance, block.s",
    ),
    ([{"duration": 1, "until": 3}], "inputs.0.until: must be text, not 3"),
]


@pytest.mark.parametrize(("given", "message"), WRONG)
def test_wrong_schedules(given: Any, message: str) -> None:
    with pytest.raises(rw.ScheduleError) as error:
        rw.simulate(slider(SPEED), "kinematic", inputs=given)
    assert str(error.value).startswith(message) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": ["w"]}, "inputs.0: unknown parameter 'w'; valid: u"),
        ({"inputs": ["u", "u"]}, "inputs.1: given twice: 'u'; valid: u"),
        (
            {"parameters": {"u": {"default": 1}, "m": {"default": 1}}, "inputs": ["u", "m"]},
            "inputs.1: m is read by no speed, target or force",
        ),
    ],
)  # fmt: skip
def test_wrong_inputs_of_scenes(change: dict[str, Any], message: str) -> None:
    with pytest.raises(rw.SceneError) as error:
        slider(SPEED, **change)
    assert str(error.value).startswith(message)


def test_numbers_of_a_drive_that_cannot_follow_an_input_say_so() -> None:
    with pytest.raises(rw.SceneError, match=r"drive\.stiffness: cannot follow the input u"):
        slider({"kind": "servo", "stiffness": "u", "target": "u"})
    with pytest.raises(rw.SceneError, match=r"target_speed: cannot follow the input u without a target"):
        slider({"kind": "servo", "stiffness": 1.0, "target_speed": "u"})


@pytest.mark.parametrize("tol", [1e-6, 1e-8])
def test_impact_in_the_last_segment_bounces_as_without_one(tol: float) -> None:
    """A step that was planned up to a switch is not tried again and again while an impact is resolved: one
    that spans the rest of the impact looks plastic, and so do its halves."""
    parameters = {"v2": 0.6, "mu": 0.0, "stiffness": 1e7, "damping": 0.6 * np.sqrt(2e7)}
    options: dict[str, Any] = {"parameters": parameters, "tol": tol, "theta": 0.5}
    whole = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT, duration=1.5484, **options)
    segment = rw.simulate("two_finger", rw.DYNAMIC_COMPLIANT, inputs=[rw.Segment({}, 1.5484)], **options)
    assert segment.final["part"]["x3"] == pytest.approx(whole.final["part"]["x3"], rel=1e-9)
    assert segment.attempts == whole.attempts
