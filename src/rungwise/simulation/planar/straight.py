"""Whether straight ways between places of a planar scene are free, in one call."""

from __future__ import annotations

import math

import numpy as np

from rungwise.kernel import Ints, Reals, kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.nearby import look
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.place import place

DEEPEST = 64
"""Halvings of a way for which there is room: more than rounding leaves."""


def way_is_clear(
    records: Records, workspace: Workspace, ends: tuple[Reals, Reals], length: float, least: float,
    enough: float, pairs: Ints,
) -> bool:  # fmt: skip
    """See `world.carriers.Surroundings.is_clear`; `enough` is the least gap but for rounding."""
    parts = np.empty((DEEPEST, 4))
    a, b = (np.ascontiguousarray(end) for end in ends)
    return bool(_stays(records, workspace, a, b, length, least, enough, pairs, parts))


@kernel
def _stays(
    records: Records, workspace: Workspace, a: Reals, b: Reals, length: float, least: float, enough: float,
    pairs: Ints, parts: Reals,
) -> bool:  # fmt: skip
    """Parts of the way that are not decided are in the rows of `parts`: where they begin and end, and the
    gaps there."""
    first = gap_at(records, workspace, a, b, 0.0, pairs)
    last = gap_at(records, workspace, a, b, 1.0, pairs)
    if not (first >= enough and last >= enough):
        return False
    parts[0, 0], parts[0, 1], parts[0, 2], parts[0, 3] = 0.0, 1.0, first, last
    count = 1
    while count > 0:
        count -= 1
        part = parts[count]
        begins, ends, one, other = part[0], part[1], part[2], part[3]
        long = length * (ends - begins)
        if one + other - long >= 2.0 * least or long <= least:
            continue
        middle = 0.5 * (begins + ends)
        between = gap_at(records, workspace, a, b, middle, pairs)
        if not between >= enough or count + 2 > parts.shape[0]:
            return False
        part[0], part[1], part[2], part[3] = begins, middle, one, between
        part = parts[count + 1]
        part[0], part[1], part[2], part[3] = middle, ends, between, other
        count += 2
    return True


@kernel
def gap_at(records: Records, workspace: Workspace, a: Reals, b: Reals, part: float, pairs: Ints) -> float:
    """The least gap of these pairs (c,) at a part of the straight way from a to b (n,)."""
    state, clock = workspace.state, workspace.state.clock[0]
    for i in range(a.shape[0]):
        state.q[i] = a[i] + part * (b[i] - a[i])
    features = state.manifolds.features
    for slot in range(features.shape[0]):
        features[slot] = ABSENT
    clock.margin, clock.tried, clock.next, clock.near = math.inf, 0.0, 0.0, 0.0
    place(records, state.q, state.placed, False)
    look(records, workspace, state.v)
    least = math.inf
    for k in range(pairs.shape[0]):
        least = min(least, state.manifolds.gaps[pairs[k]])
    return least
