"""Where bodies are in space: ``at(body, x)`` and ``tilt(body, z)``, in the world or in the frame of
another body.

Programs read 12 numbers of each body whose pose is known: its origin, and row by row the matrix whose
columns are its own axes in the world.
"""

from __future__ import annotations

import ast

AT, TILT = "at", "tilt"
"""The place of a body's origin along an axis, and the angle between an axis of a body and the same axis of
the world or of another body."""
OF_POSES = (AT, TILT)
OWN = "axis of"
"""What programs call a component of a body's own axis; no author can write it."""
AXES = "xyz"
NUMBERS = 12
"""Numbers of a body that programs read."""


def slot_of(function: str, which: str) -> int | None:
    """Which of a body's numbers a function reads; None for none of them. ``AT`` takes an axis, ``OWN`` one of
    the world and one of the body."""
    if function == AT and which in tuple(AXES):
        return AXES.index(which)
    if function == OWN and len(which) == 2:
        return 3 + 3 * AXES.index(which[0]) + AXES.index(which[1])
    return None


def expanded(function: str, args: list[str]) -> ast.expr | None:
    """A function of bodies and an axis by what programs read; None where it takes other arguments, or is read
    as it stands."""
    if function not in OF_POSES or len(args) not in (2, 3) or args[1] not in tuple(AXES):
        return None
    body, axis, frame = args[0], args[1], args[2] if len(args) == 3 else ""
    if function == TILT:
        others = [each for each in AXES if each != axis]
        across = _call("hypot", *(_along(body, axis, each, frame) for each in others))
        return _call("atan2", across, _along(body, axis, axis, frame))
    if not frame:
        return None
    ways = [ast.BinOp(_of(AT, body, each), ast.Sub(), _of(AT, frame, each)) for each in AXES]
    return _sum([_times(way, _of(OWN, frame, w + axis)) for way, w in zip(ways, AXES, strict=True)])


def _along(body: str, own: str, other: str, frame: str) -> ast.expr:
    """The component of a body's own axis along another one, of the world or of the frame."""
    if not frame:
        return _of(OWN, body, other + own)
    return _sum([_times(_of(OWN, body, w + own), _of(OWN, frame, w + other)) for w in AXES])


def _of(function: str, body: str, which: str) -> ast.expr:
    return _call(function, ast.parse(body, mode="eval").body, ast.Name(which, ast.Load()))


def _call(function: str, *args: ast.expr) -> ast.expr:
    return ast.Call(ast.Name(function, ast.Load()), list(args), [])


def _times(one: ast.expr, other: ast.expr) -> ast.expr:
    return ast.BinOp(one, ast.Mult(), other)


def _sum(parts: list[ast.expr]) -> ast.expr:
    found = parts[0]
    for part in parts[1:]:
        found = ast.BinOp(found, ast.Add(), part)
    return found
