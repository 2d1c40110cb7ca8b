"""Distances of bodies in space, of which balls about geoms tell that most need not be measured."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rungwise.world.spatial.around.distances import Distances

KINDS = ('size=".05"', 'type="box" size=".06 .03 .02"', 'type="capsule" size=".02 .06"',
         'type="cylinder" size=".03 .05"', 'type="ellipsoid" size=".06 .04 .02"')  # fmt: skip


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(12))
def test_distances_are_those_of_all_pairs_of_geoms(seed: int) -> None:
    """Of bodies of several geoms that lie about, some of them in each other, and of a tilted plane."""
    rng = np.random.default_rng(seed)
    bodies = ""
    for _ in range(6):
        geoms = "".join(
            f'<geom {KINDS[rng.integers(len(KINDS))]} pos="{x} {y} {z}" euler="{x} {y} {z}"/>'
            for x, y, z in rng.uniform(-0.1, 0.1, (int(rng.integers(1, 4)), 3)) * 10.0 ** rng.integers(2)
        )
        x, y, z = rng.uniform(-0.5, 0.5, 3)
        bodies += f'<body pos="{x} {y} {z}"><freejoint/>{geoms}</body>'
    floor = f'<geom type="plane" size="1 1 .1" pos="0 0 -.3" euler="{10 * rng.random()} 0 0"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{floor}{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    own = [np.flatnonzero(model.geom_bodyid == body).tolist() for body in range(model.nbody)]
    pairs = [(a, b) for a in range(model.nbody) for b in range(a)]
    geoms = [[(g, h) for g in own[a] for h in own[b]] for a, b in pairs]
    every = [[mujoco.mj_geomDistance(model, data, *each, 9.0, None) for each in both] for both in geoms]
    distances, all_pairs = Distances(model, geoms, 9.0), np.arange(len(pairs))
    least = np.array([min(each) for each in every])
    np.testing.assert_allclose(distances.least(data, all_pairs), least, atol=1e-9)
    some = rng.permutation(len(pairs))[:5]
    within = float(np.median(least)) + 1e-6  # none is as far as that
    told = distances.least(data, some, within)
    near = least[some] < within
    np.testing.assert_allclose(told[near], least[some][near], atol=1e-9)
    assert (told[~near] >= within).all()
    for pair in range(len(pairs)):
        gap, ends, both = distances.nearest(data, pair)
        assert (
            gap == pytest.approx(least[pair], abs=1e-9) and both == geoms[pair][int(np.argmin(every[pair]))]
        )
        assert np.linalg.norm(ends[:3] - ends[3:]) == pytest.approx(abs(gap), abs=1e-6)
