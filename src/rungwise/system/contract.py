"""What the steps of any system ask of it, in kernels: see `system.moving.System`, which says what each does.

A block gives kernels; any other object has methods of these names, and then steps are plain Python.
"""

from __future__ import annotations

from typing import Any

from rungwise.kernel import Contract, Ints, Reals
from rungwise.system.moving import Moment
from rungwise.system.terms import Terms


@Contract
def fill(
    system: Any, moment: Moment, terms: Terms, reach: float, slots: Ints, fresh: Ints, driving: Reals
) -> int:
    """Fill terms, the slots of contacts and whether each is new, and driving (n,), the part of the load that
    drives are; returns how many contacts there are, or a number below 0 where there is no room for all."""
    raise NotImplementedError


@Contract
def integrate(system: Any, q: Reals, v: Reals, h: float, after: Reals) -> None:
    """Fill after (n_q,) with the coordinates that v reaches from q within h."""
    raise NotImplementedError


@Contract
def least_gap(system: Any, q: Reals) -> float:
    """The smallest gap of all contacts; inf where there is none."""
    raise NotImplementedError


@Contract
def passes(system: Any, q: Reals, v: Reals, h: float) -> bool:
    """Whether v may lead anything through another within h of q, which the last terms were filled at."""
    raise NotImplementedError


@Contract
def fastest(system: Any, q: Reals, v: Reals) -> float:
    """A bound on the speed with which any two points approach each other."""
    raise NotImplementedError


@Contract
def tell_laws(system: Any, trial: Any, at_start: bool) -> None:
    """Add to terms what further laws of contact say; `at_start`: of where the step begins."""
    raise NotImplementedError
