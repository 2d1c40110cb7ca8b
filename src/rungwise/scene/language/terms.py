"""Conditions taken apart into their comparisons, each with the dimension of what it compares.

``gap(a, b) <= 0.01 and abs(part.angle) <= 0.2`` compares lengths and angles. Dimensions are powers of length,
time and force, read from the names of the scene: places, angles, speeds, gaps, forces, impulses and t. A
parameter may have any dimension, and takes the one that it is compared with or added to.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from rungwise.scene.language.compiler import compile_expression
from rungwise.scene.language.expression import CONSTANTS, SLOTS, Code
from rungwise.scene.language.lasting import lasting_of, parsed, written
from rungwise.scene.language.names import OF_CONTACTS, Names
from rungwise.scene.language.poses import AT, NUMBERS, TILT


class Dimension(NamedTuple):
    """Powers of length, time and force; an angle has none."""

    length: float = 0.0
    time: float = 0.0
    force: float = 0.0

    def __str__(self) -> str:
        return NAMES.get(self) or " ".join(
            f"{name}^{power:g}" for name, power in zip(self._fields, self, strict=True) if power
        )

    def times(self, other: Dimension, sign: float = 1.0) -> Dimension:
        return Dimension(*(a + sign * b for a, b in zip(self, other, strict=True)))

    def power(self, exponent: float) -> Dimension:
        return Dimension(*(exponent * a for a in self))


LENGTH, ANGLE, TIME, FORCE = Dimension(1), Dimension(), Dimension(0, 1), Dimension(0, 0, 1)
SPEED, TURN, IMPULSE = LENGTH.times(TIME, -1), ANGLE.times(TIME, -1), FORCE.times(TIME)
NAMES = {
    LENGTH: "length", ANGLE: "angle", TIME: "time", FORCE: "force", SPEED: "speed",
    TURN: "angular speed", IMPULSE: "impulse",
}  # fmt: skip

HUGE = 1e300
"""Greatest power of a dimension."""

Combination: TypeAlias = "int | tuple[str, list[Combination]]"
"""A comparison's index, or "and", "or", "not" of combinations."""


@dataclass(frozen=True)
class Term:
    """One comparison: its text, the program of its margin, and its dimension, None where only parameters and
    numbers are compared."""

    text: str
    code: Code
    dimension: Dimension | None


def terms_of(
    text: str,
    names: Names,
    of_coordinate: tuple[Dimension, ...],
    of_velocity: tuple[Dimension, ...],
    lasts: str,
) -> tuple[list[Term], Combination]:
    """The comparisons of a condition that compiles, and how they are combined; with the dimensions of
    coordinates and velocities. What must hold for a time must hold, and the time that is left of it be none,
    if it is known (see `Names.condition`); otherwise only what must hold now counts."""
    dimensions = _of_values(names, of_coordinate, of_velocity)
    terms: list[Term] = []
    slots = list(names.slots(lasts))

    def taken(node: ast.expr) -> Combination:
        if isinstance(node, ast.BoolOp):
            return ("and" if isinstance(node.op, ast.And) else "or", [taken(value) for value in node.values])
        if isinstance(node, ast.UnaryOp):
            return "not", [taken(node.operand)]
        if isinstance(node, ast.Call):
            return asked(node)
        assert isinstance(node, ast.Compare)
        operands, parts = [node.left, *node.comparators], []
        for i, op in enumerate(node.ops):
            own = ast.unparse(ast.Compare(operands[i], [op], [operands[i + 1]]))
            code = compile_expression(own, names.of_state, lambda _: "", condition=True, units=names.units)
            met = [_dimension(side, names, dimensions) for side in operands[i : i + 2]]
            terms.append(Term(own, code, _shared(met)))
            parts.append(len(terms) - 1)
        return parts[0] if len(parts) == 1 else ("and", list(parts))

    def asked(node: ast.Call) -> Combination:
        """A part that must hold for a time, or rest."""
        pair = lasting_of(node)
        if pair is None:
            own = ast.unparse(node)
            code = compile_expression(own, names.of_state, lambda _: "", condition=True, units=names.units)
            terms.append(Term(own, code, LENGTH))
            return len(terms) - 1
        inner = taken(pair[0])
        if not slots:
            return inner
        own, slot = written(node)[1:-1], slots.pop(0)
        left = f"0 >= 0 for {ast.unparse(pair[1])}"
        code = compile_expression(
            left, names.of_state, lambda _: "", condition=True, slots=[slot], units=names.units
        )
        terms.append(Term(own, code, TIME))
        return "and", [inner, len(terms) - 1]

    return terms, taken(parsed(text))


def _of_values(
    names: Names, of_coordinate: tuple[Dimension, ...], of_velocity: tuple[Dimension, ...]
) -> list[Dimension | None]:
    """Dimensions of the values that programs read, in their order (see `Template`)."""
    contacts = len(names.contacts)
    of_contacts = dict(zip(OF_CONTACTS, (LENGTH, FORCE, IMPULSE), strict=True))
    found: list[Dimension | None] = [None] * len(names.parameters)
    found += [TIME, *of_coordinate, *of_velocity]
    found += ([LENGTH] * 3 + [ANGLE] * (NUMBERS - 3)) * len(names.posed)
    for function in OF_CONTACTS:
        found += [of_contacts[function]] * contacts
    found += [TIME] * SLOTS + [LENGTH] * len(names.bodies)
    return [*found, None]


def _shared(dimensions: list[Dimension | None]) -> Dimension | None:
    return next((each for each in dimensions if each is not None), None)


def _dimension(node: ast.expr, names: Names, known: list[Dimension | None]) -> Dimension | None:
    """The dimension of a number, None where it may have any."""

    def of(part: ast.expr) -> Dimension | None:
        return _dimension(part, names, known)

    match node:
        case ast.Name() | ast.Attribute():
            return _named(ast.unparse(node), "", names.of_state, known)
        case ast.UnaryOp(_, operand):
            return of(operand)
        case ast.IfExp(_, body, orelse):
            return _shared([of(body), of(orelse)])
        case ast.BinOp(left, ast.Add() | ast.Sub(), right):
            return _shared([of(left), of(right)])
        case ast.BinOp(left, ast.Mult() | ast.Div() as op, right):
            return _product(left, right, 1.0 if isinstance(op, ast.Mult) else -1.0, of)
        case ast.BinOp(left, ast.Pow(), ast.Constant(value=int() | float() as exponent)):
            base = of(left)
            return None if base is None else _possible(base.power(float(exponent)))
        case ast.Call(ast.Name("abs" | "min" | "max" | "hypot"), args):
            return _shared([of(arg) for arg in args])
        case ast.Call(ast.Name("sqrt"), [arg]):
            under = of(arg)
            return None if under is None else under.power(0.5)
        case ast.Call(ast.Name("asin" | "acos" | "atan" | "atan2")):
            return ANGLE
        case ast.Call(ast.Name(function)) if function in (AT, TILT):
            return LENGTH if function == AT else ANGLE
        case ast.Call(ast.Name(function), args) if function in ("speed", *OF_CONTACTS):
            return _named(", ".join(ast.unparse(arg) for arg in args), function, names.of_state, known)
    return None


def _product(
    left: ast.expr, right: ast.expr, sign: float, of: Callable[[ast.expr], Dimension | None]
) -> Dimension | None:
    """A plain number changes no dimension; a parameter may, so that nothing is known of the product."""
    sides = [ANGLE if _is_plain(side) else of(side) for side in (left, right)]
    if sides[0] is None or sides[1] is None or (_is_plain(left) and _is_plain(right)):
        return None
    return _possible(sides[0].times(sides[1], sign))


def _possible(dimension: Dimension) -> Dimension | None:
    """A dimension, None where its powers are beyond all measure, and sums of them might overflow."""
    return dimension if all(abs(power) <= HUGE for power in dimension) else None


def _is_plain(node: ast.expr) -> bool:
    """Whether a number is made of literals only."""
    parts = list(ast.walk(node))
    named = any(isinstance(part, ast.Name) and part.id not in CONSTANTS for part in parts)
    return not named and not any(isinstance(part, ast.Call) for part in parts)


def _named(
    text: str,
    function: str,
    lookup: Callable[[str, tuple[str, ...]], int | None],
    known: list[Dimension | None],
) -> Dimension | None:
    slot = lookup(function, tuple(text.split(", ")))
    return None if slot is None else known[slot]
