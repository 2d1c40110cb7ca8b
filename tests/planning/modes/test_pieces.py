"""Objects of several boxes, drawn at random: what is seen of them, and where fingers touch them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rungwise.kernel import Reals
from rungwise.planning.modes.ground import Ground
from tests.planning.modes.test_space import fingers, ground_of

GRID, HIGH = 0.02, 0.02
L = ((0.05, 0.02, 0.03, -0.02), (0.02, 0.06, 0.0, 0.0))
CROSS = ((0.06, 0.02, 0.0, 0.0), (0.02, 0.06, 0.0, 0.0))


def drawn(seed: int) -> tuple[tuple[float, ...], ...]:
    """Half widths and middles of boxes on a grid, as of shapes that people draw: many of their corners are
    equally far from each other. Each box touches the first."""
    rng = np.random.default_rng(seed)
    first = GRID * rng.integers(1, 5, 2)
    found = [(*first, 0.0, 0.0)]
    for _ in range(rng.integers(1, 4)):
        half = GRID * rng.integers(1, 5, 2)
        middle = GRID * rng.integers(-4, 5, 2)
        found.append((*half, *np.clip(middle, -first - half + GRID, first + half - GRID)))
    return tuple(found)


SHAPES = [L, CROSS, *(drawn(seed) for seed in range(10))]


def ground_with(folder: Path, boxes: tuple[tuple[float, ...], ...]) -> tuple[Ground, Reals]:
    geoms = "".join(
        f'<geom type="box" size="{a} {b} {HIGH}" pos="{x} {y} 0" mass=".1"/>' for a, b, x, y in boxes
    )
    ground, seen = ground_of(fingers(folder, 1, "object.x >= 1", geoms, HIGH))
    return ground, seen.q


@pytest.mark.few(3)
@pytest.mark.parametrize("boxes", SHAPES)
def test_the_same_contacts_with_the_table_are_told_apart_wherever_an_object_lies(
    tmp_path: Path, boxes: tuple[tuple[float, ...], ...]
) -> None:
    """Otherwise contacts seem new in the midst of a push, which then ends."""
    ground, q = ground_with(tmp_path, boxes)
    rng, seen = np.random.default_rng(1), ground.look(q)
    own = sorted(seen.touches.features[seen.closed].tolist())
    assert 3 <= len(own) <= 4
    for _ in range(40):
        change = np.zeros(len(ground.around.owners))
        change[ground.columns] = [*rng.uniform(-0.1, 0.1, 2), 0.0, 0.0, 0.0, rng.uniform(-3.0, 3.0)]
        change[ground.columns] += rng.uniform(-1e-6, 1e-6, 6)
        there = ground.look(ground.around.changed(q, change))
        assert sorted(there.touches.features[there.closed].tolist()) == own


@pytest.mark.few(3)
@pytest.mark.parametrize("boxes", SHAPES)
def test_a_finger_that_touches_overlaps_no_box(tmp_path: Path, boxes: tuple[tuple[float, ...], ...]) -> None:
    """Also where it is placed in a corner between two of them; most places are reached."""
    ground, q = ground_with(tmp_path, boxes)
    reached, parts = 0, np.random.default_rng(2).random(60)
    _, normals = ground.around.outline(ground.body)(parts)
    for part in parts[np.abs(normals[:, 2]) < 0.5]:
        found = ground.placed(q, 0, float(part))
        if found is None:
            continue
        reached += 1
        gap = ground.around.least(found, ground.own)
        assert abs(gap[0]) < ground.closed
    assert reached > 0.5 * (np.abs(normals[:, 2]) < 0.5).sum()
