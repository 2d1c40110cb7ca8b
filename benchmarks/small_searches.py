"""Small searches of every kind, each of a second or two: what `search_numbers.py` runs with other numbers.

Quick tests below `tests` are searches, too: what they find is whether they pass.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import diagnosis
import fit_coverage
import numpy as np
import planted
import pytest

import rungwise as rw
from rungwise.planning.lift.lift import TENTH

DRAWN = ("push", "two_finger", "four_finger", "grasp", "peg_in_hole", "snap")
BY_MODES = ("book", "card", "corner_pivot", "corridor", "planar_hand")
IN_SPACE = ("three_finger_lift", "floor_push", "arm_turn")
BOX = {"v1": (0.2, 2.2), "v2": (0.2, 2.2), "mu": (0.05, 0.9), "x3": (-0.6, 0.6)}
FITTED = ("impacts", "compliant impacts", "stiffness from slow pushes")
SEEDS = range(3)
BUDGET = 300_000
"""Steps after which a plan counts as not found: ten times what these plans take as they are."""


class Answer(NamedTuple):
    """What a search found: a word that must stay, values that may be `near` off, and its steps or
    runs (0 where it does not count them)."""

    name: str
    word: str
    values: list[float]
    near: list[float]
    work: int


def tasks() -> Iterator[Answer]:
    """Plans of instances that are drawn."""
    for name in DRAWN:
        for seed in SEEDS:
            yield _planned(
                f"{name}, instance {seed}", rw.plan(name, task_seed=1000 + seed, budget=BUDGET, threads=1)
            )


def modes() -> Iterator[Answer]:
    """Plans by contact modes."""
    for name in BY_MODES:
        for seed in SEEDS:
            yield _planned(f"{name}, seed {seed}", rw.plan(name, seed=seed, budget=BUDGET, threads=1))


def space() -> Iterator[Answer]:
    """Plans in space."""
    for name in IN_SPACE:
        yield _planned(name, rw.plan(name, budget=BUDGET, threads=1))


def _planned(name: str, plan: rw.Plan) -> Answer:
    """A plan counts where its replay at a tenth of its error comes to the goal."""
    held = plan.found and plan.replay(tol=TENTH * plan.tol).outcome.code == rw.Code.GOAL
    return Answer(name, "goal" if held else "no plan", [], [], sum(record.steps for record in plan.records))


def sets() -> Iterator[Answer]:
    """Feasible sets and a doomed one, by the shares of their labels."""
    for model, over, tol in (
        ("kinematic", ("v1", "v2"), 0.02), ("dynamic-rigid", ("v1", "v2"), 0.02),
        ("quasistatic-rigid", ("v1", "v2", "mu"), 0.1),
    ):  # fmt: skip
        box = {name: BOX[name] for name in over}
        found = rw.feasible_set("two_finger", model, over, box=box, tol=tol, threads=1)
        share = found.volumes().get("feasible", 0.0)
        yield Answer(f"set on {model} over {len(over)}", "", [share], [tol], found.evaluations)
    doomed = rw.doomed_set(
        "two_finger", "kinematic", ("x1", "x2", "x3"), {"v1": (0.5, 1.0), "v2": (0.5, 1.0)},
        box={"x3": (-1.6, 1.6)}, cells=(18, 18, 30), parameters={"offset": 0.3}, threads=1,
    )  # fmt: skip
    yield Answer("doomed set", "", [doomed.volumes.get("doomed", 0.0)], [0.02], 0)


def fits() -> Iterator[Answer]:
    """Fits of parameters, by their values, which may move within the intervals."""
    for name in FITTED:
        case = fit_coverage.CASES[name]
        rng = np.random.default_rng(0)
        true = {each: float(rng.uniform(*ends)) for each, ends in case.drawn.items()}
        motions = case.make(case, true, 6, rng)
        for seed in SEEDS[:1]:
            found = rw.fit(case.scene, case.model, motions, case.over, seed=seed, threads=1)
            half = [0.5 * float(np.ptp(found.intervals[each])) for each in case.drawn]
            values = [found.values[each] for each in case.drawn]
            named = "named" if set(case.open) <= set(found.open) else "not named"
            yield Answer(f"fit of {name}, seed {seed}", named, values, half, found.runs)


def diagnoses() -> Iterator[Answer]:
    """Causes that a diagnosis names."""
    for kind, draw in diagnosis.KINDS.items():
        for seed in SEEDS:
            found = diagnosis.diagnosis(draw(np.random.default_rng(seed)))
            yield Answer(f"diagnosis of {kind}, {seed}", found.cause, [], [], 0)


def designs() -> Iterator[Answer]:
    """Designs: the margin, or the rate of successes, that they reach."""
    two: dict[str, Any] = {"model": "quasistatic-rigid", "threads": 1}
    for seed in SEEDS:
        box = {name: BOX[name] for name in ("x3", "v2")}
        found = rw.design("two_finger", tuple(box), box=box, seed=seed, robust=True, samples=50, **two)
        rate = found.successes / found.samples
        yield Answer(f"robust design, seed {seed}", found.how, [rate], [0.05], found.runs)
    found = rw.design("two_finger", ("v1", "v2"), box={name: BOX[name] for name in ("v1", "v2")}, **two)
    yield Answer("design", found.how, [found.values["v1"], found.values["v2"]], [0.05, 0.05], found.runs)


def comparisons() -> Iterator[Answer]:
    """Whether one rung comes near another, pair by pair."""
    found = rw.compare("two_finger", samples=2, threads=1)
    for each in found.pairs:
        yield Answer(each.pair.name, each.verdict, [], [], 0)


def problems() -> Iterator[Answer]:
    """Contact problems that have a solution: how many of ten are solved, by all solvers and by one alone."""
    for name, family in planted.FAMILIES.items():
        for load in planted.PLANTS:
            rng, pose = np.random.default_rng(0), planted.poses(family, load)
            asked = [pose(rng).asked for _ in range(10)]
            for solvers in (None, *((each,) for each in ALONE)):
                found = [_solved(problem, solvers) for problem in asked]
                yield Answer(f"{name}, {load}, {solvers or 'all'}", f"{sum(found)} of 10", [], [], 0)


ALONE = ("gauss-seidel", "pivoting", "interior-point", "homotopy", "proximal-point")
"""Solvers that are tried without the others."""


def _solved(problem: rw.Problem, solvers: tuple[str, ...] | None) -> bool:
    return bool(rw.solve(problem, solvers=solvers).status == "solved")


KINDS: dict[str, Callable[[], Iterator[Answer]]] = {
    "tasks": tasks, "modes": modes, "space": space, "sets": sets, "fits": fits, "diagnoses": diagnoses,
    "designs": designs, "comparisons": comparisons, "problems": problems,
}  # fmt: skip


class _Verdicts:
    """A plugin that notes which tests pass."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" or report.failed:
            self.found[report.nodeid] = report.outcome


def tested(*where: str) -> Iterator[Answer]:
    """Whether the quick tests of files, or single tests, pass."""
    verdicts = _Verdicts()
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main([*where, "-p", "no:cacheprovider", "-p", "no:xdist"], plugins=[verdicts])
    for name, outcome in verdicts.found.items():
        yield Answer(name, outcome, [], [], 0)


def searches(kinds: Sequence[str]) -> Iterator[tuple[str, Callable[[], Iterator[Answer]]]]:
    """The searches of these kinds, of all if none is given; files of tests are one kind together."""
    yield from ((kind, KINDS[kind]) for kind in kinds or KINDS if kind in KINDS)
    if where := [kind for kind in kinds if kind not in KINDS]:
        yield TESTS, partial(tested, *where)


TESTS = "tests"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("kinds", nargs="*", help="kinds of searches, or files of tests")
    for kind, run in searches(parser.parse_args(arguments).kinds):
        try:
            for name, *answer in run():
                print(json.dumps([f"{kind}: {name}", *answer]), flush=True)
        except Exception as error:  # what other numbers lead to is an answer, too
            print(json.dumps([f"{kind}: {error!r}", "raised", [], [], 0]), flush=True)


if __name__ == "__main__":
    main()
