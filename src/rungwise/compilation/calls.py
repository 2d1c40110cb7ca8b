"""Kernels that numba compiles each on its own, and how compiled code calls them.

Left to itself, numba copies a function that is called into each of its callers and optimises it there again:
of nested kernels the innermost is compiled as often as there are ways to reach it. Here a kernel is compiled
once, when it is first called. Compiled code reaches it through a *cell*, a pointer in the caller's own data
that is null at first. A call that finds null asks `_link` for the address, with the kernel's name and types
of arguments, which lie beside the cell; `_link` loads or compiles the kernel and fills the cell. So code that
never runs is never compiled, and code from the cache brings all data for finding the kernels it calls. Types
of results are taken from annotations, so that a caller can be compiled before the kernels it calls.

Private kernels of a module, inner kernels, and the few kernels that return arrays become parts of their
callers, as numba does it.
"""

from __future__ import annotations

import ctypes
import importlib
import inspect
import pickle
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

import llvmlite.binding
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.typing.templates import make_intrinsic_template

from rungwise.compilation.cache import KernelCache
from rungwise.compilation.entries import WithEntry, entry_name, short, shortened
from rungwise.compilation.indices import count_from_start
from rungwise.compilation.progress import compiling

if TYPE_CHECKING:
    from rungwise.kernel import Contract, Kernel

_SCALARS = {"int": types.int64, "float": types.float64, "bool": types.boolean, "None": types.none}


class LinkError(RuntimeError):
    """Compiled code could not be linked to a kernel that it calls; the reason is kept in `thread`."""


class Thread(threading.local):
    """Linking in a thread: the reason of its last failure, and its time in all."""

    error: BaseException | None = None
    seconds: float = 0.0


thread = Thread()


def result_type(function: Callable[..., object]) -> Any:
    """Numba's type of the result of an annotated kernel; None where the result is not made of scalars."""
    given = function.__annotations__.get("return", "")
    annotation = given.__name__ if isinstance(given, type) else str(given).replace(" ", "")
    if not annotation.startswith("tuple["):
        return _SCALARS.get(annotation)
    members = [_SCALARS.get(name) for name in annotation[len("tuple[") : -1].split(",")]
    return types.Tuple(tuple(members)) if all(members) else None


class KernelDispatcher(CPUDispatcher):
    """Numba's dispatcher, with the result's type from the annotation and the cache of this package."""

    def __init__(self, function: Callable[..., object], kind: str, **options: object) -> None:
        self._returns = result_type(function)
        is_linked = kind == "part" or self._returns is None
        has_entry = kind == "called" and not is_linked
        how = {"pipeline_class": WithEntry} if has_entry else {}
        options |= {"nopython": True, "no_cfunc_wrapper": True}
        super().__init__(py_func=function, targetoptions=options, **how)
        self._cache = KernelCache(function, kind, bool(options["_nrt"]), is_linked, has_entry)

    def compile(self, signature: Any) -> Any:
        arguments, _ = normalize_signature(signature)
        return super().compile(self._returns(*arguments) if self._returns else tuple(arguments))

    def address(self, arguments: tuple[Any, ...]) -> int:
        """Address of the machine code for these types of arguments; loaded or compiled now if need be."""
        self.compile(arguments)
        compiled = self.overloads[arguments]
        return int(compiled.library.get_pointer_to_function(entry_name(compiled.fndesc)))


def call(code: Callable[..., object], *arguments: object) -> object:
    """Call a kernel's dispatcher from Python. An interrupt that came where Python cannot raise it is raised
    here."""
    try:
        result = code(*arguments)
    except BaseException as error:
        raise_late(error)
    if thread.error is not None:
        raise_late()
    return result


def raise_late(error: BaseException | None = None) -> NoReturn:
    """Raise what a call raised, or in its place what came where Python could not raise it."""
    reason, thread.error = thread.error, None
    if error is None and reason is not None:
        raise reason
    compiling.reset()
    if error is None or isinstance(error, LinkError) or isinstance(reason, KeyboardInterrupt):
        raise (reason or KeyboardInterrupt()) from None
    raise error


def type_of(kernel: Kernel) -> Any:
    """Numba's type of a kernel as other kernels see it."""
    returns = result_type(kernel.function)
    if kernel.is_part or returns is None:
        return types.Dispatcher(kernel.inside)

    return _linked(kernel, returns, lambda _arguments: kernel)


def type_of_contract(contract: Contract) -> Any:
    """Numba's type of what each class of systems has a kernel for."""
    returns = result_type(contract.function)
    return _linked(contract, returns, lambda arguments: contract.given[arguments[0].kind])


def _linked(called: Kernel | Contract, returns: Any, chosen: Callable[[Any], Kernel]) -> Any:
    """Numba's type of what is called through a cell: the kernel that is chosen by the types of arguments."""

    def define(_context: object, *arguments: Any) -> tuple[Any, Callable[..., Any]]:
        kernel = chosen(arguments)
        key = pickle.dumps((kernel.__module__, kernel.name, arguments), protocol=5)
        return returns(*arguments), _caller(key)

    own = inspect.signature(called.function)
    first = inspect.Parameter("context", inspect.Parameter.POSITIONAL_ONLY)
    define.__signature__ = own.replace(parameters=[first, *own.parameters.values()])  # type: ignore[attr-defined]
    template = make_intrinsic_template(called, define, called.name, prefer_literal=False, kwargs={})
    return types.Function(template)


def _caller(key: bytes) -> Callable[..., Any]:
    """The function that writes a call through a cell."""

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        convention, module = context.call_conv, builder.module
        shorts = tuple(map(short, signature.args))
        kind = convention.get_function_type(signature.return_type, shorts).as_pointer()
        cell = cgutils.add_global_variable(module, kind, ".cell")
        cell.linkage, cell.initializer = "internal", ir.Constant(kind, None)
        with builder.if_then(cgutils.is_null(builder, builder.load(cell)), likely=False):
            asks = ir.FunctionType(cgutils.int32_t, [cgutils.voidptr_t, cgutils.intp_t, cgutils.voidptr_t])
            link = cgutils.get_or_insert_function(module, asks, _SYMBOL)
            text = cgutils.global_constant(module, ".kernel", cgutils.make_bytearray(key))
            size = ir.Constant(cgutils.intp_t, len(key))
            given = [builder.bitcast(text, cgutils.voidptr_t), size, builder.bitcast(cell, cgutils.voidptr_t)]
            with builder.if_then(cgutils.is_null(builder, builder.call(link, given)), likely=False):
                convention.return_user_exc(builder, LinkError, ())
        values = [shortened(context, builder, *each) for each in zip(signature.args, arguments, strict=True)]
        status, result = convention.call_function(
            builder, builder.load(cell), signature.return_type, shorts, values
        )
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return result

    return write


def _link(key: int, size: int, cell: int) -> None:
    """Fill a cell; where linking fails it stays null, and the reason is kept."""
    began = time.perf_counter()
    try:
        module, name, arguments = pickle.loads(ctypes.string_at(key, size))
        kernel = getattr(importlib.import_module(module), name)
        ctypes.c_void_p.from_address(cell).value = kernel.inside.address(arguments)
    except BaseException as error:
        thread.error = thread.error or error
    finally:
        thread.seconds += time.perf_counter() - began


def _keep_interrupts(of_others: Callable[[Any], object]) -> Callable[[Any], object]:
    """A hook for errors that cannot be raised: interrupts of callbacks are kept, so that `call` raises them.

    A signal that arrives within compiled code interrupts the first line of Python that follows. Where that is
    the first or the last one of `_link`, or a callback of the compiler, nobody else can catch it.
    """

    def keep(unraisable: Any) -> None:
        is_callback = "ctypes callback" in (unraisable.err_msg or "")
        if is_callback and isinstance(unraisable.exc_value, KeyboardInterrupt):
            thread.error = unraisable.exc_value
        else:
            of_others(unraisable)

    return keep


_SYMBOL = "rungwise_link"
_CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_void_p)(_link)
_LINKER = """
define i32 @linked(i8* %key, {size} %size, i8* %cell) {{
  %ask = inttoptr {size} {address} to void (i8*, {size}, i8*)*
  call void %ask(i8* %key, {size} %size, i8* %cell)
  %place = bitcast i8* %cell to i8**
  %code = load i8*, i8** %place
  %filled = icmp ne i8* %code, null
  %result = zext i1 %filled to i32
  ret i32 %result
}}
"""
"""Asks `_link`, and returns whether the cell is filled: after an error a callback returns anything."""


def _linker() -> Any:
    """The compiled `_LINKER`: it lives as long as what is returned."""
    llvmlite.binding.initialize_native_target()
    llvmlite.binding.initialize_native_asmprinter()
    size = f"i{8 * ctypes.sizeof(ctypes.c_ssize_t)}"
    address = ctypes.cast(_CALLBACK, ctypes.c_void_p).value
    module = llvmlite.binding.parse_assembly(_LINKER.format(size=size, address=address))
    machine = llvmlite.binding.Target.from_default_triple().create_target_machine()
    engine = llvmlite.binding.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine


count_from_start()
_ENGINE = _linker()
llvmlite.binding.add_symbol(_SYMBOL, _ENGINE.get_function_address("linked"))
sys.unraisablehook = _keep_interrupts(sys.unraisablehook)
