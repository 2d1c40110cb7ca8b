"""MuJoCo's C functions in kernels, by their symbols, and rows of constraints, which move in MuJoCo's memory.

A kernel knows a model and its data by their addresses (2,), which hold as long as both live. In plain Python
the functions are those of MuJoCo's package, of the objects with these addresses.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Ints

Ints32: TypeAlias = NDArray[np.int32]
MODEL, DATA = 0, 1
"""Places of the addresses of a model and of its data."""
COUNTS = ("ne", "nf", "nl")
"""Of rows of equalities, dry friction, and limits, in this order among MuJoCo's constraints."""
ROWS = (
    "efc_type", "efc_id", "efc_J_rownnz", "efc_J_rowadr", "efc_J_colind", "efc_J", "efc_pos",
    "efc_frictionloss",
)  # fmt: skip
"""What MuJoCo says of constraints; it lies in memory that each state divides anew."""
INTEGER, REAL = 4, 8
"""Bytes of MuJoCo's int and mjtNum."""


class Native:
    """A C function of MuJoCo whose arguments are addresses or, where `kinds` says i or d, an int or a real
    number."""

    def __init__(self, name: str, kinds: str) -> None:
        self.name, self.kinds = name, kinds

    @cached_property
    def _numba_type_(self) -> Any:
        from numba import types

        load()
        kinds = {"p": types.intp, "i": types.int32, "d": types.float64}
        return types.ExternalFunction(self.name, types.void(*map(kinds.__getitem__, self.kinds)))

    def __call__(self, *arguments: Any) -> None:
        kinds = zip(self.kinds, arguments, strict=True)
        self._function(*(float(value) if kind == "d" else int(value) for kind, value in kinds))

    @cached_property
    def _function(self) -> Any:
        found = getattr(ctypes.CDLL(_library()), self.name)
        kinds = {"p": ctypes.c_void_p, "i": ctypes.c_int, "d": ctypes.c_double}
        found.argtypes, found.restype = list(map(kinds.__getitem__, self.kinds)), None
        return found


mj_kinematics = Native("mj_kinematics", "pp")
mj_comPos = Native("mj_comPos", "pp")
mj_tendon = Native("mj_tendon", "pp")
mj_makeM = Native("mj_makeM", "pp")
mj_factorM = Native("mj_factorM", "pp")
mj_makeConstraint = Native("mj_makeConstraint", "pp")
mj_transmission = Native("mj_transmission", "pp")
mj_comVel = Native("mj_comVel", "pp")
mj_passive = Native("mj_passive", "pp")
mj_energyPos = Native("mj_energyPos", "pp")
mj_rne = Native("mj_rne", "ppip")
mj_solveM = Native("mj_solveM", "ppppi")
mj_mulM = Native("mj_mulM", "pppp")
mj_integratePos = Native("mj_integratePos", "pppd")


@cache
def load() -> None:
    """Let compiled code find MuJoCo's functions, also where it comes from a cache."""
    import llvmlite.binding as llvm

    llvm.load_library_permanently(_library())


@cache
def _library() -> str:
    import mujoco

    folder = Path(mujoco.__file__).parent
    found = [path for pattern in ("libmujoco*", "mujoco*.dll") for path in folder.glob(pattern)]
    if not found:
        raise InputError(f"mujoco: its library is not beside its package in {folder.name}; install it anew")
    return str(min(found))


class Read:
    """Reads a number at an address: an integer or a real of so many bytes."""

    def __init__(self, kind: Any, bits: int) -> None:
        self.kind, self.bits = kind, bits

    def __call__(self, address: int) -> Any:
        return self.kind.from_address(int(address)).value

    @cached_property
    def _numba_type_(self) -> Any:
        from llvmlite import ir
        from numba import types
        from numba.core.typing.templates import make_intrinsic_template

        is_real = self.kind is ctypes.c_double
        own = ir.DoubleType() if is_real else ir.IntType(self.bits)
        found = types.float64 if is_real else types.int64

        def write(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            value = builder.load(builder.inttoptr(arguments[0], own.as_pointer()))
            return value if is_real or self.bits == 64 else builder.sext(value, ir.IntType(64))

        def define(_context: Any, _address: Any) -> Any:
            return found(types.int64), write

        return types.Function(make_intrinsic_template(self, define, "read", prefer_literal=False, kwargs={}))


integer_at: Callable[[int], int] = Read(ctypes.c_int32, 32)
pointer_at: Callable[[int], int] = Read(ctypes.c_int64, 64)
real_at: Callable[[int], float] = Read(ctypes.c_double, 64)


@cache
def offsets() -> Ints:
    """Where in MuJoCo's data `COUNTS` and the addresses of `ROWS` lie, in bytes from its beginning. Raises
    InputError for a version of MuJoCo that does not say so truly."""
    import mujoco

    layout = _layout("mjData")
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    found = [int(getattr(layout, name).offset) for name in (*COUNTS, *ROWS)]
    counts = [integer_at(data._address + at) for at in found[: len(COUNTS)]]
    rows = [pointer_at(data._address + at) for at in found[len(COUNTS) :]]
    known = [getattr(data, name).__array_interface__["data"][0] for name in ROWS]
    if counts != [getattr(data, name) for name in COUNTS] or rows != known:
        raise InputError(f"mujoco: the layout of its data in version {mujoco.__version__} is not known")
    return np.array(found, np.int64)


_PROBE = """<mujoco><option jacobian="sparse"/><worldbody><body><joint name="a" limited="true" range="1 2"
 frictionloss="1"/><geom size="1"/></body></worldbody><equality><joint joint1="a"/></equality></mujoco>"""
"""A model with a row of each kind."""
_KINDS: dict[str, Any] = {
    "int": ctypes.c_int, "size_t": ctypes.c_size_t, "uintptr_t": ctypes.c_size_t, "mjtSize": ctypes.c_int64,
    "mjtNum": ctypes.c_double, "mjtBool": ctypes.c_uint8, "mjtByte": ctypes.c_uint8,
    "double": ctypes.c_double, "float": ctypes.c_float, "uint64_t": ctypes.c_uint64, "char": ctypes.c_char,
}  # fmt: skip


@cache
def _layout(name: str) -> Any:
    """A struct of MuJoCo's, as its package describes it."""
    from mujoco.introspect.structs import STRUCTS

    fields = [(field.name, _kind(field.type)) for field in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _kind(described: Any) -> Any:
    if hasattr(described, "extents"):
        found = _kind(described.inner_type)
        for extent in reversed(described.extents):
            found = found * extent
        return found
    if not hasattr(described, "name"):
        return ctypes.c_void_p
    return _KINDS[described.name] if described.name in _KINDS else _layout(described.name)
