"""Motions that are preferred, against what can be said by hand of which ones are admissible."""

from __future__ import annotations

from typing import Any

import pytest

import rungwise as rw

SEVERAL = (rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)


def block(at: float, **coordinate: Any) -> dict[str, Any]:
    return {
        "role": "object", "mass": 1, "shape": {"kind": "box", "width": 0.2, "height": 0.2},
        "pose": {"x": at}, "motion": {"kind": "slide", "axis": [1, 0]}, "coordinates": {"s": coordinate},
    }  # fmt: skip


def row(*objects: dict[str, Any], wall: float = 3.0, **more: Any) -> rw.Scene:
    """A finger that moves along x from 0 at speed 1, blocks in its way named a, b, and a wall."""
    bodies: dict[str, Any] = dict(zip("ab", objects, strict=False))
    bodies["finger"] = {
        "role": "robot", "shape": {"kind": "point"}, "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}},
    }  # fmt: skip
    bodies["wall"] = {
        "role": "obstacle",
        "pose": {"x": wall},
        "shape": {"kind": "halfplane", "normal": [-1, 0]},
    }
    contacts = [{"between": ["finger", "a"]}] + [{"between": [name, "wall"]} for name in "ab"[: len(objects)]]
    if len(objects) > 1:
        contacts.append({"between": ["a", "b"]})
    return rw.load(
        {"name": "row", "duration": 1, "step": 1e-3, "bodies": bodies, "contacts": contacts} | more
    )


def place(scene: rw.Scene, model: rw.Rung, motion: dict[str, float], **options: Any) -> dict[str, float]:
    """Where the blocks are in the end."""
    run = rw.simulate(scene, model, motion=motion, **({"tol": 1e-3} | options))
    assert run.outcome.name == "timeout" and run.worst_residual < 1e-8
    return {name: run.final[name]["s"] for name in "ab" if name in run.final}


@pytest.mark.parametrize("options", [{}, {"tol": None, "step": 1e-3}], ids=("controlled", "fixed"))
@pytest.mark.parametrize("model", SEVERAL, ids=str)
def test_a_pushed_block_goes_with_the_finger_or_to_the_wall(model: rw.Rung, options: dict[str, Any]) -> None:
    scene = row(block(0.6))
    assert place(scene, model, {}, **options)["a"] == pytest.approx(0.5, abs=2e-4)
    assert place(scene, model, {"a.s": -1e3}, **options)["a"] == pytest.approx(0.5, abs=2e-4)
    assert place(scene, model, {"a.s": 1e3}, **options)["a"] == pytest.approx(2.3, abs=2e-4)


def test_nothing_moves_before_it_must() -> None:
    scene = row(block(1.6))
    assert place(scene, rw.QUASISTATIC_RIGID, {"a.s": 1e3})["a"] == 0.0


def test_a_speed_between_the_extremes_is_kept() -> None:
    """Twice as fast as the finger for the half second that is left: 1, up to the time of one nominal step."""
    assert place(row(block(0.6)), rw.KINEMATIC, {"a.s": 2.0})["a"] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("model", SEVERAL[:2], ids=str)
def test_a_block_that_may_rest_stands_in_the_way(model: rw.Rung) -> None:
    """b rests while a comes; once the finger has come, too, b must move, and goes as far as it likes."""
    late = row(block(0.6), block(0.9))
    assert place(late, model, {"a.s": 1e3}, duration=0.55) == pytest.approx({"a": 0.1, "b": 0.0}, abs=1e-3)
    assert place(late, model, {"a.s": 1e3}) == pytest.approx({"a": 2.1, "b": 2.0}, abs=2e-3)
    assert place(late, model, {"b.s": 1e3}) == pytest.approx({"a": 0.5, "b": 2.0}, abs=2e-3)


def test_friction_of_a_support_leaves_one_motion() -> None:
    scene = row(block(0.6, dry_friction=0.5))
    for motion in ({}, {"a.s": 1e3}, {"a.s": -1e3}):
        assert place(scene, rw.QUASISTATIC_RIGID, motion)["a"] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.long
def test_what_nothing_stops_ends_far_away() -> None:
    """Ten extents of the scene from its start, the greatest preferred speed for as short a time."""
    scene = row(block(0.6), wall=1e6)
    assert 10.0 < place(scene, rw.KINEMATIC, {"a.s": 1e3})["a"] < 1e7


def test_wrong_input() -> None:
    scene = row(block(0.6))
    with pytest.raises(rw.ModelError, match=r"motion: unknown coordinate 'b.s' .*; valid: a.s, finger.s"):
        rw.simulate(scene, rw.KINEMATIC, motion={"b.s": 1.0})
    with pytest.raises(rw.ModelError, match=r"motion.a.s: must be a finite number"):
        rw.simulate(scene, rw.KINEMATIC, motion={"a.s": float("nan")})
    with pytest.raises(rw.ModelError, match="inertia decides on the dynamic-rigid rung"):
        rw.simulate(scene, rw.DYNAMIC_RIGID, motion={"a.s": 1.0})
