"""Blocks: named arrays that kernels get by reference.

A kernel that takes fifty arrays as arguments, or as a tuple, pays for copying fifty array headers at each
call, and compiles slowly. A `Block` is handed over as one pointer to a table of headers that never changes;
reading ``block.name`` inside a kernel loads the header, and the compiler may keep it. A field may be a block
itself.
"""

from __future__ import annotations

import ctypes
import inspect
from functools import cache, cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np


class Block:
    """Base of named groups of C-contiguous arrays, given by keyword in the order of the annotations;
    a block may add fields to another.

    The arrays' memory is shared, not copied; the block keeps them alive. Fields are fixed once built.
    """

    def __init__(self, **fields: np.ndarray[Any, Any] | Block) -> None:
        kind: Any = type(self)
        names = _fields(kind)
        if tuple(fields) != names:
            raise TypeError(f"{type(self).__name__} takes {', '.join(names)}, in this order")
        words: list[int] = []
        kinds: list[Kind] = []
        for name, value in fields.items():
            if isinstance(value, Block):
                kinds.append(value._layout)  # type: ignore[attr-defined]
            elif isinstance(value, np.ndarray) and value.flags.c_contiguous:
                kinds.append((value.dtype, value.ndim, value.flags.writeable))
            else:
                raise TypeError(f"{type(self).__name__}.{name}: must be a C-contiguous array")
            words += _header(value)
            object.__setattr__(self, name, value)
        table = np.array(words, np.int64)
        object.__setattr__(self, "_table", table)
        object.__setattr__(self, "_address", address_of(table))
        object.__setattr__(self, "_layout", Layout(type(self).__name__, names, tuple(kinds)))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} is fixed; write into the array instead")

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A field of a block that a mould made, asked for for the first time."""
            field = self.__dict__.get("_field")
            if field is None or name not in self._layout.fields:
                raise AttributeError(f"{type(self).__name__} has no field {name}")
            value = self.__dict__[name] = field(name)
            return value

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy has arrays of its own; where arrays shared memory, its arrays do not."""
        names = self._layout.fields  # type: ignore[attr-defined]
        return _rebuilt, (type(self), {name: getattr(self, name) for name in names})

    @cached_property
    def _numba_type_(self) -> Any:
        layout: Layout = self._layout  # type: ignore[attr-defined]
        known = _KNOWN.get(type(self))
        if known is None or known[0] != layout:
            found = import_module("rungwise.compilation.blocks").block_type(*layout)
            known = _KNOWN[type(self)] = layout, found
        return known[1]


@cache
def _fields(kind: type[Any]) -> tuple[str, ...]:
    """Names of the fields of a class of blocks."""
    return tuple(name for each in reversed(kind.__mro__[:-2]) for name in inspect.get_annotations(each))


def _rebuilt(kind: type[Block], fields: dict[str, Any]) -> Block:
    return kind(**fields)


class Layout(NamedTuple):
    """The layout of a block: its name, the names of its fields, and their kinds."""

    name: str
    fields: tuple[str, ...]
    kinds: tuple[Kind, ...]


Kind: TypeAlias = tuple[np.dtype[Any], int, bool] | Layout
"""The kind of a field: a block's layout or, of an array, its type, dimensions, and whether it is
writeable."""


_KNOWN: dict[type[Any], tuple[Layout, Any]] = {}
"""By class, the last layout that was asked for and numba's type: to compare layouts that share their parts
takes a twentieth of the time of a look-up by their hash."""


HEADER_DATA = 4
"""Word of an array's header that is the address of its elements."""


def header_words(kind: Kind) -> int:
    """Words of the header of a field of this kind."""
    return 1 if isinstance(kind, Layout) else HEADER_DATA + 1 + 2 * kind[1]


def header_table(block: Block) -> list[int]:
    """The headers of a block's fields, one after another."""
    layout: Layout = block._layout  # type: ignore[attr-defined]
    words = sum(header_words(kind) for kind in layout.kinds)
    return list((ctypes.c_int64 * words).from_address(block._address))  # type: ignore[attr-defined]


def _header(value: np.ndarray[Any, Any] | Block) -> list[int]:
    """An array as numba lays it out: owner and parent (none), size, item size, data, shape, strides."""
    if isinstance(value, Block):
        return [value._address]  # type: ignore[attr-defined]
    return [0, 0, value.size, value.itemsize, address_of(value), *value.shape, *value.strides]


def layout_of(value: object) -> object:
    """What the type of an argument follows from; equal for arguments that compiled code reads alike."""
    if isinstance(value, Block):
        return value._layout  # type: ignore[attr-defined]
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    if isinstance(value, tuple):
        return type(value), *map(layout_of, value)
    return type(value)


def address_of(array: np.ndarray[Any, Any]) -> int:
    """Where the array's elements begin; `array.ctypes` takes half as long again to say so."""
    return int(array.__array_interface__["data"][0])
