"""Places by which motions are compared: coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from rungwise.kernel import Reals


@dataclass(frozen=True)
class Coordinates:
    """The coordinates of a scene, each a place on a line."""

    names: tuple[str, ...]

    def __call__(self, q: Reals) -> Reals:
        """Places (..., n, 1) of states q (..., n)."""
        return q[..., None]
