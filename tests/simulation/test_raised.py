"""Robots that are raised off the plane: what they touch, and where they may come down."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

SIDE, RADIUS, WAY = 0.08, 0.01, 0.1
SPEEDS, SERVOS = "speeds", "servos"


def hop(drive: str, **changes: Any) -> dict[str, Any]:
    """A finger to the left of a box that lies on a table, and the input that raises it."""

    def led(name: str) -> dict[str, Any]:
        if drive == SPEEDS:
            return {"kind": "speed", "speed": name}
        return {"kind": "servo", "target": name, "stiffness": 500, "damping": 20, "limit": 20}

    start = 0.0 if drive == SPEEDS else -WAY
    finger = {
        "role": "robot", "shape": {"kind": "disc", "radius": RADIUS}, "pose": {"x": -WAY}, "mass": 0.1,
        "motion": {"kind": "free"}, "raised": "up",
        "coordinates": {
            "x": {"drive": led("ux")}, "y": {"drive": led("uy")},
            "angle": {"drive": {"kind": "speed", "speed": 0}},
        },
    }  # fmt: skip
    box = {
        "role": "object", "shape": {"kind": "box", "width": SIDE, "height": SIDE}, "mass": 0.5,
        "motion": {"kind": "free"}, "support": {"friction": 0.4, "gravity": 9.81},
    }  # fmt: skip
    scene = {
        "name": "hop", "inputs": ["ux", "uy", "up"],
        "parameters": {"ux": {"default": start}, "uy": {"default": 0}, "up": {"default": 0}},
        "bodies": {"finger": finger, "box": box},
        "contacts": [{"between": ["finger", "box"], "friction": 0.5, "stiffness": 1e5, "damping": 100}],
        "duration": 20, "step": 1e-3, "tolerance": 1e-4,
    }  # fmt: skip
    return scene | changes


def led(
    drive: str, *steps: tuple[float, float, bool], at: float = -WAY, up: bool = False
) -> list[rw.Segment]:  # fmt: skip
    """A finger led to each x in so many seconds, raised or not; where it is raised or lowered, at once."""
    found = list[rw.Segment]()
    for x, took, raised in steps:
        if raised != up:
            held = 0.0 if drive == SPEEDS else at
            found.append(rw.Segment({"ux": held, "up": 0.02 * raised}, 0.1))
        level = (x - at) / took if drive == SPEEDS else x
        found.append(rw.Segment({"ux": level}, took, ramp=drive == SERVOS))
        at, up = x, raised
    return found


@pytest.mark.few(6)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("drive", [SPEEDS, SERVOS])
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=lambda model: model.name)
def test_a_raised_finger_passes_over_a_box_and_pushes_it_from_behind(
    model: rw.Rung, drive: str, tol: float | None
) -> None:
    scene = rw.load(hop(drive))
    way = led(drive, (WAY, 2.0, True), (0.02, 1.0, False))
    run = rw.simulate(scene, model, inputs=way, tol=tol)
    assert run.final["box"]["x"] == pytest.approx(run.final["finger"]["x"] - SIDE / 2 - RADIUS, abs=1e-4)
    above = rw.simulate(scene, model, inputs=led(drive, (0.0, 1.0, True)), tol=tol)
    assert above.final["box"]["x"] == 0.0
    assert above.trajectory["gap"].to_numpy()[-1] == pytest.approx(0.02)
    assert not rw.ask(scene, "gap(finger, box) < 0.01", above.state).holds[0]
    on = led(drive, (WAY, 1.0, True), (0.02, 1.0, False), at=0.0, up=True)
    goes_on = rw.simulate(scene, model, state=above.state, inputs=on, tol=tol)
    assert goes_on.final["box"]["x"] < -0.01
    heights = above.trajectory["raised"].sel(body="finger").to_numpy()
    assert heights[-1] == 0.02


@pytest.mark.few(6)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("ramp", [False, True])
@pytest.mark.parametrize("drive", [SPEEDS, SERVOS])
@pytest.mark.parametrize("model", rw.LADDER[1:], ids=lambda model: model.name)
def test_one_that_is_lowered_onto_the_box_ends_the_run_there(
    model: rw.Rung, drive: str, ramp: bool, tol: float | None
) -> None:
    down = [rw.Segment({"ux": 0.0}), rw.Segment({"up": 0.0}, 0.1, ramp=ramp), rw.Segment({}, 0.1)]
    way = [*led(drive, (0.0, 1.0, True)), rw.Segment(down[0].inputs, 0.0), *down[1:]]
    run = rw.simulate(hop(drive), model, inputs=way, tol=tol)
    assert run.outcome == rw.Outcome.INVALID
    assert run.reason.startswith("finger is lowered onto box, which it overlaps by 0.0")
    assert abs(run.final["box"]["x"]) < 1e-15


def test_walls_and_robots_stop_what_is_raised() -> None:
    scene = hop(SERVOS)
    scene["bodies"]["wall"] = {"role": "obstacle", "shape": {"kind": "box", "width": 0.02, "height": 0.2}}
    scene["bodies"]["box"]["pose"] = {"x": 1.0}
    scene["contacts"].append({"between": ["finger", "wall"], "stiffness": 1e5, "damping": 100})
    run = rw.simulate(scene, "quasistatic-rigid", inputs=led(SERVOS, (0.0, 1.0, True)), tol=1e-3)
    assert run.final["finger"]["x"] == pytest.approx(-0.01 - RADIUS, abs=1e-5)


def test_contacts_forget_what_they_were_when_a_finger_rises() -> None:
    """A finger that presses lets go at once, and the box rests."""
    way = led(SERVOS, (-0.03, 1.0, False), (-0.03, 0.5, True))
    run = rw.simulate(hop(SERVOS), "dynamic-compliant", inputs=way, tol=1e-3)
    pushes = run.trajectory["contact_force"].to_numpy()[..., 0].max(axis=1)
    assert pushes.max() > 1.0 and pushes[-1] == 0.0
    assert np.abs(run.trajectory["velocity"].to_numpy()[-1]).max() < 1e-6


WRONG = (
    ({"box": "up"}, "bodies.box.raised: only robots are raised off the plane, and box is an object"),
    ({"finger": -1.0}, "bodies.finger.raised: -1 must be >= 0"),
    ({"finger": "upp"}, "bodies.finger.raised: "),
)


@pytest.mark.parametrize(("raised", "words"), WRONG)
def test_each_mistake_is_one_line(raised: dict[str, Any], words: str) -> None:
    scene = hop(SPEEDS)
    for name, value in raised.items():
        scene["bodies"][name]["raised"] = value
    with pytest.raises(rw.SceneError, match=r"\A[^\n]+\Z") as caught:
        rw.load(scene)
    assert str(caught.value).startswith(words)


def test_what_touches_no_object_is_not_raised() -> None:
    scene = hop(SPEEDS, contacts=[])
    with pytest.raises(rw.SceneError, match="finger touches no object"):
        rw.load(scene)
