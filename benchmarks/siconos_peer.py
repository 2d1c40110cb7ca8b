"""One solver of Siconos on one problem file, in a process of its own: some of them end the process.

    PYTHON benchmarks/siconos_peer.py FILE KIND SOLVER VELOCITIES OUT

KIND is fc2d, fc3d or gfc3d; SOLVER as in `SOLVERS`; VELOCITIES is their number, for gfc3d. OUT (npz) gets
`times` (t,), the least processor time in seconds of the driver alone from nothing, and `r` (t, n), the
forces, for each of its own tolerances in `TOLERANCES`. It needs numpy and siconos only.
"""

from __future__ import annotations

import importlib
import os
import sys
import time

import numpy as np

TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
ITERATIONS = 100_000
ENOUGH = 0.2
"""Seconds after which a solve is not repeated, and no tighter tolerance is tried after ten times that."""
SOLVERS = {
    "fc2d": ("NSGS", "LEMKE", "CPG", "ENUM"),
    "fc3d": ("NSGS", "NSN_AC", "NSN_FB", "ADMM", "PROX", "ACLMFP", "VI_EG"),
    "gfc3d": ("NSGS_WR", "NSN_AC_WR", "ADMM_WR", "PROX_WR", "NSGS", "NSN_AC", "ADMM", "IPM", "ACLMFP"),
}
_PREFIX = {"fc2d": "FRICTION_2D_", "fc3d": "FRICTION_3D_", "gfc3d": "GLOBAL_FRICTION_3D_"}


def main(file: str, kind: str, solver: str, velocities: str, out: str) -> None:
    siconos = importlib.import_module("siconos.numerics")
    prefix = "globalFrictionContact" if kind == "gfc3d" else "frictionContact"
    problem = getattr(siconos, f"{prefix}_new_from_filename")(file)
    n = problem.dimension * problem.numberOfContacts
    times, forces = [], []
    for tol in TOLERANCES:
        options = siconos.SolverOptions(getattr(siconos, f"SICONOS_{_PREFIX[kind]}{solver}"))
        options.iparam[0] = ITERATIONS if "NSGS" in solver or "ADMM" in solver else ITERATIONS // 100
        options.dparam[0] = tol
        least = np.inf
        for _ in range(20):
            r, u, v = np.zeros(n), np.zeros(n), np.zeros(int(velocities))
            unknowns = (r, u, v) if kind == "gfc3d" else (r, u)
            began = time.process_time()
            getattr(siconos, f"{kind}_driver")(problem, *unknowns, options)
            least = min(least, time.process_time() - began)
            if least > ENOUGH:
                break
        times.append(least)
        forces.append(r)
        np.savez(f"{out}.part.npz", times=times, r=forces)
        os.replace(f"{out}.part.npz", out)
        if least > 10.0 * ENOUGH:
            break


if __name__ == "__main__":
    main(*sys.argv[1:])
