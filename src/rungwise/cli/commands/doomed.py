"""`rungwise doomed`."""

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
    writable,
)
from rungwise.cli.terminal import INTERRUPTED, plain_errors, refuse, show, show_json


def doomed(
    scene: SceneArgument,
    model: Annotated[str, typer.Option("--model", help="Rung of the ladder, with rigid contact.")],
    over: Annotated[
        str, typer.Option("--over", help="States, NAME or NAME=LOW:HIGH, separated by commas.")
    ],
    inputs: Annotated[
        str, typer.Option("--inputs", help="Parameters that may change: NAME=LOW:HIGH, separated by commas.")
    ],
    values: SetOption = None,
    cells: Annotated[int | None, typer.Option("--cells", help="Cells along each axis.")] = None,
    stride: Annotated[
        list[float] | None,
        numeric("--stride", "Macro-step in cells that the fastest coordinate moves; may be repeated."),
    ] = None,
    padding: Annotated[int, typer.Option("--padding", help="Cells around a cell that speak for it.")] = 1,
    solutions: Annotated[
        str, typer.Option("--solutions", help="slowest; or any motion that overlaps nothing (kinematic).")
    ] = "slowest",
    threads: ThreadsOption = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the set and the figure.")] = None,
    as_json: JsonOption = False,
) -> int:  # fmt: skip
    """States from which no input within bounds reaches the goal."""
    from importlib.util import find_spec

    from rungwise.report import doomed as report
    from rungwise.sets.doomed.doomed import STRIDES, doomed_set
    from rungwise.viewing.sets.slices import doomed_slices, write_figure

    names, box = intervals("over", over)
    controls, bounds = intervals("inputs", inputs)
    for name in controls:
        if name not in bounds:
            refuse(f"inputs: {name[:60]} needs an interval, {name[:60]}=LOW:HIGH")
    try:
        with plain_errors():
            loaded, parameters = load_with(scene, values)
            if out is not None:
                writable(out)
            with progress.counting(model, quiet=as_json or not sys.stderr.isatty()) as on_progress:
                found = doomed_set(
                    loaded, model, names, bounds, box=box, cells=cells, parameters=parameters,
                    solutions=solutions, strides=stride or STRIDES, padding=padding, threads=threads, out=out,
                    on_progress=on_progress,
                )  # fmt: skip
            summary = report.summary(found)
            if out is not None and find_spec("matplotlib") is not None:
                write_figure(doomed_slices(found), out / "doomed.png")
    except KeyboardInterrupt:
        print("rungwise: stopped; nothing is kept", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        refuse(f"out: {out} cannot be written ({error.strerror or error})")
    show_json(summary) if as_json else show(report.text(summary))
    return 0 if "doomed" in summary["volumes"] else 1
