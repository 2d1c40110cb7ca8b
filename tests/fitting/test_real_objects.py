"""Laws of impact, and other simulators under a push, that the benchmarks of real objects compare."""

from __future__ import annotations

from importlib.util import find_spec
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.test_examples import script

LAWS = ("newton", "poisson", "routh", "stronge")
AWRY = ((0.3, -2.0, 0.1), (-0.5, -1.0, -0.4), (0.1, -1.5, 0.6))
"""Velocities before impacts, the last one with much spin."""


@pytest.fixture
def impacts(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return script("benchmarks/impacts.py", monkeypatch)


def impact(module: ModuleType, before: Any, lever: float) -> Any:
    """An impact of a part whose centre is 1.2 radii of gyration above the contact, and `lever` beside it."""
    after = np.array([0.2, 1.0, 0.1])
    normal, tangent = np.array([0.0, 1.0, -lever]), np.array([1.0, 0.0, 1.2])
    return module.Impact(np.array(before), after, normal, tangent)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("before", AWRY)
def test_laws_of_impact_meet_their_limits(law: str, before: Any, impacts: ModuleType) -> None:
    own, found = impact(impacts, before, 0.4), getattr(impacts, law)
    approach = own.normal @ own.before
    smooth = found(own, 0.0, 0.6) - own.before
    assert smooth[0] == 0.0 and own.normal @ (own.before + smooth) == pytest.approx(-0.6 * approach)
    rough = found(own, 50.0, 0.0)
    assert (own.normal @ rough, own.tangent @ rough) == pytest.approx((0.0, 0.0), abs=1e-9)
    for mu in (0.05, 0.2, 1.0):
        after = found(own, mu, 0.6)
        normal, tangent = np.linalg.lstsq(np.array([own.normal, own.tangent]).T, after - own.before)[0]
        assert abs(tangent) <= mu * normal * (1.0 + 1e-9)
        assert law == "newton" or after @ after <= own.before @ own.before
        known = own._replace(after=after)
        assert law == "newton" or impacts.relative(known, impacts.best(known))[0] < 1e-9


@pytest.mark.parametrize("law", LAWS[1:])
def test_all_laws_agree_where_sliding_goes_on_under_the_centre(law: str, impacts: ModuleType) -> None:
    own = impact(impacts, (3.0, -1.0, 0.0), 0.0)
    assert getattr(impacts, law)(own, 0.1, 0.5) == pytest.approx(impacts.newton(own, 0.1, 0.5))


def test_stronge_gives_back_a_part_of_the_work_where_sliding_turns_round(impacts: ModuleType) -> None:
    """By Poisson's restitution a part of the impulse comes back, and that is not the same."""
    own = impact(impacts, (-0.1, -1.0, 0.3), 0.9)
    v, _, taken = impacts._compressed(own, 0.3)
    after = impacts.stronge(own, 0.3, 0.5)
    impulse = np.linalg.lstsq(np.array([own.normal, own.tangent]).T, after - v)[0][0]
    assert 0.5 * impulse * (own.normal @ after) == pytest.approx(0.25 * taken)


ENGINES = [
    "quasistatic-rigid", "dynamic-rigid", "dynamic-compliant",
    *(pytest.param(name, marks=pytest.mark.skipif(find_spec(name) is None, reason=f"{name} is missing"))
      for name in ("mujoco", "pymunk")),
]  # fmt: skip
VALUES = {"mu": 0.2, "mu_s": 0.3, "press": 0.03, "centre_x": 0.0, "centre_y": 0.0, "arm": 2e3}
VALUES |= {"arm_C": 60.0, "lag": 0.0}


def straight(real_push: ModuleType, aside: float) -> Any:
    """A rod that moves straight, and passes the centre of the part at a distance; the part goes as far."""
    speed, frames = 0.05, np.arange(60)
    reach = 0.5 * 3.0**0.5 * real_push.SIDE + real_push.ROD
    way = speed * real_push.PERIOD * frames
    path, part = np.zeros((60, 4)), np.zeros((60, 3))
    path[:, 0], path[:, 1], path[:, 3] = aside, way - reach, speed
    part[1:, 1] = way[1:] - 0.3 * real_push.MASS * 9.81 / VALUES["arm"]
    return real_push.Push(path, part, np.zeros((60, 2)))


@pytest.mark.few(1)
@pytest.mark.parametrize("engine", ENGINES)
def test_a_part_follows_a_rod_through_its_centre(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On every rung and in every simulator, and the arm's end is ahead by the friction over its stiffness."""
    real_push = script("benchmarks/real_push.py", monkeypatch)
    push = straight(real_push, 0.0)
    off = real_push.errors_of(real_push.scene_of("ellipsoid", push.rod[0]), engine, push, VALUES)
    assert off[-1, 0] < 2e-4 and off[-1, 1] < 1e-3


@pytest.mark.few(3)
@pytest.mark.parametrize("engine", ENGINES)
def test_pressure_and_its_centre_decide_how_a_part_turns(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The farther out it is pressed, the less it turns; pushed through the centre of pressure, hardly."""
    real_push = script("benchmarks/real_push.py", monkeypatch)
    push = straight(real_push, 0.02)
    scene = real_push.scene_of("ellipsoid", push.rod[0])
    changes = ({"press": 0.01}, {}, {"centre_x": 0.02})
    far, near, least = (
        real_push.errors_of(scene, engine, push, VALUES | change)[-1, 1] for change in changes
    )
    assert far > 1.2 * near and near > 3.0 * least
