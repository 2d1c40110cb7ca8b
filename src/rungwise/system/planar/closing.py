"""The nearest places and velocities at which joints hold, for states that were measured and not run."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals, kernel
from rungwise.scene.template.records import ANGLE, Records
from rungwise.system.planar.joints import measure
from rungwise.system.planar.place import Placement, place

ROUNDS = 20
"""Newton's steps at most: from anywhere that is measured a few are enough."""
CLOSED = 1e-12
"""Opening, as a part of the reach of what is joined, that is left: below it a run begins."""
RANK = 1e-9
"""Part of the first singular value below which joints say the same."""


@kernel
def open_joints(records: Records, placed: Placement, q: Reals, rows: Reals, out: Reals) -> None:
    """Every measure of the joints at q (n,), as a length, into `out` (measures,); rates per unit of each
    speed into `rows` (measures, n)."""
    place(records, q, placed, False)
    for m in range(records.measures.shape[0]):
        out[m] = measure(records.measures[m], records, placed.pose, q, rows[m])


def close_joints(
    records: Records, placed: Placement, q: Reals, v: Reals, freedom: Reals, reach: float
) -> tuple[Reals, Reals]:  # fmt: skip
    """Places (m, n) at which joints are closed and within their travel, and velocities (m, n) that keep them
    so. What has more `freedom` (2 n,), as deviations of places and of velocities, is changed more."""
    measures, (m, n) = records.measures, q.shape
    held, places, rates = measures["held"].astype(bool), q.copy(), v.copy()
    turn = measures["which"] == ANGLE
    unit = np.where(turn, records.joints["lever"][measures["joint"]], 1.0)
    low, high = (np.where(held, 0.0, unit * measures[name]) for name in ("lower", "upper"))
    rows, out = np.zeros((len(measures), n)), np.zeros(len(measures))
    for i in range(m):
        for _ in range(ROUNDS):
            open_joints(records, placed, places[i], rows, out)
            lack = out - np.clip(out, low, high)
            if np.abs(lack).max() <= CLOSED * reach:
                break
            active = held | (lack != 0.0)
            places[i] -= _least(rows[active], freedom[:n], lack[active])
        rates[i] -= _least(rows[held], freedom[n:], rows[held] @ rates[i])
    return places, rates


def _least(rows: Reals, freedom: Reals, lack: Reals) -> Reals:
    """The least change (n,) over freedom that removes what rows (k, n) lack (k,)."""
    return np.asarray(freedom * (np.linalg.pinv(rows * freedom, rcond=RANK) @ lack))
