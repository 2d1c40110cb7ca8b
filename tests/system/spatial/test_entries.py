"""Scenes of many bodies in space: what is read by its entries alone is what there is."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.block import Block
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.system.spatial import space

pytest.importorskip("mujoco")

BOX = """
<body name="box{0}" pos="{1} {2} {3}"><freejoint/>
<geom name="box{0}" type="box" size="0.1 0.1 0.1" mass="1" condim="{4}"/></body>"""
ARM = """
<body name="upper" pos="-0.9 0 0.35"><joint name="shoulder" axis="0 1 0" range="-1 1"/>
<geom name="upper" type="capsule" fromto="0 0 0 0.4 0 0" size="0.05" mass="1"/>
<body name="lower" pos="0.4 0 0"><joint name="elbow" axis="0 1 0" range="-1 1" damping="0.1"/>
<geom name="lower" type="capsule" fromto="0.1 0 0 0.35 0 0" size="0.05" mass="0.5"/></body>
<body name="other" pos="0.4 0 0"><joint name="wrist" axis="1 0 0" stiffness="3"/>
<geom name="other" type="box" pos="0.1 0 0.2" size="0.02 0.02 0.1" mass="0.2"/></body></body>"""
TENDON = """<tendon><fixed name="tie" stiffness="5" damping="0.2"><joint joint="elbow" coef="1"/>
<joint joint="wrist" coef="0.5"/></fixed></tendon>"""


def crowd(tied: bool, condim: int) -> str:
    """Columns of boxes, an arm with branches and travel limits that leans on one, and perhaps a tendon."""
    boxes = "".join(
        BOX.format(3 * i + j, 0.21 * i, 0.02 * j, 0.1005 + 0.2005 * j, condim)
        for i in range(4)
        for j in range(3)
    )
    floor = '<geom name="floor" type="plane" size="5 5 0.1"/>'
    return f"<mujoco><worldbody>{floor}{boxes}{ARM}</worldbody>{TENDON if tied else ''}</mujoco>"


PUSHED = {"box4.x": 0.2, "box4.rz": -0.3}


@pytest.mark.parametrize(
    ("model", "tied", "condim", "speeds"),
    [
        ("dynamic-rigid", False, 3, {}),
        ("dynamic-rigid", True, 4, {}),
        ("dynamic-compliant", False, 3, {}),
        ("dynamic-compliant", True, 4, {}),
        ("kinematic", False, 3, PUSHED),
        ("dynamic-rigid", True, 4, PUSHED),
    ],
)
def test_a_crowd_moves_as_it_does_where_all_columns_are_kept(
    monkeypatch, tmp_path, model, tied, condim, speeds
):
    (tmp_path / "crowd.xml").write_text(crowd(tied, condim))
    scene = rw.load(
        {"name": "crowd", "model": {"file": str(tmp_path / "crowd.xml")}, "speeds": speeds, "duration": 0.02}
    )
    ends = []
    for least in (10**9, 60):
        monkeypatch.setattr(space, "CROWDED", least)
        run = SpaceSimulation(scene, model, duration=0.02)
        run.steps_taken(10)
        terms, n = run.stepper.terms, run.space.model.nv
        assert terms.entries.place.size == (0 if least > 60 else n + 1)
        assert (terms.rows.shape[1], terms.inertia.shape[1]) == ((n, n) if least > 60 else (12, 6))
        assert run.stepper.contacts > (20 if model.startswith("dynamic") else 0)
        ends.append(run.stepper.q)
    assert ends[1] == pytest.approx(ends[0], abs=1e-9)
    assert np.abs(ends[0] - run.space.place).max() > 1e-5


def held(*blocks: Block) -> int:
    """Bytes of the arrays of blocks and of those in them."""
    fields = [getattr(block, name) for block in blocks for name in block._layout.fields]
    return sum(held(field) if isinstance(field, Block) else field.nbytes for field in fields)


def spheres(count: int, height: float) -> str:
    """Spheres side by side above a floor."""
    side = int(np.ceil(count**0.5))
    bodies = "".join(
        f'<body pos="{0.25 * (i % side)} {0.25 * (i // side)} {height}"><freejoint/><geom size="0.1"/></body>'
        for i in range(count)
    )
    return f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{bodies}</worldbody></mujoco>'


@pytest.mark.parametrize("height", [0.1, 0.11])
def test_what_a_run_of_many_bodies_holds_grows_as_their_number(tmp_path, height):
    """Terms and problem of bodies that rest or fall, bounds of what velocities do to each, and memories."""
    each, memories = [], []
    for count in (150, 300):
        (tmp_path / "many.xml").write_text(spheres(count, height))
        run = SpaceSimulation(rw.load(tmp_path / "many.xml"), "dynamic-rigid", duration=0.004, step=1e-3)
        run.steps_taken(3)
        assert run.stepper.contacts == (count if height == 0.1 else 0)
        bytes_held = held(run.stepper.terms, run.stepper.problem, run.space.mechanism.rates)
        each.append(bytes_held / count)
        memories.append(run.memory().nbytes / count)
    assert each[1] == pytest.approx(each[0], rel=0.02)
    assert each[1] < 2e4
    assert memories[1] == pytest.approx(memories[0], rel=0.05)
