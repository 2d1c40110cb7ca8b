"""How much solvers may do: a bound on the time of a solve that does not depend on the machine."""

from __future__ import annotations

LIMIT = 1e11
"""Multiplications that one call of `rw.solve` may make."""
SHARE = 1 / 2
"""Of what is left, for the next solver of the chain."""
STEP = 1e6
"""What goes with factors, however small they are."""
_LOW = 0.2
DENSE = 0.2
"""Blocked arithmetic on dense matrices takes so much of the time of sparse arithmetic, per multiplication."""


class Work:
    """Multiplications that may still be made: of factors by their entries to the power 1.5, of sweeps by the
    entries of the matrix. Whoever makes them says so, and ends when none are left."""

    def __init__(self, left: float = LIMIT) -> None:
        self.left = left

    @property
    def is_spent(self) -> bool:
        return not self.left > 0.0

    @property
    def is_low(self) -> bool:
        """Whether too little work is left to begin anything more."""
        return self.left < _LOW * LIMIT

    def spend(self, multiplications: float) -> None:
        self.left -= multiplications

    def spend_factors(self, entries: float) -> None:
        """That a matrix was factorised whose factors have so many entries, and used in a step."""
        self.left -= entries**1.5 + STEP

    def part(self, share: float = SHARE) -> Work:
        """So much of what is left, as work of its own; whoever takes it says afterwards what was done."""
        return Work(max(share * self.left, 0.0))
