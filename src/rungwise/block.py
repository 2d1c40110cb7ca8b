"""Blocks: named arrays that kernels get by reference.

A kernel that takes fifty arrays as arguments, or as a tuple, pays for copying fifty array headers at each
call, and compiles slowly. A `Block` is handed over as one pointer to a table of headers that never changes;
reading ``block.name`` inside a kernel loads the header, and the compiler may keep it. A field may be a block
itself.
"""

from __future__ import annotations

from functools import cache
from typing import Any, TypeAlias

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)  # fmt: skip


class Block:
    """Base of named groups of C-contiguous arrays, given by keyword in the order of the annotations.

    The arrays' memory is shared, not copied; the block keeps them alive. Fields are fixed once built.
    """

    def __init__(self, **fields: np.ndarray[Any, Any] | Block) -> None:
        names = tuple(type(self).__annotations__)
        if tuple(fields) != names:
            raise TypeError(f"{type(self).__name__} takes {', '.join(names)}, in this order")
        words: list[int] = []
        kinds: list[BlockType | Kind] = []
        for name, value in fields.items():
            if isinstance(value, Block):
                kinds.append(value._type)  # type: ignore[attr-defined]
            elif isinstance(value, np.ndarray) and value.flags.c_contiguous:
                kinds.append((value.dtype, value.ndim, value.flags.writeable))
            else:
                raise TypeError(f"{type(self).__name__}.{name}: must be a C-contiguous array")
            words += _header(value)
            object.__setattr__(self, name, value)
        table = np.array(words, np.int64)
        object.__setattr__(self, "_table", table)
        object.__setattr__(self, "_address", table.ctypes.data)
        object.__setattr__(self, "_type", _block_type(type(self).__name__, names, tuple(kinds)))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} is fixed; write into the array instead")


Kind: TypeAlias = tuple[np.dtype[Any], int, bool]
"""Of an array: its type, its dimensions, and whether it may be written into."""


def _header(value: np.ndarray[Any, Any] | Block) -> list[int]:
    """An array as numba lays it out: owner and parent (none), size, item size, data, shape, strides."""
    if isinstance(value, Block):
        return [value._address]  # type: ignore[attr-defined]
    return [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]


_OWN_WORDS = 5
"""Words of a header before the shape."""


class BlockType(types.Type):
    """Numba's view of a block: field names, their types, and the word at which each begins."""

    def __init__(self, name: str, fields: tuple[tuple[str, types.Type, int], ...]) -> None:
        self.fields = fields
        super().__init__(name=f"Block({name}: {', '.join(f'{n}: {t}' for n, t, _ in fields)})")

    def find(self, attribute: str) -> tuple[types.Type, int] | None:
        for name, field_type, word in self.fields:
            if name == attribute:
                return field_type, word
        return None


@cache
def _block_type(name: str, names: tuple[str, ...], kinds: tuple[BlockType | Kind, ...]) -> BlockType:
    """Looked up by what numpy knows: asking numba for each array would take most of a run's set-up."""
    fields, word = [], 0
    for field, kind in zip(names, kinds, strict=True):
        fields.append((field, kind if isinstance(kind, BlockType) else _array_type(*kind), word))
        word += 1 if isinstance(kind, BlockType) else _OWN_WORDS + 2 * kind[1]
    return BlockType(name, tuple(fields))


def _array_type(dtype: np.dtype[Any], ndim: int, writeable: bool) -> types.Type:
    """Numba's type of a C-contiguous array."""
    array = np.zeros((1,) * ndim, dtype)
    array.flags.writeable = writeable
    return numba.typeof(array)  # type: ignore[no-any-return]


@typeof_impl.register(Block)
def _typeof(value: Block, _context: object) -> BlockType:
    return value._type  # type: ignore[attr-defined, no-any-return]


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):
    def __init__(self, manager: Any, block: BlockType) -> None:
        super().__init__(manager, block, cgutils.voidptr_t)


@unbox(BlockType)
def _unbox(_block: BlockType, obj: Any, c: Any) -> NativeValue:
    number = c.pyapi.object_getattr_string(obj, "_address")
    pointer = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    return NativeValue(pointer)


@infer_getattr
class _BlockAttribute(AttributeTemplate):
    key = BlockType

    def generic_resolve(self, block: BlockType, attribute: str) -> types.Type | None:
        found = block.find(attribute)
        return found[0] if found else None


@lower_getattr_generic(BlockType)
def _getattr(context: Any, builder: Any, block: BlockType, pointer: Any, attribute: str) -> Any:
    found = block.find(attribute)
    assert found is not None
    field_type, word = found
    at = builder.gep(pointer, [context.get_constant(types.intp, 8 * word)])
    field = builder.bitcast(at, context.get_value_type(field_type).as_pointer())
    value = builder.load(field)
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value
