"""`rungwise compare`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from rungwise.cli import progress
from rungwise.cli.arguments import JsonOption, SceneArgument, SetOption, given_values, load_scene, number
from rungwise.cli.terminal import INTERRUPTED, plain_errors, show, show_json


def compare(
    scene: SceneArgument,
    model: Annotated[str, typer.Option("--model", help="Only pairs with this rung, or all.")] = "all",
    values: SetOption = None,
    samples: Annotated[int, typer.Option("--samples", min=0, help="Inputs drawn besides the scene's.")] = 8,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the draws.")] = 0,
    accuracy: Annotated[
        float,
        typer.Option(
            "--accuracy", parser=number, metavar="NUMBER",
            help="Motions this near count as alike, as a part of the scene's extent.",
        ),
    ] = 0.01,
    duration: Annotated[
        float | None,
        typer.Option(
            "--time", parser=number, metavar="NUMBER",
            help="End of the runs; if not given, when the last rung has come to an end.",
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="Threads; all cores if not given.")
    ] = None,
    as_json: JsonOption = False,
) -> int:  # fmt: skip
    """How far the models are apart on a scene: the paper's Table 1, with numbers."""
    from rungwise.hierarchy.compare import compare as measure

    try:
        with plain_errors():
            loaded = load_scene(scene)
            given = given_values(loaded, values)
            with progress.counting("compare", quiet=as_json or not sys.stderr.isatty()) as on_progress:
                found = measure(
                    loaded, None if model == "all" else model, parameters=given, samples=samples, seed=seed,
                    accuracy=accuracy, duration=duration, threads=threads, on_progress=on_progress,
                )  # fmt: skip
    except KeyboardInterrupt:
        print("rungwise: stopped; nothing is kept", file=sys.stderr)
        return INTERRUPTED
    show_json(found.summary()) if as_json else show(str(found))
    return 0 if found.ok else 1
