"""Siconos as a peer (`peer_process`): its own Python (Debian: python3-siconos) runs this.

    PYTHON benchmarks/siconos_peer.py LOOP

LOOP is `siconos_loop.c`, compiled. A task has: file, a problem in Siconos' text format, or npz with M (n, n)
and q (n,) of an LCP; kind, as in `SOLVERS`; solver; tol, for the solver; rows and velocities, the numbers of
unknowns; slow, seconds beyond which a solve is not repeated. Times are of the driver alone, from nothing, and
apart from them of the set-up that solvers of MLCPs ask for once per problem.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from peer_process import Answer, Task, serve, typical

ITERATIONS = 100_000
SOLVERS = {
    "lcp": (
        "LEMKE", "PIVOT", "BARD", "MURTY", "NEWTON_FB_FBLSA", "NEWTONMIN", "AVI_CAOFERRIS", "PGS", "CPG",
        "ENUM",
    ),
    "mlcp": (
        "DIRECT_ENUM", "ENUM", "LCP_LEMKE", "FB", "DIRECT_FB", "PGS", "RPGS", "PSOR", "RPSOR", "SIMPLEX",
        "DIRECT_SIMPLEX",
    ),
    "relay": ("LEMKE", "AVI_CAOFERRIS", "PGS", "ENUM"),
    "fc2d": ("NSGS", "LEMKE", "CPG", "ENUM"),
    "fc3d": ("NSGS", "NSN_AC", "NSN_FB", "ADMM", "PROX", "ACLMFP", "VI_EG"),
    "gfc3d": ("NSGS_WR", "NSN_AC_WR", "ADMM_WR", "PROX_WR", "NSGS", "NSN_AC", "ADMM", "IPM", "ACLMFP"),
}  # fmt: skip
_PREFIX = {
    "lcp": "LCP",
    "mlcp": "MLCP",
    "relay": "RELAY",
    "fc2d": "FRICTION_2D",
    "fc3d": "FRICTION_3D",
    "gfc3d": "GLOBAL_FRICTION_3D",
}
_DRIVER = {"lcp": "linearComplementarity_driver"}
_SET_UP = {"mlcp": ("mlcp_driver_init", "mlcp_driver_reset")}
"""What begins and ends work on a problem: some solvers remember in between what they have found."""
_MANY = ("NSGS", "ADMM", "PGS", "PSOR", "VI_EG", "ENUM")


def _read(siconos: Any, library: Any, file: str, kind: str) -> tuple[int, Any]:
    """The address of the problem, and what keeps it."""
    if kind == "relay":
        # Python has no class for it.
        read = library.relay_new_from_filename
        read.restype, read.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        return read(file.encode()), None
    if kind == "lcp":
        with np.load(file) as told:
            made = siconos.LCP(told["M"], told["q"])
    elif kind == "mlcp":
        made = siconos.mixedLinearComplementarity_new()
        siconos.mixedLinearComplementarity_newFromFilename(made, file)
    else:
        prefix = "globalFrictionContact" if kind == "gfc3d" else "frictionContact"
        made = getattr(siconos, f"{prefix}_new_from_filename")(file)
    return int(made.this), made


def _parameters(siconos: Any, options: Any) -> Iterator[Any]:
    """Parameters of a solver and of those within it, where they are."""
    yield from (options.iparam, options.dparam)
    for inner in range(options.numberOfInternalSolvers):
        yield from _parameters(siconos, siconos.solver_options_get_internal_solver(options, inner))


def _array(kind: Any, values: list[int]) -> Any:
    return (kind * len(values))(*values)


def _addresses(arrays: list[Any]) -> Any:
    return _array(ctypes.c_void_p, [array.ctypes.data for array in arrays])


def solve(task: Task, loop: str) -> Answer:
    siconos, kind, solver = importlib.import_module("siconos.numerics"), task["kind"], task["solver"]
    options = siconos.SolverOptions(getattr(siconos, f"SICONOS_{_PREFIX[kind]}_{solver}"))
    options.iparam[0] = ITERATIONS if any(name in solver for name in _MANY) else ITERATIONS // 100
    options.dparam[0] = task["tol"]
    repeat = ctypes.CDLL(loop).repeat
    repeat.argtypes = [ctypes.c_void_p] * 8 + [ctypes.c_int] * 2 + [ctypes.c_void_p] * 3 + [ctypes.c_int] * 2
    library = ctypes.CDLL(importlib.import_module("siconos._numerics").__file__)
    driver, *set_up = (
        ctypes.cast(getattr(library, name), ctypes.c_void_p)
        for name in (_DRIVER.get(kind, f"{kind}_driver"), *_SET_UP.get(kind, ()))
    )
    set_up = set_up or [None, None]
    r, u, v = np.zeros(task["rows"]), np.zeros(task["rows"]), np.zeros(max(1, task["velocities"]))
    parameters = list(_parameters(siconos, options))
    kept = [part.copy() for part in parameters]
    places = (_addresses(parameters), _addresses(kept), _array(ctypes.c_size_t, [a.nbytes for a in kept]))
    vectors, sizes = (r.ctypes.data, u.ctypes.data, v.ctypes.data), (task["rows"], task["velocities"])
    problem, failed = _read(siconos, library, task["file"], kind), 0

    def some(driver: Any, times: int) -> float:
        nonlocal failed
        began = time.thread_time()
        failed = repeat(
            driver, *set_up, problem[0], *vectors, int(options.this), *sizes, *places, len(kept), times
        )
        return time.thread_time() - began

    def batch(times: int) -> float:
        nonlocal problem
        if kind != "gfc3d":
            return some(driver, times)
        # Its drivers may leave the factors of the mass in the place of the mass.
        total = 0.0
        for _ in range(times):
            problem = _read(siconos, library, task["file"], kind)
            total += some(driver, 1)
        return total

    preparation = typical(lambda times: some(None, times), task["slow"]) if kind in _SET_UP else 0.0
    seconds = typical(batch, task["slow"])
    return Answer(max(0.0, seconds - preparation), r, not failed, preparation)


if __name__ == "__main__":
    # Forks have it then.
    importlib.import_module("siconos.numerics")
    serve(lambda task: solve(task, sys.argv[1]))
