"""Units of parameters: a name in an expression stands for its value in the scene's units.

`UNIT` writes products of powers, such as N*s/m. Angles are in radians everywhere, so degrees are always
converted; other units only where the scene says in which units it counts, and otherwise they are refused.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from rungwise.scene.errors import SceneError
from rungwise.scene.language.lasting import ExpressionError

UNIT = re.compile(r"1|[A-Za-zµ]+(\^-?[0-9]+)?([*/·][A-Za-zµ]+(\^-?[0-9]+)?)*")
PREFIXES = {
    "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9,
}  # fmt: skip
DEGREE = math.pi / 180.0
BASES = {
    "m": (1.0, (1, 0, 0)), "g": (1e-3, (0, 1, 0)), "s": (1.0, (0, 0, 1)), "N": (1.0, (1, 1, -2)),
    "J": (1.0, (2, 1, -2)), "W": (1.0, (2, 1, -3)), "Pa": (1.0, (-1, 1, -2)), "Hz": (1.0, (0, 0, -1)),
    "rad": (1.0, (0, 0, 0)), "deg": (1.0, (0, 0, 0)),
}  # fmt: skip
"""Each base unit in kg, m and s, and its powers of length, mass and time; degrees are counted apart."""
SI = {"length": "m", "mass": "kg", "time": "s"}


class Measure(NamedTuple):
    """A unit: in kg, m and s but for degrees, powers of length, mass and time, and the power of degrees."""

    scale: float
    powers: tuple[int, int, int]
    degrees: int


class Conversion(NamedTuple):
    """What a parameter's value is multiplied by where an expression reads it; `degrees` is the power of
    degrees in its unit."""

    unit: str
    factor: float
    degrees: int


def symbols(unit: str) -> list[tuple[float, str, int]]:
    """Prefix, base and power of each symbol in a unit that is well written. Raises ValueError, with the
    symbol, for one that is not known."""
    found = []
    for operator, symbol, power in re.findall(r"([*/·]?)([A-Za-zµ]+)(?:\^(-?[0-9]+))?", unit):
        parts = [(p, b) for p in PREFIXES for b in BASES if p + b == symbol]
        if not parts:
            raise ValueError(symbol)
        prefix, base = parts[0]
        found.append((PREFIXES[prefix], base, int(power or 1) * (-1 if operator == "/" else 1)))
    return found


def measured(unit: str) -> Measure:
    """A unit that is well written, taken apart."""
    scale, powers, degrees = 1.0, [0, 0, 0], 0
    for prefix, base, power in symbols(unit):
        own, dimension = BASES[base]
        scale *= (prefix * own) ** power
        powers = [a + power * b for a, b in zip(powers, dimension, strict=True)]
        degrees += power if base == "deg" else 0
    return Measure(scale, (powers[0], powers[1], powers[2]), degrees)


def conversions(units: Mapping[str, str], counted_in: Mapping[str, str] | None) -> dict[str, Conversion]:
    """For each parameter whose unit is not the scene's, how it is converted; `units` of parameters by name,
    `counted_in` the scene's units, where it says them. Raises SceneError, at the parameter."""
    own = [measured((SI | dict(counted_in or {}))[kind]).scale for kind in SI]
    found = {}
    for name, unit in units.items():
        scale, powers, degrees = measured(unit)
        ratio = scale / math.prod(base**power for base, power in zip(own, powers, strict=True))
        differs = abs(ratio - 1.0) > 1e-9
        if differs and counted_in is None:
            raise SceneError(
                f"parameters.{name}.unit: {unit} is not a product of m, kg, s and units made of them (N, J,"
                " W, Pa, Hz), and the scene does not state its units; give the number in these units, or"
                " add units to the scene, such as units: {length: mm}, to have parameters converted"
            )
        if differs or degrees:
            found[name] = Conversion(unit, (ratio if differs else 1.0) * DEGREE**degrees, degrees)
    return found


def converted(tree: ast.expr, given: Mapping[str, Conversion]) -> ast.expr:
    """The expression with each name that has a conversion multiplied by it, but where it is multiplied by
    the constant `deg`, or by pi / 180, as its unit says. Raises ExpressionError where pi is multiplied in
    without 180 or 360."""
    return _converted(tree, given, 0, False) if given else tree


def _converted(node: ast.expr, given: Mapping[str, Conversion], by_hand: int, has_pi: bool) -> ast.expr:
    """`by_hand`: the power of deg that products around the node multiply it by; has_pi: whether by pi."""
    match node:
        case ast.Name(name) if name in given:
            return _read(node, given[name], by_hand, has_pi)
        case ast.BinOp(left, ast.Add() | ast.Sub() as op, right):
            return ast.BinOp(
                _converted(left, given, by_hand, has_pi), op, _converted(right, given, by_hand, has_pi)
            )
        case ast.BinOp(_, ast.Mult() | ast.Div(), _):
            degrees, pis = _degrees(_factors(node))
            return _product(node, given, by_hand + degrees, has_pi or pis != 0, 1)
        case ast.UnaryOp(ast.USub() | ast.UAdd() as op, operand):
            return ast.UnaryOp(op, _converted(operand, given, by_hand, has_pi))
    for field, value in ast.iter_fields(node):
        if isinstance(value, ast.expr) and not (isinstance(node, ast.Call) and field == "func"):
            setattr(node, field, _converted(value, given, 0, False))
        elif isinstance(value, list):
            parts = [_converted(x, given, 0, False) if isinstance(x, ast.expr) else x for x in value]
            setattr(node, field, parts)
    return node


def _product(
    node: ast.expr, given: Mapping[str, Conversion], by_hand: int, has_pi: bool, sign: int
) -> ast.expr:
    """A product that has been looked through; sign: -1 where it divides."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        right = -sign if isinstance(node.op, ast.Div) else sign
        return ast.BinOp(
            _product(node.left, given, by_hand, has_pi, sign),
            node.op,
            _product(node.right, given, by_hand, has_pi, right),
        )
    return _converted(node, given, sign * by_hand, has_pi)


def _factors(node: ast.expr, sign: int = 1) -> list[tuple[ast.expr, int]]:
    """Factors of a product, each with 1, or -1 where it divides; signs are left out."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return _factors(node.operand, sign)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        right = -sign if isinstance(node.op, ast.Div) else sign
        return _factors(node.left, sign) + _factors(node.right, right)
    return [(node, sign)]


def _degrees(factors: list[tuple[ast.expr, int]]) -> tuple[int, int]:
    """The power of deg in a product, where pi over 180 or 360 is one, too, and the power of pi besides."""
    named = [(part.id, sign) for part, sign in factors if isinstance(part, ast.Name)]
    turns = [sign for part, sign in factors if isinstance(part, ast.Constant) and part.value in (180, 360)]
    degrees, pis = (sum(sign for name, sign in named if name == wanted) for wanted in ("deg", "pi"))
    most = min(abs(pis), turns.count(-1 if pis > 0 else 1))
    pairs = most if pis > 0 else -most
    return degrees + pairs, pis - pairs


def _read(node: ast.Name, way: Conversion, by_hand: int, has_pi: bool) -> ast.expr:
    factor = way.factor
    if way.degrees and has_pi:
        raise ExpressionError(
            f"{node.id} is in {way.unit} and read in radians, and pi without 180 or 360 does not convert it:"
            f" write {node.id}, {node.id} * deg or {node.id} * pi / 180, which mean the same"
        )
    if way.degrees and by_hand == way.degrees:
        factor /= DEGREE**way.degrees
    return node if factor == 1.0 else ast.BinOp(node, ast.Mult(), ast.Constant(factor))
