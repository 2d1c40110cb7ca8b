"""The fingers of a hand, as text and as plain values."""

from __future__ import annotations

from typing import Any

from rungwise.planning.modes.hands.hand import Finger, Hand, hand_of
from rungwise.planning.motion.placements import placed_part
from rungwise.planning.task.fingers import Taken, with_fingers
from rungwise.planning.task.task import Task


def turning(task: Task) -> Hand | None:
    """The hand with which a task is planned; None where there is none, or where contact modes lead its
    fingers."""
    goal = task.scene.file.goal or ""
    return None if with_fingers(task).is_led or placed_part(goal) is None else hand_of(task)


def without_links(task: Task, hand: Hand, taken: Taken) -> Taken:
    """What is known of robots that are no part of a hand."""
    names = task.scene.template.bodies
    own = {names[body] for finger in hand.fingers for body in finger.bodies}
    return taken._replace(
        fingers=tuple(finger for finger in taken.fingers if finger.name not in own),
        others={name: why for name, why in taken.others.items() if name not in own},
    )


def described(task: Task, hand: Hand) -> list[str]:
    """Lines on the fingers of a hand, and with what each may touch the object."""
    lines = [f"hand that leads {task.scene.template.bodies[hand.body]}: chains of joints on servos"]
    return lines + [
        f"  {finger.driven.body:12s} led by {', '.join(_inputs(task, finger))}; touches with"
        f" {', '.join(_tips(task, hand, finger))}"
        for finger in hand.fingers
    ]


def summary(task: Task, hand: Hand) -> dict[str, Any]:
    """The hand as plain values."""
    fingers = {
        finger.driven.body: {"inputs": _inputs(task, finger), "touches_with": _tips(task, hand, finger)}
        for finger in hand.fingers
    }
    return {"hand": {"object": task.scene.template.bodies[hand.body], "fingers": fingers}}


def _inputs(task: Task, finger: Finger) -> list[str]:
    """Names of the inputs that lead a finger and no other."""
    names, own = task.scene.template.inputs, finger.driven
    rows = own.led.matrix[finger.loose]
    return [names[column] for k, column in enumerate(own.columns) if rows[:, k].any()]


def _tips(task: Task, hand: Hand, finger: Finger) -> list[str]:
    """Names of the bodies with which a finger touches the object."""
    names, pairs = task.scene.template.bodies, task.scene.template.contacts
    whole = names[hand.body]
    return [a if b == whole else b for a, b in (pairs[k] for k in finger.touching)]
