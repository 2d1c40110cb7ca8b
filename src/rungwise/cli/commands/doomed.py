"""`rungwise doomed`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import plain_errors, refuse, show, show_json, stoppable, writable_to


def doomed(
    scene: arg.SceneArgument,
    model: Annotated[
        str,
        arg.rung("Rung of the ladder, with rigid contact."),
    ],
    over: Annotated[
        str, typer.Option("--over", help="Coordinates of states: NAME or NAME=LOW:HIGH, separated by commas.")
    ],
    inputs: Annotated[
        str,
        typer.Option(
            "--inputs", help="Parameters that inputs may change: NAME=LOW:HIGH, separated by commas."
        ),
    ],
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    cells: Annotated[int | None, typer.Option("--cells", help="Cells along each axis.")] = None,
    stride: Annotated[
        list[float] | None,
        arg.numeric("--stride", "Macro-step in cells that the fastest coordinate moves; may be repeated."),
    ] = None,
    padding: Annotated[int, typer.Option("--padding", help="Neighbours examined together with a cell.")] = 1,
    solutions: Annotated[
        str, typer.Option("--solutions", help="slowest, or any: each motion without overlap (kinematic).")
    ] = "slowest",
    threads: arg.ThreadsOption = None,
    limit: arg.LimitOption = None,
    out: Annotated[Path | None, arg.path("--out", "Folder for the set and the figure.")] = None,
    force: arg.ForceOption = False,
    as_json: arg.JsonOption = False,
) -> int:
    """Find states from which no input reaches the goal. Inputs stay within their bounds.

    Example: rungwise doomed two_finger --model kinematic --over x1,x3=-2:2,x2
    --inputs v1=0.01:1,v2=0.01:1"""
    from importlib.util import find_spec

    from rungwise.deadline import Deadline, seconds
    from rungwise.report import doomed as report
    from rungwise.sets.doomed.doomed import STRIDES, doomed_set
    from rungwise.viewing.sets.slices import doomed_slices, write_figure

    names, box = arg.intervals("over", over)
    controls, bounds = arg.intervals("inputs", inputs)
    for name in controls:
        if name not in bounds:
            refuse(f"inputs: {name[:60]} needs an interval, {name[:60]}=LOW:HIGH")
    with stoppable("nothing is kept"), writable_to(out), plain_errors():
        deadline = Deadline(seconds(limit))
        loaded, parameters = arg.load_with(scene, values, settle)
        if out is not None:
            arg.writable(out)
            arg.unused(out, force)
        with progress.counting(model, as_json) as on_progress:
            found = doomed_set(
                loaded, model, names, bounds, box=box, cells=cells, parameters=parameters,
                solutions=solutions, strides=stride or STRIDES, padding=padding, threads=threads,
                limit=deadline.seconds, out=out,                on_progress=on_progress,
            )  # fmt: skip
        summary = report.summary(found, deadline.seconds)
        if out is not None and find_spec("matplotlib") is not None:
            write_figure(doomed_slices(found), out / "doomed.png")
    show_json(summary) if as_json else show(report.text(summary))
    return 0 if "doomed" in summary["volumes"] else 1
