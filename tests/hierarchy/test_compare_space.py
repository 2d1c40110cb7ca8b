"""The hierarchy in space against closed forms: yield under a load, momentum against damping, restitution."""

from __future__ import annotations

import json
import math
from pathlib import Path as File

import numpy as np
import pytest

import rungwise as rw
from rungwise.hierarchy.inputs import inputs_of
from rungwise.hierarchy.limits import SAME, STAYS, TENDS, Fit, fit
from rungwise.hierarchy.motions import Bench, apart
from rungwise.hierarchy.paths import LIGHT, PROPORTIONAL, RATIO, Path
from rungwise.scene.space import load_space
from rungwise.world.find import world_of
from rungwise.world.matching import damping_ratio, restitution
from rungwise.world.spatial.matching import matched as matched_in_space

BALL = 0.2
"""Diameter of the ball, the extent of its scene."""
CART = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="cart">
      <joint name="s" type="slide" axis="1 0 0" damping="4"/>
      <geom size="0.1" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><motor name="pull" joint="s"/></actuator>
</mujoco>
"""
FORCE, DRAG, MASS = 0.8, 4.0, 0.5


def benched(scene: rw.SpaceScene, duration: float, **parameters: float) -> Bench:
    values = scene.parameters(parameters)
    extent, levers = world_of(scene).measures(values, duration)
    match = matched_in_space(scene, values, duration)
    return Bench(match, inputs_of(scene, values), duration, extent, levers, 1)


def along(bench: Bench, path: Path, richer: rw.Rung, simpler: rw.Rung) -> Fit:
    return fit(bench, path, richer, simpler, bench.inputs.own[None], np.array([bench.duration]))


def in_space(name: str) -> rw.SpaceScene:
    scene = rw.load(name)
    assert isinstance(scene, rw.SpaceScene)
    return scene


@pytest.fixture
def cart(tmp_path: File) -> rw.SpaceScene:
    """A cart on a damped slide, pulled by a force."""
    (tmp_path / "cart.xml").write_text(CART)
    scene = rw.load(
        {
            "name": "cart", "model": {"file": str(tmp_path / "cart.xml")}, "duration": 1.0, "step": 0.01,
            "parameters": {"effort": {"default": FORCE}}, "controls": {"pull": "effort"},
        }
    )  # fmt: skip
    assert isinstance(scene, rw.SpaceScene)
    return scene


@pytest.mark.long
def test_a_pressed_ball_yields_in_inverse_proportion_to_stiffness() -> None:
    bench = benched(in_space("ball"), 0.05, v=0.0)
    assert bench.extent == pytest.approx(BALL)
    for path, richer, simpler in (
        (RATIO, rw.DYNAMIC_COMPLIANT, rw.DYNAMIC_RIGID),
        (PROPORTIONAL, rw.QUASISTATIC_COMPLIANT, rw.QUASISTATIC_RIGID),
    ):
        found = along(bench, path, richer, simpler)
        assert found.verdict == TENDS and found.order == pytest.approx(1.0, abs=0.02), found
        assert found.distances[0] == pytest.approx(9.81 / 1e6 / BALL, rel=1e-3)
    assert along(bench, LIGHT, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID).verdict == SAME


def test_a_block_on_a_slope_is_as_far_apart_whatever_way_the_slope_falls() -> None:
    """Four corners share the weight, and the slope falls along an edge or a diagonal."""
    away = []
    for heading in (0.0, 0.5 * math.pi, 2.0):
        bench = benched(in_space("slope"), 0.5, heading=heading)
        own, end = bench.inputs.own[None], np.array([0.5])
        runs = [bench.run(rung, own, end, 1e-6) for rung in rw.LADDER[2:]]
        assert apart(runs[0], runs[2])[0] < 1e-12
        away.append(apart(runs[1], runs[0])[0])
    assert away[0] == pytest.approx(away[1], rel=1e-4)
    assert away == pytest.approx([9.81 / 4e6 / bench.extent] * 3, rel=0.1)


def test_order_in_inertia_is_one_where_a_joint_has_damping(cart: rw.SpaceScene) -> None:
    bench = benched(cart, 1.0)
    found = along(bench, LIGHT, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert found.verdict == TENDS and found.order == pytest.approx(1.0, abs=0.02), found
    behind = FORCE / DRAG * 0.1 * MASS / DRAG
    assert found.distances[0] == pytest.approx(behind / bench.extent, rel=0.02)


@pytest.mark.long
def test_restitution_and_damping_say_the_same() -> None:
    """A ball thrown at the floor without gravity leaves it with e of its speed on both dynamic rungs."""
    thrown = json.loads(in_space("ball").stored)
    thrown["model"]["set"] = {"option": {"gravity": [0, 0, 0]}}
    thrown |= {"start": {"places": {"ball.z": 0.11}, "velocities": {"ball.z": -1}}, "goal": None}
    scene, end = load_space(thrown), 0.1
    for given in ({"restitution": 0.6}, {"damping": 2.0 * math.sqrt(1e5) * damping_ratio(0.6)}):
        bench = benched(scene, end, stiffness=1e5, **given)
        (ratio,) = bench.matched.ratios
        assert restitution(ratio) == pytest.approx(0.6, rel=1e-6)
        assert bench.matched.parameters["match_bounce_0"] == pytest.approx(0.6, rel=1e-6)
        own, until = bench.inputs.own[None], np.array([end])
        for rung in (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT):
            heights = [bench.run(rung, own, until, None, step=h).places[0, :, 0, 2] for h in (2e-4, 1e-4)]
            height = (2.0 * heights[1] - heights[0]) * bench.extent  # steps are of first order
            assert (height[-1] - height[29]) / (0.5 * end) == pytest.approx(0.6, rel=0.01)


@pytest.mark.long
def test_a_rolling_ball_has_no_quasistatic_limit() -> None:
    bench = benched(in_space("ball"), 0.1)
    found = along(bench, LIGHT, rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID)
    assert found.verdict == STAYS, found


def test_places_know_no_sign_of_a_quaternion() -> None:
    scene = in_space("ball")
    places = world_of(scene).marks(scene.parameters())
    q = np.array([0.3, -0.2, 0.1, 0.5, 0.1, -0.7, 0.5])
    q[3:] /= np.linalg.norm(q[3:])
    flipped = q * np.array([1, 1, 1, -1, -1, -1, -1])
    assert np.allclose(places(q), places(flipped), atol=1e-15)
    assert places.names[:2] == ("ball centre", "ball x axis")
    assert places(q)[0] == pytest.approx(q[:3])
    assert np.allclose(places(q)[1:] @ places(q)[1:].T, np.eye(3))


def test_definition_1_and_its_counterexample(cart: rw.SpaceScene, tmp_path: File) -> None:
    """The kinematic rung knows no force: it rests, and no pull within the interval lets the other rest."""
    found = rw.compare(cart, "kinematic", samples=0, threads=1)
    (pair,) = found.pairs
    assert pair.verdict == "fails" and not found.ok
    assert pair.nearest.same[0] == pytest.approx(FORCE / DRAG / found.extent)
    least = 0.5 * FORCE / DRAG / found.extent
    assert least <= pair.nearest.value < 0.7 * pair.nearest.same[0]
    assert "cart" in str(found) and "no pair of geoms touches" in str(found)
    again = rw.load_counterexample(found.save(tmp_path)[1])
    assert again.apart(*again.replay()) == pytest.approx(again.distance, rel=1e-6)
