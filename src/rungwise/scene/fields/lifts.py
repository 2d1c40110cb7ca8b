"""Inputs that raise fingers off the plane, where a task lets these pass over objects and names no such
input."""

from __future__ import annotations

from fnmatch import fnmatchcase

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Parameter, SceneFile

HIGHEST = 1.0
"""Greatest height of such an input, in the scene's unit of length."""


def with_lifts(file: SceneFile) -> SceneFile:
    """The scene with an input `NAME_raised` for each robot that may go `over` and is `raised` by nothing yet.
    Raises SceneError where that name is taken."""
    fingers = {} if file.task is None else file.task.fingers
    lifted = [
        name for name, body in file.bodies.items()
        if body.role == "robot" and body.raised is None and (path := _pattern(file, name)) is not None
        and fingers[path].over
    ]  # fmt: skip
    if not lifted:
        return file
    parameters, bodies = dict(file.parameters), dict(file.bodies)
    for name in lifted:
        own = f"{name}_raised"
        if own in parameters or len(own) > 60:
            why = "it is a parameter" if own in parameters else "its name is too long"
            raise SceneError(
                f"task.fingers.{_pattern(file, name)}.over: say which input raises {name}, in"
                f" bodies.{name}.raised; {own} cannot, for {why}"
            )
        parameters[own] = Parameter(
            default=0.0, range=(0.0, HIGHEST), about=f"height of {name} above the plane, over objects"
        )
        bodies[name] = bodies[name].model_copy(update={"raised": own})
    inputs = (*file.inputs, *(f"{name}_raised" for name in lifted))
    return file.model_copy(update={"parameters": parameters, "bodies": bodies, "inputs": inputs})


def _pattern(file: SceneFile, name: str) -> str | None:
    """The pattern of `task.fingers` that holds for a robot."""
    fingers = {} if file.task is None else file.task.fingers
    return next((each for each in fingers if fnmatchcase(name, each)), None)
