"""Of many contacts of one face those are kept that support a body nearly as all do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rungwise.planning.modes.balance import rests
from rungwise.world.spatial.around.surroundings import _spread
from tests.planning.modes.test_space import fingers, ground_of


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", range(40))
def test_kept_contacts_span_most_of_what_all_span(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(5, 20))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = rng.normal(size=(count, 2)) * [1.0, rng.uniform(0.05, 1.0)]
    points, normals = np.pad(flat, ((0, 0), (0, 1))) @ turn.T, np.tile(turn[:, 2], (count, 1))
    kept, _, _ = _spread(np.zeros(count, np.int64), points, normals, np.arange(count))
    assert 3 <= len(kept) <= 4
    assert ConvexHull(flat[kept]).volume > 0.5 * ConvexHull(flat).volume


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(10))
def test_a_tee_stands_on_the_contacts_that_are_kept_of_its_two_geoms(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wide, long, thick = rng.uniform(0.04, 0.08), rng.uniform(0.03, 0.06), rng.uniform(0.01, 0.02)
    tee = (
        f'<geom type="box" size="{wide} {thick} .02" mass=".2"/>'
        f'<geom type="box" size="{thick} {long} .02" pos="0 {-long - thick} 0" mass=".2"/>'
    )
    ground, seen = ground_of(fingers(tmp_path, 1, "object.x >= 1", tee, 0.02))
    assert len(seen.closed) == 4 and np.ptp(seen.touches.points[seen.closed][:, 1]) > 2.0 * long
    assert rests(ground, seen, np.zeros(1, np.int64)) is not None
