"""What plans are after: the goal, or parts of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rungwise.kernel import Reals
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.propagate import Places

Lack = Callable[[Places], Reals]
"""How far from their aim plans end (m,)."""


@dataclass(frozen=True)
class Aim:
    """What plans are after: the goal, with `lack` how far from it they end, by pushes at these `bodies`, at
    all where none is named. A `partial` aim, parts of the goal, is reached at the ends of moves where nothing
    is lacking: what comes after must not lose it."""

    lack: Lack
    bodies: tuple[str, ...] = ()
    partial: bool = False

    def turned(self, moves: Moves, vectors: Reals) -> Reals:
        """The vectors (..., d), with pushes at the bodies of the aim."""
        return moves.aimed(vectors, self.bodies) if self.bodies else vectors
