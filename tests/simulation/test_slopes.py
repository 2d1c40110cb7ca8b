"""Derivatives of a long step by a scene's inputs: closed forms, steps that are taken, smoothing, mirrors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.world.find import world_of

Array = np.ndarray
H, FINE = 0.1, 1e-6
"""A step, and how much farther bodies reach where that is to change nothing but what touches."""


def pushed(gap: float = 0.0, side: float = 1.0, off: float = 0.02) -> rw.Scene:
    """A finger on servos beside a disc on a film, `off` its centre; on the right for the side -1."""
    servo = {"kind": "servo", "stiffness": 100.0, "damping": 2.0}
    shape = {"kind": "disc", "radius": 0.02}
    x, y = -side * float(np.sqrt((0.07 + gap) ** 2 - off**2)), off
    drives = {
        "x": {"drive": servo | {"target": f"{x} + ux"}}, "y": {"drive": servo | {"target": f"{y} + uy"}},
    }  # fmt: skip
    return rw.load(
        {
            "name": "pushed",
            "parameters": {"ux": {"default": 0.0}, "uy": {"default": 0.0}},
            "inputs": ["ux", "uy"],
            "bodies": {
                "finger": {
                    "role": "robot", "mass": 0.1, "shape": shape, "motion": {"kind": "free"},
                    "pose": {"x": x, "y": y},
                    "coordinates": drives | {"angle": {"drive": {"kind": "speed", "speed": 0.0}}},
                },
                "disc": {
                    "role": "object", "mass": 0.3, "shape": {"kind": "disc", "radius": 0.05},
                    "motion": {"kind": "free"}, "pose": {"x": 0.0, "y": 0.0},
                    "coordinates": {
                        "x": {"damping": 5.0}, "y": {"damping": 5.0}, "angle": {"damping": 0.005},
                    },
                },
            },
            "contacts": [
                {"between": ["finger", "disc"], "friction": 0.5, "stiffness": 1e4, "damping": 10.0}
            ],
            "duration": H, "step": H,
        }
    )  # fmt: skip


def slopes(scene: Any, near: float, levels: list[float]) -> Array:
    """Changes (n_q, u) of where a step of the scene leads, by each input."""
    inputs = np.arange(len(levels))
    found = world_of(scene).slopes(scene.parameters(None), H, near)
    start = world_of(scene).at().q
    return found(start, 0.0, np.array(levels), inputs, np.ones(len(levels)))


def differences(scene: Any, levels: list[float], by: float = 1e-5) -> Array:
    """The same from runs of one step."""

    def end(told: Array) -> Array:
        inputs = [{"inputs": dict(zip(scene.template.inputs, told.tolist(), strict=True)), "duration": H}]
        run = rw.simulate(scene, rw.QUASISTATIC_COMPLIANT, inputs=inputs, step=H, duration=H)
        return np.asarray(run.state.q)

    unit = by * np.eye(len(levels))
    return np.array([end(np.array(levels) + one) - end(np.array(levels) - one) for one in unit]).T / (2 * by)


@pytest.mark.parametrize("levels", [[0.01, 0.0], [0.01, 0.02]], ids=["sticks", "slides"])
def test_a_finger_that_pushes_a_disc_moves_it_as_short_runs_do(levels: list[float]) -> None:
    scene = pushed()
    found, expected = slopes(scene, FINE, levels), differences(scene, levels)
    assert np.abs(expected[3:]).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=5e-3 * np.abs(expected).max())


def test_a_disc_that_is_pushed_through_its_centre_follows_by_its_share_of_the_resistances() -> None:
    """In a step h servos of stiffness K and damping D resist by K h + D, a film by its drag."""
    data = pushed(off=0.0).file.model_dump(mode="json", exclude_unset=True)
    data["contacts"][0] |= {"stiffness": 1e9, "damping": 0.0}
    found = slopes(rw.load(data), FINE, [0.01, 0.0])[:, 0]
    share = 100.0 * H / (100.0 * H + 2.0 + 5.0)
    np.testing.assert_allclose(found, [share, 0.0, 0.0, share, 0.0, 0.0], atol=1e-3)


def test_what_is_nearer_than_the_length_counts_as_closed() -> None:
    scene = pushed(gap=1e-3)
    assert not slopes(scene, FINE, [0.0, 0.0])[3:].any()
    touching, near = slopes(pushed(), FINE, [1e-3, 0.0]), slopes(scene, 2e-3, [0.0, 0.0])
    np.testing.assert_allclose(near[3, 0], touching[3, 0], rtol=0.05)


def test_a_mirrored_scene_has_mirrored_slopes() -> None:
    own, other = slopes(pushed(), 1e-3, [0.01, 0.005]), slopes(pushed(side=-1.0), 1e-3, [-0.01, 0.005])
    mirror = np.array([-1.0, 1.0, -1.0] * 2)
    np.testing.assert_allclose(other, mirror[:, None] * own * [-1.0, 1.0], atol=1e-9)


PLATE = (
    '<body name="{0}" pos="{1} 0 0"><joint name="{0}x" type="slide" axis="1 0 0"/>'
    '<joint name="{0}z" type="slide" axis="0 0 1"/><geom type="box" size=".01 .05 .05" mass=".1"/></body>'
)
SQUEEZED = {"ax": 2e-3, "az": 0.0, "bx": -2e-3, "bz": 0.0}
SERVO = '<position name="{0}" joint="{0}" kp="200" kv="5"/>'


def rolled(folder: Path) -> Any:
    """Two plates on servos hold a ball in space between them, without gravity."""
    bodies = PLATE.format("a", -0.04) + PLATE.format("b", 0.04)
    ball = f'<body name="ball"><freejoint/><geom size=".03" mass=".1" condim="{4}"/></body>'
    servos = "".join(SERVO.format(name) for name in SQUEEZED)
    file = folder / "rolled.xml"
    file.write_text(
        f'<mujoco><option gravity="0 0 0"/><worldbody>{ball}{bodies}</worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )
    return rw.load(
        {
            "name": "rolled", "model": {"file": str(file)}, "inputs": list(SQUEEZED),
            "controls": {name: name for name in SQUEEZED},
            "parameters": {name: {"default": value} for name, value in SQUEEZED.items()},
            "duration": H, "step": H,
            "contacts": [{"friction": 0.5, "stiffness": 1e5, "damping": 10.0}],
        }
    )  # fmt: skip


def test_two_plates_roll_a_ball_as_fast_as_their_servos_follow(tmp_path: Path) -> None:
    """One plate along the other's face moves the ball by half of its way, and turns it by the way over the
    diameter; both against each other turn it alone."""
    found = slopes(rolled(tmp_path), FINE, list(SQUEEZED.values()))
    follows = 200.0 * H / (200.0 * H + 5.0)
    z, turn = found[2], 2.0 * found[5]  # a quaternion has half of a small turn
    np.testing.assert_allclose(z[[1, 3]], 0.5 * follows, rtol=1e-3)
    np.testing.assert_allclose(turn[[1, 3]], [follows / 0.06, -follows / 0.06], rtol=1e-3)
    np.testing.assert_allclose(found[[1, 4, 6]], 0.0, atol=1e-6)


def test_two_plates_roll_a_ball_as_short_runs_do(tmp_path: Path) -> None:
    scene, levels = rolled(tmp_path), list(SQUEEZED.values())
    found, expected = slopes(scene, FINE, levels), differences(scene, levels)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_laws_without_derivatives_are_refused() -> None:
    scene = rw.load("planar_hand")
    with pytest.raises(rw.ModelError, match="support"):
        world_of(scene).slopes(scene.parameters(None), H, 1e-3)
