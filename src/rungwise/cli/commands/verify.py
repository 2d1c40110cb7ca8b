"""`rungwise verify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import answer, plain_errors, stoppable


def verify(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="A saved plan (JSON).")],
    model: Annotated[
        str | None,
        arg.rung("Rung; the plan's own if not given."),
    ] = None,
    samples: Annotated[int, typer.Option("--samples", min=1, help="Number of runs.")] = 200,
    mode: Annotated[
        str | None,
        typer.Option(
            "--mode",
            help='"open loop", "guarded moves", "re-planning", "feedback"; default: the plan\'s own.',
        ),
    ] = None,
    noise: Annotated[
        float,
        arg.numeric("--noise", "With feedback, standard deviation of measured places, as a length."),
    ] = 0.0,
    seed: arg.SeedOption = 0,
    tol: Annotated[
        float | None,
        arg.numeric("--tol", "Error allowed per step.")
    ] = None,
    rate: Annotated[
        float,
        arg.numeric(
            "--rate",
            "The answer is positive (exit code 0) if the lower bound of success is at least this.",
            metavar="RATE",
        ),
    ] = 0.9,
    limit: arg.LimitOption = None,
    threads: arg.ThreadsOption = None,
    cluster: arg.ClusterOption = None,
    as_json: arg.JsonOption = False,
) -> int:  # fmt: skip
    """Measure how often a plan succeeds under uncertainty. Starts, parameters and errors of inputs are drawn
    from the plan's task.

    Example: rungwise verify plan.json --samples 200"""
    from rungwise.planning.execution.verify import verify as run

    with stoppable("no sample is kept"), plain_errors(), progress.bar("verify", samples, as_json) as told:
        found = run(
            arg.load_plan_file(plan), model, samples, mode=mode, noise=noise, limit=limit, seed=seed, tol=tol,
            threads=threads, cluster=cluster, on_progress=told,
        )  # fmt: skip
    answer(found, as_json)
    return 0 if found.lower >= rate else 1
