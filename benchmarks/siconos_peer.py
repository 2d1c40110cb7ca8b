"""Siconos as a peer (`peer_process`): its own Python (Debian: python3-siconos) runs this.

    PYTHON benchmarks/siconos_peer.py LOOP

LOOP is `siconos_loop.c`, compiled. A task has: file, a problem in Siconos' text format, or npz with M (n, n)
and q (n,) of an LCP; kind, as in `SOLVERS`; solver; tol, for the solver; rows and velocities, the numbers of
unknowns; slow, seconds beyond which a solve is not repeated. Times are of the driver alone, from nothing.
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
    "lcp": ("LEMKE", "PIVOT", "NEWTON_FB_FBLSA", "NEWTONMIN", "PGS", "ENUM"),
    "fc2d": ("NSGS", "LEMKE", "CPG", "ENUM"),
    "fc3d": ("NSGS", "NSN_AC", "NSN_FB", "ADMM", "PROX", "ACLMFP", "VI_EG"),
    "gfc3d": ("NSGS_WR", "NSN_AC_WR", "ADMM_WR", "PROX_WR", "NSGS", "NSN_AC", "ADMM", "IPM", "ACLMFP"),
}
_PREFIX = {"lcp": "LCP", "fc2d": "FRICTION_2D", "fc3d": "FRICTION_3D", "gfc3d": "GLOBAL_FRICTION_3D"}
_DRIVER = {"lcp": "linearComplementarity_driver"}
_MANY = ("NSGS", "ADMM", "PGS", "VI_EG")


def _read(siconos: Any, file: str, kind: str) -> Any:
    if kind == "lcp":
        with np.load(file) as told:
            return siconos.LCP(told["M"], told["q"])
    prefix = "globalFrictionContact" if kind == "gfc3d" else "frictionContact"
    return getattr(siconos, f"{prefix}_new_from_filename")(file)


def _parameters(siconos: Any, options: Any) -> Iterator[Any]:
    """Parameters of a solver and of those within it, where they are."""
    yield from (options.iparam, options.dparam)
    for inner in range(options.numberOfInternalSolvers):
        yield from _parameters(siconos, siconos.solver_options_get_internal_solver(options, inner))


def _array(kind: Any, values: list[int]) -> Any:
    return (kind * len(values))(*values)


def _addresses(arrays: list[Any]) -> Any:
    return _array(ctypes.c_void_p, [array.ctypes.data for array in arrays])


def solve(task: Task, library: str) -> Answer:
    siconos, kind, solver = importlib.import_module("siconos.numerics"), task["kind"], task["solver"]
    options = siconos.SolverOptions(getattr(siconos, f"SICONOS_{_PREFIX[kind]}_{solver}"))
    options.iparam[0] = ITERATIONS if any(name in solver for name in _MANY) else ITERATIONS // 100
    options.dparam[0] = task["tol"]
    loop = ctypes.CDLL(library).repeat
    loop.argtypes = [ctypes.c_void_p] * 6 + [ctypes.c_int] * 2 + [ctypes.c_void_p] * 3 + [ctypes.c_int] * 2
    drivers = ctypes.CDLL(importlib.import_module("siconos._numerics").__file__)
    driver = ctypes.cast(getattr(drivers, _DRIVER.get(kind, f"{kind}_driver")), ctypes.c_void_p)
    r, u, v = np.zeros(task["rows"]), np.zeros(task["rows"]), np.zeros(max(1, task["velocities"]))
    parameters = list(_parameters(siconos, options))
    kept = [part.copy() for part in parameters]
    places = (_addresses(parameters), _addresses(kept), _array(ctypes.c_size_t, [a.nbytes for a in kept]))
    vectors, sizes = (r.ctypes.data, u.ctypes.data, v.ctypes.data), (task["rows"], task["velocities"])
    problem, failed = _read(siconos, task["file"], kind), 0

    def some(times: int) -> float:
        nonlocal failed
        began = time.thread_time()
        failed = loop(
            driver, int(problem.this), *vectors, int(options.this), *sizes, *places, len(kept), times
        )
        return time.thread_time() - began

    def batch(times: int) -> float:
        nonlocal problem
        if kind != "gfc3d":
            return some(times)
        # Its drivers may leave the factors of the mass in the place of the mass.
        total = 0.0
        for _ in range(times):
            problem = _read(siconos, task["file"], kind)
            total += some(1)
        return total

    seconds = typical(batch, task["slow"])
    return Answer(seconds, r, not failed)


if __name__ == "__main__":
    # Forks have it then.
    importlib.import_module("siconos.numerics")
    serve(lambda task: solve(task, sys.argv[1]))
