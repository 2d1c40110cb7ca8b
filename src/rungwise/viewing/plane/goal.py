"""Where a scene's goal wants bodies, as far as its text says it: for pictures, not for planners."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import Scene
from rungwise.scene.language.compiler import compile_expression
from rungwise.scene.language.expression import STACK, Code, Programs, evaluate
from rungwise.scene.language.lasting import ExpressionError, lasting_of, parsed


class Wanted(NamedTuple):
    """The value that a coordinate is to have, and the greatest distance from it."""

    value: float
    within: float


def goal_places(scene: Scene, parameters: Mapping[str, float]) -> dict[str, Wanted]:
    """Coordinates that the goal holds within a distance of a value, by name: terms abs(c - value) <= r and
    hypot(c - value, d - value) <= r that must hold together. Nothing of other goals."""
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
            yield from ((part, bound) for part in args)
        case ast.Call() if (pair := lasting_of(node)) is not None:
            yield from _near(pair[0])


def _centre(part: ast.expr, bound: ast.expr, scene: Scene, values: Reals) -> dict[str, Wanted]:
    """The one coordinate in an expression that is linear in it, and the value at which it is zero."""
    names = scene.template.names()
    try:
        code, near = (
            compile_expression(ast.unparse(each), names.of_state, lambda _: "", units=names.units)
            for each in (part, bound)
        )
    except ExpressionError:
        return {}
    first = len(names.parameters) + 1
    read = [slot for slot in code.reads if slot >= first - 1]
    is_linear = len(read) == 1 and first <= read[0] < first + len(names.coordinates)
    if not is_linear or any(slot >= first - 1 for slot in near.reads):
        return {}
    at = []
    for value in (0.0, 1.0, 2.0):
        values[read[0]] = value
        at.append(_value(code, values))
    values[read[0]] = 0.0
    slope = at[1] - at[0]
    if slope == 0.0 or not np.isclose(at[2] - at[1], slope):
        return {}
    name = names.coordinates[read[0] - first]
    return {name: Wanted(-at[0] / slope, _value(near, values) / abs(slope))}


def _value(code: Code, values: Reals) -> float:
    programs = Programs([code])
    return float(evaluate(programs.code, programs.constants, 0, len(code.rows), values, np.zeros(STACK)))
