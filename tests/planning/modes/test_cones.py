"""Kernels of contact modes, beside dense linear algebra: forces within cones, projections, supports."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from rungwise.kernel import Reals
from rungwise.planning.modes.forces.cones import PART, SLIDE, STICK, memory_for, nonnegative, presses
from rungwise.planning.modes.forces.mode_motions import projected, turn
from rungwise.world.planar.boundary import Boundary

MEMORY = memory_for(6, 4, 0, 3, 9)


def _problem(rng: np.random.Generator, kind: str) -> tuple[Reals, Reals]:
    """Columns (m, d) and what is wanted (d,), of a kind."""
    m, d = int(rng.integers(1, 15)), int(rng.integers(1, 12))
    columns, wanted = rng.normal(size=(m, d)), rng.normal(size=d)
    if kind == "equal":
        columns[m // 2 :] = columns[: m - m // 2] * rng.uniform(0.5, 2.0, (m - m // 2, 1))
    if kind == "dependent":
        columns = rng.normal(size=(m, 1)) @ rng.normal(size=(1, d))
    if kind == "weighted":
        columns[:, d // 2 :] *= 1e3
    if kind == "within":
        wanted = np.abs(rng.normal(size=m)) @ columns
    return columns, wanted


@pytest.mark.few(3)
@pytest.mark.parametrize("kind", ["plain", "equal", "dependent", "weighted", "within"])
def test_least_squares_of_forces_that_push_are_those_of_scipy(kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        columns, wanted = _problem(rng, kind)
        m, d = columns.shape
        MEMORY.columns[:m, :d], MEMORY.wanted[:d] = columns, wanted
        left, share = nonnegative(m, d, MEMORY), MEMORY.share[:m]
        assert (share >= 0.0).all()
        assert np.linalg.norm(share @ columns - wanted) == pytest.approx(left, abs=1e-7)
        assert left <= nnls(columns.T, wanted)[1] + 1e-7 * (1.0 + np.linalg.norm(wanted))


def test_the_motion_of_a_mode_is_the_nearest_that_keeps_its_contacts() -> None:
    """Beside the projection by singular values; contacts that part do not close."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        count = int(rng.integers(0, 4))
        MEMORY.normals[:count], MEMORY.tangents[:count] = rng.normal(size=(2, count, 3))
        if count > 1 and rng.random() < 0.3:
            MEMORY.normals[1] = MEMORY.normals[0]
        mode, want, motion = rng.integers(0, 3, count), rng.normal(size=3), np.empty(3)
        may = projected(mode, want, motion, MEMORY)
        held = np.vstack([MEMORY.normals[:count][mode != PART], MEMORY.tangents[:count][mode == STICK]])
        assert motion == pytest.approx(want - np.linalg.pinv(held, rcond=1e-7) @ held @ want, abs=1e-6)
        assert may == bool((MEMORY.normals[:count][mode == PART] @ motion >= -1e-8).all())
    assert SLIDE not in (PART, STICK)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_a_support_turns_forces_into_motions_by_the_inverse_of_its_rows(rank: int) -> None:
    rng = np.random.default_rng(rank)
    for _ in range(50):
        rows = rng.normal(size=(int(rng.integers(rank, 6)), rank)) @ rng.normal(size=(rank, 3))
        turn(rows, MEMORY)
        expected = np.linalg.pinv(rows.T @ rows, rcond=1e-10)
        assert MEMORY.turned == pytest.approx(expected, rel=1e-6, abs=1e-8 * np.abs(expected).max())


def test_a_point_of_an_outline_is_found_at_its_part() -> None:
    """Of a square whose corners are round."""
    ends = np.cumsum(np.tile([0.5 * np.pi * 0.1, 0.8], 4))
    corners = 0.4 * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], float)
    turns = np.repeat(0.5 * np.pi * np.arange(4), 2)
    normals = np.stack([np.cos(turns), np.sin(turns)], axis=-1).round(12)
    at, centre = np.zeros((8, 2)), np.zeros((8, 2))
    at[1::2], centre[::2] = corners + 0.1 * normals[1::2], corners
    along, arc = np.stack([-normals[:, 1], normals[:, 0]], axis=-1), np.tile([0.1, 0.0], 4)
    angle = turns - np.tile([0.5 * np.pi, 0.0], 4)
    outline = Boundary(ends, at, along, centre, arc, angle)
    for part in np.random.default_rng(0).uniform(0.0, 1.0, 200):
        point, normal = outline(np.array([part]))
        for off in (0.0, 0.05):
            found, inside = outline.part_of(point[0] + off * normal[0])
            assert min(abs(found - part), 1.0 - abs(found - part)) < 1e-9
            assert 0.0 <= inside <= 1.0


@pytest.mark.parametrize(("strongest", "may"), [((2.1, 1.1), True), ((1.9, 1.1), False), ((2.1, 0.9), False)])
def test_contacts_of_a_finger_share_its_force_where_others_of_its_contacts_are_open(
    strongest: tuple[float, float], may: bool
) -> None:
    """Two contacts of the first finger and one of the second press with 1 each."""
    sides, d = MEMORY.ring.shape
    MEMORY.share[: 3 * sides] = 1.0 / sides
    rows, ones = np.zeros((3, 1 + d, len(MEMORY.pushes))), np.ones(4)
    held, of = np.array([0, 1, -1, 2]), np.array([0, 0, 1, 1])
    assert presses(rows, ones[:3], held, of, ones, np.array(strongest), 9.0, MEMORY) == may
