"""Indices in kernels count from the start.

To numba an index of -1 means the last element, so it compares every index with zero and adds the length to
what is less. In kernels of this package only literals count from the end (`x[-1]`), which are looked up when
the kernel is compiled. Without the comparison runs of few bodies take about a tenth less time. Functions
outside the package are compiled as ever.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.np import arrayobj

_OWN = "_ZN8rungwise"
"""How numba's names of compiled functions of this package begin."""
_of_numba = getattr(arrayobj, "fix_integer_index", None)


def _index(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
    """The element that an index of this type means in a dimension of this size, as numba's function of
    indices, which writes it."""
    counts = kind.signed and not isinstance(index, ir.Constant) and builder.function.name.startswith(_OWN)
    if counts:
        return context.cast(builder, index, kind, types.intp)
    return _of_numba(context, builder, kind, index, size)  # type: ignore[misc]


def count_from_start() -> None:
    """Let kernels that are compiled from now on do so; without effect where numba has no such function."""
    if _of_numba is not None:
        arrayobj.fix_integer_index = _index
