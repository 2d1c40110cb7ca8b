"""Where a scene's goal wants bodies, as far as its text says it: for pictures, not for planners."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.language.compiler import compile_expression
from rungwise.scene.language.expression import STACK, Code, Programs, evaluate
from rungwise.scene.language.lasting import ExpressionError, lasting_of, parsed

if TYPE_CHECKING:
    from rungwise.scene.contract import AnyScene

NEAR_GOAL = 0.4
"""A goal that may be missed by more than this part of a body's reach is drawn as no pose."""


class Wanted(NamedTuple):
    """The value that a coordinate is to have, and the greatest distance from it."""

    value: float
    within: float


def goal_places(scene: AnyScene, parameters: Mapping[str, float]) -> dict[str, Wanted]:
    """Coordinates that the goal holds within a distance of a value, by name: terms abs(c - value) <= r and
    hypot(c - value, d - value) <= r that must hold together. In space also ``angle_about(body, z)``, by this
    name. Nothing of other goals."""
    if scene.file.goal is None:
        return {}
    values = np.zeros(scene.template.value_count)
    values[: len(scene.template.parameters)] = list(scene.parameters(parameters).values())
    found: dict[str, Wanted] = {}
    for part, bound in _near(parsed(scene.file.goal)):
        found |= _centre(part, bound, scene, values)
    return found


def _near(node: ast.expr) -> Iterator[tuple[ast.expr, ast.expr]]:
    """What a condition keeps near zero, and how near."""
    match node:
        case ast.BoolOp(ast.And(), parts):
            for part in parts:
                yield from _near(part)
        case ast.Compare(ast.Call(ast.Name("abs" | "hypot"), args), [ast.LtE() | ast.Lt()], [bound]):
            yield from ((part, bound) for part in _arguments(args))
        case ast.Call() if (pair := lasting_of(node)) is not None:
            yield from _near(pair[0])


def _arguments(args: list[ast.expr]) -> Iterator[ast.expr]:
    """Arguments, and those of hypot among them in its place."""
    for each in args:
        match each:
            case ast.Call(ast.Name("hypot"), inner):
                yield from _arguments(inner)
            case _:
                yield each


def _centre(part: ast.expr, bound: ast.expr, scene: AnyScene, values: Reals) -> dict[str, Wanted]:
    """The one coordinate, or angle about an axis, in an expression that is linear in it, and the value at
    which it is zero."""
    names = scene.template.names()
    try:
        code, near = (
            compile_expression(ast.unparse(each), names.of_state, lambda _: "", units=names.units)
            for each in (part, bound)
        )
    except ExpressionError:
        return {}
    first = len(names.parameters) + 1
    read = sorted(slot for slot in code.reads if slot >= first - 1)
    if not read or read[0] < first or read[-1] >= first + len(names.coordinates):
        return {}
    named = [names.coordinates[slot - first] for slot in read]
    name = named[0] if len(named) == 1 else _turn(named)
    if not name or any(slot >= first - 1 for slot in near.reads):
        return {}
    at = []
    for value in (0.0, 1.0, 2.0):
        values[read] = value if len(read) == 1 else (math.cos(0.5 * value), math.sin(0.5 * value))
        at.append(_value(code, values))
    values[read] = 0.0
    slope = at[1] - at[0]
    if slope == 0.0 or not np.isclose(at[2] - at[1], slope):
        return {}
    return {name: Wanted(-at[0] / slope, _value(near, values) / abs(slope))}


def _turn(named: list[str]) -> str:
    """The angle about an axis that reads these two coordinates; "" if none does."""
    body, _, real = named[0].rpartition(".q")
    other, _, axis = named[-1].rpartition(".q")
    is_turn = len(named) == 2 and body == other and real == "w" and axis in ("x", "y", "z")
    return f"angle_about({body}, {axis})" if is_turn else ""


def _value(code: Code, values: Reals) -> float:
    programs = Programs([code])
    return float(evaluate(programs.code, programs.constants, 0, len(code.rows), values, np.zeros(STACK)))
