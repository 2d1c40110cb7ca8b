"""Which laws of contact help on motions of real objects: each is fitted, and scored on trials held out.

    python benchmarks/laws.py FOLDER [--only squares ellipses] [--rungs NAMES] [--trials N] [--seed N]

FOLDER and data are those of benchmarks/real.py. Half of N trials are fitted with the common laws and with one
law more; errors of the others, over spans of a quarter of a trial, are compared trial by trial: the last
columns are the mean of the differences from the common laws with its 95 % interval (bootstrap over trials).
A law helps where the whole interval is below 0.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from real import AFTER, COMPLIANT, RIGID, Real, ellipses, squares  # beside this file

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.score import by_trial, mean_of, sizes
from rungwise.fitting.stages import Search

EXTRA = {
    "v_y": {"default": 1.0, "range": [0.01, 10.0], "unit": "m/s"},
    "held": {"default": 1.2, "range": [1.0, 5.0]},
    "pull": {"default": 0.1, "range": [1e-3, 100.0], "unit": "N"},
}
"""Parameters of the laws: the yield speed, static over kinetic friction, and adhesion."""


class Law(NamedTuple):
    """Fields of the contact, and which of `EXTRA` they add."""

    name: str
    rung: str
    fields: dict[str, Any]
    over: tuple[str, ...] = ()


LAWS = (
    Law("common", RIGID, {}),
    Law("Poisson", RIGID, {"impact": "poisson"}),
    Law("falls with speed", RIGID, {"yield_speed": "v_y"}, ("v_y",)),
    Law("static friction", RIGID, {"static_friction": "mu * held"}, ("held",)),
    Law("adhesion", RIGID, {"adhesion": "pull", "adhesion_range": 1e-4}, ("pull",)),
    Law("common", COMPLIANT, {}),
    Law("static friction", COMPLIANT, {"static_friction": "mu * held"}, ("held",)),
    Law("adhesion", COMPLIANT, {"adhesion": "pull", "adhesion_range": 1e-4}, ("pull",)),
)


def with_law(real: Real, law: Law) -> rw.Scene:
    """The scene of a set with one law more."""
    data = dict(real.scene.file.model_dump(mode="json", exclude_unset=True))
    data["contacts"] = [data["contacts"][0] | law.fields]
    extra = {name: EXTRA[name] for name in law.over}
    return rw.load(data | {"parameters": data["parameters"] | extra})


def scored(real: Real, law: Law, seed: int) -> tuple[dict[str, float], list[NDArray[np.float64]]]:
    """Values of a fit, and errors (trials,) of place and turn on the trials held out."""
    train, test = real.motions.split(0.5, seed=seed)
    rung = rw.DYNAMIC_COMPLIANT if law.rung == COMPLIANT else rw.DYNAMIC_RIGID
    options = Options(real.span, 10, real.step, None, None, seed)
    scene, over = with_law(real, law), (*real.over[law.rung], *law.over)
    fit = Search(prepare(scene, rung, train, over, None, None, options), NEVER, None).found()
    one = prepare(scene, rung, test, over, None, None, replace(options, span=real.span))
    runs = one.predictor(one.spans(), NEVER)
    point = np.array([fit.values[each] for each in fit.over])
    found = sizes(one.scene, one.layout.compared, runs(point[None]).errors[0])
    if real.name == "ellipses":  # errors of velocity
        found = type(found)(*(each[:, -1:] / AFTER * np.ones_like(each) for each in found))
    return fit.values, [by_trial(runs.spans, each) for each in found[:2]]


def table(real: Real, rungs: tuple[str, ...], seed: int) -> list[str]:
    """Lines of a page, one as soon as it is known."""
    lines = ["| set | rung | law | parameters | place | turn | place, minus common | turn, minus common |"]
    lines.append("|" + "---|" * 8)
    print(*lines, sep="\n", flush=True)
    scale, unit = (1.0, "m/s") if real.name == "ellipses" else (1e3, "mm")
    common: list[NDArray[np.float64]] = []
    for law in (law for law in LAWS if law.rung in rungs):
        values, errors = scored(real, law, seed)
        if law.name == "common":
            common = errors
        cells = [real.name, law.rung, law.name, ", ".join(f"{name} {x:.3g}" for name, x in values.items())]
        cells += [f"{errors[0].mean() * scale:.3g} {unit}", f"{errors[1].mean():.3g}"]
        for own, other, by in zip(errors, common, (scale, 1.0), strict=True):
            mean = mean_of(own - other)
            told = f"{mean.value * by:+.2g} ({mean.lower * by:+.2g} to {mean.upper * by:+.2g})"
            cells.append("" if law.name == "common" else told)
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    sets = {"squares": squares, "ellipses": ellipses}
    parser.add_argument("--only", nargs="+", choices=sets, default=list(sets))
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rungs", nargs="+", choices=(RIGID, COMPLIANT), default=[RIGID, COMPLIANT])
    given = parser.parse_args()
    for name in given.only:
        table(sets[name](given.folder, given.trials), tuple(given.rungs), given.seed)


if __name__ == "__main__":
    main()
