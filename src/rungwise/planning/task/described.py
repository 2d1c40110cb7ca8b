"""What a planner takes for fingers, as text and as plain values."""

from __future__ import annotations

from typing import Any

import numpy as np

from rungwise.planning.task.fingers import Finger, Taken

LED = {(False, False): "at given speeds", (True, False): "by servos",
       (False, True): "by joints at given speeds", (True, True): "by joints on servos"}  # fmt: skip
"""How a finger is led: whether by servos, and whether by joints."""


def described(taken: Taken) -> list[str]:
    """Lines on fingers, and on robots that are none with the reason; none where there are no robots."""
    if not taken.fingers and not taken.others:
        return []
    lines = ["fingers of plans by contact modes"]
    for finger in taken.fingers:
        lines += [
            f"  {finger.name:12s} {_led(finger)}; may touch {', '.join(finger.objects)}",
            _given(finger),
        ]
    return lines + [f"  {name:12s} is not a finger: {why}" for name, why in taken.others.items()]


def _led(finger: Finger) -> str:
    return f"led {LED[finger.driven.by_place, finger.is_arm]} by {', '.join(finger.inputs)}"


def _given(finger: Finger) -> str:
    """Numbers of a finger, as a line."""
    parts = [f"speed {finger.speed:.6g}", f"clearance {finger.clearance:.6g}"]
    if finger.press is not None:
        parts.append(f"presses with {finger.press[0]:.6g} to {finger.press[1]:.6g}")
    for axis, (low, high) in zip("xyz", finger.within.T.tolist(), strict=False):
        if np.isfinite([low, high]).any():
            parts.append(f"{axis} within {low:.6g} to {high:.6g}")
    parts += [f"contacts {finger.contacts}", f"reserve of friction {finger.reserve:.6g}"]
    return "    " + ", ".join([*parts, *(["may pass over objects"] if finger.over else [])])


def summary(taken: Taken) -> dict[str, Any]:
    """Fingers as plain values, and why other robots are none."""
    return {"fingers": {finger.name: _values(finger) for finger in taken.fingers}, "no_fingers": taken.others}


def _values(finger: Finger) -> dict[str, Any]:
    return {
        "led": LED[finger.driven.by_place, finger.is_arm],
        "inputs": list(finger.inputs),
        "objects": list(finger.objects),
        "speed": finger.speed,
        "clearance": finger.clearance,
        "press": None if finger.press is None else list(finger.press),
        "within": dict(zip("xyz", finger.within.T.tolist(), strict=False)),
        "contacts": finger.contacts,
        "reserve": finger.reserve,
        "over": finger.over,
    }
