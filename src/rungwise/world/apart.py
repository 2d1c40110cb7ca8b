"""Places that are allowed, next to such as were measured: bodies that overlap are moved apart, and contacts
that are known to be closed are closed.

The motion is the least that does so, nearly: Newton's method on the gaps, with steps of least norm in which a
turn counts as the way of the contact that it moves most.
"""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.world.carriers import Surroundings

OPENED, BEYOND = 12, 1.01
"""Steps in which bodies that overlap are moved apart, and how many times as far as it takes."""
SLIGHT = 1e-3
"""Gap, in parts of that within which contacts are closed, from which on a contact counts as open."""
BESIDE = 2.0
"""Gaps over the deepest overlap of contacts that steps do not close any more."""


def apart(
    around: Surroundings,
    q: Reals,
    within: float = 0.0,
    pairs: Ints | None = None,
    weights: Reals | None = None,
) -> Reals:
    """The place (n_q,) nearest to q (n_q,), nearly, at which no bodies overlap. Contacts of the given pairs
    that are nearer than `within` are closed besides. weights (n_v,): how dear a change of each velocity's
    coordinate is, 1 if none are given. Joints are not looked at."""
    found = q.copy()
    closed = np.zeros(0, np.int64) if pairs is None else pairs
    for _ in range(OPENED if len(closed) else 0):
        touches = around.touches(found, within)
        gaps = touches.gaps
        moved = (gaps < 0.0) | (np.isin(touches.pairs, closed) & (gaps > SLIGHT * within))
        if not moved.any():
            break
        rows, wanted = touches.rows[moved, 0], -gaps[moved]
        found = _moved(around, found, rows, wanted, weights)
    for _ in range(OPENED):
        deepest = -float(around.touches(found, 0.0).gaps.min(initial=0.0))
        if deepest <= 0.0:
            break
        touches = around.touches(found, BESIDE * deepest)
        wanted = np.maximum(-BEYOND * touches.gaps, 0.0)
        found = _moved(around, found, touches.rows[:, 0], wanted, weights)
    return found


def _moved(around: Surroundings, q: Reals, rows: Reals, wanted: Reals, weights: Reals | None) -> Reals:
    """The place (n_q,) after the least change that changes gaps with these rows (k, n_v) as wanted (k,)."""
    units = np.maximum(np.abs(rows).max(axis=0), 1.0)
    if weights is not None:
        units = units * weights
    step = np.linalg.lstsq(rows / units, wanted, rcond=None)[0]
    return around.changed(q, step / units)
