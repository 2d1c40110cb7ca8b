"""Pushes cut short where least of their aim is lacking on their way.

What slides on a support without momentum stays where a push leaves it, so the states on the way of a push are
the ends of shorter ones: one run tells what all of them do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.motion.moves import Moves, Segments
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import Ends, Places, Predictor

PARTS = 8
"""Parts of a push at whose ends its objects are looked at."""


class Stops(NamedTuple):
    """Shorter pushes of some runs (r,), vectors (r, d), and where they end."""

    rows: Ints
    vectors: Reals
    places: Places

    def take(self, rows: Ints) -> Stops:
        return Stops(self.rows[rows], self.vectors[rows], self.places.take(rows))


def parts_of(moves: Moves, predictor: Predictor) -> int:
    """Into how many parts pushes are cut on a stage: one where objects would go on by themselves."""
    task, model = moves.task, predictor.stage.model
    stays = task.slides and (model.inertia == 0.0 or model.metric or task.is_slow)
    return PARTS if stays and task.carriers and not task.by_place else 1


def stops_of(moves: Moves, vectors: Reals, segments: Segments, ends: Ends, parts: int) -> Stops:
    """All stops on the way of pushes that were run in parts, with the objects at rest there."""
    first, found = segments.durations.shape[1] - 1 - parts, list[Stops]()
    for part in range(1, parts):
        shorter, fits = moves.cut(vectors, part / parts)
        rows = np.flatnonzero(fits & (ends.switches >= first + part))
        found.append(Stops(rows, shorter[rows], ends.at(first + part - 1, rows)))
    rows, cut = (np.concatenate([getattr(each, name) for each in found]) for name in ("rows", "vectors"))
    places = Places(*(np.concatenate(field) for field in zip(*(each.places for each in found), strict=True)))
    return Stops(rows, cut, places._replace(v=np.zeros_like(places.v)))


def best_stops(aim: Aim, stops: Stops, lacks: Reals) -> tuple[Stops, Reals]:
    """The best stop of each run of which one lacks less than its end, `lacks` (m,); what they lack (r,)."""
    own = aim.lack(stops.places)
    order = np.argsort(own, kind="stable")
    first = order[np.unique(stops.rows[order], return_index=True)[1]]
    better = first[own[first] < lacks[stops.rows[first]]]
    return stops.take(better), own[better]
