"""What the geometry of contacts is worth to runs."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.models.ladder import DYNAMIC_RIGID

from .conftest import Make
from .measure import FLOOR, free, run, world
from .rungs import WITH_LOADS

TABLE = '<geom name="floor" type="box" size="2 2 .5" pos="0 0 -.5"/>'
KINDS = {
    "box": ('type="box" size=".1 .1 .1"', 0.1, ""),
    "ball": ('size=".1"', 0.1, ""),
    "capsule": ('type="capsule" size=".1 .2"', 0.1, 'euler="90 0 0"'),
    "cylinder": ('type="cylinder" size=".1 .2"', 0.2, ""),
    "lying cylinder": ('type="cylinder" size=".1 .2"', 0.1, 'euler="90 0 0"'),
    "ellipsoid": ('type="ellipsoid" size=".1 .15 .2"', 0.2, ""),
}


@pytest.mark.parametrize("ground", [FLOOR, TABLE], ids=["plane", "box"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_lies_lies_still(make: Make, kind: str, ground: str) -> None:
    """On rigid contacts to the last digits; on soft ones it only sinks in."""
    geom, height, more = KINDS[kind]
    scene = make(world(ground, free("b", f"0 0 {height}", geom, more)), duration=0.2, step=2e-3)
    for rung in WITH_LOADS:
        q = run(scene, rung).frames[-1].q
        sunk = height - q[2]
        assert (sunk > 0.0) == rung.compliant and sunk < 3e-4
        assert np.abs(np.delete(q - run(scene, rung).frames[0].q, 2)).max() < 1e-12


def test_what_is_round_rolls_without_sinking_in(make: Make) -> None:
    egg = free("b", "0 0 .2", 'type="ellipsoid" size=".1 .15 .2"')
    scene = make(world(TABLE, egg), start={"velocities": {"b.x": 0.3}}, duration=1.0, step=2e-3)
    found = run(scene, DYNAMIC_RIGID)
    assert found.time == pytest.approx(1.0)
    assert found.space is not None
    deepest = min(found.space.least_gap(frame.q) for frame in found.frames)
    assert deepest > -2e-4 * found.space.size.length


WALLS = "".join(
    f'<geom type="plane" size="1 1 .1" pos="{-0.2 * a} {-0.2 * b} 0" zaxis="{a} {b} 0"/>'
    for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [0, 2, 3, 5, 6])
def test_heaps_of_cylinders_and_ellipsoids_fall_on_rigid_contacts(make: Make, seed: int) -> None:
    draw = np.random.default_rng(seed)
    bodies = []
    for k, kind in enumerate(draw.choice(["ellipsoid", "cylinder"], 10)):
        size = " ".join(f"{x:.4f}" for x in draw.uniform(0.03, 0.08, 2 if kind == "cylinder" else 3))
        x, y, a, b = draw.uniform(-0.05, 0.05, 2).tolist() + draw.uniform(0.0, 180.0, 2).tolist()
        turned = f'euler="{a} {b} 0"'
        bodies.append(free(f"o{k}", f"{x} {y} {0.15 + 0.17 * k}", f'type="{kind}" size="{size}"', turned))
    found = run(make(world(FLOOR, WALLS, *bodies), duration=0.6, step=2e-3), DYNAMIC_RIGID)
    assert found.outcome.name == "timeout", found.reason
