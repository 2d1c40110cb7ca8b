"""`rungwise sets`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import plain_errors, refuse, show, show_json, stoppable, writable_to
from rungwise.wording import choices


def sets(
    scene: arg.SceneArgument,
    model: Annotated[str, arg.rung("Rung of the ladder, or all.")],
    over: arg.OverOption,
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    solutions: Annotated[
        str,
        typer.Option(
            "--solutions",
            help="If a model admits several motions: slowest, possible, guaranteed, or all three sets.",
        ),
    ] = "slowest",
    lift: Annotated[
        bool,
        typer.Option("--lift", help="With --model all: search each boundary near that of the rung below."),
    ] = False,
    tol: Annotated[float, arg.numeric("--tol", "Accuracy of the boundary, as a part of the box.")] = 0.01,
    accuracy: Annotated[float | None, arg.numeric("--accuracy", "Error allowed per step of a run.")] = None,
    probes: Annotated[
        int | None,
        typer.Option("--probes", min=0, help="Random points that are run in each round of the search."),
    ] = None,
    budget: Annotated[int | None, typer.Option("--budget", min=1, help="Greatest number of runs.")] = None,
    limit: arg.LimitOption = None,
    threads: arg.ThreadsOption = None,
    cluster: arg.ClusterOption = None,
    certify: Annotated[
        int, typer.Option("--certify", min=0, help="Number of fresh random points that test the result.")
    ] = 0,
    out: Annotated[Path | None, arg.path("--out", "Folder for batches, sets and the figure.")] = None,
    resume: arg.ResumeOption = False,
    force: arg.ForceOption = False,
    html: Annotated[
        Path | None, arg.path("--html", "Surfaces, slices and runs in one file, for a browser.")
    ] = None,
    table: Annotated[Path | None, arg.path("--csv", "Table of all runs and boundary points.")] = None,
    mesh: Annotated[
        Path | None,
        arg.path("--mesh", "Boundary of the feasible part, .obj or .stl; over 2 or 3 parameters."),
    ] = None,
    as_json: arg.JsonOption = False,
) -> int:
    """Find the parameters with which a scene reaches its goal. All other parameters are labelled by the
    outcome of their runs.

    Example: rungwise sets two_finger --model all --over v1,v2 --html sets.html"""
    from importlib.util import find_spec

    from rungwise.deadline import Deadline, seconds
    from rungwise.models.ladder import LADDER
    from rungwise.report import files
    from rungwise.report import sets as report
    from rungwise.sets.feasible.feasible import BUDGET, FeasibleSet, feasible_set
    from rungwise.sets.motions import SLOWEST, SOLUTIONS
    from rungwise.viewing.sets.slices import feasible_slices, write_figure
    from rungwise.viewing.view import view

    if resume and out is None:
        refuse("resume: needs --out, the folder with the kept batches")
    if solutions not in (*SOLUTIONS, "all"):
        refuse(f"solutions: unknown {solutions[:60]!r}{choices(solutions, (*SOLUTIONS, 'all'))}")
    if lift and model != "all":
        refuse("lift: needs --model all, rungs to climb")
    names, box = arg.intervals("over", over)
    rungs = [rung.name for rung in LADDER if rung.moves] if model == "all" else [model]
    wanted = [(name, each) for name in rungs for each in (SOLUTIONS if solutions == "all" else [solutions])]
    per_rung = len(wanted) // len(rungs)
    found: list[FeasibleSet] = []
    exports = {"csv": table, "mesh": mesh}
    kept = "nothing is kept without --out" if out is None else f"--resume goes on from what {out} keeps"
    finished = "; finished batches are kept, and --resume goes on from them"
    with stoppable(kept), writable_to(out, finished), plain_errors():
        deadline = Deadline(seconds(limit))
        files.check(exports, len(names))
        loaded, parameters = arg.load_with(scene, values, settle)
        if out is not None:
            arg.writable(out)
            arg.unused(out, force, resume)
        arg.unused_files(force, html=html, csv=table, mesh=mesh)
        for number, (name, each) in enumerate(wanted):
            left = len(wanted) - number + (certify > 0)
            below = found[-per_rung] if lift and name != rungs[0] else None
            folder = name if each == SLOWEST else f"{name}-{each}"
            with progress.counting(folder, as_json) as on_progress:
                found.append(
                    feasible_set(
                        loaded, name, names, tol=tol, box=box, parameters=parameters, solutions=each,
                        near=below, accuracy=accuracy, probes=probes,
                        budget=BUDGET if budget is None else budget,
                        limit=deadline.share(left), threads=threads, cluster=cluster,
                        out=None if out is None else out / folder, resume=resume, on_progress=on_progress,
                    )
                )  # fmt: skip
        summary = report.summary(found, certify, box, deadline)
        written = files.write(found, exports)
        if html is not None:
            written += view(found, html=html, limit=deadline.seconds)
        if out is not None and find_spec("matplotlib") is not None:
            write_figure(feasible_slices(found), out / "sets.png")
    summary["files"] = [str(file) for file in written]
    show_json(summary) if as_json else show(report.text(summary))
    return 0 if any("feasible" in each["volumes"] for each in summary["sets"]) else 1
