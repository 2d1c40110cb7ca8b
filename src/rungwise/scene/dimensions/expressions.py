"""The dimension of an expression, as far as the units of its parameters tell.

A number that is added or compared has the dimension of what is beside it. One that multiplies may have a
dimension of its own, such as 9.81, so that nothing is known of such a product, but for halves, doubles and
what turns degrees and radians into each other.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeAlias

from rungwise.scene.language.lasting import lasting_of
from rungwise.scene.language.units import DEGREE

PLAIN = (0.25, 0.5, 2.0, 4.0, 180.0, 360.0, math.pi, DEGREE)
"""Numbers that change no dimension where they multiply."""

DIGITS = 9
"""Of powers, after the point: the third power of a third power is the number itself."""
STEEPEST = 100
"""Of a number to a greater power nothing is known."""


class Powers(NamedTuple):
    """Powers of length, mass and time; an angle has none."""

    length: float = 0.0
    mass: float = 0.0
    time: float = 0.0

    def times(self, other: Powers, sign: float = 1.0) -> Powers:
        return Powers(*(round(a + sign * b, DIGITS) for a, b in zip(self, other, strict=True)))

    def power(self, exponent: float) -> Powers:
        return Powers(*(round(exponent * a, DIGITS) for a in self))


NONE = Powers()
Lookup: TypeAlias = "Callable[[str], Powers | None]"
"""The dimension of a name, such as ``box.x`` or ``gap(a, b)``; None where it may have any."""


class Mixed(Exception):
    """Two parts of an expression that must have one dimension have two; the arguments are both parts, each
    with its dimension."""


def dimension(node: ast.expr, known: Lookup) -> Powers | None:
    """The dimension of a number, None where it may have any. Raises Mixed."""

    def of(part: ast.expr) -> Powers | None:
        return dimension(part, known)

    match node:
        case ast.Name() | ast.Attribute():
            return known(ast.unparse(node))
        case ast.UnaryOp(_, operand):
            return of(operand)
        case ast.IfExp(test, body, orelse):
            check_condition(test, known)
            return shared([body, orelse], known)
        case ast.BinOp(left, ast.Add() | ast.Sub(), right):
            return shared([left, right], known)
        case ast.BinOp(left, ast.Mult() | ast.Div() as op, right):
            sides = [NONE if _is_plain(side) else of(side) for side in (left, right)]
            if sides[0] is None or sides[1] is None or (_is_plain(left) and _is_plain(right)):
                return None
            return sides[0].times(sides[1], 1.0 if isinstance(op, ast.Mult) else -1.0)
        case ast.BinOp(left, ast.Pow(), ast.Constant(value=int() | float() as exponent)):
            base = of(left)
            return None if base is None or abs(exponent) > STEEPEST else base.power(float(exponent))
        case ast.Call(ast.Name("abs" | "min" | "max" | "hypot"), args):
            return shared(args, known)
        case ast.Call(ast.Name("sqrt"), [arg]):
            under = of(arg)
            return None if under is None else under.power(0.5)
        case ast.Call(ast.Name("atan2"), args):
            shared(args, known)
            return NONE
        case ast.Call(ast.Name("sin" | "cos" | "tan" | "asin" | "acos" | "atan" | "exp" | "log"), [arg]):
            found = of(arg)
            if found not in (None, NONE):
                raise Mixed(arg, found, None, NONE)
            return NONE
        case ast.Call(ast.Name("sign"), [arg]):
            of(arg)
            return NONE
        case ast.Call(ast.Name(), _):
            return known(ast.unparse(node))
    return None


def shared(parts: Iterable[ast.expr], known: Lookup) -> Powers | None:
    """The one dimension of several parts. Raises Mixed."""
    found: list[tuple[ast.expr, Powers]] = []
    for part in parts:
        own = dimension(part, known)
        if own is not None:
            found.append((part, own))
            if own != found[0][1]:
                raise Mixed(*found[0], part, own)
    return found[0][1] if found else None


def check_condition(node: ast.expr, known: Lookup) -> None:
    """Raise Mixed where a condition compares what has different dimensions."""
    match node:
        case ast.Compare(left, _, right):
            shared([left, *right], known)
        case ast.BoolOp(_, values):
            for value in values:
                check_condition(value, known)
        case ast.UnaryOp(_, operand):
            check_condition(operand, known)
        case ast.Call() if (pair := lasting_of(node)) is not None:
            check_condition(pair[0], known)


def _is_plain(node: ast.expr) -> bool:
    """Whether a factor changes no dimension."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return value in PLAIN
        case ast.Name("pi" | "deg"):
            return True
        case ast.UnaryOp(_, operand):
            return _is_plain(operand)
        case ast.BinOp(left, ast.Mult() | ast.Div(), right):
            return _is_plain(left) and _is_plain(right)
    return False
