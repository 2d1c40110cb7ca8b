"""How far places of two motions are apart."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals


def farthest(difference: Reals) -> Reals:
    """The greatest length (m,) of differences of places (m, s, p, d)."""
    return np.asarray(np.linalg.norm(difference, axis=-1).max(axis=(1, 2)))
