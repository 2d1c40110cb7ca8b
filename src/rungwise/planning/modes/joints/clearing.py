"""Arms that touch an object clear of all else: by the joints that the touch leaves free."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.joints.chains import Chain
from rungwise.planning.modes.joints.inverse_kinematics import EXACT, Reach, laid, reached, stepped
from rungwise.world.carriers import Surroundings

ROUNDS, OPENS, WIDER, SLOWLY = 3, 6, 3.0, 0.5
"""How often an arm that touches a point is led clear of all that is in its way then, in how many steps, and
how far, over what it keeps; and to which part overlaps shrink in these, or no more follow."""
KEPT, FIRST = 200, 2
"""Places of an arm that are remembered, and how many of the nearest a new one is sought from first."""


@dataclass
class Earlier:
    """Where an arm touched an object before: points (m, 3) and normals (m, 3), and its joints (k,) there."""

    size: float
    marks: list[Reals] = field(default_factory=list)
    joints: list[Reals] = field(default_factory=list)

    def nearest(self, point: Reals, normal: Reals) -> list[Reals]:
        """Joints (k,) at the nearest of these."""
        if not self.marks:
            return []
        away = np.linalg.norm(np.array(self.marks) - self._mark(point, normal), axis=1)
        return [self.joints[k] for k in np.argsort(away, kind="stable")[:FIRST]]

    def note(self, point: Reals, normal: Reals, joints: Reals) -> None:
        """Remember a place, in place of the oldest."""
        self.marks[:] = [*self.marks[-KEPT:], self._mark(point, normal)]
        self.joints[:] = [*self.joints[-KEPT:], joints]

    def _mark(self, point: Reals, normal: Reals) -> Reals:
        return np.concatenate([point, self.size * normal])


def first_free(
    around: Surroundings, posed: Iterable[Reals], wanted: Reach, avoided: Ints, kept: Reals,
    arm: Chain | None = None,
) -> Reals | None:  # fmt: skip
    """Of places (n,) with an arm that touches an object as wanted, the first at which the scene's contacts
    that are avoided (a,) keep these gaps (a,), else the first; None where there is none."""
    first, pairs = None, np.array([wanted.pair, *avoided], np.int64)
    within = max(float(kept.max(initial=0.0)), wanted.exact)
    for found in posed:
        least = around.least(found, pairs, within)
        if not abs(least[0]) < wanted.exact:
            continue
        if not (least[1:] >= kept).all() and arm is not None:
            found = cleared(around, arm, found, wanted, avoided, kept)
            least = around.least(found, pairs, within)
            if not abs(least[0]) < wanted.exact:
                continue
        if (least[1:] >= kept).all():
            return found
        first = found if first is None else first
    return first


def cleared(
    around: Surroundings, arm: Chain, q: Reals, wanted: Reach, avoided: Ints, kept: Reals
) -> Reals:  # fmt: skip
    """The place (n,) with an arm that touches a point, led by those of its joints that this leaves free until
    contacts that are avoided (a,) keep these gaps (a,), as far as it comes."""
    most = float(kept.max(initial=0.0))
    near, lacks = np.zeros(0, np.int64), kept - around.least(q, avoided, most)
    for _ in range(ROUNDS):
        near, before = np.union1d(near, np.flatnonzero(lacks > 0.0)), lacks.max(initial=0.0)
        for _ in range(OPENS):
            touch, others = around.near(q, wanted.pair), [around.near(q, int(avoided[k])) for k in near]
            off = np.array([touch.gap, *touch.across @ (touch.point - wanted.point)])
            wider = WIDER * kept[near] - np.array([each.gap for each in others])
            opens = wider > 0.0
            if not opens.any() and np.abs(off).max() < EXACT * wanted.exact:
                break
            own = touch.rows.copy()
            own[1:] *= wanted.sign
            rows = np.vstack([own, *(other.rows[:1] for other in others)])[[True] * 3 + opens.tolist()]
            slope = rows[:, arm.columns] @ arm.rates(q)
            q = stepped(arm, q, slope, np.concatenate([-off, wider[opens]]), wanted.size, None)
        lacks = kept - around.least(q, avoided, most)
        if not 0.0 < lacks.max(initial=0.0) < SLOWLY * before:
            break
    return q


def touching(
    around: Surroundings, arm: Chain, q: Reals, wanted: Reach, avoided: Ints, kept: Reals,
    earlier: Earlier | None, flat: bool,
) -> Reals | None:  # fmt: skip
    """The place (n,) with an arm that touches an object as wanted, with a flat side or a point of its last
    body; see `first_free`. Arms with joints to spare begin where they touched `earlier`."""
    if flat:
        return first_free(around, laid(around, arm, q, wanted), wanted, avoided, kept)
    begun = earlier.nearest(wanted.point, wanted.normal) if earlier else ()
    posed = reached(around, arm, q, wanted, begun)
    place = first_free(around, posed, wanted, avoided, kept, arm if earlier else None)
    if place is not None and earlier:
        earlier.note(wanted.point, wanted.normal, arm.joints(place))
    return place
