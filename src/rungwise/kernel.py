"""The one compile decorator.

Every hot function of the package is a *kernel*: arrays in, arrays out, compiled when it is first called. With
the environment variable NUMBA_DISABLE_JIT=1 kernels are plain Python functions. The package
`rungwise.compilation`, which this module loads when the first kernel is called, compiles them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import cached_property, update_wrapper
from importlib import import_module
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block, layout_of

Reals: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
RecordArray: TypeAlias = NDArray[np.void]
Record: TypeAlias = Any
"""One element of a record array: its fields are known to numba, not to the type checker."""

F = TypeVar("F", bound=Callable[..., object])


def record_type(integers: str, reals: str) -> np.dtype[np.void]:
    """Type of a record array with these fields, each 8 bytes wide: `array[0].name` reads and writes one, in
    compiled code and in plain Python alike. Raises ValueError for a name that an array has already, which
    plain Python would read instead."""
    for name in (integers + " " + reals).split():
        if hasattr(np.record, name):
            raise ValueError(f"{name}: a record array has an attribute of this name")
    fields = [(name, np.int64) for name in integers.split()] + [(name, np.float64) for name in reals.split()]
    return np.dtype((np.record, fields))


class Kernel:
    """A function that is compiled for the types of its arguments; if a part, compiled code contains the
    function instead of calling it."""

    def __init__(self, function: Callable[..., object], is_part: bool, **options: object) -> None:
        update_wrapper(self, function)
        self.name = function.__qualname__
        self.function = function
        self.is_part = is_part
        self._last: tuple[tuple[object, ...], Callable[..., object]] = (), function
        self.options = {"nogil": True, "error_model": "numpy", "_nrt": False, **options}

    def __call__(self, *arguments: object) -> object:
        return self._call(self._outside, *arguments)

    @cached_property
    def _call(self) -> Callable[..., object]:
        call: Callable[..., object] = _calls().call
        return call

    @cached_property
    def _outside(self) -> Any:
        return _calls().KernelDispatcher(self.function, "outside", **self.options)

    def code_for(self, arguments: tuple[object, ...]) -> Callable[..., object]:
        """What calls the machine code for the types of these arguments."""
        layouts, last = tuple(map(layout_of, arguments)), self._last
        if layouts != last[0]:
            kinds = tuple(self._outside.typeof_pyval(each) for each in arguments)
            if kinds not in self._outside.overloads:
                self._outside.compile(kinds)
            last = self._last = layouts, self._outside.overloads[kinds].entry_point
        return last[1]

    @cached_property
    def inside(self) -> Any:
        """Numba's dispatcher for calls from compiled code."""
        kind = "part" if self.is_part else "called"
        return _calls().KernelDispatcher(self.function, kind, no_cpython_wrapper=True, **self.options)

    @cached_property
    def _numba_type_(self) -> Any:
        return _calls().type_of(self)


class SystemKernel(Kernel):
    """A kernel whose first argument is a system: compiled for blocks, and plain Python for any other."""

    def __call__(self, *arguments: object) -> object:
        if isinstance(arguments[0], Block):
            return super().__call__(*arguments)
        return self.function(*arguments)


class Inline(Kernel):
    """A kernel that is a part of its callers, and plain Python for callers in Python: it may return
    blocks."""

    def __call__(self, *arguments: object) -> object:
        return self.function(*arguments)


class Contract:
    """What kernels ask of a system: each class of blocks gives a kernel of its own (`given_by`), and any
    other object has a method of this name."""

    def __init__(self, function: Callable[..., object]) -> None:
        update_wrapper(self, function)
        self.name, self.function = function.__name__, function
        self.given: dict[str, Any] = {}

    def given_by(self, kind: type[Block]) -> Callable[[F], F]:
        """Let the kernel that follows be that of a class of blocks."""

        def give(kernel: F) -> F:
            self.given[kind.__name__] = kernel
            return kernel

        return give

    def __call__(self, system: object, *arguments: object) -> Any:
        own = self.given.get(type(system).__name__)
        return getattr(system, self.name)(*arguments) if own is None else own(system, *arguments)

    @cached_property
    def _numba_type_(self) -> Any:
        return _calls().type_of_contract(self)


def kernel(function: F) -> F:
    """Compile `function` on first call, without the GIL, with IEEE division, cached on disk.

    Code of other modules calls it; a private one becomes a part of the code that calls it.

    A kernel allocates nothing: it is compiled without reference counting, which would otherwise be paid for
    each array of each call, and numba refuses it if it allocates.
    """
    return _compile(function, _is_private(function))


def allocating_kernel(function: F) -> F:
    """A kernel that may allocate: for rare work of unknown size, never for a hot path."""
    return _compile(function, _is_private(function), _nrt=True)


def system_kernel(function: F) -> F:
    """A kernel whose first argument is a system, compiled or not (see `Contract`)."""
    return _compile(function, _is_private(function), SystemKernel)


def rare_kernel(function: F) -> F:
    """A kernel that many runs never need: though it is private, it is compiled when it is first called."""
    return _compile(function, is_part=False)


def imported_kernel(module: str) -> Callable[[F], F]:
    """Stand for the kernel of the same name and signature in `module`, imported at its first call: for code
    that few runs need and that takes long to import."""

    def declare(function: F) -> F:
        def imported(*arguments: object) -> object:
            return getattr(import_module(module), function.__name__)(*arguments)

        update_wrapper(imported, function)
        imported.__module__ = module
        return _compile(imported, is_part=False)  # type: ignore[return-value]

    return declare


def inner_kernel(function: F) -> F:
    """A kernel that becomes a part of each caller, where a call would take as long as the work."""
    return _compile(function, True, forceinline=True)


def inline(function: F) -> F:
    """An inner kernel that may return blocks (see `Inline`)."""
    return _compile(function, True, Inline, forceinline=True)


def summing_kernel(function: F) -> F:
    """An inner kernel whose sums are taken in whatever order is fastest, several terms at a time."""
    return _compile(function, True, forceinline=True, fastmath={"reassoc", "contract"})


def steady(kernel: F) -> F:
    """A caller of a kernel for arguments that keep their types, which are looked at in its first call alone:
    for loops in Python, where that takes as long as a short kernel. Arguments of other types would be read
    wrongly."""
    if not isinstance(kernel, Kernel):
        return kernel
    code: Callable[..., object] | None = None
    calls: Any = None
    thread: Any = None

    def call(*arguments: object) -> object:
        nonlocal code, calls, thread
        if code is None:
            calls, code = _calls(), kernel.code_for(arguments)
            thread = calls.thread
        # As `compilation.calls.call`, written out: a call of a function would cost as much as these lines.
        try:
            found = code(*arguments)
        except BaseException as error:
            calls.raise_late(error)
        if thread.error is not None:
            calls.raise_late()
        return found

    return call  # type: ignore[return-value]


def linking_time() -> float:
    """Seconds that this thread has spent, within compiled code, on loading and compiling called kernels."""
    calls = sys.modules.get("rungwise.compilation.calls")
    return 0.0 if calls is None else float(calls.thread.seconds)


def _calls() -> Any:
    """The module that knows numba, named and not imported: it is loaded when the first kernel is called."""
    return import_module("rungwise.compilation.calls")


def _is_private(function: Callable[..., object]) -> bool:
    """Whether the function belongs to one module, or to one function there."""
    return function.__name__.startswith("_") or "<" in function.__qualname__


def _compile(function: F, is_part: bool, kind: type[Kernel] = Kernel, **options: object) -> F:
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return function
    return kind(function, is_part, **options)  # type: ignore[return-value]


@inner_kernel
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """target[...] = source, of one shape, with one dimension or two (numba's own assignment makes a temporary
    copy, and reshaping is a call)."""
    if target.ndim == 1:
        for i in range(target.shape[0]):
            target[i] = source[i]
    else:
        for i in range(target.shape[0]):
            for j in range(target.shape[1]):
                target[i, j] = source[i, j]
