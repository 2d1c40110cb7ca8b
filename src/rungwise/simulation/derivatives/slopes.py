"""Where one long step leads, differentiated by the scene's inputs, as planners of local motions want it.

A step of the quasistatic-compliant rung, as long as a move, is linearised where it begins. Contacts that are
not closed have no part in a derivative, so bodies reach farther by a length `near`: what is nearer counts as
closed, with the force by which compliant contacts and drives resist so much overlap. This smooths the
derivative over the contacts that a move would close (analytic smoothing: Pang, Suh, Yang and Tedrake, 2023,
arXiv 2206.10787, where forces act at a distance that fades out).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rungwise.contact.analysis import DATA
from rungwise.kernel import Ints, Reals
from rungwise.simulation.derivatives.steps import Array, Data, Start, Steps
from rungwise.simulation.options import ModelError

_PART = 1e-4
"""Part of its span by which an input is changed, and of a motion by which turns are differenced: data are
almost linear in inputs, and rounding stays far below what proposals need."""


class Slopes:
    """Derivatives of the ends of steps `here` by inputs, with bodies that reach farther by `near`."""

    def __init__(self, here: Steps, near: float) -> None:
        self._here, self._near = here, near

    def __call__(self, q: Reals, time: float, levels: Reals, columns: Ints, spans: Reals) -> Array:
        """The changes (n_q, f) of where bodies come from q (n_q,), at rest, with inputs `levels` (u,), as
        each of the inputs in `columns` (f,) changes by its span (f,).

        Raises ModelError where there is no derivative.
        """
        here = self._here
        start = replace(here.begun, q=q, v=np.zeros(len(here.lever)), time=time)
        here.tell(levels)
        contact, _ = here.solved_near(start, self._near)
        each = [self._change(start, levels, int(k), float(s)) for k, s in zip(columns, spans, strict=True)]
        change = {name: np.stack([one[name] for one in each], axis=-1) for name in each[0]}
        turn = change.pop("speed")
        if any(change[name].shape[:-1] != getattr(contact.problem, name).shape for name in DATA):
            raise ModelError("step: other contacts are near with other inputs")
        try:
            turn[here.free] = contact.solved(contact.right_hand_side(change)).v
        except ValueError as error:  # a friction or limit of zero that changes
            raise ModelError(f"step: {error}") from None
        if not np.isfinite(turn).all():
            raise ModelError("step: nothing determines its derivative")
        ends = [
            [here.moved(start, "q", side * _PART * here.h * by).q for by in turn.T] for side in (-1.0, 1.0)
        ]
        return np.asarray((np.array(ends[1]) - np.array(ends[0])).T / (2.0 * _PART))

    def _change(self, start: Start, levels: Reals, column: int, span: float) -> Data:
        """The change of the data as an input changes by its span. Raises ModelError."""
        one = np.zeros(len(levels))
        one[column] = _PART * span
        sides = []
        for told in (levels - one, levels + one):
            self._here.tell(told)
            sides.append(self._here.data_near(start, self._near))
        low, high = sides
        if any(low[name].shape != high[name].shape for name in low):
            raise ModelError("step: other contacts are near with other inputs")
        return {name: _difference(low[name], high[name]) / (2.0 * _PART) for name in low}


def _difference(low: Array, high: Array) -> Array:
    """The difference of arrays that may hold the same infinite entries."""
    return np.subtract(high, low, out=np.zeros(low.shape), where=high != low)
