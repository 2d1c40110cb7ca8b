"""A step that is far too long for what it moves is told; ordinary steps are not."""

from __future__ import annotations

from typing import Any

import pytest

import rungwise as rw

Data = dict[str, Any]
QUASISTATIC = (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)


def pyramid(damping: float) -> Data:
    """Three discs, the upper one between the others, which friction does not keep together."""
    places = {"left": (-0.1, 0.1), "right": (0.1, 0.1), "top": (0.0, 0.1 + 0.1 * 3.0**0.5)}
    bodies: Data = {
        name: {
            "role": "object",
            "mass": 1.0,
            "shape": {"kind": "disc", "radius": 0.1},
            "pose": {"x": x, "y": y},
            "motion": {"kind": "free"},
            "coordinates": {
                "x": {"damping": damping},
                "y": {"damping": damping},
                "angle": {"damping": 0.01 * damping},
            },
        }
        for name, (x, y) in places.items()
    }
    bodies["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    pairs = [("*", "ground"), ("left", "top"), ("right", "top"), ("left", "right")]
    material = {"friction": 0.2, "stiffness": 1e6, "damping": 1e3}
    return {
        "name": "pyramid",
        "gravity": [0.0, -9.81],
        "bodies": bodies,
        "contacts": [
            {"between": [one, other], **material}
            for pair in pairs
            for one, other in ([(name, "ground") for name in places] if pair[0] == "*" else [pair])
        ],
    }


@pytest.mark.parametrize("rung", QUASISTATIC, ids=lambda rung: rung.name)
def test_a_pyramid_that_falls_apart_in_one_step_is_told(rung: rw.Rung) -> None:
    run = rw.simulate(pyramid(1e-6), rung, step=1e-2, duration=0.05)
    assert any("apart" in note for note in run.notes)


@pytest.mark.parametrize("rung", QUASISTATIC, ids=lambda rung: rung.name)
def test_in_short_steps_it_comes_apart_as_far_as_the_top_needs(rung: rw.Rung) -> None:
    run = rw.simulate(pyramid(10.0), rung, step=2e-3, duration=4.0)
    assert not run.notes
    assert run.final["right"]["x"] == pytest.approx(0.2, abs=2e-3)
    assert run.final["left"]["x"] == pytest.approx(-0.2, abs=2e-3)


@pytest.mark.few(7)
@pytest.mark.parametrize("rung", rw.LADDER[1:], ids=lambda rung: rung.name)
@pytest.mark.parametrize("name", rw.shipped())
def test_of_the_scenes_that_ship_only_fingers_that_nothing_damps_jump(name: str, rung: rw.Rung) -> None:
    run = rw.simulate(rw.load(name), rung)
    told = any("apart" in note for note in run.notes)
    assert told == (name == "two_finger_free" and rung in QUASISTATIC)
