"""Rollouts in space: known ways, runs that go on bit for bit, threads, wrong input."""

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene.space import SpaceScene

from .conftest import Make

PUSHER = """<worldbody><geom name="table" type="plane" size="2 2 .1"/>
<body name="pusher" pos="-.1 0 .05"><joint name="along" type="slide" axis="1 0 0"/>
<geom name="pusher" type="sphere" size=".02" mass=".2"/></body>
<body name="box" pos="0 0 .05"><freejoint/><geom name="box" type="box" size=".05 .05 .05" mass=".5"/></body>
</worldbody>
<actuator><position name="servo" joint="along" kp="400" kv="10"/></actuator>"""
GAP = 0.03
"""What is between pusher and box at the start."""


@pytest.fixture
def scene(make: Make) -> SpaceScene:
    return make(
        PUSHER,
        parameters={
            "aim": {"default": 0.0, "range": [-0.1, 0.5]},
            "mu": {"default": 0.5, "range": [0.0, 2.0]},
        },
        inputs=["aim"],
        controls={"servo": "aim"},
        contacts=[{"friction": "mu", "stiffness": 1e5, "damping": 1e2}],
        goal="box.x >= 0.3",
        step=2e-3,
    )


def pushed(scene: SpaceScene, model: rw.Rung | str = "kinematic", **options) -> rw.Rollouts:
    given = {"inputs": {"aim": [[0.1, 0.1], [0.2, 0.2]]}, "durations": [0.5, 0.3], "ramp": [True, False]}
    return rw.rollout(scene, model, tol=5e-4, threads=1, **(given | options))


def test_a_pushed_box_comes_to_where_the_pushers_way_ends(scene: SpaceScene) -> None:
    found = pushed(scene)
    x = scene.template.coordinates.index("box.x")
    assert found.q[:, -1, x] == pytest.approx([0.1 - GAP, 0.2 - GAP], abs=5e-4)
    assert list(found.outcomes) == ["missed", "missed"]
    assert found.switches.tolist() == [2, 2]
    assert np.allclose(found.times, [0.5, 0.8])
    assert (found.attempts >= found.steps).all()


@pytest.mark.parametrize("model", ["kinematic", "dynamic-rigid", "dynamic-compliant"])
def test_parts_of_a_run_are_the_whole_bit_for_bit(scene: SpaceScene, model: str) -> None:
    whole = pushed(scene, model)
    first = [whole.state(i, 0) for i in range(2)]
    rest = pushed(scene, model, states=first, inputs={"aim": [[0.1], [0.2]]}, durations=0.3, ramp=False)
    for name in ("outcome", "time", "final", "speed", "margin"):
        assert np.array_equal(getattr(rest, name), getattr(whole, name)), name


def test_a_sample_is_the_run_of_simulate(scene: SpaceScene) -> None:
    found = pushed(scene, "dynamic-compliant")
    assert np.array_equal(found.run(1).state.q, found.final[1])
    assert np.array_equal(found.state(1).q, found.final[1])
    assert found.reason(1) == found.run(1).reason


def test_answers_do_not_depend_on_the_number_of_threads(scene: SpaceScene) -> None:
    aims = np.linspace(0.05, 0.4, 10)[:, None, None]
    one, two = (
        rw.rollout(scene, "kinematic", inputs=aims, durations=0.4, tol=1e-3, threads=n) for n in (1, 2)
    )
    for name in ("outcome", "time", "final", "speed", "memory", "work"):
        assert np.array_equal(getattr(one, name), getattr(two, name), equal_nan=True), name
    assert {"goal", "missed"} == set(one.outcomes)


def test_a_segment_ends_with_its_condition(scene: SpaceScene) -> None:
    found = pushed(
        scene, inputs={"aim": [0.4, 0.0]}, durations=[1.0, 0.2], until=["gap(pusher, box) <= 1e-4", None]
    )
    assert found.times[0, 0] < 0.2
    x = scene.template.coordinates.index("box.x")
    assert found.final[0, x] < 0.05


def test_parameters_vary_by_sample_and_wrong_ones_are_faults(scene: SpaceScene) -> None:
    found = pushed(scene, parameters={"mu": [0.1, 3.0]})
    assert list(found.outcomes) == ["missed", "invalid"]
    assert "sample 1: parameters.mu" in found.faults[1]
    assert np.isnan(found.q[1]).all()


def test_bodies_that_overlap_at_the_start_are_told(scene: SpaceScene) -> None:
    found = pushed(scene, states=rw.State.of(scene, q={"box.x": -0.04}))
    assert list(found.outcomes) == ["invalid", "invalid"]
    assert "overlap" in found.reason(0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": {"speed": [1.0, 1.0]}}, "inputs: unknown input 'speed'.*aim"),
        ({"inputs": np.zeros((2, 3, 1))}, r"inputs: must have the shape \(m, 2, 1\)"),
        ({"states": np.zeros((2, 3))}, r"states: must have the shape \(m, 8\) or \(m, 15\)"),
        ({"motion": {"box.x": 1.0}}, "motion: does not work for scenes in space"),
        ({"until": ["gap(box, moon) > 0", None]}, "until.0"),
    ],
)
def test_wrong_input_is_told_in_one_line(scene: SpaceScene, options: dict, words: str) -> None:
    with pytest.raises(rw.InputError, match=words):
        pushed(scene, **options)


def test_a_state_hands_on_its_impulses_once(scene: SpaceScene) -> None:
    """The impulse of the table on a box at rest is its weight times the time, in one run and in two."""
    guarded = scene.changed(unsafe="impulse(box, world) > 1e9")
    half, whole = (rw.simulate(guarded, "dynamic-rigid", inputs=[{"duration": each}]) for each in (0.1, 0.2))
    rest = rw.simulate(guarded, "dynamic-rigid", state=half.state, inputs=[{"duration": 0.1}])
    for run in (half, whole, rest):
        (impulse,) = rw.ask(guarded, "impulse(box, world) > 0", run.state).values[0]
        assert impulse == pytest.approx(0.5 * 9.81 * run.time)
