"""Kinds of values that the fields of a scene file take, and how messages show a wrong value."""

from __future__ import annotations

import keyword
import math
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from rungwise.errors import InputError
from rungwise.scene.language.units import BASES, PREFIXES, UNIT, measured, symbols

NAME = r"^[A-Za-z][A-Za-z0-9_]*$"


def _no_keyword(name: str) -> str:
    if keyword.iskeyword(name):
        raise PydanticCustomError("keyword", "the name is taken by the expression language")
    return name


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise PydanticCustomError("text", "must be a text")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise PydanticCustomError("text", "must be a text of valid characters") from None
    return value


def _number(value: object) -> object:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float | str)
        or value == ""
        or str(value).isspace()
    ):
        raise PydanticCustomError("number", "must be a number or an expression of the parameters")
    return str(value) if isinstance(value, str) else _finite(value)


def _finite(value: object) -> float:
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            raise PydanticCustomError("finite", "must be a number") from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("finite", "must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise PydanticCustomError("finite", "must be finite")
    return number


def _flag(value: object) -> object:
    if not isinstance(value, bool):
        raise PydanticCustomError("flag", "must be true or false")
    return value


def within(low: int, high: int) -> BeforeValidator:
    """Require a whole number, of at least `low` and at most `high`."""

    def counted(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            bounds = {"low": low, "high": high}
            raise PydanticCustomError("count", "must be a whole number in {low}..{high}", bounds)
        return value

    return BeforeValidator(counted)


def _unit(value: object) -> object:
    if not isinstance(value, str) or not UNIT.fullmatch(value):
        raise PydanticCustomError("unit", "must be a unit such as m, m/s, N*s/m or 1")
    try:
        symbols(value)
    except ValueError as error:
        told = {"symbol": repr(str(error)[:60]), "bases": " ".join(sorted(BASES))}
        told["prefixes"] = " ".join([*PREFIXES][1:])
        raise PydanticCustomError(
            "unit", "unknown unit {symbol}; valid: 1 and products of {bases}, with a prefix {prefixes}", told
        ) from None
    return value


def of_dimension(*powers: int) -> AfterValidator:
    """Require a unit of these powers of length, mass and time."""
    kind = ("length", "mass", "time")[powers.index(1)]

    def checked(unit: str) -> str:
        if measured(unit)[1:] != (powers, 0):
            raise PydanticCustomError("unit", "must be a unit of {kind}", {"kind": kind})
        return unit

    return AfterValidator(checked)


Text = Annotated[str, BeforeValidator(_text)]
Name = Annotated[str, Field(pattern=NAME, max_length=60), AfterValidator(_no_keyword), BeforeValidator(_text)]
Pattern = Annotated[str, Field(min_length=1, max_length=200), BeforeValidator(_text)]
Patterns = Annotated[
    tuple[Pattern, ...], Field(min_length=1), BeforeValidator(lambda x: (x,) if isinstance(x, str) else x)
]
Number = Annotated[
    float | str, BeforeValidator(_number), WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})
]
Finite = Annotated[float, BeforeValidator(_finite)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Unit = Annotated[str, BeforeValidator(_unit)]
Pair = tuple[Number, Number]


def finite(field: str, value: object, error: type[InputError]) -> float:
    """A given number as float. Raises the error, in one line that begins with the field."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise error(f"{field}: must be a number, not {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise error(f"{field}: must be finite, not {shown(value)}")
    return number


def shown(value: object) -> str:
    """A wrong value as a message shows it: short, on one line, in the words of a scene file."""
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case int() if value.bit_length() > 200:
            return "so large an integer"
        case int() | float():
            return str(value)
        case str() if len(value) > 60:
            return f"{value[:57]!r}..."
        case str():
            return repr(value)
        case list() | tuple():
            return "a list"
        case dict():
            return "a mapping"
    return f"an object of type {type(value).__name__}"
