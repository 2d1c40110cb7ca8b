"""Local regression: velocities of measured places, and how far these scatter.

About each frame a parabola is fitted to the frames about it (Savitzky and Golay 1964). Where the frames
before or after it scatter far less about one of their own, that counts: an impact bends the window across it,
and none that ends at it (the choice of stencils of Harten and others 1987).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals

WINDOW = 7
"""Frames of a window: enough to average noise, few enough that motion between impacts is a parabola."""
DEGREE = 2
"""Of the polynomials: free fall is one of degree two."""
BENT = 0.4
"""A window is bent where another one scatters less than this part: by noise alone one in twenty does."""
_Regressions = dict[bytes, tuple[Reals, Reals]]


class Smooth(NamedTuple):
    """Of columns (k, n) at r frames: values and rates (r, n), nan where too few frames are near; scatter
    (r, n): root of the mean square of what is left of the window about each, per degree of freedom; gain
    (r, n): deviation of a rate over that of a frame. At the end of a window it is 3.6 times as great as in
    its middle: so it is where a trial begins, and beside impacts; own (r, n): scatter of that window, which
    is great where none is free of an impact."""

    values: Reals
    rates: Reals
    scatter: Reals
    gain: Reals
    own: Reals


def smooth(times: Reals, columns: Reals, rows: Ints) -> Smooth:
    """Local regression of columns (k, n) at times (k,), at some of the frames (r,); nan are gaps, over which
    windows reach."""
    found = Smooth(*(np.full((len(rows), columns.shape[1]), np.nan) for _ in range(5)))
    known = np.isfinite(columns)
    for mask in np.unique(known, axis=1).T:
        own = np.flatnonzero((known == mask[:, None]).all(axis=0))
        at = np.flatnonzero(mask[rows])
        if mask.sum() > DEGREE and len(at):
            part = _whole(times[mask], columns[np.ix_(mask, own)], np.cumsum(mask)[rows[at]] - 1)
            for whole, each in zip(found, part, strict=True):
                whole[np.ix_(at, own)] = each
    return found


def _whole(times: Reals, columns: Reals, rows: Ints) -> Smooth:
    """The same of columns without gaps."""
    k, n = columns.shape
    window, known = min(WINDOW, k), _Regressions()
    found = Smooth(*(np.full((len(rows), n), np.nan) for _ in range(5)))
    for row, at in enumerate(rows.tolist()):
        middle = _within(at - window // 2, window, k)
        others = {_within(at - window + 1, window, k), _within(at, window, k)} - {middle}
        best = np.full(n, np.inf)
        for first in (middle, *sorted(others)):
            span = slice(first, first + window)
            apart = times[span] - times[at]
            unit = float(np.abs(apart).max())
            powers, inverse = _regression(apart / unit, known)
            polynomial = inverse @ columns[span]
            left = columns[span] - powers @ polynomial
            scatter = np.sqrt((left**2).sum(axis=0) / max(window - powers.shape[1], 1))
            better = scatter < best
            best[better] = BENT * scatter[better] if first == middle else scatter[better]
            found.values[row, better] = polynomial[0, better]
            found.rates[row, better] = polynomial[1, better] / unit
            found.own[row, better] = scatter[better]
            found.gain[row, better] = float(np.linalg.norm(inverse[1])) / unit
            if first == middle:
                found.scatter[row] = scatter
    return found


def deviation(scatter: Reals, window: int) -> Reals:
    """The deviation (n,) of one frame from the scatter (r, n) of windows, by its median: impacts bend few."""
    from scipy.stats import chi

    known = np.isfinite(scatter).any(axis=0)
    found = np.zeros(scatter.shape[1])
    if not known.any():
        return found
    free = max(min(WINDOW, window) - DEGREE - 1, 1)
    found[known] = np.nanmedian(scatter[:, known], axis=0) * np.sqrt(free) / chi.median(free)
    return found


def _regression(apart: Reals, known: _Regressions) -> tuple[Reals, Reals]:
    """Powers (w, d) of the times of a window, and their pseudo-inverse."""
    key = apart.round(6).tobytes()
    if key not in known:
        powers = apart[:, None] ** np.arange(min(DEGREE, len(apart) - 1) + 1)
        known[key] = powers, np.asarray(np.linalg.pinv(powers), np.float64)
    return known[key]


def _within(first: int, window: int, k: int) -> int:
    """The first frame of a window that lies within k frames."""
    return min(max(first, 0), k - window)
