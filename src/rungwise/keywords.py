"""Public functions that answer a wrong call in one line, which lists the right keywords."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from rungwise.errors import InputError
from rungwise.wording import choices, listed

P = ParamSpec("P")
R = TypeVar("R")


class KeywordError(InputError, TypeError):
    """A function was called with a keyword that it does not have, without an argument that it needs, or with
    too many; one line that lists the right ones."""


def keywords(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with a KeywordError where Python would raise a TypeError for its arguments."""

    @wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        try:
            return function(*args, **named)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise  # from within the function
            raise KeywordError(_explained(function, args, named)) from None

    return call


def _explained(function: Callable[..., object], args: tuple[object, ...], named: dict[str, object]) -> str:
    """What is wrong with the arguments of a call."""
    parameters = dict(inspect.signature(function).parameters)
    path = function.__qualname__.removesuffix(".__init__")
    if "self" in parameters or "cls" in parameters:
        parameters.pop("self", None), parameters.pop("cls", None)
        args = args[1:]
    positional = [name for name, p in parameters.items() if p.kind != p.KEYWORD_ONLY]
    for name in named:
        if name not in parameters:
            return f"{path}: unknown keyword {name!r}{choices(name, parameters)}"
    if len(args) > len(positional):
        others = listed(name for name in parameters if name not in positional)
        return (
            f"{path}: {len(args)} arguments without a keyword, and it takes {len(positional)}"
            f" ({listed(positional)}); by keyword: {others}"
        )
    for name in positional[: len(args)]:
        if name in named:
            return f"{path}.{name}: is given twice"
    needed = [name for name, p in parameters.items() if p.default is p.empty]
    missing = [name for name in needed if name not in named and name not in positional[: len(args)]]
    return f"{path}.{missing[0]}: is required" if missing else f"{path}: wrong arguments"
