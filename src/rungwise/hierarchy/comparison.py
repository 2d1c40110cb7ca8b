"""A comparison: the paper's Table 1 with numbers, as values and as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path as File
from textwrap import wrap
from typing import Any

import numpy as np

from rungwise.content import ByContent
from rungwise.hierarchy.counterexample import Counterexample
from rungwise.hierarchy.inputs import Inputs
from rungwise.hierarchy.limits import INDEPENDENT, SAME, STAYS, TENDS, Fit
from rungwise.hierarchy.nearest import Nearest
from rungwise.hierarchy.pairs import Pair
from rungwise.hierarchy.stages import Cost
from rungwise.kernel import Reals
from rungwise.plain import cut, json_text
from rungwise.scene.contract import AnyScene

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"


WIDE = 110
"""Columns of the text."""
BOUNDS = (
    "Def. 1: the largest, over the inputs that were run, of the smallest distance found. The true value"
    " may be larger, because other inputs may be worse, and smaller, because the richer model may come nearer"
    " under inputs that were not tried. Orders are measured in the second half of the runs, after the"
    " boundary layer, until just before the first of the two runs ends."
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
    if found.costs or not found.unfinished:
        yield from _stages(found)
    if found.unfinished:
        yield from wrap(found.unfinished, WIDE, subsequent_indent="  ", break_on_hyphens=False)
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


@dataclass(frozen=True, eq=False)
class Measured(ByContent):
    """A pair of models: how near the richer one comes to the simpler (see `Nearest`), and the fits along the
    paths from one to the other."""

    pair: Pair
    nearest: Nearest
    fits: tuple[Fit, ...]
    accuracy: float

    @property
    def first(self) -> str:
        """Definition 1, within the accuracy."""
        if not self.nearest.told:
            return UNDECIDED
        return HOLDS if self.nearest.value <= self.accuracy else FAILS

    @property
    def second(self) -> str:
        """Definition 2, along one of the paths."""
        found = {fit.verdict for fit in self.fits}
        if TENDS in found:
            return HOLDS
        if found & {STAYS, INDEPENDENT}:
            return FAILS
        return SAME if found == {SAME} else UNDECIDED

    @property
    def verdict(self) -> str:
        """Whether what the paper's table says of the pair holds; of pairs that it does not have, Definition
        2."""
        return self.first if self.pair.definition == 1 else self.second

    def summary(self) -> dict[str, Any]:
        near = self.nearest
        return {
            "from": self.pair.richer.name, "to": self.pair.simpler.name,
            "paper": f"Def. {self.pair.definition}" if self.pair.definition else None,
            "distances": near.same.tolist(),
            "definition_1": {"value": near.value, "least": near.least.tolist(), "verdict": self.first},
            "definition_2": {
                "verdict": self.second,
                "paths": [
                    {
                        "path": fit.path.words, "parameter": fit.path.name, "values": list(fit.values),
                        "distances": list(fit.distances), "floors": list(fit.floors), "order": fit.order,
                        "standard_error": fit.error, "verdict": fit.verdict, "why": fit.why,
                        "until": fit.until, "sample": fit.sample, "equal_steps": fit.known.step is not None,
                    }
                    for fit in self.fits
                ],
            },
            "verdict": self.verdict,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Comparison(ByContent):
    """The hierarchy between the models, measured on a scene.

    Distances are parts of the `extent`: the greatest difference of a coordinate of an object along the run,
    angles times the longest lever; in space, of its centre and of the tips of its axes. `inputs` and
    `samples` (m, k): names and values of the inputs, the scene's own first; `until` (m,): time at which the
    last of the runs had ended, nan if a limit ended the first runs; `notes`: matched parameters; `ends`:
    how the runs of each rung ended (m,); `errors` of its motions (m,), infinite if unknown; `pairs`; `costs`
    of all stages, and `cheapest`, the stage of fewest solves within `accuracy` of the richest;
    `counterexamples`: pairs of runs that contradict a definition; `parameters` of the scene, by name;
    `unfinished`: the work that a limit in seconds left undone, in words.
    """

    scene: AnyScene
    parameters: dict[str, float]
    accuracy: float
    extent: float
    inputs: Inputs
    samples: Reals
    until: Reals
    notes: tuple[str, ...]
    ends: dict[str, list[str]]
    errors: dict[str, Reals]
    pairs: tuple[Measured, ...]
    costs: tuple[Cost, ...]
    cheapest: Cost | None
    counterexamples: tuple[Counterexample, ...]
    unfinished: str = ""

    @property
    def ok(self) -> bool:
        """Whether all pairs of the scene agree with the paper's table, and nothing was left undone."""
        return not self.unfinished and all(
            each.verdict in (HOLDS, SAME) for each in self.pairs if each.pair.definition
        )

    def __repr__(self) -> str:
        told = ", ".join(
            f"{each.pair.richer.name} -> {each.pair.simpler.name} {each.verdict}" for each in self.pairs
        )
        return f"<Comparison of {cut(self.scene.name)}: {cut(told, 400)}>"

    def __str__(self) -> str:
        return "\n".join(table(self))

    def save(self, folder: str | File) -> list[File]:
        """Write the answer into a folder, and each counterexample into a file that `load_counterexample` and
        `rungwise compare` take; returns the files. Raises OSError."""
        target = File(folder)
        target.mkdir(parents=True, exist_ok=True)
        whole = target / "comparison.json"
        whole.write_text(json_text(self.summary(), indent=1) + "\n", "utf-8")
        parts = enumerate(self.counterexamples, 1)
        return [whole, *(each.save(target / f"counterexample-{k}.json") for k, each in parts)]

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise compare --json` prints them."""
        return {
            "scene": self.scene.name, "parameters": self.parameters, "accuracy": self.accuracy,
            "extent": self.extent, "matched": list(self.notes),
            "inputs": [self.inputs.named(row) for row in self.samples], "until": self.until.tolist(),
            "ends": self.ends, "errors": {name: each.tolist() for name, each in self.errors.items()},
            "pairs": [each.summary() for each in self.pairs],
            "stages": [_plain(each) for each in self.costs],
            "cheapest": None if self.cheapest is None else _plain(self.cheapest),
            "counterexamples": [each.summary() for each in self.counterexamples],
            "unfinished": self.unfinished, "ok": self.ok,
        }  # fmt: skip


def _plain(cost: Cost) -> dict[str, Any]:
    stage = cost.stage
    return {
        "model": stage.model.name, "tol": stage.tol, "distance": cost.distance, "steps": cost.steps,
        "solves": cost.solves,
    }  # fmt: skip
