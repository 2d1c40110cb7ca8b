"""Contacts along which bodies can hardly move: what errors of their normals say is nothing."""

from __future__ import annotations

import pytest

import rungwise as rw

from .conftest import Make

ARM = """
<worldbody>
  <geom name="plate" type="box" pos="0 0 -0.012" size="0.3 0.3 0.01"/>
  <body name="base">
    <joint name="pan" axis="{tilt} 0 1"/>
    <geom name="base" type="box" size="0.05 0.05 0.001" mass="1"/>
    <body name="link" pos="0 0 0.1">
      <joint name="lift" axis="0 1 0"/>
      <geom name="link" type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="2"/>
    </body>
  </body>
</worldbody>
<actuator>
  <position name="pan" joint="pan" kp="400" kv="20" forcerange="-50 50"/>
  <position name="lift" joint="lift" kp="400" kv="20" forcerange="-50 50"/>
</actuator>
"""


@pytest.mark.few(4)
@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-11, 1e-9, 1e-8, 1e-7])
@pytest.mark.parametrize("model", ["quasistatic-rigid", "quasistatic-compliant"])
def test_a_plate_under_a_base_that_turns_in_place_says_nothing(make: Make, model: str, tilt: float) -> None:
    """A millimetre above the plate, the base turns about its normal, up to an error of that: the arm moves as
    without the plate."""
    found = []
    for under in ("", 'contype="0" conaffinity="0" '):
        text = ARM.replace("{tilt}", repr(tilt)).replace('name="plate" ', f'name="plate" {under}')
        scene = make(
            text, goal="t >= 0.1", duration=0.2, controls={"pan": "2 * t", "lift": "-t"},
            contacts=[{"stiffness": 1e5, "damping": 100}],
        )  # fmt: skip
        run = rw.simulate(scene, model)
        assert run.outcome == "goal", run.reason
        found.append([run.final["base"]["pan"], run.final["link"]["lift"]])
    assert found[0] == pytest.approx(found[1], abs=1e-9)
