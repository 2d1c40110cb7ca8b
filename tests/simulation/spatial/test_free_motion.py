"""Flight, bounces and tumbling in space, against closed forms and laws of conservation."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.spatial.frames import Frame
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.system.spatial.spins import Spins, turn_freely

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, Array, G, free, q, run, v, world
from .rungs import DYNAMIC, named

INERTIA = np.array([2.0, 3.0, 4.0])
TOP = '<body name="b"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="2 3 4"/></body>'


def momentum(frame: Frame) -> Array:
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, frame.q[3:7])
    return np.asarray(turn.reshape(3, 3) @ (INERTIA * frame.v[3:6]))


def turning(model: mujoco.MjModel, frame: Frame) -> Array:
    """Angular momentum about the centre of the whole, and its velocity (6,), as MuJoCo has them."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = frame.q, frame.v
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return np.concatenate([data.subtree_angmom[0], data.subtree_linvel[0]])


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("h", [1e-2, 5e-3])
def test_a_thrown_ball_flies_on_the_parabola_of_the_scheme(make: Make, rung: Rung, h: float) -> None:
    """Steps that take loads at their end fall short of the parabola by g t h / 2."""
    start = {"velocities": {"b.x": 1.0, "b.z": 2.0, "b.ry": 3.0}}
    found = run(make(world(free("b", "0 0 1", 'size=".1"')), start=start, duration=0.5), rung, step=h)
    t = found.time
    exact = np.array([t, 0.0, 1.0 + 2.0 * t - 0.5 * G * t * t])
    np.testing.assert_allclose(q(found)[:3] - exact, [0.0, 0.0, -0.5 * G * t * h], atol=1e-12)
    np.testing.assert_allclose(q(found)[3:], [np.cos(1.5 * t), 0.0, np.sin(1.5 * t), 0.0], atol=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("restitution", [0.8, 1.0])
def test_a_ball_bounces_to_the_square_of_its_restitution(make: Make, restitution: float) -> None:
    scene = make(
        world(FLOOR, free("b", "0 0 1.1", 'size=".1"')), contacts=[{"restitution": restitution}], duration=1.2
    )
    found = run(scene, rw.DYNAMIC_RIGID, step=5e-4)
    height = found.trajectory.position.values[:, 2] - 0.1
    tops = height[1:-1][(height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])]
    assert tops[0] == pytest.approx(restitution**2, rel=2e-3)
    assert found.energy_gained <= 1e-9


def test_a_tumbling_body_keeps_momentum_energy_to_first_order_and_unit_quaternions(make: Make) -> None:
    spin = {"b.rx": 1.0, "b.ry": 2.0, "b.rz": 3.0}
    scene = make(world(TOP, before=NO_GRAVITY), start={"velocities": spin}, duration=0.5)
    errors = []
    for h in (4e-3, 2e-3):
        found = run(scene, rw.DYNAMIC_RIGID, step=h)
        first, last = found.frames[0], found.frames[-1]
        lost = float(np.linalg.norm(momentum(last) - momentum(first)) / np.linalg.norm(momentum(first)))
        errors.append(abs(last.energy / first.energy - 1.0))
        assert lost < 1e-12
        assert max(abs(float(np.linalg.norm(each.q[3:7])) - 1.0) for each in found.frames) < 1e-12
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_body_that_turns_far_in_a_step_keeps_its_momentum(make: Make, seed: int) -> None:
    """Of a geom and a welded body, about a centre that is not its frame's; up to a whole turn in a step."""
    rng = np.random.default_rng(seed)
    place, turn = (" ".join(f"{x:.3f}" for x in rng.uniform(-1.0, 1.0, n)) for n in (3, 4))
    body = (
        f'<body name="b"><freejoint/><geom type="box" size=".1 .2 .3" pos="{place}" quat="{turn}" mass="1"/>'
        f'<body pos="{place}" quat="{turn}"><geom type="capsule" size=".1 .2" mass=".5"/></body></body>'
    )
    spin = rng.normal(size=3)
    spin = dict(zip(("b.rx", "b.ry", "b.rz"), spin / np.linalg.norm(spin), strict=True))
    scene = make(world(body, before=NO_GRAVITY), start={"velocities": spin})
    model = scene.bind().model
    for angle in (0.01, 1.0, 6.0):
        found = run(scene, rw.DYNAMIC_RIGID, step=angle, duration=200 * angle)
        kept = np.array([turning(model, each) for each in found.frames])
        sizes = np.linalg.norm(kept[:, :3], axis=1)
        # Rounding grows where each step is a whole turn.
        np.testing.assert_allclose(sizes, sizes[0], rtol=1e-10 if angle < 6.0 else 1e-9)
        if angle < 1.0:
            np.testing.assert_allclose(kept[:, :3], kept[:1, :3].repeat(len(kept), 0), atol=1e-11 * sizes[0])
        np.testing.assert_allclose(kept[:, 3:], kept[:1, 3:].repeat(len(kept), 0), atol=1e-10)


def test_a_body_that_spins_about_its_middle_axis_turns_over(make: Make) -> None:
    """Dzhanibekov's effect; about its first and third axis it does not."""
    turned = []
    for axis, aside in (("rx", "ry"), ("ry", "rx"), ("rz", "rx")):
        start = {"velocities": {f"b.{axis}": 10.0, f"b.{aside}": 0.01}}
        scene = make(world(TOP, before=NO_GRAVITY), start=start, duration=4.0)
        found = run(scene, rw.DYNAMIC_RIGID, step=4e-3)
        column = 3 + ("rx", "ry", "rz").index(axis)
        turned.append(float(found.trajectory.velocity.values[:, column].min()))
    assert turned[1] < -9.0
    assert turned[0] > 9.9 and turned[2] > 9.9


def test_a_tumbling_body_comes_to_the_same_end_as_in_finer_steps_to_first_order(make: Make) -> None:
    start = {"velocities": {"b.rx": 1.0, "b.ry": 2.0, "b.rz": 3.0}}
    scene = make(world(TOP, before=NO_GRAVITY), start=start, duration=0.5)
    ends = [q(run(scene, rw.DYNAMIC_COMPLIANT, step=h)) for h in (4e-3, 2e-3, 1e-3)]
    ratio = np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2])
    assert ratio == pytest.approx(2.0, rel=0.1)


def test_a_step_keeps_the_momentum_of_what_turns_by_a_third_of_a_radian() -> None:
    """To rounding: the body turns by the speed that it has at the end of the step."""
    I, h, w = np.diag(INERTIA), 0.1, np.array([1.0, -2.0, 1.5])
    own = Spins(
        body=np.zeros(1, np.int64), first=np.zeros(1, np.int64), mass=np.ones(1), centre=np.zeros((1, 3)),
        inertia=I[None], inverse=np.linalg.inv(I)[None],
    )  # fmt: skip
    for times in (0.5, 1.2):
        load, speed = np.zeros(6), times * w
        turn_freely(own, np.eye(3).reshape(1, 9), np.concatenate([np.zeros(3), speed]), h, 1.0, load)
        after = np.linalg.solve(I, I @ speed + h * (load[3:] - np.cross(speed, I @ speed)))
        turned = Rotation.from_rotvec(h * after).apply(I @ after)
        assert np.abs(turned - I @ speed).max() < 2e-15 * np.abs(I @ speed).max()


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("tol", [1e-2, 1e-5])
def test_steps_of_controlled_length_lead_along_the_parabola(make: Make, rung: Rung, tol: float) -> None:
    """Also a body whose centre is not its frame's, and that turns; in few steps, however small the error."""
    body = '<body name="b" pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" pos=".1 .2 .3"/></body>'
    start = {"velocities": {"b.x": 1.0, "b.z": 2.0, "b.rz": 3.0}}
    for bodies, most in ((free("b", "0 0 1", 'size=".1"'), 20), (body, 10_000)):
        found = run(make(world(bodies), start=start, duration=0.3), rung, tol=tol)
        t = found.time
        assert q(found)[2] == pytest.approx(1.0 + 2.0 * t - 0.5 * G * t * t, abs=1e-12)
        assert v(found)[2] == pytest.approx(2.0 - G * t, abs=1e-12)
        assert found.steps <= most


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-7])
def test_a_landing_takes_few_steps_however_small_the_error(make: Make, tol: float) -> None:
    """A ball that falls by 1 m bounces with e = 0.8, and once more before the end."""
    scene = make(
        world(FLOOR, free("b", "0 0 1.1", 'size=".1"')), contacts=[{"restitution": 0.8}], duration=1.5
    )
    found = run(scene, rw.DYNAMIC_RIGID, tol=tol)
    fall = np.sqrt(2.0 / G)
    after = found.time - fall
    up = 0.8 * np.sqrt(2.0 * G)
    second = after - 2.0 * up / G
    exact = 0.1 + 0.8 * up * second - 0.5 * G * second**2
    assert second > 0.0
    assert found.steps < 60 and q(found)[2] == pytest.approx(exact, abs=10.0 * tol)
    assert found.energy_gained <= 1e-9


JOINT, GEOM = "<freejoint/>", '<geom size=".1" mass="1"/>'
OTHERS = {
    "damped": ('<joint type="free" damping="1"/>', "", "", 0.0),
    "compensated": (JOINT, ' gravcomp="0.5"', "", 0.0),
    "weightless": (JOINT, "", '<option><flag gravity="disable"/></option>', 0.0),
    "pushed": (JOINT, "", '<actuator><motor site="s" gear="0 0 1 0 0 0"/></actuator>', 0.0),
    "tilted": (JOINT, "", '<option gravity="0 0 -3"/>', -3.0),
}


@pytest.mark.parametrize("which", OTHERS)
def test_only_what_weight_alone_moves_falls_on_parabolas(make: Make, which: str) -> None:
    joint, of_body, option, falls = OTHERS[which]
    body = f'<body name="b"{of_body}>{joint}<site name="s"/>{GEOM}</body>'
    scene = make(world(body, before=option))
    own = Prepared.of(scene, {}).system.falls
    np.testing.assert_array_equal(own, [0.0, 0.0, falls, 0.0, 0.0, 0.0])
