"""Scenes of many bodies in space: what is read by its entries alone is what there is."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
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


@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
@pytest.mark.parametrize(("tied", "condim"), [(False, 3), (True, 4)])
def test_a_crowd_moves_as_it_does_without_places_of_entries(monkeypatch, tmp_path, model, tied, condim):
    (tmp_path / "crowd.xml").write_text(crowd(tied, condim))
    scene = rw.load(tmp_path / "crowd.xml")
    ends = []
    for least in (10**9, 60):
        monkeypatch.setattr(space, "CROWDED", least)
        run = SpaceSimulation(scene, model, duration=0.02)
        run.steps_taken(10)
        assert run.stepper.terms.entries.place.size == (0 if least > 60 else 76)
        assert run.stepper.contacts > 20
        ends.append(run.stepper.q)
    assert ends[1] == pytest.approx(ends[0], abs=1e-9)
    assert np.abs(ends[0] - run.space.place).max() > 1e-5
