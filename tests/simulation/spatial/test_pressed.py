"""Bodies that a finger presses on a table without inertia, beside joints with faint damping."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rungwise as rw

BODIES = (
    '<geom name="table" type="plane" size="1 1 .1"/>'
    '<body name="tee" pos="0 0 .02"><freejoint/>'
    '<geom name="bar" type="box" pos="0 .0343 0" size=".08 .02 .02" mass=".229"/>'
    '<geom name="stem" type="box" pos="0 -.0457 0" size=".02 .06 .02" mass=".171"/></body>'
)


@pytest.mark.long
@pytest.mark.parametrize("damping", [0.1, 3e-3, 3e-4, 3e-5])
def test_the_rounding_of_forces_does_not_move_a_body_that_is_pushed(damping: float, tmp_path: Path) -> None:
    """Inertia far below faint damping of the finger's joints would let it: the body sinks or rises by a tenth
    of a micrometre in a step, until it overlaps its table, or hovers where nothing seems to support it."""
    joints = "".join(
        f'<joint name="{axis}" type="slide" axis="{way}" damping="{damping}"/>'
        for axis, way in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
    )
    drives = "".join(f'<position name="{axis}" joint="{axis}" kp="3000" kv="100"/>' for axis in "xyz")
    (tmp_path / "pressed.xml").write_text(
        f'<mujoco><worldbody>{BODIES}<body name="finger" pos="-.0301 -.06 .025">{joints}'
        f'<geom name="tip" size=".01" mass="3"/></body></worldbody><actuator>{drives}</actuator></mujoco>'
    )
    scene = rw.load({
        "name": "pressed", "model": {"file": str(tmp_path / "pressed.xml")}, "duration": 0.5, "step": 2e-3,
        "controls": {"x": "0.05 * t", "y": "0.01 * t", "z": "3 * 9.81 / 3000 - 0.004 * t"},
        "contacts": [{"between": ["tee", "table"], "friction": 0.3}, {"friction": 0.5}], "goal": "t >= 0.3",
    })  # fmt: skip
    run = rw.simulate(scene, "quasistatic-rigid", tol=1e-6)
    assert run.outcome == rw.Outcome.GOAL, run.reason
    for pair in ("table|bar", "table|stem"):
        gap = run.trajectory.gap.sel(pair=pair).values
        assert np.abs(gap[np.isfinite(gap)]).max() < 2e-9
    assert run.final["tee"]["x"] > 0.005
