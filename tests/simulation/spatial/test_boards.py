"""Bodies that slide over the seams of boxes whose faces are flush, as over one box."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import rungwise as rw
from rungwise.system.spatial.patch.seams import Box, is_covered

from .conftest import Make

BOX = '<body name="box" pos="0 0 0.05"><freejoint/><geom type="{kind}" size="{size}" mass="1"/></body>'
SLIDING = {"box": "0.06 0.05 0.05", "cylinder": "0.05 0.05"}
G, MU, DURATION = 9.81, 0.2, 0.3


def boards(ends: list[float], raised: float = 0.0) -> str:
    """A floor of boxes along x with these ends, the last of them raised."""
    geoms = [
        f'<geom type="box" pos="{(a + b) / 2} 0 {-0.05 + raised * (b == ends[-1])}"'
        f' size="{(b - a) / 2} 0.5 0.05"/>'
        for a, b in pairwise(ends)
    ]
    return f'<body name="floor">{"".join(geoms)}</body>'


def slide(make: Make, model: str, floor: str, heading: float, kind: str = "box") -> rw.SpaceRun:
    """A body that begins at 1 m/s, until it would come to rest on one board, or a little before."""
    body = BOX.format(kind=kind, size=SLIDING[kind])
    scene = make(
        f"<worldbody>{floor}{body}</worldbody>", goal=f"t >= {DURATION}", duration=1.0, step=1e-3,
        contacts=[{"friction": MU, "stiffness": 2e4, "damping": 200}],
        start={"velocities": {"box.x": float(np.cos(heading)), "box.y": float(np.sin(heading))}},
    )  # fmt: skip
    run = rw.simulate(scene, model)
    assert isinstance(run, rw.SpaceRun) and run.outcome == "goal", run.reason
    return run


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["box", "cylinder"])
@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
def test_a_floor_of_boards_is_as_one_board(make: Make, model: str, kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    inner = np.cumsum(rng.uniform(0.03, 0.2, 5)) - 0.15
    heading = float(rng.uniform(-0.5, 0.5))
    one = slide(make, model, boards([-2.0, 2.0]), heading, kind)
    many = slide(make, model, boards([-2.0, *inner.tolist(), 2.0]), heading, kind)
    way = DURATION - 0.5 * MU * G * DURATION**2
    assert np.hypot(one.final["box"]["x"], one.final["box"]["y"]) == pytest.approx(way, abs=1e-3)
    for axis in "xy":
        assert many.final["box"][axis] == pytest.approx(one.final["box"][axis], abs=2e-4)
    assert max(frame.q[2] for frame in many.frames) <= 0.05 + 1e-6


@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
def test_a_board_that_is_higher_stops_a_box(make: Make, model: str) -> None:
    run = slide(make, model, boards([-2.0, -0.1, 0.1, 2.0], raised=0.06), 0.0)
    most = max(frame.q[0] for frame in run.frames)
    assert most == pytest.approx(0.04, abs=1e-3) and run.final["box"]["x"] <= most


@pytest.mark.few(1)
@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
def test_a_body_of_boards_slides_over_an_edge_as_one_board(make: Make, model: str) -> None:
    """The boards lie on two blocks, and one of their seams comes over the edge of each."""
    blocks = '<geom type="box" pos="{x} 0 0.05" size="0.05 0.2 0.05"/>'
    found = []
    for ends in ([-0.6, 0.6], [-0.6, -0.22, -0.13, 0.18, 0.6]):
        plank = boards(ends).replace('body name="floor"', 'body name="plank" pos="0 0 0.2"')
        plank = plank.replace("<geom", "<freejoint/><geom", 1)
        scene = make(
            f"<worldbody>{blocks.format(x=-0.3)}{blocks.format(x=0.3)}{plank}</worldbody>",
            goal=f"t >= {DURATION}", duration=1.0, step=1e-3,
            contacts=[{"friction": MU, "stiffness": 2e5, "damping": 2000}],
            start={"velocities": {"plank.x": 1.0}},
        )  # fmt: skip
        run = rw.simulate(scene, model)
        assert run.outcome == "goal", run.reason
        found.append([run.final["plank"]["x"], run.final["plank"]["z"]])
    assert found[0] == pytest.approx(found[1], abs=2e-4)


@pytest.mark.parametrize(("normal", "covered"), [((0.0, -1.0, 0.0), True), ((0.0, 0.0, 1.0), False)])
def test_only_the_face_between_two_boards_is_covered(
    normal: tuple[float, float, float], covered: bool
) -> None:
    """At a corner of both, where they end along x: the side of one board, and its upper face."""
    turn, half = np.eye(3).ravel(), np.array([0.1, 0.2, 0.05])
    one, other = (Box(np.array([0.0, y, 0.0]), turn, half) for y in (0.2, -0.2))
    corner = np.array([0.1, 0.0, 0.05])
    assert is_covered(one, other, np.array(normal), 1.0, corner, 0.0) == covered
