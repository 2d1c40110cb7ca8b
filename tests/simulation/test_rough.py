"""Allowed errors that are not small beside the bodies are told, on the rungs where bodies have momentum."""

from __future__ import annotations

from typing import Any

import pytest

import rungwise as rw


def thrown(size: float) -> dict[str, Any]:
    """A capsule that spins falls on a floor; its reach is half its length and a radius."""
    body = {
        "role": "object",
        "shape": {"kind": "capsule", "length": 3.0 * size, "radius": size},
        "mass": 1,
        "motion": {"kind": "free"},
        "pose": {"y": 5.0 * size, "angle": 1.17},
        "coordinates": {"y": {"speed": -1.0}, "angle": {"speed": 3.868}},
    }
    floor = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    contacts = [{"between": ["body", "floor"], "stiffness": 1e6, "damping": 1e3}]
    return {"name": "thrown", "bodies": {"body": body, "floor": floor}, "contacts": contacts} | {
        "duration": 0.1, "step": 1e-3
    }  # fmt: skip


@pytest.mark.few(7)
@pytest.mark.parametrize("size", [1e-2, 1.0, 1e2])
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=str)
def test_an_error_that_is_not_small_is_told(model: rw.Rung, size: float) -> None:
    for part, told in ((3e-3, "dynamic" in model.name), (1e-3, False)):
        run = rw.simulate(thrown(size), model, tol=part * 2.5 * size)
        assert any(note.startswith("tol: ") for note in run.notes) == told, (part, run.notes)
    assert not any(note.startswith("tol: ") for note in rw.simulate(thrown(size), model).notes)
