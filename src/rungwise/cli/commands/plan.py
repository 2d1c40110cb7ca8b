"""`rungwise plan`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli import arguments as arg
from rungwise.cli import progress
from rungwise.cli.terminal import INTERRUPTED, answer, note, plain_errors, refuse

RUNGS = (
    "geometric", "kinematic", "quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid",
    "dynamic-compliant",
)  # fmt: skip


def plan(
    scene: arg.SceneArgument,
    from_: Annotated[
        str | None,
        arg.rung("First rung; the plan climbs from it, rung by rung.", "--from"),
    ] = None,
    to: Annotated[str, arg.rung("Rung on which the plan must hold.", "--to")] = "dynamic-compliant",
    schedule: Annotated[
        str | None,
        typer.Option(
            "--schedule",
            help="coarse-fine, quasistatic, climb or direct; or stages RUNG[@ACCURACY], separated by commas."
            " Default: the task's own.",
        ),
    ] = None,
    budget: Annotated[
        int, typer.Option("--budget", min=1, help="Greatest number of simulated steps.")
    ] = 1_250_000,
    limit: arg.LimitOption = None,
    improve: Annotated[
        int, typer.Option("--improve", min=0, help="Simulated steps spent on reducing the cost of the plan.")
    ] = 0,
    robust: Annotated[
        float | None,
        arg.numeric(
            "--robust",
            "Rate of success: open loop, with guarded moves or re-planning; the first that suffices.",
            metavar="RATE",
        ),
    ] = None,
    samples: Annotated[
        int, typer.Option("--samples", min=1, help="Number of samples that prove the rate.")
    ] = 200,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the searches.")] = 0,
    task_seed: Annotated[
        int | None,
        typer.Option("--task-seed", min=0, help="Seed for drawing an instance by the task's rules."),
    ] = None,
    values: arg.SetOption = None,
    settle: arg.SettleOption = False,
    initial: Annotated[Path | None, arg.path("--initial", "A saved plan to begin with.")] = None,
    out: Annotated[
        Path | None, arg.path("--out", "File for the plan (JSON); not written without one.")
    ] = None,
    force: arg.ForceOption = False,
    table: Annotated[Path | None, arg.path("--csv", "CSV file for the inputs over time.")] = None,
    as_json: arg.JsonOption = False,
) -> int:
    """Plan the task of a scene, from cheap to rich models. The answer explains on which models the plan
    fails.

    Example: rungwise plan push --task-seed 3 --out plan.json

    Ctrl-C keeps the plan of the last finished stage."""
    from rungwise.planning.lift.lift import INTERRUPTED as STOPPED
    from rungwise.planning.lift.lift import plan as search
    from rungwise.planning.plan import PLACES_ONLY

    arg.unused_files(force, out=out, csv=table)
    for file in (out, table):
        if file is not None:
            arg.writable_file(file)
    with plain_errors(), progress.line(as_json) as told:
        loaded = arg.load_scene(scene, settle)
        found = search(
            loaded, from_=from_, to=to, schedule=_stages(schedule), budget=budget, limit=limit,
            improve=improve, robust=robust, samples=samples, seed=seed, task_seed=task_seed,
            parameters=arg.given_values(loaded, values),
            initial=None if initial is None else arg.load_plan_file(initial),
            on_progress=told,
        )  # fmt: skip
    try:
        if out is not None and found.stage is not None:
            found.save(out)
        elif out is not None:
            note(f"{out} was not written, because there is no plan")
        if table is not None and found.segments:
            table.write_text(found.timetable(), "utf-8")
        elif table is not None and found.found:
            refuse(f"csv: {PLACES_ONLY}")
    except OSError as error:
        refuse(f"out: {error.filename} cannot be written ({error.strerror or error})")
    answer(found, as_json)
    if found.reason.startswith(STOPPED):
        return INTERRUPTED
    return 0 if found.found else 1


def _stages(text: str | None) -> str | list[str | tuple[str, float]] | None:
    """A schedule's name, or its stages."""
    if text is None:
        return None
    parts = [part.strip().partition("@") for part in text.split(",")]
    if len(parts) == 1 and not parts[0][1] and parts[0][0] not in RUNGS:
        return text
    return [name if not at else (name, _accuracy(accuracy)) for name, at, accuracy in parts]


def _accuracy(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        refuse(f"schedule: an accuracy must be a number, not {text[:60]!r}")
