"""Questions at states in space, and states made by hand, against known answers."""

import numpy as np
import pytest

import rungwise as rw
from rungwise.scene.space import SpaceScene

from .conftest import Make

WORLD = """<option gravity="0 0 -10"/><worldbody><geom name="floor" type="plane" size="2 2 .1"/>
<body name="arm" pos="0 0 1"><joint name="turn" axis="0 0 1"/><geom size=".1" pos=".5 0 0" mass="1"/></body>
<body name="box" pos="0 0 .1"><freejoint/><geom name="box" type="box" size=".1 .1 .1" mass="2"/></body>
</worldbody>"""


@pytest.fixture
def scene(make: Make) -> SpaceScene:
    return make(
        WORLD, goal="box.x >= 0.5 and abs(arm.turn) <= 0.1", parameters={"a": {"default": 0.5}}, duration=2.0
    )


def test_a_state_by_hand_has_unit_quaternions_and_velocities_of_their_own(scene: SpaceScene) -> None:
    state = rw.State.of(scene, q={"box.qw": 1.0, "box.qz": 1.0}, v={"box.rz": 0.3, "arm.turn": -1.0})
    assert state["box.qz"] == pytest.approx(np.sqrt(0.5))
    assert state.v[[0, -1]].tolist() == [-1.0, 0.3]
    assert len(state.q) == 8
    assert len(state.v) == 7


@pytest.mark.parametrize(("field", "names"), [("q", "box.qw"), ("v", "box.rz")])
def test_unknown_names_are_answered_with_the_valid_ones(scene: SpaceScene, field: str, names: str) -> None:
    with pytest.raises(rw.StateError, match=rf"state\.{field}: unknown 'box\.tilt'.*{names}"):
        rw.State.of(scene, **{field: {"box.tilt": 1.0}})


def test_a_state_is_saved_and_loaded(scene: SpaceScene, tmp_path) -> None:
    run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, duration=0.1)
    loaded = rw.load_state(run.state.save(tmp_path / "s.npz"))
    assert np.array_equal(loaded.q, run.state.q)
    on, again = (rw.simulate(scene, rw.DYNAMIC_COMPLIANT, state=s, duration=0.2) for s in (run.state, loaded))
    assert np.array_equal(on.state.v, again.state.v)


def test_margins_are_in_units_of_the_scene_and_lacks_add_up(scene: SpaceScene) -> None:
    extent = float(scene.bind().model.stat.extent)
    found = scene.goal(rw.State.of(scene, q={"box.x": 0.2, "arm.turn": 0.4}))
    assert found.units == ("length", "angle")
    assert found.scales.tolist() == [extent, 1.0]
    assert found.values[0] == pytest.approx([-0.3, -0.3])
    assert found.lack[0] == pytest.approx(0.3 / extent + 0.3)
    assert not found.holds[0]


def test_speeds_of_turns_are_measured_by_the_duration(scene: SpaceScene) -> None:
    found = rw.ask(scene, "abs(speed(box.rz)) <= 0.1 and speed(box.x) >= 0", rw.State.of(scene))
    assert found.units == ("angular speed", "speed")
    assert found.scales[0] == pytest.approx(1.0 / 2.0)


def test_gaps_and_poses_of_bodies(scene: SpaceScene) -> None:
    tilted = {"box.z": 0.5, "box.qw": np.cos(np.pi / 8), "box.qy": np.sin(np.pi / 8)}
    found = rw.geometry(scene, [rw.State.of(scene), rw.State.of(scene, q=tilted)])
    k = found.contacts.index(("world", "box"))
    assert found.gaps[:, k] == pytest.approx([0.0, 0.5 - 0.1 * np.sqrt(2.0)], abs=1e-6)
    assert found.poses[1, found.bodies.index("box")] == pytest.approx(
        [0.0, 0.0, 0.5, np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0]
    )
    assert not found.collides.any()
    assert rw.geometry(scene, rw.State.of(scene, q={"box.z": 0.05})).collides[0]


def test_forces_are_those_of_the_states_run(scene: SpaceScene) -> None:
    state = rw.simulate(scene, rw.DYNAMIC_RIGID, duration=0.1).state
    weight = rw.ask(scene, "force(world, box) >= 0", [rw.State.of(scene), state]).values[:, 0]
    assert weight == pytest.approx([0.0, 20.0], rel=1e-6)


@pytest.mark.parametrize(
    ("condition", "words"),
    [("gap(box, wall) > 0", "condition: .*gap"), ("unsafe", "unsafe: the scene states none")],
)
def test_wrong_conditions_are_refused(scene: SpaceScene, condition: str, words: str) -> None:
    with pytest.raises(rw.SceneError, match=words):
        rw.ask(scene, condition, rw.State.of(scene))


def test_arrays_of_a_wrong_shape_are_refused(scene: SpaceScene) -> None:
    with pytest.raises(rw.StateError, match=r"shape \(m, 8\) or \(m, 15\)"):
        scene.goal(np.zeros((1, 16)))
