"""Short lists of arguments for calls between kernels.

Numba hands an array over as seven words or more: the pointer and the length, and besides the owner, the size
of an element and the strides, which follow from the type of a C-contiguous array. Kernels whose arguments are
a dozen arrays spend a tenth of their time on this. So a kernel that compiled code calls has an *entry* beside
it that takes the pointer and the shape of such an array, and puts the array together again; the kernel itself
becomes a part of its entry, where the compiler drops the words that nobody reads.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering
from numba.np import arrayobj


def short(kind: Any) -> Any:
    """The type that stands for a type of numba in an entry's list of arguments."""
    if isinstance(kind, types.Array) and kind.layout == "C" and kind.ndim > 0:
        return types.Tuple((types.CPointer(kind.dtype), *(types.intp,) * kind.ndim))
    if isinstance(kind, types.BaseTuple):
        return types.Tuple(tuple(map(short, kind)))
    return kind


def shortened(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """What stands for a value of this type in an entry's list of arguments."""
    made = short(kind)
    if isinstance(kind, types.Array) and made is not kind:
        array = context.make_array(kind)(context, builder, value)
        shape = cgutils.unpack_tuple(builder, array.shape, kind.ndim)
        return context.make_tuple(builder, made, [array.data, *shape])
    if isinstance(kind, types.BaseTuple):
        parts = zip(kind, cgutils.unpack_tuple(builder, value, len(kind)), strict=True)
        return context.make_tuple(builder, made, [shortened(context, builder, *part) for part in parts])
    return value


def _restored(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The value of this type that `shortened` was made of."""
    if isinstance(kind, types.Array) and short(kind) is not kind:
        data, *shape = cgutils.unpack_tuple(builder, value, kind.ndim + 1)
        size = arrayobj.get_itemsize(context, kind)
        strides = [context.get_constant(types.intp, size)]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        array = context.make_array(kind)(context, builder)
        arrayobj.populate_array(array, data, shape, strides, size, meminfo=None)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts = zip(kind, cgutils.unpack_tuple(builder, value, len(kind)), strict=True)
        return context.make_tuple(builder, kind, [_restored(context, builder, *part) for part in parts])
    return value


def entry_name(described: Any) -> str:
    """The name, in machine code, of a kernel's entry."""
    return f"{described.llvm_func_name}.entry"


def _add_entry(context: Any, library: Any, described: Any) -> None:
    """Add the entry of a lowered function to its library; nothing else can call the function then."""
    convention, kinds = context.call_conv, described.argtypes
    shorts = tuple(map(short, kinds))
    module = context.create_module("entry")
    whole = convention.get_function_type(described.restype, kinds)
    kernel = ir.Function(module, whole, described.llvm_func_name)
    entry = ir.Function(
        module, convention.get_function_type(described.restype, shorts), entry_name(described)
    )
    builder = ir.IRBuilder(entry.append_basic_block("entry"))
    given = convention.decode_arguments(builder, shorts, entry)
    values = [_restored(context, builder, *each) for each in zip(kinds, given, strict=True)]
    words = context.get_arg_packer(kinds).as_arguments(builder, values)
    builder.ret(builder.call(kernel, [*entry.args[:2], *words], attrs=("alwaysinline",)))
    library.add_ir_module(module)
    library._final_module.get_function(described.llvm_func_name).linkage = "internal"


class _Lower(Lower):
    def lower(self) -> None:
        super().lower()
        _add_entry(self.context, self.library, self.fndesc)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    _name = "lowering_with_entry"

    @property
    def lowering_class(self) -> type[Lower]:
        return _Lower


class WithEntry(CompilerBase):
    """Numba's compiler, with an entry for each function."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state, "with_entry")
        passes.passes = [
            (_Lowering if each is NativeLowering else each, words) for each, words in passes.passes
        ]
        passes.finalize()
        return [passes]
