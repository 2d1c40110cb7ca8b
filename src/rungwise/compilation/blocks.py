"""Numba's view of blocks."""

from __future__ import annotations

import hashlib
from functools import cache
from typing import Any

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
    unbox,
)  # fmt: skip

from rungwise.block import Kind, Layout

_OWN_WORDS = 5
"""Words of a header before the shape."""


class BlockType(types.Type):
    """Numba's view of a block: the name of its class, field names, their types, and the word at which each
    begins."""

    def __init__(self, name: str, fields: tuple[tuple[str, types.Type, int], ...]) -> None:
        self.kind, self.fields = name, fields
        text = ", ".join(f"{field}: {kind}" for field, kind, _ in fields)
        super().__init__(name=f"{name}({hashlib.sha256(text.encode()).hexdigest()[:16]})")

    def find(self, attribute: str) -> tuple[types.Type, int] | None:
        for name, field_type, word in self.fields:
            if name == attribute:
                return field_type, word
        return None


@cache
def block_type(name: str, names: tuple[str, ...], kinds: tuple[Kind, ...]) -> BlockType:
    """Numba's type of a block, looked up by numpy's types: asking numba for each array would take most of a
    run's set-up."""
    fields: list[tuple[str, types.Type, int]] = []
    word = 0
    for field, kind in zip(names, kinds, strict=True):
        if isinstance(kind, Layout):
            fields.append((field, block_type(*kind), word))
            word += 1
        else:
            fields.append((field, _array_type(*kind), word))
            word += _OWN_WORDS + 2 * kind[1]
    return BlockType(name, tuple(fields))


def _array_type(dtype: np.dtype[Any], ndim: int, writeable: bool) -> types.Type:
    """Numba's type of a C-contiguous array."""
    array = np.zeros((1,) * ndim, dtype)
    array.flags.writeable = writeable
    return numba.typeof(array)  # type: ignore[no-any-return]


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
