"""Sets as plain values and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

from rungwise.deadline import NEVER, Deadline
from rungwise.sets.feasible.difference import between
from rungwise.sets.feasible.feasible import Certified, FeasibleSet
from rungwise.sets.motions import SLOWEST
from rungwise.sets.request import chosen


def summary(
    found: Sequence[FeasibleSet],
    certify: int = 0,
    box: Mapping[str, tuple[float, float]] | None = None,
    deadline: Deadline = NEVER,
) -> dict[str, Any]:
    """Counts, volumes and differences of neighbours on the ladder, as `rungwise sets --json` prints them.

    With `certify` > 0, each set is tested at so many fresh points, as far as time is left; `box` holds the
    intervals that were given.
    """
    first = found[0]
    return {
        "scene": first.scene.name,
        "over": {name: list(box) for name, box in zip(first.over, first.box.tolist(), strict=True)},
        "chosen": chosen(first.scene, first.over, {} if box is None else box),
        "parameters": first.parameters,
        "tol": first.tol,
        "sets": [
            {
                "model": each.model.name,
                "solutions": each.solutions,
                "evaluations": each.evaluations,
                "complete": each.complete,
                "probes": each.probes,
                "hits": each.hits,
                "volumes": each.volumes(),
                "certified": None if certified is None else asdict(certified),
            }
            for each, certified in zip(found, _certified(found, certify, deadline), strict=True)
        ],
        "between": [asdict(between(a, b)) for a, b in _neighbours(found)],
    }


def _certified(found: Sequence[FeasibleSet], n: int, deadline: Deadline) -> list[Certified | None]:
    """What fresh points say of each set; each takes its share of the time that is left."""
    if n == 0:
        return [None] * len(found)
    return [each.certify(n, limit=deadline.share(len(found) - k)) for k, each in enumerate(found)]


def _neighbours(found: Sequence[FeasibleSet]) -> list[tuple[FeasibleSet, FeasibleSet]]:
    """Pairs to compare: sets of one rung for different motions, and one rung with the next."""
    rungs = list(dict.fromkeys(each.model for each in found))
    kinds = list(dict.fromkeys(each.solutions for each in found))
    groups = [[each for each in found if each.model == rung] for rung in rungs]
    groups += [[each for each in found if each.solutions == kind] for kind in kinds]
    return [pair for group in groups for pair in pairwise(group)]


def text(summary: dict[str, Any]) -> str:
    """The summary for people."""
    over = ", ".join(f"{name} in {low:g}..{high:g}" for name, (low, high) in summary["over"].items())
    lines = [f"{summary['scene']} over {over}, boundary within {summary['tol']:g} of each side"]
    lines += [f"  {name}: {how}; {name}=LOW:HIGH gives another" for name, how in summary["chosen"].items()]
    names = [_name(each) for each in summary["sets"]]
    width = max(22, *(len(name) for name in names))
    for name, each in zip(names, summary["sets"], strict=True):
        parts = ", ".join(f"{label} {part:.4f}" for label, part in each["volumes"].items())
        lines.append(f"  {name:{width}s} {parts}")
        note = "" if each["complete"] else "; the budget or the limit ended the refinement"
        lines.append(
            f"  {'':{width}s} {each['evaluations']} runs, {each['hits']} of {each['probes']} probes"
            f" contradicted their cell{note}"
        )
        if each["certified"]:
            c = each["certified"]
            lines.append(
                f"  {'':{width}s} {c['wrong']} of {c['samples']} fresh points wrong ({c['near']} of them"
                f" within the tolerance): error rate below {c['bound']:.2g}"
                f" with confidence {1 - c['delta']:g}"
            )
    for pair in summary["between"]:
        lines.append(
            f"  {pair['cheap']} -> {pair['rich']}: loses {pair['lost']:.4f} of the box, gains"
            f" {pair['gained']:.4f} (+- {pair['error']:.4f})"
        )
    lines += [f"wrote {file}" for file in summary.get("files", ())]
    return "\n".join(lines)


def _name(summary: dict[str, Any]) -> str:
    """Name of a summarised set, as `FeasibleSet.name`."""
    model, solutions = summary["model"], summary["solutions"]
    return f"{model}" if solutions == SLOWEST else f"{model}, {solutions}"
