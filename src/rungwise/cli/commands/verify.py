"""`rungwise verify`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import progress
from rungwise.cli.arguments import (
    ClusterOption,
    JsonOption,
    SeedOption,
    ThreadsOption,
    load_plan_file,
    numeric,
)
from rungwise.cli.terminal import INTERRUPTED, plain_errors, show, show_json


def verify(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="A saved plan (JSON).")],
    model: Annotated[
        str | None, typer.Option("--model", help="Rung; the plan's own if not given.")
    ] = None,
    samples: Annotated[int, typer.Option("--samples", min=1, help="How many runs.")] = 200,
    mode: Annotated[
        str | None,
        typer.Option("--mode", help='"open loop", "guarded moves", "re-planning"; default: the plan\'s own.'),
    ] = None,
    seed: SeedOption = 0,
    tol: Annotated[
        float | None,
        numeric("--tol", "Error allowed per step."),
    ] = None,
    rate: Annotated[
        float,
        numeric(
            "--rate",
            "The answer is positive (exit code 0) where the lower bound of success is at least this.",
            metavar="RATE",
        ),
    ] = 0.9,
    limit: Annotated[
        float | None,
        numeric("--limit", "Ends with the samples run so far.", metavar="SECONDS"),
    ] = None,
    threads: ThreadsOption = None,
    cluster: ClusterOption = None,
    as_json: JsonOption = False,
) -> int:  # fmt: skip
    """Run a plan from starts, with parameters and inputs, that are drawn by its task."""
    from rungwise.planning.execution.verify import verify as run

    try:
        with plain_errors(), progress.bar("verify", samples, as_json or not sys.stderr.isatty()) as told:
            found = run(
                load_plan_file(plan), model, samples, mode=mode, limit=limit, seed=seed, tol=tol,
                threads=threads, cluster=cluster, on_progress=told,
            )  # fmt: skip
    except KeyboardInterrupt:
        print("rungwise: stopped; no sample is kept", file=sys.stderr)
        return INTERRUPTED
    show_json(found.summary()) if as_json else show(str(found))
    return 0 if found.lower >= rate else 1
