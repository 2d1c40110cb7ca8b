"""`rungwise compare`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import answer, plain_errors, show, show_json, stoppable, writable_to

SAME = 0.05
"""A counterexample is confirmed where its runs are within this part as far apart as they were."""


def compare(
    scene: arg.SceneArgument,
    model: Annotated[
        str,
        arg.rung("Only pairs with this rung, or all."),
    ] = "all",
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    samples: Annotated[
        int, typer.Option("--samples", min=0, help="Number of inputs drawn besides the scene's own.")
    ] = 8,
    seed: arg.SeedOption = 0,
    accuracy: Annotated[
        float,
        arg.numeric("--accuracy", "Motions this close count as equal, as a part of the scene's extent."),
    ] = 0.01,
    duration: Annotated[
        float | None,
        arg.numeric("--time", "End of the runs; if not given, when the runs on all rungs have ended."),
    ] = None,
    threads: arg.ThreadsOption = None,
    limit: arg.LimitOption = None,
    out: Annotated[Path | None, arg.path("--out", "Folder for the answer and its counterexamples.")] = None,
    force: arg.ForceOption = False,
    as_json: arg.JsonOption = False,
) -> int:
    """Measure how far apart the models are on a scene. This is the paper's Table 1, with numbers. SCENE may
    also be a saved counterexample, whose two runs are repeated.

    Example: rungwise compare two_finger"""
    from rungwise.hierarchy.compare import compare as measure
    from rungwise.hierarchy.counterexample import saved

    if saved(scene):
        return _replay(Path(scene), limit, as_json)
    with stoppable("nothing is kept"), plain_errors():
        if out is not None:
            arg.writable(out)
            arg.unused(out, force)
        loaded = arg.load_scene(scene, settle)
        given = arg.given_values(loaded, values)
        with progress.counting("compare", as_json) as on_progress:
            found = measure(
                loaded, None if model == "all" else model, parameters=given, samples=samples, seed=seed,
                accuracy=accuracy, duration=duration, threads=threads, limit=limit,
                on_progress=on_progress,
            )  # fmt: skip
    if out is not None:
        with writable_to(out):
            found.save(out)
    answer(found, as_json)
    return 0 if found.ok else 1


def _replay(file: Path, limit: float | None, as_json: bool) -> int:
    """Repeat both runs of a counterexample; the answer is positive where they are as far apart as before."""
    from rungwise.hierarchy.counterexample import load_counterexample

    with plain_errors():
        example = load_counterexample(file)
        runs = example.replay(limit=limit)
    is_over = any(run.outcome == "running" for run in runs)
    away = math.nan if is_over else example.apart(*runs)
    same = abs(away - example.distance) <= SAME * example.distance
    if as_json:
        told = {"words": example.words, "distance": away, "saved": example.distance, "ok": same}
        show_json(told | {"runs": [run.summary() for run in runs]})
    else:
        show(f"{example.scene.name}: {example.words}")
        for run in runs:
            show(f"  {run.model.name} at epsilon {run.model.inertia:g}: {run.outcome} at {run.time:.6g}")
        apart = "the time was over before both runs had ended" if is_over else f"{away:.3g} apart"
        show(f"  {apart}; {example.distance:.3g} when it was saved")
    return 0 if same else 1
