"""Expressions of a scene written in Python: arithmetic on parameters gives the text of a scene file."""

from __future__ import annotations

SUM, PRODUCT, SIGN, POWER, ATOM = range(5)
"""How tightly the outermost operation of a text holds together."""


class Symbol(str):
    """A parameter, or what arithmetic makes of it: ``2 * lift / v`` is the text "2 * lift / v"."""

    level: int

    def __new__(cls, text: str, level: int = ATOM) -> Symbol:
        symbol = str.__new__(cls, text)
        symbol.level = level
        return symbol

    def __add__(self, other: object) -> Symbol:
        return _joined(self, "+", other, SUM)

    def __radd__(self, other: object) -> Symbol:
        return _joined(other, "+", self, SUM)

    def __sub__(self, other: object) -> Symbol:
        return _joined(self, "-", other, SUM)

    def __rsub__(self, other: object) -> Symbol:
        return _joined(other, "-", self, SUM)

    def __mul__(self, other: object) -> Symbol:
        return _joined(self, "*", other, PRODUCT)

    def __rmul__(self, other: object) -> Symbol:
        return _joined(other, "*", self, PRODUCT)

    def __truediv__(self, other: object) -> Symbol:
        return _joined(self, "/", other, PRODUCT)

    def __rtruediv__(self, other: object) -> Symbol:
        return _joined(other, "/", self, PRODUCT)

    def __pow__(self, other: object) -> Symbol:
        return Symbol(f"{_text(self, ATOM)} ** {_text(other, ATOM)}", POWER)

    def __rpow__(self, other: object) -> Symbol:
        return Symbol(f"{_text(other, ATOM)} ** {_text(self, ATOM)}", POWER)

    def __neg__(self) -> Symbol:
        return Symbol(f"-{_text(self, POWER)}", SIGN)


def _joined(left: object, operator: str, right: object, level: int) -> Symbol:
    return Symbol(f"{_text(left, level)} {operator} {_text(right, level + 1)}", level)


def _text(value: object, least: int) -> str:
    """A side of an operation, in parentheses where it holds together less than it must."""
    if isinstance(value, Symbol):
        level = value.level
    elif isinstance(value, str):
        level = -1
    else:
        level = SIGN if str(value).startswith("-") else ATOM
    return f"({value!s})" if level < least else str(value)
