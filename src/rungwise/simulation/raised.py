"""How high bodies are above the plane, in frames of a run."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import Scene
from rungwise.scene.language.expression import STACK, Programs, evaluate


def raised_in(scene: Scene, values: Reals) -> dict[str, Reals]:
    """Heights (f,) of the bodies that may be raised, where expressions read these values (f, w)."""
    found = {}
    for name, body in scene.file.bodies.items():
        if isinstance(body.raised, str):
            code = scene.template.names().number(body.raised, f"bodies.{name}.raised", timed=True)
            programs, stack = Programs([code]), np.zeros(STACK)
            (first, last), told = programs.table[0].tolist(), (programs.code, programs.constants)
            found[name] = np.array([evaluate(*told, first, last, own, stack) for own in values])
        elif body.raised is not None:
            found[name] = np.full(len(values), float(body.raised))
    return found
