"""The task of a scene among its records: names are checked, numbers written."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Free, SceneFile
from rungwise.scene.fields.task import Task, numbers_of
from rungwise.scene.fields.values import shown
from rungwise.scene.language.names import Names
from rungwise.scene.template.writer import Writer
from rungwise.wording import choices

MOST_MOVES = 50
"""Most moves of a plan."""


def write_task(writer: Writer, scene: SceneFile) -> None:
    """Write the numbers of the task. Raises SceneError for names that the scene does not have."""
    task = scene.task
    assert task is not None
    robots = [
        name for name, body in scene.bodies.items() if body.role == "robot" and isinstance(body.motion, Free)
    ]
    check_task(task, writer.names, scene.inputs, robots)
    objects = [name for name, body in scene.bodies.items() if body.role == "object"]
    check_fingers(task, robots, objects, "xy")
    for k, place in enumerate(numbers_of(task)):
        writer.put(
            "task", k, "value", place.number, place.path,
            above=place.above, at_least=place.at_least, at_most=place.at_most,
        )  # fmt: skip


def check_task(task: Task, names: Names, inputs: Iterable[str], robots: Iterable[str]) -> None:
    """Raise SceneError for names of the task that the scene does not have, and for impossible numbers of
    moves."""
    _known("instances", "parameter", task.instances, names.parameters)
    _known("uncertain", "parameter", task.uncertain, names.parameters)
    inputs = list(inputs)
    _known("inputs", "input", [each for each in task.inputs if not fits_any(each, inputs)], inputs)
    _known("transit", "free robot", task.transit, robots)
    _known("weights", "coordinate", task.weights, names.coordinates)
    names.condition(task.where, "task.where")
    for k, text in enumerate(task.keep_out):
        names.condition(text, f"task.keep_out.{k}", "unsafe")
    least, most = task.moves
    if not (least == int(least) and most == int(most) and 1 <= least <= most <= MOST_MOVES):
        raise SceneError(f"task.moves: must be two whole numbers, 1 <= least <= greatest <= {MOST_MOVES}")


def check_fingers(task: Task, robots: Iterable[str], objects: Iterable[str], axes: str) -> None:
    """Raise SceneError for fingers whose patterns fit no robot that can be one, or no object, and for axes
    that the world does not have."""
    for pattern, finger in task.fingers.items():
        path = f"task.fingers.{pattern}"
        if not fits_any(pattern, robots):
            raise SceneError(
                f"task.fingers: {shown(pattern)} names no free robot{choices(pattern, robots)}, or *"
            )
        for k, wanted in enumerate(finger.objects):
            if not fits_any(wanted, objects):
                raise SceneError(
                    f"{path}.objects.{k}: {shown(wanted)} names no object{choices(wanted, objects)}, or *"
                )
        for axis in finger.within:
            if axis not in axes or len(axis) != 1:
                raise SceneError(f"{path}.within: unknown axis {shown(axis)}{choices(axis, axes)}")


def fits_any(pattern: str, names: Iterable[str]) -> bool:
    """Whether a pattern fits one of these names."""
    return any(fnmatchcase(name, pattern) for name in names)


def _known(field: str, kind: str, given: Iterable[str], valid: Iterable[str]) -> None:
    for name in given:
        if name not in valid:
            raise SceneError(f"task.{field}: unknown {kind} {shown(name)}{choices(name, valid)}")
