"""The paper's Table 1, measured on every scene that ships, and the cheapest stage that is enough for each.

    python benchmarks/hierarchy.py [--json] [--scenes NAMES]

A row is a pair of models: the greatest distance under the same inputs, the value of Definition 1, and the
orders along the paths of Definition 2 with their standard errors (`rungwise compare SCENE` prints all of it).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence

import rungwise as rw


def rows(found: rw.Comparison, seconds: float) -> Iterator[str]:
    """A scene's lines."""
    cheapest = found.cheapest
    stage = (
        "none" if cheapest is None else f"{cheapest.stage}, {cheapest.steps} steps, {cheapest.solves} solves"
    )
    count = len(found.samples)
    yield f"{found.scene.name}: {count} run{'s' * (count != 1)}; cheapest within {found.accuracy:g}: {stage}"
    for each in found.pairs:
        orders = ", ".join(
            fit.verdict if math.isnan(fit.order) else f"{fit.order:.2f} +- {fit.error:.2f} {fit.verdict}"
            for fit in each.fits
        )
        paper = f"Def. {each.pair.definition}" if each.pair.definition else ""
        near = each.nearest
        greatest = max((x for x in near.same if x == x), default=math.nan)
        yield (
            f"  {each.pair.richer.name:21} {each.pair.simpler.name:21} {paper:6} {greatest:7.0e}"
            f" {near.value:7.0e}  {each.verdict:13} {orders}"
        )
    print(f"{found.scene.name}: {seconds:.0f} s", file=sys.stderr)


def main(arguments: Sequence[str] | None = None, *, samples: int = 8) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--scenes", nargs="+", default=rw.shipped(), help="names of scenes")
    chosen = parser.parse_args(arguments)
    told = {}
    if not chosen.json:
        print(f"  {'from':21} {'to':21} {'paper':6} {'apart':>7} {'Def. 1':>7}  {'verdict':13} orders")
    for name in chosen.scenes:
        began = time.perf_counter()
        found = rw.compare(name, samples=samples)
        if chosen.json:
            told[name] = found.summary()
            continue
        for line in rows(found, time.perf_counter() - began):
            print(line, flush=True)
    if chosen.json:
        print(json.dumps(told))
    return 0


if __name__ == "__main__":
    sys.exit(main())
