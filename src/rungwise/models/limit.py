"""The limit eps -> 0+ in floating point: how much inertia stands for zero inertia.

Order 0 of the limit balances the resistances; order 1 lets inertia pick among the motions that balance. One
problem gives both with an inertia far below every other resistance, and far above the rounding of the forces.
Sizes are measured with `heft`, which bounds M.
"""

from __future__ import annotations

import math

from rungwise.contact.step import diagonal, span
from rungwise.kernel import Ints, Reals, RecordArray, kernel, rare_kernel
from rungwise.models.assemble import carried
from rungwise.system.entries import is_crowded, is_free, number_free, rate
from rungwise.system.terms import INERTIA, METRIC, Terms

LIMIT = 1e-8
"""Inertia in the limit eps -> 0+, relative to the other resistances to motion. As the constants below, chosen
by trial, to a decade; tests/simulation/test_faint.py and test_squeezed.py hold them."""
STIR = 1e3
"""Motion in a step, over the rounding of positions, from which on something under load no longer rests.
Chosen by trial, to a decade."""
HOVERS, HIDDEN, ROUNDED = 1e5, 1e-5, 2e-16
"""Roundings of positions by which the rounding of forces, of which the last is a part, may move a rigid
body in a step; the part of the other resistances that inertia may be for this. Chosen by trial, to a decade;
tests/simulation/test_faint.py and tests/simulation/spatial/test_pressed.py hold them."""
_SMALL = 1e-3
"""A load that is a smaller part of the greatest counts as this part, or inertia would be lost in the rounding
of the forces that balance the greatest. Chosen by trial, to a decade."""
_NOTHING = 1e-14
"""Load over the greatest that is rounding of sums of loads: about a hundred roundings."""


@kernel
def limit_inertia(
    rung: RecordArray,
    h: float,
    terms: Terms,
    contacts: int,
    limited: int,
    n: int,
    free: Ints,
    speed: Reals,
) -> float:
    """The eps of a rung: its own, or for the limit 0+ one far below every other resistance to motion.

    Each resistance is a rate at which it stops the heaviest body, which contacts may have it push: damping
    over inertia, a row's resistance times the row's yield to a force, a load over the momentum of the fastest
    motion demanded. eps is so small that a body that closes any gap within the step needs no force for this,
    nor a body that moves against the faintest damping. Without loads, damping, servos and compliance the
    limit does not depend on eps, and 1 is exact.
    """
    if rung[0].metric:
        return 0.0
    if rung[0].inertia > 0.0:
        return rung[0].inertia
    if n == 0:
        return 1.0
    number_free(terms.entries, free, n)
    heaviest = 0.0
    for i in range(n):
        a = free[i]
        heaviest = max(heaviest, terms.heft[a, INERTIA] / terms.heft[a, METRIC])
    least, fastest = math.inf, 0.0
    if limited > 0 or greatest_load(terms, n, free)[0] > 0.0:
        fastest = _demanded_pace(h, terms, contacts, limited, n, free, speed)
        least = _load_rate(terms, n, free, fastest)
    for i in range(n):
        rate = _damping_rate(h, heaviest, terms, free[i])
        if rate > 0.0:
            least = min(least, rate)
    if rung[0].compliant:
        d = terms.contact_stiffness.shape[1]
        for r in range(contacts * d):
            k, j = r // d, r % d
            resist = h * terms.contact_stiffness[k, j, j] + terms.contact_damping[k, j, j]
            rate = resist * _mobility_of_contact(r, d, terms, n, free) / heaviest
            if rate > 0.0:
                least = min(least, rate)
    for r in range(limited):
        mobility = _mobility(terms.limited, r, terms, n, free) / heaviest
        rate = (h * terms.gains[r, 0] + terms.gains[r, 1]) * mobility
        if rate > 0.0:
            least = min(least, rate)
        pace = fastest * _reach(terms.limited, r, terms, n, free)
        if terms.limit[r] > 0.0 and pace > 0.0:
            least = min(least, terms.limit[r] * mobility / pace)
    eps = LIMIT * least * h
    if not rung[0].compliant and least < math.inf:
        eps = max(eps, min(_unmoved(h, terms, n, free), HIDDEN * least * h))
    return min(1.0, eps)


@kernel
def _unmoved(h: float, terms: Terms, n: int, free: Ints) -> float:
    """The least eps with which the rounding of forces as great as the greatest load moves no body by more
    than `HOVERS` roundings of positions in the step."""
    lightest = math.inf
    for i in range(n):
        lightest = min(lightest, terms.heft[free[i], INERTIA] / terms.heft[free[i], METRIC])
    noise = ROUNDED * greatest_load(terms, n, free)[0]
    return noise * h * h / (lightest * HOVERS * float(terms.rounding[0]))


@kernel
def _load_rate(terms: Terms, n: int, free: Ints, pace: float) -> float:
    """The least load over the momentum of a coordinate at this pace; inf without loads or pace."""
    force, acceleration = greatest_load(terms, n, free)
    least = math.inf
    if force > 0.0 and pace > 0.0:
        for i in range(n):
            a = free[i]
            momentum = terms.heft[a, INERTIA] * pace / math.sqrt(terms.heft[a, METRIC])
            least = min(least, noticed_load(terms, a, force, acceleration, _SMALL) / momentum)
    return least


@kernel
def _damping_rate(h: float, heaviest: float, terms: Terms, a: int) -> float:
    """Rate at which a coordinate's own springs and dampers stop the heaviest body."""
    stretches = terms.entries.matrices
    held = h * diagonal(terms.stiffness, stretches, a) + diagonal(terms.damping, stretches, a)
    rate: float = held / (heaviest * terms.heft[a, METRIC])
    return rate


@rare_kernel
def _demanded_pace(
    h: float, terms: Terms, contacts: int, limited: int, n: int, free: Ints, speed: Reals
) -> float:
    """Fastest motion, as a length per time, by which a free body alone would meet the demand of one row."""
    fastest, d = 0.0, terms.contact_stiffness.shape[1]
    for r in range(contacts * d):
        demanded = abs(rate(terms.entries, terms.rows, r, d, speed))
        if r % d == 0:
            demanded = max(demanded, abs(terms.gap[r // d]) / h)
        if demanded > 0.0:
            fastest = max(fastest, demanded * _answer_of_contact(r, d, terms, n, free))
    for r in range(limited):
        demanded = abs(carried(terms.limited, r, speed))
        if math.isinf(terms.gains[r, 0]):
            demanded = max(demanded, abs(terms.error[r, 0]) / h)
        fastest = max(fastest, demanded * _answer(terms.limited, r, terms, n, free))
    return fastest


@kernel
def _mobility(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """W M^-1 W^T of a row for bodies of mass 1, by the diagonal of M: the change of its rate by its own
    force."""
    total = 0.0
    for i in range(n):
        a = free[i]
        total += rows[r, a] * rows[r, a] / terms.heft[a, METRIC]
    return total


@kernel
def _mobility_of_contact(r: int, d: int, terms: Terms, n: int, free: Ints) -> float:
    """As `_mobility`, of a row of a contact, by its entries where there are few."""
    if not is_crowded(terms.entries):
        return _mobility(terms.rows, r, terms, n, free)
    total = 0.0
    for side in range(2):
        first, end, shift = span(terms.entries.rows, r // d, side, len(terms.load))
        for a in range(first, end):
            own = terms.rows[r, a - shift]
            total += own * own / terms.heft[a, METRIC] if is_free(terms.entries, a) else 0.0
    return total


@kernel
def _answer_of_contact(r: int, d: int, terms: Terms, n: int, free: Ints) -> float:
    """As `_answer`, of a row of a contact, by its entries where there are few."""
    if not is_crowded(terms.entries):
        return _answer(terms.rows, r, terms, n, free)
    greatest, mobility = 0.0, _mobility_of_contact(r, d, terms, n, free)
    for side in range(2):
        first, end, shift = span(terms.entries.rows, r // d, side, len(terms.load))
        for a in range(first, end):
            if is_free(terms.entries, a):
                greatest = max(greatest, abs(terms.rows[r, a - shift]) / math.sqrt(terms.heft[a, METRIC]))
    return greatest / mobility if mobility > 0.0 else 0.0


@kernel
def _reach(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """Greatest rate of a row per speed of the bodies; an angle moves by its radius of gyration."""
    total = 0.0
    for i in range(n):
        a = free[i]
        total += abs(rows[r, a]) / math.sqrt(terms.heft[a, METRIC])
    return total


@kernel
def _answer(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """Greatest speed of a body per rate of a row, in the slowest motion that has this rate."""
    greatest, mobility = 0.0, _mobility(rows, r, terms, n, free)
    for i in range(n):
        a = free[i]
        greatest = max(greatest, abs(rows[r, a]) / math.sqrt(terms.heft[a, METRIC]))
    return greatest / mobility if mobility > 0.0 else 0.0


@kernel
def greatest_load(terms: Terms, n: int, free: Ints) -> tuple[float, float]:
    """The greatest load as a force, and as an acceleration; an angle counts by its radius of gyration."""
    force, acceleration = 0.0, 0.0
    for i in range(n):
        a = free[i]
        own = abs(terms.load[a]) / math.sqrt(terms.heft[a, METRIC])
        force = max(force, own)
        acceleration = max(acceleration, own * terms.heft[a, METRIC] / terms.heft[a, INERTIA])
    return force, acceleration


@kernel
def noticed_load(terms: Terms, a: int, force: float, acceleration: float, least: float) -> float:
    """Load beside which the remaining inertia of coordinate a must be small.

    This is the coordinate's own load, but no less than a part `least` of the greatest; where the coordinate
    has no load, but for rounding, it is the greatest, as a force or as an acceleration, whichever is less
    here.
    """
    unit = math.sqrt(terms.heft[a, METRIC])
    greatest = unit * min(force, terms.heft[a, INERTIA] / terms.heft[a, METRIC] * acceleration)
    own = abs(terms.load[a])
    return max(own, least * greatest) if own > _NOTHING * greatest else greatest
