"""Problems that keep their entries alone, as those of many bodies do (see `contact.step.spans`)."""

from __future__ import annotations

from rungwise.contact.step import ContactProblem, Widths, allocate_problem, span, stretch
from rungwise.kernel import Ints


def kept(p: ContactProblem, spans: Ints, stretches: Ints) -> ContactProblem:
    """A dense problem of which what W has in these spans, and H in these stretches, is kept."""
    n, d = len(p.c), p.R.shape[1]
    rows = (spans[:, 1] - spans[:, 0] + spans[:, 3] - spans[:, 2]).max(initial=0)
    widths = Widths(int(rows), int((stretches[:, 1] - stretches[:, 0]).max(initial=0)))
    made = allocate_problem(n, len(p.mu), len(p.F), d, widths)
    for name in ("c", "R", "w", "mu", "S", "R_s", "w_s", "F", "quantum"):
        getattr(made, name)[...] = getattr(p, name)
    for k in range(len(spans)):
        own = slice(k * d, k * d + d)
        for side in range(2):
            first, end, shift = span(spans, k, side, n)
            made.W[own, first - shift : end - shift] = p.W[own, first:end]
    for i in range(n):
        first, end = stretch(stretches, i, n)
        made.H[i, : end - first] = p.H[i, first:end]
    return made
