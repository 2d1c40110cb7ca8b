"""Joints with which arms touch objects: when a search for them ends, and what it ends with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rungwise.kernel import Reals
from rungwise.planning.modes.joints.inverse_kinematics import (
    Reach,
    _faced,
    _is_at,
    _touching,
    sides_of,
    to_posture,
)
from tests.planning.modes.test_space import fingers, ground_of


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


def slides(count: int, posture: Reals | None = None) -> Any:
    """An arm of slides, whose joints are the place."""
    return stub(
        joints=lambda q: q, posed=lambda _q, joints: joints, rates=lambda _q: np.eye(count),
        hinges=np.zeros(count, bool), columns=np.arange(count), posture=posture,
        bounds=(np.full(count, -9.0), np.full(count, 9.0)),
    )  # fmt: skip


def wanted(size: float = 1.0, exact: float = 1e-3) -> Reach:
    return Reach(0, 1.0, 0, np.zeros(3), np.array([0.0, 0.0, 1.0]), size, exact)


def asked(gap: Callable[[int], float]) -> tuple[int, float]:
    """How often an arm looks at its gap, which becomes this from step to step, and what is left."""
    count = 0

    def near(_q: Reals, _pair: int) -> Any:
        nonlocal count
        count += 1
        return stub(
            gap=0.1 * gap(count - 1), point=np.zeros(3), across=np.zeros((0, 3)), rows=np.ones((1, 1))
        )

    _, off = _touching(stub(near=near), slides(1), np.zeros(1), wanted(exact=1e-4), None)
    return count, 10.0 * float(np.abs(off).max())


@pytest.mark.parametrize("left", [1e-2, 1.0])
def test_an_arm_that_comes_no_nearer_is_given_up(left: float) -> None:
    assert asked(lambda _: left)[0] < 12
    assert asked(lambda k: left * 0.995**k)[0] < 12


@pytest.mark.parametrize("rate", [0.5, 0.7, 0.78])
def test_an_arm_that_comes_nearer_slowly_or_by_fits_and_starts_is_not(rate: float) -> None:
    assert asked(lambda k: rate**k)[1] < 1e-3
    assert asked(lambda k: 0.5 ** (k // 2))[1] < 1e-3
    assert asked(lambda k: (1.0, 1.5, 1.2, 0.9)[k] if k < 4 else 0.5 ** (k - 2))[1] < 1e-3


@pytest.mark.parametrize(("away", "there"), [(0.05, True), (0.4, False)])
def test_a_touch_is_there_within_a_tenth_of_the_size(away: float, there: bool) -> None:
    for size in (0.1, 3.0):
        around = stub(near=lambda *_, size=size: stub(point=np.array([0.0, away * size, 0.0])))
        assert _is_at(around, np.zeros(1), wanted(size)) == there


@pytest.mark.parametrize("size", [0.1, 2.0])
def test_a_flat_side_comes_before_its_place_and_faces_it(size: float) -> None:
    """Of a body on three slides, from where it is at first."""
    around = stub(
        poses=lambda q: np.array([[*q, 1.0, 0.0, 0.0, 0.0]]),
        rows=lambda *_: np.tile(np.eye(3), (2, 1))[:, None],
    )
    rng = np.random.default_rng(0)
    for far in (5e-4, 0.1, 1.0):
        begun = size * (np.array([0.0, 0.0, 0.05]) + far * np.array([1.0, 0.0, 0.0]))
        begun[:2] = begun[:2] * rng.choice([-1.0, 1.0], 2)
        found = _faced(around, slides(3), begun, wanted(size), np.zeros(3), np.array([0.0, 0.0, -1.0]))
        assert found is not None
        assert 0.01 * size < found[2] < 0.2 * size and np.abs(found[:2]).max() < 3e-4 * size


SIDES = {
    "plate": ('type="box" size=".06 .04 .02"', [(0.0, 0.0, 0.02)]),
    "bar": ('type="box" size=".06 .04 .036"', [(0.0, 0.0, 0.036), (0.0, 0.04, 0.0)]),
    "cylinder": ('type="cylinder" size=".03 .05"', [(0.0, 0.0, 0.05)]),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", list(SIDES))
def test_palms_lie_on_their_largest_flat_sides(name: str, tmp_path: Path) -> None:
    """And on those nearly as large, each with the opposite one; not on what is round."""
    geom, ends = SIDES[name]
    ground, _ = ground_of(fingers(tmp_path, 1, "object.x >= 1", f'<geom {geom} mass=".4"/>'))
    found = sides_of(ground.around, ground.body)
    assert len(found) == 2 * len(ends)
    for end in ends:
        for sign in (-1.0, 1.0):
            own = sign * np.array(end)
            middle, normal = min(found, key=lambda side, own=own: float(np.linalg.norm(side[0] - own)))
            assert np.abs(middle - own).max() < 0.004
            assert normal == pytest.approx(own / np.linalg.norm(own), abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_joints_to_spare_come_to_their_posture_within_a_search(seed: int) -> None:
    """Where nothing else asks for them; and none goes beyond."""
    rng = np.random.default_rng(seed)
    posture, q = rng.uniform(-1.0, 1.0, (2, 4))
    slope, far = np.zeros((1, 4)), [float(np.abs(posture - q).max())]
    slope[0, 0] = 1.0
    q[0] = posture[0]
    for _ in range(15):
        q = q + to_posture(slides(4, posture), q, slope, posture)
        far.append(float(np.abs(posture - q).max()))
    assert far[-1] < 0.1 * far[0] and far == sorted(far, reverse=True)


@pytest.mark.parametrize("seed", range(3))
def test_joints_go_to_their_posture_where_a_touch_moves_by_rounding_alone(seed: int) -> None:
    """What the touch asks for is kept to a millionth or so; a row that says the same again, nearly, asks for
    nothing."""
    own, other, spare = np.linalg.qr(np.random.default_rng(seed).normal(size=(4, 4)))[0][:3]
    arm = slides(4, own + other + spare)
    for slope in (np.array([own, other]), np.array([2.0 * own, other + own])):
        change = to_posture(arm, np.zeros(4), slope, arm.posture)
        assert np.abs(slope @ change).max() < 4e-6 * np.abs(slope).max() and spare @ change > 0.0
    change = to_posture(arm, np.zeros(4), np.array([own, own + 4e-4 * other]), arm.posture)
    assert other @ change > 0.9 * (spare @ change)
