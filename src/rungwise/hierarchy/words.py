"""A comparison as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rungwise.hierarchy.compare import Comparison, Measured
    from rungwise.hierarchy.stages import Cost

WIDE = 110
"""Columns of the text."""
BOUNDS = (
    "Def. 1: the largest, over the inputs that were run, of the smallest distance found. Inputs that were not"
    " drawn may be worse (a bound from below), inputs that were not tried better (a bound from above). Orders"
    " are those of the second half, after the boundary layer, until just before the first of the two ends."
)
RUNG = 21
"""Columns of the longest name of a rung."""


def table(found: Comparison) -> Iterator[str]:
    """The paper's Table 1 with numbers, what was matched, orders along paths, and the cheapest stage."""
    m = len(found.samples)
    drawn = f", and {m - 1} drawn of {', '.join(found.inputs.names)}" if m > 1 else ""
    yield (
        f"{found.scene.name}: the scene's own inputs{drawn};"
        f" distances as parts of the extent {found.extent:.3g}"
    )
    for note in found.notes:
        yield from wrap(f"matched: {note}", WIDE, initial_indent="  ", subsequent_indent="    ")
    heads = " ".join(f"{head:>8}" for head in ("own", "median", "greatest", "Def. 1"))
    yield f"{'from':{RUNG}} {'to':{RUNG}} {'paper':6} {heads}  verdict"
    for each in found.pairs:
        yield from _pair(each)
    yield from wrap(BOUNDS, WIDE)
    yield from _runs(found)
    yield from _stages(found)
    for example in found.counterexamples:
        text = f"counterexample: {example.words}: {example.distance:.2e} apart"
        yield from wrap(text, WIDE, subsequent_indent="  ")


def _pair(each: Measured) -> Iterator[str]:
    pair, same = each.pair, each.nearest.same
    told = same[~np.isnan(same)]
    middle, greatest = (np.median(told), told.max()) if len(told) else (np.nan, np.nan)
    numbers = (same[0], middle, greatest, each.nearest.value)
    paper = f"Def. {pair.definition}" if pair.definition else "-"
    yield (
        f"{pair.richer.name:{RUNG}} {pair.simpler.name:{RUNG}} {paper:6} "
        + " ".join(f"{x:8.1e}" if x == x else f"{'-':>8}" for x in numbers)
        + f"  {each.verdict}"
    )
    if len(told) < len(same):
        lost = f"{len(same) - len(told)} of {len(same)} inputs are left out"
        yield f"    {lost}: a run did not converge or took too many steps"
    for fit in each.fits:
        yield from wrap(str(fit), WIDE, initial_indent="    ", subsequent_indent="      ")


def _runs(found: Comparison) -> Iterator[str]:
    """How the rungs' runs ended, and how exact they are."""
    for name, ends in found.ends.items():
        counts = Counter(ends)
        told = ", ".join(f"{count} {end}" for end, count in counts.most_common())
        errors = found.errors[name]
        known = errors[np.isfinite(errors)]
        error = f"{known.max():.0e}" if len(known) else "unknown"
        yield from wrap(f"{name}: {told}; error up to {error}", WIDE, subsequent_indent="  ")


def _stages(found: Comparison) -> Iterator[str]:
    richest = [cost for cost in found.costs if cost.stage.model.name == "dynamic-compliant"]
    if not found.costs:
        yield "no stage is judged: no run on the richest rung converged"
    elif found.cheapest is None:
        yield f"no stage is within {found.accuracy:g} of the richest rung"
    else:
        yield f"cheapest stage within {found.accuracy:g} of the richest rung: {_cost(found.cheapest)}"
    enough = [cost for cost in richest if cost.distance <= found.accuracy]
    if enough and enough[0] is not found.cheapest:
        least = min(enough, key=lambda cost: cost.solves)
        yield f"  on the richest rung itself: {_cost(least)}"


def _cost(cost: Cost) -> str:
    return f"{cost.stage} ({cost.steps} steps, {cost.solves} solves; {cost.distance:.1e} away)"
