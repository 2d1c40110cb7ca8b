"""`rungwise compare`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import progress
from rungwise.cli.arguments import (
    JsonOption,
    SceneArgument,
    SeedOption,
    SetOption,
    ThreadsOption,
    given_values,
    load_scene,
    numeric,
    writable,
)
from rungwise.cli.terminal import INTERRUPTED, plain_errors, refuse, show, show_json

SAME = 0.05
"""A counterexample is confirmed where its runs are within this part as far apart as they were."""


def compare(
    scene: SceneArgument,
    model: Annotated[str, typer.Option("--model", help="Only pairs with this rung, or all.")] = "all",
    values: SetOption = None,
    samples: Annotated[int, typer.Option("--samples", min=0, help="Inputs drawn besides the scene's.")] = 8,
    seed: SeedOption = 0,
    accuracy: Annotated[
        float,
        numeric("--accuracy", "Motions this near count as alike, as a part of the scene's extent."),
    ] = 0.01,
    duration: Annotated[
        float | None,
        numeric("--time", "End of the runs; if not given, when the last rung has come to an end."),
    ] = None,
    threads: ThreadsOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the answer, and a file for each counterexample.")
    ] = None,
    as_json: JsonOption = False,
) -> int:  # fmt: skip
    """How far the models are apart on a scene: the paper's Table 1, with numbers. SCENE may be a saved
    counterexample: its two runs are repeated."""
    from rungwise.hierarchy.compare import compare as measure
    from rungwise.hierarchy.counterexample import saved

    if saved(scene):
        return _replay(Path(scene), as_json)
    try:
        with plain_errors():
            if out is not None:
                writable(out)
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
    if out is not None:
        try:
            found.save(out)
        except OSError as error:
            refuse(f"out: {out} cannot be written ({error.strerror or error})")
    show_json(found.summary()) if as_json else show(str(found))
    return 0 if found.ok else 1


def _replay(file: Path, as_json: bool) -> int:
    """Repeat both runs of a counterexample; the answer is positive where they are as far apart as before."""
    from rungwise.hierarchy.counterexample import load_counterexample

    with plain_errors():
        example = load_counterexample(file)
        runs = example.replay()
    away = example.apart(*runs)
    same = abs(away - example.distance) <= SAME * example.distance
    if as_json:
        told = {"words": example.words, "distance": away, "saved": example.distance, "ok": same}
        show_json(told | {"runs": [run.summary() for run in runs]})
    else:
        show(f"{example.scene.name}: {example.words}")
        for run in runs:
            show(f"  {run.model.name} at epsilon {run.model.inertia:g}: {run.outcome} at {run.time:.6g}")
        show(f"  {away:.3g} apart; {example.distance:.3g} when it was saved")
    return 0 if same else 1
