"""How much solvers may do, by the size of the problem: a bound on the time of a solve that does not depend on
the machine."""

from __future__ import annotations

from rungwise.deadline import Deadline

LIMIT, SLIGHT, SQUARE = 5e10, 1e9, 1e4
"""Multiplications that one call of `rw.solve` may make at most; and those that it may for any problem and
for each pair of its unknowns. Chosen by trial: three times as many as the hardest solved problems need."""
SHARE = 1 / 2
"""Share of the remaining work that the next solver of the chain may take; chosen by trial."""
STEP = 1e6
"""Multiplications counted for every factorisation, however small its factors are; chosen by trial, to a
decade."""
_LOW = 0.2
"""Share of all that is allowed below which no further attempt is begun; chosen by trial."""
DENSE = 0.2
"""Time of blocked arithmetic on dense matrices over the time of sparse arithmetic, per multiplication;
chosen by trial."""


def allowed(unknowns: int) -> float:
    """Multiplications for a problem of so many unknowns."""
    return min(SLIGHT + SQUARE * float(unknowns) ** 2, LIMIT)


class Work:
    """Multiplications that may still be made: of factors by their entries to the power 1.5, of sweeps by the
    entries of the matrix. A solver reports the multiplications it makes, and ends when none are left, or
    when the `deadline` has come, whose halt (1,) compiled loops read."""

    def __init__(self, left: float = LIMIT, deadline: Deadline | None = None) -> None:
        self.left = self._whole = left
        self.deadline = deadline or Deadline()
        self.halt = self.deadline.halt

    @property
    def is_halted(self) -> bool:
        """Whether the time of the call is over."""
        return bool(self.halt[0] != 0)

    @property
    def is_spent(self) -> bool:
        return self.is_halted or not self.left > 0.0

    @property
    def is_low(self) -> bool:
        """Whether too little work is left to begin anything more."""
        return self.is_halted or self.left < _LOW * self._whole

    def spend(self, multiplications: float) -> None:
        self.left -= multiplications

    def spend_factors(self, entries: float) -> None:
        """Count the work of one step with factors of so many entries: to make the factors and to use them."""
        self.left -= entries**1.5 + STEP

    def part(self, share: float = SHARE) -> Work:
        """A share of the remaining work as separate `Work`; its user reports afterwards what was spent."""
        return Work(max(share * self.left, 0.0), self.deadline)
