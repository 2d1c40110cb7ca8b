"""Blocks: named arrays that kernels get by reference.

A kernel that takes fifty arrays as arguments, or as a tuple, pays for copying fifty array headers at each
call, and compiles slowly. A `Block` is handed over as one pointer to a table of headers that never changes;
reading ``block.name`` inside a kernel loads the header, and the compiler may keep it. A field may be a block
itself.
"""

from __future__ import annotations

import inspect
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple, TypeAlias

import numpy as np


class Block:
    """Base of named groups of C-contiguous arrays, given by keyword in the order of the annotations;
    a block may add fields to another.

    The arrays' memory is shared, not copied; the block keeps them alive. Fields are fixed once built.
    """

    def __init__(self, **fields: np.ndarray[Any, Any] | Block) -> None:
        names = tuple(
            name for kind in reversed(type(self).__mro__[:-2]) for name in inspect.get_annotations(kind)
        )
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
        object.__setattr__(self, "_address", table.ctypes.data)
        object.__setattr__(self, "_layout", Layout(type(self).__name__, names, tuple(kinds)))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} is fixed; write into the array instead")

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy has arrays of its own; where arrays shared memory, its arrays do not."""
        names = self._layout.fields  # type: ignore[attr-defined]
        return _rebuilt, (type(self), {name: getattr(self, name) for name in names})

    @cached_property
    def _numba_type_(self) -> Any:
        return import_module("rungwise.compilation.blocks").block_type(*self._layout)  # type: ignore[attr-defined]


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


def _header(value: np.ndarray[Any, Any] | Block) -> list[int]:
    """An array as numba lays it out: owner and parent (none), size, item size, data, shape, strides."""
    if isinstance(value, Block):
        return [value._address]  # type: ignore[attr-defined]
    return [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
