"""Pinocchio's constraint solvers as a peer (`peer_process`): run by a Python that has it (`pip install pin`).

A task has: file, npz with G (n, n), g (n,) and mu (k,), two tangents first and the normal last in each
contact, velocities G lambda + g; solver, as in `SOLVERS`; tol, of feasibility and complementarity over the
largest of |g|; slow, seconds beyond which a solve is not repeated. Times are from nothing, on a dense
Delassus operator: what `solve` measures itself by the clock, or the processor's time of the call where that
is less, because others use the machine too. Coulomb's law is asked for (`solve_ncp`), not its convex
relaxation.
"""

from __future__ import annotations

import importlib
import time
from typing import Any

import numpy as np
from peer_process import Answer, Task, serve, typical

SOLVERS = ("ADMM OSQP", "ADMM SPECTRAL", "ADMM OSQP A8", "ADMM SPECTRAL A8", "PGS")
"""Method, rule by which its penalty is updated, and iterates that Anderson's acceleration remembers."""
ITERATIONS, TRIAL, SHARE = 100_000, 20, 0.6
"""At most so many, and after so many for trial no more than this share of the time that is left."""


def solve(task: Task) -> Answer:
    pin = importlib.import_module("pinocchio")
    with np.load(task["file"]) as told:
        G, g, mu = np.asfortranarray(told["G"]), told["g"], told["mu"]
    method, *rule = task["solver"].split()
    models, datas = _contacts(pin, mu)
    settings = getattr(pin, f"{method}SolverSettings")()
    settings.solve_ncp = settings.measure_timings = True
    settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = task["tol"] * abs(g).max()
    settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
    if rule:
        settings.admm_update_rule = getattr(pin.ADMMUpdateRule, rule[0])
        settings.anderson_capacity = int(rule[1][1:]) if len(rule) > 1 else 0
    forces, converged = np.zeros(len(g)), False

    def batch(times: int) -> float:
        nonlocal forces, converged
        total = 0.0
        for _ in range(times):
            result = getattr(pin, f"{method}SolverResult")()
            solver = getattr(pin, f"{method}ConstraintSolver")(len(g))
            operator = pin.DelassusOperatorDense(G)
            began = time.thread_time()
            converged = solver.solve(operator, g, models, datas, settings, result)
            total += min(1e-6 * solver.getElapsedTime(), time.thread_time() - began)
        forces = result.retrieveConstraintImpulses()
        return total

    settings.max_iterations = TRIAL
    each = batch(1) / TRIAL
    settings.max_iterations = max(TRIAL, min(ITERATIONS, int(SHARE * task["limit"] / each)))
    seconds = typical(batch, min(task["slow"], SHARE * task["limit"] / 10.0))
    return Answer(seconds, forces, bool(converged))


def _contacts(pin: Any, mu: Any) -> tuple[Any, Any]:
    """As many contacts of points of the world: their places do not matter, their friction does."""
    model = pin.Model()
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    for friction in mu:
        contact = pin.PointContactConstraintModel(model)
        contact.setFriction(float(friction))
        models.append(pin.ConstraintModel(contact))
        datas.append(models[len(models) - 1].createData())
    return models, datas


if __name__ == "__main__":
    # Forks have it then.
    importlib.import_module("pinocchio")
    serve(solve)
