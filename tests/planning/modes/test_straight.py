"""Straight ways of an object: one compiled question, and the same answer as place by place."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.motion.free_paths import is_clear
from rungwise.world.planar.surroundings import PlanarSurroundings


@pytest.mark.few(2)
@pytest.mark.parametrize("least", [1e-4, 2e-3, 2e-2])
@pytest.mark.parametrize(("name", "turning"), [("corridor", 8), ("book", 8)])
def test_a_way_is_clear_in_one_call_as_place_by_place(name: str, turning: int, least: float) -> None:
    """Ways that are drawn, some of them free and some not."""
    scene = rw.load(name)
    around, q = PlanarSurroundings(scene, scene.parameters()), rw.State.of(scene).q
    rng, answers = np.random.default_rng(0), []
    pairs = np.array(
        [k for k, pair in enumerate(scene.template.contacts) if not any("finger" in own for own in pair)]
    )

    def gaps(rows: Reals) -> Reals:
        return np.array([around.touches(row, 0.0).least[pairs].min() for row in rows])

    for _ in range(150):
        a, b = q.copy(), q.copy()
        a[turning - 2 : turning + 1] += rng.uniform(-0.4, 0.4, 3)
        b[turning - 2 : turning + 1] = a[turning - 2 : turning + 1] + rng.uniform(-0.3, 0.3, 3)
        length = float(np.linalg.norm((b - a)[:turning])) + 0.13 * abs(b[turning] - a[turning])
        answers.append(is_clear(gaps, a, b, length, least))
        assert around.is_clear(a, b, length, least, pairs) == answers[-1]
    assert 10 < sum(answers) < 140
