"""`rungwise fit`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import INTERRUPTED, answer, plain_errors, refuse, show, stoppable, writable_to


def fit(
    scene: arg.SceneArgument,
    data: Annotated[Path, typer.Option("--data", help="Measured motions, CSV: trial, time, coordinates.")],
    over: arg.OverOption,
    model: Annotated[
        str,
        arg.rung("Rung of the ladder, or all, to find the simplest one that explains the motions."),
    ],
    values: arg.SetOption = None,
    deviation: Annotated[
        list[str] | None,
        typer.Option(
            "--deviation",
            help="Standard deviation of a coordinate's measurement, name=value; may be repeated.",
        ),
    ] = None,
    span: Annotated[
        float | None,
        arg.numeric("--span", "How long runs from measured states last; inf: whole trials.", "TIME"),
    ] = None,
    held_out: Annotated[
        float,
        arg.numeric(
            "--held-out", "With --model all: the fraction of the trials that is held out for the scores."
        ),
    ] = 0.5,
    tol: Annotated[
        float | None,
        arg.numeric(
            "--tol",
            "Error allowed per step; if not given, steps become finer until the values hardly change.",
        ),
    ] = None,
    limit: arg.LimitOption = None,
    seed: arg.SeedOption = 0,
    threads: arg.ThreadsOption = None,
    out: Annotated[
        Path | None, arg.path("--out", "Folder for batches, the answer, and the scene found.")
    ] = None,
    resume: arg.ResumeOption = False,
    force: arg.ForceOption = False,
    as_json: arg.JsonOption = False,
) -> int:
    """Fit parameters of a scene to measured motions. With --model all the answer also says which rung
    explains the motions. Ctrl-C gives the best answer so far.

    Example: rungwise fit part.yaml --data measured.csv --model all --over mu,e"""
    from rungwise.fitting.explain import explain
    from rungwise.fitting.fit import fit as search

    if resume and out is None:
        refuse("resume: needs --out, the folder with the kept batches")
    names, box = arg.intervals("over", over)
    kept = "nothing is kept without --out" if out is None else f"--resume goes on from what {out} keeps"
    finished = "; finished batches are kept, and --resume goes on from them"
    found: Any
    with stoppable(kept), writable_to(out, finished), plain_errors():
        if out is not None:
            arg.writable(out)
            arg.unused(out, force, resume)
        loaded = arg.load_scene(scene)
        motions = _motions(data, deviation)
        with progress.counting("fit", as_json) as told:
            shared: dict[str, Any] = {
                "box": box, "parameters": arg.given_values(loaded, values), "span": span, "tol": tol,
                "limit": limit, "seed": seed, "threads": threads, "out": out, "resume": resume,
                "keep_interrupted": True, "on_progress": told,
            }  # fmt: skip
            if model == "all":
                found = explain(loaded, motions, names, held_out=held_out, **shared)
            else:
                found = search(loaded, model, motions, names, **shared)
        if out is not None:
            _write(found, out, as_json)
    answer(found, as_json)
    return INTERRUPTED if "interrupted" in found.unfinished else 0 if found.ok else 1


def _motions(data: Path, deviation: list[str] | None) -> Any:
    """Measured motions of a file."""
    from rungwise.fitting.measured.motions import Motions

    given: dict[str, float] = {}
    for item in deviation or []:
        name, equals, text = item.partition("=")
        try:
            given[name.strip()] = float(text)
        except ValueError:
            equals = ""
        if not equals or not math.isfinite(given.get(name.strip(), math.inf)):
            refuse(f"deviation: {item[:80]!r} must be name=number")
    return Motions.from_csv(data, deviations=given)


def _write(found: Any, out: Path, as_json: bool) -> None:
    """The answer, and the scene with the values found."""
    from rungwise.plain import json_text
    from rungwise.stored import whole

    best = found.rungs[found.adequate].fit if hasattr(found, "rungs") else found
    for name, text in (("fit.json", json_text(found.summary(), 1)), ("scene.yaml", best.scene.yaml())):
        with whole(out / name) as draft:
            draft.write_text(text, "utf-8")
    if not as_json:
        show(f"{out / 'scene.yaml'}: {best.measured_on.name} with the values found on {best.model.name}")
