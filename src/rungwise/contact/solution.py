"""The answers of `solve`: never more than has been judged or certified."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from rungwise.contact.judge.farkas import Infeasible
from rungwise.contact.judge.residuals import Residuals
from rungwise.contact.problem import Array, Problem
from rungwise.plain import brief


class Status(StrEnum):
    """SOLVED within tolerance · JAMMED no rates satisfy the laws, certified · UNSUPPORTED no forces balance
    the loads, certified · NOT_CONVERGED neither, and the residual says how far off the answer is."""

    SOLVED = "solved"
    JAMMED = "jammed"
    UNSUPPORTED = "unsupported"
    NOT_CONVERGED = "not_converged"


ADVICE = {
    Status.SOLVED: "every law holds within the tolerance",
    Status.JAMMED: "no rates and forces satisfy all laws; the certificate proves it",
    Status.UNSUPPORTED: "no contact, joint or drive can balance the loads; the certificate is the motion",
    Status.NOT_CONVERGED: "no solver came within tolerance, and no certificate says why: see the residual",
}

FORCES_ALONE = (
    "the rounding of a Delassus matrix hides small differences of velocities, and its entries are many: give"
    " the problem as `Problem.balance`, which takes less time and knows these differences"
)
"""What else helps where a problem has contacts and no velocities."""


@dataclass(frozen=True)
class Attempt:
    """One solver's part: its iterations, and the best natural residual after it."""

    solver: str
    iterations: int
    residual: float


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """x (N,) and rates y = A x + b (N,) of the problem, judged by its `residuals`, of which none may exceed
    `tol` where the `status` says solved; `attempts`: each solver tried, in order, with what it came to.

    `certificate` is there when the status is JAMMED or UNSUPPORTED; x is then the least violation met.
    `massless`: judged beside the demanded rates, for inertia is next to zero (see `system`); the certificate
    is then a certificate of `scaled(problem, massless=True)`. `unfinished`: the time
    was over.
    """

    problem: Problem
    status: Status
    x: Array
    y: Array
    residuals: Residuals
    tol: float
    attempts: tuple[Attempt, ...]
    certificate: Infeasible | None = None
    massless: bool = False
    unfinished: bool = False

    __repr__ = brief

    @property
    def r(self) -> Array:
        """Contact forces (k d,), normal first."""
        return self.x[: self.problem.rows]

    @property
    def u(self) -> Array:
        """Contact rates (k d,): W r + q."""
        return self.y[: self.problem.rows]

    @property
    def v(self) -> Array:
        """Velocities of a mixed form (n,)."""
        return self.x[self.problem.rows : self.problem.rows + self.problem.velocities]

    @property
    def z(self) -> Array:
        """Unknowns that are neither contact forces nor velocities: unknowns of LCPs, joints, limited rows."""
        return self.x[self.problem.rows + self.problem.velocities :]

    @property
    def chain(self) -> tuple[str, ...]:
        """Names of the solvers that were called, in order."""
        return tuple(attempt.solver for attempt in self.attempts)

    @property
    def iterations(self) -> int:
        """Iterations of all attempts together."""
        return sum(attempt.iterations for attempt in self.attempts)

    @property
    def reason(self) -> str:
        """What the status means, and what to do where it says that no answer was found."""
        if self.status == Status.NOT_CONVERGED and self.unfinished:
            last = f" ({self.chain[-1]} was the last solver)" if self.attempts else ""
            return f"the time is over, before any solver came within tolerance{last}: see the residual"
        is_local = self.problem.rows > 0 and self.problem.velocities == 0
        if self.status == Status.NOT_CONVERGED and is_local:
            return f"{ADVICE[self.status]}; {FORCES_ALONE}"
        return ADVICE[self.status]

    def summary(self) -> dict[str, object]:
        """Plain values, for printing."""
        return {
            "status": str(self.status),
            "reason": self.reason,
            "contacts": len(self.problem.mu),
            "directions": self.problem.directions,
            "unknowns": len(self.problem.b),
            "residual": self.residuals.worst,
            "tol": self.tol,
            "residuals": asdict(self.residuals),
            "chain": list(self.chain),
            "iterations": self.iterations,
            "certificate": None if self.certificate is None else self.certificate.kind,
        }

    def save(self, path: str | Path) -> None:
        """Write r, u, v, z to `path` (npz), atomically, by way of a file beside it."""
        path = Path(path)
        partial = path.with_name(path.name + ".part")
        try:
            with partial.open("wb") as file:
                np.savez(file, r=self.r, u=self.u, v=self.v, z=self.z)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
