"""Expressions of a scene written in Python: arithmetic on parameters gives the text of a scene file."""

from __future__ import annotations

from collections.abc import Callable

SUM, PRODUCT, SIGN, POWER, ATOM = range(5)
"""How tightly the outermost operation of a text holds together."""


def _left(operator: str, level: int) -> Callable[[Symbol, object], Symbol]:
    return lambda own, other: _joined(own, operator, other, level)


def _right(operator: str, level: int) -> Callable[[Symbol, object], Symbol]:
    return lambda own, other: _joined(other, operator, own, level)


class Symbol(str):
    """A parameter, or what arithmetic makes of it: ``2 * lift / v`` is the text "2 * lift / v"."""

    level: int

    def __new__(cls, text: str, level: int = ATOM) -> Symbol:
        symbol = str.__new__(cls, text)
        symbol.level = level
        return symbol

    __add__, __radd__ = _left("+", SUM), _right("+", SUM)
    __sub__, __rsub__ = _left("-", SUM), _right("-", SUM)
    __mul__, __rmul__ = _left("*", PRODUCT), _right("*", PRODUCT)
    __truediv__, __rtruediv__ = _left("/", PRODUCT), _right("/", PRODUCT)

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
