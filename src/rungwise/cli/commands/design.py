"""`rungwise design`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import answer, plain_errors, stoppable


def design(
    scene: arg.SceneArgument,
    over: arg.OverOption,
    model: Annotated[str, arg.rung("Rung on which to succeed.")] = "dynamic-compliant",
    from_: Annotated[
        str | None,
        arg.rung("Rung on which the search begins; it climbs rung by rung.", "--from"),
    ] = None,
    robust: Annotated[
        bool,
        typer.Option(
            "--robust", help="Maximize the rate of success under the uncertainty of the scene's task."
        ),
    ] = False,
    samples: Annotated[
        int, typer.Option("--samples", min=1, help="Number of fresh runs that confirm the design.")
    ] = 200,
    draws: Annotated[
        int, typer.Option("--draws", min=1, help="Number of samples with which each design is tried.")
    ] = 50,
    tol: Annotated[float, arg.numeric("--tol", "Accuracy of the set's boundary.")] = 0.01,
    budget: Annotated[int, typer.Option("--budget", min=1, help="Greatest number of runs.")] = 200_000,
    limit: arg.LimitOption = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the search and of the draws.")] = 0,
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    out: Annotated[Path | None, arg.path("--out", "Scene file with the best values as defaults.")] = None,
    force: arg.ForceOption = False,
    png: Annotated[Path | None, arg.path("--png", "Picture of how far each parameter may drift.")] = None,
    threads: arg.ThreadsOption = None,
    as_json: arg.JsonOption = False,
) -> int:
    """Choose parameters that succeed and lie far from failure. The answer says how far each may drift.

    Example: rungwise design two_finger --over x3=-0.6:0.6,v2=0.2:2.2 --out best.yaml"""
    from rungwise.planning.design.design import design as choose
    from rungwise.viewing.designs import design_bars
    from rungwise.viewing.write import needs_matplotlib, write

    names, box = arg.intervals("over", over)
    with stoppable("nothing is kept"), plain_errors():
        loaded, parameters = arg.load_with(scene, values, settle)
        if png is not None:
            needs_matplotlib("png")
        arg.unused_files(force, out=out, png=png)
        for file in (out, png):
            if file is not None:
                arg.writable_file(file)
        with progress.bar("design", budget, as_json) as told:
            found = choose(
                loaded, names, model=model, from_=from_, box=box, parameters=parameters, robust=robust,
                samples=samples, draws=draws, tol=tol, budget=budget, limit=limit, seed=seed,
                threads=threads, on_progress=told,
            )  # fmt: skip
        if found.found and out is not None:
            text = found.designed().yaml()
            write("out", out, lambda file: file.write_text(text, "utf-8"))
        if found.found and png is not None:
            write("png", png, lambda file: design_bars(found).savefig(file, dpi=150, format="png"))
    answer(found, as_json)
    return 0 if found.ok else 1
