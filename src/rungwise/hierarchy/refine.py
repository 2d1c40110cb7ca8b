"""Runs that are repeated at smaller errors per step, until their motions are known well enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.hierarchy.motions import Bench, Motions, apart
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

PARTS = (1e-1, 1e-2, 1e-3, 1e-4)
"""Errors allowed per step, as parts of the accuracy asked for: the next where motions are not settled."""
ENOUGH = 0.01
"""Error of settled motions, as a part of the accuracy."""
LONGER = 4.0
"""A run at a tenth of the error per step takes at most so many times as many steps; those that would exceed
the budget are not begun."""


class Settled(NamedTuple):
    """Motions (m,) at the smallest error per step, `tol` (m,), that was needed, or within the budget.

    error (m,): how far the run before, at ten times the error per step and with other moments, is from it;
    infinite where there is none.
    """

    motions: Motions
    error: Reals
    tol: Reals


def settle(bench: Bench, model: Rung, inputs: Reals, until: Reals, accuracy: float) -> Settled:
    """Runs of one model, whose errors are a small part of the accuracy where the budget allows it."""
    motions = bench.run(model, inputs, until, PARTS[0] * accuracy)
    error, tol = np.full(len(inputs), np.inf), np.full(len(inputs), PARTS[0] * accuracy)
    rows = np.flatnonzero(motions.known)
    for level, part in enumerate(PARTS[1:], 1):
        rows = rows[motions.steps[rows] * LONGER <= bench.budget]
        if not len(rows):
            break
        found = bench.run(model, inputs[rows], until[rows], part * accuracy, halved=level % 2 == 1)
        away, good = apart(found, motions.rows(rows)), found.known
        rows = rows[good]
        for whole, new in zip(motions, found, strict=True):
            whole[rows] = new[good]
        error[rows], tol[rows] = away[good], part * accuracy
        rows = rows[error[rows] > ENOUGH * accuracy]
    return Settled(motions, error, tol)
