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


@Contract
def fill_speeds(system: Any, time: float, speeds: Reals) -> None:
    """Fill speeds (n,) with the prescribed velocities; nan for velocities that are free."""
    raise NotImplementedError


@Contract
def follow(system: Any, values: Reals, h: float, ends: bool) -> None:
    """Follow inputs, which are told as in the middle of a step of length h, and then as where it `ends`."""
    raise NotImplementedError


@Contract
def lacks_room(system: Any) -> bool:
    """Whether there was no room for all contacts since this was asked last: then what was found is void."""
    raise NotImplementedError


@Contract
def until_edge(system: Any, trial: Any) -> float:
    """A step of length h, from terms where it begins, or less where a contact comes to the edge of a pull."""
    raise NotImplementedError


@Contract
def accept(system: Any, q: Reals, v: Reals, trial: Any) -> None:
    """A step was taken and led to q and v: its contacts are those of the last `fill`."""
    raise NotImplementedError


@Contract
def keep(system: Any) -> None:
    """Keep what steps change, which `take_back` brings back as long as one more step was taken at most."""
    raise NotImplementedError


@Contract
def take_back(system: Any) -> None:
    """Be again as when that was kept."""
    raise NotImplementedError


@Contract
def tell_values(system: Any, asked: Any, q: Reals, v: Reals, values: Reals) -> bool:
    """Fill in what conditions ask of q and v: gaps, poses, ways; whether there was room for all contacts."""
    raise NotImplementedError


@Contract
def hear(system: Any, asked: Any, force: Reals, h: float, values: Reals) -> None:
    """Fill in the normal forces that conditions ask for, from forces by slot (s, d), normal first, and add
    their impulses in a step of length h."""
    raise NotImplementedError


@Contract
def remember(system: Any, setting: Any, out: Reals, bits: Ints, at: int) -> int:
    """Write what a run hands on of the core and of the system into `out` from `at` on, of which `bits` are
    the same numbers as integers; returns where it ends, -1 where there is no room."""
    raise NotImplementedError


@Contract
def tell_frame(system: Any, setting: Any, out: Reals, at: int) -> int:
    """Write what else is to be known of the state of a run, its energy first; returns as `remember`."""
    raise NotImplementedError
