"""`rungwise design`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import progress
from rungwise.cli.arguments import (
    JsonOption,
    SceneArgument,
    SetOption,
    ThreadsOption,
    intervals,
    load_with,
    numeric,
    writable_file,
)
from rungwise.cli.terminal import INTERRUPTED, plain_errors, show, show_json


def design(
    scene: SceneArgument,
    over: Annotated[
        str, typer.Option("--over", help="Parameters, NAME or NAME=LOW:HIGH, separated by commas.")
    ],
    model: Annotated[str, typer.Option("--model", help="Rung on which to succeed.")] = "dynamic-compliant",
    from_: Annotated[
        str | None, typer.Option("--from", help="Rung of which on designs are searched, rung after rung.")
    ] = None,
    robust: Annotated[
        bool, typer.Option("--robust", help="Under what the scene's task calls uncertain.")
    ] = False,
    samples: Annotated[int, typer.Option("--samples", min=1, help="Fresh runs that confirm it.")] = 200,
    draws: Annotated[int, typer.Option("--draws", min=1, help="Samples to try a design.")] = 50,
    tol: Annotated[
        float,
        numeric("--tol", "Accuracy of the set's boundary."),
    ] = 0.01,
    budget: Annotated[int, typer.Option("--budget", min=1, help="Greatest number of runs.")] = 200_000,
    limit: Annotated[
        float | None,
        numeric("--limit", "Ends with the best design so far.", metavar="SECONDS"),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the search and of the draws.")] = 0,
    values: SetOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Scene file with the best values as defaults.")
    ] = None,
    png: Annotated[Path | None, typer.Option("--png", help="Picture: how far each may drift.")] = None,
    threads: ThreadsOption = None,
    as_json: JsonOption = False,
) -> int:
    """Choose parameters with which a scene succeeds, as far from failure as may be."""
    from rungwise.planning.design.design import design as choose
    from rungwise.viewing.designs import design_bars
    from rungwise.viewing.write import needs_matplotlib, write

    names, box = intervals("over", over)
    try:
        with plain_errors():
            loaded, parameters = load_with(scene, values)
            if png is not None:
                needs_matplotlib("png")
            for file in (out, png):
                if file is not None:
                    writable_file(file)
            with progress.bar("design", budget, as_json or not sys.stderr.isatty()) as told:
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
    except KeyboardInterrupt:
        print("rungwise: stopped; nothing is kept", file=sys.stderr)
        return INTERRUPTED
    show_json(found.summary()) if as_json else show(str(found))
    return 0 if found.ok else 1
